//! PNG images: 8 and 16 bits, grey or RGB, with or without alpha.

use std::io::Cursor;

use image::ImageEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};

use crate::images::decoded::{DecodedImage, ImageFault, MAX_TEXELS, Samples, check_size, three_channels};

pub(crate) fn decode(bytes: &[u8], expected: Option<(usize, usize)>) -> Result<DecodedImage, ImageFault> {
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
    Ok(DecodedImage::rgb(width, height, samples))
}

/// Encodes 8-bit RGB `[texel, channel]`.
pub(crate) fn encode(pixels: &[u8], width: usize, height: usize) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::with_capacity(pixels.len() / 2 + 1024);
    // A fixed filter and the fast compressor: thousands of images go by, so speed before size.
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Sub)
        .write_image(pixels, width as u32, height as u32, image::ExtendedColorType::Rgb8)
        .map_err(|error| error.to_string())?;
    Ok(bytes)
}
