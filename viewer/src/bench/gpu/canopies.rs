//! Canopies under sun and sky, with one ray for what occludes the sky.

use crate::bench::gpu::frames::FrameTimer;
use crate::bench::gpu::params::GpuBenchParams;
use crate::bench::gpu::rows::Rows;
use crate::bench::gpu::workload::Workload;
use crate::bench::instanced_scene::{instanced_plants, instanced_scene};
use crate::bench::points::{PAPER_TRIANGLES, Point, by_normal, outdoors};
use crate::error::ViewerError;

/// Width and height of the pictures.
const SIZE: [u32; 2] = [1920, 1080];
/// Triangles besides the paper's.
const TRIANGLES: [u64; 4] = [100_000, 1_000_000, 30_000_000, 100_000_000];
/// Triangles of quick runs at most.
const QUICK_TRIANGLES: u64 = 1_000_000;

/// Times the canopy of as many triangles as the paper's [Miao].
///
/// # Errors
/// Those of the model's file and of the tracer.
pub(super) fn canopy_of_the_paper(params: &GpuBenchParams, rows: Rows) -> Result<(), ViewerError> {
    time_canopies(params, &[PAPER_TRIANGLES], rows)
}

/// Times canopies of 100,000 to 100 million triangles.
///
/// # Errors
/// Those of the model's file and of the tracer.
pub(super) fn canopies(params: &GpuBenchParams, rows: Rows) -> Result<(), ViewerError> {
    time_canopies(params, &TRIANGLES, rows)
}

fn time_canopies(params: &GpuBenchParams, triangles: &[u64], rows: Rows) -> Result<(), ViewerError> {
    let workload = Workload::open(params)?;
    let engine = workload.engine();
    for count in triangles.iter().filter(|count| !params.quick || **count <= QUICK_TRIANGLES) {
        let (name, scene) = match &params.mesh {
            Some(path) => ("instances", instanced_scene(path, *count)?),
            None => ("plants", instanced_plants(*count)?),
        };
        let point = workload.point(name, outdoors(scene)?, SIZE);
        FrameTimer::new(&engine).time(&Point { shade: by_normal(point.shade), ..point }, rows)?;
    }
    Ok(())
}
