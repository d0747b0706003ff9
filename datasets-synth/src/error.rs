//! Errors of making captures and measuring models, each one sentence with its remedy.

use btf_capture::CaptureError;

/// Reason why no capture was made. `Display` is one plain sentence.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SynthError {
    /// A parameter out of its range.
    #[error("{name} is {value}, which is out of range; give {allowed}")]
    BadParameter {
        /// Name of the parameter, as on the command line where it has an option.
        name: &'static str,
        /// Value that was given.
        value: String,
        /// Allowed range.
        allowed: String,
    },
    /// Stop at the caller's request; nothing was left behind.
    #[error("stopped before the capture was complete; nothing was written")]
    Stopped,
    /// A description or textures of a leaf, or a script of shapes, that cannot be used.
    #[error(transparent)]
    Model(#[from] btf_models::ModelError),
    /// A table of spectra that cannot be used.
    #[error("{path} cannot be used as spectra: {reason}")]
    BadSpectra {
        /// The file.
        path: String,
        /// What is wrong, as a clause with its remedy.
        reason: String,
    },
    /// A capture that could not be written.
    #[error(transparent)]
    Capture(#[from] CaptureError),
}

/// Refuses a number outside of a range, and NaN, by the name of the parameter.
pub(crate) fn check_range(name: &'static str, value: f64, low: f64, high: f64) -> Result<(), SynthError> {
    // Not `<`, so that a NaN is refused, too.
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(SynthError::BadParameter { name, value: value.to_string(), allowed: format!("a number from {low} to {high}") })
}

/// Refuses the first of some numbers that is out of its range. Each is `(name, number, least, most)`.
pub(crate) fn check_ranges(ranges: &[(&'static str, f64, f64, f64)]) -> Result<(), SynthError> {
    ranges.iter().try_for_each(|&(name, value, low, high)| check_range(name, value, low, high))
}
