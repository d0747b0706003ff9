//! Everything that can go wrong while a volumetric texture is built or measured.

use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why no volumetric texture was built or measured. Each message is one sentence with its remedy.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum VoxelizeError {
    /// A model of which no volume can be made. Remedy: as the message says.
    #[error("{0}")]
    Model(String),
    /// A mesh, a leaf or a script of shapes cannot be read.
    #[error(transparent)]
    Input(#[from] btf_models::ModelError),
    /// An asset that a material points at is not usable.
    #[error("{path}: {source}")]
    Asset {
        /// The asset's file.
        path: PathBuf,
        /// What is wrong with it.
        source: btf_runtime::FormatError,
    },
    /// The volume that was built breaks a rule of its format.
    #[error(transparent)]
    Pack(#[from] btf_runtime::voltex::VoltexError),
    /// A file could not be read.
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
    /// The caller asked to stop.
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
