//! Colour: transfer curves, spectra, colour differences.

pub mod cie;
pub mod ciede;
pub(crate) mod illuminant;
pub(crate) mod spectrum;
pub(crate) mod transfer;
