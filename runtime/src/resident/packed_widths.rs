//! Chooses steps and widths of packed bases: for each component and channel of a cluster how finely its numbers are rounded.
//!
//! An error in a component counts as often as texels use it, by the square of their coefficients. So the step of component j
//! in cluster k is `d / (rms of its coefficients * sqrt(texels of the cluster))`, and each bit of each number takes away
//! about the same error, which is what fewest bytes for an error ask for (reverse water-filling [cover2006, section 10.3.3]).
//! Widths follow from how many values of each size there are, counted over all measured pairs, and from a table of what
//! rounding leaves of a value of that size.

use crate::asset::asset::Asset;
use crate::resident::expansion::Expansion;
use crate::resident::packed_part::{
    MAX_WIDTH, PACKED_PLACES, PLACE_WORDS, PackedBasis, WORD_BITS, code_words, packed_level, packed_number, row_words,
};
use crate::threads::{Threads, map};
use half::f16;
use std::sync::LazyLock;

/// Bits of a single that do not tell its class: eight classes an octave.
const CLASS_SHIFT: u32 = 20;
/// Classes of an octave.
const CLASSES: u32 = 8;
/// Number of classes whose values are told apart; smaller ones count as the smallest.
const TOLD_APART: usize = 128;
/// Number of all classes.
const ALL_CLASSES: usize = 1 << (31 - CLASS_SHIFT);
/// Classes between the largest value and the step from which on no number is worth a bit.
const SMALL: i32 = 24;
/// Classes below and above the step that the table of errors has.
const REACH: i32 = 160;
/// Points of a class at which the table's errors are taken.
const POINTS: usize = 8;
/// Squared error, in squared steps, that one more bit of a number must take away: at a fine step the error is `step^2 / 12`,
/// and a bit takes away three quarters of it.
const BIT_PRICE: f64 = std::f64::consts::LN_2 / 6.0;
/// Smallest and largest step, in units: every class between begins with a half.
const STEP_RANGE: [f64; 2] = [1.0 / 16384.0, 32768.0];
/// Halvings of the interval in which the step is searched for.
const HALVINGS: usize = 20;

/// What packed bases may cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PackedGoal {
    /// Most bytes of the whole resident form.
    Bytes(u64),
    /// Root mean square of what the residual may change by at the measured pairs, in its curve.
    Noise(f32),
}

impl PackedGoal {
    /// Returns the noise that leaves a PSNR of `db`, with a residual of 1 as peak.
    pub fn of_psnr(db: f32) -> PackedGoal {
        PackedGoal::Noise(10f32.powf(-db / 20.0))
    }
}

/// What rounding leaves of a value, squared, in squared steps: the mean over a class of values.
struct Errors(Vec<f32>);

static ERRORS: LazyLock<Errors> = LazyLock::new(Errors::new);

impl Errors {
    fn new() -> Errors {
        let span = 2 * REACH as usize;
        let mut means = Vec::with_capacity(MAX_WIDTH as usize * CLASSES as usize * span);
        for width in 1..=MAX_WIDTH {
            for class in 0..CLASSES as i32 {
                let class = 127 * CLASSES as i32 + class;
                let step = edge(class);
                for offset in -REACH..REACH {
                    let [low, high] = [0, 1].map(|next| edge(class + offset + next) / step);
                    let errors = (0..POINTS).map(|i| {
                        let value = low + (high - low) * (i as f32 + 0.5) / POINTS as f32;
                        (value - packed_level(packed_number(value, width), width)).powi(2)
                    });
                    means.push(errors.sum::<f32>() / POINTS as f32);
                }
            }
        }
        Errors(means)
    }

    /// Returns the errors at `width` bits of the classes from `first` on, for the step at the edge of class `step`.
    fn from(&self, width: u32, step: i32, first: i32) -> &[f32] {
        let span = 2 * REACH as usize;
        let row = (width as usize - 1) * CLASSES as usize + (step as u32 % CLASSES) as usize;
        &self.0[row * span..(row + 1) * span][(first - step + REACH).max(0) as usize..]
    }
}

/// Returns the least value of a class.
fn edge(class: i32) -> f32 {
    f32::from_bits((class as u32) << CLASS_SHIFT)
}

fn class_of(value: f32) -> i32 {
    (value.abs().to_bits() >> CLASS_SHIFT) as i32
}

/// How many values of each size the numbers of a basis in a channel have.
struct Sizes {
    /// Class of the smallest values.
    first: i32,
    /// Number of values in each class from there on; none where all values are 0.
    counts: Vec<f32>,
    /// Sum of the squares of all values.
    squares: f64,
}

impl Sizes {
    fn new(counts: &[u32], squares: f64) -> Sizes {
        let Some(last) = counts.iter().skip(1).rposition(|count| *count > 0).map(|last| last + 1) else {
            return Sizes { first: 0, counts: Vec::new(), squares };
        };
        let first = last.saturating_sub(TOLD_APART - 1);
        let mut told: Vec<f32> = counts[first..=last].iter().map(|count| *count as f32).collect();
        told[0] += counts[..first].iter().sum::<u32>() as f32;
        Sizes { first: first as i32, counts: told, squares }
    }

    /// Returns the squared error for each width from 0 on, with the step at the edge of class `step`.
    fn errors(&self, step: i32) -> [f64; MAX_WIDTH as usize + 1] {
        let mut errors = [self.squares; MAX_WIDTH as usize + 1];
        let last = self.first + self.counts.len() as i32 - 1;
        if self.counts.is_empty() || last < step - SMALL {
            return errors;
        }
        let square = f64::from(edge(step)).powi(2);
        for (width, error) in errors.iter_mut().enumerate().skip(1) {
            let of_classes = ERRORS.from(width as u32, step, self.first);
            let sum: f32 = self.counts.iter().zip(of_classes).map(|(count, error)| count * error).sum();
            *error = f64::from(sum) * square;
        }
        errors
    }
}

/// What the widths of one cluster are chosen by.
pub(crate) struct Spread {
    /// Number of texels, those of coarser levels included.
    texels: usize,
    /// Number of pairs of the layer.
    pairs: usize,
    /// Mean square of the coefficients of each basis: 1 for the mean.
    energies: Vec<f64>,
    /// Bits that hold every code of each basis: 0 for the mean.
    code_widths: Vec<u32>,
    /// Largest value of each basis, at any pair.
    peaks: Vec<f32>,
    /// Values, `[basis][channel]`.
    sizes: Vec<Sizes>,
}

/// Bases of one cluster with their steps and widths.
pub(crate) struct ChosenCluster {
    pub bases: Vec<PackedBasis>,
    /// Squared error of all texels, pairs and channels.
    error: f64,
}

impl Spread {
    /// Returns the step that error `noise` asks for, of each basis; 0 for those that no texel uses.
    fn steps(&self, noise: f64) -> impl Iterator<Item = f64> {
        // Steps are rounded down to the edge of a class, and the class of the peak shall have levels to its end.
        let rounding = 1.0 + 1.0 / f64::from(CLASSES);
        let most = f64::from(packed_level((1 << (MAX_WIDTH - 1)) - 1, MAX_WIDTH)) / (rounding * rounding);
        let texels = self.texels as f64;
        self.energies.iter().zip(&self.peaks).map(move |(energy, peak)| match *energy > 0.0 && texels > 0.0 {
            true => (noise / (energy * texels).sqrt()).max(f64::from(*peak) / most),
            false => 0.0,
        })
    }

    /// Chooses the bases' steps, and widths by what a bit costs and takes away. A row ends with its last word: what is left
    /// of it goes where it takes away most.
    fn choose(&self, noise: f64, unit: f32) -> ChosenCluster {
        let price = BIT_PRICE * noise * noise;
        let mut errors = Vec::with_capacity(self.sizes.len());
        let mut bases: Vec<PackedBasis> = Vec::with_capacity(self.energies.len());
        let of_bases = self.steps(noise).zip(&self.energies).zip(&self.code_widths).zip(self.sizes.chunks_exact(3));
        for (((step, energy), code_width), sizes) in of_bases {
            let [least, most] = STEP_RANGE.map(|end| end * f64::from(unit));
            let step = class_of(step.clamp(least, most) as f32);
            let scale = energy * self.texels as f64;
            let mut widths = [0; 3];
            // What the basis costs with its numbers, less than without them.
            let mut gain = -price * (*code_width as usize * self.texels) as f64;
            for (width, sizes) in widths.iter_mut().zip(sizes) {
                let unused = [0.0; MAX_WIDTH as usize + 1];
                let own = if scale > 0.0 { sizes.errors(step).map(|error| error * scale) } else { unused };
                let cost = |width: usize| own[width] + price * (width * self.pairs) as f64;
                let best = (0..own.len()).min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or(0);
                *width = best as u32;
                gain += cost(0) - cost(best);
                errors.push(own);
            }
            if gain <= 0.0 {
                widths = [0; 3];
            }
            let code_width = if widths == [0; 3] { 0 } else { *code_width };
            let step = if widths == [0; 3] { f16::ZERO } else { f16::from_f32(edge(step) / unit) };
            bases.push(PackedBasis { step, widths, code_width });
        }
        fill_last_word(&mut bases, &errors);
        let numbers = bases.iter().flat_map(|basis| basis.widths).zip(&errors);
        let error = numbers.map(|(width, errors)| errors[width as usize]).sum();
        ChosenCluster { bases, error }
    }
}

/// Gives the bits that a row's last word has left to the numbers from which they take away most.
fn fill_last_word(bases: &mut [PackedBasis], errors: &[[f64; MAX_WIDTH as usize + 1]]) {
    let bits: u32 = bases.iter().flat_map(|basis| basis.widths).sum();
    for _ in 0..bits.next_multiple_of(WORD_BITS) - bits {
        let mut best = (0.0, 0);
        for (place, errors) in errors.iter().enumerate() {
            let basis = &bases[place / 3];
            let width = basis.widths[place % 3] as usize;
            if basis.step > f16::ZERO && width < MAX_WIDTH as usize && errors[width] - errors[width + 1] > best.0 {
                best = (errors[width] - errors[width + 1], place);
            }
        }
        if best.0 == 0.0 {
            return;
        }
        bases[best.1 / 3].widths[best.1 % 3] += 1;
    }
}

/// Counts the values of the clusters of layer `number`; none without a residual. Cost: an expansion of the bases.
pub(crate) fn spreads(asset: &Asset, number: usize, threads: Threads) -> Vec<Spread> {
    let layer = &asset.layers[number];
    let (Some(residual), Some(expansion)) = (&layer.residual, Expansion::of_layer(layer)) else { return Vec::new() };
    let (bases, clusters) = (residual.bases.len(), layer.dictionary.len());
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
    map(threads, clusters, |cluster| {
        let mut energies = energies[cluster * bases..(cluster + 1) * bases].to_vec();
        energies.iter_mut().for_each(|energy| *energy /= texels[cluster].max(1) as f64);
        energies[0] = 1.0;
        let mut counts = vec![0u32; 3 * bases * ALL_CLASSES];
        let mut squares = vec![0.0f64; 3 * bases];
        let mut peaks = vec![0.0f32; bases];
        if texels[cluster] > 0 {
            expansion.frame_rows(cluster, |_, rows| {
                for (channel, row) in rows.chunks_exact(expansion.padded()).enumerate() {
                    for (basis, value) in row.iter().take(bases).enumerate() {
                        let place = 3 * basis + channel;
                        counts[place * ALL_CLASSES + class_of(*value) as usize] += 1;
                        squares[place] += f64::from(value * value);
                        peaks[basis] = peaks[basis].max(value.abs());
                    }
                }
            });
        }
        let sizes = counts.chunks_exact(ALL_CLASSES).zip(squares).map(|(counts, squares)| Sizes::new(counts, squares));
        Spread {
            texels: texels[cluster],
            pairs: layer.views.len() * layer.lights.len(),
            energies,
            code_widths: code_widths[cluster * bases..(cluster + 1) * bases].to_vec(),
            peaks,
            sizes: sizes.collect(),
        }
    })
}

/// Returns the bits of a texel's code in two's complement; 0 for 0.
fn width_of(code: i32) -> u32 {
    match code {
        0 => 0,
        _ => WORD_BITS + 1 - (code ^ (code >> 31)).leading_zeros(),
    }
}

/// Returns the unit of a layer's steps: a power of two, of which the largest step is at most [`STEP_RANGE`].
fn unit_of(clusters: &[Spread], noise: f64) -> f32 {
    let largest = clusters.iter().flat_map(|cluster| cluster.steps(noise)).fold(0.0, f64::max);
    (largest / STEP_RANGE[1]).max(1e-30).log2().ceil().exp2() as f32
}

/// Returns the bases of all clusters for one `noise`, with the layer's unit.
pub(crate) fn chosen_clusters(clusters: &[Spread], noise: f64, threads: Threads) -> (f32, Vec<ChosenCluster>) {
    let unit = unit_of(clusters, noise);
    (unit, map(threads, clusters.len(), |cluster| clusters[cluster].choose(noise, unit)))
}

/// Returns the largest noise that keeps the goal; or for bytes that cannot be kept, the one beyond which nothing gets
/// smaller. One number serves all layers, as the file form has one step.
pub(crate) fn chosen_noise(layers: &[Vec<Spread>], goal: PackedGoal, threads: Threads) -> f64 {
    let clusters = || layers.iter().flatten();
    let numbers: f64 = clusters().map(|cluster| (cluster.texels * 3 * cluster.pairs) as f64).sum();
    let of_noise = |noise: f64| {
        let (mut words, mut error) = (0, 0.0);
        for layer in layers {
            words += PACKED_PLACES + PLACE_WORDS * layer.len();
            for (chosen, spread) in chosen_clusters(layer, noise, threads).1.iter().zip(layer) {
                words += chosen.bases.len() + row_words(&chosen.bases) * spread.pairs;
                words += code_words(&chosen.bases) * spread.texels;
                error += chosen.error;
            }
        }
        (4 * words as u64, (error / numbers.max(1.0)).sqrt())
    };
    let largest = clusters().flat_map(|cluster| {
        let loudest = cluster.energies.iter().zip(&cluster.peaks);
        loudest.map(|(energy, peak)| (energy * cluster.texels as f64).sqrt() * f64::from(*peak))
    });
    // A small step takes many bytes and adds little error.
    let largest = largest.fold(1e-20, f64::max);
    let (mut small, mut large) = (1e-8 * largest, 8.0 * largest);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    #[test]
    fn errors_are_those_of_numbers() {
        let mut random = Random::new(4);
        let values: Vec<f32> = (0..4000).map(|_| random.within(-1.0, 1.0).powi(3)).collect();
        let mut counts = vec![0u32; ALL_CLASSES];
        values.iter().for_each(|value| counts[class_of(*value) as usize] += 1);
        let square = |values: &mut dyn Iterator<Item = f32>| values.map(|x| f64::from(x).powi(2)).sum::<f64>();
        let sizes = Sizes::new(&counts, square(&mut values.iter().copied()));
        for step in [1e-4, 1e-3, 1e-2, 0.1, 0.5].map(class_of) {
            let of_widths = sizes.errors(step);
            for (width, error) in of_widths.iter().enumerate() {
                let rounded = |x: &f32| match width {
                    0 => 0.0,
                    _ => packed_level(packed_number(x / edge(step), width as u32), width as u32) * edge(step),
                };
                let plain = square(&mut values.iter().map(|x| x - rounded(x)));
                assert!((error - plain).abs() < 0.1 * plain + 1e-9, "{width}: {error} {plain}");
            }
        }
        // Values far below a step are worth no bit.
        assert_eq!(sizes.errors(class_of(64.0)), [sizes.squares; MAX_WIDTH as usize + 1]);
        let none = Sizes::new(&vec![0; ALL_CLASSES], 0.0);
        assert_eq!(none.errors(class_of(0.1)), [0.0; MAX_WIDTH as usize + 1]);
    }

    #[test]
    fn codes_have_the_bits_of_their_numbers() {
        assert_eq!([0, 1, -1, 2, -2, -3, 127, -128].map(width_of), [0, 2, 1, 3, 2, 3, 8, 8]);
    }

    #[test]
    fn a_row_uses_its_last_word() {
        let basis = PackedBasis { step: f16::ONE, widths: [3, 0, 1], code_width: 2 };
        let mut bases = [basis, PackedBasis { step: f16::ZERO, widths: [0; 3], code_width: 0 }];
        // Each bit takes away half; numbers of the greatest error get most, and a basis without a step gets nothing.
        let errors = |first: f64| {
            [0; 16].map({
                let mut error = 2.0 * first;
                move |_: i32| {
                    error /= 2.0;
                    error
                }
            })
        };
        fill_last_word(&mut bases, &[1.0, 1e-9, 64.0, 1e9, 1e9, 1e9].map(errors));
        assert_eq!(bases[0].widths.iter().sum::<u32>(), 32);
        assert_eq!(bases[0].widths, [15, 2, 15]);
        assert_eq!(bases[1].widths, [0; 3]);
    }
}
