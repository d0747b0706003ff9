//! Decodes and encodes one image file of any format.
//!
//! Decoders are strict: an image whose file ends early or whose checksums fail is refused, never
//! filled up with grey. JPEG has no checksum, so a JPEG damaged inside, its end intact, is seen
//! only where the damage makes no valid code.

use crate::images::bands::BandReading;
use crate::images::decoded::{DecodedImage, ImageFault, Samples};
use crate::images::{envi, exr, jpg, png, radiance, tiff};
use crate::info::ImageFormat;

/// Format of an image file, told by its extension, and of `.hdr` by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FileFormat {
    Png,
    Jpg,
    /// OpenEXR, with RGB or one channel per wavelength.
    Exr,
    /// Radiance picture.
    Hdr,
    /// TIFF, with RGB, grey or bands.
    Tiff,
    /// Header of an ENVI image, whose numbers are in a file beside it.
    Envi,
}

impl FileFormat {
    /// Returns the format that a file name extension stands for, in any case; `None` for other extensions. See
    /// [`FileFormat::of_bytes`] for `.hdr`.
    pub(crate) fn from_extension(extension: &str) -> Option<FileFormat> {
        if extension.eq_ignore_ascii_case("hdr") {
            return Some(FileFormat::Hdr);
        }
        if extension.eq_ignore_ascii_case("tif") || extension.eq_ignore_ascii_case("tiff") {
            return Some(FileFormat::Tiff);
        }
        ImageFormat::from_extension(extension).map(|format| match format {
            ImageFormat::Png => FileFormat::Png,
            ImageFormat::Jpg => FileFormat::Jpg,
            ImageFormat::Exr => FileFormat::Exr,
        })
    }

    /// Returns the format of a file that its name says to be of this one: Radiance pictures and the headers of ENVI
    /// images have one extension.
    pub(crate) fn of_bytes(self, bytes: &[u8]) -> FileFormat {
        if self == FileFormat::Hdr && envi::is_header(bytes) { FileFormat::Envi } else { self }
    }

    /// Returns whether files may have a band for each of many wavelengths.
    pub(crate) fn is_spectral(self) -> bool {
        matches!(self, FileFormat::Exr | FileFormat::Tiff | FileFormat::Envi)
    }

    /// Returns the format in which a capture of such files with such samples would be written.
    pub(crate) fn written_as(self, samples: &Samples) -> ImageFormat {
        match (self, samples) {
            (FileFormat::Png, _) | (FileFormat::Tiff, Samples::U8(_) | Samples::U16(_)) => ImageFormat::Png,
            (FileFormat::Jpg, _) => ImageFormat::Jpg,
            (FileFormat::Exr | FileFormat::Hdr | FileFormat::Tiff | FileFormat::Envi, _) => ImageFormat::Exr,
        }
    }
}

/// Decodes `bytes`, bands by `reading`. `beside` are the numbers beside the header of an ENVI image, else empty. If
/// `expected` is given, an image of another size is refused from its header.
pub(crate) fn decode(
    bytes: &[u8],
    beside: &[u8],
    format: FileFormat,
    expected: Option<(usize, usize)>,
    reading: BandReading,
) -> Result<DecodedImage, ImageFault> {
    if bytes.is_empty() {
        return Err(ImageFault::damaged("the file is empty"));
    }
    let image = match format {
        FileFormat::Png => png::decode(bytes, expected),
        FileFormat::Jpg => jpg::decode(bytes, expected),
        FileFormat::Exr => exr::decode(bytes, expected, reading.weighing),
        FileFormat::Hdr => radiance::decode(bytes, expected),
        FileFormat::Tiff => return tiff::decode(bytes, expected, reading),
        FileFormat::Envi => return envi::decode(&envi::Header::read(bytes)?, beside, expected, reading),
    }?;
    check_told(&image, reading.told_nm)?;
    Ok(image)
}

/// Checks that `capture.toml` tells no wavelengths of a file whose format names its channels, or those of the file.
fn check_told(image: &DecodedImage, told_nm: &[f64]) -> Result<(), ImageFault> {
    let mut told = told_nm.to_vec();
    told.sort_by(f64::total_cmp);
    if told.is_empty() || told == image.wavelengths_nm {
        return Ok(());
    }
    let has = match image.wavelengths_nm.len() {
        0 => "no bands".to_string(),
        bands => format!("{bands} bands with names of their own"),
    };
    Err(ImageFault::Unfit(format!(
        "has {has}, and `wavelengths_nm` in capture.toml has {} other numbers; remove that key",
        told.len()
    )))
}

/// Encodes 8-bit RGB `[texel, channel]` as png or jpg.
pub(crate) fn encode_8_bit(pixels: &[u8], width: usize, height: usize, format: ImageFormat) -> Result<Vec<u8>, String> {
    match format {
        ImageFormat::Png => png::encode(pixels, width, height),
        _ => jpg::encode(pixels, width, height),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::images::decoded::{Samples, check_size};
    use ::image::ImageEncoder;
    use ::image::codecs::png::PngEncoder;

    /// Returns an image with structure in both axes and all channels.
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
        let image = decode(&png, &[], FileFormat::Png, Some((32, 24)), BandReading::COLOUR).unwrap();
        assert_eq!((image.width, image.height), (32, 24));
        assert_eq!(samples_u8(image), pixels);
        let jpg = encode_8_bit(&pixels, 32, 24, ImageFormat::Jpg).unwrap();
        let back = samples_u8(decode(&jpg, &[], FileFormat::Jpg, Some((32, 24)), BandReading::COLOUR).unwrap());
        let worst = pixels.iter().zip(&back).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        assert!(worst > 0 && worst < 60, "{worst}");
    }

    #[test]
    fn every_prefix_of_a_png_and_of_a_jpg_is_refused() {
        let pixels = picture(24, 24);
        for (format, file) in [(ImageFormat::Png, FileFormat::Png), (ImageFormat::Jpg, FileFormat::Jpg)] {
            let bytes = encode_8_bit(&pixels, 24, 24, format).unwrap();
            for length in 0..bytes.len() {
                assert!(
                    decode(&bytes[..length], &[], file, None, BandReading::COLOUR).is_err(),
                    "{format} prefix of {length}"
                );
            }
            assert!(decode(&bytes, &[], file, None, BandReading::COLOUR).is_ok());
        }
    }

    #[test]
    fn a_flipped_bit_anywhere_in_a_png_is_refused_or_harmless() {
        let pixels = picture(16, 16);
        let bytes = encode_8_bit(&pixels, 16, 16, ImageFormat::Png).unwrap();
        for position in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[position] ^= 0x10;
            if let Ok(image) = decode(&damaged, &[], FileFormat::Png, Some((16, 16)), BandReading::COLOUR) {
                assert_eq!(samples_u8(image), pixels, "byte {position} changed the pixels unseen");
            }
        }
    }

    #[test]
    fn hdr_files_are_told_apart_by_their_first_bytes() {
        let hdr = FileFormat::from_extension("HDR").unwrap();
        assert_eq!(hdr.of_bytes(b"#?RADIANCE\n"), FileFormat::Hdr);
        for envi in [&b"ENVI"[..], b"ENVI\nsamples", b"ENVI \r\n"] {
            assert_eq!(hdr.of_bytes(envi), FileFormat::Envi);
            assert_eq!(FileFormat::Png.of_bytes(envi), FileFormat::Png);
        }
        assert_eq!(hdr.of_bytes(b"ENVIRONMENT"), FileFormat::Hdr);
        assert_eq!(FileFormat::from_extension("TIFF"), FileFormat::from_extension("tif"));
    }

    #[test]
    fn wavelengths_told_of_files_that_name_their_own_must_be_theirs() {
        use crate::images::exr::tests::spectral;
        let png = encode_8_bit(&picture(4, 3), 4, 3, ImageFormat::Png).unwrap();
        let exr = spectral(&["650", "450nm"], |_, _| 0.5);
        for (bytes, format, told_nm, part) in [
            (&png, FileFormat::Png, &[650.0, 550.0, 450.0][..], Some("has no bands")),
            (&exr, FileFormat::Exr, &[650.0], Some("2 bands with names of their own")),
            (&exr, FileFormat::Exr, &[650.0, 460.0], Some("2 other numbers; remove that key")),
            (&exr, FileFormat::Exr, &[650.0, 450.0], None),
        ] {
            let found = decode(bytes, &[], format, None, BandReading { told_nm, ..BandReading::COLOUR });
            match (found, part) {
                (Ok(_), None) => {}
                (Err(ImageFault::Unfit(reason)), Some(part)) => assert!(reason.contains(part), "{reason}"),
                (other, _) => panic!("{told_nm:?}: {other:?}"),
            }
        }
    }

    #[test]
    fn another_size_is_refused_from_the_header() {
        let bytes = encode_8_bit(&picture(16, 8), 16, 8, ImageFormat::Png).unwrap();
        assert_eq!(
            decode(&bytes, &[], FileFormat::Png, Some((8, 16)), BandReading::COLOUR).unwrap_err(),
            ImageFault::WrongSize { width: 16, height: 8 }
        );
    }

    #[test]
    fn a_png_that_claims_billions_of_texels_is_refused_before_allocating() {
        let mut bytes = encode_8_bit(&picture(4, 4), 4, 4, ImageFormat::Png).unwrap();
        // Width and height stand at bytes 16..24 of every PNG; without the right checksum the
        // claim is refused even earlier, so the checksum is left wrong on purpose.
        bytes[16..24].copy_from_slice(&[0x7F, 0xFF, 0xFF, 0xFF, 0x7F, 0xFF, 0xFF, 0xFF]);
        assert!(decode(&bytes, &[], FileFormat::Png, None, BandReading::COLOUR).is_err());
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
            decode(&bytes, &[], FileFormat::Png, Some((2, 1)), BandReading::COLOUR).unwrap()
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
