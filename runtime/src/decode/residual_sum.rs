//! Sums the residual of a texel at measured pairs with SIMD: rows of the expanded bases, weighted by the texel's
//! coefficients. Twin: `decode/residual_sum.wgsl`.
//!
//! The bases of a pair are words of two halves, channel after channel. A block of words is read as it lies, across
//! channels, and the sums of its lanes are sorted into channels at the end: the order of all sums is the same on every
//! processor.

use crate::asset::limits::MAX_CHANNEL_WORDS;
use crate::decode::texel::Texel;
use crate::numeric::quantize::coefficient_from_byte;
use crate::resident::layout::block;
use pulp::Simd;

/// Number of words that are read together.
pub(crate) const LANES: usize = 16;
/// Largest number of blocks of [`LANES`] words that the bases of a pair fill, and one more.
pub(crate) const MAX_BLOCKS: usize = (3 * MAX_CHANNEL_WORDS).div_ceil(LANES) + 1;
/// Number of blocks that the bases of eight components fill, and some more words.
pub(crate) const FEW_BLOCKS: usize = 2;

/// Returns whether weights of this many words a channel fit into `blocks` blocks, each channel in whole blocks from its
/// first word on.
pub(crate) fn fit_blocks(channel_words: usize, blocks: usize) -> bool {
    2 * channel_words + channel_words.next_multiple_of(LANES) <= blocks * LANES
}

/// The array that a layer's expanded bases are read from.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Bases<'a> {
    /// Words of the resident form.
    Halves(&'a [u32]),
    /// Numbers of [`crate::SingleBases`], two for each word of the resident form.
    Singles(&'a [f32]),
}

/// The weights of a texel's bases, for each lane of each block those of the word's low and high half: 1 for the mean,
/// the decoded code for a component, 0 for an unused basis.
#[derive(Debug, Clone)]
pub(crate) struct BasisWeights<const BLOCKS: usize> {
    halves: [[[f32; LANES]; BLOCKS]; 2],
    /// Whether a block has weights other than 0.
    used: [bool; BLOCKS],
    /// Number of words of a channel in use, and in all.
    channel: [usize; 2],
}

impl<const BLOCKS: usize> BasisWeights<BLOCKS> {
    /// Collects the weights of `t`, whose words must fit into `BLOCKS` blocks ([`fit_blocks`]).
    pub(crate) fn of_texel(t: &Texel) -> BasisWeights<BLOCKS> {
        let channel = [t.bases.div_ceil(2), t.field(block::CHANNEL_WORDS)];
        let [used_words, channel_words] = channel;
        let pieces = used_words.div_ceil(LANES);
        let of_channel = channel_weights(t);
        let mut weights = BasisWeights { halves: [[[0.0; LANES]; BLOCKS]; 2], used: [false; BLOCKS], channel };
        for at in (0..3).map(|c| c * channel_words) {
            for (all, of_channel) in weights.halves.iter_mut().zip(&of_channel) {
                // In whole blocks: what is beyond the channel is 0, and is the next channel's then.
                let all = all.as_flattened_mut()[at..].as_chunks_mut::<LANES>().0;
                all.iter_mut().zip(of_channel).take(pieces).for_each(|(out, piece)| *out = *piece);
            }
            weights.used[at / LANES..(at + used_words).div_ceil(LANES)].fill(true);
        }
        weights
    }
}

/// Returns the weights of the low and the high halves of a channel's words.
fn channel_weights(t: &Texel) -> [[[f32; LANES]; MAX_CHANNEL_WORDS.div_ceil(LANES)]; 2] {
    let mut halves = [[[0.0f32; LANES]; MAX_CHANNEL_WORDS.div_ceil(LANES)]; 2];
    let [low, high] = halves.each_mut().map(|half| half.as_flattened_mut());
    low[0] = 1.0;
    let first = t.field(block::CODES) + t.texel * t.field(block::CODE_WORDS);
    let codes = &t.words[first..first + (t.bases - 1).div_ceil(4)];
    // The code of an even component belongs to the high half of a word, that of the next one to the low half of the next.
    let words = low[1..].as_chunks_mut::<2>().0.iter_mut().zip(high.as_chunks_mut::<2>().0);
    for (word, (low, high)) in codes.iter().zip(words) {
        let weights = [0, 8, 16, 24].map(|shift| coefficient_from_byte(word >> shift & 0xff));
        (high[0], low[0], high[1], low[1]) = (weights[0], weights[1], weights[2], weights[3]);
    }
    // Components that are left out.
    for index in t.bases..(t.bases - 1).next_multiple_of(4) + 1 {
        [&mut *low, &mut *high][index % 2][index / 2] = 0.0;
    }
    halves
}

/// Returns the sum of `shares` times the residual, RGB. Each share has the first word of its pair's bases and the
/// weights of its texel; all are of one layer.
#[inline(always)]
pub(crate) fn residual_sum<S: Simd, const BLOCKS: usize>(
    simd: S,
    bases: Bases,
    pairs: &[(f32, usize, &BasisWeights<BLOCKS>)],
) -> [f32; 3] {
    let mut rgb = [0.0; 3];
    let Some((_, _, BasisWeights { used, channel: [used_words, channel_words], .. })) = pairs.first() else {
        return rgb;
    };
    let mut sums = [[0.0; LANES]; BLOCKS];
    for (number, sums) in sums.iter_mut().enumerate().filter(|(number, _)| used[*number]) {
        for (share, first, weights) in pairs {
            let halves = [&weights.halves[0][number], &weights.halves[1][number]];
            add_block(simd, bases, first + number * LANES, *share, halves, sums);
        }
    }
    for (c, sum) in rgb.iter_mut().enumerate() {
        *sum = sums.as_flattened()[c * channel_words..][..*used_words].iter().sum();
    }
    rgb
}

/// Adds the block that begins at word `first` to `sums`: `share` times its numbers times their weights.
#[inline(always)]
fn add_block<S: Simd>(
    simd: S,
    bases: Bases,
    first: usize,
    share: f32,
    weights: [&[f32; LANES]; 2],
    sums: &mut [f32; LANES],
) {
    let share = simd.splat_f32s(share);
    let [(low_weights, _), (high_weights, _)] = weights.map(|weights| S::as_simd_f32s(weights));
    let (sums, _) = S::as_mut_simd_f32s(sums);
    match bases {
        Bases::Halves(words) => {
            let words: [u32; LANES] = part(words, first);
            let (words, _) = S::as_simd_u32s(&words);
            for i in 0..sums.len() {
                let [low, high] = finite_halves(simd, words[i]);
                let sum = simd.add_f32s(simd.mul_f32s(low_weights[i], low), simd.mul_f32s(high_weights[i], high));
                sums[i] = simd.add_f32s(sums[i], simd.mul_f32s(share, sum));
            }
        }
        Bases::Singles(values) => {
            let values: [f32; 2 * LANES] = part(values, 2 * first);
            let halves = [0, 1].map(|half| -> [f32; LANES] { std::array::from_fn(|i| values[2 * i + half]) });
            let [(low, _), (high, _)] = [S::as_simd_f32s(&halves[0]), S::as_simd_f32s(&halves[1])];
            for i in 0..sums.len() {
                let sum = simd.add_f32s(simd.mul_f32s(low_weights[i], low[i]), simd.mul_f32s(high_weights[i], high[i]));
                sums[i] = simd.add_f32s(sums[i], simd.mul_f32s(share, sum));
            }
        }
    }
}

/// Returns the low and the high half-precision numbers of words; all must be finite.
#[inline(always)]
fn finite_halves<S: Simd>(simd: S, words: S::u32s) -> [S::f32s; 2] {
    let [magnitude, sign] = [0x0fff_e000, 0x8000_0000].map(|bits| simd.splat_u32s(bits));
    // The exponents' biases differ by 112; denormals come out right as well.
    let bias = simd.splat_f32s(f32::from_bits((127 + 112) << 23));
    let low = simd.wrapping_dyn_shl_u32s(words, simd.splat_u32s(13));
    let high = simd.wrapping_dyn_shr_u32s(words, simd.splat_u32s(3));
    let signs = [simd.wrapping_dyn_shl_u32s(words, simd.splat_u32s(16)), words];
    let mut halves = [low, high].map(|bits| {
        let magnitude = simd.transmute_f32s_u32s(simd.and_u32s(bits, magnitude));
        simd.mul_f32s(magnitude, bias)
    });
    for (half, bits) in halves.iter_mut().zip(signs) {
        let bits = simd.or_u32s(simd.transmute_u32s_f32s(*half), simd.and_u32s(bits, sign));
        *half = simd.transmute_f32s_u32s(bits);
    }
    halves
}

/// Returns `N` of `all` from `first` on, and zeros beyond the last.
#[inline(always)]
fn part<T: Copy + Default, const N: usize>(all: &[T], first: usize) -> [T; N] {
    match all.get(first..).and_then(|rest| rest.first_chunk()) {
        Some(whole) => *whole,
        None => std::array::from_fn(|i| all.get(first + i).copied().unwrap_or_default()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::in_vectors::in_vectors;
    use crate::numeric::quantize::half_at;
    use pulp::{Scalar, WithSimd};

    struct Convert<'a>(&'a [u32; LANES]);

    impl WithSimd for Convert<'_> {
        type Output = [[f32; LANES]; 2];

        fn with_simd<S: Simd>(self, simd: S) -> [[f32; LANES]; 2] {
            let mut halves = [[0.0; LANES]; 2];
            for (i, words) in S::as_simd_u32s(self.0).0.iter().enumerate() {
                let found = finite_halves(simd, *words);
                for (halves, found) in halves.iter_mut().zip(found) {
                    S::as_mut_simd_f32s(halves).0[i] = found;
                }
            }
            halves
        }
    }

    #[test]
    fn every_finite_half_is_what_it_is_elsewhere_in_vectors_of_any_width() {
        let mut odd = 0;
        for first in (0..=0xffffu32).step_by(LANES) {
            // Another number in the other half.
            let words: [u32; LANES] = std::array::from_fn(|i| {
                let bits = first + i as u32;
                bits | bits.reverse_bits() & 0xffff_0000
            });
            for found in [in_vectors(Convert(&words)), Convert(&words).with_simd(Scalar)] {
                for (i, word) in words.iter().enumerate() {
                    for half in 0..2 {
                        let (known, found) = (half_at(*word, half), found[half as usize][i]);
                        assert!(found.is_finite());
                        assert_eq!(known.is_finite(), known.to_bits() == found.to_bits(), "{word:x}");
                        odd += u32::from(!known.is_finite());
                    }
                }
            }
        }
        assert_eq!(odd, 2 * 2 * 2 * 1024, "infinite and undefined ones");
    }

    #[test]
    fn what_lies_beyond_the_end_is_zero() {
        assert_eq!(part::<u32, 4>(&[1, 2, 3], 1), [2, 3, 0, 0]);
        assert_eq!(part::<u32, 2>(&[1, 2, 3], 1), [2, 3]);
        assert_eq!(part::<u32, 2>(&[1, 2, 3], 7), [0, 0]);
    }
}
