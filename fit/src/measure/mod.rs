//! Error of a decoded asset against its capture.

pub(crate) mod batch_errors;
pub(crate) mod batch_sizes;
pub(crate) mod compare;
pub(crate) mod expand;
pub(crate) mod gpu_errors;
pub(crate) mod heatmap;
pub(crate) mod image_decoder;
pub(crate) mod texel_tiles;
pub(crate) mod thinned_grid;
pub(crate) mod tile_errors;
