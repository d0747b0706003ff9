//! Decoding and encoding of one image: png and jpg here, exr and hdr in their own files.
//!
//! Decoders are strict: an image whose file ends early or whose checksums fail is refused, never
//! filled up with grey. JPEG has no checksum, so a JPEG damaged inside, its end intact, is seen
//! only where the damage makes no valid code.

use std::io::Cursor;

use image::ImageEncoder;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::images::exr;
use crate::images::radiance;
use crate::info::ImageFormat;

/// Largest number of texels of an image: 8192 x 8192. Larger claims are refused before anything
/// is allocated.
pub(crate) const MAX_TEXELS: usize = 1 << 26;

/// Quality of written JPEGs, 1 to 100.
const JPEG_QUALITY: u8 = 95;

/// What an image file can be, told by its name's extension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FileFormat {
    Png,
    Jpg,
    /// RGB or one channel per wavelength.
    Exr,
    /// Radiance.
    Hdr,
}

impl FileFormat {
    /// The format that a file name extension stands for, in any case; `None` for others.
    pub(crate) fn from_extension(extension: &str) -> Option<FileFormat> {
        if extension.eq_ignore_ascii_case("hdr") {
            return Some(FileFormat::Hdr);
        }
        ImageFormat::from_extension(extension).map(|format| match format {
            ImageFormat::Png => FileFormat::Png,
            ImageFormat::Jpg => FileFormat::Jpg,
            ImageFormat::Exr => FileFormat::Exr,
        })
    }

    /// The format that a capture of such files would be written in.
    pub(crate) fn written_as(self) -> ImageFormat {
        match self {
            FileFormat::Png => ImageFormat::Png,
            FileFormat::Jpg => ImageFormat::Jpg,
            FileFormat::Exr | FileFormat::Hdr => ImageFormat::Exr,
        }
    }
}

/// File values of a decoded image, `[texel, channel]`, three channels.
#[derive(Debug)]
pub(crate) enum Samples {
    U8(Vec<u8>),
    /// 16-bit PNG, 0 to 65535.
    U16(Vec<u16>),
    /// EXR, Radiance.
    F32(Vec<f32>),
    /// Linear RGB made here from something else, a spectrum or a factorisation. A negative is then no
    /// sign of a damaged file: below what captures hold it is clamped, not refused.
    Computed(Vec<f32>),
}

#[derive(Debug)]
pub(crate) struct DecodedImage {
    pub width: usize,
    pub height: usize,
    pub samples: Samples,
}

/// Why an image was not decoded.
#[derive(Debug, PartialEq)]
pub(crate) enum ImageFault {
    /// The decoder's reason.
    Damaged(String),
    /// Its header claims another size than was asked for.
    WrongSize { width: usize, height: usize },
}

impl ImageFault {
    pub(crate) fn damaged(reason: impl ToString) -> ImageFault {
        // Decoders' reasons come with line breaks, quotes and a full stop; an error message is
        // one sentence.
        let reason = reason.to_string();
        let one_line: Vec<&str> = reason.split_whitespace().collect();
        ImageFault::Damaged(one_line.join(" ").trim_end_matches('.').to_string())
    }
}

/// Decodes `bytes`. With `expected` given, an image of another size is refused from its header.
pub(crate) fn decode(
    bytes: &[u8],
    format: FileFormat,
    expected: Option<(usize, usize)>,
) -> Result<DecodedImage, ImageFault> {
    if bytes.is_empty() {
        return Err(ImageFault::damaged("the file is empty"));
    }
    match format {
        FileFormat::Png => decode_png(bytes, expected),
        FileFormat::Jpg => decode_jpg(bytes, expected),
        FileFormat::Exr => exr::decode(bytes, expected),
        FileFormat::Hdr => radiance::decode(bytes, expected),
    }
}

/// Checks a header's size against what was asked for and against the largest allowed.
pub(crate) fn check_size(width: usize, height: usize, expected: Option<(usize, usize)>) -> Result<(), ImageFault> {
    if expected.is_some_and(|size| size != (width, height)) {
        return Err(ImageFault::WrongSize { width, height });
    }
    if width == 0 || height == 0 || width.checked_mul(height).is_none_or(|texels| texels > MAX_TEXELS) {
        let reason = format!("it claims {width} x {height} texels; 1 to {MAX_TEXELS} texels are allowed");
        return Err(ImageFault::damaged(reason));
    }
    Ok(())
}

fn decode_png(bytes: &[u8], expected: Option<(usize, usize)>) -> Result<DecodedImage, ImageFault> {
    let limits = png::Limits { bytes: MAX_TEXELS * 8 };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(png::Transformations::EXPAND);
    decoder.ignore_checksums(false);
    let mut reader = decoder.read_info().map_err(ImageFault::damaged)?;
    let (width, height) = reader.info().size();
    let (width, height) = (width as usize, height as usize);
    check_size(width, height, expected)?;
    let size = reader.output_buffer_size().ok_or_else(|| ImageFault::damaged("its size overflows"))?;
    let mut pixels = vec![0; size];
    let frame = reader.next_frame(&mut pixels).map_err(ImageFault::damaged)?;
    // Reads on to the end marker: a file cut behind its last row is refused, too.
    reader.finish().map_err(ImageFault::damaged)?;
    let channels = frame.color_type.samples();
    let samples = match frame.bit_depth {
        png::BitDepth::Sixteen => {
            let values: Vec<u16> = pixels.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect();
            Samples::U16(three_channels(values, channels))
        }
        _ => Samples::U8(three_channels(pixels, channels)),
    };
    Ok(DecodedImage { width, height, samples })
}

/// Repeats grey, drops alpha, and passes RGB through without a copy.
fn three_channels<T: Copy>(values: Vec<T>, channels: usize) -> Vec<T> {
    match channels {
        1 => values.iter().flat_map(|&grey| [grey; 3]).collect(),
        2 => values.chunks_exact(2).flat_map(|texel| [texel[0]; 3]).collect(),
        4 => values.chunks_exact(4).flat_map(|texel| [texel[0], texel[1], texel[2]]).collect(),
        _ => values,
    }
}

fn decode_jpg(bytes: &[u8], expected: Option<(usize, usize)>) -> Result<DecodedImage, ImageFault> {
    check_jpg_ends(bytes)?;
    let options = DecoderOptions::default().set_strict_mode(true).jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(ImageFault::damaged)?;
    let (width, height) = decoder.dimensions().ok_or_else(|| ImageFault::damaged("it has no size"))?;
    check_size(width, height, expected)?;
    let pixels = decoder.decode().map_err(ImageFault::damaged)?;
    let channels = pixels.len() / (width * height);
    if !(1..=4).contains(&channels) || pixels.len() != channels * width * height {
        return Err(ImageFault::damaged("its number of channels is not supported"));
    }
    Ok(DecodedImage { width, height, samples: Samples::U8(three_channels(pixels, channels)) })
}

/// Walks the segments of a JPEG and demands the end marker: a decoder fills the rows of a cut file
/// with grey [ITU-T T.81, B.1].
fn check_jpg_ends(bytes: &[u8]) -> Result<(), ImageFault> {
    const END_OF_IMAGE: u8 = 0xD9;
    let cut = || ImageFault::damaged("the file ends before the end-of-image marker");
    if !bytes.starts_with(&[0xFF, 0xD8]) {
        return Err(ImageFault::damaged("it does not start like a JPEG"));
    }
    let mut at = 2;
    loop {
        // Find the next marker: 0xFF followed by neither another 0xFF (fill) nor 0 (a stuffed
        // byte of the scan) nor a restart marker.
        let offset = bytes[at..].iter().position(|&byte| byte == 0xFF).ok_or_else(cut)?;
        at += offset + 1;
        let marker = *bytes.get(at).ok_or_else(cut)?;
        match marker {
            0xFF => continue,
            0 | 0x01 | 0xD0..=0xD8 => at += 1,
            END_OF_IMAGE => return Ok(()),
            _ => {
                let length = bytes.get(at + 1..at + 3).ok_or_else(cut)?;
                let length = usize::from(u16::from_be_bytes([length[0], length[1]]));
                // A scan's data follows its header, and the search above walks over it.
                at += 1 + length.max(2);
                if at > bytes.len() {
                    return Err(cut());
                }
            }
        }
    }
}

/// Encodes 8-bit RGB `[texel, channel]` as png or jpg.
pub(crate) fn encode_8_bit(pixels: &[u8], width: usize, height: usize, format: ImageFormat) -> Result<Vec<u8>, String> {
    let (columns, rows) = (width as u32, height as u32);
    let colour = image::ExtendedColorType::Rgb8;
    let mut bytes = Vec::with_capacity(pixels.len() / 2 + 1024);
    let done = match format {
        // A fixed filter and the fast compressor: thousands of images go by, so speed before size.
        ImageFormat::Png => PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Sub)
            .write_image(pixels, columns, rows, colour),
        _ => JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY).write_image(pixels, columns, rows, colour),
    };
    done.map_err(|error| error.to_string())?;
    Ok(bytes)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A picture with structure in both axes and all channels.
    pub(crate) fn picture(width: usize, height: usize) -> Vec<u8> {
        (0..width * height)
            .flat_map(|i| {
                let (x, y) = (i % width, i / width);
                [(x * 255 / width) as u8, (y * 255 / height) as u8, ((x * 7 + y * 13) % 256) as u8]
            })
            .collect()
    }

    fn samples_u8(image: DecodedImage) -> Vec<u8> {
        match image.samples {
            Samples::U8(values) => values,
            other => panic!("not 8-bit: {other:?}"),
        }
    }

    #[test]
    fn png_comes_back_bit_for_bit_and_jpg_nearly() {
        let pixels = picture(32, 24);
        let png = encode_8_bit(&pixels, 32, 24, ImageFormat::Png).unwrap();
        let image = decode(&png, FileFormat::Png, Some((32, 24))).unwrap();
        assert_eq!((image.width, image.height), (32, 24));
        assert_eq!(samples_u8(image), pixels);
        let jpg = encode_8_bit(&pixels, 32, 24, ImageFormat::Jpg).unwrap();
        let back = samples_u8(decode(&jpg, FileFormat::Jpg, Some((32, 24))).unwrap());
        let worst = pixels.iter().zip(&back).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        assert!(worst > 0 && worst < 60, "{worst}");
    }

    #[test]
    fn every_prefix_of_a_png_and_of_a_jpg_is_refused() {
        let pixels = picture(24, 24);
        for (format, file) in [(ImageFormat::Png, FileFormat::Png), (ImageFormat::Jpg, FileFormat::Jpg)] {
            let bytes = encode_8_bit(&pixels, 24, 24, format).unwrap();
            for length in 0..bytes.len() {
                assert!(decode(&bytes[..length], file, None).is_err(), "{format} prefix of {length}");
            }
            assert!(decode(&bytes, file, None).is_ok());
        }
    }

    #[test]
    fn a_flipped_bit_anywhere_in_a_png_is_refused_or_harmless() {
        let pixels = picture(16, 16);
        let bytes = encode_8_bit(&pixels, 16, 16, ImageFormat::Png).unwrap();
        for position in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[position] ^= 0x10;
            if let Ok(image) = decode(&damaged, FileFormat::Png, Some((16, 16))) {
                assert_eq!(samples_u8(image), pixels, "byte {position} changed the pixels unseen");
            }
        }
    }

    #[test]
    fn another_size_is_refused_from_the_header() {
        let bytes = encode_8_bit(&picture(16, 8), 16, 8, ImageFormat::Png).unwrap();
        assert_eq!(
            decode(&bytes, FileFormat::Png, Some((8, 16))).unwrap_err(),
            ImageFault::WrongSize { width: 16, height: 8 }
        );
    }

    #[test]
    fn a_png_that_claims_billions_of_texels_is_refused_before_allocating() {
        let mut bytes = encode_8_bit(&picture(4, 4), 4, 4, ImageFormat::Png).unwrap();
        // Width and height stand at bytes 16..24 of every PNG; without the right checksum the
        // claim is refused even earlier, so the checksum is left wrong on purpose.
        bytes[16..24].copy_from_slice(&[0x7F, 0xFF, 0xFF, 0xFF, 0x7F, 0xFF, 0xFF, 0xFF]);
        assert!(decode(&bytes, FileFormat::Png, None).is_err());
        assert!(check_size(1 << 20, 1 << 20, None).is_err());
        assert!(check_size(usize::MAX, 2, None).is_err());
        assert!(check_size(0, 7, None).is_err());
    }

    #[test]
    fn grey_alpha_and_16_bit_pngs_are_read() {
        use image::ExtendedColorType as Colour;
        let encode = |data: &[u8], colour| {
            let mut bytes = Vec::new();
            PngEncoder::new(&mut bytes).write_image(data, 2, 1, colour).unwrap();
            decode(&bytes, FileFormat::Png, Some((2, 1))).unwrap()
        };
        assert_eq!(samples_u8(encode(&[7, 9], Colour::L8)), [7, 7, 7, 9, 9, 9]);
        assert_eq!(samples_u8(encode(&[7, 255, 9, 255], Colour::La8)), [7, 7, 7, 9, 9, 9]);
        assert_eq!(samples_u8(encode(&[1, 2, 3, 255, 4, 5, 6, 255], Colour::Rgba8)), [1, 2, 3, 4, 5, 6]);
        let wide: Vec<u8> = [1u16, 2, 3, 400, 500, 600].iter().flat_map(|v| v.to_ne_bytes()).collect();
        match encode(&wide, Colour::Rgb16).samples {
            Samples::U16(values) => assert_eq!(values, [1, 2, 3, 400, 500, 600]),
            other => panic!("{other:?}"),
        }
    }
}
