//! Sums the residual of a texel from packed bases. Twin: `decode/packed_sum.wgsl`, whose pairs are three.
//!
//! The pairs lie side by side in a vector, because all rows of a cluster have the same order: a number is cut out of each
//! by the same two shifts. A number stands for a level: with half a step added to it, q, that is `q (1/2 + bend |q|)` steps.
//!
//! Many codes of a texel are 0. The bases of the others are listed first, without a branch, so that the processor has
//! nothing to guess; only their numbers are read then, out of copies of the rows that lie at a fixed distance.

use crate::asset::limits::MAX_COMPONENTS;
use crate::asset::residual::COLOUR_FRAME;
use crate::decode::texel::Texel;
use crate::numeric::in_vectors::in_vectors;
use crate::resident::packed_part::{MAX_WIDTH, packed_bend, packed_signed};
use pulp::{Simd, WithSimd};

/// Largest number of pairs: three views times three lights.
pub(crate) const MAX_PAIRS: usize = 9;
/// Bytes that are copied together.
const PIECE: usize = 64;
/// Bytes that are read together.
const READ: usize = 4;
/// Bytes of copies of the rows that most assets have, and of the longest, with what is read beyond their ends.
const SHORT_ROW: usize = 4 * PIECE;
const LONG_ROW: usize = (((1 + MAX_COMPONENTS) * 3 * MAX_WIDTH as usize).div_ceil(8) + READ).next_multiple_of(PIECE);
/// Bytes of a copy of a texel's codes.
const CODES: usize = (MAX_COMPONENTS + READ).next_multiple_of(PIECE);

/// Returns the sum of `shares` times the residual of `t` at their pairs, RGB; `rows` are the first words of the pairs' rows,
/// [`MAX_PAIRS`] at most.
pub(crate) fn packed_sum(t: &Texel, shares: &[f32], rows: &[usize]) -> [f32; 3] {
    macro_rules! sum {
        ($pairs:expr, $lanes:literal) => {
            match 4 * t.packed().row_words(t.cluster) + READ <= SHORT_ROW {
                true => in_vectors(PackedSum::<{ $pairs }, $lanes, SHORT_ROW> { t, shares, rows }),
                false => in_vectors(PackedSum::<{ $pairs }, $lanes, LONG_ROW> { t, shares, rows }),
            }
        };
    }
    match rows.len() {
        0..=4 => sum!(4, 4),
        5..=6 => sum!(6, 8),
        _ => sum!(MAX_PAIRS, 16),
    }
}

/// The sum of up to `PAIRS` pairs in vectors of `LANES` numbers, with copies of rows of `ROW` bytes.
struct PackedSum<'a, 'b, const PAIRS: usize, const LANES: usize, const ROW: usize> {
    t: &'b Texel<'a>,
    shares: &'b [f32],
    rows: &'b [usize],
}

/// A basis that a texel uses.
#[derive(Clone, Copy, Default)]
struct UsedBasis {
    /// Number of bits before its numbers, and their widths, as in [`crate::resident::packed_table::PlacedBasis`].
    bit: u16,
    widths: u16,
    /// Step of the basis times the texel's code.
    weight: f32,
}

impl<const PAIRS: usize, const LANES: usize, const ROW: usize> WithSimd for PackedSum<'_, '_, PAIRS, LANES, ROW> {
    type Output = [f32; 3];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> [f32; 3] {
        let PackedSum { t, shares, rows } = self;
        let mut copies = [[0u8; ROW]; PAIRS];
        copy_rows(t.words, rows, t.packed().row_words(t.cluster), &mut copies);
        let mut list = [UsedBasis::default(); 1 + MAX_COMPONENTS];
        let used = used_bases(t, &mut list);
        let (mut grey, mut red_blue, mut green_magenta) = ([0.0f32; LANES], [0.0f32; LANES], [0.0f32; LANES]);
        for UsedBasis { bit, widths, weight } in list[..used].iter().copied() {
            let [a, b, c] = [0, 4, 8].map(|shift| u32::from(widths >> shift & 0xf));
            let bit = u32::from(bit);
            let (bits, first) = (packed_read::<PAIRS, LANES, ROW>(&copies, bit), bit % 8);
            add_numbers(&mut grey, &bits, first, a, weight);
            if b + c == 0 {
                continue;
            }
            if first + a + b + c <= 8 * READ as u32 {
                add_numbers(&mut red_blue, &bits, first + a, b, weight);
                add_numbers(&mut green_magenta, &bits, first + a + b, c, weight);
                continue;
            }
            let (bits, first) = (packed_read::<PAIRS, LANES, ROW>(&copies, bit + a), (bit + a) % 8);
            add_numbers(&mut red_blue, &bits, first, b, weight);
            let (bits, first) = (packed_read::<PAIRS, LANES, ROW>(&copies, bit + a + b), (bit + a + b) % 8);
            add_numbers(&mut green_magenta, &bits, first, c, weight);
        }
        let mut rgb = [0.0; 3];
        for (sums, frame) in [grey, red_blue, green_magenta].iter().zip(COLOUR_FRAME) {
            let sum: f32 = sums.iter().zip(shares).map(|(sum, share)| sum * share).sum();
            (0..3).for_each(|c| rgb[c] += frame[c] * sum);
        }
        rgb
    }
}

/// Adds the numbers of `width` bits that follow the `first` bits, as levels, times `weight`.
#[inline(always)]
fn add_numbers<const LANES: usize>(sums: &mut [f32; LANES], bits: &[u32; LANES], first: u32, width: u32, weight: f32) {
    if width == 0 {
        return;
    }
    let (up, down) = (32 - width - first, 32 - width);
    let (linear, square) = (0.5 * weight, packed_bend(width) * weight);
    for (sum, bits) in sums.iter_mut().zip(bits) {
        let place = ((bits << up) as i32 >> down) as f32 + 0.5;
        *sum += place * (linear + square * place.abs());
    }
}

/// Lists the mean, and the bases whose code is not 0. Returns their number.
fn used_bases(t: &Texel, list: &mut [UsedBasis; 1 + MAX_COMPONENTS]) -> usize {
    let Some([mean, bases @ ..]) = t.table.map(|table| table.of_cluster(t.cluster)) else { return 0 };
    let mut codes = [[0u8; CODES]];
    let length = t.packed().code_words(t.cluster);
    copy_rows(t.words, &[t.first_lobe() - length], length, &mut codes);
    let [codes] = codes;
    list[0] = UsedBasis { bit: mean.bit, widths: mean.widths, weight: mean.step };
    let mut used = 1;
    for basis in bases.iter().take_while(|basis| usize::from(basis.index) < t.bases) {
        let at = (usize::from(basis.code_bit) / 8).min(CODES - READ);
        let bits = u32::from(u16::from_le_bytes([codes[at], codes[at + 1]]));
        let code = packed_signed(bits >> (basis.code_bit % 8), basis.code_width.into());
        list[used.min(MAX_COMPONENTS)] =
            UsedBasis { bit: basis.bit, widths: basis.widths, weight: basis.step * code as f32 };
        used += usize::from(code != 0);
    }
    used
}

/// Copies rows of `length` words, in pieces of one size; behind their end may be anything.
#[inline(always)]
fn copy_rows<const ROW: usize>(words: &[u32], rows: &[usize], length: usize, copies: &mut [[u8; ROW]]) {
    // Piece after piece: row after row would become calls that copy few bytes.
    for at in (0..length).step_by(PIECE / 4) {
        for (copy, row) in copies.iter_mut().zip(rows) {
            let Some(copy) = copy.get_mut(4 * at..).and_then(|copy| copy.first_chunk_mut::<PIECE>()) else { return };
            match words.get(row + at..).and_then(|rest| rest.first_chunk::<{ PIECE / 4 }>()) {
                Some(whole) => *copy = bytemuck::cast(*whole),
                None => copy_last(&words[row + at..row + length], copy),
            }
        }
    }
}

/// Copies less than a piece, at the end of all words.
#[cold]
fn copy_last(words: &[u32], copy: &mut [u8]) {
    copy[..4 * words.len()].copy_from_slice(bytemuck::cast_slice(words));
}

/// Reads the bits of each row from that byte on in which bit number `bit` is.
#[inline(always)]
fn packed_read<const PAIRS: usize, const LANES: usize, const ROW: usize>(
    rows: &[[u8; ROW]; PAIRS],
    bit: u32,
) -> [u32; LANES] {
    let at = (bit as usize / 8).min(ROW - READ);
    let mut out = [0; LANES];
    for (out, row) in out.iter_mut().zip(rows) {
        *out = u32::from_le_bytes([row[at], row[at + 1], row[at + 2], row[at + 3]]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::residual::ResidualKind;
    use crate::decode::options::DecodeOptions;
    use crate::resident::layout::block;
    use crate::resident::packed_widths::PackedGoal;
    use crate::resident::resident::Resident;
    use crate::testing::{Random, sample_asset};
    use crate::threads::serial;

    #[test]
    fn sums_are_those_of_the_numbers_one_by_one() {
        let (mut random, mut long, mut planted) = (Random::new(9), 0, 0);
        for components in [4, 30, 128] {
            let mut asset = sample_asset(40, 6, 5, ResidualKind::Root);
            let residual = asset.layers[0].residual.as_mut().unwrap();
            for j in residual.coefficients.len()..components {
                residual.bases.push(residual.bases[1 + j % 4].clone());
                let mut plane = residual.coefficients[j % 4].clone();
                plane.codes.iter_mut().for_each(|code| *code = [0, 0, 1, -1, 17, -128][random.below(6)]);
                residual.coefficients.push(plane);
            }
            for noise in [1e-2, 1e-9] {
                let packed = Resident::packed_on(&asset, PackedGoal::Noise(noise), &serial);
                for round in 0..300 {
                    let most = if round % 2 == 0 { 128 } else { random.below(components + 1) as u32 };
                    let options = DecodeOptions { components: most, ..DecodeOptions::default() };
                    let t = Texel::new(&packed, 0, random.below(30) as u32, &options);
                    let (part, weights) = (t.packed(), t.packed_weights());
                    long += usize::from(4 * part.row_words(t.cluster) > SHORT_ROW);
                    // The last row of all may end with the words.
                    let mut pairs: Vec<usize> =
                        (0..1 + round % MAX_PAIRS).map(|_| random.below(t.field(block::PAIRS))).collect();
                    pairs[0] = t.field(block::PAIRS) - 1;
                    let shares: Vec<f32> = pairs.iter().map(|_| random.within(0.0, 1.0)).collect();
                    let expected = |pairs: &[usize]| {
                        let (mut sum, mut size) = ([0.0f64; 3], 0.0);
                        for (pair, share) in pairs.iter().zip(&shares) {
                            part.unpack(t.cluster, *pair, t.bases, |basis, channel, value| {
                                let value = f64::from(share * weights[basis] * value);
                                size += value.abs();
                                (0..3).for_each(|c| sum[c] += f64::from(COLOUR_FRAME[channel][c]) * value);
                            });
                        }
                        (sum, size)
                    };
                    let rows: Vec<usize> = pairs.iter().map(|pair| part.row(t.cluster, *pair)).collect();
                    let found = packed_sum(&t, &shares, &rows);
                    let far = |(sum, size): ([f64; 3], f64)| {
                        (0..3).any(|c| (f64::from(found[c]) - sum[c]).abs() > 1e-6 * size)
                    };
                    assert!(!far(expected(&pairs)), "{components} {noise} {round}: {found:?} {:?}", expected(&pairs));
                    pairs[0] -= 1;
                    planted += usize::from(far(expected(&pairs)));
                }
            }
        }
        assert!(long > 200 && planted > 1000, "{long} {planted}");
    }
}
