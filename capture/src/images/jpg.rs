//! JPEG images.

use image::ImageEncoder;
use image::codecs::jpeg::JpegEncoder;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::images::decoded::{DecodedImage, ImageFault, Samples, check_size, three_channels};

/// Quality of written JPEGs, 1 to 100.
const JPEG_QUALITY: u8 = 95;

pub(crate) fn decode(bytes: &[u8], expected: Option<(usize, usize)>) -> Result<DecodedImage, ImageFault> {
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
    Ok(DecodedImage::rgb(width, height, Samples::U8(three_channels(pixels, channels))))
}

/// Checks that a JPEG has its end marker, by a walk over its segments. A decoder would fill the rows of a cut file with
/// grey [ITU-T T.81, B.1].
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

/// Encodes 8-bit RGB `[texel, channel]`.
pub(crate) fn encode(pixels: &[u8], width: usize, height: usize) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::with_capacity(pixels.len() / 2 + 1024);
    JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY)
        .write_image(pixels, width as u32, height as u32, image::ExtendedColorType::Rgb8)
        .map_err(|error| error.to_string())?;
    Ok(bytes)
}
