//! Other formats.

pub(crate) mod gltf;
pub(crate) mod ktx2;
pub(crate) mod openpbr;
pub(crate) mod pairs;
pub(crate) mod png;
pub(crate) mod usd;
