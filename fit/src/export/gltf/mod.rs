//! glTF files with a fitted fallback material (docs/reference/gltf.md).

pub(crate) mod brdf;
pub(crate) mod document;
pub(crate) mod fit;
pub(crate) mod textures;
