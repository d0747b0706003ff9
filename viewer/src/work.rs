//! Work beside the window's own: on a thread, where there are threads.

use std::sync::mpsc::{Receiver, channel};

/// Does `work` on a thread of its own and returns where its result will arrive; in a browser, whose program has one thread,
/// it is done at once.
pub(crate) fn in_background<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Receiver<T> {
    let (sender, result) = channel();
    run(move || {
        // Nobody receives what is not wanted any more.
        let _ = sender.send(work());
    });
    result
}

/// Whether [`run`] returns before the work is done.
pub(crate) const HAS_THREADS: bool = cfg!(not(target_arch = "wasm32"));

/// Runs `work` on a thread of its own, or at once.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn run(work: impl FnOnce() + Send + 'static) {
    std::thread::spawn(work);
}

/// Runs `work` on a thread of its own, or at once.
#[cfg(target_arch = "wasm32")]
pub(crate) fn run(work: impl FnOnce() + Send + 'static) {
    work();
}
