//! Block-compressed textures that samplers filter (docs/reference/ktx2-filtered.md).

pub(crate) mod bases;
pub(crate) mod bc4;
pub(crate) mod components;
pub(crate) mod error;
pub(crate) mod export;
pub(crate) mod layout;
pub(crate) mod light_map;
pub(crate) mod measured_rows;
pub(crate) mod planes;
pub(crate) mod view_map;
