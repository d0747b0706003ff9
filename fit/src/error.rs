//! Everything that can go wrong while fitting, expanding or comparing.

use std::path::PathBuf;
use thiserror::Error;

/// Why a fit, an expansion or a comparison stopped. Each message is one sentence with its remedy.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FitError {
    /// The capture is not usable.
    #[error(transparent)]
    Capture(#[from] btf_capture::CaptureError),
    /// An asset is not usable.
    #[error("{path}: {source}")]
    Asset {
        /// The asset's file.
        path: PathBuf,
        /// What is wrong with it.
        source: btf_runtime::FormatError,
    },
    /// A validated file has errors.
    #[error("{path} is not valid: {errors} {}, the first {first}", if *.errors == 1 { "error" } else { "errors" })]
    Invalid {
        /// The file.
        path: PathBuf,
        /// How many there are.
        errors: usize,
        /// The first, with its remedy.
        first: String,
    },
    /// The asset that was built breaks a rule of the format.
    #[error(transparent)]
    Pack(#[from] btf_runtime::FormatError),
    /// A volumetric texture's file is not usable.
    #[error("{path}: {source}")]
    Volume {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: btf_runtime::voltex::VoltexError,
    },
    /// The volume that was built breaks a rule of its format.
    #[error(transparent)]
    PackVolume(#[from] btf_runtime::voltex::VoltexError),
    /// A file could not be read or written.
    #[error("{path}: {action} failed ({source}); {remedy}")]
    File {
        /// The file.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// What the system said.
        source: std::io::Error,
        /// What helps.
        remedy: &'static str,
    },
    /// A volumetric texture that cannot be built or measured.
    #[error(transparent)]
    Voxelize(btf_voxelize::VoxelizeError),
    /// Options that do not go together or are out of range.
    #[error("{0}")]
    Params(String),
    /// The memory limit is below what the capture needs.
    #[error(
        "--memory {given} is too little for this capture: it needs at least {needed} (one block of texels and the features of all texels); raise --memory"
    )]
    Memory {
        /// The limit, in words.
        given: String,
        /// The least that works, in words.
        needed: String,
    },
    /// A sample that the residual's curve cannot hold.
    #[error("{path} has the value {value:e}, and assets made with this --error hold at most {most}; {remedy}")]
    TooBright {
        /// The image.
        path: String,
        /// Its sample.
        value: f32,
        /// The largest that fits.
        most: f32,
        /// What helps.
        remedy: &'static str,
    },
    /// No setting reaches what `--bytes` or `--psnr` asked for.
    #[error("{0}")]
    Budget(String),
    /// The captures of one asset do not fit each other.
    #[error("{path}: {reason}; the captures of one asset must share one texel grid and differ in their sides")]
    Layers {
        /// The capture that does not fit.
        path: PathBuf,
        /// What differs.
        reason: String,
    },
    /// Ctrl-C.
    #[error("interrupted; nothing was written")]
    Interrupted,
}

impl From<btf_voxelize::VoxelizeError> for FitError {
    fn from(error: btf_voxelize::VoxelizeError) -> FitError {
        match error {
            btf_voxelize::VoxelizeError::Interrupted => FitError::Interrupted,
            other => FitError::Voxelize(other),
        }
    }
}
