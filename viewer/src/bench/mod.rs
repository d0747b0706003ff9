//! How the time of a frame grows.

pub(crate) mod bench;
pub(crate) mod gpu;
pub(crate) mod instanced_scene;
pub(crate) mod leaf_modes;
pub(crate) mod params;
pub(crate) mod plot;
mod points;
mod report;
mod timing;
