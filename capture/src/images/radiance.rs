//! Decodes Radiance pictures (`.hdr`): shared-exponent RGB, unpacked or in either run-length code [Ward 1991].
//!
//! Values are mantissa x 2^(exponent - 136), as most readers take them, divided by the product of the
//! header's `EXPOSURE`s. Nothing is clamped.

use crate::images::decoded::{DecodedImage, ImageFault, Samples, check_size};

/// Texels that a picture may claim whatever its size in bytes.
const FREE_TEXELS: usize = 1 << 16;

/// Texels that a picture may claim per byte; a constant line of the largest known pictures stays below this.
const MAX_TEXELS_PER_BYTE: usize = 128;

/// Longest header in bytes that is searched for its end.
const MAX_HEADER_BYTES: usize = 1 << 16;

/// Lengths of scanlines that the newer run-length code is used for.
const NEW_CODE_WIDTHS: std::ops::Range<usize> = 8..0x8000;

/// Orientation of scanlines in a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Orientation {
    /// Whether scanlines are columns.
    columns: bool,
    /// Whether columns run from the right, and rows from the bottom.
    from_right: bool,
    from_bottom: bool,
}

#[derive(Debug, PartialEq)]
struct Header {
    width: usize,
    height: usize,
    orientation: Orientation,
    /// Factor from file values to the values before any exposure.
    factor: [f32; 3],
    /// Offset of the pixels in bytes.
    pixels_at: usize,
}

/// Decodes a picture.
pub(crate) fn decode(bytes: &[u8], expected: Option<(usize, usize)>) -> Result<DecodedImage, ImageFault> {
    let header = read_header(bytes).map_err(ImageFault::damaged)?;
    let Header { width, height, orientation, .. } = header;
    check_size(width, height, expected)?;
    if width * height > FREE_TEXELS.max(bytes.len().saturating_mul(MAX_TEXELS_PER_BYTE)) {
        let reason = format!("it claims {width} x {height} texels in {} bytes", bytes.len());
        return Err(ImageFault::damaged(reason));
    }
    let (length, lines) = if orientation.columns { (height, width) } else { (width, height) };
    let mut rest = &bytes[header.pixels_at..];
    let mut line = vec![[0u8; 4]; length];
    let mut values = vec![0f32; width * height * 3];
    for number in 0..lines {
        read_scanline(&mut rest, &mut line)
            .ok_or_else(|| ImageFault::damaged(format!("scanline {number} of {lines} is cut or contradicts itself")))?;
        for (along, texel) in line.iter().enumerate() {
            let (column, row) = if orientation.columns { (number, along) } else { (along, number) };
            let column = if orientation.from_right { width - 1 - column } else { column };
            let row = if orientation.from_bottom { height - 1 - row } else { row };
            let scale = exponent_factor(texel[3]);
            for channel in 0..3 {
                values[(row * width + column) * 3 + channel] =
                    f32::from(texel[channel]) * scale * header.factor[channel];
            }
        }
    }
    if !rest.is_empty() {
        return Err(ImageFault::damaged(format!("{} bytes follow its last scanline", rest.len())));
    }
    Ok(DecodedImage::rgb(width, height, Samples::F32(values)))
}

/// Returns 2^(exponent - 136), and 0 for the exponent 0.
fn exponent_factor(exponent: u8) -> f32 {
    if exponent == 0 { 0.0 } else { ((i32::from(exponent) - 136) as f32).exp2() }
}

fn read_header(bytes: &[u8]) -> Result<Header, String> {
    if !bytes.starts_with(b"#?") {
        return Err("it does not start like a Radiance picture".into());
    }
    let searched = &bytes[..bytes.len().min(MAX_HEADER_BYTES)];
    let mut at = 0;
    let mut next_line = || {
        let length = searched[at..].iter().position(|&byte| byte == b'\n').ok_or("its header has no end")?;
        let line = std::str::from_utf8(&searched[at..at + length]).map_err(|_| "its header is no text")?;
        at += length + 1;
        Ok::<&str, String>(line.trim_end_matches('\r'))
    };
    let mut factor = [1f32; 3];
    next_line()?;
    loop {
        let line = next_line()?;
        if line.is_empty() {
            break;
        }
        let numbers = |text: &str| -> Result<Vec<f32>, String> {
            let found: Option<Vec<f32>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
            found
                .filter(|numbers| numbers.iter().all(|number| number.is_finite() && *number > 0.0))
                .ok_or_else(|| format!("its header has the line `{}`", line.escape_debug()))
        };
        if let Some(format) = line.strip_prefix("FORMAT=") {
            if format.trim() != "32-bit_rle_rgbe" {
                return Err(format!("its format is `{}`, only 32-bit_rle_rgbe is read", format.escape_debug()));
            }
        } else if let Some(exposure) = line.strip_prefix("EXPOSURE=") {
            let [exposure] = numbers(exposure)?[..] else { return Err("its exposure is not one number".into()) };
            factor = factor.map(|factor| factor / exposure);
        } else if let Some(correction) = line.strip_prefix("COLORCORR=") {
            let [r, g, b] = numbers(correction)?[..] else { return Err("its COLORCORR is not three numbers".into()) };
            factor = [factor[0] / r, factor[1] / g, factor[2] / b];
        }
    }
    if factor.iter().any(|factor| !factor.is_finite()) {
        return Err("its exposures leave the range of numbers".into());
    }
    let (width, height, orientation) = parse_resolution(next_line()?)?;
    Ok(Header { width, height, orientation, factor, pixels_at: at })
}

/// Returns the size and orientation that a resolution line states: the axis that comes first changes from scanline to
/// scanline, `-Y` counts from the top, `+X` from the left.
///
/// One of the eight forms is an exception: `+X W -Y H`, which ATRIUM's pictures have. By the letter, their scanlines
/// would be columns, but they are rows from the bottom: readers of that database replace the line by `-Y H +X W` and
/// then flip the picture. No program is known that writes this form otherwise.
fn parse_resolution(line: &str) -> Result<(usize, usize, Orientation), String> {
    let bad = || format!("its resolution line is `{}`, not like `-Y 256 +X 256`", line.escape_debug());
    let words: Vec<&str> = line.split_whitespace().collect();
    let [first, first_count, second, second_count] = words[..] else { return Err(bad()) };
    let count = |word: &str| -> Result<usize, String> {
        let digits = word.len() <= 9 && word.bytes().all(|byte| byte.is_ascii_digit());
        if digits { word.parse().map_err(|_| bad()) } else { Err(bad()) }
    };
    let (first_count, second_count) = (count(first_count)?, count(second_count)?);
    let sign = |word: &str, axis: char| match word.as_bytes() {
        [b'+', letter] if *letter as char == axis => Some(true),
        [b'-', letter] if *letter as char == axis => Some(false),
        _ => None,
    };
    if let (Some(y_up), Some(x_right)) = (sign(first, 'Y'), sign(second, 'X')) {
        let orientation = Orientation { columns: false, from_right: !x_right, from_bottom: y_up };
        return Ok((second_count, first_count, orientation));
    }
    let (Some(x_right), Some(y_up)) = (sign(first, 'X'), sign(second, 'Y')) else { return Err(bad()) };
    let orientation = if x_right && !y_up {
        Orientation { columns: false, from_right: false, from_bottom: true }
    } else {
        Orientation { columns: true, from_right: !x_right, from_bottom: y_up }
    };
    Ok((first_count, second_count, orientation))
}

/// Reads one scanline in either code; returns `None` if it is cut or runs over its end.
fn read_scanline(rest: &mut &[u8], line: &mut [[u8; 4]]) -> Option<()> {
    let start = rest.get(..4)?;
    if NEW_CODE_WIDTHS.contains(&line.len()) && start[0] == 2 && start[1] == 2 && start[2] < 128 {
        if usize::from(start[2]) << 8 | usize::from(start[3]) != line.len() {
            return None;
        }
        *rest = &rest[4..];
        return read_new_code(rest, line);
    }
    read_old_code(rest, line)
}

/// Reads a scanline in the newer code: each of the four components in turn, as runs (count above 128) and literals.
fn read_new_code(rest: &mut &[u8], line: &mut [[u8; 4]]) -> Option<()> {
    for component in 0..4 {
        let mut at = 0;
        while at < line.len() {
            let (&count, tail) = rest.split_first()?;
            let is_run = count > 128;
            let count = usize::from(if is_run { count - 128 } else { count });
            let used = if is_run { 1 } else { count };
            if count == 0 || count > line.len() - at || used > tail.len() {
                return None;
            }
            for (i, texel) in line[at..at + count].iter_mut().enumerate() {
                texel[component] = tail[if is_run { 0 } else { i }];
            }
            at += count;
            *rest = &tail[used..];
        }
    }
    Some(())
}

/// Reads a scanline in the older code: texels one by one, where (1, 1, 1, n) repeats the previous texel n times, and
/// further repeats in a row count in the next higher bytes.
fn read_old_code(rest: &mut &[u8], line: &mut [[u8; 4]]) -> Option<()> {
    let (mut at, mut shift) = (0, 0);
    while at < line.len() {
        let (texel, tail) = rest.split_at_checked(4)?;
        *rest = tail;
        if texel[..3] == [1, 1, 1] {
            let count = usize::from(texel[3]).checked_shl(shift)?;
            if at == 0 || count > line.len() - at || shift > 16 {
                return None;
            }
            let before = line[at - 1];
            line[at..at + count].fill(before);
            at += count;
            shift += 8;
        } else {
            line[at].copy_from_slice(texel);
            at += 1;
            shift = 0;
        }
    }
    Some(())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Returns a header with `resolution` as its last line.
    pub(crate) fn header(resolution: &str) -> Vec<u8> {
        format!("#?RADIANCE\n# made by a test\nFORMAT=32-bit_rle_rgbe\n\n{resolution}\n").into_bytes()
    }

    /// Returns the texels without a run-length code; exact for values whose mantissas have 8 bits.
    pub(crate) fn flat(texels: &[[f32; 3]]) -> Vec<u8> {
        texels.iter().flat_map(rgbe).collect()
    }

    fn rgbe(texel: &[f32; 3]) -> [u8; 4] {
        let largest = texel.iter().fold(0f32, |a, &b| a.max(b));
        if largest == 0.0 {
            return [0; 4];
        }
        let exponent = largest.log2().floor() as i32 + 1;
        let mantissa = |value: f32| (value * ((8 - exponent) as f32).exp2()) as u8;
        [mantissa(texel[0]), mantissa(texel[1]), mantissa(texel[2]), (exponent + 128) as u8]
    }

    fn values(image: &DecodedImage) -> Vec<[f32; 3]> {
        match &image.samples {
            Samples::F32(values) => values.chunks_exact(3).map(|texel| [texel[0], texel[1], texel[2]]).collect(),
            other => panic!("{other:?}"),
        }
    }

    fn decoded(resolution: &str, pixels: &[u8]) -> Result<DecodedImage, ImageFault> {
        decode(&[header(resolution), pixels.to_vec()].concat(), None)
    }

    /// Returns six texels that all differ, one far above 1.
    fn six() -> [[f32; 3]; 6] {
        [[1.0, 0.5, 0.25], [300.0, 2.0, 6.0], [0.0, 0.0, 0.0], [0.125, 1.5, 0.0], [4e-4, 0.0, 1e-4], [96.0, 64.0, 8.0]]
            .map(|texel| texel.map(|value: f32| value))
    }

    #[test]
    fn each_orientation_is_turned_upright() {
        // 3 columns x 2 rows, texel = row * 3 + column.
        let (a, b, c, d, e, f) = (0, 1, 2, 3, 4, 5);
        for (resolution, order) in [
            ("-Y 2 +X 3", [a, b, c, d, e, f]),
            ("-Y 2 -X 3", [c, b, a, f, e, d]),
            ("+Y 2 +X 3", [d, e, f, a, b, c]),
            ("+Y 2 -X 3", [f, e, d, c, b, a]),
            ("+X 3 +Y 2", [d, a, e, b, f, c]),
            ("-X 3 -Y 2", [c, f, b, e, a, d]),
            ("-X 3 +Y 2", [f, c, e, b, d, a]),
            // ATRIUM's: rows from the bottom, whatever the letters say.
            ("+X 3 -Y 2", [d, e, f, a, b, c]),
        ] {
            // Whole numbers below 256 are exact.
            let texel = |index: usize| [index as f32 + 1.0, 2.0 * index as f32, 0.0];
            let file: Vec<[f32; 3]> = order.iter().map(|&index| texel(index)).collect();
            let image = decoded(resolution, &flat(&file)).unwrap();
            assert_eq!((image.width, image.height), (3, 2), "{resolution}");
            let upright: Vec<[f32; 3]> = (0..6).map(texel).collect();
            assert_eq!(values(&image), upright, "{resolution}");
        }
    }

    #[test]
    fn values_above_one_are_kept_within_the_mantissa() {
        let image = decoded("-Y 2 +X 3", &flat(&six())).unwrap();
        for (read, written) in values(&image).iter().zip(six()) {
            let step = written.iter().fold(0f32, |a, &b| a.max(b)) / 128.0;
            for channel in 0..3 {
                assert!((read[channel] - written[channel]).abs() <= step, "{read:?} {written:?}");
            }
        }
        assert_eq!(values(&image)[1][0], 300.0);
    }

    #[test]
    fn both_run_length_codes_give_the_same_picture_as_none() {
        let line: Vec<[u8; 4]> =
            (0..200).map(|i| if (40..190).contains(&i) { [9, 8, 7, 130] } else { [i as u8, 3, 200, 131] }).collect();
        let plain = decoded("-Y 1 +X 200", &line.concat()).unwrap();
        // Old: texels, and the repeats of one as (1, 1, 1, count).
        let mut old = line[..41].concat();
        old.extend([1, 1, 1, 149]);
        old.extend(line[190..].concat());
        assert_eq!(values(&decoded("-Y 1 +X 200", &old).unwrap()), values(&plain));
        // New: each component as literals of up to 128 and runs of up to 127.
        let mut new = vec![2, 2, 0, 200];
        for component in 0..4 {
            let literal = |from: usize, to: usize| {
                let mut bytes = vec![(to - from) as u8];
                bytes.extend(line[from..to].iter().map(|texel| texel[component]));
                bytes
            };
            new.extend(literal(0, 40));
            for run in [127u8, 23] {
                new.extend([128 + run, line[40][component]]);
            }
            new.extend(literal(190, 200));
        }
        assert_eq!(values(&decoded("-Y 1 +X 200", &new).unwrap()), values(&plain));
        // A count over several repeats: 5 + 1 x 256.
        let mut long = flat(&[[1.0, 2.0, 3.0]]);
        long.extend([1, 1, 1, 5, 1, 1, 1, 1]);
        let image = decoded("-Y 1 +X 262", &long).unwrap();
        assert!(values(&image).iter().all(|texel| *texel == [1.0, 2.0, 3.0]));
    }

    #[test]
    fn exposure_and_colour_correction_are_undone() {
        let text = "#?RGBE\nEXPOSURE=2\nEXPOSURE= 4.0\nCOLORCORR= 1 2 4\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n";
        let image = decode(&[text.as_bytes(), &flat(&[[8.0, 8.0, 8.0]])].concat(), None).unwrap();
        assert_eq!(values(&image), [[1.0, 0.5, 0.25]]);
    }

    #[test]
    fn what_is_wrong_is_said_and_nothing_large_is_allocated_for_a_lie() {
        let reason = |bytes: &[u8]| match decode(bytes, None) {
            Err(ImageFault::Damaged(reason)) => reason,
            other => panic!("{other:?}"),
        };
        for (text, part) in [
            ("GIF89a", "start"),
            ("#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n", "xyze"),
            ("#?RADIANCE\nEXPOSURE=nan\n\n-Y 1 +X 1\n", "EXPOSURE"),
            ("#?RADIANCE\nEXPOSURE=0\n\n-Y 1 +X 1\n", "EXPOSURE"),
            ("#?RADIANCE\n\n-Z 1 +X 1\n", "resolution"),
            ("#?RADIANCE\n\n-Y 1 +Y 1\n", "resolution"),
            ("#?RADIANCE\n\n-Y -1 +X 1\n", "resolution"),
            ("#?RADIANCE\n\n-Y 99999999999999999999 +X 1\n", "resolution"),
            ("#?RADIANCE\n\n-Y 0 +X 1\n", "0"),
            ("#?RADIANCE\n\n-Y 8000 +X 8000\n", "claims 8000 x 8000"),
            ("#?RADIANCE\n\n-Y 99999 +X 99999\n", "claims"),
            ("#?RADIANCE\n\n-Y 2 +X 3\n", "scanline 0"),
        ] {
            let reason = reason(text.as_bytes());
            assert!(reason.contains(part), "{text:?}: {reason}");
        }
        // Runs over the end, a run of nothing, a repeat of nothing, a line of another length, a tail.
        let long = "-Y 1 +X 200";
        for bytes in [&[2, 2, 0, 200, 255, 9, 255, 9][..], &[2, 2, 0, 200, 0], &[1, 1, 1, 200], &[2, 2, 0, 199, 255, 9]]
        {
            assert!(decoded(long, bytes).is_err(), "{bytes:?}");
        }
        let tail = [flat(&six()), vec![0]].concat();
        assert!(decoded("-Y 2 +X 3", &tail).is_err());
        let good = [header("-Y 2 +X 3"), flat(&six())].concat();
        assert_eq!(decode(&good, Some((2, 3))).unwrap_err(), ImageFault::WrongSize { width: 3, height: 2 });
    }

    #[test]
    fn every_prefix_is_refused_and_no_flipped_byte_panics() {
        let line: Vec<u8> = [2u8, 2, 0, 9].into_iter().chain([128 + 9, 5].repeat(4)).collect();
        let good = [header("+X 9 -Y 2"), line.clone(), line].concat();
        assert!(decode(&good, None).is_ok());
        for length in 0..good.len() {
            assert!(decode(&good[..length], None).is_err(), "prefix of {length}");
        }
        for position in 0..good.len() {
            for mask in [1, 2, 0x10, 0x80, 0xFF] {
                let mut damaged = good.clone();
                damaged[position] ^= mask;
                let _ = decode(&damaged, None);
            }
        }
    }
}
