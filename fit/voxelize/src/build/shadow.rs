//! Fit of the shadows within a level: the distance at which rays to the light begin, and how many of their gaps eye and
//! light share, fitted to what the model itself shows.

use crate::build::lit::{Lit, even_light_along};
use crate::rays::along_ray::{depth_along, seen_along};
use crate::rays::occluder::Occluder;
use crate::rays::projection::{HALF_SIDE, Projection, rays_of_pixel, spread_directions};
use btf_runtime::voltex::{HOTSPOT_DEG, LevelShadow, MIN_SHARED, Voltex};
use glam::Vec3;
use rayon::prelude::*;

/// Parameters of fitting the shadows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShadowParams {
    /// Number of directions of the eye.
    pub views: usize,
    /// Number of lights around the eye for each angle.
    pub turns: usize,
    /// Pixels along a side of a picture at most; of larger pictures every n-th pixel is taken.
    pub pixels: usize,
}

impl Default for ShadowParams {
    fn default() -> ShadowParams {
        ShadowParams { views: 24, turns: 1, pixels: 48 }
    }
}

/// Offsets that are tried, in voxels.
const OFFSETS: [f32; 7] = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.3];
/// Rays along each side of a pixel past the model, and through the volume; more where a view has few pixels.
const MODEL_RAYS: usize = 4;
const VOLUME_RAYS: usize = 2;
/// Side of a pixel in voxels, as a renderer looks at a level.
const PIXEL_VOXELS: f32 = 2.0;

/// Pixels along the side of a picture of which `asked` are looked at. Rays through levels with more pixels meet more
/// voxels, of which each sends rays to the light that meet more, too.
const MAX_ASKED: usize = 64;
/// Pixels along the side of a picture that are looked at at least, as far as they were asked for.
const MIN_PIXELS: usize = 12;

/// Returns how many pixels along the side of a picture of `count` are looked at, where `asked` should be: fewer of
/// large pictures, so that all levels cost about as much.
fn pixels_of(asked: usize, count: usize) -> usize {
    (asked * MAX_ASKED / count.max(MAX_ASKED)).max(MIN_PIXELS.min(asked))
}

/// Contribution of a part of a pixel's ray: its light without shadow, and the optical depth towards the light for each
/// offset.
type Part = (f32, [f32; OFFSETS.len()]);

/// Fits the shadows of `level`.
pub fn fit_shadow(
    voltex: &Voltex,
    level: u32,
    occluder: &Occluder,
    lit: &impl Lit,
    params: &ShadowParams,
) -> LevelShadow {
    let side = voltex.voxel_side(level);
    let pixel = side * PIXEL_VOXELS;
    let count = (2.0 * HALF_SIDE / pixel).ceil() as usize;
    let stride = count.div_ceil(pixels_of(params.pixels, count));
    let [model_rays, volume_rays] = [MODEL_RAYS, VOLUME_RAYS].map(|rays| rays_of_pixel(rays, count));
    let share = 1.0 / (volume_rays * volume_rays) as f32;
    let views = spread_directions(params.views, 1.1);
    let mut shared = [[0f32; HOTSPOT_DEG.len()]; OFFSETS.len()];
    let mut errors = [0f64; OFFSETS.len()];
    for (angle, degrees) in HOTSPOT_DEG.iter().enumerate() {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let jobs: Vec<(Projection, Vec3, usize)> = (0..params.views * params.turns)
            .flat_map(|job| {
                let view = Projection::new(views[job / params.turns]);
                let turn = (job % params.turns) as f32 / params.turns as f32 * std::f32::consts::TAU + job as f32;
                let side = view.across(turn);
                let light = (-view.direction * cos + side * sin).normalize();
                (0..count).step_by(stride).map(move |y| (view, light, y))
            })
            .collect();
        let pixels: Vec<(f32, Vec<Part>)> = jobs
            .par_iter()
            .flat_map_iter(|(view, light, y)| {
                (0..count).step_by(stride).filter_map(move |x| {
                    let ray_at = |s: usize, n: usize| {
                        let at = |i: usize, s: usize| (i as f32 + (s as f32 + 0.5) / n as f32) * pixel - HALF_SIDE;
                        view.origin(at(x, s % n), at(*y, s / n))
                    };
                    let mut parts = Vec::new();
                    for s in 0..volume_rays * volume_rays {
                        add_parts(voltex, level, side, ray_at(s, volume_rays), view.direction, *light, &mut parts);
                    }
                    if parts.is_empty() {
                        return None;
                    }
                    let truth: f32 = (0..model_rays * model_rays)
                        .map(|s| even_light_along(occluder, lit, ray_at(s, model_rays), view.direction, *light))
                        .sum();
                    Some((truth / (model_rays * model_rays) as f32, parts))
                })
            })
            .collect();
        let truth: f64 = pixels.iter().map(|(truth, _)| f64::from(*truth)).sum();
        for o in 0..OFFSETS.len() {
            let light_of = |parts: &[Part], c: f32| -> f32 {
                share * parts.iter().map(|(light, depths)| light * (-(1.0 - c) * depths[o]).exp()).sum::<f32>()
            };
            let total = |c: f32| -> f64 { pixels.iter().map(|(_, parts)| f64::from(light_of(parts, c))).sum() };
            let (mut low, mut high) = (MIN_SHARED, 1.0f32);
            for _ in 0..17 {
                let middle = 0.5 * (low + high);
                if total(middle) < truth { low = middle } else { high = middle }
            }
            let c = 0.5 * (low + high);
            shared[o][angle] = c;
            let scale = 1.0 / pixels.iter().map(|(truth, _)| f64::from(truth * truth)).sum::<f64>().max(1e-30);
            errors[o] += scale
                * pixels.iter().map(|(truth, parts)| f64::from((light_of(parts, c) - truth).powi(2))).sum::<f64>();
        }
    }
    let best = (0..OFFSETS.len()).min_by(|a, b| errors[*a].total_cmp(&errors[*b])).unwrap_or(0);
    LevelShadow { offset: OFFSETS[best], shared: shared[best] }
}

fn add_parts(
    voltex: &Voltex,
    level: u32,
    side: f32,
    origin: Vec3,
    direction: Vec3,
    light: Vec3,
    parts: &mut Vec<Part>,
) {
    seen_along(voltex, level, origin, direction, |seen| {
        let value = seen.diffuse(voltex, -direction, light);
        let towards = seen.towards(voltex, light).normalize_or_zero() * side;
        let depths = OFFSETS.map(|offset| depth_along(voltex, level, seen.at + towards * offset, light));
        parts.push((seen.weight * value, depths));
    });
}
