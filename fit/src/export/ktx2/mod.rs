//! KTX2 textures (docs/reference/ktx2.md).

pub(crate) mod file;
pub(crate) mod filtered;
pub(crate) mod planes;
