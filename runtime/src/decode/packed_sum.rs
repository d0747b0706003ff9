//! Sums the residual of a texel from packed bases. Twin: `decode/packed_sum.wgsl`, whose pairs are three.
//!
//! The pairs lie side by side in a vector and go through their rows together, because all rows of a cluster have the same
//! order: a number is cut out of each by the same two shifts. A number stands for a level: with half a step added to it,
//! q, that is `q (1/2 + bend |q|)` steps.

use crate::asset::residual::COLOUR_FRAME;
use crate::decode::texel::Texel;
use crate::resident::packed_part::{PackedBasis, packed_bend, packed_bits};
use pulp::{Arch, Simd, WithSimd};

/// Returns the sum of `shares` times the residual of `t` at their pairs, RGB; `rows` are the first words of the pairs' rows.
pub(crate) fn packed_sum<const PAIRS: usize>(t: &Texel, shares: [f32; PAIRS], rows: [usize; PAIRS]) -> [f32; 3] {
    Arch::new().dispatch(PackedSum { t, shares, rows })
}

struct PackedSum<'a, 'b, const PAIRS: usize> {
    t: &'b Texel<'a>,
    shares: [f32; PAIRS],
    rows: [usize; PAIRS],
}

impl<const PAIRS: usize> WithSimd for PackedSum<'_, '_, PAIRS> {
    type Output = [f32; 3];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> [f32; 3] {
        let PackedSum { t, shares, rows } = self;
        let (unit, bases) = (t.packed().unit(), t.packed().bases(t.cluster, t.bases));
        let codes = t.packed_codes();
        let mut sums = [[0.0f32; PAIRS]; 3];
        let mut words = [0u32; PAIRS];
        // Places of the next number in the rows, and of the next code.
        let (mut bit, mut code_bit) = (0, 0);
        for (index, basis) in bases.iter().enumerate() {
            let basis = PackedBasis::from_word(*basis);
            let mut weight = basis.step() * unit;
            if index > 0 {
                if basis.code_width == 0 {
                    continue;
                }
                weight *= packed_bits(codes, code_bit, basis.code_width) as f32;
                code_bit += basis.code_width;
            }
            for (sums, width) in sums.iter_mut().zip(basis.widths) {
                if width == 0 {
                    continue;
                }
                let (word, first) = (bit as usize / 32, bit % 32);
                bit += width;
                if first == 0 {
                    packed_read(&mut words, t.words, &rows, word);
                }
                let down = 32 - width;
                let bend = packed_bend(width);
                let add = |sum: &mut f32, bits: u32| {
                    let place = (bits as i32 >> down) as f32 + 0.5;
                    *sum += weight * place * (0.5 + bend * place.abs());
                };
                if first + width <= 32 {
                    let up = down - first;
                    sums.iter_mut().zip(&words).for_each(|(sum, word)| add(sum, word << up));
                    continue;
                }
                let mut next = [0u32; PAIRS];
                packed_read(&mut next, t.words, &rows, word + 1);
                for ((sum, word), next) in sums.iter_mut().zip(&words).zip(&next) {
                    add(sum, (word >> first | next << (32 - first)) << down);
                }
                words = next;
            }
        }
        let mut rgb = [0.0; 3];
        for (sums, frame) in sums.iter().zip(COLOUR_FRAME) {
            let sum: f32 = sums.iter().zip(&shares).map(|(sum, share)| sum * share).sum();
            (0..3).for_each(|c| rgb[c] += frame[c] * sum);
        }
        rgb
    }
}

/// Reads word number `word` of each row.
#[inline(always)]
fn packed_read<const PAIRS: usize>(out: &mut [u32; PAIRS], words: &[u32], rows: &[usize; PAIRS], word: usize) {
    for (out, row) in out.iter_mut().zip(rows) {
        *out = words.get(row + word).copied().unwrap_or(0);
    }
}
