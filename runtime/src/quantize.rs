//! Bit widths and number encodings. Twin: `shaders/quantize.wgsl`.

use half::f16;

/// Lobe weight from its byte: `scale (q / 255)^2`, so that small weights keep their relative precision.
///
/// Error: at most half a step, `scale (2 q + 1) / 255^2 / 2`; relative about `1 / q`, so below 2 % from 4 % of
/// the scale up and below 1 % from 16 % up.
pub fn weight_from_byte(q: u32, scale: f32) -> f32 {
    let x = q as f32 / 255.0;
    scale * x * x
}

/// The byte whose decoded weight is nearest to `weight` (0 for negative ones).
pub fn byte_from_weight(weight: f32, scale: f32) -> u8 {
    if scale.is_nan() || scale <= 0.0 || weight <= 0.0 {
        return 0;
    }
    let guess = ((weight / scale).sqrt() * 255.0).clamp(0.0, 255.0) as u32;
    let error = |q: u32| (weight_from_byte(q, scale) - weight).abs();
    if guess < 255 && error(guess + 1) < error(guess) { (guess + 1) as u8 } else { guess as u8 }
}

/// Residual coefficient in units of its step, from its stored code of `bits` bits: mid-rise, zero-mean,
/// `code - 2^(bits-1) + 1/2`.
pub fn coefficient_from_code(code: u32, bits: u32) -> f32 {
    code as f32 - (1u32 << (bits - 1)) as f32 + 0.5
}

/// The code whose decoded coefficient is nearest to `value / step`.
pub fn code_from_coefficient(value: f32, step: f32, bits: u32) -> u8 {
    let half_range = (1u32 << (bits - 1)) as f32;
    ((value / step).floor() + half_range).clamp(0.0, 2.0 * half_range - 1.0) as u8
}

/// The low or high half-precision number of a word (`slot` 0 or 1).
pub fn half_at(word: u32, slot: u32) -> f32 {
    f16::from_bits((word >> (16 * slot)) as u16).to_f32()
}

/// Two numbers as half precision in one word, `a` in the low half.
pub fn word_from_halves(a: f32, b: f32) -> u32 {
    u32::from(f16::from_f32(a).to_bits()) | u32::from(f16::from_f32(b).to_bits()) << 16
}

/// Coefficient codes packed `bits` at a time, lowest bits first; no code straddles a word.
///
/// `bits`: 2, 3, 4, 5, 6 or 8; `32 / bits` (rounded down) codes a word.
pub fn words_from_codes(codes: &[u8], bits: u32) -> Vec<u32> {
    let per_word = (32 / bits) as usize;
    codes
        .chunks(per_word)
        .map(|chunk| chunk.iter().enumerate().fold(0, |word, (i, code)| word | u32::from(*code) << (i as u32 * bits)))
        .collect()
}

/// The code number `index` of a plane packed by [`words_from_codes`].
pub fn code_at(words: &[u32], index: usize, bits: u32) -> u32 {
    let per_word = (32 / bits) as usize;
    words[index / per_word] >> ((index % per_word) as u32 * bits) & ((1 << bits) - 1)
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
    fn codes_survive_packing_at_every_width() {
        for bits in [2, 3, 4, 5, 6, 8] {
            let codes: Vec<u8> = (0..77u32).map(|i| (i * 37 % (1 << bits)) as u8).collect();
            let words = words_from_codes(&codes, bits);
            for (i, code) in codes.iter().enumerate() {
                assert_eq!(code_at(&words, i, bits), u32::from(*code), "{bits} bits, code {i}");
            }
            // Planted difference: a neighbour's width reads something else.
            let other = if bits == 8 { 6 } else { 8 };
            assert!((0..19).any(|i| code_at(&words, i, other) != u32::from(codes[i])));
        }
    }

    #[test]
    fn a_coefficient_is_decoded_within_half_a_step() {
        for bits in [2, 4, 8] {
            let reach = (1u32 << (bits - 1)) as f32;
            for i in -100..=100 {
                let value = i as f32 / 100.0 * (reach - 0.01);
                let code = code_from_coefficient(value, 1.0, bits);
                assert!((coefficient_from_code(code.into(), bits) - value).abs() <= 0.5 + 1e-4);
            }
        }
    }
}
