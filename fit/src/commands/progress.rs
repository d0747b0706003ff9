//! Progress on a terminal, silence elsewhere, and Ctrl-C.

use super::failure::Failure;
use super::options::Shared;
use super::output::complain;
use btf_fit::{Forecast, Monitor};
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Time between two redraws of the elapsed time.
const TICK: Duration = Duration::from_millis(200);

/// Returns a monitor that draws a bar on stderr where that is a terminal, and that Ctrl-C cancels. With a forecast the
/// bar also tells how long the whole fit will still take. Remarks go to stderr, one line each, unless `--quiet`.
pub(super) fn monitor(shared: &Shared, forecast: Option<Forecast>) -> Result<Arc<Monitor>, Failure> {
    let target = if shared.quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
    let bar = ProgressBar::with_draw_target(None, target);
    let shown = !bar.is_hidden();
    if shown {
        bar.enable_steady_tick(TICK);
    }
    let (remarks, quiet) = (bar.clone(), shared.quiet);
    let (start, state) = (Instant::now(), Mutex::new((String::new(), forecast)));
    let draw = move |name: &str, done: usize, total: usize| {
        if !shown {
            return;
        }
        let Ok(mut state) = state.lock() else { return };
        let (stage, forecast) = &mut *state;
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
        let left = forecast.as_mut().map(|forecast| forecast.report(name, done, total, start.elapsed().as_secs_f64()));
        if let Some(seconds) = left.and_then(|left| left.whole_s) {
            bar.set_prefix(whole(seconds));
        }
    };
    let hear = move |sentence: &str| {
        if !quiet {
            remarks.suspend(|| complain(&format!("note: {sentence}")));
        }
    };
    let monitor = Arc::new(Monitor::with_listener(draw).on_remark(hear));
    let cancelled = Arc::clone(&monitor);
    ctrlc::set_handler(move || cancelled.cancel())
        .map_err(|error| Failure::Path(format!("Ctrl-C could not be caught ({error}); run the program again")))?;
    Ok(monitor)
}

/// Returns the text behind a stage's own bar: the rounded time that the whole fit still takes.
fn whole(seconds: f64) -> String {
    // A guess to the second would promise too much.
    let rounded = if seconds > 120.0 { (seconds / 60.0).ceil() * 60.0 } else { (seconds / 5.0).ceil() * 5.0 };
    format!("; the whole fit about {} more", HumanDuration(Duration::from_secs_f64(rounded.min(1e9))))
}

fn style(known: bool) -> ProgressStyle {
    let template = if known {
        "{msg:12} [{bar:32}] {percent:>3} %  {elapsed}, {eta} to go{prefix}"
    } else {
        "{msg:12} {spinner} {elapsed}{prefix}"
    };
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_rounded_up_to_what_a_guess_can_say() {
        assert_eq!(whole(0.3), "; the whole fit about 5 seconds more");
        assert_eq!(whole(61.0), "; the whole fit about 65 seconds more");
        assert_eq!(whole(121.0), "; the whole fit about 3 minutes more");
        assert_eq!(whole(1201.0), "; the whole fit about 21 minutes more");
    }
}
