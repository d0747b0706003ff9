//! Scales the extinction of voxels until parallel rays through the volume let through what rays past the model do: a
//! tomography by ordered subsets, one view a subset [Hudson & Larkin 1994], with the steps of SART [Andersen & Kak 1984].

use super::occluder::Occluder;
use super::projection::{HALF_SIDE, Projection, spread_directions};
use btf_runtime::voltex::{NO_VOXEL, Voltex, VoltexRay, Voxel, Walk};
use rayon::prelude::*;

/// How a level is refitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RefitParams {
    /// Directions from which is looked, spread over the sphere; none leaves the voxels as they are.
    pub views: usize,
    /// Times that all views are gone through.
    pub passes: usize,
    /// Rays along each side of a pixel, which is as large as a voxel.
    pub rays: usize,
}

impl Default for RefitParams {
    fn default() -> RefitParams {
        RefitParams { views: 24, passes: 2, rays: 4 }
    }
}

/// Share of a step that is gone in the first pass; in the last a tenth of it.
const RELAXATION: f32 = 0.5;
/// What of a step's weight stands for doubt.
const DOUBT: f32 = 1e-3;
/// Blocks of rows that are summed apart, so that sums do not depend on threads.
const BLOCKS: usize = 8;
/// Optical depth beyond which a ray is dark.
const DARK: f32 = 14.0;
/// Largest change of a voxel, and of all together, as a logarithm.
const MOST_CHANGE: f32 = 4.0;

/// A level's voxels while they are refitted.
struct Level<'a> {
    voltex: &'a Voltex,
    level: u32,
    /// Of each voxel of the volume its place among those of the level.
    place: Vec<u32>,
    voxels: Vec<Voxel>,
    rays: usize,
    pixel: f32,
    /// Pixels on a side of a view.
    count: usize,
}

/// What rays through one view say.
#[derive(Clone)]
struct Sums {
    slope: Vec<f32>,
    weight: Vec<f32>,
    /// Of what is opaque: of the model, and of the volume more than that.
    opaque: [f64; 2],
}

impl Level<'_> {
    /// Share of light that passes the model in each pixel of a view.
    fn truth(&self, view: &Projection, occluder: &Occluder) -> Vec<f32> {
        let through = |i: usize| {
            let rays = self.rays * self.rays;
            let free = |s: &usize| !occluder.occluded(self.origin(view, i, *s), view.direction, 4.0);
            (0..rays).filter(free).count() as f32 / rays as f32
        };
        (0..self.count * self.count).into_par_iter().map(through).collect()
    }

    /// Where ray `s` of pixel `i` begins.
    fn origin(&self, view: &Projection, i: usize, s: usize) -> glam::Vec3 {
        let at = |x: usize, s: usize| (x as f32 + (s as f32 + 0.5) / self.rays as f32) * self.pixel - HALF_SIDE;
        view.origin(at(i % self.count, s % self.rays), at(i / self.count, s / self.rays))
    }

    /// How the scales `logs` of the voxels should change by what is seen in a view.
    fn sums(&self, view: &Projection, truth: &[f32], logs: &[f32]) -> Sums {
        let d = view.direction.to_array();
        let extinction = |(voxel, log): (&Voxel, &f32)| voxel.extinction_along(d) * log.exp();
        let sigmas: Vec<f32> = self.voxels.par_iter().zip(logs).map(extinction).collect();
        let rows = self.count.div_ceil(BLOCKS);
        let none = Sums { slope: vec![0.0; logs.len()], weight: vec![0.0; logs.len()], opaque: [0.0; 2] };
        let block = |block: usize| {
            let mut sums = none.clone();
            let last = ((block + 1) * rows).min(self.count) * self.count;
            for i in (block * rows * self.count).min(last)..last {
                self.add_pixel(view, i, truth[i], &sigmas, &mut sums);
            }
            sums
        };
        let blocks: Vec<Sums> = (0..BLOCKS).into_par_iter().map(block).collect();
        blocks.into_iter().fold(none, |mut sum, block| {
            sum.slope.iter_mut().zip(block.slope).for_each(|(a, b)| *a += b);
            sum.weight.iter_mut().zip(block.weight).for_each(|(a, b)| *a += b);
            [0, 1].into_iter().for_each(|k| sum.opaque[k] += block.opaque[k]);
            sum
        })
    }

    fn add_pixel(&self, view: &Projection, i: usize, truth: f32, sigmas: &[f32], sums: &mut Sums) {
        let direction = view.direction.to_array();
        let share = 1.0 / (self.rays * self.rays) as f32;
        // What each ray meets: voxel and length; and where among these each ray ends, with what passes it.
        let mut met: Vec<(u32, f32)> = Vec::new();
        let mut ends: Vec<(usize, f32)> = Vec::new();
        for s in 0..self.rays * self.rays {
            let ray = VoltexRay { origin: self.origin(view, i, s).to_array(), direction };
            let mut walk = Walk::new(ray, 0.0, 4.0, self.voltex.level_count());
            let mut depth = 0.0;
            while let Some(segment) = walk.next(self.voltex, self.level) {
                if segment.cell.voxel == NO_VOXEL {
                    continue;
                }
                let place = self.place[segment.cell.voxel as usize];
                let length = segment.t1 - segment.t0;
                met.push((place, length));
                depth += sigmas[place as usize] * length;
                if depth > DARK {
                    break;
                }
            }
            ends.push((met.len(), (-depth).exp()));
        }
        if met.is_empty() {
            return;
        }
        let excess = share * ends.iter().map(|(_, through)| through).sum::<f32>() - truth;
        sums.opaque[0] += f64::from(1.0 - truth);
        sums.opaque[1] -= f64::from(excess);
        let parts = || {
            let starts = std::iter::once(0).chain(ends.iter().map(|(end, _)| *end));
            starts.zip(&ends).flat_map(|(start, (end, through))| {
                met[start..*end].iter().map(move |(place, length)| {
                    let place = *place as usize;
                    (place, share * through * sigmas[place] * length)
                })
            })
        };
        let total: f32 = parts().map(|(_, part)| part).sum();
        for (place, part) in parts() {
            sums.slope[place] -= part * excess;
            sums.weight[place] += part * total;
        }
    }
}

/// Refits `level` of `voltex` to what the `occluder` in the same unit cube hides.
///
/// Deterministic. Cost: `views * passes` times (1.7 voxels a side)^2 times `rays^2` rays through the volume.
pub fn refit(voltex: &mut Voltex, level: u32, occluder: &Occluder, params: &RefitParams) {
    let numbers = voltex.numbers_at(level);
    let mut place = vec![u32::MAX; voltex.voxel_count()];
    numbers.iter().enumerate().for_each(|(i, number)| place[*number as usize] = i as u32);
    let pixel = voltex.voxel_side(level);
    let own = Level {
        voltex: &*voltex,
        level,
        place,
        voxels: numbers.iter().map(|number| voltex.voxel(*number)).collect(),
        rays: params.rays,
        pixel,
        count: (2.0 * HALF_SIDE / pixel).ceil() as usize,
    };
    let views: Vec<Projection> = spread_directions(params.views, 0.3).into_iter().map(Projection::new).collect();
    let truths: Vec<Vec<f32>> = views.iter().map(|view| own.truth(view, occluder)).collect();
    let mut logs = vec![0f32; numbers.len()];
    for pass in 0..params.passes {
        let relaxation = RELAXATION * 0.1f32.powf(pass as f32 / (params.passes.max(2) - 1) as f32);
        for subset in 0..views.len() {
            // One view after the other is far from the one before.
            let view = subset * coprime_stride(views.len()) % views.len();
            let sums = own.sums(&views[view], &truths[view], &logs);
            for (i, log) in logs.iter_mut().enumerate() {
                let step = relaxation * sums.slope[i] / (sums.weight[i] + DOUBT);
                *log = (*log - step).clamp(-MOST_CHANGE, MOST_CHANGE);
            }
        }
    }
    let common = common_change(&own, &views, &truths, &logs);
    let scaled: Vec<Voxel> =
        own.voxels.iter().zip(&logs).map(|(voxel, log)| voxel.scaled((log + common).exp())).collect();
    numbers.iter().zip(scaled).for_each(|(number, voxel)| voltex.set_voxel(*number, &voxel));
}

/// What all voxels together lack so that the volume hides as much as the model in the mean over the views: least squares
/// per pixel alone leave it a few percent too clear or too dark.
fn common_change(own: &Level, views: &[Projection], truths: &[Vec<f32>], logs: &[f32]) -> f32 {
    // Secant steps on the ratio of what is hidden.
    let ratio = |change: f32| {
        let changed: Vec<f32> = logs.iter().map(|log| log + change).collect();
        let opaque = views.iter().zip(truths).fold([0.0; 2], |sum, (view, truth)| {
            let sums = own.sums(view, truth, &changed);
            [sum[0] + sums.opaque[0], sum[1] + sums.opaque[1]]
        });
        if opaque[0] > 0.0 { (opaque[1] / opaque[0]) as f32 } else { 0.0 }
    };
    if views.is_empty() {
        return 0.0;
    }
    let first = ratio(0.0);
    let guess = (-2.0 * first).clamp(-1.0, 1.0);
    let second = ratio(guess);
    if (first - second).abs() < 1e-6 {
        return 0.0;
    }
    (guess * first / (first - second)).clamp(-1.0, 1.0)
}

/// A step through `count` views that meets all of them, about a third of them on.
fn coprime_stride(count: usize) -> usize {
    fn gcd(a: usize, b: usize) -> usize {
        if b == 0 { a } else { gcd(b, a % b) }
    }
    (count / 3 + 1..).find(|stride| gcd(*stride, count) == 1).unwrap_or(1)
}
