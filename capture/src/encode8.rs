//! Fast rounding of linear values to 8-bit file values, equal to the slow definition for every
//! input.

use crate::colour::Transfer;
use crate::info::{CaptureInfo, file_linear, round_to_8_bits};

/// Number of cells of the first-guess table over file values in [0, 1]. 4096 cells leave at most
/// three steps of the sRGB curve (slope 12.92) in one cell.
const CELLS: usize = 4096;

/// Encodes many linear values as 8-bit file values: [`CaptureInfo::encoded8_from_linear`] by
/// table, several times faster because no power is taken. Build one per capture and share it between threads.
#[derive(Debug, Clone)]
pub struct Encoder8 {
    /// `thresholds[v]`: the smallest linear file value that is stored as at least `v + 1`; NaN for
    /// the last, which nothing reaches.
    thresholds: [f32; 256],
    /// The stored value at the lower edge of each cell.
    first_guess: Vec<u8>,
    /// Per light: factor from file values to reflectance x cosine.
    factors: Vec<f32>,
}

impl Encoder8 {
    /// The encoder of a capture's files.
    pub fn new(info: &CaptureInfo) -> Encoder8 {
        let mut thresholds = [f32::NAN; 256];
        for value in 0..255u8 {
            thresholds[value as usize] = smallest_stored_above(info.transfer, value);
        }
        let first_guess = (0..CELLS).map(|cell| encode(info.transfer, cell as f32 / CELLS as f32)).collect();
        let factors = (0..info.lights.len()).map(|light| info.linear_factor(light)).collect();
        Encoder8 { thresholds, first_guess, factors }
    }

    /// The 8-bit file value of reflectance x cosine `linear` under light `light`; equal to
    /// [`CaptureInfo::encoded8_from_linear`].
    #[inline]
    pub fn encode(&self, light: usize, linear: f32) -> u8 {
        self.encode_file_value(file_linear(linear, self.factors[light]))
    }

    /// [`Encoder8::encode`] over a slice; `encoded` and `linear` have one length.
    ///
    /// # Panics
    /// If the lengths differ.
    pub fn encode_slice(&self, light: usize, linear: &[f32], encoded: &mut [u8]) {
        assert_eq!(linear.len(), encoded.len(), "one 8-bit value per linear value");
        let factor = self.factors[light];
        for (encoded, &linear) in encoded.iter_mut().zip(linear) {
            *encoded = self.encode_file_value(file_linear(linear, factor));
        }
    }

    #[inline]
    fn encode_file_value(&self, file_value: f32) -> u8 {
        // `as` maps NaN and negatives to cell 0, where the loop below ends at once.
        let cell = ((file_value * CELLS as f32) as usize).min(CELLS - 1);
        let mut value = self.first_guess[cell];
        while file_value >= self.thresholds[value as usize] {
            value += 1;
        }
        value
    }
}

fn encode(transfer: Transfer, file_value: f32) -> u8 {
    round_to_8_bits(255.0 * transfer.encoded_from_linear(file_value))
}

/// The smallest float that is stored above `value`, by bisection over the bit patterns of
/// [0, 2], which order like the floats themselves.
fn smallest_stored_above(transfer: Transfer, value: u8) -> f32 {
    let (mut low, mut high) = (0u32, 2f32.to_bits());
    while low + 1 < high {
        let middle = low + (high - low) / 2;
        if encode(transfer, f32::from_bits(middle)) > value { high = middle } else { low = middle }
    }
    f32::from_bits(high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Cosine, DirectionSet, ImageFormat};

    #[test]
    fn the_table_equals_the_definition_everywhere_and_at_every_threshold() {
        let set = DirectionSet::bonn81();
        let base = CaptureInfo::new("test", 1, 1, set.clone(), set, ImageFormat::Png);
        for transfer in [Transfer::Srgb, Transfer::Gamma(2.2), Transfer::Gamma(0.5), Transfer::Linear] {
            let info = CaptureInfo { transfer, cosine: Cosine::Excluded, scale: 1.3, ..base.clone() };
            let encoder = Encoder8::new(&info);
            let mut values: Vec<f32> = (0..60_000).map(|i| i as f32 * 2.5e-5 - 0.1).collect();
            for t in &encoder.thresholds[..255] {
                let linear = t * info.linear_factor(70);
                values.extend([linear.next_down(), linear, linear.next_up()]);
            }
            values.extend([f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30, -0.0]);
            for light in [0, 70] {
                for &linear in &values {
                    let slow = info.encoded8_from_linear(light, linear);
                    assert_eq!(encoder.encode(light, linear), slow, "{transfer} {linear}");
                }
            }
            let mut encoded = vec![0; values.len()];
            encoder.encode_slice(70, &values, &mut encoded);
            assert!(values.iter().zip(&encoded).all(|(&x, &e)| e == encoder.encode(70, x)));
        }
    }
}
