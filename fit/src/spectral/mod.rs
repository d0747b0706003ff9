//! Captures in spectral bands: the channels that tell the bands, and the error in bands.

pub(crate) mod basis;
pub(crate) mod measure;
