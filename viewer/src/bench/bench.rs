//! How the time of a frame grows: with lights, materials, coverage, resolution, residual components and triangles, and what
//! the decoder's short cuts are worth. After figures 4 and 5 of Silva & Santos [silva2012]. And what landscapes take.

use crate::bench::instanced_scene::instanced_scene;
use crate::bench::leaf_modes::{LeafModeRow, leaf_mode_rows};
use crate::cpu::picture::CpuPicture;
use crate::error::ViewerError;
use crate::gpu::backend::BackendChoice;
use crate::gpu::frame::FrameRequest;
use crate::gpu::timer::{GpuTimer, PassTimes};
use crate::gpu::tracer::Tracer;
use crate::light::daylight::Daylight;
use crate::options::{DecoderForm, RenderMode, ShadeOptions, SkyLight};
use crate::picture::PixelHit;
use crate::picture::psnr_db;
use crate::render::control::Control;
use crate::render::engine::Engine;
use crate::scene::asset::SceneAsset;
use crate::scene::landscape::{Landscape, LandscapeParams};
use crate::scene::scene::{Ambient, DaylightParts, MeshChoice, Outdoors, Scene};
use btf_runtime::{Asset, DecodeOptions, Interpolation, LobeRef};
use glam::Vec3;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Frames of a row at least.
const MIN_FRAMES: usize = 3;
/// Frames of a row at most.
const MAX_FRAMES: usize = 60;
/// Milliseconds of frames after which a row ends.
const ROW_MS: f64 = 1000.0;

/// Samples of a picture whose error `trade` tells.
pub const TRADE_SAMPLES: u32 = 16;
/// Samples of the path-traced picture that it is measured against; they are others.
pub const REFERENCE_SAMPLES: u32 = 256;
/// Rays of its paths at most.
const REFERENCE_DEPTH: u32 = 6;

/// Triangles of the canopy that [Miao] draws at 31 frames a second.
const PAPER_TRIANGLES: u64 = 8_605_600;

/// What is varied.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum BenchKind {
    /// 1 to 64 point lights on four meshes.
    Lights,
    /// 1 to 32 assets that share the same pixels, on two meshes.
    Materials,
    /// The share of the picture that shows assets: a shoe with three from farther and farther away.
    Coverage,
    /// The picture's size.
    Resolution,
    /// Residual components.
    Components,
    /// The decoder without its short cuts, one by one.
    Ablations,
    /// Triangles: a model placed ever more often, under sun and sky with one ray each.
    Triangles,
    /// Error against the path-traced picture over time, for every setting of the dials; and of the modes of a live leaf.
    Trade,
    /// Lawn, grove and forest of volumetric textures, from afar, nearer and from close by.
    Landscapes,
}

impl BenchKind {
    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            BenchKind::Lights => "lights",
            BenchKind::Materials => "materials",
            BenchKind::Coverage => "coverage",
            BenchKind::Resolution => "resolution",
            BenchKind::Components => "components",
            BenchKind::Ablations => "ablations",
            BenchKind::Triangles => "triangles",
            BenchKind::Trade => "trade",
            BenchKind::Landscapes => "landscapes",
        }
    }
}

/// What to measure.
#[derive(Debug, Clone)]
pub struct BenchParams {
    /// What is varied.
    pub kind: BenchKind,
    /// For `triangles`, and for `resolution` where it is given: the model that is placed.
    pub mesh: Option<PathBuf>,
    /// Width and height of the picture, pixels, where the size is not what is varied.
    pub size: [u32; 2],
    /// Which renderer.
    pub backend: BackendChoice,
    /// Part of the adapter's name, where there are several.
    pub adapter: Option<String>,
    /// How pictures are computed, where that is not what is varied.
    pub shade: ShadeOptions,
}

/// A measured point.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BenchRow {
    /// The mesh, `instances` for a model of the user's, or the landscape.
    pub mesh: &'static str,
    /// What was changed, for `ablations`, which light is followed, for `trade`, and from where it is seen, for `landscapes`.
    pub variant: &'static str,
    /// `fast` or `exact`.
    pub interpolation: &'static str,
    /// For `trade`: error of the mean of [`TRADE_SAMPLES`] samples against the path-traced picture, of 8-bit sRGB values, peak
    /// 255.
    pub psnr_db: Option<f64>,
    /// For `trade`: on the front of error over time.
    pub front: bool,
    /// Median time of a frame, milliseconds.
    pub frame_ms: f64,
    /// That frame by kind of pass, where the GPU has timestamps.
    pub passes: Option<PassTimes>,
    /// Frames that were timed.
    pub frames: usize,
    /// Point lights.
    pub lights: usize,
    /// Assets.
    pub materials: usize,
    /// Share of the pixels that show an asset.
    pub coverage: f64,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Residual components at most.
    pub components: u32,
    /// Asset decodes of a frame.
    pub spmm_evaluations: u64,
    /// Rays of a frame.
    pub rays: u64,
    /// Triangles of the scene, each as often as it is placed.
    pub triangles: u64,
    /// Instances of meshes.
    pub instances: usize,
}

/// A whole bench; the keys of `--json`.
#[derive(Debug, Clone, Serialize)]
pub struct BenchReport {
    /// What was varied.
    pub bench: BenchKind,
    /// Adapter name, or the number of threads of the CPU backend.
    pub adapter: String,
    /// Graphics interface and kind of adapter.
    pub interface: String,
    /// `ray-query`, `bvh` or `cpu`.
    pub backend: &'static str,
    /// `gpu-timestamps` or `wall-clock`.
    pub timer: &'static str,
    /// Names of the assets.
    pub assets: Vec<String>,
    /// Bytes of the assets in the decoder's memory.
    pub resident_bytes: usize,
    /// The points.
    pub rows: Vec<BenchRow>,
    /// For `trade`: the modes of a live leaf.
    pub leaf_modes: Vec<LeafModeRow>,
}

/// Times every point of a bench; the report has what was measured, in a fixed order. `assets` are shown by the scenes in
/// turn and must not be empty.
///
/// # Errors
/// Those of [`crate::render`].
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

/// A scene and how it is drawn.
struct Point {
    mesh: &'static str,
    variant: &'static str,
    scene: Scene,
    size: [u32; 2],
    shade: ShadeOptions,
    decoder: DecoderForm,
    /// Whether each frame is the first of its picture, as while the camera moves: volumes are coarser in it than in later ones.
    moves: bool,
}

impl Point {
    /// Returns the request of the first frame.
    fn frame(&self) -> FrameRequest<'_> {
        FrameRequest { scene: &self.scene, size: self.size, options: self.shade, sample: 0 }
    }

    /// Number of the sample that a frame adds.
    fn sample(&self, frame: usize) -> u32 {
        if self.moves { 0 } else { frame as u32 }
    }
}

const MESHES: [(&str, MeshChoice); 4] = [
    ("cornell", MeshChoice::Cornell),
    ("shoe", MeshChoice::Shoe),
    ("boots", MeshChoice::Boots),
    ("pullover", MeshChoice::Pullover),
];

fn points(assets: &[Arc<SceneAsset>], params: &BenchParams) -> Result<Vec<Point>, ViewerError> {
    let scene = |mesh: &MeshChoice, assets: &[Arc<SceneAsset>]| Scene::built_in(mesh, assets.to_vec(), [1.0; 2]);
    let point = |mesh: &'static str, scene: Scene| Point {
        mesh,
        variant: "",
        scene,
        size: params.size,
        shade: params.shade,
        decoder: DecoderForm::Halves,
        moves: false,
    };
    let mut points = Vec::new();
    match params.kind {
        BenchKind::Lights => {
            for (name, mesh) in &MESHES {
                let scene = scene(mesh, assets)?;
                for lights in [1, 2, 4, 8, 16, 32, 64] {
                    let mut scene = scene.clone();
                    scene.place_lights(lights);
                    points.push(point(name, scene));
                }
            }
        }
        BenchKind::Materials => {
            for (name, mesh) in &MESHES[..2] {
                for count in [1usize, 2, 4, 8, 16, 32] {
                    // Each material has an asset of its own, be it a copy, so that memory is not shared.
                    let copies: Vec<_> = (0..count).map(|i| assets[i % assets.len()].clone()).collect();
                    points.push(point(name, dealt_out(scene(mesh, &copies)?, count)));
                }
            }
        }
        BenchKind::Coverage => {
            let near = scene(&MeshChoice::Shoe, assets)?;
            for distance in [6.0f32, 4.0, 2.8, 2.0, 1.5, 1.1, 0.8, 0.6, 0.45, 0.3, 0.15] {
                let mut scene = near.clone();
                let camera = &mut scene.camera;
                // Towards a point of the upper, which in the end fills the picture.
                camera.target = camera.target.lerp(Vec3::new(0.03, 0.06, 0.04), (2.0 - distance).clamp(0.0, 1.0));
                camera.eye = camera.target + (near.camera.eye - near.camera.target) * distance;
                points.push(point("shoe", scene));
            }
        }
        BenchKind::Resolution => {
            let (name, scene, shade) = match &params.mesh {
                Some(path) => {
                    ("instances", outdoors(instanced_scene(path, PAPER_TRIANGLES)?)?, by_normal(params.shade))
                }
                None => ("cornell", scene(&MeshChoice::Cornell, assets)?, params.shade),
            };
            for size in [[128, 128], [256, 256], [512, 512], [1024, 1024], [1920, 1080], [3840, 2160]] {
                points.push(Point { size, shade, ..point(name, scene.clone()) });
            }
        }
        BenchKind::Triangles => {
            let path = params.mesh.as_ref().ok_or_else(|| {
                ViewerError::Usage(
                    "bench triangles needs a model: make one with `btf-synth plants maize.glb`, then add --mesh maize.glb"
                        .into(),
                )
            })?;
            for triangles in [100_000, 1_000_000, PAPER_TRIANGLES, 30_000_000, 100_000_000] {
                let shade = by_normal(params.shade);
                points.push(Point { shade, ..point("instances", outdoors(instanced_scene(path, triangles)?)?) });
            }
        }
        BenchKind::Components => {
            let scene = scene(&MeshChoice::Cornell, assets)?;
            let all = assets.iter().map(|asset| asset.most_components()).max().unwrap_or(0);
            for components in [0, 1, 2, 4, 8, 16, 32, 64, 128].into_iter().filter(|n| *n < all).chain([all]) {
                let mut shade = params.shade;
                shade.decode.components = components;
                points.push(Point { shade, ..point("cornell", scene.clone()) });
            }
        }
        BenchKind::Trade => {
            let mut scene = scene(&MeshChoice::Shoe, assets)?;
            scene.place_lights(2);
            let open = Ambient { distance: 1e6, ..scene.usual_ambient() };
            let all = assets.iter().map(|asset| asset.most_components()).max().unwrap_or(0);
            for (variant, ambient, mode) in [
                ("path tracing", open, RenderMode::Path),
                ("direct and ambient light", open, RenderMode::Direct),
                ("direct light", Ambient::NONE, RenderMode::Direct),
            ] {
                for interpolation in [Interpolation::Fast, Interpolation::Exact] {
                    for components in [0, 4, 16, 64].into_iter().filter(|n| *n < all).chain([all]) {
                        let mut shade = ShadeOptions { mode, ..params.shade };
                        (shade.decode.components, shade.decode.interpolation) = (components, interpolation);
                        let scene = Scene { ambient, ..scene.clone() };
                        points.push(Point { variant, shade, ..point("shoe", scene) });
                    }
                }
            }
        }
        BenchKind::Landscapes => {
            let cameras = ["from afar", "nearer", "from close by"];
            for landscape in [Landscape::Lawn, Landscape::Grove, Landscape::Forest] {
                let (scene, _) = landscape.scene(&LandscapeParams::default())?;
                let seen = std::iter::once(scene.camera).chain(scene.more_cameras.iter().copied());
                for (variant, camera) in cameras.into_iter().zip(seen) {
                    let scene = Scene { camera, ..scene.clone() };
                    points.push(Point { variant, moves: true, ..point(landscape.name(), scene) });
                }
            }
        }
        BenchKind::Ablations => {
            for lights in [1, 16] {
                let with = |assets: &[Arc<SceneAsset>], variant, decoder| -> Result<Point, ViewerError> {
                    let mut scene = scene(&MeshChoice::Cornell, assets)?;
                    scene.place_lights(lights);
                    Ok(Point { variant, decoder, ..point("cornell", scene) })
                };
                let changed = |change: fn(&mut Asset)| -> Result<Vec<Arc<SceneAsset>>, ViewerError> {
                    let one = |asset: &Arc<SceneAsset>| {
                        let mut file = asset.file_form()?.asset.clone();
                        change(&mut file);
                        Ok(Arc::new(SceneAsset::new(asset.name.clone(), file)))
                    };
                    assets.iter().map(one).collect()
                };
                points.push(with(assets, "as it is", DecoderForm::Halves)?);
                points.push(with(assets, "everything for every light", DecoderForm::Whole)?);
                points.push(with(&changed(without_grids)?, "all triangles searched", DecoderForm::Halves)?);
                points.push(with(&changed(with_most_lobes)?, "most lobes in every texel", DecoderForm::Halves)?);
            }
        }
    }
    Ok(points)
}

/// Under sun and sky.
fn outdoors(mut scene: Scene) -> Result<Scene, ViewerError> {
    let daylight = Daylight::new("2026-06-21T10:00+00:00", "40.0,0.0")?;
    let light = daylight.sun_and_sky()?;
    scene.stand_outdoors(Outdoors { daylight, parts: DaylightParts::Both }, light);
    Ok(scene)
}

/// The sky by the normal's irradiance and one ray for what occludes it.
fn by_normal(shade: ShadeOptions) -> ShadeOptions {
    ShadeOptions { sky: SkyLight::Irradiance, ..shade }
}

/// Gives the scene's triangles to `count` materials in turn, one asset each: every material is everywhere in the picture.
fn dealt_out(mut scene: Scene, count: usize) -> Scene {
    let old = scene.materials.clone();
    scene.materials = (0..count * old.len())
        .map(|i| crate::Material { body: crate::Body::Asset(i % count), ..old[i / count] })
        .collect();
    let mut turn = 0;
    let triangles = scene.geometry.triangles().to_vec();
    let triangles = triangles
        .into_iter()
        .map(|triangle| {
            turn += 1;
            let material = triangle.material as usize * count + turn % count;
            crate::Triangle { material: material as u32, ..triangle }
        })
        .collect();
    scene.geometry = Arc::new(scene.geometry.with_triangles(triangles));
    scene
}

fn without_grids(asset: &mut Asset) {
    for layer in &mut asset.layers {
        (layer.lights, layer.views) = (layer.lights.without_grid(), layer.views.without_grid());
    }
}

/// Fills every texel up to the layer's largest count, with lobes of weight 0.
fn with_most_lobes(asset: &mut Asset) {
    for layer in &mut asset.layers {
        let most = layer.texel_lobe_counts.iter().copied().max().unwrap_or(0);
        let mut refs = Vec::with_capacity(layer.texel_lobe_counts.len() * usize::from(most));
        let mut rest = layer.lobe_refs.as_slice();
        for count in &mut layer.texel_lobe_counts {
            let (own, later) = rest.split_at(usize::from(*count));
            refs.extend_from_slice(own);
            refs.extend((*count..most).map(|_| LobeRef { lobe: 0, weight: [0; 3] }));
            (*count, rest) = (most, later);
        }
        layer.lobe_refs = refs;
    }
}

impl Engine {
    /// Mean radiance of some samples.
    fn picture(
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

    /// The path-traced picture of a point's scene, every component and the exact rule; its samples are not those of the
    /// points.
    fn reference(&self, point: &Point, control: &Control) -> Result<Vec<[f32; 3]>, ViewerError> {
        let mut shade = ShadeOptions { mode: RenderMode::Path, depth: REFERENCE_DEPTH, ..point.shade };
        shade.decode = DecodeOptions { interpolation: Interpolation::Exact, ..DecodeOptions::default() };
        let reference = Point { scene: point.scene.clone(), shade, ..*point };
        self.picture(&reference, TRADE_SAMPLES..TRADE_SAMPLES + REFERENCE_SAMPLES, control)
    }

    fn time(&self, point: &Point) -> Result<BenchRow, ViewerError> {
        let mut times: Vec<(f64, Option<PassTimes>)> = Vec::new();
        let enough = |times: &[(f64, Option<PassTimes>)]| {
            let spent: f64 = times.iter().map(|(ms, _)| ms).sum();
            times.len() >= MAX_FRAMES || (times.len() >= MIN_FRAMES && spent >= ROW_MS)
        };
        let hits = match self {
            Engine::Cpu => {
                let mut picture = CpuPicture::new(point.size);
                while !enough(&times) {
                    let start = Instant::now();
                    picture.samples = point.sample(times.len());
                    picture.add_sample(&point.scene, &point.shade, &|| true);
                    times.push((start.elapsed().as_secs_f64() * 1e3, None));
                }
                picture.hits
            }
            Engine::Gpu(gpu, kind) => {
                let mut tracer = Tracer::with_decoder(gpu, &point.scene, *kind, point.decoder)?;
                let mut timer = GpuTimer::new(gpu);
                tracer.warm_up(&point.frame())?;
                // One whole frame more, for caches and clocks.
                tracer.sample(&point.frame(), None)?;
                gpu.wait()?;
                while !enough(&times) {
                    let sample = point.sample(times.len());
                    times.push(tracer.timed_sample(&FrameRequest { sample, ..point.frame() }, timer.as_mut())?);
                }
                tracer.read_hits()?
            }
        };
        times.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (frame_ms, passes) = times[times.len() / 2];
        Ok(row(point, frame_ms, passes, times.len(), &hits))
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

fn row(point: &Point, frame_ms: f64, passes: Option<PassTimes>, frames: usize, hits: &[PixelHit]) -> BenchRow {
    let scene = &point.scene;
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
        frames,
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

#[cfg(test)]
mod tests {
    use super::*;

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
