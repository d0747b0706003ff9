//! The entropy coder of the file form: an adaptive binary range coder [Martin 1979] and models for planes of small
//! signed numbers. It uses integers only, so that every machine decodes the same numbers.
//!
//! Encoder and decoder share the model code through [`BinaryCoder`], so that the decoder reads exactly what the encoder
//! wrote.

use crate::rule::{self, Rule};

/// Probability of a bit, adapted at two rates: quickly while little is known, then slowly.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bit {
    /// Fast estimate of the probability of 0, in 65536ths; the slow one follows.
    fast: u16,
    slow: u16,
    /// Number of bits seen, at most 63.
    seen: u8,
}

/// Shifts of the slow estimate by the number of bits seen: about 1 / (n + 1.5) at first.
const LEARNING_SHIFTS: [u8; 64] = {
    let mut shifts = [7u8; 64];
    let mut seen = 0;
    while seen < 64 {
        shifts[seen] = match seen {
            0 => 1,
            1 => 2,
            2..=4 => 3,
            5..=11 => 4,
            12..=23 => 5,
            24..=47 => 6,
            _ => 7,
        };
        seen += 1;
    }
    shifts
};
/// Shift of the fast estimate after the first bits.
const FAST_SHIFT: u8 = 5;
/// Least probability of a bit in 65536ths: 1 / 128. A bit therefore costs at least 0.0113 bits, and bytes bound the
/// symbols they can hold.
const LEAST: u32 = 512;
/// Largest number of symbols that one byte can hold; follows from `LEAST`.
pub(crate) const SYMBOLS_PER_BYTE: usize = 1024;

/// Bits of a decision of the probability `i / 512`, in the middle of its interval.
static BITS: std::sync::LazyLock<[f32; 513]> =
    std::sync::LazyLock::new(|| std::array::from_fn(|i| -((i as f32 + 0.5) / 512.0).min(1.0).log2()));

impl Bit {
    pub(crate) const NEW: Bit = Bit { fast: 1 << 15, slow: 1 << 15, seen: 0 };

    #[inline(always)]
    fn of_zero(self) -> u32 {
        ((u32::from(self.fast) + u32::from(self.slow)) >> 1).clamp(LEAST, 65536 - LEAST)
    }

    /// Returns about the bits that `bit` costs.
    #[inline(always)]
    pub(crate) fn bits(self, bit: bool) -> f32 {
        let zero = self.of_zero();
        BITS[((if bit { 65536 - zero } else { zero }) >> 7) as usize]
    }

    #[inline(always)]
    fn learn(&mut self, bit: bool) {
        let slow = LEARNING_SHIFTS[usize::from(self.seen)];
        let fast = slow.min(FAST_SHIFT);
        self.seen = (self.seen + 1).min(63);
        // After 1, p - (p >> shift); after 0 the same of 65535 - p.
        let mask = if bit { 0 } else { 0xffff };
        let toward = |p: u16, shift: u8| ((p ^ mask) - ((p ^ mask) >> shift)) ^ mask;
        (self.fast, self.slow) = (toward(self.fast, fast), toward(self.slow, slow));
    }
}

/// A coder of single bits under a model: an encoder or a decoder.
pub(crate) trait BinaryCoder {
    /// Codes one bit. The encoder writes `bit` and returns it; the decoder ignores it and returns the bit that it
    /// reads.
    fn bit(&mut self, model: &mut Bit, bit: bool) -> bool;
}

/// An encoder. Carries wait in `cache` and `waiting` until they are settled.
pub(crate) struct Encoder {
    low: u64,
    range: u32,
    cache: u8,
    waiting: usize,
    bytes: Vec<u8>,
}

const TOP: u32 = 1 << 24;

impl Encoder {
    pub(crate) fn new() -> Encoder {
        Encoder { low: 0, range: u32::MAX, cache: 0, waiting: 0, bytes: Vec::new() }
    }

    fn shift_low(&mut self) {
        if self.low < 0xff00_0000 || self.low > 0xffff_ffff {
            let carry = (self.low >> 32) as u8;
            self.bytes.push(self.cache.wrapping_add(carry));
            self.bytes.extend(std::iter::repeat_n(0xffu8.wrapping_add(carry), self.waiting));
            self.waiting = 0;
            self.cache = (self.low >> 24) as u8;
        } else {
            self.waiting += 1;
        }
        self.low = (self.low & 0x00ff_ffff) << 8;
    }

    /// Returns the bytes: exactly those that a decoder of the same bits reads.
    pub(crate) fn finish(mut self) -> Vec<u8> {
        (0..5).for_each(|_| self.shift_low());
        // The first byte is always 0: no carry leaves the top.
        self.bytes.remove(0);
        self.bytes
    }
}

impl BinaryCoder for Encoder {
    #[inline(always)]
    fn bit(&mut self, model: &mut Bit, bit: bool) -> bool {
        let bound = (self.range >> 16) * model.of_zero();
        if bit {
            self.low += u64::from(bound);
            self.range -= bound;
        } else {
            self.range = bound;
        }
        model.learn(bit);
        while self.range < TOP {
            self.range <<= 8;
            self.shift_low();
        }
        bit
    }
}

/// A decoder. Behind the end it reads zeros; [`Decoder::ended`] finds that.
pub(crate) struct Decoder<'a> {
    code: u32,
    range: u32,
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Decoder<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Decoder<'a> {
        let mut decoder = Decoder { code: 0, range: u32::MAX, bytes, at: 0 };
        (0..4).for_each(|_| decoder.shift_in());
        decoder
    }

    #[inline(always)]
    fn normalise(&mut self) {
        while self.range < TOP {
            self.range <<= 8;
            self.shift_in();
        }
    }

    #[inline(always)]
    fn shift_in(&mut self) {
        self.code = self.code << 8 | u32::from(self.bytes.get(self.at).copied().unwrap_or(0));
        self.at += 1;
    }

    /// Checks that exactly all bytes have been read.
    pub(crate) fn ended(&self) -> Result<(), Rule> {
        match self.at.cmp(&self.bytes.len()) {
            std::cmp::Ordering::Greater => Err(rule::ENDS_EARLY),
            std::cmp::Ordering::Less => Err(rule::TOO_LONG),
            std::cmp::Ordering::Equal => Ok(()),
        }
    }
}

impl BinaryCoder for Decoder<'_> {
    #[inline(always)]
    fn bit(&mut self, model: &mut Bit, _: bool) -> bool {
        let bound = (self.range >> 16) * model.of_zero();
        let bit = self.code >= bound;
        (self.code, self.range) = if bit { (self.code - bound, self.range - bound) } else { (self.code, bound) };
        model.learn(bit);
        if self.range < TOP {
            self.normalise();
        }
        bit
    }
}

/// Model of a number below `2^BITS`, coded from its highest bit down; each bit has a model for every value of the bits
/// above it.
#[derive(Clone)]
pub(crate) struct Tree<const BITS: usize>(Vec<Bit>);

impl<const BITS: usize> Tree<BITS> {
    pub(crate) fn new() -> Self {
        Tree(vec![Bit::NEW; 1 << BITS])
    }

    pub(crate) fn code(&mut self, coder: &mut impl BinaryCoder, value: u32) -> u32 {
        let mut node = 1usize;
        for bit in (0..BITS).rev() {
            node = node << 1 | usize::from(coder.bit(&mut self.0[node], value >> bit & 1 == 1));
        }
        (node - (1 << BITS)) as u32
    }
}

/// Number of contexts of a neighbourhood's magnitude: 0 to 3, then four for each doubling.
const CONTEXTS: usize = 68;

/// Returns the context of a neighbourhood with the weighted magnitude `sum`.
#[inline(always)]
pub(crate) fn context(sum: u32) -> usize {
    if sum < 4 {
        return sum as usize;
    }
    let log = 31 - sum.leading_zeros();
    (4 + (log as usize - 2) * 4 + (sum >> (log - 2) & 3) as usize).min(CONTEXTS - 1)
}

/// Model of signed numbers of up to 16 bits whose size is predicted by their neighbourhood.
#[derive(Clone)]
pub(crate) struct Signed {
    zero: Vec<Bit>,
    sign: [Bit; 5],
    /// Models of the length in bits: `[context / 2][floor(log2 |value|)]`.
    length: Vec<[Bit; 16]>,
    /// Models of the bits below the highest: `[length][leading bits, at most 31]`.
    mantissa: Vec<[Bit; 32]>,
}

impl Signed {
    pub(crate) fn new() -> Signed {
        Signed {
            zero: vec![Bit::NEW; CONTEXTS],
            sign: [Bit::NEW; 5],
            length: vec![[Bit::NEW; 16]; CONTEXTS / 2],
            mantissa: vec![[Bit::NEW; 32]; 17],
        }
    }

    /// Codes one number. `around` is the weighted magnitude of its neighbourhood, `signs` the sum of the signs of two
    /// neighbours.
    #[inline(always)]
    pub(crate) fn code(&mut self, coder: &mut impl BinaryCoder, value: i32, around: u32, signs: i32) -> i32 {
        let context = context(around);
        if !coder.bit(&mut self.zero[context], value != 0) {
            return 0;
        }
        let negative = coder.bit(&mut self.sign[(signs + 2) as usize], value < 0);
        let magnitude = value.unsigned_abs().max(1);
        let given = 31 - magnitude.leading_zeros();
        let lengths = &mut self.length[context / 2];
        let mut length = 0;
        while length < 15 && coder.bit(&mut lengths[length as usize], length < given) {
            length += 1;
        }
        let mut read = 1u32;
        for bit in (0..length).rev() {
            let model = &mut self.mantissa[length as usize][read.min(31) as usize];
            read = read << 1 | u32::from(coder.bit(model, magnitude >> bit & 1 == 1));
        }
        if negative { -(read as i32) } else { read as i32 }
    }
}

/// Codes `values` row by row, `width` in a row. The neighbourhood of a number are the numbers coded before it to the
/// left and above.
///
/// The encoder leaves `values` as they are; the decoder fills them. Magnitudes are at most 65535. Returns false if the
/// decoder met a number that `T` cannot hold.
pub(crate) fn code_plane<T>(coder: &mut impl BinaryCoder, model: &mut Signed, values: &mut [T], width: usize) -> bool
where
    T: Copy + Into<i32> + TryFrom<i32>,
{
    let mut fits = true;
    if width == 0 {
        return fits;
    }
    // Two cells of margin to the left, one to the right.
    let mut above2 = vec![0i32; width + 3];
    let mut above = above2.clone();
    let mut row = above2.clone();
    for line in values.chunks_mut(width) {
        row.iter_mut().for_each(|x| *x = 0);
        for (i, value) in line.iter_mut().enumerate() {
            let (west, north) = (row[i + 1], above[i + 2]);
            let size = |x: i32| x.unsigned_abs();
            let around = 2 * (size(west) + size(north))
                + size(above[i + 1])
                + size(above[i + 3])
                + size(row[i])
                + size(above2[i + 2]);
            let coded = model.code(coder, (*value).into(), around, west.signum() + north.signum());
            row[i + 2] = coded;
            match T::try_from(coded) {
                Ok(coded) => *value = coded,
                Err(_) => fits = false,
            }
        }
        std::mem::swap(&mut above2, &mut above);
        std::mem::swap(&mut above, &mut row);
    }
    fits
}

/// Slowest adaption of a column's mean size: by a sixteenth of the difference.
const COLUMN_SHIFT: u32 = 4;

/// Codes `values` row by row, `width` in a row, where the numbers of a column are alike in size. The decoder fills them.
/// Magnitudes are at most 65535. Returns false if the decoder met a number that does not fit.
pub(crate) fn code_columns(coder: &mut impl BinaryCoder, values: &mut [i16], width: usize) -> bool {
    let (mut model, mut fits) = (Signed::new(), true);
    // Mean size of each column's numbers, in 64ths.
    let mut means = vec![0u32; width];
    for (row, line) in values.chunks_mut(width.max(1)).enumerate() {
        let shift = (row as u32 + 1).ilog2().min(COLUMN_SHIFT);
        for (value, mean) in line.iter_mut().zip(&mut means) {
            let coded = model.code(coder, (*value).into(), *mean / 2, 0);
            let size = 64 * coded.unsigned_abs();
            *mean = if size > *mean { *mean + ((size - *mean) >> shift) } else { *mean - ((*mean - size) >> shift) };
            *value = coded as i16;
            fits &= i32::from(*value) == coded;
        }
    }
    fits
}

/// Returns the bytes of numbers coded by [`code_plane`].
pub(crate) fn encode_plane<T>(values: &[T], width: usize) -> Vec<u8>
where
    T: Copy + Into<i32> + TryFrom<i32>,
{
    let (mut coder, mut values) = (Encoder::new(), values.to_vec());
    code_plane(&mut coder, &mut Signed::new(), &mut values, width);
    coder.finish()
}

/// Returns the number of bytes that a plane of numbers, `width` in a row, takes in the file form, for choosing between
/// planes. Magnitudes are at most 65535. Cost: about 40 ns a number.
pub fn plane_bytes(values: &[i32], width: usize) -> usize {
    encode_plane(values, width).len()
}

/// Decodes the `count` numbers that [`encode_plane`] wrote.
pub(crate) fn decode_plane<T>(bytes: &[u8], count: usize, width: usize) -> Result<Vec<T>, Rule>
where
    T: Copy + Default + Into<i32> + TryFrom<i32>,
{
    bounded(count, bytes)?;
    let mut values = vec![T::default(); count];
    let mut coder = Decoder::new(bytes);
    let fits = code_plane(&mut coder, &mut Signed::new(), &mut values, width);
    coder.ended()?;
    if fits { Ok(values) } else { Err(rule::NUMBER) }
}

/// Refuses more symbols than the bytes can hold, before anything is allocated for them.
pub(crate) fn bounded(count: usize, bytes: &[u8]) -> Result<(), Rule> {
    if count > bytes.len().saturating_mul(SYMBOLS_PER_BYTE) { Err(rule::ENDS_EARLY) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    fn numbers(seed: u64, count: usize, spread: f32) -> Vec<i32> {
        let mut random = Random::new(seed);
        // Roughly Laplacian, with slowly changing spread.
        (0..count)
            .map(|i| {
                let local = spread * (1.2 + (i as f32 * 0.01).sin());
                let size = -random.within(1e-6, 1.0).ln() * local;
                if random.below(2) == 0 { size as i32 } else { -(size as i32) }
            })
            .collect()
    }

    #[test]
    fn planes_come_back_as_they_were_written_whatever_their_size() {
        for (count, width, spread) in
            [(1, 1, 1.0), (7, 3, 0.1), (1000, 40, 0.3), (1000, 33, 5.0), (500, 500, 300.0), (300, 1, 4000.0)]
        {
            let values: Vec<i32> =
                numbers(count as u64, count, spread).iter().map(|x| x.clamp(&-65535, &65535)).copied().collect();
            let bytes = encode_plane(&values, width);
            assert_eq!(decode_plane::<i32>(&bytes, count, width).unwrap(), values);
            // Planted differences: another width reads something else, or not to the end.
            if count > 100 && width > 1 {
                assert_ne!(decode_plane(&bytes, count, width - 1).ok(), Some(values.clone()));
            }
            assert!(decode_plane::<i32>(&bytes[..bytes.len() - 1], count, width).is_err());
            assert!(decode_plane::<i32>(&[&bytes[..], &[0]].concat(), count, width).is_err());
        }
    }

    #[test]
    fn extreme_numbers_come_back() {
        let values = vec![65535, -65535, 0, 32768, -32768, 1, -1, 0, 65535];
        assert_eq!(decode_plane::<i32>(&encode_plane(&values, 3), 9, 3).unwrap(), values);
        assert_eq!(decode_plane::<i16>(&encode_plane(&values, 3), 9, 3), Err(rule::NUMBER));
    }

    #[test]
    fn the_size_is_near_the_entropy_of_what_is_coded() {
        // Independent numbers of a fixed spread: the neighbourhood predicts nothing.
        let mut random = Random::new(5);
        let values: Vec<i32> = (0..40_000).map(|_| [0, 0, 0, 0, 1, -1, 2, -2][random.below(8)]).collect();
        let entropy_bytes = 40_000.0 / 8.0 * (0.5 * 1.0 + 4.0 * 0.125 * 3.0);
        let bytes = encode_plane(&values, 200).len() as f64;
        assert!((0.99..1.02).contains(&(bytes / entropy_bytes)), "{bytes} {entropy_bytes}");
        // Nothing at all costs next to nothing, and still bounds the symbols.
        let empty = encode_plane(&vec![0i32; 1 << 20], 1024);
        assert!(empty.len() < 1600, "{}", empty.len());
        assert!(decode_plane::<i8>(&empty, 1 << 20, 1024).is_ok());
        assert!(decode_plane::<i8>(&empty, empty.len() * SYMBOLS_PER_BYTE + 1, 1024).is_err());
    }
}
