//! Comparison of volumes with their models.

pub(crate) mod ablations;
pub(crate) mod measure;
pub(crate) mod simplify;
