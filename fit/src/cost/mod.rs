//! Cost of a fit, told before it runs: processor time, memory and disk.

pub(crate) mod image_probe;
pub(crate) mod model;
pub(crate) mod training;
pub(crate) mod work;
