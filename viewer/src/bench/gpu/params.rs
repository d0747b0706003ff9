//! What the measurement of a GPU is asked for.

use crate::gpu::backend::GpuTracer;
use crate::scene::asset::SceneAsset;
use std::path::PathBuf;
use std::sync::Arc;

/// Parameters of the measurement of a GPU.
#[derive(Debug, Clone, Default)]
pub struct GpuBenchParams {
    /// Assets that the scenes show in turn, at least one.
    pub assets: Vec<Arc<SceneAsset>>,
    /// Model that canopies are made of; where there is none, a plant that comes with the viewer.
    pub mesh: Option<PathBuf>,
    /// Folder with the models of the landscapes' plants, for which volumes stand in.
    pub plants: Option<PathBuf>,
    /// Part of the adapter's name, where there are several.
    pub adapter: Option<String>,
    /// How rays are traced; where it is not said, by ray queries if the adapter has them.
    pub tracer: Option<GpuTracer>,
    /// Whether pictures, assets and canopies are small, so that a software driver is done in a minute or two.
    pub quick: bool,
}
