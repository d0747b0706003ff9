//! Number encodings. Twin: `numeric/quantize.wgsl`.

use half::f16;

/// Decodes a lobe weight: `scale (q / 255)^2`, so that small weights keep their relative precision.
///
/// Error: at most half a step, `scale (2 q + 1) / 255^2 / 2`; relative about `1 / q`, so below 2 % from 4 % of the
/// scale up and below 1 % from 16 % up.
pub fn weight_from_byte(q: u32, scale: f32) -> f32 {
    let x = q as f32 * (1.0 / 255.0);
    scale * x * x
}

/// Returns the byte whose decoded weight is nearest to `weight`; 0 for a negative weight.
pub fn byte_from_weight(weight: f32, scale: f32) -> u8 {
    if scale.is_nan() || scale <= 0.0 || weight <= 0.0 {
        return 0;
    }
    let guess = ((weight / scale).sqrt() * 255.0).clamp(0.0, 255.0) as u32;
    let error = |q: u32| (weight_from_byte(q, scale) - weight).abs();
    if guess < 255 && error(guess + 1) < error(guess) { (guess + 1) as u8 } else { guess as u8 }
}

/// Decodes a residual coefficient from the low byte of `byte`, which is two's complement. The unit is the step of the
/// coefficient.
pub fn coefficient_from_byte(byte: u32) -> f32 {
    f32::from(byte as u8 as i8)
}

/// Returns the low (`slot` 0) or high (`slot` 1) half-precision number of a word.
pub fn half_at(word: u32, slot: u32) -> f32 {
    f16::from_bits((word >> (16 * slot)) as u16).to_f32()
}

/// Packs two numbers as half precision into one word, `a` in the low half.
pub fn word_from_halves(a: f32, b: f32) -> u32 {
    u32::from(f16::from_f32(a).to_bits()) | u32::from(f16::from_f32(b).to_bits()) << 16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_weight_survives_its_byte_within_half_a_step() {
        for i in 0..=1000 {
            let weight = i as f32 / 1000.0 * 3.0;
            let q = byte_from_weight(weight, 3.0);
            let step = 3.0 * (2.0 * f32::from(q) + 1.0) / (255.0 * 255.0);
            assert!((weight_from_byte(q.into(), 3.0) - weight).abs() <= 0.5 * step + 1e-6, "weight {weight}");
        }
    }

    #[test]
    fn a_coefficients_byte_is_twos_complement() {
        for (byte, value) in [(0u32, 0.0), (1, 1.0), (127, 127.0), (0x81, -127.0), (0xff, -1.0)] {
            assert_eq!(coefficient_from_byte(byte), value);
        }
    }
}
