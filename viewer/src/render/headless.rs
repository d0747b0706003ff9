//! Renders a scene without a window, on whichever backend was asked for.

use crate::cpu::picture::CpuPicture;
use crate::denoise::a_trous::a_trous;
use crate::denoise::features::features_of;
use crate::error::ViewerError;
use crate::gpu::backend::BackendChoice;
use crate::gpu::device::Gpu;
use crate::gpu::frame::FrameRequest;
use crate::gpu::results::timer::{GpuTimer, PassTimes};
use crate::gpu::scene_change::SceneChange;
use crate::gpu::tracer::Tracer;
use crate::motion::motion_picture::MotionPicture;
use crate::motion::pose::Pose;
use crate::motion::vectors::motion_of;
use crate::options::{MAX_DEPTH, MAX_IRRADIANCE_CELLS, MAX_LIGHT_SAMPLES, RenderMode, ShadeOptions};
use crate::picture::Picture;
use crate::picture::PixelHit;
use crate::render::bricks::{BrickReport, USUAL_VOLUME_BUDGET_MB, load_bricks};
use crate::render::control::Control;
use crate::render::engine::Engine;
use crate::render::governor::{Governor, Spending};
use crate::scene::camera::Camera;
use crate::scene::scene::Scene;
use serde::Serialize;
use web_time::Instant;

/// Largest picture side, pixels.
pub const MAX_SIDE: u32 = 16384;

/// The parameters of a rendering.
#[derive(Debug, Clone)]
pub struct RenderParams {
    /// Width and height, pixels, 1 to [`MAX_SIDE`].
    pub size: [u32; 2],
    /// Frames, at least 1. Each adds one sample per pixel, the first through the pixel's middle, the others spread over
    /// it; the picture is their mean and the frame time their mean.
    pub frames: u32,
    /// The renderer.
    pub backend: BackendChoice,
    /// Part of the adapter's name, where there are several.
    pub adapter: Option<String>,
    /// The settings that trade speed for accuracy.
    pub shade: ShadeOptions,
    /// Milliseconds that a frame may take; what frames then save in components, lobes and lights, they learn from one
    /// another.
    pub target_ms: Option<f64>,
    /// Whether noise is filtered out of the picture, which then has at least 2 frames.
    pub denoise: bool,
    /// Whether the motion of what pixels show is told, too; of the pictures of a sequence, not of one alone.
    pub motion: bool,
    /// Megabytes that volumes may take: they are drawn coarser where they would take more.
    pub volume_budget_mb: u32,
}

impl Default for RenderParams {
    /// Returns those of a picture of 512 x 512 pixels with one frame, by whichever renderer there is.
    fn default() -> RenderParams {
        RenderParams {
            size: [512, 512],
            frames: 1,
            backend: BackendChoice::Auto,
            adapter: None,
            shade: ShadeOptions::default(),
            target_ms: None,
            denoise: false,
            motion: false,
            volume_budget_mb: USUAL_VOLUME_BUDGET_MB,
        }
    }
}

impl RenderParams {
    /// Checks that size, frames, depth and light samples are within their ranges.
    ///
    /// # Errors
    /// [`ViewerError::Usage`].
    pub fn check(&self) -> Result<(), ViewerError> {
        if self.size.iter().any(|side| *side == 0 || *side > MAX_SIDE) {
            return Err(ViewerError::Usage(format!("a picture's sides are 1 to {MAX_SIDE} pixels, as in 512x512")));
        }
        if self.frames == 0 {
            return Err(ViewerError::Usage("a picture has at least 1 frame".into()));
        }
        if self.denoise && self.frames < 2 {
            return Err(ViewerError::Usage(
                "--denoise learns the noise from how frames differ: give --frames 2 or more".into(),
            ));
        }
        if !(1..=MAX_DEPTH).contains(&self.shade.depth) {
            return Err(ViewerError::Usage(format!("--depth is 1 to {MAX_DEPTH}")));
        }
        if !(1..=MAX_LIGHT_SAMPLES).contains(&self.shade.light_samples) {
            return Err(ViewerError::Usage(format!("--light-samples is 1 to {MAX_LIGHT_SAMPLES}")));
        }
        if self.shade.irradiance_cells > MAX_IRRADIANCE_CELLS {
            return Err(ViewerError::Usage(format!("--irradiance-volume has 1 to {MAX_IRRADIANCE_CELLS} cells")));
        }
        if self.shade.irradiance_cells > 0 && self.shade.mode == RenderMode::Path {
            return Err(ViewerError::Usage(
                "--irradiance-volume stands in for bounces, which --mode path traces: leave one of them out".into(),
            ));
        }
        Ok(())
    }
}

/// The figures of a rendering; the keys of `--json`.
#[derive(Debug, Clone, Serialize)]
pub struct RenderReport {
    /// Adapter name, or the number of threads of the CPU backend.
    pub adapter: String,
    /// Graphics interface and kind of adapter.
    pub interface: String,
    /// `ray-query`, `bvh` or `cpu`.
    pub backend: &'static str,
    /// Mean time of a frame, milliseconds; compiling and uploading are not in it.
    pub frame_ms: f64,
    /// The frame time by kind of pass, where the GPU has timestamps.
    pub passes: Option<PassTimes>,
    /// `gpu-timestamps` (begin and end of the compute passes) or `wall-clock` (submission until it is finished).
    pub timer: &'static str,
    /// Asset decodes per frame (of the last frame, where jitter makes them differ).
    pub spmm_evaluations: u64,
    /// Rays per frame, shadow rays included (of the last frame).
    pub rays: u64,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Frames, which are also the samples per pixel.
    pub frames: u32,
    /// Lights.
    pub lights: usize,
    /// Triangles, each as often as it is placed.
    pub triangles: u64,
    /// Instances of meshes.
    pub instances: usize,
    /// Whether there is ambient light.
    pub ambient_occlusion: bool,
    /// Whether a picture of light surrounds the scene.
    pub environment: bool,
    /// What is loaded of the volumes that are stored by brick; `null` where there are none.
    pub volume_bricks: Option<BrickReport>,
    /// Lights of which a sample asks at most.
    pub light_samples: u32,
    /// `direct` or `path`.
    pub mode: &'static str,
    /// Rays of a path at most.
    pub depth: u32,
    /// Cells along the longest side of the irradiance volume; 0 without one.
    pub irradiance_cells: u32,
    /// Residual components at most; `null` for all.
    pub components: Option<u32>,
    /// Lobes at most; `null` for all.
    pub lobes: Option<u32>,
    /// `fast` or `exact`.
    pub interpolation: &'static str,
    /// The frame-time budget, milliseconds.
    pub target_ms: Option<f64>,
    /// The spending of a frame of that budget, as far as it was learned.
    pub spends: Option<Spending>,
    /// Use of the heights: `none`, `parallax` or `relief`.
    pub heights: &'static str,
}

/// A finished rendering.
pub struct Rendered {
    /// The picture, linear.
    pub picture: Picture,
    /// Hit and cost of the last sample of each pixel, row-major from the top left.
    pub hits: Vec<PixelHit>,
    /// Motion from this picture to the one before, where it was asked for.
    pub motion: Option<MotionPicture>,
    /// The figures.
    pub report: RenderReport,
}

/// Renders `scene`. Cost: on a GPU the passes of each frame; on the CPU about one BVH traversal and one decode per
/// pixel and light on every thread.
///
/// # Errors
/// [`ViewerError::Usage`] for sizes out of range, [`ViewerError::NoAdapter`] where a GPU is asked for by name and there
/// is none (with [`BackendChoice::Auto`] it renders on the CPU and says so), [`ViewerError::Gpu`],
/// [`ViewerError::Interrupted`].
pub fn render(scene: &Scene, params: &RenderParams, control: &Control) -> Result<Rendered, ViewerError> {
    let mut last = None;
    let params = &RenderParams { motion: false, ..params.clone() };
    render_sequence(scene, params, &Sequence::turntable(1), control, &mut |_, rendered| {
        last = Some(rendered);
        Ok(())
    })?;
    last.ok_or(ViewerError::Interrupted)
}

/// The pictures of a scene one after the other; the first is that of [`render`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sequence {
    /// Number of pictures.
    pub pictures: u32,
    /// Angle by which the camera turns about its target from one picture to the next, radians.
    pub turn_rad: f32,
    /// Time from one picture to the next, seconds.
    pub interval_s: f64,
}

impl Sequence {
    /// Returns a sequence of `pictures` pictures once around the scene.
    pub fn turntable(pictures: u32) -> Sequence {
        Sequence { pictures, turn_rad: std::f32::consts::TAU / pictures as f32, interval_s: 0.0 }
    }

    /// Returns the cameras of the pictures, of which `first` is the first one's; only that where none turns.
    fn cameras(&self, first: Camera) -> Vec<Camera> {
        let turned = |camera: &Camera| {
            let mut next = *camera;
            next.orbit(self.turn_rad, 0.0);
            Some(next)
        };
        let count = if self.turn_rad == 0.0 { 1 } else { self.pictures as usize };
        std::iter::successors(Some(first), turned).take(count).collect()
    }
}

/// Returns where things were one picture before the first one of a sequence: the camera of a turntable one turn back, the
/// wind one interval earlier.
fn pose_before(scene: &Scene, sequence: &Sequence) -> Result<Pose, ViewerError> {
    let mut earlier = scene.clone();
    // A turn keeps off the poles, where a camera that stands still may be.
    if sequence.turn_rad != 0.0 {
        earlier.camera.orbit(-sequence.turn_rad, 0.0);
    }
    if sequence.interval_s != 0.0 {
        earlier.blow(scene.time_s - sequence.interval_s)?;
    }
    Ok(Pose::of(&earlier))
}

/// Renders the pictures of a sequence and gives each to `each` with its number. Uploads and compiles once.
/// The motion of the first picture is from where things were one picture's time before.
///
/// # Errors
/// As [`render`], and those of `each`, which end the sequence.
pub fn render_sequence(
    scene: &Scene,
    params: &RenderParams,
    sequence: &Sequence,
    control: &Control,
    each: &mut dyn FnMut(u32, Rendered) -> Result<(), ViewerError>,
) -> Result<(), ViewerError> {
    let mut scene = scene.clone();
    let cameras = sequence.cameras(scene.camera);
    let budget_mb = params.volume_budget_mb;
    let (bricks, _) = load_bricks(&mut scene, &cameras, params.size, params.frames, budget_mb, control)?;
    let mut session = Session::new(&scene, params, control)?;
    let began_s = scene.time_s;
    let mut before = if params.motion { Some(pose_before(&scene, sequence)?) } else { None };
    for number in 0..sequence.pictures {
        if let Some(camera) = cameras.get(number as usize) {
            scene.camera = *camera;
        }
        if number > 0 && sequence.interval_s != 0.0 {
            scene.blow(began_s + f64::from(number) * sequence.interval_s)?;
            session.take_over_skins(&scene)?;
        }
        let progress = |share: f32| (control.progress)((number as f32 + share) / sequence.pictures as f32);
        let control = Control { progress: &progress, ..*control };
        let mut rendered = session.render(&scene, params, &control)?;
        rendered.report.volume_bricks = bricks;
        if let Some(before) = &mut before {
            let motion = motion_of(&scene, before, params.size, &params.shade, params.frames, control.cancelled)?;
            (rendered.motion, *before) = (Some(motion), Pose::of(&scene));
        }
        each(number, rendered)?;
    }
    Ok(())
}

/// A scene that is uploaded and compiled once, for several pictures.
pub(crate) struct Session {
    engine: Engine,
    tracer: Option<Tracer>,
}

impl Session {
    /// Opens the renderer, uploads the scene and compiles.
    ///
    /// # Errors
    /// As [`render`].
    pub(crate) fn new(scene: &Scene, params: &RenderParams, control: &Control) -> Result<Session, ViewerError> {
        params.check()?;
        if let Some(reason) = scene.camera.fault() {
            return Err(ViewerError::Usage(reason.into()));
        }
        let engine = Engine::open(params.backend, params.adapter.as_deref(), control)?;
        let tracer = match &engine {
            Engine::Gpu(gpu, kind) => Some(Tracer::new(gpu, scene, *kind)?),
            Engine::Cpu => None,
        };
        Ok(Session { engine, tracer })
    }

    /// Takes over where the wind has moved the scene's skins.
    ///
    /// # Errors
    /// As [`render`].
    fn take_over_skins(&mut self, scene: &Scene) -> Result<(), ViewerError> {
        match (&self.engine, &mut self.tracer) {
            (Engine::Gpu(..), Some(tracer)) => tracer.update(scene, &SceneChange::Skins).map(|_| ()),
            _ => Ok(()),
        }
    }

    /// Returns how long a GPU takes for a frame after the transitions between meshes and volumes have changed, milliseconds;
    /// `None` where the CPU draws.
    ///
    /// # Errors
    /// As [`render`].
    pub(crate) fn frame_ms_after_change(
        &mut self,
        scene: &Scene,
        params: &RenderParams,
        control: &Control,
    ) -> Result<Option<f64>, ViewerError> {
        self.take_over_skins(scene)?;
        let (Engine::Gpu(gpu, _), Some(tracer)) = (&self.engine, &mut self.tracer) else { return Ok(None) };
        let params = RenderParams { frames: 1, denoise: false, target_ms: None, ..params.clone() };
        let control = Control { progress: &|_| (), ..*control };
        let (_, (frame_ms, ..)) = render_gpu(gpu, tracer, scene, &params, &control)?;
        Ok(Some(frame_ms))
    }

    /// Draws the scene, whose camera, lights and surroundings may have changed since [`Session::new`].
    ///
    /// # Errors
    /// As [`render`].
    pub(crate) fn render(
        &mut self,
        scene: &Scene,
        params: &RenderParams,
        control: &Control,
    ) -> Result<Rendered, ViewerError> {
        let (mut picture, times) = match (&self.engine, &mut self.tracer) {
            (Engine::Gpu(gpu, _), Some(tracer)) => render_gpu(gpu, tracer, scene, params, control)?,
            _ => render_cpu(scene, params, control)?,
        };
        if params.denoise {
            let features = features_of(scene, params.size, &params.shade, params.frames);
            picture.radiance = a_trous(&picture.radiance, &picture.halfway, params.frames, &features, params.size);
        }
        Ok(rendered(&self.engine, scene, params, picture, times))
    }
}

/// Radiance and what the last sample of every pixel did.
struct Drawn {
    radiance: Vec<[f32; 3]>,
    /// Radiance of the first half of the frames, where noise is filtered out.
    halfway: Vec<[f32; 3]>,
    hits: Vec<PixelHit>,
}

/// Mean time of a frame, milliseconds, and of its passes; and what was learned from them.
type FrameTimes = (f64, Option<PassTimes>, Option<Governor>);

fn render_cpu(scene: &Scene, params: &RenderParams, control: &Control) -> Result<(Drawn, FrameTimes), ViewerError> {
    use std::sync::atomic::{AtomicU64, Ordering};
    let mut picture = CpuPicture::new(params.size);
    let rows = AtomicU64::new(0);
    let total = u64::from(params.frames) * u64::from(params.size[1]);
    let row_done = || {
        let done = rows.fetch_add(1, Ordering::Relaxed) + 1;
        (control.progress)(done as f32 / total as f32);
        !(control.cancelled)()
    };
    let start = Instant::now();
    let mut governor = governor(scene, params);
    let mut halfway = Vec::new();
    for frame in 0..params.frames {
        if params.denoise && frame == params.frames / 2 {
            halfway = picture.radiance();
        }
        let frame_start = Instant::now();
        let shade = governor.as_ref().map_or(params.shade, |governor| governor.settings(&params.shade));
        picture.add_sample(scene, &shade, &row_done);
        governor.iter_mut().for_each(|governor| governor.observe(frame_start.elapsed().as_secs_f64() * 1e3));
        if (control.cancelled)() {
            return Err(ViewerError::Interrupted);
        }
    }
    let frame_ms = start.elapsed().as_secs_f64() * 1e3 / f64::from(params.frames);
    Ok((Drawn { radiance: picture.radiance(), halfway, hits: picture.hits }, (frame_ms, None, governor)))
}

fn render_gpu(
    gpu: &Gpu,
    tracer: &mut Tracer,
    scene: &Scene,
    params: &RenderParams,
    control: &Control,
) -> Result<(Drawn, FrameTimes), ViewerError> {
    let mut timer = GpuTimer::new(gpu);
    let first = FrameRequest { scene, size: params.size, options: params.shade, sample: 0 };
    tracer.warm_up(&first)?;
    let (mut frame_ms, mut passes) = (0.0, None);
    let mut governor = governor(scene, params);
    let mut halfway = Vec::new();
    for frame in 0..params.frames {
        if params.denoise && frame == params.frames / 2 {
            halfway = tracer.read_radiance()?;
        }
        if (control.cancelled)() {
            return Err(ViewerError::Interrupted);
        }
        let options = governor.as_ref().map_or(params.shade, |governor| governor.settings(&params.shade));
        let request = FrameRequest { options, sample: frame, ..first };
        let (ms, of_frame) = tracer.timed_sample(&request, timer.as_mut())?;
        frame_ms += ms / f64::from(params.frames);
        if let Some(of_frame) = of_frame {
            passes.get_or_insert_with(PassTimes::default).add(&of_frame, 1.0 / f64::from(params.frames));
        }
        governor.iter_mut().for_each(|governor| governor.observe(ms));
        (control.progress)((frame + 1) as f32 / params.frames as f32);
    }
    let (radiance, hits) = (tracer.read_radiance()?, tracer.read_hits()?);
    Ok((Drawn { radiance, halfway, hits }, (frame_ms, passes, governor)))
}

fn governor(scene: &Scene, params: &RenderParams) -> Option<Governor> {
    params.target_ms.map(|target_ms| Governor::new(target_ms, Spending::all_of(scene)))
}

fn rendered(
    engine: &Engine,
    scene: &Scene,
    params: &RenderParams,
    Drawn { radiance, hits, .. }: Drawn,
    (frame_ms, passes, governor): FrameTimes,
) -> Rendered {
    let [width, height] = params.size;
    let limit = |x: u32| (x != u32::MAX).then_some(x);
    let report = RenderReport {
        adapter: engine.adapter(),
        interface: engine.interface(),
        backend: engine.backend(),
        frame_ms,
        passes,
        timer: engine.timer(),
        spmm_evaluations: hits.iter().map(|hit| u64::from(hit.evaluations)).sum(),
        rays: hits.iter().map(|hit| u64::from(hit.rays)).sum(),
        width,
        height,
        frames: params.frames,
        lights: scene.lights.len(),
        triangles: scene.geometry.placed_triangles(),
        instances: scene.geometry.instances().len(),
        ambient_occlusion: scene.ambient.radiance.iter().any(|x| *x > 0.0),
        environment: scene.environment.is_some(),
        volume_bricks: None,
        light_samples: params.shade.light_samples,
        mode: params.shade.mode.name(),
        depth: params.shade.depth,
        irradiance_cells: params.shade.irradiance_cells,
        components: limit(params.shade.decode.components),
        lobes: limit(params.shade.decode.lobes),
        interpolation: params.shade.decode.interpolation.name(),
        target_ms: params.target_ms,
        spends: governor.map(|governor| governor.spends()),
        heights: params.shade.decode.heights.name(),
    };
    Rendered { picture: Picture { width, height, radiance }, hits, motion: None, report }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::RenderMode;
    use crate::scene::material::Material;
    use crate::scene::mesh;
    use crate::scene::scene::SceneObject;
    use std::path::Path;

    fn grey(part: mesh::MeshPart) -> SceneObject {
        SceneObject { part, material: Material::plain([0.5; 3]) }
    }

    fn cpu(size: [u32; 2]) -> RenderParams {
        RenderParams { size, backend: BackendChoice::Cpu, ..RenderParams::default() }
    }

    #[test]
    fn a_facing_grey_plane_has_the_radiance_of_the_formula() {
        let mut scene = Scene::from_objects(Path::new("plane"), vec![grey(mesh::plane())], Vec::new()).unwrap();
        scene.camera.eye = glam::Vec3::new(0.0, 0.0, 8.0);
        scene.camera.target = glam::Vec3::ZERO;
        let position = glam::Vec3::new(3.0, 0.0, 4.0);
        scene.lights = vec![crate::scene::scene::PointLight { position, intensity: [100.0, 50.0, 0.0] }];
        let rendered = render(&scene, &cpu([33, 33]), &Control::SILENT).unwrap();
        let middle = rendered.picture.radiance[16 * 33 + 16];
        // Distance 5, cosine 4/5.
        let expected = 100.0 / 25.0 * 0.5 * 0.8 / std::f32::consts::PI;
        assert!((middle[0] - expected).abs() < 1e-4 && (middle[1] - expected / 2.0).abs() < 1e-4 && middle[2] == 0.0);
        assert_eq!(rendered.report.spmm_evaluations, 0);
    }

    #[test]
    fn an_object_between_light_and_surface_throws_a_shadow() {
        let mut blocker = mesh::plane();
        blocker.transform(glam::Mat4::from_translation(glam::Vec3::Z) * glam::Mat4::from_scale(glam::Vec3::splat(0.3)));
        for (objects, lit) in [(vec![grey(mesh::plane())], true), (vec![grey(mesh::plane()), grey(blocker)], false)] {
            let mut scene = Scene::from_objects(Path::new("x"), objects, Vec::new()).unwrap();
            // The eye looks at the middle from the side, past the blocker.
            scene.camera.eye = glam::Vec3::new(8.0, 0.0, 3.0);
            scene.camera.target = glam::Vec3::ZERO;
            let position = glam::Vec3::new(0.0, 0.0, 3.0);
            scene.lights = vec![crate::scene::scene::PointLight { position, intensity: [30.0; 3] }];
            let rendered = render(&scene, &cpu([33, 33]), &Control::SILENT).unwrap();
            assert_eq!(rendered.picture.radiance[16 * 33 + 16][0] > 0.1, lit);
        }
    }

    #[test]
    fn a_filtered_picture_is_nearer_to_one_of_many_samples() {
        let mut ball = mesh::sphere();
        ball.transform(glam::Mat4::from_translation(glam::Vec3::new(0.2, 0.1, 0.8)));
        let mut scene = Scene::from_objects(Path::new("x"), vec![grey(mesh::plane()), grey(ball)], Vec::new()).unwrap();
        scene.lights.clear();
        scene.ambient = crate::scene::scene::Ambient { radiance: [0.8; 3], distance: 100.0 };
        let drawn = |frames, denoise| {
            render(&scene, &RenderParams { frames, denoise, ..cpu([40, 40]) }, &Control::SILENT)
                .map(|drawn| drawn.picture)
        };
        let truth = drawn(256, false).unwrap();
        let error = |picture: Picture| -> f32 {
            picture.radiance.iter().zip(&truth.radiance).map(|(a, b)| (a[1] - b[1]).powi(2)).sum::<f32>().sqrt()
        };
        let [raw, filtered] = [false, true].map(|denoise| error(drawn(4, denoise).unwrap()));
        assert!(filtered < 0.7 * raw, "{raw} {filtered}");
        assert_eq!(drawn(1, true).unwrap_err().exit_code(), 2);
    }

    #[test]
    fn a_lit_sphere_does_not_shadow_itself() {
        let mut scene = Scene::from_objects(Path::new("sphere"), vec![grey(mesh::sphere())], Vec::new()).unwrap();
        let eye = scene.camera.eye;
        scene.lights = vec![crate::scene::scene::PointLight { position: eye, intensity: [1000.0; 3] }];
        let rendered = render(&scene, &cpu([128, 128]), &Control::SILENT).unwrap();
        let black = rendered
            .picture
            .radiance
            .iter()
            .zip(&rendered.hits)
            .filter(|(radiance, hit)| hit.primitive != crate::NO_HIT && radiance[0] == 0.0)
            .count();
        assert_eq!(black, 0);
    }

    #[test]
    fn a_mirror_shows_what_lies_behind_the_eye_and_a_path_ends_at_its_depth() {
        // A grey wall at z = 4, lit from beside the eye, seen in a mirror at z = 0.
        let mut wall = mesh::plane();
        wall.transform(
            glam::Mat4::from_translation(glam::Vec3::Z * 4.0) * glam::Mat4::from_rotation_y(std::f32::consts::PI),
        );
        let mirror = Material { mirror: [0.5, 0.25, 0.0], ..Material::plain([0.0; 3]) };
        let objects = vec![grey(wall), SceneObject { part: mesh::plane(), material: mirror }];
        let mut scene = Scene::from_objects(Path::new("mirror"), objects, Vec::new()).unwrap();
        scene.camera.eye = glam::Vec3::new(0.0, 0.0, 2.0);
        scene.camera.target = glam::Vec3::ZERO;
        let light = glam::Vec3::new(0.0, 3.0, 0.0);
        scene.lights = vec![crate::scene::scene::PointLight { position: light, intensity: [100.0; 3] }];
        let middle = |depth| {
            let shade = ShadeOptions { depth, ..ShadeOptions::default() };
            let rendered = render(&scene, &RenderParams { shade, ..cpu([33, 33]) }, &Control::SILENT).unwrap();
            rendered.picture.radiance[16 * 33 + 16]
        };
        // Distance 5, cosine 4/5.
        let wall = 100.0 / 25.0 * 0.5 * 0.8 / std::f32::consts::PI;
        let seen = middle(2);
        assert!(
            (seen[0] - 0.5 * wall).abs() < 1e-4 && (seen[1] - 0.25 * wall).abs() < 1e-4 && seen[2] == 0.0,
            "{seen:?}"
        );
        assert_eq!(middle(1), [0.0; 3]);
    }

    #[test]
    fn an_integrating_sphere_has_the_radiance_of_its_formula() {
        // Inside a sphere of albedo a, lit from its middle, every point has L = a E / pi / (1 - a).
        let albedo = 0.5;
        let mut part = mesh::sphere();
        part.transform(glam::Mat4::from_scale(glam::Vec3::splat(2.0)));
        let object = SceneObject { part, material: Material::plain([albedo; 3]) };
        let mut scene = Scene::from_objects(Path::new("sphere"), vec![object], Vec::new()).unwrap();
        scene.camera.eye = glam::Vec3::new(0.0, 0.3, 1.0);
        scene.camera.target = glam::Vec3::ZERO;
        scene.lights = vec![crate::scene::scene::PointLight { position: glam::Vec3::ZERO, intensity: [4.0; 3] }];
        let mean = |mode| {
            let shade = ShadeOptions { mode, depth: 16, ..ShadeOptions::default() };
            let params = RenderParams { shade, frames: 16, ..cpu([24, 24]) };
            let picture = render(&scene, &params, &Control::SILENT).unwrap().picture;
            picture.radiance.iter().map(|c| f64::from(c[1])).sum::<f64>() / picture.radiance.len() as f64
        };
        let once = f64::from(albedo) * 1.0 / std::f64::consts::PI;
        let (direct, path) = (mean(RenderMode::Direct), mean(RenderMode::Path));
        assert!((direct / once - 1.0).abs() < 0.01, "{direct} {once}");
        assert!((path / (once / (1.0 - f64::from(albedo))) - 1.0).abs() < 0.02, "{path} {once}");
    }

    /// A dim sky with a small sun, its middle row and column.
    fn sky() -> crate::Environment {
        let (width, height) = (64, 32);
        let mut rgb = vec![0.2; width * height * 3];
        for (row, column) in [(6, 30), (6, 31), (7, 30), (7, 31)] {
            rgb[(row * width + column) * 3..][..3].fill(200.0);
        }
        crate::Environment::new(width, height, &rgb)
    }

    #[test]
    fn a_sky_lights_a_plane_as_its_integral_says_in_both_modes() {
        // The plane faces up, so that it sees the upper half of the picture.
        let mut up = mesh::plane();
        up.transform(glam::Mat4::from_rotation_x(-std::f32::consts::FRAC_PI_2));
        let mut scene = Scene::from_objects(Path::new("plane"), vec![grey(up)], Vec::new()).unwrap();
        scene.surround(sky());
        scene.camera.eye = glam::Vec3::new(0.0, 3.0, 0.1);
        scene.camera.target = glam::Vec3::ZERO;
        scene.camera.fov_deg = 20.0;
        let environment = scene.environment.clone().unwrap();
        let mut expected = 0.0f64;
        let (rows, columns) = (256, 512);
        for i in 0..rows {
            let polar = std::f32::consts::FRAC_PI_2 * (i as f32 + 0.5) / rows as f32;
            for j in 0..columns {
                let (sin, cos) = (std::f32::consts::TAU * (j as f32 + 0.5) / columns as f32).sin_cos();
                let d = glam::Vec3::new(polar.sin() * sin, polar.cos(), -polar.sin() * cos);
                let area =
                    polar.sin() * std::f32::consts::FRAC_PI_2 / rows as f32 * std::f32::consts::TAU / columns as f32;
                expected += f64::from(environment.radiance(d).y * polar.cos() * area);
            }
        }
        expected *= 0.5 / std::f64::consts::PI;
        let mean = |mode, scene: &Scene| {
            let shade = ShadeOptions { mode, ..ShadeOptions::default() };
            let params = RenderParams { shade, frames: 64, ..cpu([24, 24]) };
            let picture = render(scene, &params, &Control::SILENT).unwrap().picture;
            picture.radiance.iter().map(|c| f64::from(c[1])).sum::<f64>() / picture.radiance.len() as f64
        };
        for mode in [RenderMode::Direct, RenderMode::Path] {
            let found = mean(mode, &scene);
            assert!((found / expected - 1.0).abs() < 0.02, "{mode:?}: {found} {expected}");
        }
        // Planted difference: a sun that is a sixth dimmer.
        let mut rgb = vec![0.2; 64 * 32 * 3];
        for (row, column) in [(6, 30), (6, 31), (7, 30), (7, 31)] {
            rgb[(row * 64 + column) * 3..][..3].fill(167.0);
        }
        scene.surround(crate::Environment::new(64, 32, &rgb));
        let found = mean(RenderMode::Direct, &scene);
        assert!((found / expected - 1.0).abs() > 0.04, "{found} {expected}");
    }

    #[test]
    fn an_even_sky_is_ambient_light_on_an_asset() {
        let asset = btf_runtime::testing::sample_asset(4, 12, 8, btf_runtime::ResidualKind::Root);
        let assets = vec![std::sync::Arc::new(crate::SceneAsset::new("sample", asset))];
        let mut scene = Scene::built_in(&crate::MeshChoice::Plane, assets, [1.0; 2]).unwrap();
        // Only the plane is in the picture.
        scene.camera.fov_deg = 10.0;
        let mean = |mode, scene: &Scene| {
            let shade = ShadeOptions { mode, ..ShadeOptions::default() };
            let params = RenderParams { shade, frames: 64, ..cpu([24, 24]) };
            let picture = render(scene, &params, &Control::SILENT).unwrap().picture;
            picture.radiance.iter().map(|c| f64::from(c[1])).sum::<f64>() / picture.radiance.len() as f64
        };
        let mut ambient = scene.clone();
        ambient.lights.clear();
        ambient.ambient = crate::Ambient { radiance: [0.7; 3], distance: 1e6 };
        let expected = mean(RenderMode::Direct, &ambient);
        scene.surround(crate::Environment::new(16, 8, &[0.7; 16 * 8 * 3]));
        for mode in [RenderMode::Direct, RenderMode::Path] {
            let found = mean(mode, &scene);
            assert!((found / expected - 1.0).abs() < 0.02, "{mode:?}: {found} {expected}");
        }
    }

    #[test]
    fn drawn_lights_have_the_mean_of_all_and_an_error_that_falls() {
        let mut scene = Scene::from_objects(Path::new("sphere"), vec![grey(mesh::sphere())], Vec::new()).unwrap();
        scene.place_lights(1024);
        // Uneven lights: every seventh is ten times as bright.
        scene.lights.iter_mut().step_by(7).for_each(|light| light.intensity = light.intensity.map(|x| 10.0 * x));
        let picture = |light_samples, frames| {
            let shade = ShadeOptions { light_samples, ..ShadeOptions::default() };
            let mut scene = scene.clone();
            // The same pixels in every frame.
            scene.camera.fov_deg = 30.0;
            render(&scene, &RenderParams { shade, frames, ..cpu([24, 24]) }, &Control::SILENT).unwrap().picture.radiance
        };
        let (all_one, all_many) = (picture(1024, 1), picture(1024, 32));
        let error = |a: &[[f32; 3]], b: &[[f32; 3]]| {
            let square: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a[1] - b[1]).powi(2)).sum();
            let mean: f64 = b.iter().map(|b| f64::from(b[1])).sum::<f64>() / b.len() as f64;
            (
                (square / b.len() as f64).sqrt() / mean,
                a.iter().map(|a| f64::from(a[1])).sum::<f64>() / b.len() as f64 / mean,
            )
        };
        let (few, _) = error(&picture(4, 1), &all_one);
        let (some, _) = error(&picture(32, 1), &all_one);
        let (long, mean) = error(&picture(4, 32), &all_many);
        println!(
            "relative error with 1024 lights: {few:.3} of 4 samples, {some:.3} of 32, {long:.3} of 4 over 32 frames"
        );
        assert!(some < few / 2.0 && long < few / 4.0, "{few} {some} {long}");
        assert!((mean - 1.0).abs() < 0.01, "{mean}");
        // Planted difference: one light less in a thousand is not what makes the error.
        scene.lights.truncate(512);
        let half = render(&scene, &cpu([24, 24]), &Control::SILENT).unwrap().picture.radiance;
        assert!(error(&half, &all_one).1 < 0.7);
    }

    #[test]
    fn on_a_convex_body_paths_and_ambient_light_agree() {
        // An asset, so that its sampling is what is tested; nothing near, so that no light goes two ways.
        let asset = btf_runtime::testing::sample_asset(3, 12, 8, btf_runtime::ResidualKind::Root);
        let assets = vec![std::sync::Arc::new(crate::SceneAsset::new("sample", asset))];
        let mut scene = Scene::built_in(&crate::MeshChoice::Plane, assets, [1.0; 2]).unwrap();
        scene.lights.clear();
        scene.background = [0.0; 3];
        scene.ambient = crate::Ambient { radiance: [1.0; 3], distance: 1e6 };
        let mean = |mode, scene: &Scene| {
            let shade = ShadeOptions { mode, depth: 3, ..ShadeOptions::default() };
            let params = RenderParams { shade, frames: 64, ..cpu([32, 32]) };
            let picture = render(scene, &params, &Control::SILENT).unwrap().picture;
            picture.radiance.iter().map(|c| f64::from(c[1])).sum::<f64>() / picture.radiance.len() as f64
        };
        let (direct, path) = (mean(RenderMode::Direct, &scene), mean(RenderMode::Path, &scene));
        assert!(direct > 0.01 && (path / direct - 1.0).abs() < 0.02, "{direct} {path}");
        // Planted difference: another sky.
        scene.ambient.radiance = [0.9; 3];
        assert!((mean(RenderMode::Path, &scene) / direct - 1.0).abs() > 0.05);
    }

    #[test]
    fn a_turntable_goes_round_once_and_begins_with_the_picture() {
        let mut scene = Scene::from_objects(Path::new("cube"), vec![grey(mesh::cube("cube"))], Vec::new()).unwrap();
        scene.camera.eye = glam::Vec3::new(3.0, 2.0, 6.0);
        let mut pictures = Vec::new();
        render_sequence(&scene, &cpu([16, 16]), &Sequence::turntable(4), &Control::SILENT, &mut |number, rendered| {
            assert_eq!(number as usize, pictures.len());
            pictures.push(rendered.picture.radiance);
            Ok(())
        })
        .unwrap();
        assert_eq!(pictures.len(), 4);
        assert_eq!(pictures[0], render(&scene, &cpu([16, 16]), &Control::SILENT).unwrap().picture.radiance);
        // The light stays where it is, so that every side looks different.
        assert!((1..4).all(|i| pictures[i] != pictures[i - 1]) && pictures[3] != pictures[0]);
        let stopped =
            render_sequence(&scene, &cpu([8, 8]), &Sequence::turntable(9), &Control::SILENT, &mut |number, _| {
                if number == 2 { Err(ViewerError::Interrupted) } else { Ok(()) }
            });
        assert!(matches!(stopped, Err(ViewerError::Interrupted)));
    }

    #[test]
    fn a_sequence_shows_the_wind_as_it_is_at_each_moment() {
        use crate::scene::landscape::{Landscape, LandscapeParams};
        let params = LandscapeParams { times: 1, volumes: Vec::new(), meshes: Vec::new(), wind_m_per_s: Some(4.0) };
        let (mut scene, _) = Landscape::Lawn.scene(&params).unwrap();
        scene.camera = scene.more_cameras[1];
        scene.blow(7.0).unwrap();
        let mut pictures = Vec::new();
        let sequence = Sequence { pictures: 3, turn_rad: 0.0, interval_s: 0.25 };
        render_sequence(&scene, &cpu([24, 16]), &sequence, &Control::SILENT, &mut |_, rendered| {
            pictures.push(rendered.picture.radiance);
            Ok(())
        })
        .unwrap();
        assert!(pictures[0] != pictures[1] && pictures[1] != pictures[2]);
        for (number, picture) in pictures.iter().enumerate() {
            scene.blow(7.0 + 0.25 * number as f64).unwrap();
            assert_eq!(*picture, render(&scene, &cpu([24, 16]), &Control::SILENT).unwrap().picture.radiance);
        }
        assert!(scene.blow(f64::NAN).is_err());
    }

    #[test]
    fn cancelling_ends_with_exit_code_130_and_bad_sizes_with_2() {
        let scene = Scene::from_objects(Path::new("sphere"), vec![grey(mesh::sphere())], Vec::new()).unwrap();
        let stop = Control { cancelled: &|| true, ..Control::SILENT };
        assert_eq!(render(&scene, &cpu([8, 8]), &stop).err().map(|error| error.exit_code()), Some(130));
        for size in [[0, 8], [8, MAX_SIDE + 1]] {
            assert_eq!(render(&scene, &cpu(size), &Control::SILENT).err().map(|error| error.exit_code()), Some(2));
        }
    }
}
