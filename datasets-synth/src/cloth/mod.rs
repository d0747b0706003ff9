//! Woven cloth: weaves, yarns, the fibres that they are spun of, and the capture of a patch.

pub(crate) mod capture;
pub(crate) mod fabric;
pub(crate) mod fibre;
pub(crate) mod params;
pub(crate) mod weave;
pub(crate) mod yarn;
