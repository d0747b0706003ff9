//! Where meshes should pass into the volumes that stand in for them on a GPU: what landscapes cost by the width of leaves there.

use crate::bench::gpu::params::GpuBenchParams;
use crate::bench::gpu::rows::{Rows, row_of};
use crate::bench::gpu::workload::Workload;
use crate::bench::points::CAMERAS;
use crate::error::ViewerError;
use crate::gpu::backend::BackendChoice;
use crate::render::control::Control;
use crate::render::headless::RenderParams;
use crate::render::transition_cost::{TransitionCost, cheapest, least_cost, measure_transitions};
use crate::scene::landscape::{Landscape, LandscapeParams};
use serde::Serialize;
use std::path::PathBuf;

/// Width and height of the pictures.
const SIZE: [u32; 2] = [1920, 1080];
/// Width and height of the pictures of quick runs.
const QUICK_SIZE: [u32; 2] = [64, 36];
/// Names of the plants' models, as `cargo xtask volumes --models` writes them.
const MODELS: [(Landscape, &[&str]); 3] = [
    (Landscape::Lawn, &["lawn", "lawn_flower"]),
    (Landscape::Grove, &["tree"]),
    (Landscape::Forest, &["tree", "tree2", "spruce", "spruce2"]),
];

/// The cost of one transition.
#[derive(Serialize)]
struct TransitionRow {
    mesh: &'static str,
    variant: &'static str,
    width: u32,
    height: u32,
    #[serde(flatten)]
    cost: TransitionCost,
    /// Time to a noise over the least of the view.
    relative_cost: f64,
    /// Whether `--lod-transition auto` takes it.
    is_taken: bool,
}

/// Measures the transitions of the landscapes whose plants have models in the folder that was given, each from afar, nearer and from
/// close by; nothing without a folder.
///
/// # Errors
/// [`ViewerError::Usage`] for a folder with the models of no landscape; those of their files and of the tracer.
pub(super) fn measure(params: &GpuBenchParams, rows: Rows) -> Result<(), ViewerError> {
    let Some(folder) = &params.plants else { return Ok(()) };
    let files = |names: &[&str]| names.iter().map(|name| folder.join(format!("{name}.glb"))).collect::<Vec<PathBuf>>();
    let all = MODELS.map(|(landscape, names)| (landscape, files(names)));
    let whole: Vec<_> = all.iter().filter(|(_, files)| files.iter().all(|file| file.is_file())).collect();
    if whole.is_empty() {
        return Err(ViewerError::Usage(format!(
            "{}: there are no models of a landscape's plants here; write them with `cargo xtask volumes --models`, or name \
             another folder with --plants",
            folder.display()
        )));
    }
    let workload = Workload::open(params)?;
    let render = RenderParams {
        size: if params.quick { QUICK_SIZE } else { SIZE },
        backend: BackendChoice::Gpu(workload.tracer),
        adapter: params.adapter.clone(),
        ..RenderParams::default()
    };
    for (landscape, meshes) in whole {
        let (mut scene, _) =
            landscape.scene(&LandscapeParams { meshes: meshes.clone(), ..LandscapeParams::default() })?;
        for (variant, camera) in CAMERAS.into_iter().zip(scene.cameras()) {
            scene.camera = camera;
            let costs = measure_transitions(&scene, &render, &Control::SILENT)?;
            let (least, taken) = (least_cost(&costs), cheapest(&costs));
            for cost in &costs {
                let row = TransitionRow {
                    mesh: landscape.name(),
                    variant,
                    width: render.size[0],
                    height: render.size[1],
                    cost: *cost,
                    relative_cost: cost.cost() / least,
                    is_taken: cost.pixels == taken,
                };
                rows(row_of("transition", &row));
            }
        }
    }
    Ok(())
}
