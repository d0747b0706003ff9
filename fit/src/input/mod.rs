//! Input of a fit: captures turned into blocks of texels, in the frame of the asset.

pub(crate) mod brightness;
pub(crate) mod layer_frame;
pub(crate) mod pair_stride;
pub(crate) mod residual_curve;
pub(crate) mod rounds;
pub(crate) mod texel_sample;
pub(crate) mod tile_cache;
pub(crate) mod tone_curve;
