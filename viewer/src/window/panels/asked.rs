//! What the user asked for in a frame, by panel or key.

use crate::window::editing::physiology::LeafChange;
use std::path::PathBuf;

/// A file that the user asks to be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Export {
    /// The picture as it is.
    Picture,
    /// Pictures of a whole turn around the scene.
    Turntable,
}

/// Requests that the user made in a frame.
#[derive(Debug, Default)]
pub(crate) struct Asked {
    /// The picture must begin anew (exposure does not need that).
    pub changed: bool,
    /// The asset whose edits changed.
    pub edited: Option<usize>,
    /// Assets in bands are shown under another light.
    pub illuminant: bool,
    /// Changes of a leaf.
    pub leaf: Option<LeafChange>,
    /// The light that surrounds the scene changed.
    pub surroundings: bool,
    /// The wind moved the scene's skins.
    pub skins: bool,
    /// An asset to compare with.
    pub compare_with: Option<PathBuf>,
    /// Files to write.
    pub exports: Vec<Export>,
    /// A file to open.
    pub open: Option<PathBuf>,
    /// A file to open is to be chosen.
    pub choose: bool,
    /// All unsaved edits are to be saved.
    pub save: bool,
    /// The window is to be closed.
    pub close: bool,
}
