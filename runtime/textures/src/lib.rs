//! Draws with nothing of an asset but its block-compressed textures, those of `btf-fit export-ktx2 --bc`
//! (docs/reference/ktx2-filtered.md).
//!
//! The decoder is a text to paste into a shader, [`GLSL`] or [`HLSL`]: it needs six bindings and no library of ours. What
//! else is here loads the files for wgpu, as an example for other engines; `examples/draw.rs` makes a picture of them.

mod files;
mod gpu;

pub use files::{Texture, TextureError, Textures, read_textures};
pub use gpu::{FEATURES, Uploaded, limits, upload};

/// The decoder in GLSL: the function `vec3 btf(vec2 uv, float lod, vec3 wi, vec3 wo)`.
pub const GLSL: &str = include_str!("../btf_textures.glsl");
/// The decoder in HLSL: the function `float3 btf(float2 uv, float lod, float3 wi, float3 wo)`.
pub const HLSL: &str = include_str!("../btf_textures.hlsl");
