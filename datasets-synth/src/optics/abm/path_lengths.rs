//! One trace without absorption for every wavelength and pigment level: the distribution of the path lengths of rays
//! through the mesophyll.
//!
//! Without absorption the walk does not depend on the pigments, so the path lengths `L` (in thicknesses of the
//! mesophyll) of the rays that leave on one side are drawn once, and for any optical depth `k` of a straight crossing
//! the share of light that leaves there is the mean of `exp(-k L)`. The result equals the direct simulation in the
//! mean, with less variance. The refractive indices must not change between the wavelengths that share a trace.

use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

use crate::optics::abm::stack::Stack;
use crate::optics::abm::walk::{Absorption, End, walk, walk_splitting};

/// Number of bins per doubling of the path length. Each bin keeps the mean of its lengths, so the error of its weight
/// is of second order: below 2e-5 of its rays at any absorption.
const BINS_PER_DOUBLING: f64 = 32.0;

/// Shortest path that has a bin of its own; shorter ones (possible where the mesophyll is split) join it.
const SHORTEST: f64 = 1.0 / 1024.0;

/// Number of bins, up to 2^20 thicknesses. Longer paths join the last.
const BINS: usize = 30 * BINS_PER_DOUBLING as usize;

/// Number of rays per block. A block has its own random numbers, so that the number of threads does not matter.
pub(crate) const BLOCK: u64 = 8192;

/// Incident light: a distribution of directions of travel.
pub trait Beam: Sync {
    /// Draws a unit direction of travel (z < 0 meets the adaxial face).
    fn direction(&self, random: &mut Xoshiro256PlusPlus) -> [f64; 3];
}

/// Beam with all rays in one direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parallel {
    /// Unit direction of travel.
    pub direction: [f64; 3],
}

impl Parallel {
    /// Returns the light at `theta_deg` from the normal of a face and azimuth 0, 0 to 90 (taken as just above the
    /// horizon). It travels towards negative x, so that its mirror direction has the azimuth 180.
    pub fn onto(face: Face, theta_deg: f64) -> Parallel {
        let (sin, cos) = theta_deg.to_radians().sin_cos();
        Parallel { direction: [-sin, 0.0, -face.sign() * cos.max(1e-9)] }
    }
}

impl Beam for Parallel {
    fn direction(&self, _: &mut Xoshiro256PlusPlus) -> [f64; 3] {
        self.direction
    }
}

/// Light from everywhere on the side of a face, evenly (Lambertian), as bihemispherical quantities need it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Diffuse {
    /// Face towards the light.
    pub face: Face,
}

impl Beam for Diffuse {
    fn direction(&self, random: &mut Xoshiro256PlusPlus) -> [f64; 3] {
        // Even in sin^2; 1 - u keeps the cosine above 0.
        let cos = (1.0 - random.r#gen::<f64>()).sqrt();
        let turn = std::f64::consts::TAU * random.r#gen::<f64>();
        let sin = (1.0 - cos * cos).sqrt();
        [sin * turn.cos(), sin * turn.sin(), -self.face.sign() * cos]
    }
}

/// Faces of a leaf.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Face {
    /// The upper face.
    #[default]
    Adaxial,
    /// The lower face.
    Abaxial,
}

impl Face {
    /// Returns z of the outward normal of the face.
    pub fn sign(self) -> f64 {
        match self {
            Face::Adaxial => 1.0,
            Face::Abaxial => -1.0,
        }
    }
}

/// Mean of a weight over rays, with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Mean.
    pub mean: f64,
    /// Standard error of the mean.
    pub standard_error: f64,
}

/// Path lengths of the rays that left on one side.
#[derive(Debug, Clone, PartialEq)]
pub struct PathLengths {
    /// Weight of rays that met no mesophyll at all.
    straight: f64,
    /// Weight, and weight times length, per bin.
    bins: Vec<[f64; 2]>,
}

impl PathLengths {
    pub(crate) fn new() -> PathLengths {
        PathLengths { straight: 0.0, bins: vec![[0.0; 2]; BINS] }
    }

    pub(crate) fn add(&mut self, weight: f64, path: f64) {
        if path == 0.0 {
            self.straight += weight;
            return;
        }
        let place = (path.max(SHORTEST) / SHORTEST).log2() * BINS_PER_DOUBLING;
        let bin = &mut self.bins[(place as usize).min(BINS - 1)];
        bin[0] += weight;
        bin[1] += weight * path;
    }

    fn merge(&mut self, other: &PathLengths) {
        self.straight += other.straight;
        for (mine, theirs) in self.bins.iter_mut().zip(&other.bins) {
            mine[0] += theirs[0];
            mine[1] += theirs[1];
        }
    }

    /// Returns the weight of all rays on this side.
    pub fn weight(&self) -> f64 {
        self.straight + self.bins.iter().map(|bin| bin[0]).sum::<f64>()
    }

    /// Returns the distribution as (length, weight), the lengths in thicknesses of the mesophyll, ascending. Empty bins
    /// are left out.
    pub fn ways(&self) -> impl Iterator<Item = (f64, f64)> {
        let straight = (self.straight > 0.0).then_some((0.0, self.straight));
        straight.into_iter().chain(self.bins.iter().filter(|bin| bin[0] > 0.0).map(|bin| (bin[1] / bin[0], bin[0])))
    }

    /// Returns the share of `rays` rays that leaves on this side for the optical depth `k` of a straight crossing. The
    /// standard error is that of single rays, each of weight one.
    pub fn escaping(&self, k: f64, rays: f64) -> Estimate {
        let (mut sum, mut squares) = (0.0, 0.0);
        for (way, weight) in self.ways() {
            let left = (-k * way).exp();
            sum += weight * left;
            squares += weight * left * left;
        }
        let mean = sum / rays;
        let variance = (squares / rays - mean * mean).max(0.0);
        Estimate { mean, standard_error: (variance / rays).sqrt() }
    }
}

/// Result of tracing a beam on one face, for any absorption.
#[derive(Debug, Clone, PartialEq)]
pub struct TracedBeam {
    /// Number of rays that were sent.
    pub rays: u64,
    /// Number of rays that met more interfaces than any path should; 0 in every model here.
    pub lost: u64,
    /// Rays that left on the side of the beam.
    pub reflected: PathLengths,
    /// Rays that left on the other side.
    pub transmitted: PathLengths,
}

impl TracedBeam {
    /// Returns the reflectance for the optical depth `k` of a straight crossing of the mesophyll.
    pub fn reflectance(&self, k: f64) -> Estimate {
        self.reflected.escaping(k, self.rays as f64)
    }

    /// Returns the transmittance for the optical depth `k` of a straight crossing of the mesophyll.
    pub fn transmittance(&self, k: f64) -> Estimate {
        self.transmitted.escaping(k, self.rays as f64)
    }
}

/// Traces `rays` rays of `beam`, in parallel on the current pool. Equal seeds give equal results on any number of
/// threads.
///
/// Cost: some 100 to 800 ns a ray, more the less a stack lets through.
pub fn trace_path_lengths(stack: &Stack, beam: &dyn Beam, rays: u64, seed: u64) -> TracedBeam {
    in_blocks(rays, seed, |count, random, traced| {
        for _ in 0..count {
            let start = beam.direction(random);
            match walk(stack, start, Absorption::None, random).end {
                End::Escaped { direction, path } => {
                    let same_side = direction[2] * start[2] < 0.0;
                    let side = if same_side { &mut traced.reflected } else { &mut traced.transmitted };
                    side.add(1.0, path);
                }
                End::Absorbed => traced.lost += 1,
            }
        }
    })
}

/// Traces a beam by splitting every ray at every interface. The weights are not those of single rays, so the standard
/// errors of [`PathLengths::escaping`] are upper bounds.
pub fn trace_splitting(stack: &Stack, beam: &dyn Beam, rays: u64, seed: u64) -> TracedBeam {
    in_blocks(rays, seed, |count, random, traced| {
        for _ in 0..count {
            let start = beam.direction(random);
            walk_splitting(stack, start, random, &mut |weight, direction, path| {
                let same_side = direction[2] * start[2] < 0.0;
                let side = if same_side { &mut traced.reflected } else { &mut traced.transmitted };
                side.add(weight, path);
            });
        }
    })
}

/// Runs blocks of rays in parallel, each from its own seed, and adds them up in order.
fn in_blocks(rays: u64, seed: u64, block: impl Fn(u64, &mut Xoshiro256PlusPlus, &mut TracedBeam) + Sync) -> TracedBeam {
    let empty = || TracedBeam { rays: 0, lost: 0, reflected: PathLengths::new(), transmitted: PathLengths::new() };
    let blocks = rays.div_ceil(BLOCK);
    // Groups keep few histograms alive at a time; their size does not change the result.
    let mut total = empty();
    const GROUP: u64 = 64;
    for first in (0..blocks).step_by(GROUP as usize) {
        let traced: Vec<TracedBeam> = (first..(first + GROUP).min(blocks))
            .into_par_iter()
            .map(|i| {
                let mut random = block_random(seed, i);
                let mut traced = empty();
                traced.rays = BLOCK.min(rays - i * BLOCK);
                block(traced.rays, &mut random, &mut traced);
                traced
            })
            .collect();
        for part in &traced {
            total.rays += part.rays;
            total.lost += part.lost;
            total.reflected.merge(&part.reflected);
            total.transmitted.merge(&part.transmitted);
        }
    }
    total
}

/// Returns the random generator of block `i`. The generator's own seeding (SplitMix64) mixes the seeds.
pub(crate) fn block_random(seed: u64, i: u64) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ i)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::abm::abm97::Abm97;
    use crate::optics::abm::tissue::Tissue;
    use crate::optics::abm::walk::Walked;
    use crate::optics::units::Nanometres;

    /// The binned sum against the plain sum over the same rays.
    #[test]
    fn bins_lose_nothing_that_matters() {
        let stack = Abm97::default().stack(Nanometres(550.0));
        let beam = Parallel::onto(Face::Adaxial, 8.0);
        let mut random = block_random(1, 0);
        let mut ways = Vec::new();
        let mut binned = PathLengths::new();
        let rays = 50_000;
        for _ in 0..rays {
            if let Walked { end: End::Escaped { direction, path }, .. } =
                walk(&stack, beam.direction, Absorption::None, &mut random)
                && direction[2] < 0.0
            {
                ways.push(path);
                binned.add(1.0, path);
            }
        }
        assert!((binned.weight() - ways.len() as f64).abs() < 1e-9);
        for depth in [0.0, 1e-6, 0.01, 0.3, 1.0, 3.0, 10.0] {
            let plain: f64 = ways.iter().map(|way| (-depth * way).exp()).sum::<f64>() / f64::from(rays);
            let sum = binned.escaping(depth, f64::from(rays)).mean;
            assert!((plain - sum).abs() < 2e-5 * binned.weight() / f64::from(rays), "{depth}: {plain} {sum}");
        }
        assert_eq!(binned.escaping(f64::MAX, f64::from(rays)).mean, 0.0);
    }

    /// Bihemispherical transmittance without absorption, from another implementation: 0.4653 from the face,
    /// 0.4795 from the back. A reciprocal leaf would have one number.
    #[test]
    fn the_1997_model_is_not_reciprocal_by_a_known_amount() {
        let stack = Abm97::default().stack(Nanometres(550.0));
        let through = |face| trace_path_lengths(&stack, &Diffuse { face }, 400_000, 1).transmittance(0.0).mean;
        let (down, up) = (through(Face::Adaxial), through(Face::Abaxial));
        assert!((down - 0.4653).abs() < 0.004 && (up - 0.4795).abs() < 0.004, "{down} {up}");
    }

    #[test]
    fn extreme_ways_have_a_bin() {
        let mut lengths = PathLengths::new();
        for way in [0.0, 1e-300, 1e-3, 1.0, 1e9, f64::MAX] {
            lengths.add(1.0, way);
        }
        assert_eq!(lengths.weight(), 6.0);
        assert!((lengths.escaping(1.0, 6.0).mean * 6.0 - (2.0 + (-1e-3f64).exp() + (-1f64).exp())).abs() < 1e-3);
    }
}
