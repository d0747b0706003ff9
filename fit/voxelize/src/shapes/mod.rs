//! Volumetric textures from a script of shapes ([`btf_models::shapes`]): its strokes painted into the finest voxels.
//!
//! Surfaces become facets that are cut at voxels' faces ([`Canvas::facet`]); solids are descended into and cut into
//! such facets ([`polygonise`]); limbs and strands are distributions of normals around their axes ([`Frustum`]); fields
//! are sampled ([`paint_field`]). [`paint`] does all of it, [`build_painted`] makes a volume of the canvas.

mod brush;
mod canvas;
mod descent;
mod field;
mod frustum;
mod fur;
mod ground;
mod noise;
mod paint;
mod particles;
mod solid;
mod surface;
mod tint;
mod volume;

pub use brush::{Brush, Coat};
pub use canvas::{CLOSED, Canvas, Facet};
pub use descent::{coverage, polygonise};
pub use field::{Field, Hypertexture, Scan, isotropic_microflakes, paint_field};
pub use frustum::{Frustum, round_microflakes};
pub use noise::NoiseField;
pub use paint::{Paints, coats_of, colour_of, paint};
pub use solid::{Placement, Solid};
pub use surface::{mesh_facets, sheet_facets};
pub use tint::TintMap;
pub use volume::build_painted;

use std::path::Path;

use crate::error::VoxelizeError;

/// Returns the error of a script, or of a file that it names, that cannot be used.
fn unusable(path: &Path, fault: String, remedy: &'static str) -> VoxelizeError {
    btf_models::ModelError::Shapes { path: path.into(), fault, remedy }.into()
}
