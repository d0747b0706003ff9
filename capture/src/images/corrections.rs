//! Corrections of photographs before they are reflectance: black level, flat field, exposures merged to one image, texels that
//! are masked out, the order of the rows.

use crate::colour::transfer::Transfer;
use crate::images::decoded::{DecodedImage, MIN_LINEAR, Samples};

/// Share of the largest file value from which on a sample counts as saturated, for files of 8 and 16 bits.
pub(crate) const SATURATION: f32 = 0.98;
/// Least difference between flat field and black level, of linear values.
pub(crate) const MIN_FLAT: f32 = 1e-4;

/// The light of a photograph.
#[derive(Debug, Clone)]
pub(crate) struct Light {
    /// Linear values, `[texel, channel]`, of the photograph's exposure.
    pub values: Vec<f32>,
    /// Which of them are not saturated.
    pub valid: Vec<bool>,
    /// Exposure, above 0.
    pub exposure: f32,
}

/// How the images of a capture are corrected.
#[derive(Debug, Clone, Default)]
pub(crate) struct Corrections {
    /// Whether the files' first row is the lowest.
    pub rows_up: bool,
    /// Linear value of no light, `[texel, channel]`.
    pub black: Option<Vec<f32>>,
    /// Linear value of a white target less the black level, `[texel, channel]`, at least [`MIN_FLAT`].
    pub flat: Option<Vec<f32>>,
    /// For each texel the one whose samples stand for it: itself, or the nearest that is not masked out.
    pub stand_ins: Option<Vec<u32>>,
    /// File value, as a share of the largest, from which on a sample is saturated; of linear files the value itself.
    pub saturation: Option<f32>,
}

impl Corrections {
    /// Turns the rows and fills masked texels of file values, in place.
    pub fn place(&self, image: &mut DecodedImage) {
        self.turn(image);
        let channels = image.channels;
        match &mut image.samples {
            Samples::U8(values) => self.fill(values, channels),
            Samples::U16(values) => self.fill(values, channels),
            Samples::F32(values) | Samples::Computed(values) => self.fill(values, channels),
        }
    }

    /// Turns the rows of a file, in place.
    pub fn turn(&self, image: &mut DecodedImage) {
        let row = image.channels * image.width;
        match &mut image.samples {
            _ if !self.rows_up => {}
            Samples::U8(values) => turn_rows(values, row),
            Samples::U16(values) => turn_rows(values, row),
            Samples::F32(values) | Samples::Computed(values) => turn_rows(values, row),
        }
    }

    fn fill<T: Copy>(&self, values: &mut [T], channels: usize) {
        for (texel, from) in self.stand_ins.iter().flatten().enumerate() {
            let from = *from as usize;
            if from != texel {
                values.copy_within(channels * from..channels * (from + 1), channels * texel);
            }
        }
    }

    /// Returns the light of a file whose rows are turned, less the black level and over the flat field.
    pub fn light(&self, image: &DecodedImage, transfer: Transfer, exposure: f32) -> Light {
        let mut values = linear(image, transfer);
        if let Some(black) = &self.black {
            values.iter_mut().zip(black).for_each(|(x, black)| *x -= black);
        }
        if let Some(flat) = &self.flat {
            values.iter_mut().zip(flat).for_each(|(x, flat)| *x /= flat);
        }
        let valid = (0..values.len()).map(|i| !self.is_saturated(image, i)).collect();
        Light { values, valid, exposure }
    }

    /// Merges the light of a pair's photographs, the shortest exposure first, to linear values `[texel, channel]` of exposure 1.
    ///
    /// Of each sample those count that are not saturated: the sum of their light over the sum of their exposures, which has the
    /// least noise where photons are counted. Where all are saturated the shortest exposure counts, and the value is too low.
    pub fn merge(&self, shots: &[Light]) -> Vec<f32> {
        let Some(shortest) = shots.first() else { return Vec::new() };
        let mut merged: Vec<f32> = (0..shortest.values.len())
            .map(|i| {
                let (mut light, mut time) = (0.0, 0.0);
                for shot in shots.iter().filter(|shot| shot.valid[i]) {
                    light += shot.values[i];
                    time += shot.exposure;
                }
                let value = if time > 0.0 { light / time } else { shortest.values[i] / shortest.exposure };
                // Noise below the black level; a sample that is no number is told by who reads it.
                if value < MIN_LINEAR { MIN_LINEAR } else { value }
            })
            .collect();
        self.fill(&mut merged, 3);
        merged
    }

    fn is_saturated(&self, image: &DecodedImage, i: usize) -> bool {
        let share = self.saturation.unwrap_or(SATURATION);
        match &image.samples {
            Samples::U8(values) => f32::from(values[i]) >= 255.0 * share,
            Samples::U16(values) => f32::from(values[i]) >= 65535.0 * share,
            Samples::F32(values) | Samples::Computed(values) => {
                self.saturation.is_some_and(|saturation| values[i] >= saturation)
            }
        }
    }
}

fn turn_rows<T>(values: &mut [T], row: usize) {
    let rows = values.len() / row;
    for number in 0..rows / 2 {
        let (upper, lower) = values.split_at_mut((rows - 1 - number) * row);
        upper[number * row..][..row].swap_with_slice(&mut lower[..row]);
    }
}

/// Returns the linear file values of an image.
pub(crate) fn linear(image: &DecodedImage, transfer: Transfer) -> Vec<f32> {
    match &image.samples {
        Samples::U8(values) => {
            let table: Vec<f32> =
                (0..=255u8).map(|value| transfer.linear_from_encoded(f32::from(value) / 255.0)).collect();
            values.iter().map(|value| table[usize::from(*value)]).collect()
        }
        Samples::U16(values) => {
            values.iter().map(|value| transfer.linear_from_encoded(f32::from(*value) / 65535.0)).collect()
        }
        Samples::F32(values) | Samples::Computed(values) => values.clone(),
    }
}

/// Returns for each texel the nearest one that is `valid`, in steps along rows and columns; `None` if none is.
pub(crate) fn nearest_valid(valid: &[bool], width: usize) -> Option<Vec<u32>> {
    let mut found: Vec<Option<u32>> =
        valid.iter().enumerate().map(|(texel, valid)| valid.then_some(texel as u32)).collect();
    let mut front: Vec<usize> = (0..valid.len()).filter(|texel| valid[*texel]).collect();
    while !front.is_empty() {
        let mut next = Vec::new();
        for texel in front {
            let (column, row) = (texel % width, texel / width);
            let left = (column > 0).then(|| texel - 1);
            let right = (column + 1 < width).then_some(texel + 1);
            let above = (row > 0).then(|| texel - width);
            let below = (texel + width < valid.len()).then_some(texel + width);
            for other in [left, right, above, below].into_iter().flatten() {
                if found[other].is_none() {
                    found[other] = found[texel];
                    next.push(other);
                }
            }
        }
        front = next;
    }
    found.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(samples: Samples) -> DecodedImage {
        DecodedImage::rgb(2, 2, samples)
    }

    #[test]
    fn exposures_merge_to_the_light_that_made_them() {
        // Light of 0.001 to 2 under exposures of 1, 1/8 and 8, 16 bits, with a black level.
        let light: Vec<f32> = (0..12).map(|i| 0.001 * 2f32.powi(i)).collect();
        let black = 0.01f32;
        let shot = |exposure: f32| {
            let codes = light.iter().map(|x| ((x * exposure + black).min(1.0) * 65535.0).round() as u16).collect();
            (image(Samples::U16(codes)), exposure)
        };
        let corrections = Corrections { black: Some(vec![black; 12]), ..Corrections::default() };
        let merge = |corrections: &Corrections, exposures: &[f32]| {
            let lit = |exposure: &f32| {
                let (image, exposure) = shot(*exposure);
                corrections.light(&image, Transfer::Linear, exposure)
            };
            corrections.merge(&exposures.iter().map(lit).collect::<Vec<_>>())
        };
        let merged = merge(&corrections, &[0.125, 1.0, 8.0]);
        for (merged, light) in merged.iter().zip(&light) {
            assert!((merged - light).abs() < 0.01 * light, "{merged} {light}");
        }
        // The shortest exposure of all that are saturated; with one alone the brightest is cut.
        let one = merge(&corrections, &[1.0]);
        assert!((one[11] - 0.99).abs() < 1e-3 && light[11] > 2.0, "{}", one[11]);
        // Planted: saturated samples that count.
        let blind = Corrections { saturation: Some(2.0), ..corrections.clone() };
        let wrong = merge(&blind, &[0.125, 1.0, 8.0]);
        assert!(wrong[11] < 0.5 * light[11], "{}", wrong[11]);
    }

    #[test]
    fn a_flat_field_takes_the_lens_out() {
        let vignette = [1.0, 0.5, 0.25, 0.8];
        let codes: Vec<f32> = vignette.iter().flat_map(|v| [0.1 * v, 0.2 * v, 0.4 * v]).collect();
        let flat = Some(vignette.iter().flat_map(|v| [*v; 3]).collect());
        let corrections = Corrections { flat, ..Corrections::default() };
        let merged = corrections.merge(&[corrections.light(&image(Samples::F32(codes)), Transfer::Linear, 1.0)]);
        assert!(merged.chunks_exact(3).all(|rgb| (rgb[0] - 0.1).abs() < 1e-6 && (rgb[2] - 0.4).abs() < 1e-6));
    }

    #[test]
    fn rows_are_turned_and_masked_texels_have_their_neighbours_values() {
        let values: Vec<u8> = (0..12).collect();
        let mut turned = image(Samples::U8(values.clone()));
        Corrections { rows_up: true, ..Corrections::default() }.place(&mut turned);
        let Samples::U8(found) = turned.samples else { panic!("8 bits stay") };
        assert_eq!(found, [6, 7, 8, 9, 10, 11, 0, 1, 2, 3, 4, 5]);
        let stand_ins = nearest_valid(&[true, false, false, false], 2).unwrap();
        assert_eq!(stand_ins, [0; 4]);
        let mut filled = image(Samples::U8(values));
        Corrections { stand_ins: Some(stand_ins), ..Corrections::default() }.place(&mut filled);
        let Samples::U8(found) = filled.samples else { panic!("8 bits stay") };
        assert_eq!(found, [0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2]);
        assert_eq!(nearest_valid(&[false; 4], 2), None);
    }
}
