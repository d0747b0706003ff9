//! Strips and tiles of a TIFF file: their bytes without compression and prediction.

use std::borrow::Cow;
use std::io::Read;

use flate2::read::ZlibDecoder;

use crate::images::decoded::little_endian;

/// How the bytes of strips and tiles are packed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Compression {
    Uncompressed,
    Lzw,
    Deflate,
    PackBits,
}

impl Compression {
    /// Returns the compression of a number in the tag; `None` for those that are not read.
    pub(crate) fn of(number: u64) -> Option<Compression> {
        Some(match number {
            1 => Compression::Uncompressed,
            5 => Compression::Lzw,
            // The number of the specification, and an older one.
            8 | 32946 => Compression::Deflate,
            32773 => Compression::PackBits,
            _ => return None,
        })
    }

    /// Returns the largest ratio between unpacked and packed bytes.
    pub(crate) fn max_inflation(self) -> usize {
        match self {
            Compression::Uncompressed => 1,
            // Of one byte over and over 1340, as the codes have 9 to 12 bits and stand for up to 3837 bytes.
            Compression::Lzw => 1400,
            Compression::Deflate => 1032,
            Compression::PackBits => 64,
        }
    }
}

/// How samples are predicted from those before them in a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Predictor {
    Nothing,
    /// By the sample before.
    Horizontal,
    /// Of floats by the sample before, byte by byte, the highest bytes of a row first.
    FloatingPoint,
}

impl Predictor {
    /// Returns the predictor of a number in the tag; `None` for those that are not read.
    pub(crate) fn of(number: u64) -> Option<Predictor> {
        Some(match number {
            1 => Predictor::Nothing,
            2 => Predictor::Horizontal,
            3 => Predictor::FloatingPoint,
            _ => return None,
        })
    }
}

/// How the rows of a strip or tile are stored.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rows {
    /// Texels of a row.
    pub width: usize,
    /// Samples of a texel.
    pub count: usize,
    /// Bytes of a sample: 1, 2, 4 or 8.
    pub size: usize,
    pub is_big_endian: bool,
}

impl Rows {
    /// Returns the size of a row in bytes.
    pub(crate) fn bytes(&self) -> usize {
        self.width * self.count * self.size
    }
}

/// Unpacks the first `rows` rows of a strip or tile, which remain in the file's order of bytes. `packed` are its bytes
/// in the file. `None` where they are too few or contradict themselves.
pub(crate) fn unpacked<'a>(
    packed: &'a [u8],
    compression: Compression,
    predictor: Predictor,
    layout: Rows,
    rows: usize,
) -> Option<Cow<'a, [u8]>> {
    let length = layout.bytes().checked_mul(rows)?;
    let mut bytes = match compression {
        Compression::Uncompressed => Cow::Borrowed(packed.get(..length)?),
        Compression::Lzw => Cow::Owned(lzw(packed, length)?),
        Compression::Deflate => Cow::Owned(inflated(packed, length)?),
        Compression::PackBits => Cow::Owned(unpacked_bits(packed, length)?),
    };
    let is_big = layout.is_big_endian;
    match predictor {
        Predictor::Nothing => {}
        Predictor::Horizontal => {
            for row in bytes.to_mut().chunks_exact_mut(layout.bytes()) {
                match layout.size {
                    1 => add_before::<1>(row, layout.count, is_big),
                    2 => add_before::<2>(row, layout.count, is_big),
                    4 => add_before::<4>(row, layout.count, is_big),
                    _ => add_before::<8>(row, layout.count, is_big),
                }
            }
        }
        Predictor::FloatingPoint => {
            let mut planes = vec![0; layout.bytes()];
            for row in bytes.to_mut().chunks_exact_mut(layout.bytes()) {
                planes.copy_from_slice(row);
                for at in layout.count..planes.len() {
                    planes[at] = planes[at].wrapping_add(planes[at - layout.count]);
                }
                let samples = layout.width * layout.count;
                for (sample, bytes) in row.chunks_exact_mut(layout.size).enumerate() {
                    for plane in 0..layout.size {
                        let place = if is_big { plane } else { layout.size - 1 - plane };
                        bytes[place] = planes[plane * samples + sample];
                    }
                }
            }
        }
    }
    Some(bytes)
}

/// Adds to each sample of `N` bytes the one of the texel before it, in a row of texels of `count` samples.
fn add_before<const N: usize>(row: &mut [u8], count: usize, is_big_endian: bool) {
    let number = |row: &[u8], at: usize| {
        let mut bytes = [0; 8];
        bytes[..N].copy_from_slice(&little_endian::<N>(row, at, is_big_endian));
        u64::from_le_bytes(bytes)
    };
    for at in count..row.len() / N {
        let sum = number(row, at).wrapping_add(number(row, at - count)).to_le_bytes();
        let place = &mut row[at * N..][..N];
        place.copy_from_slice(&sum[..N]);
        if is_big_endian {
            place.reverse();
        }
    }
}

/// Inflates `length` bytes. The checksum counts where the data end there.
fn inflated(packed: &[u8], length: usize) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    ZlibDecoder::new(packed).take(length as u64 + 1).read_to_end(&mut bytes).ok()?;
    let is_whole = bytes.len() >= length;
    bytes.truncate(length);
    is_whole.then_some(bytes)
}

/// Unpacks `length` bytes: after a number n from 0 to 127 come n + 1 bytes, after one from -127 to -1 a byte that
/// stands 1 - n times.
fn unpacked_bits(packed: &[u8], length: usize) -> Option<Vec<u8>> {
    let (mut bytes, mut rest) = (Vec::new(), packed);
    while bytes.len() < length {
        let (head, tail) = rest.split_first()?;
        rest = match *head as i8 {
            count @ 0.. => {
                let (literal, tail) = tail.split_at_checked(count as usize + 1)?;
                bytes.extend_from_slice(literal);
                tail
            }
            i8::MIN => tail,
            count => {
                let (byte, tail) = tail.split_first()?;
                bytes.resize(bytes.len() + 1 + usize::from(count.unsigned_abs()), *byte);
                tail
            }
        };
    }
    bytes.truncate(length);
    Some(bytes)
}

/// Codes of LZW that start over and end, and the first code of a string.
const LZW_CLEAR: usize = 256;
const LZW_END: usize = 257;
const LZW_FIRST: usize = 258;
/// Bits of the longest code.
const LZW_MAX_BITS: u32 = 12;

/// Unpacks `length` bytes of LZW, the highest bits first, where codes get longer one code early [TIFF 6.0, section 13].
fn lzw(packed: &[u8], length: usize) -> Option<Vec<u8>> {
    let mut bytes: Vec<u8> = Vec::new();
    // Place and length in `bytes` of the string that each code stands for, from the first on, and of the last string.
    let mut strings: Vec<(usize, usize)> = Vec::new();
    let mut last: Option<(usize, usize)> = None;
    let (mut rest, mut buffer, mut held, mut bits) = (packed.iter(), 0u32, 0, 9);
    while bytes.len() < length {
        while held < bits {
            buffer = buffer << 8 | u32::from(*rest.next()?);
            held += 8;
        }
        held -= bits;
        let code = (buffer >> held) as usize & ((1 << bits) - 1);
        let start = bytes.len();
        match (code, last) {
            (LZW_CLEAR, _) => {
                strings.clear();
                (last, bits) = (None, 9);
                continue;
            }
            (LZW_END, _) => return None,
            (0..LZW_CLEAR, _) => bytes.push(code as u8),
            _ => match (strings.get(code - LZW_FIRST), last) {
                (Some(&(at, count)), _) => bytes.extend_from_within(at..at + count),
                // The string that this very code completes.
                (None, Some((at, count))) if code - LZW_FIRST == strings.len() => {
                    bytes.extend_from_within(at..at + count);
                    bytes.push(bytes[at]);
                }
                _ => return None,
            },
        }
        if let Some((at, count)) = last
            && strings.len() + LZW_FIRST < 1 << LZW_MAX_BITS
        {
            // The last string and the byte behind it.
            strings.push((at, count + 1));
        }
        last = Some((start, bytes.len() - start));
        if strings.len() + LZW_FIRST >= (1 << bits) - 1 && bits < LZW_MAX_BITS {
            bits += 1;
        }
    }
    bytes.truncate(length);
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROW: Rows = Rows { width: 3, count: 1, size: 1, is_big_endian: false };

    #[test]
    fn the_examples_of_the_specifications_are_unpacked() {
        // Of PackBits [TIFF 6.0, section 9].
        let packed = b"\xFE\xAA\x02\x80\x00\x2A\xFD\xAA\x03\x80\x00\x2A\x22\xF7\xAA";
        let wanted =
            b"\xAA\xAA\xAA\x80\x00\x2A\xAA\xAA\xAA\xAA\x80\x00\x2A\x22\xAA\xAA\xAA\xAA\xAA\xAA\xAA\xAA\xAA\xAA";
        assert_eq!(unpacked_bits(packed, wanted.len()).unwrap(), wanted);
        assert!(unpacked_bits(packed, wanted.len() + 1).is_none() && unpacked_bits(&packed[..13], 24).is_none());
        // Of LZW [section 13]: 7 7 7 8 8 7 7 6 6, with the codes 256 7 258 8 8 258 6 6 257.
        let codes = [256, 7, 258, 8, 8, 258, 6, 6, 257];
        let bits: String = codes.iter().map(|code| format!("{code:09b}")).collect();
        let bits = format!("{bits:0<88}");
        let packed: Vec<u8> = (0..11).map(|i| u8::from_str_radix(&bits[8 * i..][..8], 2).unwrap()).collect();
        assert_eq!(lzw(&packed, 9).unwrap(), [7, 7, 7, 8, 8, 7, 7, 6, 6]);
        assert!(lzw(&packed, 10).is_none() && lzw(&packed[..5], 9).is_none());
        // A code of a string that is not there yet.
        assert!(lzw(&[0x80, 0x01, 0xFF, 0xFF], 9).is_none());
    }

    #[test]
    fn a_damaged_checksum_of_deflate_is_seen() {
        let mut packed = Vec::new();
        flate2::read::ZlibEncoder::new(&b"abcabcabc"[..], flate2::Compression::fast())
            .read_to_end(&mut packed)
            .unwrap();
        let unpacked = |packed: &[u8], rows| {
            unpacked(packed, Compression::Deflate, Predictor::Nothing, ROW, rows).map(Cow::into_owned)
        };
        assert_eq!(unpacked(&packed, 3).unwrap(), b"abcabcabc");
        assert_eq!(unpacked(&packed, 2).unwrap(), b"abcabc");
        assert!(unpacked(&packed, 4).is_none());
        *packed.last_mut().unwrap() ^= 1;
        assert!(unpacked(&packed, 3).is_none());
    }

    #[test]
    fn predictions_are_undone_in_both_orders_of_bytes() {
        // Two texels of two samples.
        let numbers = [1000u16, 7, 900, 65535];
        for is_big_endian in [false, true] {
            let bytes = |number: &u16| if is_big_endian { number.to_be_bytes() } else { number.to_le_bytes() };
            let row = Rows { width: 2, count: 2, size: 2, is_big_endian };
            let differences = [1000, 7, 900u16.wrapping_sub(1000), 65535 - 7];
            let packed: Vec<u8> = differences.iter().flat_map(bytes).collect();
            let wanted: Vec<u8> = numbers.iter().flat_map(bytes).collect();
            let found = unpacked(&packed, Compression::Uncompressed, Predictor::Horizontal, row, 1).unwrap();
            assert_eq!(*found, wanted);
            // Of floats the high bytes come first, whatever the order of bytes.
            let planes = [0x03u8, 0x00, 0x03, 0xFF, 0xE8, 0x07, 0x84, 0xFF];
            let mut packed = planes;
            (2..8).for_each(|at| packed[at] = planes[at].wrapping_sub(planes[at - 2]));
            let found = unpacked(&packed, Compression::Uncompressed, Predictor::FloatingPoint, row, 1).unwrap();
            assert_eq!(*found, wanted);
        }
    }
}
