//! Refit of the extinction: voxels are scaled until parallel rays through the volume let through what rays past the
//! model do, by a tomography with ordered subsets, one view a subset [Hudson & Larkin 1994], and the steps of SART
//! [Andersen & Kak 1984].

use crate::build::extinction::entries_along;
use crate::rays::occluder::Occluder;
use crate::rays::projection::{HALF_SIDE, Projection, rays_of_pixel, spread_directions};
use btf_runtime::voltex::{MAX_CLUMPING, NO_VOXEL, Sym3, Voltex, VoltexRay, Voxel, Walk};
use nalgebra::{Matrix6, Vector6};
use rayon::prelude::*;

/// Parameters of refitting a level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RefitParams {
    /// Views, spread over the sphere; 0 leaves the voxels as they are.
    pub views: usize,
    /// Passes over all views.
    pub passes: usize,
    /// Rays along each side of a pixel, which is as large as a voxel; more where a view has few pixels.
    pub rays: usize,
}

impl Default for RefitParams {
    fn default() -> RefitParams {
        RefitParams { views: 24, passes: 2, rays: 4 }
    }
}

/// Rays of a view at most, as long as there is one for each pixel: of fine levels, whose voxels are narrower than
/// leaves, a few rays tell what a pixel hides.
const MAX_VIEW_RAYS: usize = 1 << 20;
/// Share of a step that is taken in the first pass; in the last pass a tenth of it.
const RELAXATION: f32 = 0.5;
/// Share of a step's weight that is added for uncertainty.
const DOUBT: f32 = 1e-3;
/// Blocks of rows that are summed apart, so that sums do not depend on threads.
const BLOCKS: usize = 8;
/// Optical depth beyond which a ray is dark.
const DARK: f32 = 14.0;
/// Steps by which the clumping is fitted after each pass.
const CLUMPING_STEPS: usize = 2;
/// Largest change of a voxel as a logarithm.
const MAX_CHANGE: f32 = 4.0;

/// A level's cells while they are refitted.
struct Level<'a> {
    voltex: &'a Voltex,
    level: u32,
    /// Place of each voxel of the volume among the cells of the level.
    place: Vec<u32>,
    /// Voxel of each cell.
    numbers: Vec<u32>,
    rays: usize,
    pixel: f32,
    /// Pixels on a side of a view.
    count: usize,
}

/// Changes of the voxels that a view asks for.
#[derive(Clone)]
struct Sums {
    slope: Vec<f32>,
    weight: Vec<f32>,
}

/// Difference of what volume and model hide in a view, and its growth with the logarithm of all extinction.
#[derive(Clone, Copy, Default)]
struct Hidden {
    excess: f64,
    growth: f64,
}

/// Everything that the rays of a pixel meet: voxel and length; where among these each ray ends, and the light that
/// passes.
#[derive(Default)]
struct Met {
    parts: Vec<(u32, f32)>,
    ends: Vec<(usize, f32)>,
}

impl Level<'_> {
    /// Returns the share of light that passes the model in each pixel of a view.
    fn truth(&self, view: &Projection, occluder: &Occluder) -> Vec<f32> {
        let through = |i: usize| {
            let rays = self.rays * self.rays;
            let free = |s: &usize| !occluder.occluded(self.origin(view, i, *s), view.direction, 4.0);
            (0..rays).filter(free).count() as f32 / rays as f32
        };
        (0..self.count * self.count).into_par_iter().map(through).collect()
    }

    /// Returns the origin of ray `s` of pixel `i`.
    fn origin(&self, view: &Projection, i: usize, s: usize) -> glam::Vec3 {
        let at = |x: usize, s: usize| (x as f32 + (s as f32 + 0.5) / self.rays as f32) * self.pixel - HALF_SIDE;
        view.origin(at(i % self.count, s % self.rays), at(i / self.count, s / self.rays))
    }

    /// Returns the extinction of the voxels along a view, scaled by `logs` and by `clumping`.
    fn sigmas(&self, view: &Projection, logs: &[f32], clumping: &Sym3) -> Vec<f32> {
        let d = view.direction.to_array();
        let common = clumping.form(d, d);
        let extinction = |(number, log): (&u32, &f32)| self.voltex.extinction_along(*number, d) * (log + common).exp();
        self.numbers.par_iter().zip(logs).map(extinction).collect()
    }

    /// Writes what the rays of pixel `i` meet into `met`, and returns the share of light that passes.
    fn look(&self, view: &Projection, i: usize, sigmas: &[f32], met: &mut Met) -> f32 {
        met.parts.clear();
        met.ends.clear();
        for s in 0..self.rays * self.rays {
            let ray = VoltexRay { origin: self.origin(view, i, s).to_array(), direction: view.direction.to_array() };
            let mut walk = Walk::new(ray, 0.0, 4.0, self.voltex.level_count());
            let mut depth = 0.0;
            while let Some(segment) = walk.next(self.voltex, self.level) {
                if segment.cell.voxel == NO_VOXEL {
                    continue;
                }
                let place = self.place[segment.cell.voxel as usize];
                let length = segment.t1 - segment.t0;
                met.parts.push((place, length));
                depth += sigmas[place as usize] * length;
                if depth > DARK {
                    break;
                }
            }
            met.ends.push((met.parts.len(), (-depth).exp()));
        }
        met.ends.iter().map(|(_, through)| through).sum::<f32>() / met.ends.len() as f32
    }

    /// Returns the changes of the voxels that a view asks for.
    fn sums(&self, view: &Projection, truth: &[f32], sigmas: &[f32]) -> Sums {
        let rows = self.count.div_ceil(BLOCKS);
        let none = Sums { slope: vec![0.0; sigmas.len()], weight: vec![0.0; sigmas.len()] };
        let block = |block: usize| {
            let (mut sums, mut met) = (none.clone(), Met::default());
            let last = ((block + 1) * rows).min(self.count) * self.count;
            for i in (block * rows * self.count).min(last)..last {
                let excess = self.look(view, i, sigmas, &mut met) - truth[i];
                let total: f32 = met.hiding(sigmas).map(|(_, part)| part).sum();
                for (place, part) in met.hiding(sigmas) {
                    sums.slope[place] -= part * excess;
                    sums.weight[place] += part * total;
                }
            }
            sums
        };
        let blocks: Vec<Sums> = (0..BLOCKS).into_par_iter().map(block).collect();
        blocks.into_iter().fold(none, |mut sum, block| {
            sum.slope.iter_mut().zip(block.slope).for_each(|(a, b)| *a += b);
            sum.weight.iter_mut().zip(block.weight).for_each(|(a, b)| *a += b);
            sum
        })
    }

    /// Returns what volume and model hide in a view.
    fn hidden(&self, view: &Projection, truth: &[f32], sigmas: &[f32]) -> Hidden {
        let row = |y: usize| {
            let (mut sum, mut met) = (Hidden::default(), Met::default());
            for i in y * self.count..(y + 1) * self.count {
                sum.excess += f64::from(truth[i] - self.look(view, i, sigmas, &mut met));
                sum.growth += f64::from(met.hiding(sigmas).map(|(_, part)| part).sum::<f32>());
            }
            sum
        };
        let rows: Vec<Hidden> = (0..self.count).into_par_iter().map(row).collect();
        rows.iter().fold(Hidden::default(), |sum, row| Hidden {
            excess: sum.excess + row.excess,
            growth: sum.growth + row.growth,
        })
    }
}

impl Met {
    /// Returns for each part of a ray its voxel, and how much more the pixel hides per logarithm of that voxel's
    /// extinction.
    fn hiding(&self, sigmas: &[f32]) -> impl Iterator<Item = (usize, f32)> {
        let share = 1.0 / self.ends.len() as f32;
        let starts = std::iter::once(0).chain(self.ends.iter().map(|(end, _)| *end));
        starts.zip(&self.ends).flat_map(move |(start, (end, through))| {
            self.parts[start..*end].iter().map(move |(place, length)| {
                let place = *place as usize;
                (place, share * through * sigmas[place] * length)
            })
        })
    }
}

/// Refits `level` of `voltex`, its voxels and its clumping, to what the `occluder` in the same unit cube hides.
///
/// Deterministic. Cost: `views * (passes + CLUMPING_STEPS * (passes + 1))` times (1.7 voxels a side)^2 times `rays^2`
/// rays through the volume, of fine levels with fewer `rays`, down to one.
pub fn refit(voltex: &mut Voltex, level: u32, occluder: &Occluder, params: &RefitParams) {
    let numbers = voltex.numbers_at(level);
    let mut place = vec![u32::MAX; voltex.voxel_count()];
    numbers.iter().enumerate().for_each(|(i, number)| place[*number as usize] = i as u32);
    let pixel = voltex.voxel_side(level);
    let count = (2.0 * HALF_SIDE / pixel).ceil() as usize;
    let rays = rays_of_pixel(params.rays, count).min((MAX_VIEW_RAYS / (count * count)).isqrt()).max(1);
    let own = Level { voltex: &*voltex, level, place, numbers, rays, pixel, count };
    let views: Vec<Projection> = spread_directions(params.views, 0.3).into_iter().map(Projection::new).collect();
    let truths: Vec<Vec<f32>> = views.iter().map(|view| own.truth(view, occluder)).collect();
    let mut logs = vec![0f32; own.numbers.len()];
    let mut clumping = Sym3::default();
    for pass in 0..params.passes {
        let relaxation = RELAXATION * 0.1f32.powf(pass as f32 / (params.passes.max(2) - 1) as f32);
        for subset in 0..views.len() {
            // One view after the other is far from the one before.
            let view = subset * coprime_stride(views.len()) % views.len();
            let sums = own.sums(&views[view], &truths[view], &own.sigmas(&views[view], &logs, &clumping));
            for (i, log) in logs.iter_mut().enumerate() {
                let step = relaxation * sums.slope[i] / (sums.weight[i] + DOUBT);
                *log = (*log - step).clamp(-MAX_CHANGE, MAX_CHANGE);
            }
        }
        fit_clumping(&own, &views, &truths, &logs, &mut clumping);
    }
    let scaled =
        own.numbers.iter().zip(&logs).flat_map(|(cell, log)| {
            own.voltex.microflakes(*cell).map(|(number, voxel)| (number, voxel.scaled(log.exp())))
        });
    let scaled: Vec<(u32, Voxel)> = scaled.collect();
    scaled.into_iter().for_each(|(number, voxel)| voltex.set_voxel(number, &voxel));
    voltex.set_clumping(level, &clumping);
}

/// Fits the clumping by steps of Newton's method, each of them least squares over the views: until the volume hides in
/// each view what the model does, as far as six numbers can, and in all views together as much. Leaves that stand
/// behind each other in some directions and beside each other in others are what voxels on their own cannot express.
fn fit_clumping(own: &Level, views: &[Projection], truths: &[Vec<f32>], logs: &[f32], clumping: &mut Sym3) {
    for _ in 0..CLUMPING_STEPS {
        let (mut gram, mut right) = (Matrix6::<f64>::zeros(), Vector6::<f64>::zeros());
        for (view, truth) in views.iter().zip(truths) {
            let hidden = own.hidden(view, truth, &own.sigmas(view, logs, clumping));
            if hidden.growth > 0.0 {
                let row = Vector6::from(entries_along(view.direction.as_dvec3()));
                gram += hidden.growth * row * row.transpose();
                right -= hidden.excess * row;
            }
        }
        let doubt = 1e-3 * gram.trace() / 6.0;
        let Some(factor) = (gram + Matrix6::identity() * doubt).cholesky() else { return };
        let step = factor.solve(&right);
        for (entry, step) in clumping.0.iter_mut().zip(step.iter()) {
            *entry = (*entry + (*step as f32).clamp(-1.0, 1.0)).clamp(-MAX_CLUMPING, MAX_CLUMPING);
        }
    }
}

/// Returns a stride through `count` views that visits all of them, about a third of them apart.
fn coprime_stride(count: usize) -> usize {
    fn gcd(a: usize, b: usize) -> usize {
        if b == 0 { a } else { gcd(b, a % b) }
    }
    (count / 3 + 1..).find(|stride| gcd(*stride, count) == 1).unwrap_or(1)
}
