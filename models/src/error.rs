//! Errors of reading and writing leaves, meshes and scripts of shapes, each one sentence with its remedy.

use btf_capture::CaptureError;
use std::path::{Path, PathBuf};

/// Reason why a leaf, a mesh or a script of shapes could not be read or written. `Display` is one plain sentence that
/// names the file and says what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A mesh file that cannot be used.
    #[error("{}: {reason}", path.display())]
    Mesh {
        /// The file.
        path: PathBuf,
        /// Fault and remedy.
        reason: String,
    },
    /// A description of a leaf, or a texture file or folder, that cannot be used.
    #[error("{} {fault}; {remedy}", path.display())]
    Leaf {
        /// The file or folder.
        path: PathBuf,
        /// Fault as a verb phrase.
        fault: String,
        /// Remedy as an imperative.
        remedy: &'static str,
    },
    /// A script of shapes ([`crate::shapes::Script`]) that cannot be used.
    #[error("{} {fault}; {remedy}", path.display())]
    Shapes {
        /// The file.
        path: PathBuf,
        /// Fault as a verb phrase.
        fault: String,
        /// Remedy as an imperative.
        remedy: &'static str,
    },
    /// A file that cannot be written.
    #[error(transparent)]
    File(#[from] CaptureError),
}

impl ModelError {
    pub(crate) fn leaf(path: &Path, fault: String, remedy: &'static str) -> ModelError {
        ModelError::Leaf { path: path.into(), fault, remedy }
    }
}
