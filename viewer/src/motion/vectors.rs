//! Motion vectors of a picture's pixels, over the first things that their rays meet.
//!
//! A sample shows the place up to which half of its light is hidden: a volume there, else the surface behind, else the
//! sky. A pixel has the mean of the samples that are about as far away as its median sample: over one thing that is the
//! mean over the pixel, as of its colour, and on the edge between two things it is the motion of the one that fills more
//! of the pixel and never one between, which nothing in the picture has.

use super::motion_picture::{BACKGROUND_DEPTH, MotionPicture, MotionPixel};
use super::pose::Pose;
use crate::cpu::path::Path;
use crate::cpu::shader::{FAR, Shader};
use crate::error::ViewerError;
use crate::geometry::bvh::NO_HIT;
use crate::options::ShadeOptions;
use crate::scene::camera::CameraFrame;
use crate::scene::scene::Scene;
use crate::volume::volumes::SkinTet;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Samples a pixel at most: motion varies little within a pixel, and these tell which of two things fills more of it.
const MAX_SAMPLES: u32 = 4;
/// Share of light that is hidden up to the place that a sample shows.
const SHOWN: f32 = 0.5;
/// Share of the median's nearness by which that of a sample of the same thing may differ.
const SAME_THING: f64 = 0.1;
/// Least depth that is projected, scene units: what was behind the eye is taken to have left the picture.
const MIN_DEPTH: f64 = 1e-6;
/// Largest motion, pixels: the largest number of half precision, to which other programs may convert.
const MAX_MOTION: f64 = 65504.0;

/// What one sample shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Seen {
    /// One over the depth along the camera's axis; 0 for the sky.
    pub nearness: f64,
    pub motion: DVec2,
}

/// The thing on which a sample's place is.
#[derive(Clone, Copy)]
enum Thing {
    Instance(usize),
    /// A volume, and the tetrahedron that it is mapped by; `None` where it stands on its own.
    Volume(Option<SkinTet>),
}

/// Returns the motion of all pixels, from the scene as it is to where things were `before`, for a picture of so many
/// samples. `cancelled` is asked before each row. Cost: that of the eye's rays of as many samples, 4 at most.
///
/// # Errors
/// [`ViewerError::Interrupted`].
pub(crate) fn motion_of(
    scene: &Scene,
    before: &Pose,
    [width, height]: [u32; 2],
    options: &ShadeOptions,
    samples: u32,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<MotionPicture, ViewerError> {
    let camera = scene.camera.frame(width, height);
    let camera_before = before.camera.frame(width, height);
    let pixel = |x: u32, y: u32| {
        let seen = (0..samples.clamp(1, MAX_SAMPLES)).map(|sample| {
            let shader = Shader::of_first_hit(scene, camera, *options, [x, y], sample);
            shader.motion_seen([x, y], before, &camera_before)
        });
        of_most(&mut seen.collect::<Vec<Seen>>())
    };
    let row = |y: u32| {
        let is_wanted = !cancelled();
        is_wanted.then(|| (0..width).map(|x| pixel(x, y)).collect::<Vec<MotionPixel>>())
    };
    let rows: Option<Vec<Vec<MotionPixel>>> = (0..height).into_par_iter().map(row).collect();
    let pixels = rows.ok_or(ViewerError::Interrupted)?.concat();
    Ok(MotionPicture { width, height, pixels })
}

/// Returns what a pixel has of its samples, at least one: the mean of those near the median.
pub(super) fn of_most(seen: &mut [Seen]) -> MotionPixel {
    seen.sort_by(|a, b| a.nearness.total_cmp(&b.nearness));
    // Of two things that fill as much, the nearer one.
    let median = seen[seen.len() / 2].nearness;
    let is_same = |one: &&Seen| (one.nearness - median).abs() <= SAME_THING * median;
    let (mut count, mut nearness, mut motion) = (0.0, 0.0, DVec2::ZERO);
    for one in seen.iter().filter(is_same) {
        (count, nearness, motion) = (count + 1.0, nearness + one.nearness, motion + one.motion);
    }
    let depth = if nearness > 0.0 { (count / nearness) as f32 } else { BACKGROUND_DEPTH };
    MotionPixel { motion: (motion / count).as_vec2().to_array(), depth: depth.min(BACKGROUND_DEPTH) }
}

impl Shader<'_> {
    /// Returns what the sample of a pixel shows, and how it has moved.
    fn motion_seen(&self, [x, y]: [u32; 2], before: &Pose, camera_before: &CameraFrame) -> Seen {
        let path = Path::from_eye(self.camera.eye, self.camera.direction(x, y, self.jitter));
        let (eye, direction) = (path.origin.as_dvec3(), path.direction.as_dvec3());
        let Some((t, thing)) = self.place_shown(&path) else {
            // A point at infinity turns with the camera alone.
            let motion = pixel_of(camera_before, direction) - pixel_of(&self.camera, direction);
            return Seen { nearness: 0.0, motion: limited(motion) };
        };
        let point = eye + f64::from(t) * direction;
        let point_before = match (thing, &self.scene.volumes) {
            (Thing::Instance(instance), _) => before.of_instance(&self.scene.geometry, instance, point),
            (Thing::Volume(Some(within)), Some(volumes)) => before.of_skin(volumes, within, point),
            // Volumes that stand on their own stand still.
            (Thing::Volume(_), _) => point,
        };
        let now = pixel_of(&self.camera, point - eye);
        let then = pixel_of(camera_before, point_before - camera_before.eye.as_dvec3());
        let depth = f64::from(t) * direction.dot(self.camera.forward.as_dvec3());
        Seen { nearness: 1.0 / depth.max(MIN_DEPTH), motion: limited(then - now) }
    }

    /// Returns the distance along the eye's ray of the place that it shows, and the thing there; `None` for the sky.
    fn place_shown(&self, path: &Path) -> Option<(f32, Thing)> {
        let (hit, sunk) = self.trace_closest(path.origin, path.direction);
        if let Some(volumes) = &self.scene.volumes {
            let width_at = |t: f32| t * self.voxel_width();
            let t_max = if hit.primitive == NO_HIT { FAR } else { hit.t };
            let (mut hidden, mut shown) = (0.0, None);
            volumes.march(path.origin, path.direction, t_max, &self.lod_transition, width_at, |point| {
                hidden += point.weight;
                if shown.is_none() && hidden >= SHOWN {
                    shown = Some((point.t, Thing::Volume(point.within)));
                }
            });
            if shown.is_some() {
                return shown;
            }
        }
        if hit.primitive == NO_HIT {
            return None;
        }
        // A displaced surface lies below the triangle.
        let (_, relief) = self.surface_of(&hit, sunk, path.direction);
        let below = relief.map_or(0.0, |(relief, _)| sunk / relief.texels_per_unit);
        Some((hit.t + below, Thing::Instance(hit.instance as usize)))
    }
}

/// Returns where something is seen, pixels from the picture's top left corner; `towards` is its place from the eye, or for
/// a point at infinity its direction.
fn pixel_of(camera: &CameraFrame, towards: DVec3) -> DVec2 {
    let [forward, right, up] = [camera.forward, camera.right, camera.up].map(|axis| axis.as_dvec3());
    let depth = towards.dot(forward).max(MIN_DEPTH);
    let x = towards.dot(right) / (depth * right.length_squared());
    let y = towards.dot(up) / (depth * up.length_squared());
    DVec2::new(0.5 * (1.0 + x) * f64::from(camera.width), 0.5 * (1.0 - y) * f64::from(camera.height))
}

/// Returns a motion within its range.
fn limited(motion: DVec2) -> DVec2 {
    motion.clamp(DVec2::splat(-MAX_MOTION), DVec2::splat(MAX_MOTION))
}
