//! Errors of building and measuring volumetric textures.

use std::path::{Path, PathBuf};
use thiserror::Error;

/// Reason why no volumetric texture was built or measured. Each message is one sentence with its remedy.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum VoxelizeError {
    /// A model of which no volume can be made. Remedy: as the message says.
    #[error("{0}")]
    Model(String),
    /// A mesh, a leaf or a script of shapes that cannot be read.
    #[error(transparent)]
    Input(#[from] btf_models::ModelError),
    /// An asset that a material points at and that is not usable.
    #[error("{path}: {source}")]
    Asset {
        /// Path of the asset's file.
        path: PathBuf,
        /// Fault that the runtime found.
        source: btf_runtime::FormatError,
    },
    /// A volume that was built and breaks a rule of its format.
    #[error(transparent)]
    Pack(#[from] btf_runtime::voltex::VoltexError),
    /// A file that could not be read.
    #[error("{path}: {action} failed ({source}); {remedy}")]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Action that failed, as a participle.
        action: &'static str,
        /// Error of the operating system.
        source: std::io::Error,
        /// Remedy, as a clause.
        remedy: &'static str,
    },
    /// Interruption by the caller.
    #[error("interrupted; nothing was written")]
    Interrupted,
}

impl VoxelizeError {
    /// Names the model's file in a message that is about the model.
    pub fn of_model(self, path: &Path) -> VoxelizeError {
        match self {
            VoxelizeError::Model(reason) => VoxelizeError::Model(format!("{}: {reason}", path.display())),
            other => other,
        }
    }
}
