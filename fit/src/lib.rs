//! Fits a capture and packs it, measures what was packed, expands it again and reports.

mod cache;
mod sparse;
mod project;
mod pipeline;
mod local_pca;
mod lasso;
mod kmeans;
mod holdout;
mod factor;
mod encode;
mod dictionary;
mod curve;
mod candidates;
mod budget;
mod ciede;
mod error;
mod image_decoder;
mod material;
mod metrics;
mod monitor;
mod params;
#[cfg(test)]
mod sample_asset;

pub use cache::{Mapping, Tile, TileCache};
pub use ciede::{Lab, LabConverter, delta_e00};
pub use error::FitError;
pub use image_decoder::{ImageDecoder, PairPlan, SAME_DIRECTION_DEG, Spot, TexelBlock};
pub use material::{
    CaptureRecord, FitRecord, Material, MaterialLayer, layer_directions, side_of_layer, sides_of_capture,
};
pub use metrics::{ErrorSums, Metrics, psnr_db_from_codes};
pub use monitor::{Monitor, Stage};
pub use params::{ErrorMeasure, FitOutcome, FitParams, KMeansEngine};
pub use kmeans::{Clustering, kmeans};
pub use lasso::{LassoParams, LassoPoint, LassoProblem, coordinate_descent, non_negative_weights, stagewise_lasso};
pub use pipeline::{MATERIAL_RESERVE, fit};
