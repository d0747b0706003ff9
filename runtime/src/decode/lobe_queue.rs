//! Evaluates lobes of one family side by side: many calls of [`LobeSetup::eval`] at once with SIMD, and with the same
//! bits. A texel has lobes of many families; lobes of many texels wait here until enough of one family are together.

use crate::asset::lobe::{LobeFamily, LobeSetup, ResidentLobe, lobe_family};
use crate::numeric::in_vectors::in_vectors;
use crate::numeric::vector::dot;
use pulp::{Simd, WithSimd};
use std::vec::Drain;

/// Number of lobes that are evaluated together.
const LANES: usize = 16;

/// Lobes of one family, with a light and an eye each, that wait for their evaluation.
#[derive(Clone, Copy)]
struct Waiting {
    count: usize,
    /// Numbers of each lane: normal, tangent and parameters, then light and eye.
    numbers: [[f32; LANES]; 16],
    /// Index of the value that each lane computes.
    values: [usize; LANES],
}

/// A queue of lobes that wait for their evaluation, and the values of all since the last [`LobeQueue::finish`].
pub(crate) struct LobeQueue {
    families: [Waiting; LobeFamily::ALL.len()],
    values: Vec<f32>,
}

impl LobeQueue {
    pub(crate) fn new() -> LobeQueue {
        let waiting = Waiting { count: 0, numbers: [[0.0; LANES]; 16], values: [0; LANES] };
        LobeQueue { families: [waiting; LobeFamily::ALL.len()], values: Vec::new() }
    }

    /// Queues a lobe for a light and an eye. Its value is the next one in the order of [`LobeQueue::finish`].
    pub(crate) fn push(&mut self, words: &ResidentLobe, wi: [f32; 3], wo: [f32; 3]) {
        let name = lobe_family(words);
        let family = &mut self.families[name as usize];
        let lane = family.count % LANES;
        for i in 0..10 {
            family.numbers[i][lane] = f32::from_bits(words[1 + i]);
        }
        for i in 0..3 {
            family.numbers[10 + i][lane] = wi[i];
            family.numbers[13 + i][lane] = wo[i];
        }
        family.values[lane] = self.values.len();
        self.values.push(0.0);
        family.count += 1;
        if family.count == LANES {
            family.flush(name, &mut self.values);
        }
    }

    /// Evaluates what waits, and returns the values of all lobes since the last call, in the order of
    /// [`LobeQueue::push`].
    pub(crate) fn finish(&mut self) -> Drain<'_, f32> {
        for (family, name) in self.families.iter_mut().zip(LobeFamily::ALL) {
            family.flush(name, &mut self.values);
        }
        self.values.drain(..)
    }
}

impl Waiting {
    fn flush(&mut self, family: LobeFamily, values: &mut [f32]) {
        let found = in_vectors(Evaluate { family, numbers: &self.numbers });
        for lane in 0..self.count {
            values[self.values[lane]] = found[lane];
        }
        self.count = 0;
    }
}

/// The evaluation of all lanes of a family, for [`pulp`].
struct Evaluate<'a> {
    family: LobeFamily,
    numbers: &'a [[f32; LANES]; 16],
}

impl WithSimd for Evaluate<'_> {
    type Output = [f32; LANES];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> [f32; LANES] {
        let (family, numbers) = (self.family, self.numbers);
        let mut values = [0.0; LANES];
        // A loop for each family, without a choice within.
        macro_rules! lanes {
            (|$lobe:ident, $ci:ident, $wi:ident, $wo:ident| $value:expr) => {
                for i in 0..LANES {
                    let three = |first: usize| [numbers[first][i], numbers[first + 1][i], numbers[first + 2][i]];
                    let ($wi, $wo) = (three(10), three(13));
                    let params = [numbers[6][i], numbers[7][i], numbers[8][i], numbers[9][i]];
                    let $lobe = LobeSetup { family, normal: three(0), tangent: three(3), params };
                    let $ci = dot($lobe.normal, $wi);
                    let value = $value;
                    values[i] = if $ci > 0.0 { value } else { 0.0 };
                }
            };
        }
        match family {
            LobeFamily::Lambertian => lanes!(|lobe, ci, wi, _wo| ci),
            LobeFamily::OrenNayar => lanes!(|lobe, ci, wi, wo| lobe.oren_nayar(ci, wi, wo)),
            LobeFamily::BlinnPhong => lanes!(|lobe, ci, wi, wo| lobe.blinn_phong(ci, wi, wo)),
            LobeFamily::Ward => lanes!(|lobe, ci, wi, wo| lobe.ward(ci, wi, wo)),
            LobeFamily::CookTorrance => lanes!(|lobe, ci, wi, wo| lobe.cook_torrance(ci, wi, wo)),
            LobeFamily::Lafortune => lanes!(|lobe, ci, wi, wo| lobe.lafortune(ci, wi, wo)),
            LobeFamily::AshikhminShirley => lanes!(|lobe, ci, wi, wo| lobe.ashikhmin_shirley(ci, wi, wo)),
            LobeFamily::Ggx => lanes!(|lobe, ci, wi, wo| lobe.ggx(ci, wi, wo)),
            LobeFamily::WindowedCosine => lanes!(|lobe, ci, wi, wo| lobe.windowed_cosine(ci, wo)),
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, random_lobe};

    #[test]
    fn values_are_those_of_one_lobe_after_the_other_bit_for_bit() {
        let (mut random, mut queue) = (Random::new(5), LobeQueue::new());
        for round in 1..20 {
            let mut expected = Vec::new();
            for _ in 0..round * 37 {
                let family = LobeFamily::ALL[random.below(9)];
                let setup = random_lobe(&mut random, family).setup();
                let (mut wi, wo) = (random.direction(), random.direction());
                wi[2] *= [1.0, -1.0][random.below(2)];
                queue.push(&setup.to_resident_words(1.0), wi, wo);
                expected.push(setup.eval(wi, wo));
            }
            let values: Vec<f32> = queue.finish().collect();
            let bits = |values: &[f32]| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&values), bits(&expected));
            assert!(values.iter().filter(|x| **x > 0.0).count() >= values.len() / 4);
        }
    }
}
