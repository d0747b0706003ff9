//! Error figures: what each one means, and how sums become figures.
//!
//! All are functions of [`ErrorSums`], which add up over blocks, pairs and layers. The 8-bit sums are
//! integers and the floating-point ones are added in a fixed order, so that a figure does not depend
//! on the number of threads.

use crate::input::tone_curve::ToneCurve;
use crate::resume::stored::stored_structs;
use serde::{Deserialize, Serialize};

/// Largest 8-bit value: the peak of `psnr_db`.
const PEAK_CODE: f64 = 255.0;

/// Error figures of a decoded asset against its capture. The names are the keys of `--json`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Metrics {
    /// Peak signal-to-noise ratio in dB of the 8-bit values that `expand` writes against the capture's,
    /// all texels, pairs and channels, peak 255. Infinite (null in JSON) where they are equal.
    ///
    /// Of a capture with linear images (EXR) both sides are encoded with the sRGB curve first, and before that mapped by
    /// `tone_curve`, where there is one.
    #[serde(with = "decibel")]
    pub psnr_db: f64,
    /// Peak signal-to-noise ratio in dB of linear reflectance x cosine; the peak is the capture's largest sample.
    #[serde(with = "decibel")]
    pub psnr_linear_db: f64,
    /// `sqrt(sum (x' - x)^2 / sum x^2)`, linear. Where the capture is black, `x` of the divisor and the peak above are
    /// 1.
    pub rel_rmse: f64,
    /// Largest root mean square error of one texel over its pairs and channels, linear.
    pub worst_texel_rmse: f64,
    /// Mean of the decoded linear samples over that of the capture's; 1 where the capture is black. Below 1 a decoder is
    /// too dark, which decibels hide. 0 in descriptions of assets that were written before there was such a figure.
    #[serde(default)]
    pub energy_ratio: f64,
    /// Mean colour difference CIEDE2000 of the 8-bit values taken as sRGB under D65, over all texels and
    /// the pairs that [`crate::colour_pair_stride`] picks; `None` where it was not computed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delta_e00_mean: Option<f64>,
    /// Tone curve in front of the 8-bit values of `psnr_db` and `delta_e00_mean`; only of a capture of which more than one
    /// sample in a thousand is above 1, or all are far below. Of several layers that of the first one that has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tone_curve: Option<ToneCurve>,
}

/// Serialises decibels: infinity is null in JSON.
mod decibel {
    use serde::{Deserialize, Deserializer, Serializer};

    pub(crate) fn serialize<S: Serializer>(db: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        if db.is_finite() { serializer.serialize_f64(*db) } else { serializer.serialize_none() }
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
    }
}

impl Metrics {
    /// Returns what `psnr_db` and `delta_e00_mean` are of, in words.
    pub fn coded_as(&self) -> &'static str {
        if self.tone_curve.is_some() { "tone-mapped 8-bit values" } else { "8-bit values" }
    }

    /// Returns the figures rounded as an asset's own description holds them: decibels to 4 decimals, the rest to 6
    /// significant digits.
    pub fn rounded(&self) -> Metrics {
        let decibels = |x: f64| if x.is_finite() { (x * 1e4).round() / 1e4 } else { x };
        let digits = |x: f64| format!("{x:.5e}").parse().unwrap_or(x);
        Metrics {
            psnr_db: decibels(self.psnr_db),
            psnr_linear_db: decibels(self.psnr_linear_db),
            rel_rmse: digits(self.rel_rmse),
            worst_texel_rmse: digits(self.worst_texel_rmse),
            energy_ratio: digits(self.energy_ratio),
            delta_e00_mean: self.delta_e00_mean.map(digits),
            tone_curve: self.tone_curve,
        }
    }
}

/// Sums from which [`Metrics`] are computed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ErrorSums {
    /// Samples: texels x pairs x 3 channels.
    pub samples: u64,
    /// Sum of squared differences of 8-bit values.
    pub code_error: u64,
    /// Sum of squared linear differences.
    pub linear_error: f64,
    /// Sum of squared linear samples of the capture.
    pub linear_square: f64,
    /// Sum of the linear samples of the capture.
    pub linear_sum: f64,
    /// Sum of the decoded linear samples.
    pub decoded_sum: f64,
    /// Largest linear sample of the capture.
    pub linear_peak: f64,
    /// Largest mean squared linear difference of one texel.
    pub worst_texel: f64,
    /// Sum of CIEDE2000 differences.
    pub delta_e00: f64,
    /// Number of colours whose differences `delta_e00` sums.
    pub colours: u64,
    /// Tone curve in front of 8-bit values.
    pub tone_curve: Option<ToneCurve>,
}

stored_structs! {
    ErrorSums {
        samples, code_error, linear_error, linear_square, linear_sum, decoded_sum, linear_peak, worst_texel, delta_e00,
        colours, tone_curve,
    }
}

impl ErrorSums {
    /// Adds the sums of another part or layer.
    pub fn add(&mut self, other: &ErrorSums) {
        self.samples += other.samples;
        self.code_error += other.code_error;
        self.linear_error += other.linear_error;
        self.linear_square += other.linear_square;
        self.linear_sum += other.linear_sum;
        self.decoded_sum += other.decoded_sum;
        self.linear_peak = self.linear_peak.max(other.linear_peak);
        self.worst_texel = self.worst_texel.max(other.worst_texel);
        self.delta_e00 += other.delta_e00;
        self.colours += other.colours;
        self.tone_curve = self.tone_curve.or(other.tone_curve);
    }

    /// Returns the figures of these sums.
    pub fn metrics(&self) -> Metrics {
        let samples = self.samples.max(1) as f64;
        // Where all is black, white takes the place of what errors are relative to.
        let (peak, square) =
            if self.linear_square > 0.0 { (self.linear_peak, self.linear_square) } else { (1.0, samples) };
        Metrics {
            psnr_db: psnr_db_from_codes(self.code_error, self.samples),
            psnr_linear_db: decibels(peak * peak, self.linear_error / samples),
            rel_rmse: if self.linear_error > 0.0 { (self.linear_error / square).sqrt() } else { 0.0 },
            worst_texel_rmse: self.worst_texel.sqrt(),
            energy_ratio: if self.linear_sum > 0.0 { self.decoded_sum / self.linear_sum } else { 1.0 },
            delta_e00_mean: (self.colours > 0).then(|| self.delta_e00 / self.colours as f64),
            tone_curve: self.tone_curve,
        }
    }
}

/// Returns `psnr_db` of a sum of squared differences of `samples` 8-bit values; infinite where the sum is 0.
pub fn psnr_db_from_codes(code_error: u64, samples: u64) -> f64 {
    decibels(PEAK_CODE * PEAK_CODE, code_error as f64 / samples.max(1) as f64)
}

fn decibels(peak_square: f64, mean_square: f64) -> f64 {
    if mean_square > 0.0 { 10.0 * (peak_square / mean_square).log10() } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sums() -> ErrorSums {
        ErrorSums {
            samples: 300,
            code_error: 300 * 25,
            linear_error: 3.0,
            linear_square: 48.0,
            linear_sum: 100.0,
            decoded_sum: 95.0,
            linear_peak: 2.0,
            worst_texel: 0.04,
            delta_e00: 30.0,
            colours: 100,
            tone_curve: None,
        }
    }

    #[test]
    fn figures_follow_their_definitions() {
        let metrics = sums().metrics();
        // An error of 5 in every sample: 20 log10(255 / 5).
        assert!((metrics.psnr_db - 34.1514).abs() < 1e-4, "{}", metrics.psnr_db);
        assert!((metrics.psnr_linear_db - 10.0 * (4.0f64 / 0.01).log10()).abs() < 1e-12);
        assert_eq!(metrics.rel_rmse, 0.25);
        assert!((metrics.worst_texel_rmse - 0.2).abs() < 1e-12);
        assert_eq!((metrics.delta_e00_mean, metrics.energy_ratio), (Some(0.3), 0.95));
        // Planted difference: one more step in one sample is seen.
        let other = ErrorSums { code_error: sums().code_error + 1, ..sums() };
        assert!(other.metrics().psnr_db < metrics.psnr_db);
    }

    #[test]
    fn two_layers_together_weigh_by_their_samples() {
        let mut both = sums();
        both.add(&ErrorSums { samples: 100, worst_texel: 0.09, linear_peak: 1.0, ..ErrorSums::default() });
        let metrics = both.metrics();
        assert!((metrics.psnr_db - psnr_db_from_codes(300 * 25, 400)).abs() < 1e-12);
        assert!((metrics.worst_texel_rmse - 0.3).abs() < 1e-12);
        assert_eq!(both.linear_peak, 2.0);
    }

    #[test]
    fn an_exact_copy_has_infinite_psnr_which_json_holds_as_null() {
        let exact = ErrorSums { samples: 3, linear_square: 1.0, linear_peak: 1.0, ..ErrorSums::default() }.metrics();
        assert_eq!((exact.psnr_db, exact.rel_rmse), (f64::INFINITY, 0.0));
        let black = ErrorSums { samples: 100, linear_error: 1e-4, ..ErrorSums::default() }.metrics();
        assert!((black.rel_rmse - 1e-3).abs() < 1e-12 && (black.psnr_linear_db - 60.0).abs() < 1e-9, "{black:?}");
        let text = serde_json::to_string(&exact).unwrap();
        assert!(text.contains("\"psnr_db\":null"), "{text}");
        assert_eq!(serde_json::from_str::<Metrics>(&text).unwrap(), exact);
    }

    #[test]
    fn rounded_figures_are_short_and_near() {
        let metrics = Metrics { rel_rmse: 0.123_456_789, psnr_db: 34.123_456_789, ..sums().metrics() };
        let rounded = metrics.rounded();
        assert_eq!((rounded.psnr_db, rounded.rel_rmse), (34.1235, 0.123457));
        assert_ne!(rounded, metrics);
    }
}
