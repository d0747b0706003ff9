//! The part of packed bases in the words of a resident form, as decoders read it. Twin: `resident/packed_part.wgsl`.
//!
//! docs/reference/format.md, chapter "Packed bases", has the layout.

use half::f16;

/// Number of words before the places of the clusters' rows: unit (f32), bases, offset of the words of the bases, zero.
pub const PACKED_PLACES: usize = 4;
/// Number of words of a cluster's place: offset of its rows, words of a row, words of a texel's codes.
pub const PLACE_WORDS: usize = 3;
/// Greatest number of bits of a number.
pub(crate) const MAX_WIDTH: u32 = 15;
/// Largest size of a number of a basis, so that every decoded value is finite.
const MAX_NUMBER: f32 = 1e6;
/// Largest unit of a layer's steps.
pub(crate) const MAX_UNIT: f32 = 1e9;
/// Bits of a word.
pub(crate) const WORD_BITS: u32 = u32::BITS;

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
    pub(crate) fn to_word(self) -> u32 {
        let [a, b, c] = self.widths;
        u32::from(self.step.to_bits()) | a << 16 | b << 20 | c << 24 | self.code_width << 28
    }

    /// Reads a word.
    pub(crate) fn from_word(word: u32) -> PackedBasis {
        let [a, b, c, code_width] = [16, 20, 24, 28].map(|shift| word >> shift & 0xf);
        PackedBasis { step: f16::from_bits(word as u16), widths: [a, b, c], code_width }
    }

    /// Returns the step as a single: what `f16::to_f32` gives for numbers that are finite and not negative, in two
    /// instructions on every processor.
    pub(crate) fn step(self) -> f32 {
        f32::from_bits(u32::from(self.step.to_bits()) << 13) * f32::from_bits(239 << 23)
    }

    /// Returns whether the step is a finite number and not negative, and numbers are at most [`MAX_NUMBER`].
    pub(crate) fn has_good_step(&self, unit: f32) -> bool {
        let widest = self.widths.into_iter().max().unwrap_or(0);
        // The last level is below 5/4 of so many steps.
        let largest = self.step.to_f32() * unit * 1.25 * (1 << widest) as f32 / 2.0;
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

/// The part of a layer's packed bases.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PackedPart<'a> {
    /// Words of the asset.
    words: &'a [u32],
    /// First word of the part.
    at: usize,
}

impl<'a> PackedPart<'a> {
    pub(crate) fn new(words: &'a [u32], at: usize) -> PackedPart<'a> {
        PackedPart { words, at }
    }

    /// Returns the unit of the steps.
    pub(crate) fn unit(&self) -> f32 {
        f32::from_bits(self.words[self.at])
    }

    /// Returns the words of the first `count` bases of `cluster`.
    pub(crate) fn bases(&self, cluster: usize, count: usize) -> &'a [u32] {
        let [stored, bases] = [1, 2].map(|word| self.words[self.at + word] as usize);
        &self.words[self.at + bases + cluster * stored..][..count]
    }

    /// Returns the first word of the row of `cluster` at a pair.
    pub(crate) fn row(&self, cluster: usize, pair: usize) -> usize {
        let [rows, length, _] = self.place(cluster);
        self.at + rows + pair * length
    }

    /// Returns the number of words of a row of `cluster`.
    pub(crate) fn row_words(&self, cluster: usize) -> usize {
        self.place(cluster)[1]
    }

    /// Returns the number of words of the codes of a texel of `cluster`.
    pub(crate) fn code_words(&self, cluster: usize) -> usize {
        self.place(cluster)[2]
    }

    fn place(&self, cluster: usize) -> [usize; PLACE_WORDS] {
        let place = self.at + PACKED_PLACES + PLACE_WORDS * cluster;
        [0, 1, 2].map(|word| self.words[place + word] as usize)
    }

    /// Calls `take(basis, channel of the colour frame, value)` with what the row of `cluster` at a pair has of the first
    /// `count` bases; all else is 0.
    pub(crate) fn unpack(&self, cluster: usize, pair: usize, count: usize, mut take: impl FnMut(usize, usize, f32)) {
        let row = &self.words[self.row(cluster, pair)..];
        let (unit, mut bit) = (self.unit(), 0);
        let bases = self.bases(cluster, count).iter().map(|word| PackedBasis::from_word(*word));
        for (index, basis) in bases.enumerate() {
            for (channel, width) in basis.widths.into_iter().enumerate().filter(|(_, width)| *width > 0) {
                let number = packed_bits(row, bit, width);
                bit += width;
                take(index, channel, basis.step() * unit * packed_level(number, width));
            }
        }
    }
}

/// Returns how much the levels of numbers of `width` bits spread: 3/2 over the number of levels, exactly.
pub(crate) fn packed_bend(width: u32) -> f32 {
    1.5 * f32::from_bits((127 - width) << 23)
}

/// Returns the level of a number of `width` bits, at least 1, in steps.
pub(crate) fn packed_level(number: i32, width: u32) -> f32 {
    let place = number as f32 + 0.5;
    place * (0.5 + packed_bend(width) * place.abs())
}

/// Returns the number of `width` bits, at least 1, whose level is nearest to `value`, in steps.
pub(crate) fn packed_number(value: f32, width: u32) -> i32 {
    let bend = packed_bend(width);
    // Halfway between two levels lies `0.5 i + bend (i^2 + 1/4)`, solved for i.
    let beyond = (value.abs() - bend / 4.0).max(0.0);
    let place = 2.0 * beyond / (0.5 + (0.25 + 4.0 * bend * beyond).sqrt());
    let number = (place as i32).min((1 << (width - 1)) - 1);
    if value < 0.0 { -1 - number } else { number }
}

/// Returns the number of `width` bits, at least 1, that follows the first `bit` bits of `words`.
pub(crate) fn packed_bits(words: &[u32], bit: u32, width: u32) -> i32 {
    let (word, first) = ((bit / WORD_BITS) as usize, bit % WORD_BITS);
    let mut bits = words[word] >> first;
    if first + width > WORD_BITS {
        bits |= words[word + 1] << (WORD_BITS - first);
    }
    packed_signed(bits, width)
}

/// Returns the number of the lowest `width` bits, 0 for none.
#[inline(always)]
pub(crate) fn packed_signed(bits: u32, width: u32) -> i32 {
    let sign = 1 << width >> 1;
    ((bits & ((1 << width) - 1)) ^ sign) as i32 - sign as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_those_of_halves() {
        for bits in 0..0x7c00 {
            let basis = PackedBasis { step: f16::from_bits(bits), widths: [0; 3], code_width: 0 };
            assert_eq!(basis.step(), basis.step.to_f32());
        }
        let basis = PackedBasis { step: f16::from_f32(0.37), widths: [15, 0, 3], code_width: 8 };
        assert_eq!(PackedBasis::from_word(basis.to_word()), basis);
    }

    #[test]
    fn a_value_gets_the_nearest_level() {
        for width in 1..=MAX_WIDTH {
            let end = 1 << (width - 1);
            for number in -end..end {
                let level = packed_level(number, width);
                assert_eq!(packed_number(level, width), number, "{width}");
                // Halfway to the next level.
                let next = packed_level(number + 1, width);
                if number + 1 < end && number != -1 {
                    let near = |share: f32| packed_number(level + share * (next - level), width);
                    assert_eq!([near(0.45), near(0.55)], [number, number + 1], "{width} {number}");
                }
            }
            assert_eq!([-1e9, 1e9].map(|value| packed_number(value, width)), [-end, end - 1]);
        }
    }
}
