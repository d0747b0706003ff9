//! Volumetric textures: volumes of microflakes that replace a plant's geometry where its leaves are small in the picture
//! [Neyret 1996], with what is known today.
//!
//! Texture space is the unit cube. A voxel holds the microflakes in it as two matrices: the extinction matrix S, whose
//! `sqrt(d' S d)` is their area projected along d per volume [Heitz 2015], and the moment N = sum of `a n n'`, by which
//! light is reflected in closed form. Both are looked up at levels, each half as fine as the one before.
//!
//! A volume is stored as a `.voltex` file, docs/reference/voltex.md.
//!
//! ```text
//! bytes <--pack, parse--> Volume (levels of voxels)
//! Volume (levels of voxels) --Voltex::new--> Voltex (words for the GPU, WGSL beside) --Walk--> segments --shade--> light
//! ```

mod codes;
mod coding;
mod error;
mod file;
mod gloss;
mod matrix;
pub mod rule;
mod shade;
mod tree;
mod validate;
mod volume;
mod voxel;
mod walk;
pub mod words;

pub use codes::VoxelCodes;
pub use error::VoltexError;
pub use file::{MAX_MATERIALS, MAX_SIDE_M, VOLTEX_VERSION, VoltexHead, VoltexSection, read_voltex_directory};
pub use gloss::{FACETS, Facets, MAX_DENSER, MAX_FACETS, MIN_HALF2, MIN_REFRACTED, MIN_ROUGHNESS, gloss};
pub use matrix::{Sym3, cross, dot};
pub use shade::{MIN_ROOT, SERIES_DEPTH, seen_at, shade};
pub use tree::{Cell, NO_VOXEL, NODE_WORDS};
pub use validate::validate;
pub use volume::{
    HOTSPOT_DEG, LevelShadow, MAX_CLUMPING, MAX_LEVELS, MIN_SHARED, MicroflakeMaterial, Volume, VolumeLevel, order,
};
pub use voxel::{OTHER_AT, VOXEL_WORDS, Voxel, moment_of};
pub use walk::{MIN_DIRECTION, Segment, VoltexRay, Walk};
pub use words::Voltex;
