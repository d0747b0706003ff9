//! Progress on a terminal, silence elsewhere, and Ctrl-C.

use super::{Failure, Shared};
use btf_fit::Monitor;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// How often the elapsed time is redrawn.
const TICK: Duration = Duration::from_millis(200);

/// A monitor that draws a bar on stderr where that is a terminal, and that Ctrl-C cancels.
pub(super) fn monitor(shared: &Shared) -> Result<Arc<Monitor>, Failure> {
    let target = if shared.quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
    let bar = ProgressBar::with_draw_target(None, target);
    let shown = !bar.is_hidden();
    if shown {
        bar.enable_steady_tick(TICK);
    }
    let stage = Mutex::new(String::new());
    let monitor = Arc::new(Monitor::with_listener(move |name, done, total| {
        if !shown {
            return;
        }
        let Ok(mut stage) = stage.lock() else { return };
        let known = bar.length().unwrap_or(0) > 0;
        if *stage != name || known != (total > 0) {
            if *stage != name {
                stage.clear();
                stage.push_str(name);
                bar.reset();
            }
            bar.set_style(style(total > 0));
            bar.set_message(name.to_string());
        }
        if total > 0 {
            bar.set_length(total as u64);
            bar.set_position(done as u64);
        } else {
            bar.unset_length();
        }
    }));
    let cancelled = Arc::clone(&monitor);
    ctrlc::set_handler(move || cancelled.cancel())
        .map_err(|error| Failure::Path(format!("Ctrl-C could not be caught ({error}); run the program again")))?;
    Ok(monitor)
}

fn style(known: bool) -> ProgressStyle {
    let template = if known {
        "{msg:12} [{bar:32}] {percent:>3} %  {elapsed}, {eta} to go"
    } else {
        "{msg:12} {spinner} {elapsed}"
    };
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> ")
}
