//! Transfer curves, by which the numbers in an image file encode linear light.

use std::fmt;
use std::str::FromStr;

use crate::error::CaptureError;

/// Curve between encoded file values and linear light, both 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Transfer {
    /// The sRGB curve, IEC 61966-2-1 (two pieces).
    Srgb,
    /// A pure power: linear = encoded ^ exponent, exponent in [0.1, 10].
    Gamma(f32),
    /// No curve: the file holds linear values.
    Linear,
}

/// Slope of the linear piece of the sRGB curve near black [IEC 61966-2-1].
const SRGB_SLOPE: f32 = 12.92;
/// Encoded value at which the two pieces of the sRGB curve meet [IEC 61966-2-1].
const SRGB_KNEE_ENCODED: f32 = 0.04045;
/// Linear value at which the two pieces of the sRGB curve meet [IEC 61966-2-1].
const SRGB_KNEE_LINEAR: f32 = 0.003_130_8;

impl Transfer {
    /// Returns the linear light of an encoded value. `encoded` may exceed 1, where the curve continues.
    /// [`Transfer::Srgb`] and [`Transfer::Gamma`] clamp negatives to 0; [`Transfer::Linear`] keeps them.
    pub fn linear_from_encoded(self, encoded: f32) -> f32 {
        match self {
            Transfer::Linear => encoded,
            Transfer::Gamma(exponent) => encoded.max(0.0).powf(exponent),
            Transfer::Srgb => {
                let encoded = encoded.max(0.0);
                if encoded <= SRGB_KNEE_ENCODED { encoded / SRGB_SLOPE } else { ((encoded + 0.055) / 1.055).powf(2.4) }
            }
        }
    }

    /// Returns the encoded value of linear light, the inverse of [`Transfer::linear_from_encoded`] with the same
    /// treatment of negatives. The result is not clamped above.
    pub fn encoded_from_linear(self, linear: f32) -> f32 {
        match self {
            Transfer::Linear => linear,
            Transfer::Gamma(exponent) => linear.max(0.0).powf(1.0 / exponent),
            Transfer::Srgb => {
                let linear = linear.max(0.0);
                if linear <= SRGB_KNEE_LINEAR { linear * SRGB_SLOPE } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
            }
        }
    }
}

impl fmt::Display for Transfer {
    /// Writes `srgb`, `linear` or `gamma:2.2`, as in `capture.toml`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Transfer::Srgb => f.write_str("srgb"),
            Transfer::Linear => f.write_str("linear"),
            Transfer::Gamma(exponent) => write!(f, "gamma:{exponent}"),
        }
    }
}

impl FromStr for Transfer {
    type Err = CaptureError;

    /// Reads `srgb`, `linear` or `gamma:2.2`.
    fn from_str(word: &str) -> Result<Transfer, CaptureError> {
        match word {
            "srgb" => return Ok(Transfer::Srgb),
            "linear" => return Ok(Transfer::Linear),
            _ => {}
        }
        match word.strip_prefix("gamma:").and_then(|number| number.parse::<f32>().ok()) {
            Some(exponent) if (0.1..=10.0).contains(&exponent) => Ok(Transfer::Gamma(exponent)),
            _ => Err(CaptureError::BadWord {
                word: word.into(),
                what: "a transfer curve",
                allowed: "\"srgb\", \"linear\" or \"gamma:2.2\" (exponent 0.1 to 10)",
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_8_bit_value_survives_decoding_and_encoding() {
        for transfer in [Transfer::Srgb, Transfer::Gamma(2.2), Transfer::Linear] {
            for value in 0..=255u8 {
                let encoded = value as f32 / 255.0;
                let back = transfer.encoded_from_linear(transfer.linear_from_encoded(encoded));
                assert!((back - encoded).abs() < 2e-6, "{transfer} {value}: {back}");
            }
        }
    }

    #[test]
    fn srgb_agrees_with_the_standard_at_middle_grey() {
        // 0.5 encoded is 0.21404114 linear (IEC 61966-2-1 evaluated in double precision).
        assert!((Transfer::Srgb.linear_from_encoded(0.5) - 0.214_041_14).abs() < 1e-7);
        // A planted difference: the pure power 2.2 is another curve.
        assert!((Transfer::Gamma(2.2).linear_from_encoded(0.5) - 0.214_041_14).abs() > 1e-3);
    }

    #[test]
    fn names_are_read_back_and_nonsense_is_refused() {
        for transfer in [Transfer::Srgb, Transfer::Gamma(2.2), Transfer::Linear] {
            assert_eq!(transfer.to_string().parse::<Transfer>().unwrap(), transfer);
        }
        for word in ["gamma:0", "gamma:nan", "rec709", ""] {
            assert!(word.parse::<Transfer>().is_err(), "{word}");
        }
    }

    #[test]
    fn negatives_are_kept_only_without_a_curve() {
        assert_eq!(Transfer::Linear.linear_from_encoded(-0.05), -0.05);
        assert_eq!(Transfer::Srgb.encoded_from_linear(-0.05), 0.0);
        assert_eq!(Transfer::Gamma(2.2).encoded_from_linear(-0.05), 0.0);
    }
}
