//! Combines the lobes and residuals of many values side by side: many calls of [`ResidualKind::combine_rgb`] at once with
//! SIMD, and with the same bits.

use crate::asset::residual::ResidualKind;
use crate::decode::viewed_texel::Parts;
use crate::numeric::in_vectors::in_vectors;
use pulp::{Simd, WithSimd};

/// Values whose parts wait to be combined.
#[derive(Default)]
pub(crate) struct PartQueue {
    /// Curve of all that wait, with its epsilon.
    curve: Option<(ResidualKind, f32)>,
    /// Three channels of each.
    lobes: Vec<f32>,
    residuals: Vec<f32>,
    /// Index of each value, and what is multiplied with it.
    values: Vec<(usize, [f32; 2])>,
}

impl PartQueue {
    /// Queues the parts of value number `index`, which are combined in `curve`, a kind with its epsilon.
    pub(crate) fn push(&mut self, parts: Parts, curve: (ResidualKind, f32), index: usize, values: &mut [[f32; 3]]) {
        if self.curve.is_some_and(|waiting| waiting != curve) {
            self.finish(values);
        }
        self.curve = Some(curve);
        self.lobes.extend(parts.lobes);
        self.residuals.extend(parts.residual);
        self.values.push((index, parts.falls));
    }

    /// Combines what waits, into `values`.
    pub(crate) fn finish(&mut self, values: &mut [[f32; 3]]) {
        let Some((kind, epsilon)) = self.curve.take() else { return };
        // Whole vectors.
        self.lobes.resize(self.lobes.len().next_multiple_of(16), 0.0);
        self.residuals.resize(self.lobes.len(), 0.0);
        in_vectors(Combine { kind, epsilon, sums: &mut self.lobes, residuals: &self.residuals });
        for ((index, falls), sums) in self.values.drain(..).zip(self.lobes.as_chunks::<3>().0) {
            values[index] = sums.map(|x| x * falls[0] * falls[1]);
        }
        self.lobes.clear();
        self.residuals.clear();
    }
}

struct Combine<'a> {
    kind: ResidualKind,
    epsilon: f32,
    sums: &'a mut [f32],
    residuals: &'a [f32],
}

impl WithSimd for Combine<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Combine { kind, epsilon, sums, residuals } = self;
        kind.encode_slice(sums, epsilon);
        sums.iter_mut().zip(residuals).for_each(|(sum, r)| *sum += r);
        kind.decode_slice(sums, epsilon);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    #[test]
    fn values_are_those_of_parts_combined_one_by_one_bit_for_bit() {
        let (mut random, mut queue) = (Random::new(3), PartQueue::default());
        for round in 1..40 {
            let mut values = vec![[f32::NAN; 3]; round];
            let mut expected = values.clone();
            for index in (0..round).rev() {
                let kind = [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root][random.below(3)];
                let curve = (kind, [1e-3, 0.05][random.below(2)]);
                let mut three = |most: f32| [0; 3].map(|_| random.within(-most, most));
                let [lobes, residual, [a, b, _]] = [three(3.0).map(f32::abs), three(1.0), three(1.0)];
                queue.push(Parts { lobes, residual, falls: [a, b] }, curve, index, &mut values);
                expected[index] = kind.combine_rgb(lobes, residual, curve.1).map(|x| x * a * b);
            }
            queue.finish(&mut values);
            let bits = |values: &[[f32; 3]]| values.as_flattened().iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&values), bits(&expected), "{round}");
        }
    }
}
