//! From measured spectra, or a capture, to the contents of a leaf.

pub(crate) mod body_shares;
pub(crate) mod diffuse_colour;
pub(crate) mod digits;
pub(crate) mod forward;
pub(crate) mod halves;
pub(crate) mod invert;
pub(crate) mod least_squares;
pub(crate) mod maps;
pub(crate) mod mean_spectra;
pub(crate) mod outcome;
pub(crate) mod plates;
pub(crate) mod remarks;
pub(crate) mod simulated;
pub(crate) mod spectra;
pub(crate) mod spectra_file;
pub(crate) mod tissue;
pub(crate) mod whitening;
