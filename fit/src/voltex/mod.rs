//! Builds volumetric textures: microflakes gathered into voxels, filtered to levels, refitted to what rays see.

pub mod ablations;
mod along;
pub mod build;
pub mod clip;
pub mod extinction;
pub mod facets;
pub mod gather;
pub mod march;
pub mod material;
pub mod measure;
pub mod microflakes;
pub mod model;
pub mod occluder;
pub mod palette;
pub mod projection;
pub mod refit;
pub mod shadow;
pub mod shapes;
pub mod simplify;
