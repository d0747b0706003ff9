//! Codes the coefficients of all texels of a layer. Each is predicted from the neighbouring texels by weights that are
//! learnt on the way, and only the difference from the prediction is coded. One routine serves encoder and decoder, as
//! in [`crate::container::entropy`].
//!
//! The weights are those of recursive least squares [Haykin 2002, chapter 9], a set for each cluster. All sums are in
//! single precision and in the order of their index, with every operation rounded by itself, so that every machine
//! predicts the same numbers.

use crate::asset::residual::{Basis, Coefficients, PredictedGroup, Residual};
use crate::container::entropy::{BinaryCoder, Bit, Encoder, context};
use crate::numeric::in_vectors::in_vectors;
use crate::numeric::padded_rows::{LANES, Vector, add_rows, add_scaled, padded, vectors, zeros};
use pulp::{Simd, WithSimd};
use std::ops::Range;

/// Ridge that holds the weights to those that they begin with, in squared codes.
const RIDGE: f32 = 50.0;
/// Weight, at first, of the same component of the left and of the upper neighbour.
const FIRST_WEIGHT: f32 = 0.5;
/// Size of an error that is expected, at first, in codes.
const FIRST_SIZE: f32 = 0.5;
/// Number of texels of a cluster over which the sizes of its errors are averaged.
const AVERAGED: f32 = 400.0;
/// Share of the average size, scaled to the texel's errors so far, in the expected size.
const OWN_SHARE: f32 = 0.9;
/// Share of the size that the left and of the size that the upper neighbour's error had.
const NEIGHBOUR_SHARE: f32 = 0.1;
/// Added to the sums of a texel's sizes and of the average ones before they are divided.
const STEADY: f32 = 2.0;
/// Contexts of an expected size, those of [`context`] of its sixteenths.
const EXPECTED: usize = 32;
const SIXTEENTHS: f32 = 16.0;
/// Contexts of the distance of a prediction from the nearest code.
const DISTANCES: usize = 4;
/// Size of a difference from which on it is told by its binary digits.
const LARGE: u32 = 18;
/// Number of binary digits behind the first that a large difference has at most.
const LARGE_DIGITS: usize = 8;
/// Largest prediction and largest code that an encoder chooses.
const MAX_CODE: f32 = 127.0;
/// Operations, and numbers in memory, that a group may take for each of its bytes: a short file must not keep a reader
/// busy.
const MAX_OPERATIONS_PER_BYTE: u64 = 1 << 18;
const MAX_NUMBERS_PER_BYTE: u64 = 1 << 10;

/// Neighbours of a texel, in the order of a group's inputs, as columns and rows: left, above, above left, above right.
const NEIGHBOURS: [[isize; 2]; 4] = [[-1, 0], [0, -1], [-1, -1], [1, -1]];

/// What prediction knows of a layer.
pub(crate) struct CoefficientFrame<'a> {
    /// Texels in a row.
    pub width: usize,
    /// Cluster of each texel.
    pub texel_clusters: &'a [u8],
    /// Mean and first components of all clusters.
    pub bases: &'a [Basis],
    /// Steps of the first components' coefficients.
    pub steps: &'a [f32],
    /// Number of components that a texel's codes have room for.
    pub components: usize,
}

impl CoefficientFrame<'_> {
    fn clusters(&self) -> usize {
        self.bases[0].steps.len()
    }

    /// Returns the number of shared bases.
    fn shared(&self) -> usize {
        self.bases[0].values.len() / self.clusters().max(1)
    }

    /// Returns the mean, or a component, of a cluster as a mixture of the shared bases.
    fn mixture(&self, cluster: usize, basis: usize) -> Vec<f32> {
        let (basis, shared) = (&self.bases[basis], self.shared());
        let codes = &basis.values[cluster * shared..(cluster + 1) * shared];
        codes.iter().map(|code| basis.steps[cluster] * f32::from(*code)).collect()
    }

    /// Returns whether a stream of `bytes` bytes is long enough for the time and memory that the group behind component
    /// `first` takes. Rows count without their padding, which adds 26 MB at most.
    pub(crate) fn allows(&self, group: &PredictedGroup, first: usize, bytes: usize) -> bool {
        let [texels, clusters, shared] = [self.texel_clusters.len(), self.clusters(), self.shared()].map(|n| n as u64);
        let [inputs, components, end] =
            [group.input_count(), group.components, first + group.components].map(|n| n as u64);
        let widest = u64::from(group.inputs.into_iter().max().unwrap_or(0));
        let learnt = inputs * (inputs + components);
        let mixtures = shared * (1 + end + widest);
        texels * (learnt + mixtures) <= MAX_OPERATIONS_PER_BYTE * bytes as u64
            && clusters * (learnt + mixtures) <= MAX_NUMBERS_PER_BYTE * bytes as u64
    }
}

/// The choice of a code by an encoder.
pub(crate) trait Choice {
    /// Returns the code to be written for a component of a texel. `bits` returns the bits that a code takes.
    fn choose(&mut self, texel: usize, component: usize, bits: impl Fn(i32) -> f32) -> i32;
}

/// Codes that are chosen already, `[texel][component]`; a decoder's do not count.
pub(crate) struct Given<'a> {
    pub codes: &'a [i8],
    pub components: usize,
}

impl Choice for Given<'_> {
    #[inline(always)]
    fn choose(&mut self, texel: usize, component: usize, _: impl Fn(i32) -> f32) -> i32 {
        self.codes.get(texel * self.components + component).map_or(0, |code| i32::from(*code))
    }
}

/// Codes of least squared error and bits together.
struct Cheapest<'a> {
    /// Wanted coefficients, in steps, `[texel][component]`.
    wanted: &'a [f32],
    components: usize,
    /// Squared error that a bit must take away, in squared steps.
    price: f32,
}

impl Choice for Cheapest<'_> {
    #[inline(always)]
    fn choose(&mut self, texel: usize, component: usize, bits: impl Fn(i32) -> f32) -> i32 {
        let wanted = self.wanted[texel * self.components + component];
        let cost = |code: f32| (wanted - code) * (wanted - code) + self.price * bits(code as i32);
        let below = wanted.floor().clamp(-MAX_CODE, MAX_CODE - 1.0);
        // The two next to it, and the one behind them towards 0.
        let third = if wanted > 0.0 { (below - 1.0).max(-MAX_CODE) } else { (below + 2.0).min(MAX_CODE) };
        let mut best = (cost(below), below);
        for code in [below + 1.0, third] {
            let cost = cost(code);
            if cost < best.0 {
                best = (cost, code);
            }
        }
        best.1 as i32
    }
}

/// Contexts of a difference.
#[derive(Clone, Copy)]
struct Contexts {
    /// By the size that is expected.
    expected: usize,
    /// By the distance of the prediction from the nearest code.
    distance: usize,
}

/// Models of the differences of codes from their predictions.
struct Differences {
    zero: [[Bit; DISTANCES]; EXPECTED],
    negative: [[Bit; DISTANCES]; EXPECTED],
    /// Whether a difference is larger than its index: `[expected size][1 to LARGE - 1]`.
    larger: [[Bit; LARGE as usize]; EXPECTED],
    longer: [Bit; LARGE_DIGITS],
    digit: [Bit; LARGE_DIGITS],
}

impl Differences {
    fn new() -> Differences {
        Differences {
            zero: [[Bit::NEW; DISTANCES]; EXPECTED],
            negative: [[Bit::NEW; DISTANCES]; EXPECTED],
            larger: [[Bit::NEW; LARGE as usize]; EXPECTED],
            longer: [Bit::NEW; LARGE_DIGITS],
            digit: [Bit::NEW; LARGE_DIGITS],
        }
    }

    #[inline(always)]
    fn code(&mut self, coder: &mut impl BinaryCoder, value: i32, contexts: Contexts) -> i32 {
        let Contexts { expected, distance } = contexts;
        if !coder.bit(&mut self.zero[expected][distance], value != 0) {
            return 0;
        }
        let negative = coder.bit(&mut self.negative[expected][distance], value < 0);
        let size = value.unsigned_abs();
        let mut read = 1;
        while read < LARGE && coder.bit(&mut self.larger[expected][read as usize], size > read) {
            read += 1;
        }
        if read == LARGE {
            read = LARGE - 1 + self.code_rest(coder, (size + 1).saturating_sub(LARGE).max(1));
        }
        if negative { -(read as i32) } else { read as i32 }
    }

    /// Codes a number from 1 on: how many binary digits follow the first, then these.
    fn code_rest(&mut self, coder: &mut impl BinaryCoder, value: u32) -> u32 {
        let given = 31 - value.leading_zeros();
        let mut length = 0;
        while length < LARGE_DIGITS && coder.bit(&mut self.longer[length], (length as u32) < given) {
            length += 1;
        }
        (0..length)
            .rev()
            .fold(1, |read, bit| read << 1 | u32::from(coder.bit(&mut self.digit[bit], value >> bit & 1 == 1)))
    }

    /// Returns about the bits of a difference.
    #[inline(always)]
    fn bits(&self, value: i32, contexts: Contexts) -> f32 {
        let Contexts { expected, distance } = contexts;
        let zero = self.zero[expected][distance];
        if value == 0 {
            return zero.bits(false);
        }
        let (size, larger) = (value.unsigned_abs(), &self.larger[expected]);
        let sign = self.negative[expected][distance].bits(value < 0);
        let steps = larger[1..size.min(LARGE) as usize].iter().map(|bit| bit.bits(true));
        let last = if size < LARGE { larger[size as usize].bits(false) } else { 2.0 * (size as f32).log2() };
        zero.bits(true) + sign + steps.sum::<f32>() + last
    }
}

/// What is known of a cluster, and what has been learnt from its texels so far.
struct Cluster {
    /// Mean as a mixture of the shared bases.
    mean: Vec<Vector>,
    /// Components as mixtures of the shared bases, in order.
    components: Vec<Vector>,
    /// Codes of the first components per coordinate, `[coordinate][component]`.
    codes: Vec<Vector>,
    /// Whether the cluster has the components of the group: it lacks those whose mixture is 0.
    has: Vec<bool>,
    /// Inverse of the inputs' products, `[input][input]`, but for the last texel.
    inverse: Vec<Vector>,
    /// Product of the inverse and the last texel's inputs, and 1 and its product with these inputs; 0 where there is
    /// nothing to be learnt.
    gain: Vec<Vector>,
    along: f32,
    /// Weights, `[input][component]`.
    weights: Vec<Vector>,
    /// Mean size of the components' errors.
    sizes: Vec<f32>,
    /// Number of texels that they are averaged over.
    seen: f32,
}

impl Cluster {
    fn new(frame: &CoefficientFrame, group: &PredictedGroup, components: &Range<usize>, number: usize) -> Cluster {
        let (inputs, count, shared) = (group.input_count(), components.len(), frame.shared());
        let mixtures: Vec<Vec<f32>> = (1..=components.end).map(|j| frame.mixture(number, j)).collect();
        let widest = usize::from(group.inputs.into_iter().max().unwrap_or(0));
        let mut codes = zeros(shared, widest);
        for (j, (mixture, step)) in mixtures.iter().zip(frame.steps).enumerate().take(widest) {
            if *step > 0.0 {
                let row = LANES * vectors(widest);
                mixture.iter().enumerate().for_each(|(r, x)| codes.as_flattened_mut()[r * row + j] = x / step);
            }
        }
        let mut weights = zeros(inputs, count);
        let [left, above] = [0, 1].map(|neighbour| usize::from(group.inputs[neighbour]));
        for (first, same) in [(0, left), (left, above)] {
            for j in components.start..components.end.min(same) {
                let row = LANES * vectors(count);
                weights.as_flattened_mut()[(first + j) * row + j - components.start] = FIRST_WEIGHT;
            }
        }
        let mut inverse = zeros(inputs, inputs);
        let row = LANES * vectors(inputs);
        (0..inputs).for_each(|i| inverse.as_flattened_mut()[i * row + i] = 1.0 / RIDGE);
        let has = mixtures[components.clone()].iter().map(|mixture| mixture.iter().any(|x| *x != 0.0)).collect();
        Cluster {
            mean: padded(&frame.mixture(number, 0)),
            components: mixtures.iter().flat_map(|mixture| padded(mixture)).collect(),
            codes,
            has,
            inverse,
            gain: zeros(1, inputs),
            along: 0.0,
            weights,
            sizes: vec![FIRST_SIZE; count],
            seen: 1.0,
        }
    }

    /// Learns from the errors of the last predictions, which came from `inputs`. `gain` and `factors` are scratch.
    #[inline(always)]
    fn learn<S: Simd>(
        &mut self,
        simd: S,
        inputs: &[f32],
        error: &[Vector],
        gain: &mut [Vector],
        factors: &mut [Vector],
    ) {
        if inputs.is_empty() {
            return;
        }
        // The inverse after the texel before this one, and its product with the inputs: one pass through memory.
        divided(factors, &self.gain, self.along);
        let factors = factors.as_flattened_mut();
        let learnt = (self.along > 0.0).then_some((&*factors, &*self.gain));
        gain.fill([0.0; LANES]);
        add_rows(simd, (&mut self.inverse, gain.len()), inputs, learnt, gain);
        let along = inputs.iter().zip(gain.as_flattened()).fold(1.0f32, |sum, (x, g)| sum + x * g);
        // Less than 1 is rounding, or numbers of a hostile file.
        self.along = if along >= 1.0 && along.is_finite() { along } else { 0.0 };
        if self.along > 0.0 {
            self.gain.copy_from_slice(gain);
            inputs.iter().zip(gain.as_flattened()).zip(&mut *factors).for_each(|((_, g), factor)| *factor = g / along);
            for (factor, weights) in factors.iter().zip(self.weights.chunks_exact_mut(error.len())) {
                add_scaled(simd, weights, *factor, error);
            }
        }
    }
}

/// Sets `factors` to what of `gain` each row of an inverse loses: -gain / along.
#[inline(always)]
fn divided(factors: &mut [Vector], gain: &[Vector], along: f32) {
    for (factors, gain) in factors.iter_mut().zip(gain) {
        factors.iter_mut().zip(gain).for_each(|(factor, g)| *factor = -(g / along));
    }
}

/// Codes the coefficients of the group of components behind component `first` of all texels; `codes` are `[texel][component]`,
/// those of earlier groups are there already. Returns false where a decoder met a number that is no code.
pub(crate) fn code_group(
    coder: &mut impl BinaryCoder,
    choice: &mut impl Choice,
    frame: &CoefficientFrame,
    (group, first): (&PredictedGroup, usize),
    codes: &mut [i8],
) -> bool {
    in_vectors(Coding { coder, choice, frame, group, first, codes })
}

/// The arguments of [`code_group`], for [`pulp`].
struct Coding<'a, 'b, B, C> {
    coder: &'a mut B,
    choice: &'a mut C,
    frame: &'a CoefficientFrame<'b>,
    group: &'a PredictedGroup,
    first: usize,
    codes: &'a mut [i8],
}

impl<B: BinaryCoder, C: Choice> WithSimd for Coding<'_, '_, B, C> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let texels = self.frame.texel_clusters.len();
        let mut rows = Rows::new(self.frame, self.group, self.first);
        let mut fits = true;
        for texel in 0..texels {
            fits &= rows.code(simd, self.coder, self.choice, self.codes, texel);
        }
        fits
    }
}

/// The state of coding between two texels: what is kept of this row and of the one above, and the models.
struct Rows<'a, 'b> {
    frame: &'a CoefficientFrame<'b>,
    group: &'a PredictedGroup,
    components: Range<usize>,
    clusters: Vec<Option<Box<Cluster>>>,
    models: Differences,
    /// Values of the texels of the row above and of this one in coordinates, `[column][coordinate]`; only of those that
    /// a neighbour of another cluster asks for.
    values: [Vec<Vector>; 2],
    /// Sizes of the errors of the row above and of this one, `[1 + column][component]`.
    sizes: [Vec<f32>; 2],
    /// Inputs, predictions and errors of the texel, and scratch of learning.
    inputs: Vec<f32>,
    predicted: Vec<Vector>,
    error: Vec<Vector>,
    gain: Vec<Vector>,
    factors: Vec<Vector>,
    /// Codes that a neighbour of another cluster would have.
    there: Vec<Vector>,
    /// Value of a neighbour of another cluster less the cluster's mean, in coordinates.
    off: Vec<Vector>,
    /// Coefficients of a texel.
    coefficients: Vec<f32>,
}

impl<'a, 'b> Rows<'a, 'b> {
    fn new(frame: &'a CoefficientFrame<'b>, group: &'a PredictedGroup, first: usize) -> Rows<'a, 'b> {
        let (count, inputs) = (group.components, group.input_count());
        Rows {
            frame,
            group,
            components: first..first + count,
            clusters: (0..frame.clusters()).map(|_| None).collect(),
            models: Differences::new(),
            values: [0, 1].map(|_| zeros(frame.width, frame.shared())),
            sizes: [0, 1].map(|_| vec![0.0; (1 + frame.width) * count]),
            inputs: vec![0.0; inputs],
            predicted: zeros(1, count),
            error: zeros(1, count),
            gain: zeros(1, inputs),
            factors: zeros(1, inputs),
            off: zeros(1, frame.shared()),
            coefficients: vec![0.0; first + count],
            there: zeros(1, group.inputs.into_iter().max().unwrap_or(0).into()),
        }
    }

    /// Codes a texel. Returns false where a decoder met a number that is no code.
    #[inline(always)]
    fn code<S: Simd, C: Choice>(
        &mut self,
        simd: S,
        coder: &mut impl BinaryCoder,
        choice: &mut C,
        codes: &mut [i8],
        texel: usize,
    ) -> bool {
        if texel.is_multiple_of(self.frame.width) {
            self.values.swap(0, 1);
            self.sizes.swap(0, 1);
            self.sizes[1].fill(0.0);
        }
        let number = usize::from(self.frame.texel_clusters[texel]);
        let mut cluster = self.clusters[number]
            .take()
            .unwrap_or_else(|| Box::new(Cluster::new(self.frame, self.group, &self.components, number)));
        self.take_inputs(simd, &mut cluster, codes, texel);
        self.predicted.fill([0.0; LANES]);
        let length = self.predicted.len();
        add_rows(simd, (&mut cluster.weights, length), &self.inputs, None, &mut self.predicted);
        let fits = self.code_components(coder, choice, &mut cluster, codes, texel);
        self.keep_value(simd, &mut cluster, codes, texel);
        cluster.learn(simd, &self.inputs, &self.error, &mut self.gain, &mut self.factors);
        self.clusters[number] = Some(cluster);
        fits
    }

    /// Sets the inputs of a texel: the codes of each neighbour's first components, or what they would be in the texel's
    /// cluster, and its own codes of earlier groups.
    #[inline(always)]
    fn take_inputs<S: Simd>(&mut self, simd: S, cluster: &mut Cluster, codes: &[i8], texel: usize) {
        let (width, all) = (self.frame.width, self.frame.components);
        let (row, column) = (texel / width, texel % width);
        let shared = vectors(self.frame.shared());
        let widest = self.there.len();
        let mut rest = &mut self.inputs[..];
        for ([right, down], count) in NEIGHBOURS.into_iter().zip(self.group.inputs) {
            let (inputs, others) = rest.split_at_mut(usize::from(count));
            rest = others;
            inputs.fill(0.0);
            let (x, y) = (column as isize + right, row as isize + down);
            if x < 0 || y < 0 || x >= width as isize {
                continue;
            }
            let neighbour = y as usize * width + x as usize;
            if self.frame.texel_clusters[neighbour] == self.frame.texel_clusters[texel] {
                let codes = &codes[neighbour * all..][..inputs.len()];
                inputs.iter_mut().zip(codes).for_each(|(x, code)| *x = f32::from(*code));
            } else {
                let value = &self.values[if down < 0 { 0 } else { 1 }][x as usize * shared..][..shared];
                let there = &mut self.there[..vectors(inputs.len())];
                there.fill([0.0; LANES]);
                for ((off, value), mean) in self.off.iter_mut().zip(value).zip(&cluster.mean) {
                    (0..LANES).for_each(|i| off[i] = value[i] - mean[i]);
                }
                add_rows(simd, (&mut cluster.codes, widest), self.off.as_flattened(), None, there);
                inputs.copy_from_slice(&there.as_flattened()[..inputs.len()]);
            }
        }
        rest.iter_mut().zip(&codes[texel * all..]).for_each(|(x, code)| *x = f32::from(*code));
    }

    /// Codes the components of the group, and sets the errors of their predictions.
    #[inline(always)]
    fn code_components<C: Choice>(
        &mut self,
        coder: &mut impl BinaryCoder,
        choice: &mut C,
        cluster: &mut Cluster,
        codes: &mut [i8],
        texel: usize,
    ) -> bool {
        let (count, column) = (self.components.len(), texel % self.frame.width);
        let own = &mut codes[texel * self.frame.components..][self.components.clone()];
        let [above, here] = &mut self.sizes;
        let above = &above[(1 + column) * count..][..count];
        let (left, here) = here[column * count..].split_at_mut(count);
        let rate = 1.0 / (1.0 + cluster.seen);
        let (mut of_texel, mut usual, mut fits) = (STEADY, STEADY, true);
        let (predicted, errors) = (self.predicted.as_flattened(), self.error.as_flattened_mut());
        for j in 0..count {
            errors[j] = 0.0;
            if !cluster.has[j] {
                own[j] = 0;
                continue;
            }
            let size = &mut cluster.sizes[j];
            let expected = OWN_SHARE * (*size * (of_texel / usual)) + NEIGHBOUR_SHARE * (left[j] + above[j]);
            let predicted = if predicted[j].is_nan() { 0.0 } else { predicted[j].clamp(-MAX_CODE, MAX_CODE) };
            let nearest = (predicted + 0.5).floor();
            let away = predicted - nearest;
            let contexts = Contexts {
                expected: context((SIXTEENTHS * expected) as u32).min(EXPECTED - 1),
                distance: (((2 * DISTANCES) as f32 * away.abs()) as usize).min(DISTANCES - 1),
            };
            // Differences are told as if the prediction lay above the nearest code.
            let (nearest, sign) = (nearest as i32, if away < 0.0 { -1 } else { 1 });
            let models = &mut self.models;
            let bits = |code: i32| models.bits(sign * (code - nearest), contexts);
            let code = choice.choose(texel, self.components.start + j, bits);
            let code = nearest + sign * models.code(coder, sign * (code - nearest), contexts);
            own[j] = code as i8;
            fits &= i32::from(own[j]) == code;
            errors[j] = code as f32 - predicted;
            let error = errors[j].abs();
            here[j] = error;
            of_texel += error;
            usual += *size;
            *size += rate * (error - *size);
        }
        cluster.seen = (cluster.seen + 1.0).min(AVERAGED);
        fits
    }

    /// Keeps the value of a texel in coordinates if a later neighbour of another cluster will ask for it.
    #[inline(always)]
    fn keep_value<S: Simd>(&mut self, simd: S, cluster: &mut Cluster, codes: &[i8], texel: usize) {
        let (width, shared) = (self.frame.width, vectors(self.frame.shared()));
        let clusters = &self.frame.texel_clusters;
        let differs = |later: usize| clusters.get(later).is_some_and(|other| *other != clusters[texel]);
        if ![texel + 1, texel + width, texel + width + 1, texel + width - 1].into_iter().any(differs) {
            return;
        }
        let value = &mut self.values[1][texel % width * shared..][..shared];
        value.copy_from_slice(&cluster.mean);
        let codes = codes[texel * self.frame.components..].iter().zip(self.frame.steps);
        self.coefficients.iter_mut().zip(codes).for_each(|(x, (code, step))| *x = f32::from(*code) * step);
        add_rows(simd, (&mut cluster.components, shared), &self.coefficients, None, value);
    }
}

/// Returns the stream of each group of a residual's coefficients, which [`code_group`] reads.
pub(crate) fn encode_groups(residual: &Residual, width: usize, texel_clusters: &[u8]) -> Vec<Vec<u8>> {
    let components = residual.coefficients.len();
    let given = texel_major(&residual.coefficients, texel_clusters.len());
    let mut codes = given.clone();
    let steps: Vec<f32> = residual.coefficients.iter().map(|plane| plane.step).collect();
    let mut first = 0;
    let streams = residual.groups.iter().map(|group| {
        let end = first + group.components;
        let (bases, steps) = (&residual.bases[..=end], &steps[..end]);
        let frame = CoefficientFrame { width, texel_clusters, bases, steps, components };
        let mut coder = Encoder::new();
        code_group(&mut coder, &mut Given { codes: &given, components }, &frame, (group, first), &mut codes);
        first = end;
        coder.finish()
    });
    streams.collect()
}

/// Chooses the codes of a residual's coefficients: those of least squared error and bits together, with a bit at
/// `price` squared steps. `wanted` are the coefficients in steps, `[texel][component]`; of the residual's coefficients
/// only the steps count. Groups get fewer inputs where they have too many for their bytes. Returns the number of bytes of
/// each group.
///
/// Cost: that of loading, and some tens of nanoseconds a coefficient.
pub fn choose_coefficients(
    residual: &mut Residual,
    (width, texel_clusters): (usize, &[u8]),
    wanted: &[f32],
    price: f32,
) -> Vec<usize> {
    let components = residual.coefficients.len();
    let mut codes = vec![0i8; texel_clusters.len() * components];
    let steps: Vec<f32> = residual.coefficients.iter().map(|plane| plane.step).collect();
    let mut bytes = Vec::new();
    let mut first = 0;
    for index in 0..residual.groups.len() {
        let end = first + residual.groups[index].components;
        let (bases, steps) = (&residual.bases[..=end], &steps[..end]);
        let frame = CoefficientFrame { width, texel_clusters, bases, steps, components };
        loop {
            let group = &mut residual.groups[index];
            let mut coder = Encoder::new();
            code_group(&mut coder, &mut Cheapest { wanted, components, price }, &frame, (&*group, first), &mut codes);
            let stream = coder.finish();
            if group.input_count() == 0 || frame.allows(group, first, stream.len()) {
                bytes.push(stream.len());
                break;
            }
            (group.inputs, group.own) = (group.inputs.map(|inputs| inputs / 2), group.own / 2);
        }
        first = end;
    }
    for (j, plane) in residual.coefficients.iter_mut().enumerate() {
        plane.codes = codes.iter().skip(j).step_by(components).copied().collect();
    }
    bytes
}

/// Returns codes `[texel][component]` of planes.
fn texel_major(planes: &[Coefficients], texels: usize) -> Vec<i8> {
    let mut codes = vec![0i8; texels * planes.len()];
    for (j, plane) in planes.iter().enumerate() {
        codes.iter_mut().skip(j).step_by(planes.len()).zip(&plane.codes).for_each(|(out, code)| *out = *code);
    }
    codes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::asset::Asset;
    use crate::asset::residual::ResidualKind;
    use crate::container::directory::Directory;
    use crate::error::FormatError;
    use crate::file::format::{Head, SectionKind, read_directory};
    use crate::file::pack::{pack, packed_len};
    use crate::rule;
    use crate::testing::{FileParts, Random, sample_grouped_asset};

    fn residual(asset: &mut Asset) -> &mut Residual {
        asset.layers[0].residual.as_mut().unwrap()
    }

    fn directory(bytes: &[u8]) -> Directory<Head> {
        read_directory(bytes).unwrap()
    }

    #[test]
    fn predicted_coefficients_come_back_from_every_tier() {
        for kind in [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root] {
            let asset = sample_grouped_asset(kind as u64, 24, 18, kind);
            let bytes = pack(&asset).unwrap();
            assert_eq!(Asset::parse(&bytes).unwrap(), asset);
            let tiers = directory(&bytes).tiers;
            let at = |tier: usize| Asset::parse(&bytes[..tiers[tier] as usize]).unwrap().layers.remove(0);
            assert_eq!(tiers.len(), 5);
            assert!((0..2).all(|tier| at(tier).residual.is_none()));
            // The lobes of the first tier are those of a cluster, those of the next ones the texels' own.
            assert_ne!(at(0).lobe_refs, at(1).lobe_refs);
            assert_eq!(at(1).lobe_refs, asset.layers[0].lobe_refs);
            for (tier, components) in [(2, 2), (3, 2), (4, 4)] {
                let read = at(tier).residual.unwrap();
                let whole = asset.layers[0].residual.as_ref().unwrap();
                assert_eq!(read.coefficients[..], whole.coefficients[..components], "{tier}");
                assert_eq!(read.groups[..], whole.groups[..components / 2], "{tier}");
                assert_eq!(read.factors, whole.factors);
            }
        }
    }

    #[test]
    fn smooth_coefficients_take_fewer_bytes_when_they_are_predicted() {
        let mut asset = sample_grouped_asset(5, 64, 48, ResidualKind::Root);
        for plane in &mut residual(&mut asset).coefficients[..3] {
            let wave =
                |texel: usize| 40.0 * ((texel % 64) as f32 * 0.11).sin() + 30.0 * ((texel / 64) as f32 * 0.17).cos();
            plane.codes.iter_mut().enumerate().for_each(|(texel, code)| *code = wave(texel) as i8 + *code / 32);
        }
        let mut plain = asset.clone();
        residual(&mut plain).groups.clear();
        let mut blind = asset.clone();
        residual(&mut blind).groups.iter_mut().for_each(|group| (group.inputs, group.own) = ([0; 4], 0));
        let [plain, blind, predicted] = [&plain, &blind, &asset].map(|asset| {
            let kinds = [SectionKind::Coefficients, SectionKind::PredictedCoefficients].map(|kind| kind as u32);
            let sections = directory(&pack(asset).unwrap()).sections;
            sections.iter().filter(|entry| kinds.contains(&entry.kind)).map(|entry| entry.length).sum::<u32>()
        });
        assert!(predicted < plain * 70 / 100 && predicted < blind * 70 / 100, "{plain} {blind} {predicted}");
    }

    #[test]
    fn codes_of_any_size_come_back() {
        let mut asset = sample_grouped_asset(6, 24, 18, ResidualKind::Root);
        let mut random = Random::new(6);
        let extremes = [-128i8, 127, 0, 1, -1, 64];
        for plane in &mut residual(&mut asset).coefficients[..3] {
            plane.codes.iter_mut().for_each(|code| *code = extremes[random.below(extremes.len())]);
            // Numbers that overflow a single: predictions are not finite, and stay lossless.
            plane.step = [1e9, 0.0][random.below(2)];
        }
        asset.layers[0].predict_lobes();
        let mut weights = asset.layers[0].lobe_weights.take().unwrap();
        let layer = &asset.layers[0];
        weights.nodes = weights.nodes_of_texels(&layer.texel_clusters, &layer.coefficient_planes(), 20);
        asset.layers[0].lobe_weights = Some(weights);
        asset.layers[0].predict_lobes();
        for basis in &mut residual(&mut asset).bases {
            basis.steps.iter_mut().for_each(|step| *step = 1e4);
            basis.values.iter_mut().for_each(|code| *code = code.saturating_mul(600));
        }
        assert_eq!(Asset::parse(&pack(&asset).unwrap()).unwrap(), asset);
    }

    #[test]
    fn chosen_codes_cost_little_error_and_the_told_bytes() {
        let mut asset = sample_grouped_asset(7, 64, 48, ResidualKind::Root);
        let texel_clusters = asset.layers[0].texel_clusters.clone();
        let codes = texel_major(&residual(&mut asset).coefficients, texel_clusters.len());
        let mut random = Random::new(7);
        // Clusters want nothing of components that they do not have.
        let off = |code: i8| if code == 0 { 0.0 } else { random.within(-0.5, 0.5) };
        let off: Vec<f32> = codes.iter().copied().map(off).collect();
        let wanted: Vec<f32> = codes.iter().zip(&off).map(|(code, off)| f32::from(*code) + off).collect();
        let noise = off.iter().map(|off| f64::from(*off).powi(2)).sum::<f64>() / off.len() as f64;
        let chosen = |price: f32| {
            let mut asset = asset.clone();
            let bytes = choose_coefficients(residual(&mut asset), (64, &texel_clusters), &wanted, price);
            let made = texel_major(&residual(&mut asset).coefficients, texel_clusters.len());
            let error = |(wanted, code): (&f32, &i8)| f64::from(wanted - f32::from(*code)).powi(2);
            let used = wanted.iter().zip(&made).map(error).sum::<f64>() / wanted.len() as f64;
            asset.layers[0].lobe_weights = None;
            assert_eq!(packed_len(&asset, std::slice::from_ref(&bytes)).unwrap(), pack(&asset).unwrap().len());
            (bytes.iter().sum::<usize>(), used)
        };
        let [free, cheap, dear] = [0.0, 0.12, 0.5].map(chosen);
        assert!(dear.0 < cheap.0 && cheap.0 < free.0, "{free:?} {cheap:?} {dear:?}");
        assert!((free.1 - noise).abs() < 1e-6 * noise, "{free:?} {noise}");
        // Each bit less costs about the error that it may cost.
        for (dear, cheap, price) in [(free, cheap, 0.12), (cheap, dear, 0.5)] {
            let spent = (cheap.1 - dear.1) * wanted.len() as f64 / (8.0 * (dear.0 - cheap.0) as f64);
            assert!((0.3 * price..2.0 * price).contains(&spent), "{dear:?} {cheap:?} {spent}");
        }
    }

    #[test]
    fn a_group_that_asks_for_too_much_is_refused() {
        let asset = sample_grouped_asset(8, 24, 18, ResidualKind::Root);
        let bytes = pack(&asset).unwrap();
        let changed = |word: usize, value: u32| {
            let mut parts = FileParts::from_bytes(&bytes).unwrap();
            let kind = SectionKind::PredictedCoefficients as u32;
            let section = parts.sections.iter_mut().rfind(|section| section.head[0] == kind).unwrap();
            section.bytes[4 * word..4 * word + 4].copy_from_slice(&value.to_le_bytes());
            match Asset::parse(&parts.to_bytes()) {
                Err(FormatError::Section { reason, .. }) => Some(reason),
                _ => None,
            }
        };
        // Shared bases, components, inputs that are not decoded yet, own ones of the group itself.
        for (word, value) in [(0, 2000), (0, 4), (1, 0), (1, 3), (2, 5), (5, 300), (6, 3)] {
            assert_eq!(changed(word, value), Some(rule::GROUP), "{word} {value}");
        }
        let frame = |clusters: &[u8], allowed: bool| {
            let residual = asset.layers[0].residual.as_ref().unwrap();
            let (bases, steps) = (&residual.bases[..], [1.0; 4]);
            let frame = CoefficientFrame { width: 1000, texel_clusters: clusters, bases, steps: &steps, components: 4 };
            assert_eq!(frame.allows(&residual.groups[1], 2, 100), allowed);
        };
        frame(&[0; 1000], true);
        frame(&[0; 1_000_000], false);
        let mut bad = asset.clone();
        residual(&mut bad).groups[1].own = 3;
        assert!(matches!(pack(&bad), Err(FormatError::Pack { .. })));
    }
}
