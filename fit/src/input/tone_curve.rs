//! Tone curve by which a capture brighter than white, or very dark, is judged: `psnr_db` and `delta_e00_mean` are of 8-bit
//! values, which would all be 255 above 1 and 0 below a three-thousandth.

use crate::error::FitError;
use crate::input::brightness::Brightness;
use crate::resume::stored::stored_structs;
use btf_capture::{CaptureInfo, Pixels};
use serde::{Deserialize, Serialize};

/// Display value of the logarithmic mean of a capture.
const KEY: f64 = 0.18;
/// A largest sample below this share of white asks for a tone curve, too.
const MIN_LARGEST: f32 = 0.05;

/// Reinhard's global tone curve [reinhard2002, eq. 4], channel by channel: `L (1 + L / W^2) / (1 + L)` with
/// `L = exposure x` and `W = exposure white`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ToneCurve {
    /// Factor in front of the curve: 0.18 over the logarithmic mean of the capture's samples.
    pub exposure: f32,
    /// Smallest linear value that is shown as white: the largest of the samples that were looked at.
    pub white: f32,
}

stored_structs! {
    ToneCurve { exposure, white }
}

impl ToneCurve {
    /// Returns the curve of a capture, or `None` where 8-bit values show it: where its files hold such values, or where at
    /// most one sample in a thousand is above white, the capture's `scale`, and the largest is at least a twentieth of
    /// it. Cost: a read of 64 images at most.
    ///
    /// # Errors
    /// If an image cannot be read.
    pub fn of_capture(
        info: &CaptureInfo,
        read: &(dyn Fn(usize, usize) -> Result<Pixels, FitError> + Sync),
    ) -> Result<Option<ToneCurve>, FitError> {
        let Some(brightness) = Brightness::of_capture(info, read)? else { return Ok(None) };
        let shown = !brightness.is_above_white() && brightness.largest >= MIN_LARGEST * info.scale;
        Ok((!shown).then_some(ToneCurve { exposure: (KEY / brightness.log_mean) as f32, white: brightness.largest }))
    }

    /// Replaces linear values by display values, 0 to 1 and linear for an sRGB display; 1 above `white`.
    pub fn apply(&self, values: &mut [f32]) {
        let per_white_square = 1.0 / (self.exposure * self.white).powi(2);
        for value in values {
            let l = (self.exposure * *value).clamp(0.0, self.exposure * self.white);
            *value = l * (1.0 + l * per_white_square) / (1.0 + l);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_leads_from_black_to_white_and_shows_the_mean_as_middle_grey() {
        let curve = ToneCurve { exposure: 0.18 / 0.5, white: 80.0 };
        let mut values = [-0.1, 0.0, 0.5, 5.0, 40.0, 80.0, 300.0];
        curve.apply(&mut values);
        assert!(values.is_sorted() && values[..2] == [0.0, 0.0] && values[5..] == [values[5]; 2], "{values:?}");
        assert!((values[5] - 1.0).abs() < 1e-6 && (values[2] - 0.18 / 1.18).abs() < 1e-3, "{values:?}");
        // The curve by hand: L = 1.8, W = 28.8.
        assert!((f64::from(values[3]) - 1.8 * (1.0 + 1.8 / 829.44) / 2.8).abs() < 1e-6, "{values:?}");
    }
}
