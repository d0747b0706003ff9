//! How far a tracer is that another thread makes ready.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// Progress of [`Tracer::make_ready`](crate::Tracer), shared with the thread that waits for it.
#[derive(Debug, Default)]
pub(crate) struct Preparation {
    /// Passes to compile; 0 while the scene is being uploaded.
    passes: AtomicU32,
    /// Passes that are compiled.
    compiled: AtomicU32,
    /// Whether nobody waits any more.
    is_abandoned: AtomicBool,
}

impl Preparation {
    /// Notes that the scene is uploaded and how many passes are compiled next.
    pub(crate) fn begin(&self, passes: usize) {
        self.compiled.store(0, Ordering::Relaxed);
        self.passes.store(passes as u32, Ordering::Relaxed);
    }

    /// Notes that a further pass is compiled.
    pub(crate) fn count(&self) {
        self.compiled.fetch_add(1, Ordering::Relaxed);
    }

    /// Has the work end after the pass at hand.
    pub(crate) fn abandon(&self) {
        self.is_abandoned.store(true, Ordering::Relaxed);
    }

    /// Tells whether nobody waits any more.
    pub(crate) fn is_abandoned(&self) -> bool {
        self.is_abandoned.load(Ordering::Relaxed)
    }

    /// Returns what is being done, for the user.
    pub(crate) fn line(&self) -> String {
        match (self.passes.load(Ordering::Relaxed), self.compiled.load(Ordering::Relaxed)) {
            (0, _) => "uploading the scene".into(),
            (passes, compiled) => format!("compiling shaders: {} of {passes}", (compiled + 1).min(passes)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_counts_the_pass_that_is_being_compiled() {
        let preparation = Preparation::default();
        assert_eq!(preparation.line(), "uploading the scene");
        preparation.begin(3);
        assert_eq!(preparation.line(), "compiling shaders: 1 of 3");
        preparation.count();
        assert_eq!(preparation.line(), "compiling shaders: 2 of 3");
        preparation.count();
        preparation.count();
        assert_eq!(preparation.line(), "compiling shaders: 3 of 3");
        assert!(!preparation.is_abandoned());
        preparation.abandon();
        assert!(preparation.is_abandoned());
    }
}
