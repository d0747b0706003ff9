//! glTF files with a fitted fallback material (docs/GLTF.md).

pub(crate) mod brdf;
pub(crate) mod document;
pub(crate) mod fit;
pub(crate) mod textures;
