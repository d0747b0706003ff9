//! Studies: what methods cost and how far off they are, as tables of the documentation; and what promises and benches
//! share.
//!
//! A module that promises use as well has its calculation in public functions, and `run` prints what they return.

pub mod bands;
pub mod bent_skins;
pub mod beside;
pub mod canopies;
pub mod denoise;
pub mod dolly;
mod embree;
pub mod fit_floor;
mod fixtures;
pub mod flicker;
pub mod irradiance;
pub mod landscape_costs;
pub mod leaf;
pub mod light_directions;
pub mod lobe_worth;
pub mod many_captures;
pub mod rays;
pub mod volume_costs;
pub mod voxel_bounds;

pub use fixtures::{
    absent, capture_from, capture_of, cloth_capture, fitted, gpu, leaf_capture, measured_data, resident, skip,
    small_fit,
};
