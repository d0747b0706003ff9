//! Parallel rays through models and volumes.

pub(crate) mod along_ray;
pub(crate) mod march;
pub(crate) mod occluder;
pub(crate) mod projection;
