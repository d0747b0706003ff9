//! How long the frames of a point take.

use crate::bench::points::Point;
use crate::bench::report::BenchRow;
use crate::cpu::picture::CpuPicture;
use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use crate::gpu::frame::FrameRequest;
use crate::gpu::results::timer::{GpuTimer, PassTimes};
use crate::gpu::tracer::Tracer;
use crate::picture::PixelHit;
use crate::render::engine::Engine;
use std::time::Duration;
use web_time::Instant;

/// Frames of a row at least.
pub(super) const MIN_FRAMES: usize = 3;
/// Frames of a row at most.
const MAX_FRAMES: usize = 60;
/// How long frames are drawn before they are timed, at least one of them.
const WARM_UP: Duration = Duration::from_millis(150);
/// Milliseconds of frames after which a row ends.
const ROW_MS: f64 = 1000.0;
/// Milliseconds that a band's passes may take: systems that show windows take a device for hung after 2 s.
const MAX_BAND_MS: f64 = 1000.0;
/// Milliseconds that the frames which are not waited for may take together, about.
const UNWAITED_MS: f64 = 100.0;

/// What was measured of a point's frames.
struct Times {
    /// Milliseconds of each frame, and by kind of pass.
    frames: Vec<(f64, Option<PassTimes>)>,
    /// Mean milliseconds of frames that are submitted without waiting for one another.
    unwaited_ms: Option<f64>,
    bands: usize,
    hits: Vec<PixelHit>,
}

impl Engine {
    /// Times the frames of a point: the median is the row's.
    ///
    /// # Errors
    /// The errors of [`Tracer`].
    pub(super) fn time(&self, point: &Point) -> Result<BenchRow, ViewerError> {
        self.time_with(&mut None, point)
    }

    /// Times the frames of a point with the `tracer` of an earlier one, which must have shown the same geometry and assets
    /// by the same decoder, or, where there is none, makes it: then nothing is uploaded or compiled twice.
    ///
    /// # Errors
    /// The errors of [`Tracer`].
    pub(super) fn time_with(&self, tracer: &mut Option<Tracer>, point: &Point) -> Result<BenchRow, ViewerError> {
        let mut times = match self {
            Engine::Cpu => time_on_cpu(point),
            Engine::Gpu(gpu, kind) => {
                let tracer = match tracer {
                    Some(tracer) => tracer,
                    none => none.insert(Tracer::with_decoder(gpu, &point.scene, *kind, point.decoder)?),
                };
                time_on_gpu(gpu, tracer, point)?
            }
        };
        times.frames.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(row(point, &times))
    }
}

/// Tells whether so many frames are enough of a row.
fn is_enough(frames: &[(f64, Option<PassTimes>)]) -> bool {
    let spent: f64 = frames.iter().map(|(ms, _)| ms).sum();
    frames.len() >= MAX_FRAMES || (frames.len() >= MIN_FRAMES && spent >= ROW_MS)
}

fn time_on_cpu(point: &Point) -> Times {
    let mut frames = Vec::new();
    let mut picture = CpuPicture::new(point.size);
    while !is_enough(&frames) {
        let start = Instant::now();
        picture.samples = point.sample(frames.len());
        picture.add_sample(&point.scene, &point.shade, &|| true);
        frames.push((start.elapsed().as_secs_f64() * 1e3, None));
    }
    Times { frames, unwaited_ms: None, bands: 1, hits: picture.hits }
}

fn time_on_gpu(gpu: &Gpu, tracer: &mut Tracer, point: &Point) -> Result<Times, ViewerError> {
    let mut timer = GpuTimer::new(gpu);
    tracer.warm_up(&point.frame())?;
    tracer.limit_bands(&point.frame(), MAX_BAND_MS)?;
    // More whole frames, for caches and for clocks, which GPUs lower while they rest.
    let start = Instant::now();
    loop {
        tracer.sample(&point.frame(), None)?;
        gpu.wait()?;
        if start.elapsed() >= WARM_UP {
            break;
        }
    }
    let mut frames = Vec::new();
    while !is_enough(&frames) {
        let sample = point.sample(frames.len());
        frames.push(tracer.timed_sample(&FrameRequest { sample, ..point.frame() }, timer.as_mut())?);
    }
    let mean_ms = frames.iter().map(|(ms, _)| ms).sum::<f64>() / frames.len() as f64;
    let count = (UNWAITED_MS / mean_ms) as usize;
    let mut unwaited_ms = None;
    if count >= MIN_FRAMES {
        let start = Instant::now();
        for number in 0..count {
            tracer.sample(&FrameRequest { sample: point.sample(number), ..point.frame() }, None)?;
        }
        gpu.wait()?;
        unwaited_ms = Some(start.elapsed().as_secs_f64() * 1e3 / count as f64);
    }
    Ok(Times { frames, unwaited_ms, bands: tracer.bands().len(), hits: tracer.read_hits()? })
}

/// Makes the row of a point; the frames are sorted.
fn row(point: &Point, times: &Times) -> BenchRow {
    let (scene, hits) = (&point.scene, &times.hits);
    let (frame_ms, passes) = times.frames[times.frames.len() / 2];
    let shows_asset = |hit: &&PixelHit| {
        let triangle = scene.geometry.triangles().get(hit.primitive as usize);
        triangle.is_some_and(|triangle| scene.materials[triangle.material as usize].asset().is_some())
    };
    let all = scene.most_components();
    BenchRow {
        mesh: point.mesh,
        variant: point.variant,
        interpolation: point.shade.decode.interpolation.name(),
        psnr_db: None,
        front: false,
        frame_ms,
        passes,
        frames: times.frames.len(),
        unwaited_ms: times.unwaited_ms,
        bands: times.bands,
        lights: scene.lights.len(),
        materials: scene.assets.len(),
        coverage: hits.iter().filter(shows_asset).count() as f64 / hits.len() as f64,
        width: point.size[0],
        height: point.size[1],
        components: point.shade.decode.components.min(all),
        spmm_evaluations: hits.iter().map(|hit| u64::from(hit.evaluations)).sum(),
        rays: hits.iter().map(|hit| u64::from(hit.rays)).sum(),
        triangles: scene.geometry.placed_triangles(),
        instances: scene.geometry.instances().len(),
    }
}
