//! Corrections of photographs before they are reflectance: black level, flat field, exposures merged to one image, texels that
//! are masked out, the order of the rows.

use crate::colour::transfer::Transfer;
use crate::images::decoded::{DecodedImage, Samples};

/// Share of the largest file value from which on a sample counts as saturated, for files of 8 and 16 bits.
pub(crate) const SATURATION: f32 = 0.98;
/// Least difference between flat field and black level, of linear values.
pub(crate) const MIN_FLAT: f32 = 1e-4;

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
    /// Turns the rows and fills masked texels, in place.
    pub fn place(&self, image: &mut DecodedImage) {
        let width = image.width;
        match &mut image.samples {
            Samples::U8(values) => self.place_values(values, width),
            Samples::U16(values) => self.place_values(values, width),
            Samples::F32(values) | Samples::Computed(values) => self.place_values(values, width),
        }
    }

    fn place_values<T: Copy>(&self, values: &mut [T], width: usize) {
        if self.rows_up {
            let rows = values.len() / (3 * width);
            for row in 0..rows / 2 {
                let (upper, lower) = values.split_at_mut((rows - 1 - row) * 3 * width);
                upper[row * 3 * width..][..3 * width].swap_with_slice(&mut lower[..3 * width]);
            }
        }
        for (texel, from) in self.stand_ins.iter().flatten().enumerate() {
            let from = *from as usize;
            if from != texel {
                values.copy_within(3 * from..3 * from + 3, 3 * texel);
            }
        }
    }

    /// Merges shots of one pair, each with its exposure, to linear values `[texel, channel]` of exposure 1.
    ///
    /// Of each sample those shots count that are not saturated: the sum of their light over the sum of their exposures, which
    /// has the least noise where photons are counted. Where all are saturated the shortest exposure counts, and the value is
    /// too low.
    pub fn merge(&self, shots: &[(DecodedImage, f32)], transfer: Transfer) -> Vec<f32> {
        let count = shots.first().map_or(0, |(image, _)| linear(image, transfer).len());
        let mut light = vec![0.0f32; count];
        let mut time = vec![0.0f32; count];
        let mut shortest: Option<(Vec<f32>, f32)> = None;
        for (image, exposure) in shots {
            let mut values = linear(image, transfer);
            if let Some(black) = &self.black {
                values.iter_mut().zip(black).for_each(|(x, black)| *x -= black);
            }
            for (i, x) in values.iter().enumerate().filter(|(i, _)| !self.is_saturated(image, *i)) {
                light[i] += x;
                time[i] += exposure;
            }
            if shortest.as_ref().is_none_or(|(_, least)| exposure < least) {
                shortest = Some((values, *exposure));
            }
        }
        if let Some((values, exposure)) = shortest {
            for (i, x) in values.iter().enumerate().filter(|(i, _)| time[*i] == 0.0).collect::<Vec<_>>() {
                (light[i], time[i]) = (*x, exposure);
            }
        }
        light.iter_mut().zip(&time).for_each(|(light, time)| *light /= time);
        if let Some(flat) = &self.flat {
            light.iter_mut().zip(flat).for_each(|(x, flat)| *x /= flat);
        }
        // Noise below the black level; a sample that is no number is told by who reads it.
        light.iter_mut().filter(|x| **x < 0.0).for_each(|x| *x = 0.0);
        light
    }

    fn is_saturated(&self, image: &DecodedImage, i: usize) -> bool {
        let bits = self.saturation.unwrap_or(SATURATION);
        match &image.samples {
            Samples::U8(values) => f32::from(values[i]) >= 255.0 * bits,
            Samples::U16(values) => f32::from(values[i]) >= 65535.0 * bits,
            Samples::F32(values) | Samples::Computed(values) => {
                self.saturation.is_some_and(|saturation| values[i] >= saturation)
            }
        }
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
        DecodedImage { width: 2, height: 2, samples }
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
        let merged = corrections.merge(&[shot(1.0), shot(0.125), shot(8.0)], Transfer::Linear);
        for (merged, light) in merged.iter().zip(&light) {
            assert!((merged - light).abs() < 0.01 * light, "{merged} {light}");
        }
        // The shortest exposure of all that are saturated; with one alone the brightest is cut.
        let one = corrections.merge(&[shot(1.0)], Transfer::Linear);
        assert!((one[11] - 0.99).abs() < 1e-3 && light[11] > 2.0, "{}", one[11]);
        // Planted: saturated samples that count.
        let blind = Corrections { saturation: Some(2.0), ..corrections };
        let wrong = blind.merge(&[shot(1.0), shot(0.125), shot(8.0)], Transfer::Linear);
        assert!(wrong[11] < 0.5 * light[11], "{}", wrong[11]);
    }

    #[test]
    fn a_flat_field_takes_the_lens_out() {
        let vignette = [1.0, 0.5, 0.25, 0.8];
        let codes: Vec<f32> = vignette.iter().flat_map(|v| [0.1 * v, 0.2 * v, 0.4 * v]).collect();
        let flat = Some(vignette.iter().flat_map(|v| [*v; 3]).collect());
        let corrections = Corrections { flat, ..Corrections::default() };
        let merged = corrections.merge(&[(image(Samples::F32(codes)), 1.0)], Transfer::Linear);
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
