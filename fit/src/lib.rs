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
mod byte_size;
mod ciede;
mod compare;
mod describe;
mod error;
mod expand;
mod fitted;
mod heatmap;
mod image_decoder;
mod material;
mod memory;
mod metrics;
mod monitor;
mod params;
mod plot;
mod report;
#[cfg(test)]
mod sample_asset;

pub use byte_size::{bytes_from_text, text_from_bytes};
pub use cache::{Mapping, Tile, TileCache};
pub use ciede::{Lab, LabConverter, delta_e00};
pub use compare::{Comparison, MeasureParams, colour_pair_stride, layer_for_capture, measure, measure_images};
pub use describe::{
    Description, FamilyUse, LayerDescription, SectionSize, TierDescription, describe, describe_file, family_name,
    load_asset, resident_in_parallel, validate, validate_file,
};
pub use error::FitError;
pub use expand::{ExpandParams, expand, expand_info};
pub use fitted::{Fitted, fit_and_measure};
pub use heatmap::{Raster, scale_top, viridis, write_heatmaps};
pub use image_decoder::{ImageDecoder, PairPlan, SAME_DIRECTION_DEG, Spot, TexelBlock};
pub use material::{
    CaptureRecord, FitRecord, Material, MaterialLayer, layer_directions, side_of_layer, sides_of_capture,
};
pub use memory::peak_memory_bytes;
pub use metrics::{ErrorSums, Metrics, psnr_db_from_codes};
pub use monitor::{Monitor, Stage};
pub use report::{ReportInput, ReportLayer, report_html};
pub use params::{ErrorMeasure, FitOutcome, FitParams, KMeansEngine, LobeFigures};
pub use kmeans::{Clustering, kmeans};
pub use lasso::{LassoParams, LassoPoint, LassoProblem, coordinate_descent, non_negative_weights, stagewise_lasso};
pub use pipeline::{MATERIAL_RESERVE, fit};
