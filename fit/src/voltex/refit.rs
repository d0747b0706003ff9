//! Scales the extinction of voxels until parallel rays through the volume let through what rays past the model do: a
//! tomography by ordered subsets [Hudson & Larkin 1994], one view a subset, with the steps of SART [Andersen & Kak 1984].

use super::occluder::Occluder;
use btf_runtime::voltex::{NO_VOXEL, Voltex, VoltexRay, Voxel, Walk};
use glam::Vec3;
use rayon::prelude::*;

/// How a level is refitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RefitParams {
    /// Directions from which is looked, spread over the sphere.
    pub views: usize,
    /// Times that all views are gone through.
    pub passes: usize,
    /// Rays along each side of a pixel.
    pub rays: usize,
    /// Side of a pixel in voxels.
    pub pixel: f32,
    /// Share of a step that is gone in the first pass; a tenth of it in the last.
    pub relaxation: f32,
}

/// What of a step's weight stands for doubt.
const DOUBT: f32 = 1e-3;
/// Blocks of rows that are summed apart, so that sums do not depend on threads.
const BLOCKS: usize = 8;
/// Optical depth beyond which a ray is dark.
const DARK: f32 = 14.0;

/// Unit vectors spread over the sphere [Fibonacci lattice].
pub fn spread_directions(count: usize, turn: f32) -> Vec<Vec3> {
    let golden = std::f32::consts::PI * (3.0 - 5f32.sqrt());
    (0..count)
        .map(|i| {
            let z = 1.0 - (2.0 * i as f32 + 1.0) / count as f32;
            let (sin, cos) = (golden * i as f32 + turn).sin_cos();
            let r = (1.0 - z * z).sqrt();
            Vec3::new(r * cos, r * sin, z)
        })
        .collect()
}

/// Parallel rays through the unit cube.
#[derive(Debug, Clone, Copy)]
pub struct Projection {
    /// Where rays go.
    pub direction: Vec3,
    right: Vec3,
    up: Vec3,
}

/// Half the side of a square in which every view of the unit cube lies.
pub const HALF_SIDE: f32 = 0.867;

impl Projection {
    /// Along a unit vector.
    pub fn new(direction: Vec3) -> Projection {
        let right = direction.any_orthonormal_vector();
        Projection { direction, right, up: direction.cross(right) }
    }

    /// Where the ray at `u`, `v` begins, outside the cube.
    pub fn origin(&self, u: f32, v: f32) -> Vec3 {
        Vec3::splat(0.5) + self.right * u + self.up * v - self.direction
    }
}

/// Refits `level` of `tree`.
pub fn refit(tree: &mut Voltex, level: u32, occluder: &Occluder, params: &RefitParams) -> f32 {
    let numbers = tree.numbers_at(level);
    let mut place = vec![u32::MAX; tree.voxel_count()];
    numbers.iter().enumerate().for_each(|(i, number)| place[*number as usize] = i as u32);
    let voxels: Vec<Voxel> = numbers.iter().map(|number| tree.voxel(*number)).collect();
    let mut logs = vec![0f32; numbers.len()];
    let side = (1u32 << level) as f32 / (1u32 << tree.level_count()) as f32;
    let pixel = side * params.pixel;
    let count = (2.0 * HALF_SIDE / pixel).ceil() as usize;
    let directions = spread_directions(params.views, 0.3);
    let mut truths: Vec<Vec<f32>> = Vec::new();
    let mut rmse = 0.0;
    let stride = (1..).find(|s| gcd(*s, params.views) == 1 && 3 * s > params.views).unwrap_or(1);
    for pass in 0..params.passes {
        let relaxation = params.relaxation * 0.1f32.powf(pass as f32 / (params.passes.max(2) - 1) as f32);
        let (mut error, mut pixels) = (0.0f64, 0usize);
        for subset in 0..params.views {
            let view = subset * stride % params.views;
            let w = Projection::new(directions[view]);
            let d = w.direction.to_array();
            // Extinction of every voxel along the view.
            let sigmas: Vec<f32> = voxels
                .par_iter()
                .zip(&logs)
                .map(|(voxel, log)| voxel.extinction.form(d, d).max(0.0).sqrt() * log.exp())
                .collect();
            let sub = params.rays;
            let ray_at = |x: usize, y: usize, s: usize| {
                let at = |i: usize, s: usize| (i as f32 + (s as f32 + 0.5) / sub as f32) * pixel - HALF_SIDE;
                w.origin(at(x, s % sub), at(y, s / sub))
            };
            if pass == 0 {
                let truth = (0..count * count)
                    .into_par_iter()
                    .map(|i| {
                        let through = (0..sub * sub)
                            .filter(|s| !occluder.occluded(ray_at(i % count, i / count, *s), w.direction, 4.0))
                            .count();
                        through as f32 / (sub * sub) as f32
                    })
                    .collect();
                truths.push(truth);
            }
            let truth = &truths[subset];
            let rows = count.div_ceil(BLOCKS);
            let tree = &*tree;
            let sums: Vec<(Vec<f32>, Vec<f32>, f64, usize)> = (0..BLOCKS)
                .into_par_iter()
                .map(|block| {
                    let mut slope = vec![0f32; numbers.len()];
                    let mut weight = vec![0f32; numbers.len()];
                    let (mut error, mut pixels) = (0.0f64, 0);
                    let mut met: Vec<(u32, f32)> = Vec::new();
                    let mut ends: Vec<(usize, f32)> = Vec::new();
                    for y in block * rows..((block + 1) * rows).min(count) {
                        for x in 0..count {
                            met.clear();
                            ends.clear();
                            let mut mean = 0.0;
                            for s in 0..sub * sub {
                                let origin = ray_at(x, y, s).to_array();
                                let mut walk =
                                    Walk::new(VoltexRay { origin, direction: d }, 0.0, 4.0, tree.level_count());
                                let mut depth = 0.0;
                                while let Some(segment) = walk.next(tree, level) {
                                    if segment.cell.voxel == NO_VOXEL {
                                        continue;
                                    }
                                    let i = place[segment.cell.voxel as usize];
                                    let length = segment.t1 - segment.t0;
                                    met.push((i, length));
                                    depth += sigmas[i as usize] * length;
                                    if depth > DARK {
                                        break;
                                    }
                                }
                                let through = (-depth).exp();
                                ends.push((met.len(), through));
                                mean += through / (sub * sub) as f32;
                            }
                            if met.is_empty() {
                                continue;
                            }
                            let e = mean - truth[y * count + x];
                            error += f64::from(e * e);
                            pixels += 1;
                            let mut total = 0.0;
                            let mut from = 0;
                            for (end, through) in &ends {
                                for (i, length) in &met[from..*end] {
                                    total += through * sigmas[*i as usize] * length / (sub * sub) as f32;
                                }
                                from = *end;
                            }
                            from = 0;
                            for (end, through) in &ends {
                                for (i, length) in &met[from..*end] {
                                    let part = through * sigmas[*i as usize] * length / (sub * sub) as f32;
                                    slope[*i as usize] -= part * e;
                                    weight[*i as usize] += part * total;
                                }
                                from = *end;
                            }
                        }
                    }
                    (slope, weight, error, pixels)
                })
                .collect();
            for i in 0..numbers.len() {
                let (slope, weight) = sums.iter().fold((0.0, 0.0), |(s, w), block| (s + block.0[i], w + block.1[i]));
                logs[i] = (logs[i] - relaxation * slope / (weight + DOUBT)).clamp(-4.0, 4.0);
            }
            error += sums.iter().map(|block| block.2).sum::<f64>();
            pixels += sums.iter().map(|block| block.3).sum::<usize>();
        }
        rmse = (error / pixels.max(1) as f64).sqrt() as f32;
    }
    for ((number, voxel), log) in numbers.iter().zip(&voxels).zip(&logs) {
        tree.set_voxel(*number, &voxel.scaled(log.exp()));
    }
    rmse
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}
