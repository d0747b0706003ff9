//! Volumetric textures: volumes of microflakes that replace a plant's geometry where its leaves are small in the
//! picture [Neyret 1996].
//!
//! Texture space is the unit cube. A voxel holds its microflakes as two matrices: the extinction matrix S, whose
//! `sqrt(d' S d)` is their area projected along d per volume (the microflake matrix of SGGX [Heitz 2015]), and the
//! moment N = sum of `a n n'`, by which light is reflected in closed form. Both are looked up at levels, each half as
//! fine as the one before.
//!
//! A volume is stored as a `.voltex` file, docs/reference/voltex.md.
//!
//! ```text
//! bytes <--pack, parse--> Volume (levels of voxels)
//! Volume (levels of voxels) --Voltex::new--> Voltex (words for the GPU, WGSL beside) --Walk--> segments --shade--> light
//! ```

mod bricked_file;
mod bricks;
mod build;
mod codes;
mod coding;
pub(crate) mod corrections;
mod error;
mod file;
pub(crate) mod gloss;
mod level_stream;
mod matrix;
pub(crate) mod node;
pub mod rule;
pub(crate) mod shade;
mod tree;
mod validate;
mod volume;
pub(crate) mod voxel;
mod walk;
pub mod words;

pub use crate::numeric::vector::{cross, dot};
pub use bricked_file::{BrickError, BrickedFile, ReadRange};
pub use bricks::{BRICK_LEVEL, BrickCount, MAX_WHOLE_LEVEL, level_of_brick};
pub use codes::VoxelCodes;
pub use corrections::facets::{FACETS, Facets, MAX_FACETS};
pub use corrections::light_correction::{LIGHT_TERMS, LightCorrection, MAX_BRIGHTER, MAX_LIGHT_COEFFICIENT};
pub use error::VoltexError;
pub use file::{MAX_MATERIALS, MAX_SIDE_M, VOLTEX_VERSION, VoltexHead, VoltexSection, read_voltex_directory};
pub use gloss::gloss;
pub use matrix::Sym3;
pub use node::NO_VOXEL;
pub use shade::{seen_at, shade};
pub use tree::Cell;
pub use validate::validate;
pub use volume::{
    HOTSPOT_DEG, LevelShadow, MAX_CLUMPING, MAX_LEVELS, MIN_SHARED, MicroflakeMaterial, Volume, VolumeLevel, order,
};
pub use voxel::{Voxel, moment_of};
pub use walk::{MIN_DIRECTION, Segment, VoltexRay, Walk};
pub use words::Voltex;
