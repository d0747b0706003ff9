//! Failures of commands.

use btf_synth::SynthError;

/// Reason why the program ends with an error.
pub(super) enum Failure {
    /// Wrong usage.
    Usage(String),
    /// Bad input, or the work failed.
    Failed(String),
    /// Ctrl-C.
    Interrupted,
}

impl From<SynthError> for Failure {
    fn from(error: SynthError) -> Failure {
        match error {
            SynthError::BadParameter { .. } => Failure::Usage(error.to_string()),
            SynthError::Stopped => Failure::Interrupted,
            other => Failure::Failed(other.to_string()),
        }
    }
}
