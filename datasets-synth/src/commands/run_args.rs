//! Options and progress bar of commands that work for a while, and their result.

use std::io::Write;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use btf_capture::write_file_atomically;
use btf_synth::SynthError;
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::Value;

use super::failure::Failure;

/// Flag that Ctrl-C sets; the work stops at the next step.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Options of every command that works for a while.
#[derive(Args)]
pub(super) struct RunArgs {
    /// Number of threads [default: all cores]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Show no progress and no result line
    #[arg(long)]
    quiet: bool,
    /// Write the result as JSON to FILE; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl RunArgs {
    /// Runs `work` on a pool of the requested size with a progress bar over `total` steps, until Ctrl-C. `work` gets a
    /// function that takes the number of steps done and says whether to continue.
    pub(super) fn work<T: Send>(
        &self,
        message: &'static str,
        unit: &str,
        total: usize,
        work: impl FnOnce(&(dyn Fn(usize, usize) -> ControlFlow<()> + Sync)) -> Result<T, SynthError> + Send,
    ) -> Result<T, Failure> {
        ctrlc::set_handler(|| INTERRUPTED.store(true, Ordering::Relaxed)).map_err(|error| {
            Failure::Failed(format!("Ctrl-C cannot be caught ({error}); start the program from a shell"))
        })?;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.threads.map_or(0, usize::from)).build().map_err(
            |error| Failure::Failed(format!("no threads can be started ({error}); give a smaller --threads")),
        )?;
        // Draws on standard error, and only where that is a terminal.
        let bar = if self.quiet { ProgressBar::hidden() } else { ProgressBar::new(total as u64) };
        let style = ProgressStyle::with_template(&format!("{{msg}} {{wide_bar}} {{pos}}/{{len}} {unit}, {{eta}} left"));
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_message(message);
        let progress = |done: usize, total: usize| {
            // The work knows best how much there is.
            bar.set_length(total as u64);
            bar.set_position(done as u64);
            if INTERRUPTED.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let result = pool.install(|| work(&progress));
        bar.finish_and_clear();
        Ok(result?)
    }

    /// Writes the JSON result if the options ask for it. Prints the result line unless standard output holds the JSON
    /// or the user wants quiet.
    pub(super) fn report(&self, result: &Value, line: &str) -> Result<(), Failure> {
        if let Some(path) = &self.json {
            let text = format!("{result:#}\n");
            if path.as_os_str() == "-" {
                // Standard output then holds the JSON and nothing else.
                return std::io::stdout()
                    .write_all(text.as_bytes())
                    .map_err(|error| Failure::Failed(format!("standard output could not be written ({error})")));
            }
            write_text(path, &text)?;
        }
        if !self.quiet {
            println!("{line}");
        }
        Ok(())
    }
}

/// Writes a text file whole or not at all.
pub(super) fn write_text(path: &Path, text: &str) -> Result<(), Failure> {
    write_file_atomically(path, text.as_bytes()).map_err(|error| Failure::Failed(error.to_string()))
}
