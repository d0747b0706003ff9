//! Fits a capture and packs it; measures what was packed, expands it again and reports.
//!
//! ```text
//! Capture --TileCache--> features --kmeans--> clusters --stagewise_lasso--> dictionaries
//!         --> lobes and weights per texel --> factored residual --fit--> Asset
//! Capture + Asset --measure--> Comparison --> Metrics, error maps, report
//! Asset --expand--> capture folder
//! Capture --trade--> bytes, error and time over a grid of settings
//! Asset --export_materialx--> OpenPBR Surface with textures, as a MaterialX document
//! Asset --export_usd--> the same and UsdPreviewSurface, as an OpenUSD layer or package
//! Asset --export_ktx2--> planes and bases as KTX2 textures
//! Asset --fit_gltf--> textures of a glTF material --export_gltf--> .glb that points at the asset
//! ```
//!
//! [`fit_and_measure`] is the whole job. Every stage reads linear reflectance x cosine; 8-bit values
//! exist only where the error of a file is counted ([`Metrics`]). Without a GPU results do not depend on the number
//! of threads, and memory stays within [`FitParams::memory_bytes`].

mod cost;
mod error;
mod export;
mod gpu;
mod input;
mod inspect;
mod library;
mod matrix_product;
mod measure;
mod metrics;
mod monitor;
mod numeric;
mod output_path;
mod params;
mod peak_memory;
mod pipeline;
mod priors;
mod provenance;
mod report;
mod resume;
#[cfg(test)]
mod sample_asset;
mod spectral;
mod stages;
mod trade;

pub use btf_capture::{bytes_from_text, text_from_bytes};
pub use cost::image_probe::ImageProbe;
pub use cost::model::{CostModel, FitCost, product_gflops};
pub use cost::training::{MeasuredFit, learn_cost};
pub use cost::work::FitWork;
pub use error::FitError;
pub use export::gltf::brdf::{GltfTexel, Sheen};
pub use export::gltf::document::{AssetPlace, EXTENSION, GltfExport, export_gltf};
pub use export::gltf::fit::{GltfFit, MIN_SAVED, Maps, TriedPart, fit_gltf};
pub use export::gltf::textures::{GltfImage, GltfTextures};
pub use export::ktx2::file::{Ktx2Array, Ktx2Format};
pub use export::ktx2::filtered::error::LayerError;
pub use export::ktx2::filtered::export::{FilteredExport, FilteredFigures, FilteredParams, export_filtered};
pub use export::ktx2::planes::{KTX2_KEY, Ktx2Export, export_ktx2};
pub use export::openpbr::export::{MaterialXExport, OpenPbrFigures, export_materialx};
pub use export::openpbr::fit::{OpenPbrFit, fit_openpbr};
pub use export::openpbr::materialx::{MaterialXNames, materialx_document};
pub use export::openpbr::model::OpenPbrTexel;
pub use export::openpbr::textures::{OpenPbrTexture, OpenPbrTextures};
pub use export::usd::export::{UsdExport, export_usd};
pub use gpu::device::GpuChoice;
pub use gpu::speed::{GemmBench, ProductSpeed, bench_gemm};
pub use input::layer_frame::{capture_directions, layer_directions, side_of_layer, sides_of_capture};
pub use input::tile_cache::{Mapping, Tile, TileCache};
pub use inspect::convert::{Shape, convert};
pub use inspect::describe::{Description, FamilyUse, LayerDescription, TierDescription, describe, family_name};
pub use inspect::describe_file::{FileDescription, describe_file};
pub use inspect::describe_resident::{ResidentDescription, describe_resident};
pub use inspect::describe_voltex::{
    LevelDescription, MaterialUse, VoltexDescription, VoltexTier, describe_voltex, load_voltex,
};
pub use inspect::load::{
    load_asset, packed_in_parallel, read_file, resident_in_parallel, unpacked_in_parallel, with_path,
};
pub use inspect::lobe_use::LobeUse;
pub use inspect::sections::SectionSize;
pub use inspect::validate::{FindingCounts, FindingRecord, Validation, validate, validate_file, validate_voltex};
pub use library::catalogue::{catalogue_csv, catalogue_html};
pub use library::collect::{CollectedMaterial, Library, Status, collect_library};
pub use library::discover::{discover_captures, glob_from_text};
pub use library::estimate::{LibraryEstimate, MaterialCost, estimate_library};
pub use library::likeness::Likeness;
pub use library::options::MaterialOptions;
pub use library::plan::{LibraryPlan, PlanRule, PlannedMaterial};
pub use library::record::FittedMaterial;
pub use library::run::{RunNews, RunOutcome, RunParams, run_library};
pub use library::scripts::{Scheduler, WorkerLimits, library_script};
pub use measure::compare::{
    Comparison, MeasureParams, colour_pair_stride, layer_for_capture, measure, measure_images, side_words,
};
pub use measure::expand::{ExpandParams, expand, expand_info};
pub use measure::heatmap::{Raster, scale_top, viridis, write_heatmaps};
pub use measure::image_decoder::{ImageDecoder, PairPlan, SAME_DIRECTION_DEG, Spot};
pub use measure::texel_tiles::{BasisWeights, RowWord, TILE_TEXELS, TexelTile, TileRgb};
pub use metrics::{ErrorSums, Metrics, psnr_db_from_codes};
pub use monitor::{Monitor, Stage};
pub use output_path::{output_fault, real_path};
pub use params::{ErrorMeasure, FitParams, Goal, KMeansEngine, Priors, Role, ValidFitParams};
pub use peak_memory::peak_memory_bytes;
pub use pipeline::description::description_bytes;
pub use pipeline::fit::fit;
pub use pipeline::fitted::{Fitted, fit_and_measure};
pub use pipeline::forecast::{Forecast, LastStage, Left};
pub use pipeline::outcome::FitOutcome;
pub use priors::learn::prior_capture;
pub use priors::propose::{ProposeParams, propose_directions};
pub use provenance::{CaptureRecord, FitRecord, Material, MaterialLayer};
pub use report::report::{ReportInput, ReportLayer, report_html};
pub use resume::checkpoint::remove_finished_stages;
pub use spectral::basis::SpectralBasis;
pub use spectral::measure::measure_capture;
pub use stages::kmeans::{Clustering, kmeans};
pub use stages::lasso::{
    LassoParams, LassoPoint, LassoProblem, coordinate_descent, non_negative_weights, stagewise_lasso,
};
pub use stages::lobe_dictionaries::LobeFigures;
pub use trade::page::{trade_csv, trade_html, trade_plots};
pub use trade::params::TradeParams;
pub use trade::pareto::{CostAndGain, pareto_front};
pub use trade::point::{Limit, Precision, Rule, TradePoint};
pub use trade::trade::{Trade, trade};
