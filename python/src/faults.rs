//! Our errors as Python's: OSError for what the system refused, ValueError for all else, each one sentence.

use btf_capture::CaptureError;
use btf_fit::FitError;
use pyo3::PyErr;
use pyo3::exceptions::{PyOSError, PyValueError};

/// Makes a ValueError.
pub fn value_error(sentence: impl Into<String>) -> PyErr {
    PyValueError::new_err(sentence.into())
}

/// Makes the error of a capture.
pub fn capture_error(error: &CaptureError) -> PyErr {
    match error {
        CaptureError::Read { .. } | CaptureError::NotFound { .. } | CaptureError::Write { .. } => {
            PyOSError::new_err(error.to_string())
        }
        _ => value_error(error.to_string()),
    }
}

/// Makes the error of a fit or a measurement.
pub fn fit_error(error: &FitError) -> PyErr {
    match error {
        FitError::Capture(error) => capture_error(error),
        FitError::File { .. } => PyOSError::new_err(error.to_string()),
        // Options of the command line are keywords here.
        _ => value_error(error.to_string().replace("--", "")),
    }
}
