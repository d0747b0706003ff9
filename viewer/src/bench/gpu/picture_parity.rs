//! Whether the GPU's pictures are the CPU's.

use crate::bench::gpu::params::GpuBenchParams;
use crate::bench::gpu::parity::count_differences;
use crate::bench::gpu::rows::{Rows, row_of};
use crate::bench::gpu::workload::{ResidentForm, Workload};
use crate::bench::instanced_scene::instanced_plants;
use crate::bench::points::{Point, by_normal, landscape_points, outdoors};
use crate::error::ViewerError;
use crate::gpu::backend::GpuTracer;
use crate::picture::psnr_db;
use crate::render::control::Control;
use crate::render::engine::Engine;
use crate::scene::scene::MeshChoice;
use serde::Serialize;

/// Width and height of the pictures, and in a quick run.
const SIZE: [u32; 2] = [256, 192];
const QUICK_SIZE: [u32; 2] = [64, 48];
/// Samples of a pixel.
const SAMPLES: u32 = 2;
/// Triangles of the canopy.
const TRIANGLES: u64 = 100_000;
/// One in so many pixels may differ: nearest texels, edges and shadows flip where rounding does; and of foliage, where
/// every pixel has edges.
const FLIPPED: usize = 100;
const FLIPPED_IN_FOLIAGE: usize = 20;

/// A comparison of pictures.
#[derive(Serialize)]
struct PictureRow {
    scene: &'static str,
    form: Option<ResidentForm>,
    backend: &'static str,
    width: u32,
    height: u32,
    /// Error of 8-bit sRGB values, dB.
    psnr_db: f64,
    /// Pixels that differ by more than a decoded value may, and how many may.
    differing: usize,
    allowed: usize,
}

/// Compares pictures of assets in both forms, a canopy and a lawn, by every way of tracing that the adapter has.
///
/// # Errors
/// [`ViewerError::Gpu`] where a picture differs in more pixels than it may, after all comparisons.
pub(super) fn compare_pictures(params: &GpuBenchParams, rows: Rows) -> Result<(), ViewerError> {
    let workload = Workload::open(params)?;
    let gpu = &workload.gpu;
    let tracers = [Some(GpuTracer::Bvh), gpu.has_ray_query().then_some(GpuTracer::RayQuery)];
    let mut faults = Vec::new();
    for (form, share, point) in pictures(&workload)? {
        let expected = Engine::Cpu.picture(&point, 0..SAMPLES, &Control::SILENT)?;
        for tracer in tracers.into_iter().flatten() {
            let engine = Engine::Gpu(Box::new(gpu.clone()), tracer);
            let found = engine.picture(&point, 0..SAMPLES, &Control::SILENT)?;
            let row = PictureRow {
                scene: point.mesh,
                form,
                backend: tracer.name(),
                width: point.size[0],
                height: point.size[1],
                psnr_db: psnr_db(&expected, &found, point.scene.exposure_ev),
                differing: count_differences(&expected, &found),
                allowed: expected.len() / share,
            };
            if row.differing > row.allowed {
                faults.push(format!("{} pixels of {} by {}", row.differing, point.mesh, tracer.name()));
            }
            rows(row_of("picture", &row));
        }
    }
    workload.judge("pictures", &faults)
}

/// Returns the pictures to compare: the form of their assets, one in how many pixels may differ, and the point.
fn pictures(workload: &Workload) -> Result<Vec<(Option<ResidentForm>, usize, Point)>, ViewerError> {
    let size = if workload.params.quick { QUICK_SIZE } else { SIZE };
    let mut pictures = Vec::new();
    for form in [ResidentForm::Expanded, ResidentForm::Packed] {
        let assets = workload.assets(form);
        let point = workload.built_in(("cornell", MeshChoice::Cornell), &assets, size)?;
        pictures.push((Some(form), FLIPPED, point));
    }
    let canopy = workload.point("plants", outdoors(instanced_plants(TRIANGLES)?)?, size);
    pictures.push((None, FLIPPED_IN_FOLIAGE, Point { shade: by_normal(canopy.shade), ..canopy }));
    // Software drivers compile the shaders of volumes for minutes.
    let lawn = if workload.params.quick { None } else { landscape_points()?.into_iter().next() };
    if let Some((_, name, scene)) = lawn {
        pictures.push((None, FLIPPED_IN_FOLIAGE, workload.point(name, scene, size)));
    }
    pictures.iter_mut().for_each(|(_, _, point)| point.size = size);
    Ok(pictures)
}
