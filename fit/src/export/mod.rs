//! Other formats.

pub(crate) mod gltf;
pub(crate) mod ktx2;
