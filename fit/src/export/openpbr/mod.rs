//! OpenPBR Surface materials with fitted textures (docs/reference/materialx.md).

pub(crate) mod descent;
pub(crate) mod export;
pub(crate) mod fit;
pub(crate) mod graph;
pub(crate) mod materialx;
pub(crate) mod model;
pub(crate) mod real;
pub(crate) mod textures;
