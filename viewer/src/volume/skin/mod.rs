//! The thick skin on which volumetric textures lie [Neyret 1996, section 4]: what a user maps, the tetrahedra that rays
//! walk through, and the texels that they meet in texture space.
//!
//! ```text
//! Skin --Jitter, Wind, layers--> Skin --Shell::new--> Shell --Walk--> Interval --CellWalk--> CellSpan --Pattern-->
//! Variant vertices, faces of 3 or 4      again                tetrahedra      t0, t1, tet           one texel
//! its volume
//! ```
//!
//! Three spaces [Neyret 1996, section 4.1]: the world (x, y, z); the skin's own (U, V, W), U and V within a face, W
//! from 0 on the face to 1 on top of the height vectors; the texture's (u, v, w), where texel (i, j) is the unit cube i
//! <= u <= i + 1, j <= v <= j + 1, 0 <= w <= 1. Within a tetrahedron the map from the world to the texture is affine,
//! so a straight ray stays straight: `o + t d`, d not unit.

mod cell;
mod height_noise;
mod jitter;
mod layers;
mod levels;
mod pattern;
mod place;
mod refine;
mod shell;
mod shell_words;
#[cfg(test)]
mod testing;
mod thick_skin;
mod walk;
mod weld;
mod wind;

pub use cell::{CellSpan, CellWalk};
pub use height_noise::Noise;
pub use jitter::Jitter;
pub use layers::LayerSpan;
pub use levels::ShellLevel;
pub use pattern::{CellMap, DiscreteJitter, MAX_MERGED, Merged, NO_VOLUME, Pattern, Variant, pattern_words};
pub(crate) use place::{SkinPlace, TetPoint};
pub use refine::ShellParams;
pub use shell::{NO_LINK, Shell, ShellReport, Tet};
pub use thick_skin::{Corners, Skin, SkinFace, SkinVertex};
pub use walk::{Interval, TextureMap, TextureRay, Walk};
pub use wind::Wind;

#[cfg(feature = "controls")]
pub(crate) use wind::MAX_WIND_SPEED;

#[cfg(test)]
pub(crate) use {
    cell::CONSTANTS as CELL_CONSTANTS, cell::MAX_CELLS, pattern::CONSTANTS as PATTERN_CONSTANTS,
    shell_words::CONSTANTS as SHELL_CONSTANTS, walk::CONSTANTS as WALK_CONSTANTS,
};
