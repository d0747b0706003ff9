//! How a running computation talks to its caller.

/// The callbacks by which a rendering talks to its caller while it runs.
pub struct Control<'a> {
    /// Asked between rows and frames; `true` ends the rendering with
    /// [`ViewerError::Interrupted`](crate::ViewerError::Interrupted).
    pub cancelled: &'a (dyn Fn() -> bool + Sync),
    /// Told the share of the work that is done, 0 to 1.
    pub progress: &'a (dyn Fn(f32) + Sync),
    /// Told what the user should know although it is not an error, one sentence.
    pub notice: &'a (dyn Fn(&str) + Sync),
}

impl Control<'_> {
    /// Neither stops nor says anything.
    pub const SILENT: Control<'static> = Control { cancelled: &|| false, progress: &|_| (), notice: &|_| () };
}
