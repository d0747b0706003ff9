//! Builds volumetric textures from meshes and scripts of shapes, and measures how well they stand for their models.
//!
//! ```text
//! TriangleModel | Canvas (painted script) --gather--> voxels of microflakes --filter--> levels --refit to rays-->
//! Volume TriangleModel + Volume --measure_voltex--> VoltexRow
//! ```
//!
//! Every level is fitted to what parallel rays past the model see: extinction, then shadows, then the specular lobe
//! [Neyret 1996; Heitz 2015]. docs/reference/voltex.md is the format.

mod build;
mod error;
mod measure;
mod model;
mod rays;
pub mod shapes;

pub use build::build::{VoltexParams, build_voltex};
pub use build::clip::{Polygon, clip_polygon, clip_triangle};
pub use build::extinction::extinction_of;
pub use build::gather::{Gather, VoxelSums};
pub use build::lit::{Lit, model_light};
pub use build::palette::Palette;
pub use build::refit::{RefitParams, refit};
pub use build::sggx_correction::{GlossTruth, GlossyMicroflake};
pub use build::shadow::{ShadowParams, fit_shadow};
pub use error::VoxelizeError;
pub use measure::ablations::Ablation;
pub use measure::measure::{AngleFigures, PixelFigures, TRIANGLE_BYTES, VoltexRow, VoltexTruth, measure_voltex};
pub use measure::simplify::simplify;
pub use model::frame::Frame;
pub use model::leaf_colour::{colour_of_asset, colour_of_leaf};
pub use model::light_table::LightTable;
pub use model::microflakes::{CellMicroflakes, DIRECTIONS, MicroflakeColour, MicroflakeSums, luminance};
pub use model::triangle_model::TriangleModel;
pub use rays::march::{March, MarchParams, Reflection};
pub use rays::occluder::{Met, Occluder};
pub use rays::projection::{HALF_SIDE, Projection, rays_of_pixel, spread_directions};
