//! Textures as PNG files.

use crate::error::FitError;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

/// Encodes 8-bit samples of 3 or 4 channels, row by row.
///
/// # Errors
/// If the picture is larger than PNG allows.
pub fn png(size: [usize; 2], channels: usize, samples: &[u8]) -> Result<Vec<u8>, FitError> {
    let mut bytes = Vec::new();
    let colours = if channels == 4 { ExtendedColorType::Rgba8 } else { ExtendedColorType::Rgb8 };
    PngEncoder::new(&mut bytes)
        .write_image(samples, size[0] as u32, size[1] as u32, colours)
        .map_err(|error| FitError::Params(format!("a texture could not be encoded as PNG ({error})")))?;
    Ok(bytes)
}

/// Returns the nearest byte of a number from 0 to 1.
pub fn byte(x: f32) -> u8 {
    // The cast saturates.
    (255.0 * x + 0.5) as u8
}

/// Returns the number from 0 to 1 that a byte stands for.
pub fn number(byte: u8) -> f32 {
    f32::from(byte) / 255.0
}
