//! Shows a scene: in a window, or as pictures in files.

use super::band_picture::write_bands;
use super::headless::{SceneReport, write_pictures};
use super::lod_transition::choose_transition;
use super::scene_options::{PictureArguments, see_scene};
use btf_viewer::{LandscapeCounts, RenderParams, Scene, SceneAsset, ViewerError, WindowParams, run_window};
use std::sync::Arc;

/// Writes the picture that the command line asks for, or opens a window. `compare` is the asset that the window's split
/// view shows; `counts` are those of a landscape.
///
/// # Errors
/// [`ViewerError::Usage`] where a time is given and nothing in the scene moves, and for assets that take more memory than
/// they may; those of [`run_window`] and of rendering.
pub(super) fn show(
    arguments: &PictureArguments,
    mut scene: Scene,
    compare: Option<Arc<SceneAsset>>,
    counts: Option<LandscapeCounts>,
) -> Result<(), ViewerError> {
    let render = &arguments.render;
    let (backend, adapter, shade) = (render.backend(), render.adapter.clone(), render.shade());
    let target_ms = arguments.target_ms.map(f64::from);
    if scene.wind.is_none() && (arguments.time.is_some() || arguments.sequence.is_some()) {
        return Err(ViewerError::Usage(
            "nothing moves in this scene: give `btf-view scene` a --wind, or the scene's file skins and a [wind]"
                .into(),
        ));
    }
    see_scene(&mut scene, arguments)?;
    render.pack(&mut scene.assets)?;
    scene.blow(arguments.time.unwrap_or(0.0))?;
    let params = RenderParams {
        size: arguments.size.unwrap_or([512, 512]),
        frames: arguments.frames,
        backend,
        adapter: adapter.clone(),
        shade,
        target_ms,
        denoise: arguments.denoise,
        motion: arguments.motion,
        volume_budget_mb: render.volume_budget,
    };
    let lod_transition = choose_transition(&mut scene, arguments, &params)?;
    match &arguments.out {
        Some(out) => {
            if arguments.bands {
                return write_bands(arguments, &mut scene, &params, out);
            }
            write_pictures(arguments, &scene, params, out, SceneReport { landscape: counts, lod_transition })
        }
        None => {
            let (size, volume_budget_mb) = (arguments.size, render.volume_budget);
            run_window(scene, WindowParams { size, backend, adapter, shade, target_ms, volume_budget_mb, compare })
        }
    }
}
