//! The scene file while it is read: where it lies, and the errors that name it.

use crate::error::ViewerError;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};

/// A scene file that is being read.
#[derive(Debug, Clone, Copy)]
pub(super) struct Source<'a> {
    /// The file itself.
    pub path: &'a Path,
}

impl Source<'_> {
    /// Reads the file as TOML.
    ///
    /// # Errors
    /// [`ViewerError::Read`]; [`ViewerError::Scene`] naming the line that is wrong.
    pub(super) fn parse<T: DeserializeOwned>(self) -> Result<T, ViewerError> {
        let read = |source| ViewerError::Read { path: self.path.into(), source };
        let text = btf_capture::files::read_to_string(self.path).map_err(read)?;
        toml::from_str(&text).map_err(|error| {
            let line = error.span().map_or(1, |span| text[..span.start].matches('\n').count() + 1);
            self.fault(format!("line {line}: {}", error.message().replace('\n', " ")))
        })
    }

    /// Makes an error of `reason` that names the scene file.
    pub(super) fn fault(self, reason: impl Into<String>) -> ViewerError {
        ViewerError::scene(self.path, reason)
    }

    /// Returns the path of a file that the scene file names relative to itself.
    pub(super) fn beside(self, name: &str) -> PathBuf {
        self.path.parent().unwrap_or(Path::new(".")).join(name)
    }
}
