//! Scripts of shapes, `NAME.shapes.toml`: models for volumetric textures, painted into a box stroke by stroke [Neyret
//! 1996, section 3].
//!
//! ```toml
//! [space]                         # the box that is painted; z is up, the texture's w
//! least_m = [0.0, 0.0, 0.0]
//! most_m = [0.2, 0.2, 0.1]
//! cyclic = [true, true]           # along x and y the box is one period: what leaves it on one side enters on the other
//!
//! [[materials]]
//! name = "blade"
//! reflectance = [0.05, 0.12, 0.03]   # hemispherical, linear, sRGB primaries; 0 to 1
//! transmittance = [0.04, 0.13, 0.02]
//! specular = 0.04                 # reflectance of the surface at normal incidence
//! roughness = 0.5
//!
//! [[materials]]
//! name = "petal"
//! from = "petal-leaf.toml"        # a leaf's description or an asset (.spmm) in place of the numbers
//! tint = { kind = "stripes", period_m = [0.0, 0.0, 0.01], colours = [[1.0, 1.0, 1.0], [0.9, 0.4, 0.4]] }
//!
//! [[strokes]]                     # in this order
//! material = "blade"
//! mode = "add"                    # add, subtract, set, normals; without it add
//! shapes = [
//!   { kind = "sphere", centre_m = [0.1, 0.1, 0.05], radius_m = 0.02 },
//!   { kind = "difference", of = [
//!     { kind = "box", least_m = [0.0, 0.0, 0.0], most_m = [0.02, 0.02, 0.02] },
//!     { kind = "cylinder", ends_m = [[0.01, 0.01, 0.0], [0.01, 0.01, 0.02]], radius_m = 0.005 },
//!   ] },
//! ]
//! ```
//!
//! [`Script`] is the file, [`Shape`] what can be drawn, [`PaintMode`] how, [`Material`] in what. Files that a script
//! names are relative to it. Unknown keys are refused, so that a misspelt key is noticed. Reading a script builds
//! nothing: distances, microflakes and voxels are made by the voxelizer.

mod check;
mod material;
mod noise;
mod point;
mod script;
mod script_file;
mod shape;

pub use material::{Material, Projection, Tint};
pub use noise::Noise;
pub use point::Point;
pub use script::{PaintMode, Script, Space, Stroke};
pub use script_file::{MAX_SCRIPT_BYTES, SCRIPT_ENDING};
pub use shape::{BlendElement, DensityData, MAX_NESTING, NumberType, ParticleSystem, Shape, Trail, UpAxis};
