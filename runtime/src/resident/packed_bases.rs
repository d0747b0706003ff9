//! Bases of the clusters in few bits, for a resident form that is a tenth as large: each component is rounded as coarsely
//! as its coefficients are small, and each of its numbers takes as many bits as its component and channel need.
//!
//! A step of component j in cluster k is `d / rms of its coefficients`, so that each component adds the same error, which
//! is what least bytes for an error ask for. In the colour frame most chroma takes no bits at all. The order and the
//! widths of the numbers are those of the cluster; a pair's numbers are a *row* of whole words, which a decoder reads from
//! front to back, and a shorter sum reads a shorter part.
//!
//! docs/reference/format.md, chapter "Packed bases", has the layout.

use crate::asset::asset::{Asset, Layer};
use crate::asset::residual::COLOUR_FRAME;
use crate::resident::expansion::Expansion;
use crate::threads::{Threads, map};
use half::f16;

/// Number of words before the places of the clusters' rows: unit (f32), bases, offset of the words of the bases, zero.
pub const PACKED_PLACES: usize = 4;
/// Greatest number of bits of a number.
pub(crate) const MAX_WIDTH: u32 = 15;
/// Largest size of a number of a basis, so that every decoded value is finite.
const MAX_NUMBER: f32 = 1e6;
/// Largest size of a number that is packed.
const MAX_PACKED: f32 = 65504.0;
/// Largest unit of a layer's steps.
pub(crate) const MAX_UNIT: f32 = 1e9;
/// Bits of a word.
pub(crate) const WORD_BITS: u32 = u32::BITS;
/// Number of pairs by which widths are chosen.
const SAMPLES: usize = 1000;
/// Number of largest values between those pairs that count as well: a highlight that few pairs see must not be cut unseen.
const TAIL: usize = 16;
/// Squared error, in squared steps, that one more bit of a number must take away: the slope of `step^2 / 12` over bits.
const BIT_PRICE: f64 = std::f64::consts::LN_2 / 6.0;
/// Largest step, in units.
const MAX_STEP: f64 = 60_000.0;
/// Halvings of the interval in which the step is searched for.
const HALVINGS: usize = 18;

/// What packed bases may cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PackedGoal {
    /// Most bytes of the whole resident form.
    Bytes(u64),
    /// Root mean square of what the residual may change by at the measured pairs, in its curve.
    Noise(f32),
}

/// What a decoder knows of a basis of a cluster, as its word holds it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PackedBasis {
    /// Step, in units of the layer.
    pub step: f16,
    /// Bits of a number of each channel of the colour frame; 0 where all are 0.
    pub widths: [u32; 3],
    /// Bits of a texel's code; 0 for the mean, and where all are 0.
    pub code_width: u32,
}

impl PackedBasis {
    /// Returns the word.
    fn to_word(self) -> u32 {
        let [a, b, c] = self.widths;
        u32::from(self.step.to_bits()) | a << 16 | b << 20 | c << 24 | self.code_width << 28
    }

    /// Reads a word.
    pub(crate) fn from_word(word: u32) -> PackedBasis {
        let [a, b, c, code_width] = [16, 20, 24, 28].map(|shift| word >> shift & 0xf);
        PackedBasis { step: f16::from_bits(word as u16), widths: [a, b, c], code_width }
    }

    /// Returns whether the step is a finite number and not negative, and numbers are at most [`MAX_NUMBER`].
    pub(crate) fn has_good_step(&self, unit: f32) -> bool {
        let widest = self.widths.into_iter().max().unwrap_or(0);
        let largest = self.step.to_f32() * unit * (1 << widest) as f32 / 2.0;
        self.step.is_finite() && self.step.is_sign_positive() && largest <= MAX_NUMBER
    }

    /// Returns whether a component's code has at most 8 bits, and numbers only where there is a code.
    pub(crate) fn has_good_widths(&self) -> bool {
        self.code_width <= 8 && (self.code_width > 0 || self.widths == [0; 3])
    }
}

/// Returns the number of words of a row of these bases.
pub(crate) fn row_words(bases: &[PackedBasis]) -> usize {
    bases.iter().flat_map(|basis| basis.widths).sum::<u32>().div_ceil(WORD_BITS) as usize
}

/// Returns the number of words of a texel's codes of these bases.
pub(crate) fn code_words(bases: &[PackedBasis]) -> usize {
    bases.iter().map(|basis| basis.code_width).sum::<u32>().div_ceil(WORD_BITS) as usize
}

/// Writes the low `width` bits of `code` behind the first `bit` bits of `words`.
fn push_bits(words: &mut [u32], bit: u32, width: u32, code: i32) {
    let (word, first) = ((bit / WORD_BITS) as usize, bit % WORD_BITS);
    let code = code as u32 & ((1u64 << width) - 1) as u32;
    words[word] |= code << first;
    if first + width > WORD_BITS {
        words[word + 1] |= code >> (WORD_BITS - first);
    }
}

/// The packed bases of a layer.
pub(crate) struct PackedLayer {
    /// Words of the part.
    pub words: Vec<u32>,
    /// Bits of a texel's codes, `[cluster][component]`.
    pub code_widths: Vec<Vec<u32>>,
    /// Number of words of a texel's codes.
    pub code_words: usize,
}

/// Packs the bases of all layers of `asset`; `None` for those without a residual. A goal in bytes is that of bases and codes
/// here. The same asset and goal give the same words on any number of threads.
///
/// Cost: two expansions of all bases, and some tens of passes over a thousand pairs.
pub(crate) fn packed_bases(asset: &Asset, goal: PackedGoal, threads: Threads) -> Vec<Option<PackedLayer>> {
    let sampled: Vec<Vec<SampledCluster>> =
        (0..asset.layers.len()).map(|number| sampled_clusters(asset, number, threads)).collect();
    // One number for all layers, as the file form has one step.
    let noise = chosen_noise(&sampled, goal, threads);
    let layers = asset.layers.iter().zip(&sampled);
    layers.map(|(layer, sampled)| packed_layer(layer, sampled, noise, threads)).collect()
}

/// What widths of one cluster are chosen by.
struct SampledCluster {
    /// Number of texels.
    texels: usize,
    /// Number of pairs of the layer.
    pairs: usize,
    /// Mean square of the coefficients of each basis: 1 for the mean.
    energies: Vec<f64>,
    /// Bits that hold every code of each basis: 0 for the mean.
    code_widths: Vec<u32>,
    /// Largest value of each basis, at any pair.
    peaks: Vec<f32>,
    /// Values at some pairs, `[basis][channel][pair]`.
    values: Vec<f32>,
    /// Number of these pairs.
    samples: usize,
    /// The largest sizes at the other pairs, `[basis][channel][TAIL]`.
    tails: Vec<f32>,
}

impl SampledCluster {
    /// Returns bases in the order of the file with the widths that a step of `noise` over the root mean square of the
    /// coefficients asks for; and their squared error, summed over the pairs' channels, for a texel.
    fn choose(&self, noise: f64, unit: f32) -> (Vec<PackedBasis>, f64) {
        let mut error = 0.0;
        let known = self.energies.iter().zip(&self.peaks).zip(&self.code_widths);
        let numbers = self.values.chunks_exact(3 * self.samples).zip(self.tails.chunks_exact(3 * TAIL));
        let share = (self.pairs.saturating_sub(TAIL) as f64 / self.samples as f64).max(1.0);
        let of_basis = known.zip(numbers).map(|(((energy, peak), bits), (values, tails))| {
            let step = (noise / energy.max(1e-30).sqrt()).max(f64::from(*peak) / f64::from(limit(MAX_WIDTH)));
            let step = f16::from_f64((step / f64::from(unit)).min(MAX_STEP));
            let exact = f64::from(step.to_f32() * unit);
            let mut widths = [0; 3];
            let channels = values.chunks_exact(self.samples).zip(tails.chunks_exact(TAIL));
            for (width, (values, tail)) in widths.iter_mut().zip(channels) {
                if *energy > 0.0 && exact > 0.0 {
                    let left;
                    (*width, left) = chosen_width(values, share, tail, exact);
                    error += energy * left;
                }
            }
            match widths {
                [0, 0, 0] => PackedBasis { step: f16::ZERO, widths, code_width: 0 },
                _ => PackedBasis { step, widths, code_width: *bits },
            }
        });
        let bases = of_basis.collect();
        (bases, error)
    }
}

/// Returns the width that costs least, with a bit at [`BIT_PRICE`] squared steps a number, and the squared error that is
/// left. Each of `values` stands for `share` numbers, each of `tail` for itself.
fn chosen_width(values: &[f32], share: f64, tail: &[f32], step: f64) -> (u32, f64) {
    // By the bits that a code needs: number, sum and sum of squares of the values in steps, and rounding error.
    let mut classes = [[0.0f64; 4]; MAX_WIDTH as usize + 1];
    let inverse = (1.0 / step) as f32;
    let weighted = values.iter().map(|value| (share, value)).chain(tail.iter().map(|value| (1.0, value)));
    for (weight, value) in weighted {
        let size = (value * inverse).abs();
        let code = (size + 0.5) as u32;
        let width = if code == 0 { 0 } else { (code.ilog2() + 2).min(MAX_WIDTH) };
        let off = size - code as f32;
        let class = &mut classes[width as usize];
        for (sum, x) in class.iter_mut().zip([1.0, size, size * size, off * off]) {
            *sum += weight * f64::from(x);
        }
    }
    let numbers = share * values.len() as f64 + tail.len() as f64;
    let mut best = (f64::MAX, 0, 0.0);
    for width in (0..=MAX_WIDTH).filter(|width| *width != 1) {
        let limit = f64::from(limit(width));
        let mut error = 0.0;
        for (needed, [count, sum, square, off]) in classes.iter().enumerate() {
            let is_exact = needed > 0 && needed <= width as usize || needed == 0 && width > 0;
            // What is cut is told by the class's sums.
            error += if is_exact { *off } else { square - 2.0 * limit * sum + count * limit * limit };
        }
        let cost = error + BIT_PRICE * f64::from(width) * numbers;
        if cost < best.0 {
            best = (cost, width, error);
        }
    }
    (best.1, best.2 * step * step)
}

/// Returns the bits of a texel's code in two's complement; 0 for 0.
fn width_of(code: i32) -> u32 {
    match code {
        0 => 0,
        _ => WORD_BITS + 1 - (code ^ (code >> 31)).leading_zeros(),
    }
}

/// Returns the greatest code of `width` bits; the least one is its negative.
fn limit(width: u32) -> i32 {
    if width == 0 { 0 } else { (1 << (width - 1)) - 1 }
}

/// Calls `take(pair, values)` with the bases of `cluster` in the colour frame, `[channel, basis]`, bases padded.
fn frame_rows(expansion: &Expansion, cluster: usize, lights: usize, mut take: impl FnMut(usize, &[f32])) {
    let padded = expansion.padded();
    let mut turned = vec![0.0f32; 3 * padded];
    expansion.rows(cluster, |view, rows| {
        for (light, rgb) in rows.chunks_exact(3 * padded).enumerate() {
            for (out, frame) in turned.chunks_exact_mut(padded).zip(COLOUR_FRAME) {
                for (i, out) in out.iter_mut().enumerate() {
                    let value = frame[0] * rgb[i] + frame[1] * rgb[padded + i] + frame[2] * rgb[2 * padded + i];
                    *out = value.clamp(-MAX_PACKED, MAX_PACKED);
                }
            }
            take(view * lights + light, &turned);
        }
    });
}

/// Samples the clusters of layer `number`; none without a residual.
fn sampled_clusters(asset: &Asset, number: usize, threads: Threads) -> Vec<SampledCluster> {
    let layer = &asset.layers[number];
    let (Some(residual), Some(expansion)) = (&layer.residual, Expansion::of_layer(layer)) else { return Vec::new() };
    let (bases, clusters) = (residual.bases.len(), layer.dictionary.len());
    let [_, lights] = residual.factors.shape;
    let pairs = layer.views.len() * lights;
    let mut texels = vec![0usize; clusters];
    let mut energies = vec![0.0f64; clusters * bases];
    let mut code_widths = vec![0u32; clusters * bases];
    let mut add = |of_texels: &[u8], planes: &mut dyn Iterator<Item = &[i8]>| {
        of_texels.iter().for_each(|cluster| texels[usize::from(*cluster)] += 1);
        for (j, codes) in planes.enumerate() {
            for (cluster, code) in of_texels.iter().zip(codes) {
                let at = usize::from(*cluster) * bases + 1 + j;
                energies[at] += f64::from(*code).powi(2);
                code_widths[at] = code_widths[at].max(width_of(i32::from(*code)));
            }
        }
    };
    add(&layer.texel_clusters, &mut residual.coefficients.iter().map(|plane| plane.codes.as_slice()));
    for level in &asset.levels {
        let of_layer = &level.layers[number];
        add(&of_layer.clusters, &mut of_layer.codes.iter().map(Vec::as_slice));
    }
    // A stride without a factor in common with the lights visits all of them.
    let stride = (pairs / SAMPLES).max(1);
    let stride = (stride..).find(|stride| gcd(*stride, lights.max(1)) == 1).unwrap_or(1);
    let samples = pairs.div_ceil(stride);
    map(threads, clusters, |cluster| {
        let count = texels[cluster];
        let mut energies = energies[cluster * bases..(cluster + 1) * bases].to_vec();
        energies.iter_mut().for_each(|energy| *energy /= count.max(1) as f64);
        energies[0] = 1.0;
        let code_widths = code_widths[cluster * bases..(cluster + 1) * bases].to_vec();
        let mut values = vec![0.0f32; bases * 3 * samples];
        let mut peaks = vec![0.0f32; bases];
        let mut tails = vec![0.0f32; bases * 3 * TAIL];
        frame_rows(&expansion, cluster, lights, |pair, rows| {
            for row in rows.chunks_exact(expansion.padded()) {
                peaks.iter_mut().zip(row).for_each(|(peak, value)| *peak = peak.max(value.abs()));
            }
            if pair % stride != 0 {
                for (channel, row) in rows.chunks_exact(expansion.padded()).enumerate() {
                    for (basis, value) in row.iter().take(bases).enumerate() {
                        keep_large(&mut tails[(3 * basis + channel) * TAIL..][..TAIL], value.abs());
                    }
                }
                return;
            }
            for (channel, row) in rows.chunks_exact(expansion.padded()).enumerate() {
                for (basis, value) in row.iter().take(bases).enumerate() {
                    values[(3 * basis + channel) * samples + pair / stride] = *value;
                }
            }
        });
        SampledCluster { texels: count, pairs, energies, code_widths, peaks, values, samples, tails }
    })
}

/// Puts `size` in its place among the largest sizes, which fall; the least of them goes.
fn keep_large(tail: &mut [f32], size: f32) {
    if tail.last().is_some_and(|least| size > *least) {
        let place = tail.partition_point(|other| *other >= size);
        tail[place..].rotate_right(1);
        tail[place] = size;
    }
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// Returns the unit of a layer's steps: the step of a coefficient of the least energy.
fn unit_of(clusters: &[SampledCluster], noise: f64) -> f32 {
    let energies = clusters.iter().flat_map(|cluster| &cluster.energies).filter(|energy| **energy > 0.0);
    let least = energies.copied().fold(1.0, f64::min);
    (noise / least.sqrt()).clamp(1e-30, f64::from(MAX_UNIT)) as f32
}

/// Returns the largest `d` (see the head of this file) that keeps the goal; or for bytes that cannot be kept, the one beyond
/// which nothing gets smaller.
fn chosen_noise(layers: &[Vec<SampledCluster>], goal: PackedGoal, threads: Threads) -> f64 {
    let clusters: Vec<(usize, &SampledCluster)> =
        layers.iter().enumerate().flat_map(|(layer, clusters)| clusters.iter().map(move |one| (layer, one))).collect();
    let peak = clusters.iter().flat_map(|(_, cluster)| &cluster.values).fold(0.0f32, |peak, x| peak.max(x.abs()));
    let numbers: f64 = clusters.iter().map(|(_, cluster)| (cluster.texels * 3 * cluster.pairs) as f64).sum();
    let texels: Vec<usize> =
        layers.iter().map(|clusters| clusters.iter().map(|cluster| cluster.texels).sum()).collect();
    let of_noise = |noise: f64| {
        let units: Vec<f32> = layers.iter().map(|clusters| unit_of(clusters, noise)).collect();
        let found = map(threads, clusters.len(), |i| {
            let (layer, cluster) = clusters[i];
            let (bases, error) = cluster.choose(noise, units[layer]);
            let words = 2 + bases.len() + row_words(&bases) * cluster.pairs;
            (words, code_words(&bases), error * cluster.texels as f64)
        });
        let mut code_words = vec![0; layers.len()];
        let (mut words, mut error) = (PACKED_PLACES * layers.len(), 0.0);
        for ((layer, _), (of_rows, of_codes, own)) in clusters.iter().zip(found) {
            code_words[*layer] = of_codes.max(code_words[*layer]);
            words += of_rows;
            error += own;
        }
        words += texels.iter().zip(&code_words).map(|(texels, words)| texels * words).sum::<usize>();
        (4 * words as u64, (error / numbers.max(1.0)).sqrt())
    };
    // A small step takes many bytes and adds little error.
    let (mut small, mut large) = (1e-7 * f64::from(peak).max(1e-12), 1e3 * f64::from(peak).max(1e-12));
    for _ in 0..HALVINGS {
        let middle = (small * large).sqrt();
        let (bytes, error) = of_noise(middle);
        let is_coarse = match goal {
            PackedGoal::Bytes(most) => bytes <= most,
            PackedGoal::Noise(most) => error > f64::from(most),
        };
        *if is_coarse { &mut large } else { &mut small } = middle;
    }
    if matches!(goal, PackedGoal::Bytes(_)) { large } else { small }
}

/// Packs the bases of a layer; `None` without a residual.
fn packed_layer(layer: &Layer, sampled: &[SampledCluster], noise: f64, threads: Threads) -> Option<PackedLayer> {
    let expansion = Expansion::of_layer(layer)?;
    let bases = layer.residual.as_ref()?.bases.len();
    let unit = unit_of(sampled, noise);
    let chosen: Vec<Vec<PackedBasis>> = sampled.iter().map(|cluster| cluster.choose(noise, unit).0).collect();
    let rows = map(threads, chosen.len(), |cluster| packed_rows(&expansion, cluster, layer, &chosen[cluster], unit));
    let at_bases = PACKED_PLACES + 2 * chosen.len();
    let mut words = vec![unit.to_bits(), bases as u32, at_bases as u32, 0];
    let mut first = at_bases + bases * chosen.len();
    for (bases, rows) in chosen.iter().zip(&rows) {
        words.extend([first as u32, row_words(bases) as u32]);
        first += rows.len();
    }
    words.extend(chosen.iter().flatten().map(|basis| basis.to_word()));
    words.extend(rows.iter().flatten());
    Some(PackedLayer {
        words,
        code_widths: chosen.iter().map(|bases| bases[1..].iter().map(|basis| basis.code_width).collect()).collect(),
        code_words: chosen.iter().map(|bases| code_words(bases)).max().unwrap_or(0),
    })
}

impl PackedLayer {
    /// Returns the codes of some texels, [`PackedLayer::code_words`] of each; `planes` are those of the components at hand.
    pub(crate) fn packed_codes(&self, clusters: &[u8], planes: &[&[i8]]) -> Vec<u32> {
        let mut words = vec![0u32; clusters.len() * self.code_words];
        if self.code_words == 0 {
            return words;
        }
        for (texel, own) in words.chunks_exact_mut(self.code_words).enumerate() {
            let mut bit = 0;
            for (plane, width) in planes.iter().zip(&self.code_widths[usize::from(clusters[texel])]) {
                if *width > 0 {
                    push_bits(own, bit, *width, i32::from(plane[texel]));
                    bit += width;
                }
            }
        }
        words
    }
}

/// Returns the rows of a cluster, pair after pair.
fn packed_rows(expansion: &Expansion, cluster: usize, layer: &Layer, bases: &[PackedBasis], unit: f32) -> Vec<u32> {
    let [lights, length] = [layer.lights.len(), row_words(bases)];
    let mut words = vec![0u32; layer.views.len() * lights * length];
    let padded = expansion.padded();
    let inverses: Vec<f32> = bases.iter().map(|basis| 1.0 / (basis.step.to_f32() * unit).max(1e-38)).collect();
    frame_rows(expansion, cluster, lights, |pair, values| {
        let row = &mut words[pair * length..(pair + 1) * length];
        let mut bit = 0;
        for (j, (basis, inverse)) in bases.iter().zip(&inverses).enumerate() {
            for (channel, width) in basis.widths.iter().enumerate().filter(|(_, width)| **width > 0) {
                let most = limit(*width) as f32;
                let code = (values[channel * padded + j] * inverse).round().clamp(-most, most) as i32;
                push_bits(row, bit, *width, code);
                bit += width;
            }
        }
    });
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::residual::ResidualKind;
    use crate::decode::decode::{decode, decode_single};
    use crate::decode::options::{DecodeOptions, Interpolation};
    use crate::decode::packed_sum::packed_bits;
    use crate::levels::levels::with_levels;
    use crate::resident::resident::Resident;
    use crate::resident::single::SingleBases;
    use crate::testing::{Random, sample_asset, sample_grouped_asset, sample_relief_asset};
    use crate::threads::serial;

    fn sum_of_squares(values: impl Iterator<Item = f32>) -> f64 {
        values.map(|x| f64::from(x).powi(2)).sum()
    }

    /// Returns the root mean square of what packing changes the residual by, over all texels, pairs and channels of layer 0.
    fn added(asset: &Asset, packed: &Resident) -> f64 {
        let layer = &asset.layers[0];
        let [exact, rounded] = [SingleBases::from_asset_on(asset, &serial), SingleBases::of_packed(packed, &serial)];
        let planes: Vec<&[i8]> = layer.coefficient_planes();
        let padded = (planes.len() + 1).next_multiple_of(2);
        let rows = layer.views.len() * layer.lights.len() * 3;
        let mut sum = 0.0;
        for (texel, cluster) in layer.texel_clusters.iter().enumerate() {
            let first = usize::from(*cluster) * rows * padded;
            for row in 0..rows {
                let at = first + row * padded;
                let change = |basis: usize| exact.layer(0)[at + basis] - rounded.layer(0)[at + basis];
                let of_components = (0..planes.len()).map(|j| f32::from(planes[j][texel]) * change(1 + j));
                sum += f64::from(change(0) + of_components.sum::<f32>()).powi(2);
            }
        }
        (sum / (rows * layer.texel_clusters.len()) as f64).sqrt()
    }

    #[test]
    fn packed_bases_decode_as_the_numbers_that_they_tell() {
        for (seed, kind) in [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root].into_iter().enumerate() {
            let assets = [
                sample_asset(20 + seed as u64, 6, 5, kind),
                sample_grouped_asset(seed as u64, 9, 7, kind),
                sample_relief_asset(seed as u64, 8, 8),
            ];
            for asset in assets {
                let asset = with_levels(&asset, &serial);
                let packed = Resident::packed_on(&asset, PackedGoal::Noise(0.01), &serial);
                let (plain, singles) = (Resident::from_asset(&asset), SingleBases::of_packed(&packed, &serial));
                let mut random = Random::new(7);
                let mut differs = 0;
                for i in 0..600u32 {
                    let (wi, wo) = (random.direction(), random.direction());
                    let level = i % plain.levels();
                    let [width, rows] = plain.size(level * plain.layers());
                    let texel = random.below((width * rows) as usize) as u32;
                    let interpolation = if i % 3 == 0 { Interpolation::Exact } else { Interpolation::Fast };
                    let options = DecodeOptions { interpolation, components: i % 9, ..DecodeOptions::default() };
                    let layer = level * plain.layers();
                    let value = decode(&packed, layer, texel, wi, wo, &options);
                    if level == 0 {
                        let expected = decode_single(&plain, &singles, layer, texel, wi, wo, &options);
                        let near = (0..3).all(|c| (value[c] - expected[c]).abs() <= 1e-4 + 1e-4 * expected[c].abs());
                        assert!(near, "{kind:?} {i}: {value:?} {expected:?}");
                    }
                    let whole = decode(&plain, layer, texel, wi, wo, &options);
                    differs += usize::from((0..3).any(|c| (value[c] - whole[c]).abs() > 1e-4 + 1e-4 * whole[c].abs()));
                    let near = (0..3).all(|c| (value[c] - whole[c]).abs() <= 0.3 + 0.3 * whole[c].abs());
                    assert!(near, "{kind:?} {i}: {value:?} {whole:?}");
                }
                // Planted difference: the bases that were packed.
                assert!(differs > 20, "{differs}");
            }
        }
    }

    #[test]
    fn goals_are_kept_and_nearly_used() {
        let asset = sample_grouped_asset(3, 24, 18, ResidualKind::Root);
        let plain = Resident::from_asset(&asset);
        let bases = 4 * plain.bases_of(0).len() as u64;
        let others = 4 * plain.words().len() as u64 - bases;
        let of_noise = |noise: f32| {
            let packed = Resident::packed_on(&asset, PackedGoal::Noise(noise), &serial);
            (added(&asset, &packed), 4 * packed.words().len() as u64 - others.min(4 * packed.words().len() as u64))
        };
        let mut before = u64::MAX;
        for noise in [1e-4, 1e-3, 1e-2] {
            let (error, bytes) = of_noise(noise);
            assert!(error < 1.4 * f64::from(noise) && error > 0.3 * f64::from(noise), "{noise}: {error}");
            assert!(bytes < before && bytes < bases, "{bytes} of {bases}");
            before = bytes;
        }
        for share in [3, 6, 12] {
            let packed = packed_bases(&asset, PackedGoal::Bytes(bases / share), &serial);
            let codes = |layer: &PackedLayer| layer.code_words * asset.texel_count();
            let words: usize = packed.iter().flatten().map(|layer| layer.words.len() + codes(layer)).sum();
            let bytes = 4 * words as u64;
            assert!(bytes <= bases / share && bytes > bases / share / 2, "{share}: {bytes} of {bases}");
        }
        // What cannot be kept is as small as it gets.
        let packed = packed_bases(&asset, PackedGoal::Bytes(1), &serial);
        let words = packed[0].as_ref().unwrap().words.len();
        assert!(words < 100, "{words}");
    }

    #[test]
    fn widths_follow_from_what_a_bit_takes_away() {
        let mut random = Random::new(4);
        let values: Vec<f32> = (0..1000).map(|_| random.within(-1.0, 1.0)).collect();
        let [mut width, mut error] = [MAX_WIDTH, 0].map(f64::from);
        for step in [1e-3, 1e-2, 0.1, 0.5, 4.0] {
            let (found, left) = chosen_width(&values, 1.0, &[], step);
            assert!(f64::from(found) <= width && left >= error, "{step}: {found} {left}");
            let most = limit(found) as f64 * step;
            let plain = sum_of_squares(values.iter().map(|x| {
                let code = (f64::from(*x) / step).round() * step;
                x - code.clamp(-most, most) as f32
            }));
            assert!((left - plain).abs() < 1e-3 * plain + 1e-6, "{step}: {left} {plain}");
            (width, error) = (f64::from(found), left);
        }
        assert_eq!(chosen_width(&values, 1.0, &[], 4.0).0, 0);
        assert_eq!(chosen_width(&values, 1.0, &[], 1.0 / 127.0).0, 8);
    }

    #[test]
    fn numbers_come_back_from_their_bits() {
        let mut words = [0; 3];
        let numbers = [(15, -16_384), (15, 16_383), (12, -1), (2, 1), (2, -2), (15, 77), (8, -128)];
        let mut bit = 0;
        for (width, code) in numbers {
            push_bits(&mut words, bit, width, code);
            bit += width;
        }
        bit = 0;
        for (width, code) in numbers {
            assert_eq!(packed_bits(&words, bit, width), code);
            bit += width;
        }
        assert_eq!([0, 1, -1, 2, -2, -3, 127, -128].map(width_of), [0, 2, 1, 3, 2, 3, 8, 8]);
        let basis = PackedBasis { step: f16::from_f32(0.37), widths: [15, 0, 3], code_width: 8 };
        assert_eq!(PackedBasis::from_word(basis.to_word()), basis);
    }
}
