//! The decoder: from texel, light and eye to reflectance times cosine. Twin: `decode/decode.wgsl`.

use crate::decode::options::DecodeOptions;
use crate::decode::viewed_texel::ViewedTexel;
use crate::resident::resident::Resident;
use crate::resident::single::SingleBases;

/// Decodes the value of a texel of a resident asset: reflectance times cosine times pi, linear RGB, at least 0.
///
/// `wi` points to the light, `wo` to the eye, both unit, in the texel's frame. The value is 0 where the light or the
/// eye is on another side than the layer's. `layer` and `texel` must be within the asset. [`ViewedTexel`] is cheaper
/// for several lights.
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

/// Decodes the value of a texel like [`decode`], with bases in single precision, which take twice the memory. `bases`
/// must be of the same asset, and `layer` at the finest level.
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
