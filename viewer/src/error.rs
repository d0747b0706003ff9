//! The errors of the viewer, each as one sentence that names the file or the missing thing.

use btf_capture::toml_text::one_line;
use std::path::{Path, PathBuf};

/// Every error of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ViewerError {
    /// A file cannot be read. Remedy: check the path and its permissions.
    #[error("{}: cannot be read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A file is not a whole asset. Remedy: fit it again, or copy it again.
    #[error("{}: {source}", path.display())]
    Asset {
        /// The file.
        path: PathBuf,
        /// Fault that was found.
        source: btf_runtime::FormatError,
    },
    /// A file is not a whole volumetric texture. Remedy: build it again, or copy it again.
    #[error("{}: {source}", path.display())]
    Volume {
        /// The file.
        path: PathBuf,
        /// Fault that was found.
        source: btf_runtime::voltex::VoltexError,
    },
    /// A leaf cannot be evaluated. Remedy: correct its description.
    #[error("the leaf {name}: {source}")]
    Leaf {
        /// The leaf's name.
        name: String,
        /// Fault that was found.
        source: btf_runtime::LeafError,
    },
    /// A mesh file cannot be used. Remedy: export it again as the message says.
    #[error("{}: {reason}", path.display())]
    Mesh {
        /// The file, or the built-in mesh's name.
        path: PathBuf,
        /// Fault and remedy.
        reason: String,
    },
    /// A scene description is wrong. Remedy: correct the named key.
    #[error("{}: {reason}", path.display())]
    Scene {
        /// The file.
        path: PathBuf,
        /// Fault and remedy.
        reason: String,
    },
    /// Options contradict each other or are out of range; the program exits with 2.
    #[error("{0}")]
    Usage(String),
    /// No adapter for the backend that was asked for.
    #[error("{0}")]
    NoAdapter(String),
    /// The adapter is too small for the scene, or the driver reported an error.
    #[error("the GPU {adapter} failed: {reason}; --backend cpu renders without it")]
    Gpu {
        /// Adapter name.
        adapter: String,
        /// Message of the driver or of the limit check.
        reason: String,
    },
    /// Some steps of the measurement of a GPU failed. Remedy: see their sentences in its results.
    #[error("{0}")]
    Steps(String),
    /// A leaf's description or textures cannot be read.
    #[error(transparent)]
    Model(#[from] btf_models::ModelError),
    /// The result cannot be written.
    #[error(transparent)]
    Write(#[from] btf_capture::CaptureError),
    /// The picture cannot be encoded.
    #[error("{}: the picture cannot be encoded: {reason}", path.display())]
    Encode {
        /// The file.
        path: PathBuf,
        /// Message of the encoder.
        reason: String,
    },
    /// No window can be opened. Remedy: `--headless`.
    #[error("no window can be opened ({0}); --headless --out picture.png renders without one")]
    Window(String),
    /// The user pressed Ctrl-C; the program exits with 130.
    #[error("interrupted; nothing is half written")]
    Interrupted,
}

impl ViewerError {
    pub(crate) fn mesh(path: impl AsRef<Path>, reason: impl Into<String>) -> ViewerError {
        ViewerError::Mesh { path: path.as_ref().to_path_buf(), reason: reason.into() }
    }

    pub(crate) fn scene(path: impl AsRef<Path>, reason: impl Into<String>) -> ViewerError {
        // A scene file may hold texts of several lines.
        ViewerError::Scene { path: path.as_ref().to_path_buf(), reason: one_line(&reason.into()) }
    }

    /// Returns the exit status that COMMANDS promises: 2 usage, 130 Ctrl-C, else 1.
    pub fn exit_code(&self) -> u8 {
        match self {
            ViewerError::Usage(_) => 2,
            ViewerError::Interrupted => 130,
            _ => 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_in_a_scene_is_told_in_one_line() {
        let told = ViewerError::scene("scene.toml", "there is no material `a\nb\u{1b}`").to_string();
        assert_eq!(told, "scene.toml: there is no material `a\\nb\\u{1b}`");
    }
}
