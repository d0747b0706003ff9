//! Parameters of the window, in builds with and without it.

use crate::gpu::backend::BackendChoice;
use crate::options::ShadeOptions;
use crate::scene::asset::SceneAsset;
use std::sync::Arc;

/// Parameters that the window starts with.
#[derive(Debug, Clone)]
pub struct WindowParams {
    /// Width and height, pixels; the last run's where there is none.
    pub size: Option<[u32; 2]>,
    /// Which renderer; the panel switches it.
    pub backend: BackendChoice,
    /// Part of the adapter's name, where there are several.
    pub adapter: Option<String>,
    /// Settings that trade time for accuracy; the panel changes them.
    pub shade: ShadeOptions,
    /// Milliseconds that a frame may take; components, lobes and lights are what is saved.
    pub target_ms: Option<f64>,
    /// Megabytes that volumes may take: they are drawn coarser where they would take more.
    pub volume_budget_mb: u32,
    /// What the split view shows in place of the scene's first leaf, or first asset.
    pub compare: Option<Arc<SceneAsset>>,
}
