//! Errors of fitting, expanding and comparing.

use std::path::PathBuf;
use thiserror::Error;

/// Reason why a fit, an expansion or a comparison stopped. Each message is one sentence with its remedy.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FitError {
    /// A capture that is not usable.
    #[error(transparent)]
    Capture(#[from] btf_capture::CaptureError),
    /// An asset that is not usable.
    #[error("{path}: {source}")]
    Asset {
        /// Path of the asset's file.
        path: PathBuf,
        /// Fault that the runtime found in the asset.
        source: btf_runtime::FormatError,
    },
    /// A validated file with errors.
    #[error("{path} is not valid: {errors} {}, the first {first}", if *.errors == 1 { "error" } else { "errors" })]
    Invalid {
        /// Path of the file.
        path: PathBuf,
        /// Number of errors.
        errors: usize,
        /// The first error, with its remedy.
        first: String,
    },
    /// An asset that was built and breaks a rule of the format.
    #[error(transparent)]
    Pack(#[from] btf_runtime::FormatError),
    /// A volumetric texture's file that is not usable.
    #[error("{path}: {source}")]
    Volume {
        /// Path of the file.
        path: PathBuf,
        /// Fault that the runtime found in the volume.
        source: btf_runtime::voltex::VoltexError,
    },
    /// A volume that was built and breaks a rule of its format.
    #[error(transparent)]
    PackVolume(#[from] btf_runtime::voltex::VoltexError),
    /// A file that could not be read or written.
    #[error("{path}: {action} failed ({source}); {remedy}")]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Action that failed, as a participle: "reading the asset".
        action: &'static str,
        /// Error of the operating system.
        source: std::io::Error,
        /// Remedy, as a clause.
        remedy: &'static str,
    },
    /// A volumetric texture that cannot be built or measured.
    #[error(transparent)]
    Voxelize(btf_voxelize::VoxelizeError),
    /// Options that do not go together or are out of range.
    #[error("{0}")]
    Params(String),
    /// A memory limit below what the capture needs.
    #[error(
        "--memory {given} is too little for this capture: it needs at least {needed} (one block of texels and the features of all texels); raise --memory"
    )]
    Memory {
        /// The limit in words, as `500 MB`.
        given: String,
        /// The least limit that suffices, in words.
        needed: String,
    },
    /// A sample that the residual's curve cannot hold.
    #[error("{path} has the value {value:e}, and assets made with this --error hold at most {most}; {remedy}")]
    TooBright {
        /// Name of the image.
        path: String,
        /// The sample that is too bright.
        value: f32,
        /// Largest sample that the curve can hold.
        most: f32,
        /// Remedy, as a clause.
        remedy: &'static str,
    },
    /// A plan of a library, or a material of one, that is not usable.
    #[error("{0}")]
    Library(String),
    /// A folder of finished stages that another fit works in.
    #[error("{folder} is in use by another run of btf-fit; wait until it has ended or write another asset")]
    InUse {
        /// The folder.
        folder: PathBuf,
    },
    /// A goal of `--bytes` or `--psnr` that no setting reaches.
    #[error("{0}")]
    Budget(String),
    /// Captures of one asset that do not fit each other.
    #[error("{path}: {reason}; the captures of one asset must share one texel grid and differ in their sides")]
    Layers {
        /// Path of an image of the capture that does not fit.
        path: PathBuf,
        /// Difference from the other captures.
        reason: String,
    },
    /// Interruption by Ctrl-C.
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
