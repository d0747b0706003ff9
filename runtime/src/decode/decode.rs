//! The decoder: from texel, light and eye to reflectance times cosine. Twin: `decode/decode.wgsl`.

use crate::decode::options::DecodeOptions;
use crate::decode::viewed_texel::ViewedTexel;
use crate::resident::resident::Resident;
use crate::resident::single::SingleBases;

/// Reflectance times cosine times pi of `texel` in `layer` of a resident asset, linear RGB, at least 0.
///
/// `wi` points to the light, `wo` to the eye, both unit, in the texel's frame. A light or an eye on
/// another side than the layer's gives 0. `layer` and `texel` must be within the asset. For several lights see
/// [`ViewedTexel`].
pub fn decode(
    resident: &Resident,
    layer: u32,
    texel: u32,
    wi: [f32; 3],
    wo: [f32; 3],
    options: &DecodeOptions,
) -> [f32; 3] {
    ViewedTexel::new(resident, layer, texel, wo, options).light_alone(wi)
}

/// The same with bases in single precision: twice the memory for the resident form's largest part.
/// `bases` must be of the same asset, and `layer` at the finest level.
pub fn decode_single(
    resident: &Resident,
    bases: &SingleBases,
    layer: u32,
    texel: u32,
    wi: [f32; 3],
    wo: [f32; 3],
    options: &DecodeOptions,
) -> [f32; 3] {
    ViewedTexel::new_single(resident, bases, layer, texel, wo, options).light_alone(wi)
}
