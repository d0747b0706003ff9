//! KTX2 textures (docs/KTX2.md).

pub(crate) mod file;
pub(crate) mod planes;
