//! Exit codes of the program, and reasons why a command did not succeed.

use btf_capture::CaptureError;
use btf_fit::FitError;
use std::process::ExitCode;

/// Exit code of the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Exit {
    Success = 0,
    Failure = 1,
    Usage = 2,
    /// Interrupted: 128 + SIGINT, as shells count.
    Interrupted = 130,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> ExitCode {
        ExitCode::from(exit as u8)
    }
}

/// Reason why a command did not succeed; its text follows `error: `.
#[derive(Debug, thiserror::Error)]
pub(super) enum Failure {
    /// Options that do not go together or are out of range.
    #[error("{0}")]
    Usage(String),
    #[error("{0}")]
    Path(String),
    #[error("interrupted; run the same command again to go on after the last finished stage")]
    Suspended,
    #[error(transparent)]
    Fit(#[from] FitError),
}

impl From<CaptureError> for Failure {
    fn from(error: CaptureError) -> Failure {
        Failure::Fit(error.into())
    }
}

impl From<btf_voxelize::VoxelizeError> for Failure {
    fn from(error: btf_voxelize::VoxelizeError) -> Failure {
        Failure::Fit(error.into())
    }
}

impl Failure {
    pub(super) fn exit(&self) -> Exit {
        match self {
            Failure::Usage(_) => Exit::Usage,
            Failure::Suspended | Failure::Fit(FitError::Interrupted) => Exit::Interrupted,
            Failure::Path(_) | Failure::Fit(_) => Exit::Failure,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_failure_has_its_exit_code() {
        assert_eq!(Failure::Usage(String::new()).exit() as u8, 2);
        assert_eq!(Failure::Path(String::new()).exit() as u8, 1);
        assert_eq!(Failure::Suspended.exit() as u8, 130);
        assert_eq!(Failure::from(FitError::Interrupted).exit() as u8, 130);
        assert_eq!(Failure::from(FitError::Params(String::new())).exit() as u8, 1);
    }
}
