//! Builds volumetric textures: flakes gathered into voxels, filtered to levels, refitted to what rays see.

pub mod clip;
pub mod extinction;
pub mod flakes;
pub mod gather;
pub mod occluder;
pub mod refit;
pub mod shapes;
