//! Fits a capture and packs it; measures what was packed, expands it again and reports.
//!
//! ```text
//! Capture --TileCache--> features --kmeans--> clusters --stagewise_lasso--> dictionaries
//!         --> lobes and weights per texel --> factored residual --fit--> Asset
//! Capture + Asset --measure--> Comparison --> Metrics, error maps, report
//! Asset --expand--> capture folder
//! Capture --trade--> bytes, error and time over a grid of settings
//! Asset --export_ktx2--> planes and bases as KTX2 textures
//! Asset --fit_gltf--> textures of a glTF material --export_gltf--> .glb that points at the asset
//! ```
//!
//! [`fit_and_measure`] is the whole job. Every stage reads linear reflectance x cosine; 8-bit values
//! exist only where the error of a file is counted ([`Metrics`]). Results do not depend on the number of
//! threads, and memory stays within [`FitParams::memory_bytes`].

mod budget;
mod byte_size;
mod cache;
mod candidates;
mod checkpoint;
mod compare;
mod convert;
mod coordinates;
mod curve;
mod describe;
mod describe_voltex;
mod dictionary;
mod encode;
mod error;
mod evaluation_time;
mod expand;
mod export_gltf;
mod export_ktx2;
mod factor;
mod fitted;
mod forecast;
mod frame;
mod gltf_brdf;
mod gltf_fit;
mod gltf_textures;
mod gpu_clock;
mod heatmap;
mod heights;
mod holdout;
mod image_decoder;
mod kmeans;
mod ktx2_file;
mod lasso;
mod local_pca;
mod material;
mod memory;
mod metrics;
mod monitor;
mod page;
mod params;
mod pareto;
mod pipeline;
mod plot;
mod project;
mod report;
mod residual_source;
#[cfg(test)]
mod sample_asset;
mod sparse;
mod stored;
mod texel_sample;
mod texel_tiles;
mod thinned_grid;
mod tile_errors;
mod trade;
mod trade_grid;
mod trade_page;
mod validate;
pub mod voltex;

pub use byte_size::{bytes_from_text, text_from_bytes};
pub use cache::{Mapping, Tile, TileCache};
pub use checkpoint::remove_finished_stages;
pub use compare::{
    Comparison, MeasureParams, colour_pair_stride, layer_for_capture, measure, measure_images, side_words,
};
pub use convert::{Shape, convert};
pub use describe::{
    Description, FamilyUse, FileDescription, LayerDescription, ResidentDescription, SectionSize, TierDescription,
    describe, describe_file, describe_resident, family_name, load_asset, read_file, resident_in_parallel, with_path,
};
pub use describe_voltex::{LevelDescription, MaterialUse, VoltexDescription, VoltexTier, describe_voltex, load_voltex};
pub use error::FitError;
pub use expand::{ExpandParams, expand, expand_info};
pub use export_gltf::{AssetPlace, EXTENSION, GltfExport, export_gltf};
pub use export_ktx2::{KTX2_KEY, Ktx2Export, export_ktx2};
pub use fitted::{Fitted, fit_and_measure};
pub use forecast::{Forecast, Left};
pub use frame::{capture_directions, layer_directions};
pub use gltf_brdf::{GltfTexel, Sheen};
pub use gltf_fit::{GltfFit, LEAST_SAVED, Maps, TriedPart, fit_gltf};
pub use gltf_textures::{GltfImage, GltfTextures};
pub use gpu_clock::GpuChoice;
pub use heatmap::{Raster, scale_top, viridis, write_heatmaps};
pub use image_decoder::{ImageDecoder, PairPlan, SAME_DIRECTION_DEG, Spot};
pub use kmeans::{Clustering, kmeans};
pub use ktx2_file::{Ktx2Array, Ktx2Format};
pub use lasso::{LassoParams, LassoPoint, LassoProblem, coordinate_descent, non_negative_weights, stagewise_lasso};
pub use material::{CaptureRecord, FitRecord, Material, MaterialLayer, side_of_layer, sides_of_capture};
pub use memory::peak_memory_bytes;
pub use metrics::{ErrorSums, Metrics, psnr_db_from_codes};
pub use monitor::{Monitor, Stage};
pub use params::{ErrorMeasure, FitOutcome, FitParams, KMeansEngine, LobeFigures};
pub use pareto::{CostAndGain, pareto_front};
pub use pipeline::{description_bytes, fit};
pub use report::{ReportInput, ReportLayer, report_html};
pub use texel_tiles::{BasisWeights, RowWord, TILE_TEXELS, TexelTile, TileRgb};
pub use trade::{Limit, Precision, Role, Rule, Trade, TradeParams, TradePoint, trade};
pub use trade_page::{trade_csv, trade_html, trade_plots};
pub use validate::{FindingCounts, FindingRecord, Validation, validate, validate_file, validate_voltex};
