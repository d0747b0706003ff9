//! The covariance between the direction pairs of a capture: functions of the priors and analytic kernels, each with the
//! share that makes the capture's own samples most likely.

use crate::priors::kernels::{KERNELS, Kernel, PairGeometry};
use crate::priors::variances::{NOISE, variance_components};
use btf_runtime::Sphere;
use nalgebra::DMatrix;
use ndarray::{Array1, Array2, ArrayView2, Axis, s};
use rayon::prelude::*;

/// Share of the samples' energy below which a part only takes time.
const MIN_ENERGY: f64 = 1e-3;
/// Pairs of a capture that the shares are found from, at most.
const FITTED_PAIRS: usize = 256;

/// Covariance between direction pairs.
pub struct PairCovariance {
    /// Functions of all parts, scaled by the roots of their shares: `[pair, function]`, so that a pair's lie together.
    functions: Array2<f32>,
    /// Kernels with their shares.
    kernels: Vec<(Kernel, f64)>,
    geometry: PairGeometry,
    /// Variance of the samples' own noise.
    noise: f64,
}

impl PairCovariance {
    /// Joins the `parts` of the priors, `[function, pair]` each, and the kernels so that they explain `rows`, samples
    /// `[sample, pair]` of which only the pairs `seen` are looked at.
    pub fn adapted(
        views: &Sphere,
        lights: &Sphere,
        parts: Vec<Array2<f32>>,
        rows: ArrayView2<f32>,
        seen: &[usize],
    ) -> PairCovariance {
        let geometry = PairGeometry::new(views, lights);
        let some: Vec<usize> =
            (0..seen.len().min(FITTED_PAIRS)).map(|i| seen[i * seen.len() / seen.len().min(FITTED_PAIRS)]).collect();
        let observed = rows.select(Axis(1), &some);
        let moments = as_f64(observed.t().dot(&observed).view()) / rows.nrows().max(1) as f64;
        let matrices: Vec<DMatrix<f64>> = (0..parts.len() + KERNELS.len())
            .into_par_iter()
            .map(|number| match number.checked_sub(parts.len()) {
                None => {
                    let own = parts[number].select(Axis(1), &some);
                    as_f64(own.t().dot(&own).view())
                }
                Some(kernel) => DMatrix::from_fn(some.len(), some.len(), |i, j| {
                    geometry.covariance(KERNELS[kernel], some[i], some[j])
                }),
            })
            .collect();
        let shares = variance_components(&matrices, &moments);
        let noise = NOISE * moments.trace() / some.len().max(1) as f64;
        PairCovariance::of_shares(geometry, parts, &shares, noise)
    }

    /// Joins `parts` with equal shares and without kernels: what is known before anything is seen.
    pub fn before_samples(views: &Sphere, lights: &Sphere, parts: Vec<Array2<f32>>) -> PairCovariance {
        let shares = vec![1.0 / parts.len().max(1) as f64; parts.len()];
        PairCovariance::of_shares(PairGeometry::new(views, lights), parts, &shares, NOISE)
    }

    fn of_shares(geometry: PairGeometry, parts: Vec<Array2<f32>>, shares: &[f64], noise: f64) -> PairCovariance {
        let pairs = geometry.pair_count();
        let (of_parts, of_kernels) = shares.split_at(parts.len());
        let kernel_energy =
            |kernel: Kernel| (0..pairs).map(|pair| geometry.covariance(kernel, pair, pair)).sum::<f64>();
        let part_energies: Vec<f64> = parts.iter().zip(of_parts).map(|(part, share)| share * energy(part)).collect();
        let kernel_energies: Vec<f64> =
            KERNELS.into_iter().zip(of_kernels).map(|(kernel, share)| share * kernel_energy(kernel)).collect();
        let least = MIN_ENERGY * part_energies.iter().chain(&kernel_energies).sum::<f64>();
        let kernels = KERNELS.into_iter().zip(of_kernels.iter().copied()).zip(&kernel_energies);
        // A little noise keeps matrices invertible.
        let kernels = kernels.filter(|((kernel, _), energy)| **energy > least || *kernel == Kernel::Noise);
        let kernels = kernels.map(|(kernel, _)| kernel).collect();
        let kept: Vec<(Array2<f32>, f64)> = parts
            .into_iter()
            .zip(of_parts.iter().copied())
            .zip(part_energies)
            .filter(|(_, energy)| *energy > least)
            .map(|(part, _)| part)
            .collect();
        let count = kept.iter().map(|(part, _)| part.nrows()).sum();
        let mut functions = Array2::zeros((pairs, count));
        let mut first = 0;
        for (part, share) in kept {
            let root = share.sqrt() as f32;
            let mut own = functions.slice_mut(s![.., first..first + part.nrows()]);
            own.zip_mut_with(&part.t(), |to, x| *to = root * x);
            first += part.nrows();
        }
        PairCovariance { functions, kernels, geometry, noise }
    }

    /// Returns the functions `[pair, function]`, scaled so that the sum of their products is the covariance without kernels.
    pub fn functions(&self) -> &Array2<f32> {
        &self.functions
    }

    /// Returns the covariances between the pairs `a` and the pairs `b`, `[a, b]`.
    pub fn between(&self, a: &[usize], b: &[usize]) -> Array2<f32> {
        let mut found = self.functions.select(Axis(0), a).dot(&self.functions.select(Axis(0), b).t());
        for (mut row, a) in found.axis_iter_mut(Axis(0)).zip(a) {
            for (x, b) in row.iter_mut().zip(b) {
                *x += self.of_kernels(*a, *b) as f32;
            }
        }
        found
    }

    /// Returns the variance of each pair.
    pub fn variances(&self, pairs: &[usize]) -> Array1<f32> {
        let own = |pair: &usize| {
            let own = self.functions.row(*pair);
            own.dot(&own) + self.of_kernels(*pair, *pair) as f32
        };
        pairs.iter().map(own).collect()
    }

    fn of_kernels(&self, a: usize, b: usize) -> f64 {
        let sum: f64 = self.kernels.iter().map(|(kernel, share)| share * self.geometry.covariance(*kernel, a, b)).sum();
        sum + if a == b { self.noise } else { 0.0 }
    }
}

fn energy(functions: &Array2<f32>) -> f64 {
    functions.iter().map(|x| f64::from(x * x)).sum()
}

fn as_f64(matrix: ArrayView2<f32>) -> DMatrix<f64> {
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| f64::from(matrix[[i, j]]))
}
