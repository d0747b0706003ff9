//! Stands in for the window where this package is built without its cargo feature `window`, as the demo builds it.

use crate::error::ViewerError;
use crate::gpu::backend::BackendChoice;
use crate::options::ShadeOptions;
use crate::scene::asset::SceneAsset;
use crate::scene::scene::Scene;
use std::sync::Arc;

/// Parameters of the window, with the same fields as in a build with the window.
pub struct WindowParams {
    /// Width and height in pixels.
    pub size: Option<[u32; 2]>,
    /// The renderer.
    pub backend: BackendChoice,
    /// Part of the adapter's name, where there are several.
    pub adapter: Option<String>,
    /// Settings that trade time for accuracy.
    pub shade: ShadeOptions,
    /// Milliseconds that a frame may take.
    pub target_ms: Option<f64>,
    /// What the split view would show in place of the scene's first leaf, or first asset.
    pub compare: Option<Arc<SceneAsset>>,
}

/// Refuses to open a window.
///
/// # Errors
/// [`ViewerError::Usage`] always.
pub fn run_window(_: Scene, _: WindowParams) -> Result<(), ViewerError> {
    Err(ViewerError::Usage(
        "this btf-view was built without its window: give --out FILE for a picture, or build it with its cargo feature \
         `window`"
            .into(),
    ))
}
