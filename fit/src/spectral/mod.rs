//! Captures in spectral bands: three channels that tell the bands, and the error in bands.

pub(crate) mod basis;
pub(crate) mod measure;
pub(crate) mod non_negative;
