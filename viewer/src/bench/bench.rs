//! How the time of a frame grows: with lights, materials, coverage, resolution, residual components and triangles, and
//! what the decoder's short cuts are worth. After figures 4 and 5 of Silva & Santos [silva2012]. And what landscapes
//! take.

use crate::bench::leaf_modes::leaf_mode_rows;
pub use crate::bench::params::{BenchKind, BenchParams};
use crate::bench::points::{Point, points};
pub use crate::bench::report::{BenchReport, BenchRow};
use crate::cpu::picture::CpuPicture;
use crate::error::ViewerError;
use crate::gpu::frame::FrameRequest;
use crate::gpu::tracer::Tracer;
use crate::options::{RenderMode, ShadeOptions};
use crate::picture::psnr_db;
use crate::render::control::Control;
use crate::render::engine::Engine;
use crate::scene::asset::SceneAsset;
use btf_runtime::{DecodeOptions, Interpolation};
use std::sync::Arc;

/// Samples of a picture whose error `trade` tells.
pub const TRADE_SAMPLES: u32 = 16;
/// Samples of the path-traced reference picture that errors are measured against. Its random numbers differ from those
/// of the measured pictures.
pub const REFERENCE_SAMPLES: u32 = 256;
/// Maximum number of rays in a path of the reference picture.
const REFERENCE_DEPTH: u32 = 6;

/// Times every point of a bench; the report has what was measured, in a fixed order. `assets` are shown by the scenes
/// in turn and must not be empty.
///
/// # Errors
/// The errors of [`crate::render`].
pub fn run_bench(
    assets: &[Arc<SceneAsset>],
    params: &BenchParams,
    control: &Control,
) -> Result<BenchReport, ViewerError> {
    let engine = Engine::open(params.backend, params.adapter.as_deref(), control)?;
    let points = points(assets, params)?;
    let mut rows = Vec::new();
    let reference = match params.kind {
        BenchKind::Trade => Some(engine.reference(&points[0], control)?),
        _ => None,
    };
    for (done, point) in points.iter().enumerate() {
        if (control.cancelled)() {
            return Err(ViewerError::Interrupted);
        }
        let mut row = engine.time(point)?;
        if let Some(reference) = &reference {
            let picture = engine.picture(point, 0..TRADE_SAMPLES, control)?;
            row.psnr_db = Some(psnr_db(reference, &picture, 0.0));
        }
        rows.push(row);
        (control.progress)((done + 1) as f32 / points.len() as f32);
    }
    mark_front(&mut rows);
    Ok(BenchReport {
        bench: params.kind,
        adapter: engine.adapter(),
        interface: engine.interface(),
        backend: engine.backend(),
        timer: engine.timer(),
        assets: assets.iter().map(|asset| asset.name.clone()).collect(),
        resident_bytes: assets.iter().map(|asset| 4 * asset.head().words().len()).sum(),
        rows,
        leaf_modes: if params.kind == BenchKind::Trade { leaf_mode_rows()? } else { Vec::new() },
    })
}

impl Engine {
    /// Computes the mean radiance of some samples.
    pub(super) fn picture(
        &self,
        point: &Point,
        samples: std::ops::Range<u32>,
        control: &Control,
    ) -> Result<Vec<[f32; 3]>, ViewerError> {
        let stopped = || if (control.cancelled)() { Err(ViewerError::Interrupted) } else { Ok(()) };
        let mut sums: Vec<[f32; 3]> = Vec::new();
        match self {
            Engine::Cpu => {
                let mut picture = CpuPicture::new(point.size);
                picture.samples = samples.start;
                for _ in samples.clone() {
                    stopped()?;
                    picture.add_sample(&point.scene, &point.shade, &|| true);
                }
                sums = picture.sums;
            }
            Engine::Gpu(gpu, kind) => {
                let mut tracer = Tracer::with_decoder(gpu, &point.scene, *kind, point.decoder)?;
                for sample in samples.clone() {
                    stopped()?;
                    tracer.sample(&FrameRequest { sample, ..point.frame() }, None)?;
                    gpu.wait()?;
                }
                // The first sample of a fresh tracer adds to zeros, whatever its number.
                let count = samples.len() as f32;
                sums.extend(tracer.read_radiance()?.iter().map(|mean| mean.map(|x| x * count)));
            }
        }
        let count = samples.len() as f32;
        Ok(sums.iter().map(|sum| sum.map(|x| x / count)).collect())
    }

    /// Computes the path-traced picture of a point's scene, every component and the exact rule; its samples are not
    /// those of the points.
    fn reference(&self, point: &Point, control: &Control) -> Result<Vec<[f32; 3]>, ViewerError> {
        let mut shade = ShadeOptions { mode: RenderMode::Path, depth: REFERENCE_DEPTH, ..point.shade };
        shade.decode = DecodeOptions { interpolation: Interpolation::Exact, ..DecodeOptions::default() };
        let reference = Point { scene: point.scene.clone(), shade, ..*point };
        self.picture(&reference, TRADE_SAMPLES..TRADE_SAMPLES + REFERENCE_SAMPLES, control)
    }
}

/// Marks the rows that no other is at least as fast as and better than.
fn mark_front(rows: &mut [BenchRow]) {
    let points: Vec<_> = rows.iter().map(|row| (row.frame_ms, row.psnr_db)).collect();
    for row in rows {
        let beaten = |(ms, psnr): &(f64, Option<f64>)| *ms <= row.frame_ms && *psnr > row.psnr_db;
        row.front = row.psnr_db.is_some() && !points.iter().any(beaten);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::timing::MIN_FRAMES;
    use crate::gpu::backend::BackendChoice;

    fn rows(kind: BenchKind) -> Vec<BenchRow> {
        let assets = [Arc::new(SceneAsset::built_in())];
        let shade = ShadeOptions::default();
        let params =
            BenchParams { kind, mesh: None, size: [12, 12], backend: BackendChoice::Cpu, adapter: None, shade };
        run_bench(&assets, &params, &Control::SILENT).unwrap().rows
    }

    #[test]
    fn each_bench_varies_what_it_says_and_nothing_else() {
        let lights = rows(BenchKind::Lights);
        assert_eq!(lights.len(), 28);
        assert!(lights[..7].windows(2).all(|w| w[1].lights == 2 * w[0].lights && w[1].rays > w[0].rays));
        assert!(lights.iter().all(|row| row.frame_ms > 0.0 && row.materials == 1 && row.frames >= MIN_FRAMES));
        let materials = rows(BenchKind::Materials);
        assert_eq!(materials.iter().map(|row| row.materials).collect::<Vec<_>>()[..6], [1, 2, 4, 8, 16, 32]);
        // The same pixels show assets however many there are.
        let evaluations = |row: &BenchRow| row.spmm_evaluations as f64;
        assert!(materials[..6].iter().all(|row| (evaluations(row) / evaluations(&materials[0]) - 1.0).abs() < 0.03));
        let coverage = rows(BenchKind::Coverage);
        assert!(coverage.windows(2).all(|w| w[1].coverage >= w[0].coverage));
        assert!(coverage[0].coverage < 0.1 && coverage.last().unwrap().coverage > 0.95);
        let landscapes = rows(BenchKind::Landscapes);
        let seen: Vec<_> = landscapes.iter().map(|row| row.mesh).collect();
        assert_eq!(seen, [["lawn"; 3], ["grove"; 3], ["forest"; 3]].concat());
        assert!(landscapes.windows(2).all(|w| w[0].variant != w[1].variant && w[0].rays != w[1].rays));
        let components: Vec<u32> = rows(BenchKind::Components).iter().map(|row| row.components).collect();
        assert_eq!(components, [0, 1, 2, 4]);
    }

    #[test]
    fn short_cuts_change_time_and_not_the_picture() {
        let points = points(
            &[Arc::new(SceneAsset::built_in())],
            &BenchParams {
                kind: BenchKind::Ablations,
                mesh: None,
                size: [16, 16],
                backend: BackendChoice::Cpu,
                adapter: None,
                shade: ShadeOptions::default(),
            },
        )
        .unwrap();
        let picture = |point: &Point| Engine::Cpu.picture(point, 0..1, &Control::SILENT).unwrap();
        for point in &points[1..4] {
            assert_eq!(picture(point), picture(&points[0]), "{}", point.variant);
        }
        assert_ne!(picture(&points[4]), picture(&points[0]), "16 lights are not one");
    }

    #[test]
    fn errors_against_the_traced_picture_fall_with_what_is_followed() {
        let rows = rows(BenchKind::Trade);
        let best = |variant: &str| {
            rows.iter().filter(|row| row.variant == variant).filter_map(|row| row.psnr_db).fold(0.0, f64::max)
        };
        let (path, ambient, direct) = (best("path tracing"), best("direct and ambient light"), best("direct light"));
        assert!(ambient > direct + 2.0 && path > direct + 2.0, "{path} {ambient} {direct}");
        assert!(rows.iter().any(|row| row.front) && rows.iter().any(|row| !row.front));
        for row in rows.iter().filter(|row| row.front) {
            assert!(!rows.iter().any(|other| other.frame_ms <= row.frame_ms && other.psnr_db > row.psnr_db));
        }
    }
}
