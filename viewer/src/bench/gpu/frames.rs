//! Frames of the scenes with assets, and of landscapes: the time of a frame, and what it makes of rays, evaluations and bytes.

use crate::bench::bench::BenchRow;
use crate::bench::gpu::params::GpuBenchParams;
use crate::bench::gpu::rows::{Rows, row_of};
use crate::bench::gpu::workload::{ResidentForm, Workload};
use crate::bench::points::{Point, landscape_points};
use crate::error::ViewerError;
use crate::gpu::tracer::Tracer;
use crate::render::engine::Engine;
use crate::scene::asset::SceneAsset;
use crate::scene::scene::MeshChoice;
use btf_runtime::testing::{Random, evaluation_traffic};
use btf_runtime::{DecodeOptions, Query};
use serde::Serialize;
use std::sync::Arc;

/// Width and height of the Cornell box's pictures.
const BOX: [u32; 2] = [512, 512];
/// Sizes of the screens.
const FULL_HD: [u32; 2] = [1920, 1080];
const ULTRA_HD: [u32; 2] = [3840, 2160];
/// Components of the cheaper settings, where an asset has more.
const FEW: u32 = 8;
const SOME: u32 = 24;
/// Columns and rows of pixels of the workgroups that are compared.
const WORKGROUPS: [(&str, [u32; 2]); 7] = [
    ("8 x 8", [8, 8]),
    ("8 x 4", [8, 4]),
    ("16 x 4", [16, 4]),
    ("32 x 1", [32, 1]),
    ("64 x 1", [64, 1]),
    ("16 x 8", [16, 8]),
    ("16 x 16", [16, 16]),
];
/// Evaluations whose bytes are counted; their mean is told.
const COUNTED: usize = 4096;

/// A timed picture.
#[derive(Serialize)]
struct FrameRow<'a> {
    #[serde(flatten)]
    frame: &'a BenchRow,
    /// The form of the assets; none where there are none.
    form: Option<ResidentForm>,
    /// Whether coarser levels are used.
    levels: bool,
    frames_per_s: f64,
    rays_per_s: f64,
    evaluations_per_s: f64,
    /// Mean bytes of one evaluation of the first asset's finest level, alone and without caches.
    bytes_per_evaluation: Option<f64>,
    /// Multiply-adds of the residual's sum of such an evaluation.
    multiply_adds_per_evaluation: Option<f64>,
    /// What all evaluations of a second would read and compute so. Lights that share a texel, and caches, save of it.
    gigabytes_per_s: Option<f64>,
    tera_multiply_adds_per_s: Option<f64>,
}

/// Times points of scenes of the same geometry and assets, which are uploaded and compiled once.
pub(super) struct FrameTimer<'a> {
    engine: &'a Engine,
    tracer: Option<Tracer>,
}

impl FrameTimer<'_> {
    /// Makes a timer for points of one scene.
    pub(super) fn new(engine: &Engine) -> FrameTimer<'_> {
        FrameTimer { engine, tracer: None }
    }

    /// Times a point and hands its row over.
    ///
    /// # Errors
    /// The errors of the tracer.
    pub(super) fn time(&mut self, point: &Point, rows: Rows) -> Result<(), ViewerError> {
        let frame = self.engine.time_with(&mut self.tracer, point)?;
        rows(frame_row(point, &frame));
        Ok(())
    }
}

/// Makes the row of a timed point.
fn frame_row(point: &Point, frame: &BenchRow) -> serde_json::Value {
    let asset = point.scene.assets.first();
    let per_s = |count: u64| count as f64 * 1e3 / frame.frame_ms;
    let traffic = asset.and_then(|asset| mean_traffic(asset, &point.shade.decode));
    let evaluations_per_s = per_s(frame.spmm_evaluations);
    let row = FrameRow {
        frame,
        form: asset.map(|asset| match asset.head().is_packed(0) {
            true => ResidentForm::Packed,
            false => ResidentForm::Expanded,
        }),
        levels: point.shade.uses_levels(),
        frames_per_s: per_s(1),
        rays_per_s: per_s(frame.rays),
        evaluations_per_s,
        bytes_per_evaluation: traffic.map(|[bytes, _]| bytes),
        multiply_adds_per_evaluation: traffic.map(|[_, multiply_adds]| multiply_adds),
        gigabytes_per_s: traffic.map(|[bytes, _]| bytes * evaluations_per_s * 1e-9),
        tera_multiply_adds_per_s: traffic.map(|[_, multiply_adds]| multiply_adds * evaluations_per_s * 1e-12),
    };
    row_of("frame", &row)
}

/// Returns the mean bytes and multiply-adds of evaluations at random; none for an asset that came in resident form.
fn mean_traffic(asset: &SceneAsset, options: &DecodeOptions) -> Option<[f64; 2]> {
    let layer = &asset.file.as_ref()?.whole.layers[0];
    let mut random = Random::new(1);
    let mut sums = [0; 2];
    for _ in 0..COUNTED {
        let uv = [0; 2].map(|_| random.within(0.0, 1.0));
        let query = Query { uv, wi: random.direction(), wo: random.direction() };
        let traffic = evaluation_traffic(layer, asset.head(), &query, options.components);
        sums = [sums[0] + traffic.bytes, sums[1] + traffic.multiply_adds];
    }
    Some(sums.map(|sum| sum as f64 / COUNTED as f64))
}

/// Returns the components to draw with, from few to all.
pub(super) fn component_counts(assets: &[Arc<SceneAsset>]) -> Vec<u32> {
    let all = assets.iter().map(|asset| asset.most_components()).max().unwrap_or(0);
    [FEW, SOME].into_iter().filter(|count| *count < all).chain([all]).collect()
}

/// Narrows the field of view so that what fills a square picture fills the point's, which is wider than high.
fn fill_wide(point: &mut Point) {
    let [width, height] = point.size.map(|side| side as f32);
    let camera = &mut point.scene.camera;
    let half = (0.5 * camera.fov_deg).to_radians().tan() * (height / width).min(1.0);
    camera.fov_deg = 2.0 * half.atan().to_degrees();
}

/// Times the Cornell box, which fills its picture, under one light: both forms, few components to all, with and without
/// levels.
///
/// # Errors
/// The errors of the tracer.
pub(super) fn cornell(params: &GpuBenchParams, rows: Rows) -> Result<(), ViewerError> {
    let workload = Workload::open(params)?;
    let engine = workload.engine();
    for form in [ResidentForm::Expanded, ResidentForm::Packed] {
        let assets = workload.assets(form);
        let mut timer = FrameTimer::new(&engine);
        let mut point = workload.built_in(("cornell", MeshChoice::Cornell), &assets, BOX)?;
        for components in component_counts(&assets).into_iter().rev() {
            point.shade.decode.components = components;
            timer.time(&point, rows)?;
        }
        let mut finest = workload.built_in(("cornell", MeshChoice::Cornell), &assets, BOX)?;
        finest.shade.levels = false;
        finest.variant = "finest texels only";
        timer.time(&finest, rows)?;
    }
    Ok(())
}

/// Times the Cornell box on larger screens, which it fills: both forms, few components and all.
///
/// # Errors
/// The errors of the tracer.
pub(super) fn resolutions(params: &GpuBenchParams, rows: Rows) -> Result<(), ViewerError> {
    let workload = Workload::open(params)?;
    let engine = workload.engine();
    for form in [ResidentForm::Expanded, ResidentForm::Packed] {
        let assets = workload.assets(form);
        let counts = component_counts(&assets);
        let mut timer = FrameTimer::new(&engine);
        for size in [FULL_HD, ULTRA_HD] {
            for components in [counts[0], counts[counts.len() - 1]] {
                let mut point = workload.built_in(("cornell", MeshChoice::Cornell), &assets, size)?;
                fill_wide(&mut point);
                point.shade.decode.components = components;
                timer.time(&point, rows)?;
            }
        }
    }
    Ok(())
}

/// Times the Cornell box under 1 to 64 lights, with both forms and all components.
///
/// # Errors
/// The errors of the tracer.
pub(super) fn lights(params: &GpuBenchParams, rows: Rows) -> Result<(), ViewerError> {
    let workload = Workload::open(params)?;
    let engine = workload.engine();
    let counts: &[usize] = if params.quick { &[1, 16] } else { &[1, 16, 2, 4, 8, 32, 64] };
    for form in [ResidentForm::Expanded, ResidentForm::Packed] {
        let assets = workload.assets(form);
        let mut timer = FrameTimer::new(&engine);
        for count in counts {
            let mut point = workload.built_in(("cornell", MeshChoice::Cornell), &assets, BOX)?;
            point.scene.place_lights(*count);
            timer.time(&point, rows)?;
        }
    }
    Ok(())
}

/// Times the Cornell box with other workgroups than the usual 8 x 8 pixels: both forms, all components.
///
/// # Errors
/// The errors of the tracer.
pub(super) fn workgroups(params: &GpuBenchParams, rows: Rows) -> Result<(), ViewerError> {
    let workload = Workload::open(params)?;
    let engine = workload.engine();
    for form in [ResidentForm::Expanded, ResidentForm::Packed] {
        let assets = workload.assets(form);
        let mut point = workload.built_in(("cornell", MeshChoice::Cornell), &assets, BOX)?;
        let mut tracer = Tracer::new(&workload.gpu, &point.scene, workload.tracer)?;
        for (name, group) in WORKGROUPS {
            tracer.set_group(group);
            point.variant = name;
            let mut timer = FrameTimer { engine: &engine, tracer: Some(tracer) };
            timer.time(&point, rows)?;
            let Some(used) = timer.tracer else { return Ok(()) };
            tracer = used;
        }
    }
    Ok(())
}

/// Times shoe, boots and pullover under one light.
///
/// # Errors
/// The errors of the tracer.
pub(super) fn models(params: &GpuBenchParams, rows: Rows) -> Result<(), ViewerError> {
    let workload = Workload::open(params)?;
    let engine = workload.engine();
    let assets = workload.assets(ResidentForm::Expanded);
    let models = [("shoe", MeshChoice::Shoe), ("boots", MeshChoice::Boots), ("pullover", MeshChoice::Pullover)];
    for model in models {
        FrameTimer::new(&engine).time(&workload.built_in(model, &assets, FULL_HD)?, rows)?;
    }
    Ok(())
}

/// Times lawn, grove and forest, each from afar, nearer and from close by.
///
/// # Errors
/// The errors of the tracer.
pub(super) fn landscapes(params: &GpuBenchParams, rows: Rows) -> Result<(), ViewerError> {
    let workload = Workload::open(params)?;
    let engine = workload.engine();
    let (mut timer, mut shown) = (FrameTimer::new(&engine), "");
    for (variant, name, scene) in landscape_points()? {
        if name != shown {
            (timer, shown) = (FrameTimer::new(&engine), name);
        }
        let point = Point { variant, moves: true, ..workload.point(name, scene, FULL_HD) };
        timer.time(&point, rows)?;
    }
    Ok(())
}
