//! The error that a fit minimises where none was asked for.

use crate::error::FitError;
use crate::input::brightness::Brightness;
use crate::params::{ErrorMeasure, ValidFitParams};
use btf_capture::Capture;

/// Ratio of mean to logarithmic mean from which on the relative error is minimised, where samples are above white.
///
/// In 200 kB a brushed metal has 51.3 dB and a relative RMSE of 0.0253 so, and with the error of gamma-encoded values 39.2
/// dB and 0.0266; a bright stone, whose mean is less than three times the logarithmic one, 22.3 dB and 0.261, and 23.1 dB
/// and 0.188 (docs/results/results.md).
const MIN_MEAN_OVER_LOG_MEAN: f64 = 3.0;
/// Largest sample from which on the relative error is minimised, in units of white: the metal's is 86. Leaves, whose largest
/// is 1.9 to 5.1, have up to 2.2 times the relative RMSE with the relative error, and are worse by all other measures, too.
const MIN_LARGEST: f32 = 10.0;

/// Returns `params` with the error to minimise chosen from the captures, if they leave it open: relative where a capture
/// holds values far above white that the log curve can hold and spans orders of magnitude, else that of gamma-encoded
/// values. Cost: a read of at most 64 linear images of each capture.
///
/// # Errors
/// If an image cannot be read.
pub fn with_chosen_error(captures: &[Capture], params: &ValidFitParams) -> Result<ValidFitParams, FitError> {
    if params.asked().error.is_some() {
        return Ok(params.clone());
    }
    let mut error = ErrorMeasure::Gamma;
    for capture in captures {
        let read = |view, light| Ok(capture.read(view, light)?);
        if Brightness::of_capture(capture.info(), &read)?.is_some_and(|found| spans_much(&found, capture.info().scale))
        {
            error = ErrorMeasure::Log;
        }
    }
    Ok(params.with_error(error))
}

fn spans_much(brightness: &Brightness, white: f32) -> bool {
    brightness.is_above_white()
        && brightness.largest >= MIN_LARGEST * white
        && brightness.mean > MIN_MEAN_OVER_LOG_MEAN * brightness.log_mean
        // Images that were not looked at may be brighter.
        && brightness.largest < 0.25 * ErrorMeasure::Log.most()
}
