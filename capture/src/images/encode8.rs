//! Rounds linear values to 8-bit file values fast, with the results of the slow definition for every input.

use crate::colour::transfer::Transfer;
use crate::info::{CaptureInfo, file_linear, round_to_8_bits};

/// Encoder of many linear values as 8-bit file values. It gives the results of [`CaptureInfo::encoded8_from_linear`] by
/// a table, several times faster because it takes no power. Build one encoder per capture and share it between threads.
#[derive(Debug, Clone)]
pub struct Encoder8 {
    /// Cells of equal relative width over the floats from just below the smallest threshold to the largest. At most two
    /// 8-bit values meet in a cell. The upper 8 bits hold the value at its lower edge, the others the distance, in
    /// floats, from there to the next value.
    cells: Vec<u32>,
    /// Bits of the first and the last float that has a cell of its own.
    range: [u32; 2],
    /// Number of low bits of a float that do not affect its cell.
    shift: u32,
    /// Factor from file values to reflectance x cosine, per light.
    factors: Vec<f32>,
}

impl Encoder8 {
    /// Returns the encoder of a capture's files.
    pub fn new(info: &CaptureInfo) -> Encoder8 {
        // Bits of the smallest float that is stored above each value; floats order like their bits.
        let mut thresholds = [u32::MAX; 256];
        for value in 0..255u8 {
            thresholds[value as usize] = smallest_stored_above(info.transfer, value).to_bits();
        }
        let range = [thresholds[0] - 1, thresholds[254]];
        // Eight bits behind the exponent separate the values of every curve that is steepest at 0.
        let cell_of = |bits: u32, shift: u32| (bits - range[0]) >> shift;
        let apart =
            |shift: &u32| thresholds[..255].windows(2).all(|pair| cell_of(pair[0], *shift) < cell_of(pair[1], *shift));
        let shift = (8..=15).rev().find(apart).unwrap_or(8);
        let mut value = 0u32;
        let cells = (0..=cell_of(range[1], shift)).map(|cell| {
            let least = range[0] + (cell << shift);
            while least > thresholds[value as usize] {
                value += 1;
            }
            value << 24 | (thresholds[value as usize] - least).min(1 << shift)
        });
        let cells = cells.collect();
        let factors = (0..info.lights.len()).map(|light| info.linear_factor(light)).collect();
        Encoder8 { cells, range, shift, factors }
    }

    /// Returns the 8-bit file value of reflectance x cosine `linear` under light `light`, equal to
    /// [`CaptureInfo::encoded8_from_linear`].
    #[inline]
    pub fn encode(&self, light: usize, linear: f32) -> u8 {
        self.encode_file_value(file_linear(linear, self.factors[light]))
    }

    /// Encodes a slice by [`Encoder8::encode`].
    ///
    /// # Panics
    /// If the lengths differ.
    #[inline(always)]
    pub fn encode_slice(&self, light: usize, linear: &[f32], encoded: &mut [u8]) {
        assert_eq!(linear.len(), encoded.len(), "one 8-bit value per linear value");
        let factor = self.factors[light];
        for (encoded, &linear) in encoded.iter_mut().zip(linear) {
            *encoded = self.encode_file_value(file_linear(linear, factor));
        }
    }

    /// Looks up one file value. The code has no branch, because the branch predictor cannot foresee a decoded image.
    #[inline(always)]
    fn encode_file_value(&self, file_value: f32) -> u8 {
        // As a comparison, NaN becomes 0.
        let file_value = if file_value > 0.0 { file_value } else { 0.0 };
        let at = file_value.to_bits().clamp(self.range[0], self.range[1]) - self.range[0];
        // Always there; said so that the loop can run in vectors.
        let cell = self.cells.get((at >> self.shift) as usize).copied().unwrap_or(0);
        let within = at & ((1 << self.shift) - 1);
        ((cell >> 24) + u32::from(within >= cell & 0x00ff_ffff)) as u8
    }
}

fn encode(transfer: Transfer, file_value: f32) -> u8 {
    round_to_8_bits(255.0 * transfer.encoded_from_linear(file_value))
}

/// Returns the smallest float that is stored above `value`, by bisection over the bit patterns of [0, 2], which order
/// like the floats themselves.
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
        for transfer in
            [Transfer::Gamma(7.0), Transfer::Srgb, Transfer::Gamma(2.2), Transfer::Gamma(0.5), Transfer::Linear]
        {
            let info = CaptureInfo { transfer, cosine: Cosine::Excluded, scale: 1.3, ..base.clone() };
            let encoder = Encoder8::new(&info);
            let mut values: Vec<f32> = (0..60_000).map(|i| i as f32 * 2.5e-5 - 0.1).collect();
            for value in 0..255 {
                let linear = smallest_stored_above(transfer, value) * info.linear_factor(70);
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
