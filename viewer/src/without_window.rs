//! Stands in for the window where this package is built without its cargo feature `window`, as the demo builds it.

use crate::error::ViewerError;
use crate::scene::scene::Scene;
use crate::window_params::WindowParams;

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
