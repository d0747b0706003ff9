//! The progress bar, notices on stderr, and Ctrl-C.

use btf_viewer::{Control, ViewerError};
use std::sync::atomic::{AtomicBool, Ordering};

/// Runs `work` with a progress bar, prints its notices on stderr and cancels it on Ctrl-C. With `quiet` nothing is
/// printed.
///
/// # Errors
/// The errors of `work`; [`ViewerError::Interrupted`] after Ctrl-C.
pub(super) fn with_progress<T>(
    quiet: bool,
    work: impl FnOnce(&Control) -> Result<T, ViewerError>,
) -> Result<T, ViewerError> {
    static CANCELLED: AtomicBool = AtomicBool::new(false);
    // Without a handler Ctrl-C ends the program anyway, only not with 130.
    let _ = ctrlc::set_handler(|| CANCELLED.store(true, Ordering::Relaxed));
    const STEPS: f32 = 1000.0;
    let bar = if quiet {
        indicatif::ProgressBar::hidden()
    } else {
        indicatif::ProgressBar::new(STEPS as u64).with_style(
            indicatif::ProgressStyle::with_template("{bar:40} {percent}% {eta}").unwrap_or_else(|_| {
                // The template is a constant; the default style is as good.
                indicatif::ProgressStyle::default_bar()
            }),
        )
    };
    let notice = |text: &str| {
        if !quiet {
            eprintln!("note: {text}");
        }
    };
    let control = Control {
        cancelled: &|| CANCELLED.load(Ordering::Relaxed),
        progress: &|share| bar.set_position((share * STEPS) as u64),
        notice: &notice,
    };
    let result = work(&control);
    bar.finish_and_clear();
    if CANCELLED.load(Ordering::Relaxed) {
        return Err(ViewerError::Interrupted);
    }
    result
}
