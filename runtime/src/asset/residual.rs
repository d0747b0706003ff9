//! The residual of a layer: the difference between the measured values and the lobes, and the curve in which the two
//! are added. The bases of each cluster are mixtures of shared bases, which are factored over light x view [Tucker
//! 1966]. Twin: `asset/residual.wgsl`.

use crate::asset::limits::MAX_INPUTS;
use crate::numeric::power::{from_root, positive, root};
use half::f16;

/// The curve `g` in which the residual is added to the lobes: `X = g^-1(g(S) + R)`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum ResidualKind {
    /// `g(x) = x`.
    Additive = 0,
    /// `g(x) = ln(x + epsilon)`.
    Log = 1,
    /// `g(x) = (x + epsilon)^(1 / 2.4)`: the exponent of the sRGB curve, so that errors are those that `psnr_db`
    /// counts.
    Root = 2,
}

/// Exponent of the root curve.
pub const ROOT: f32 = 2.4;
/// Largest `|g(S) + R|` that the log curve exponentiates (e^12 is beyond any reflectance).
pub const MAX_LOG: f32 = 12.0;

impl ResidualKind {
    /// Returns the kind with a number; `None` for an unknown one.
    pub fn from_number(number: u32) -> Option<ResidualKind> {
        [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root].into_iter().find(|kind| *kind as u32 == number)
    }

    /// Returns `g(x)`. `x` is clamped at 0 except for the additive kind.
    #[inline(always)]
    pub fn encode(self, x: f32, epsilon: f32) -> f32 {
        match self {
            ResidualKind::Additive => x,
            ResidualKind::Log => (positive(x) + epsilon).ln(),
            ResidualKind::Root => root(positive(x) + epsilon),
        }
    }

    /// Returns `g^-1(y)`, which is finite for every finite `y`.
    #[inline(always)]
    pub fn decode(self, y: f32, epsilon: f32) -> f32 {
        match self {
            ResidualKind::Additive => y,
            ResidualKind::Log => y.clamp(-MAX_LOG, MAX_LOG).exp() - epsilon,
            ResidualKind::Root => from_root(y) - epsilon,
        }
    }

    /// Combines the lobe sum `s` and the residual `r` of one channel: `max(0, g^-1(g(s) + r))`.
    #[inline(always)]
    pub fn combine(self, s: f32, r: f32, epsilon: f32) -> f32 {
        positive(self.decode(self.encode(s, epsilon) + r, epsilon))
    }

    /// Combines three channels like [`ResidualKind::combine`], with the same bits; the root curve uses SIMD.
    #[inline(always)]
    pub fn combine_rgb(self, s: [f32; 3], r: [f32; 3], epsilon: f32) -> [f32; 3] {
        // Loops over four, which fill a vector.
        let [mut y, r] = [s, r].map(|[red, green, blue]| [red, green, blue, 0.0]);
        self.encode_slice(&mut y, epsilon);
        y.iter_mut().zip(r).for_each(|(y, r)| *y += r);
        self.decode_slice(&mut y, epsilon);
        [y[0], y[1], y[2]]
    }

    /// Returns the factor on a residual outside the hull, `beyond` as in [`crate::Neighbours`]: `beyond` for an
    /// additive residual, its root for a root residual (both then scale like the light's cosine), and 1 for a log
    /// residual, which is a factor itself.
    #[inline(always)]
    pub fn scale_beyond(self, beyond: f32) -> f32 {
        match self {
            ResidualKind::Additive => beyond,
            ResidualKind::Log => 1.0,
            ResidualKind::Root if beyond == 1.0 => 1.0,
            ResidualKind::Root => root(beyond.max(1e-12)),
        }
    }

    /// Applies [`ResidualKind::encode`] to many numbers in place, with the same bits; the root curve uses SIMD.
    #[inline(always)]
    pub fn encode_slice(self, values: &mut [f32], epsilon: f32) {
        // A loop per kind: a choice within the loop would keep it from running in vectors.
        match self {
            ResidualKind::Additive => {}
            ResidualKind::Log => values.iter_mut().for_each(|x| *x = ResidualKind::Log.encode(*x, epsilon)),
            ResidualKind::Root => values.iter_mut().for_each(|x| *x = ResidualKind::Root.encode(*x, epsilon)),
        }
    }

    /// Applies [`ResidualKind::decode`] to many numbers in place and clamps the results at 0, with the same bits; the
    /// root curve uses SIMD.
    #[inline(always)]
    pub fn decode_slice(self, values: &mut [f32], epsilon: f32) {
        match self {
            ResidualKind::Additive => values.iter_mut().for_each(|y| *y = positive(*y)),
            ResidualKind::Log => values.iter_mut().for_each(|y| *y = positive(ResidualKind::Log.decode(*y, epsilon))),
            ResidualKind::Root => values.iter_mut().for_each(|y| *y = positive(ResidualKind::Root.decode(*y, epsilon))),
        }
    }
}

/// Rows of the bases' colour frame, orthonormal: grey, red-blue, green-magenta.
pub const COLOUR_FRAME: [[f32; 3]; 3] = [
    [0.577_350_26, 0.577_350_26, 0.577_350_26],
    [std::f32::consts::FRAC_1_SQRT_2, 0.0, -std::f32::consts::FRAC_1_SQRT_2],
    [0.408_248_3, -0.816_496_6, 0.408_248_3],
];

/// Factor matrices that all bases of a layer share, one pair for each channel of the colour frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Factors {
    /// Number of views and lights.
    pub shape: [usize; 2],
    /// Ranks `[view, light]` of each channel.
    pub ranks: [[usize; 2]; 3],
    /// View matrix of each channel, row-major `[view, view rank]`.
    pub view: [Vec<f16>; 3],
    /// Light matrix of each channel, row-major `[light, light rank]`.
    pub light: [Vec<f16>; 3],
}

impl Factors {
    /// Returns the number of values of one core, `[channel, view rank, light rank]`.
    pub fn core_len(&self) -> usize {
        self.ranks.iter().map(|rank| rank[0] * rank[1]).sum()
    }
}

/// The bases that all clusters of a layer share. The bases of each cluster are mixtures of these.
#[derive(Debug, Clone, PartialEq)]
pub struct SharedBases {
    /// Quantisation step of each basis' core.
    pub steps: Vec<f32>,
    /// Codes q, `[basis, channel, view rank, light rank]`; a value of a core is `step * q`.
    pub values: Vec<i16>,
}

impl SharedBases {
    /// Returns the core of shared basis `number`, `[channel, view rank, light rank]`.
    pub fn core(&self, number: usize) -> Vec<f32> {
        let len = self.values.len() / self.steps.len();
        self.values[number * len..(number + 1) * len].iter().map(|q| self.steps[number] * f32::from(*q)).collect()
    }
}

/// The mean, or one component, of every cluster as a mixture of the shared bases.
#[derive(Debug, Clone, PartialEq)]
pub struct Basis {
    /// Quantisation step of each cluster.
    pub steps: Vec<f32>,
    /// Codes q, `[cluster, shared basis]`; the weight of a shared basis is `step * q`.
    pub values: Vec<i16>,
}

/// The coefficients of one component for all texels.
#[derive(Debug, Clone, PartialEq)]
pub struct Coefficients {
    /// Quantisation step: the coefficient is `step * code`.
    pub step: f32,
    /// Code of each texel.
    pub codes: Vec<i8>,
}

/// Components whose coefficients are coded together, each predicted from the neighbouring texels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PredictedGroup {
    /// Number of components.
    pub components: usize,
    /// Number of first components of the left, upper, upper left and upper right neighbour by which they are predicted,
    /// at most those of this and earlier groups.
    pub inputs: [u8; 4],
    /// Number of first components of the texel itself by which they are predicted, at most those of earlier groups.
    pub own: u8,
}

impl PredictedGroup {
    /// Returns the number of inputs of a prediction.
    pub fn input_count(&self) -> usize {
        self.inputs.iter().map(|count| usize::from(*count)).sum::<usize>() + usize::from(self.own)
    }

    /// Returns whether a group behind component `first` can be: inputs are decoded before what they predict, and are not
    /// too many.
    pub fn is_valid_behind(&self, first: usize) -> bool {
        let end = first + self.components;
        self.components > 0
            && self.inputs.iter().all(|count| usize::from(*count) <= end)
            && usize::from(self.own) <= first
            && self.input_count() <= MAX_INPUTS
    }
}

/// The residual of a layer.
#[derive(Debug, Clone, PartialEq)]
pub struct Residual {
    /// Factor matrices of the shared bases' cores.
    pub factors: Factors,
    /// The shared bases.
    pub shared: SharedBases,
    /// Bases of the clusters: `bases[0]` is the mean, `bases[j]` the j-th component.
    pub bases: Vec<Basis>,
    /// Coefficients of the components: `coefficients[j - 1]` belongs to `bases[j]`.
    pub coefficients: Vec<Coefficients>,
    /// Groups of components whose coefficients a file predicts, in order and of all components; none where it codes
    /// each component by itself.
    pub groups: Vec<PredictedGroup>,
}

impl Residual {
    /// Keeps the first `count` components.
    pub(crate) fn truncate(&mut self, count: usize) {
        self.coefficients.truncate(count);
        self.bases.truncate(self.coefficients.len() + 1);
        let mut first = 0;
        self.groups.retain_mut(|group| {
            group.components = group.components.min(self.coefficients.len() - first);
            first += group.components;
            group.inputs = group.inputs.map(|inputs| inputs.min(first as u8));
            group.components > 0
        });
    }

    /// Returns whether `cluster` has component `index`, counted from 1: whether its mixture of shared bases is not 0. Where
    /// coefficients are predicted, its texels have none of a component that it lacks.
    pub fn has_component(&self, cluster: usize, index: usize) -> bool {
        let (basis, shared) = (&self.bases[index], self.shared.steps.len());
        let codes = &basis.values[cluster * shared..(cluster + 1) * shared];
        codes.iter().any(|code| basis.steps[cluster] * f32::from(*code) != 0.0)
    }

    /// Mixes the shared cores into the core of basis `index` in `cluster`, `[channel, view rank, light rank]`.
    ///
    /// Cost: a multiply-add per core value and shared basis with a weight other than 0.
    pub fn core(&self, index: usize, cluster: usize) -> Vec<f32> {
        let (len, shared) = (self.factors.core_len(), self.shared.steps.len());
        let basis = &self.bases[index];
        let mut core = vec![0.0f32; len];
        for (number, q) in basis.values[cluster * shared..(cluster + 1) * shared].iter().enumerate() {
            if *q != 0 {
                let weight = basis.steps[cluster] * f32::from(*q) * self.shared.steps[number];
                let values = &self.shared.values[number * len..(number + 1) * len];
                core.iter_mut().zip(values).for_each(|(sum, x)| *sum += weight * f32::from(*x));
            }
        }
        core
    }
}

/// Expands a core to `[view, light, rgb]`: `sum_rs U[v, r] core[r, s] W[l, s]`, back in RGB.
///
/// Cost: about 0.3 MFLOP a channel for the 81 x 81 directions of a Bonn capture at rank 32.
pub fn expand_core(factors: &Factors, core: &[f32]) -> Vec<f32> {
    let [views, lights] = factors.shape;
    let mut rgb = vec![0.0f32; views * lights * 3];
    let mut core_at = 0;
    for channel in 0..3 {
        let [rv, rl] = factors.ranks[channel];
        let core = &core[core_at..core_at + rv * rl];
        core_at += rv * rl;
        let view: Vec<f32> = factors.view[channel].iter().map(|x| x.to_f32()).collect();
        let light: Vec<f32> = factors.light[channel].iter().map(|x| x.to_f32()).collect();
        // rows[r, l] = sum_s core[r, s] W[l, s]
        let mut rows = vec![0.0f32; rv * lights];
        for r in 0..rv {
            for l in 0..lights {
                let w = &light[l * rl..(l + 1) * rl];
                rows[r * lights + l] = core[r * rl..(r + 1) * rl].iter().zip(w).map(|(a, b)| a * b).sum();
            }
        }
        let mut line = vec![0.0f32; lights];
        for v in 0..views {
            line.fill(0.0);
            for r in 0..rv {
                let u = view[v * rv + r];
                for (out, x) in line.iter_mut().zip(&rows[r * lights..(r + 1) * lights]) {
                    *out += u * x;
                }
            }
            for (l, x) in line.iter().enumerate() {
                for c in 0..3 {
                    rgb[(v * lights + l) * 3 + c] += COLOUR_FRAME[channel][c] * x;
                }
            }
        }
    }
    rgb
}

/// Evaluates a core at one pair of directions straight from the factored form. Cost: `view rank x light rank`
/// multiply-adds a channel, which is why the resident form holds expanded bases.
pub fn core_at_pair(factors: &Factors, core: &[f32], view: usize, light: usize) -> [f32; 3] {
    let mut rgb = [0.0f32; 3];
    let mut at = 0;
    for channel in 0..3 {
        let [rv, rl] = factors.ranks[channel];
        let w = &factors.light[channel][light * rl..(light + 1) * rl];
        let mut sum = 0.0f32;
        for r in 0..rv {
            let inner: f32 = core[at..at + rl].iter().zip(w).map(|(q, x)| q * x.to_f32()).sum();
            sum += factors.view[channel][view * rv + r].to_f32() * inner;
            at += rl;
        }
        for c in 0..3 {
            rgb[c] += COLOUR_FRAME[channel][c] * sum;
        }
    }
    rgb
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_curve_is_undone_by_its_inverse() {
        for kind in [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root] {
            for x in [0.0f32, 1e-4, 0.02, 0.5, 1.0, 7.0, 100.0] {
                let back = kind.decode(kind.encode(x, 0.01), 0.01);
                assert!((back - x).abs() <= 1e-5 + 2e-5 * x, "{kind:?} {x} {back}");
            }
            for y in [-1e30f32, -5.0, 0.0, 1e3] {
                assert!(kind.decode(y, 0.01).is_finite());
            }
        }
    }

    #[test]
    fn slices_hold_the_same_bits_as_single_numbers() {
        let values: Vec<f32> = (0..1003).map(|i| (i as f32 - 200.0) * 0.0137).collect();
        for kind in [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root] {
            let (mut encoded, mut decoded) = (values.clone(), values.clone());
            kind.encode_slice(&mut encoded, 0.01);
            kind.decode_slice(&mut decoded, 0.01);
            for (i, x) in values.iter().enumerate() {
                assert_eq!(encoded[i].to_bits(), kind.encode(*x, 0.01).to_bits(), "{kind:?} {x}");
                assert_eq!(decoded[i].to_bits(), kind.decode(*x, 0.01).max(0.0).to_bits(), "{kind:?} {x}");
            }
            // Planted difference: another epsilon.
            let mut other = values.clone();
            kind.decode_slice(&mut other, 0.02);
            assert_eq!(other == decoded, kind == ResidualKind::Additive);
        }
    }

    #[test]
    fn the_colour_frame_is_orthonormal() {
        for i in 0..3 {
            for j in 0..3 {
                let product: f32 = (0..3).map(|c| COLOUR_FRAME[i][c] * COLOUR_FRAME[j][c]).sum();
                assert!((product - if i == j { 1.0 } else { 0.0 }).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn the_expanded_core_agrees_with_the_factored_one_at_every_pair() {
        let number = |i: usize| ((i * 7919 % 1000) as f32 / 500.0) - 1.0;
        let matrix = |n: usize, salt: usize| (0..n).map(|i| f16::from_f32(number(i + salt))).collect::<Vec<_>>();
        let factors = Factors {
            shape: [5, 7],
            ranks: [[4, 3], [2, 2], [1, 2]],
            view: [matrix(20, 1), matrix(10, 2), matrix(5, 3)],
            light: [matrix(21, 4), matrix(14, 5), matrix(14, 6)],
        };
        let codes = |n: usize, salt: usize| (0..n).map(|i| (100.0 * number(3 * i + salt)) as i16).collect::<Vec<_>>();
        let shared = SharedBases { steps: vec![0.01, 0.002, 0.03], values: codes(3 * factors.core_len(), 7) };
        let bases = vec![Basis { steps: vec![0.02, 0.01], values: codes(6, 8) }];
        let residual = Residual { factors, shared, bases, coefficients: Vec::new(), groups: Vec::new() };
        for cluster in 0..2 {
            let (core, other) = (residual.core(0, cluster), residual.core(0, 1 - cluster));
            let expanded = expand_core(&residual.factors, &core);
            for view in 0..5 {
                for light in 0..7 {
                    let at = (view * 7 + light) * 3;
                    let close = |core: &[f32]| {
                        let direct = core_at_pair(&residual.factors, core, view, light);
                        (0..3).all(|c| (direct[c] - expanded[at + c]).abs() < 1e-4)
                    };
                    assert!(close(&core));
                    assert!(!close(&other), "the planted cluster must not agree");
                }
            }
            // By hand: the mixture's first value.
            let by_hand: f64 = (0..3)
                .map(|r| {
                    let weight = f64::from(residual.bases[0].steps[cluster])
                        * f64::from(residual.bases[0].values[cluster * 3 + r]);
                    let value = residual.shared.values[r * residual.factors.core_len()];
                    weight * f64::from(residual.shared.steps[r]) * f64::from(value)
                })
                .sum();
            assert!((by_hand - f64::from(core[0])).abs() < 1e-5);
        }
    }
}
