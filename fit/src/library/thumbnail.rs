//! A thumbnail of an asset: three shapes under a lamp and a weaker light from the other side.

use crate::error::FitError;
use crate::library::shapes::Shape;
use btf_capture::Transfer;
use btf_runtime::{DecodeOptions, Interpolation, Query, Resident, evaluate_many};
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;

/// Width and height of a shape's picture in pixels.
pub const SHAPE_PIXELS: usize = 72;
/// Places within a pixel that are seen, in each of x and y: what a sharp texture needs to be recognised.
const PLACES: usize = 2;
/// Quality of the JPEG: 4 to 6 kB for the three shapes.
const JPEG_QUALITY: u8 = 80;
/// Directions to the lights, x to the right, y up, z to the eye, with the share of each.
const LIGHTS: [([f32; 3], f32); 2] = [([-0.48, 0.56, 0.676], 1.0), ([0.75, -0.15, 0.644], 0.25)];
/// Colour beside the shapes, linear.
const BACKGROUND: f32 = 0.8;

/// Draws the thumbnail of `resident`: a JPEG of `3 x SHAPE_PIXELS` by `SHAPE_PIXELS` pixels. A material that only lets light
/// through is lit from behind.
///
/// # Errors
/// [`FitError::Library`] if the picture cannot be encoded.
///
/// Cost: 120,000 evaluations at most, a tenth of a second.
pub fn thumbnail(resident: &Resident) -> Result<Vec<u8>, FitError> {
    let pixels = draw(resident);
    let mut bytes = Vec::new();
    let (width, height) = (Shape::ALL.len() * SHAPE_PIXELS, SHAPE_PIXELS);
    JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY)
        .encode(&pixels, width as u32, height as u32, ExtendedColorType::Rgb8)
        .map_err(|error| {
            FitError::Library(format!("a thumbnail could not be encoded ({error}); please report this"))
        })?;
    Ok(bytes)
}

/// Returns 8-bit sRGB pixels `[row, column, channel]`.
fn draw(resident: &Resident) -> Vec<u8> {
    let options = DecodeOptions { interpolation: Interpolation::Fast, ..DecodeOptions::default() };
    let behind = !has_reflection(resident);
    let mut pixels = Vec::with_capacity(3 * SHAPE_PIXELS * SHAPE_PIXELS * Shape::ALL.len());
    let (mut queries, mut values) = (Vec::new(), Vec::new());
    for row in 0..SHAPE_PIXELS {
        for shape in Shape::ALL {
            queries.clear();
            let mut covered = [0usize; SHAPE_PIXELS];
            for (column, covered) in covered.iter_mut().enumerate() {
                for place in 0..PLACES * PLACES {
                    let at = |pixel: usize, part: usize| {
                        2.0 * (pixel as f32 + (part as f32 + 0.5) / PLACES as f32) / SHAPE_PIXELS as f32 - 1.0
                    };
                    let Some(point) = shape.point([at(column, place % PLACES), -at(row, place / PLACES)]) else {
                        continue;
                    };
                    *covered += 1;
                    let wo = point.local([0.0, 0.0, 1.0]);
                    queries.extend(LIGHTS.iter().map(|(light, _)| {
                        let [x, y, z] = point.local(*light);
                        Query { uv: point.uv, wi: if behind { [x, y, -z] } else { [x, y, z] }, wo }
                    }));
                }
            }
            values.resize(queries.len(), [0.0; 3]);
            evaluate_many(resident, 0, &queries, &options, &mut values);
            let mut next = values.chunks_exact(LIGHTS.len());
            for covered in covered {
                let mut sum = [BACKGROUND * (PLACES * PLACES - covered) as f32; 3];
                for lit in next.by_ref().take(covered) {
                    for (value, (_, share)) in lit.iter().zip(LIGHTS) {
                        (0..3).for_each(|channel| sum[channel] += share * value[channel]);
                    }
                }
                pixels.extend(sum.map(|sum| {
                    let encoded = Transfer::Srgb.encoded_from_linear((sum / (PLACES * PLACES) as f32).clamp(0.0, 1.0));
                    (255.0 * encoded).round() as u8
                }));
            }
        }
    }
    pixels
}

/// Returns whether the material has a layer that reflects light on its front.
pub(crate) fn has_reflection(resident: &Resident) -> bool {
    use btf_runtime::SurfaceSide::Front;
    resident.layer_for_sides(0, Front, Front).is_some()
}
