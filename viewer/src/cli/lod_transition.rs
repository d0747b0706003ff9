//! `--lod-transition`: where meshes pass into the volumes that stand in for them.

use super::parse::Transition;
use super::progress::with_progress;
use super::scene_options::PictureArguments;
use btf_viewer::{
    RenderParams, Scene, TransitionCost, USUAL_TRANSITION_PIXELS, ViewerError, cheapest, least_cost,
    measure_transitions,
};
use std::fmt;

/// Where meshes pass into volumes, and what was measured for it; a key of `--json`.
#[derive(Debug, Clone, serde::Serialize)]
pub(super) struct TransitionReport {
    /// Width of leaves, pixels.
    pixels: f32,
    /// Costs of all that were compared; empty where it was given.
    measured: Vec<TransitionCost>,
}

/// Gives the scene the transition that is asked for. Returns it where volumes stand in for meshes.
///
/// # Errors
/// [`ViewerError::Usage`] where one is asked for and no volume stands in for a mesh; those of [`measure_transitions`].
pub(super) fn choose_transition(
    scene: &mut Scene,
    arguments: &PictureArguments,
    params: &RenderParams,
) -> Result<Option<TransitionReport>, ViewerError> {
    let asked = arguments.lod_transition;
    if !scene.has_transitions() {
        return match asked {
            None => Ok(None),
            Some(_) => Err(ViewerError::Usage(
                "--lod-transition needs meshes for which volumes stand in: give `btf-view scene` the plants' models with \
                 --mesh, or a [[volume]] of the scene's file its mesh"
                    .into(),
            )),
        };
    }
    let (pixels, measured) = match asked.unwrap_or(Transition::Pixels(USUAL_TRANSITION_PIXELS)) {
        Transition::Pixels(pixels) => (pixels, Vec::new()),
        Transition::Auto => {
            let quiet = arguments.render.quiet;
            let costs = with_progress(quiet, |control| measure_transitions(scene, params, control))?;
            (cheapest(&costs), costs)
        }
    };
    scene.scale_transitions(1.0 / pixels);
    Ok(Some(TransitionReport { pixels, measured }))
}

impl fmt::Display for TransitionReport {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let least = least_cost(&self.measured);
        for own in &self.measured {
            let TransitionCost { pixels, frame_ms, variance } = own;
            let chosen = if *pixels == self.pixels { ", taken" } else { "" };
            writeln!(
                f,
                "meshes from leaves of {pixels:.3} pixels on: {frame_ms:.1} ms a frame, variance {variance:.5}, {:.2} times \
                 the least time to a noise{chosen}",
                own.cost() / least
            )?;
        }
        Ok(())
    }
}
