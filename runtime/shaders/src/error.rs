//! Errors of the translation.

/// Error of a WGSL text that has no translation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ShaderError {
    /// The text is not WGSL, or needs more than core WGSL: correct it where the message points.
    #[error("the WGSL is not valid: {0}")]
    Wgsl(String),
    /// A language cannot express something that the module does: leave that out of the module.
    #[error("{file} cannot be written: {reason}")]
    Translation {
        /// Name of the file that was to be written.
        file: String,
        /// Reason that naga gives.
        reason: String,
    },
}
