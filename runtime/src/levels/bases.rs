//! The components of a cluster at the sampled pairs, in the order in which sums over them read memory.

use crate::numeric::algebra::gram_of;
use crate::numeric::in_vectors::in_vectors;
use pulp::{Simd, WithSimd};

/// Number of samples that a sum keeps in registers while it goes over the components.
const TILE: usize = 64;
/// Number of partial sums of a scalar product.
const LANES: usize = 16;
/// Number of vectors of sums that stay in registers.
const BLOCK: usize = 4;

/// Components for a code of 1 at the sampled pairs.
#[derive(Default)]
pub(super) struct Bases {
    /// Number of components.
    pub count: usize,
    /// Values, `[tile][component][TILE]`; the samples beyond the last are 0.
    values: Vec<f32>,
    /// Scalar products of the components with each other, `[i, j]`.
    pub gram: Vec<f32>,
}

impl Bases {
    /// Arranges components, `[component][sample]`.
    pub(super) fn new(components: &[Vec<f32>]) -> Bases {
        let tiles = components.first().map_or(0, |component| component.len().div_ceil(TILE));
        let mut values = vec![0.0; tiles * components.len() * TILE];
        for (tile, values) in values.chunks_exact_mut((components.len() * TILE).max(1)).enumerate() {
            for (component, values) in components.iter().zip(values.chunks_exact_mut(TILE)) {
                let there = &component[tile * TILE..component.len().min((tile + 1) * TILE)];
                values[..there.len()].copy_from_slice(there);
            }
        }
        Bases { count: components.len(), values, gram: gram_of(components) }
    }

    /// Adds components to `samples`, each `(number, weight)`.
    #[inline(always)]
    pub(super) fn add<S: Simd>(&self, simd: S, weighted: &[(usize, f32)], samples: &mut [f32]) {
        if weighted.is_empty() {
            return;
        }
        for (samples, tile) in samples.chunks_mut(TILE).zip(self.values.chunks_exact(self.count * TILE)) {
            let tile = tile.as_chunks::<TILE>().0;
            let mut padded = [0.0f32; TILE];
            padded[..samples.len()].copy_from_slice(samples);
            for (block, sums) in S::as_mut_simd_f32s(&mut padded).0.as_chunks_mut::<BLOCK>().0.iter_mut().enumerate() {
                let mut kept = *sums;
                for (number, weight) in weighted {
                    let weight = simd.splat_f32s(*weight);
                    let values = S::as_simd_f32s(&tile[*number]).0.as_chunks::<BLOCK>().0[block];
                    for i in 0..BLOCK {
                        kept[i] = simd.add_f32s(kept[i], simd.mul_f32s(weight, values[i]));
                    }
                }
                *sums = kept;
            }
            samples.copy_from_slice(&padded[..samples.len()]);
        }
    }

    /// Returns the scalar products of the first `count` components with `samples`.
    pub(super) fn products(&self, count: usize, samples: &[f32]) -> Vec<f32> {
        in_vectors(Products { bases: self, count, samples })
    }

    /// Returns the products of the first `count` components with each other.
    pub(super) fn first_gram(&self, count: usize) -> Vec<f32> {
        (0..count).flat_map(|i| self.gram[i * self.count..i * self.count + count].iter().copied()).collect()
    }
}

/// The arguments of [`Bases::products`], for [`pulp`].
struct Products<'a> {
    bases: &'a Bases,
    count: usize,
    samples: &'a [f32],
}

impl WithSimd for Products<'_> {
    type Output = Vec<f32>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<f32> {
        let Products { bases, count, samples } = self;
        let mut sums = vec![[0.0f32; LANES]; count];
        for (samples, tile) in samples.chunks(TILE).zip(bases.values.chunks_exact((bases.count * TILE).max(1))) {
            let mut padded = [0.0f32; TILE];
            padded[..samples.len()].copy_from_slice(samples);
            let samples = S::as_simd_f32s(&padded).0;
            for (sums, values) in sums.iter_mut().zip(tile.as_chunks::<TILE>().0) {
                let (sums, values) = (S::as_mut_simd_f32s(sums).0, S::as_simd_f32s(values).0);
                // The sums are the same whatever the width of the processor's vectors.
                let vectors = sums.len();
                for (samples, values) in samples.chunks_exact(vectors).zip(values.chunks_exact(vectors)) {
                    for ((sum, x), y) in sums.iter_mut().zip(samples).zip(values) {
                        *sum = simd.add_f32s(*sum, simd.mul_f32s(*x, *y));
                    }
                }
            }
        }
        sums.iter().map(|lanes| lanes.iter().sum()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::vector::dot_slices;
    use crate::testing::Random;
    use pulp::Scalar;

    #[test]
    fn tiles_change_no_sum() {
        let mut random = Random::new(5);
        // The last tile is not full.
        let components: Vec<Vec<f32>> =
            (0..5).map(|_| (0..TILE * 2 + 7).map(|_| random.within(-1.0, 1.0)).collect()).collect();
        let bases = Bases::new(&components);
        let start: Vec<f32> = (0..TILE * 2 + 7).map(|_| random.within(-1.0, 1.0)).collect();
        for (number, product) in bases.products(4, &start).iter().enumerate() {
            assert!((product - dot_slices(&components[number], &start)).abs() < 1e-4);
        }
        let mut sums = start.clone();
        bases.add(Scalar, &[(1, 2.0), (4, -3.0)], &mut sums);
        for (i, sum) in sums.iter().enumerate() {
            assert!((sum - (start[i] + 2.0 * components[1][i] - 3.0 * components[4][i])).abs() < 1e-5);
        }
        assert_eq!(bases.first_gram(2), [0, 1, 5, 6].map(|at| bases.gram[at]));
        // Planted difference: one sample of the last tile.
        let mut other = start.clone();
        other[TILE * 2 + 6] += 1.0;
        assert!((bases.products(1, &other)[0] - bases.products(1, &start)[0]).abs() > 1e-3);
    }
}
