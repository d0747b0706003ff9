//! What frames take by counting, which is the same on every adapter: operations and words of memory of an evaluation, a ray and
//! a pixel.

use crate::bench::gpu::frames::component_counts;
use crate::bench::gpu::params::GpuBenchParams;
use crate::bench::gpu::rows::{Rows, row_of};
use crate::bench::gpu::workload::{ResidentForm, Workload};
use crate::bench::points::Point;
use crate::error::ViewerError;
use crate::gpu::modules::ModulePart;
use crate::gpu::tracer::Tracer;
use crate::operations::counts::{KINDS, OperationCounts};
use crate::scene::scene::MeshChoice;
use btf_runtime::HeightUse;
use serde::Serialize;

/// Width and height of the pictures: operations of a pixel do not depend on it.
const SIZE: [u32; 2] = [128, 128];
/// Lights of the scene with many.
const MANY_LIGHTS: usize = 16;

/// What was counted of a picture.
#[derive(Serialize)]
struct OperationsRow {
    mesh: &'static str,
    variant: &'static str,
    form: ResidentForm,
    lights: usize,
    components: u32,
    evaluations_per_pixel: f64,
    rays_per_pixel: f64,
    /// Of decoding, for one evaluation; the view's half is shared by the lights of a pixel.
    evaluation: MeanOperations,
    /// Of finding what is hit, for one ray.
    ray: MeanOperations,
    /// Of all else, for one pixel.
    pixel: MeanOperations,
}

/// [`OperationCounts`] in the mean.
#[derive(Serialize)]
struct MeanOperations {
    float: f64,
    special: f64,
    integer: f64,
    loaded_words: f64,
    stored_words: f64,
    array_words: f64,
    branches: f64,
}

impl MeanOperations {
    fn of(counts: OperationCounts, divisor: u64) -> MeanOperations {
        let numbers: [f64; KINDS] = counts.numbers().map(|number| number as f64 / divisor.max(1) as f64);
        let [float, special, integer, loaded_words, stored_words, array_words, branches] = numbers;
        MeanOperations { float, special, integer, loaded_words, stored_words, array_words, branches }
    }
}

/// Counts the Cornell box: both forms, few components to all, many lights, the exact rule, without heights.
///
/// # Errors
/// The errors of the tracer.
pub(super) fn count(params: &GpuBenchParams, rows: Rows) -> Result<(), ViewerError> {
    let workload = Workload::open(params)?;
    for form in [ResidentForm::Expanded, ResidentForm::Packed] {
        let assets = workload.assets(form);
        let mut point = workload.built_in(("cornell", MeshChoice::Cornell), &assets, SIZE)?;
        let mut tracer = Tracer::counting(&workload.gpu, &point.scene)?;
        let mut count = |point: &Point| count_point(&mut tracer, point, form, rows);
        for components in component_counts(&assets) {
            point.shade.decode.components = components;
            count(&point)?;
        }
        if point.shade.decode.heights != HeightUse::None && assets.iter().any(|asset| asset.has_heights()) {
            let mut level = workload.built_in(("cornell", MeshChoice::Cornell), &assets, SIZE)?;
            level.shade.decode.heights = HeightUse::None;
            level.variant = "without heights";
            count(&level)?;
        }
        let mut lit = workload.built_in(("cornell", MeshChoice::Cornell), &assets, SIZE)?;
        lit.scene.place_lights(MANY_LIGHTS);
        count(&lit)?;
    }
    Ok(())
}

/// Counts a picture and hands its row over.
fn count_point(tracer: &mut Tracer, point: &Point, form: ResidentForm, rows: Rows) -> Result<(), ViewerError> {
    let counts = tracer.count_sample(&point.frame())?;
    let hits = tracer.read_hits()?;
    let pixels = hits.len() as u64;
    let sum = |of: fn(&crate::picture::PixelHit) -> u32| hits.iter().map(|hit| u64::from(of(hit))).sum::<u64>();
    let (evaluations, rays) = (sum(|hit| hit.evaluations), sum(|hit| hit.rays));
    let of = |part: ModulePart, divisor| MeanOperations::of(counts[part as usize], divisor);
    let row = OperationsRow {
        mesh: point.mesh,
        variant: point.variant,
        form,
        lights: point.scene.lights.len(),
        components: point
            .shade
            .decode
            .components
            .min(point.scene.assets.iter().map(|a| a.most_components()).max().unwrap_or(0)),
        evaluations_per_pixel: evaluations as f64 / pixels as f64,
        rays_per_pixel: rays as f64 / pixels as f64,
        evaluation: of(ModulePart::Decode, evaluations),
        ray: of(ModulePart::Trace, rays),
        pixel: of(ModulePart::Shade, pixels),
    };
    rows(row_of("operations", &row));
    Ok(())
}
