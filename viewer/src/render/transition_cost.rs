//! The cost of a view by where meshes pass into the volumes that stand in for them, measured, and the cheapest such
//! transition.
//!
//! A path through a volume takes longer than one through a few triangles and has less noise, since it sees all that a
//! voxel holds at once; the farther away leaves are, the more so. What a picture costs is the time of a path times its
//! variance, which is the time to any given noise whatever the number of paths. Noise is that of pixels spread over the
//! picture, drawn on the CPU; time is theirs, or that of a whole frame where a GPU draws.
//!
//! All pixels have as many paths, so the sums of times and of variances are what is multiplied: half of a picture as one and half
//! as the other may cost more than either alone.
//!
//! When it is wrong: a volume's own error, which more paths do not take away, is not counted; the noise of a few thousand
//! pixels is known to some hundredths.

use crate::cpu::picture::CpuPicture;
use crate::error::ViewerError;
use crate::light::solar_spectrum::luminance;
use crate::options::ShadeOptions;
use crate::render::bricks::load_bricks;
use crate::render::control::Control;
use crate::render::headless::{RenderParams, Session};
use crate::scene::camera::Camera;
use crate::scene::scene::Scene;
use serde::Serialize;
use web_time::Instant;

/// Widths at which a transition can be, pixels: leaves are narrower than the first only far beyond what volumes are for, and wider
/// than the last in no picture. Volumes, or meshes, are seen alone.
pub const TRANSITION_PIXELS: [f32; 2] = [1.0 / 1024.0, 1024.0];
/// Widths that are compared besides, from wide to narrow.
const COMPARED: [f32; 7] = [4.0, 2.0, 1.0, 0.5, 0.25, 0.125, 0.0625];
/// The usual width, pixels, which is kept where another saves less than a twentieth. Wider leaves stay meshes whatever they cost, because
/// their volumes are seen to be blurred.
pub const USUAL_TRANSITION_PIXELS: f32 = 1.0;
/// Share of the cost that another transition than the usual one must save.
const MIN_SAVING: f64 = 0.05;
/// Parts of the picture that are drawn, along both sides.
const PARTS: [u32; 2] = [5, 4];
/// Pixels along each side of such a part.
const PART_SIDE: u32 = 12;
/// Paths of a pixel from which its variance is told.
const PATHS: u32 = 4;

/// The cost of a view with one transition.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TransitionCost {
    /// Width in pixels of leaves of which half of the paths see the mesh and half the volume.
    pub pixels: f32,
    /// Time of a path for each pixel of the picture, milliseconds.
    pub frame_ms: f64,
    /// Variance of a path's luminance, mean over the pixels.
    pub variance: f64,
}

impl TransitionCost {
    /// Returns the time to a noise of 1, milliseconds: that to any other is in proportion.
    pub fn cost(&self) -> f64 {
        self.frame_ms * self.variance
    }
}

/// Returns the least cost of all, milliseconds to a noise of 1; infinity of none.
pub fn least_cost(costs: &[TransitionCost]) -> f64 {
    costs.iter().map(TransitionCost::cost).fold(f64::INFINITY, f64::min)
}

/// Returns the cheapest transition of those that leave leaves of a pixel and more meshes, pixels; the usual one, which is a pixel, where
/// none is cheaper by much, and where there is none.
pub fn cheapest(costs: &[TransitionCost]) -> f32 {
    let usual =
        costs.iter().find(|own| own.pixels == USUAL_TRANSITION_PIXELS).map_or(f64::INFINITY, TransitionCost::cost);
    let least =
        costs.iter().filter(|own| own.pixels <= USUAL_TRANSITION_PIXELS).min_by(|a, b| a.cost().total_cmp(&b.cost()));
    least.filter(|own| own.cost() < (1.0 - MIN_SAVING) * usual).map_or(USUAL_TRANSITION_PIXELS, |own| own.pixels)
}

/// Measures what the scene's camera sees with transitions from volumes alone to meshes alone; nothing where no volume stands in for a
/// mesh. `params` say by which renderer and with which settings. Cost: 3 to 10 seconds of two cores for a landscape, and two frames a
/// transition where a GPU draws.
///
/// # Errors
/// Those of [`render`](crate::render()).
pub fn measure_transitions(
    scene: &Scene,
    params: &RenderParams,
    control: &Control,
) -> Result<Vec<TransitionCost>, ViewerError> {
    params.check()?;
    if !scene.has_transitions() {
        return Ok(Vec::new());
    }
    let [least, most] = TRANSITION_PIXELS;
    let all: Vec<f32> = [most].into_iter().chain(COMPARED).chain([least]).collect();
    let mut scene = scene.clone();
    scene.scale_transitions(1.0 / most);
    // As fine as volumes alone ask for.
    let cameras = [scene.camera];
    load_bricks(&mut scene, &cameras, params.size, 1, params.volume_budget_mb, control)?;
    let mut session = Session::new(&scene, params, control)?;
    let mut latest = most;
    let mut costs = Vec::new();
    for (number, pixels) in all.iter().enumerate() {
        scene.scale_transitions(latest / pixels);
        latest = *pixels;
        let (path_ms, variance) = path_of(&scene, params, control)?;
        let frame_ms = session.frame_ms_after_change(&scene, params, control)?.unwrap_or(path_ms);
        costs.push(TransitionCost { pixels: *pixels, frame_ms, variance });
        (control.progress)((number + 1) as f32 / all.len() as f32);
    }
    Ok(costs)
}

/// Draws parts of the picture on the CPU; returns the milliseconds that a path of every pixel would take, and the variance
/// of a path.
fn path_of(scene: &Scene, params: &RenderParams, control: &Control) -> Result<(f64, f64), ViewerError> {
    let mut part = scene.clone();
    let (mut seconds, mut sum, mut pixels) = (0.0, 0.0, 0u64);
    for camera in parts(&scene.camera, params.size) {
        if (control.cancelled)() {
            return Err(ViewerError::Interrupted);
        }
        part.camera = camera;
        let (own_seconds, own_sum) = variance_of(&part, &params.shade);
        (seconds, sum) = (seconds + own_seconds, sum + own_sum);
        pixels += u64::from(PART_SIDE * PART_SIDE);
    }
    let of_picture = f64::from(params.size[0]) * f64::from(params.size[1]) / (pixels * u64::from(PATHS)) as f64;
    Ok((1e3 * seconds * of_picture, sum / pixels as f64))
}

/// Returns the cameras of parts of a picture, whose pixels are as wide as the picture's.
fn parts(camera: &Camera, [width, height]: [u32; 2]) -> impl Iterator<Item = Camera> {
    let frame = camera.frame(width, height);
    let shorter = width.min(height) as f32;
    let tangent = (0.5 * camera.fov_deg.to_radians()).tan() * PART_SIDE as f32 / shorter;
    let camera = *camera;
    (0..PARTS[0] * PARTS[1]).filter_map(move |number| {
        let at = [number % PARTS[0], number / PARTS[0]];
        let [x, y] = [0, 1].map(|axis| (at[axis] as f32 + 0.5) / PARTS[axis] as f32 * 2.0 - 1.0);
        let target = camera.eye + frame.forward + x * frame.right + y * frame.up;
        let own = Camera { target, fov_deg: 2.0 * tangent.atan().to_degrees(), ..camera };
        own.fault().is_none().then_some(own)
    })
}

/// Draws a part; returns the seconds that this took, and the sum over its pixels of the variance of a path's luminance.
fn variance_of(scene: &Scene, shade: &ShadeOptions) -> (f64, f64) {
    let mut picture = CpuPicture::new([PART_SIDE; 2]);
    // The first goes through the middle of each pixel.
    picture.samples = 1;
    let mut before = picture.sums.clone();
    let mut moments = vec![[0.0f64; 2]; before.len()];
    let mut seconds = 0.0;
    for _ in 0..PATHS {
        let start = Instant::now();
        picture.add_sample(scene, shade, &|| true);
        seconds += start.elapsed().as_secs_f64();
        for ((sum, before), [first, second]) in picture.sums.iter().zip(&before).zip(&mut moments) {
            let own = luminance([0, 1, 2].map(|channel| f64::from(sum[channel] - before[channel])));
            (*first, *second) = (*first + own, *second + own * own);
        }
        before.clone_from(&picture.sums);
    }
    let paths = f64::from(PATHS);
    let variances = moments.iter().map(|[first, second]| (second - first * first / paths) / (paths - 1.0));
    (seconds, variances.sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::backend::BackendChoice;
    use crate::render::headless::render;
    use crate::scene::material::Material;
    use crate::scene::mesh;
    use crate::scene::scene::SceneObject;
    use crate::volume::volumes::{VolumePlace, Volumes};
    use btf_runtime::testing::{Random, random_volume};
    use btf_runtime::voltex::Voltex;
    use glam::{Mat4, Vec3};
    use std::path::Path;
    use std::sync::Arc;

    /// A cube and, in its place, a volume from where its leaves are narrower than pixels.
    fn scene() -> Scene {
        let cube = SceneObject { part: mesh::cube("cube"), material: Material::plain([0.5; 3]) };
        let mut scene = Scene::from_objects(Path::new("cube"), vec![cube], Vec::new()).unwrap();
        // About a pixel in the picture.
        let leaf_width = 0.1;
        Arc::make_mut(&mut scene.geometry).set_leaf_widths(|_, _| leaf_width);
        let voltex = Arc::new(Voltex::new(&random_volume(&mut Random::new(3), 3, 0.4)));
        let world_from_volume = Mat4::from_scale(Vec3::splat(2.0)) * Mat4::from_translation(Vec3::splat(-0.5));
        let place = VolumePlace { volume: 0, world_from_volume, leaf_width };
        scene.volumes = Some(Arc::new(Volumes::new(vec![voltex], &[place], Vec::new()).unwrap()));
        scene
    }

    fn params() -> RenderParams {
        RenderParams { size: [48, 36], backend: BackendChoice::Cpu, ..RenderParams::default() }
    }

    #[test]
    fn transitions_go_from_volumes_alone_to_meshes_alone() {
        let picture = |scene: &Scene| render(scene, &params(), &Control::SILENT).unwrap().picture.radiance;
        let scaled = |factor| {
            let mut scene = scene();
            scene.scale_transitions(factor);
            picture(&scene)
        };
        let mut meshes = scene();
        meshes.volumes = None;
        Arc::make_mut(&mut meshes.geometry).set_leaf_widths(|_, _| 0.0);
        let meshes = picture(&meshes);
        let [least, most] = TRANSITION_PIXELS;
        assert!(scaled(1.0 / least) == meshes);
        assert!(scaled(1.0) != meshes);
        // The mesh is nowhere near enough to the eye.
        assert!(scaled(1.0 / most) != scaled(1.0));
        let mut volumes = scene();
        volumes.scale_transitions(1.0 / most);
        Arc::make_mut(&mut volumes.geometry).set_leaf_widths(|_, _| 1e-9);
        assert!(picture(&volumes) == scaled(1.0 / most));
    }

    #[test]
    fn all_transitions_are_measured_and_a_user_may_stop_that() {
        let costs = measure_transitions(&scene(), &params(), &Control::SILENT).unwrap();
        let [least, most] = TRANSITION_PIXELS;
        assert_eq!([costs[0].pixels, costs[costs.len() - 1].pixels], [most, least]);
        assert!(costs.is_sorted_by(|wide, narrow| wide.pixels > narrow.pixels) && costs.len() == 9);
        assert!(costs.iter().all(|own| own.frame_ms > 0.0 && own.variance > 0.0), "{costs:?}");
        // Fog and an even cube are told apart.
        assert!(costs[0].variance != costs[8].variance);
        let stop = Control { cancelled: &|| true, ..Control::SILENT };
        assert!(matches!(measure_transitions(&scene(), &params(), &stop), Err(ViewerError::Interrupted)));
        let mut plain = scene();
        plain.volumes = None;
        assert_eq!(measure_transitions(&plain, &params(), &Control::SILENT).unwrap(), []);
    }

    #[test]
    fn the_cheapest_transition_is_taken_if_it_saves_something_and_shows_no_blurred_leaf() {
        let cost = |pixels, frame_ms, variance| TransitionCost { pixels, frame_ms, variance };
        let [least, most] = TRANSITION_PIXELS;
        let costs =
            |of_meshes| [cost(most, 9.0, 0.1), cost(1.0, 5.0, 1.0), cost(0.5, 9.0, 1.0), cost(least, of_meshes, 1.0)];
        assert_eq!(cheapest(&costs(4.0)), least);
        assert_eq!(cheapest(&costs(4.9)), 1.0);
        assert_eq!(cheapest(&costs(6.0)), 1.0);
        assert_eq!(cheapest(&[]), 1.0);
    }

    #[test]
    fn the_pixels_of_parts_are_as_wide_as_the_picture_s() {
        let camera = scene().camera;
        for size in [[960, 540], [300, 700]] {
            let frame = camera.frame(size[0], size[1]);
            let all: Vec<Camera> = parts(&camera, size).collect();
            assert_eq!(all.len(), 20);
            for part in &all {
                let own = part.frame(PART_SIDE, PART_SIDE);
                assert!((own.pixel_width() / frame.pixel_width() - 1.0).abs() < 1e-4);
                // Within the picture.
                let ahead = own.forward / own.forward.dot(frame.forward);
                let [x, y] = [frame.right, frame.up].map(|side| ahead.dot(side) / side.length_squared());
                assert!(x.abs() < 1.0 && y.abs() < 1.0, "{x} {y}");
            }
            // Planted: the middle is not all of the picture.
            assert!(all.iter().any(|part| part.frame(8, 8).forward.dot(frame.forward) < 0.999));
        }
    }
}
