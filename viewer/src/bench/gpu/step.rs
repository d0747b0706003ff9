//! The steps of a measurement, in the order in which they run: the most telling first.

use crate::bench::gpu::params::GpuBenchParams;
use crate::bench::gpu::rows::{Rows, row_of};
use crate::bench::gpu::{
    adapter, canopies, expansion, frames, operations, parity, picture_parity, roofline, transitions,
};
use crate::error::ViewerError;

/// A part of the measurement that runs in a process of its own.
pub(super) struct Step {
    pub name: &'static str,
    /// Seconds after which the process is ended.
    pub deadline_s: u64,
    /// Whether a quick run has it: software drivers compile the shaders of volumes for minutes, and have no time for many
    /// triangles.
    pub in_quick_runs: bool,
    /// Measures and hands over the rows.
    pub run: fn(&GpuBenchParams, Rows) -> Result<(), ViewerError>,
}

/// The steps. Compilers of drivers take tens of seconds for our shaders when they meet them first, so no deadline is short;
/// software drivers take half a minute for each shader that counts.
pub(super) const STEPS: [Step; 15] = [
    Step { name: "adapter", deadline_s: 30, in_quick_runs: true, run: adapter::tell },
    Step { name: "roofline", deadline_s: 60, in_quick_runs: true, run: roofline::measure },
    Step { name: "parity-decode", deadline_s: 120, in_quick_runs: true, run: parity::compare_decoders },
    Step { name: "operations", deadline_s: 240, in_quick_runs: true, run: operations::count },
    Step { name: "cornell", deadline_s: 120, in_quick_runs: true, run: frames::cornell },
    Step { name: "resolutions", deadline_s: 120, in_quick_runs: true, run: frames::resolutions },
    Step { name: "canopy", deadline_s: 120, in_quick_runs: false, run: canopies::canopy_of_the_paper },
    Step { name: "lights", deadline_s: 90, in_quick_runs: true, run: frames::lights },
    Step { name: "parity-pictures", deadline_s: 120, in_quick_runs: true, run: picture_parity::compare_pictures },
    Step { name: "models", deadline_s: 90, in_quick_runs: true, run: frames::models },
    Step { name: "landscapes", deadline_s: 90, in_quick_runs: false, run: frames::landscapes },
    Step { name: "transitions", deadline_s: 180, in_quick_runs: true, run: transitions::measure },
    Step { name: "workgroups", deadline_s: 60, in_quick_runs: true, run: frames::workgroups },
    Step { name: "expansion", deadline_s: 90, in_quick_runs: true, run: expansion::measure },
    Step { name: "canopies", deadline_s: 120, in_quick_runs: true, run: canopies::canopies },
];

/// Steps that fail on purpose: they run only where `--only` names them, and show that a failure is noticed and costs nothing
/// but its step.
pub(super) const PLANTED: [Step; 3] = [
    Step { name: "planted-abort", deadline_s: 30, in_quick_runs: true, run: abort },
    Step { name: "planted-hang", deadline_s: 2, in_quick_runs: true, run: hang },
    Step { name: "planted-wrong-decode", deadline_s: 120, in_quick_runs: true, run: parity::compare_wrong_decoders },
];

/// Finds a step, planted ones among them.
pub(super) fn find(name: &str) -> Option<&'static Step> {
    STEPS.iter().chain(&PLANTED).find(|step| step.name == name)
}

/// Runs a step in this process and prints its rows, a line of JSON each: what a child of [`run_gpu_bench`] does.
///
/// [`run_gpu_bench`]: crate::run_gpu_bench
///
/// # Errors
/// [`ViewerError::Usage`] for a name that no step has; what stopped the step.
pub fn run_gpu_step(name: &str, params: &GpuBenchParams) -> Result<(), ViewerError> {
    let step = find(name).ok_or_else(|| no_such_step(name))?;
    (step.run)(params, &mut |row| println!("{row}"))
}

/// Returns the error of a name that no step has.
pub(super) fn no_such_step(name: &str) -> ViewerError {
    let names: Vec<&str> = STEPS.iter().map(|step| step.name).collect();
    ViewerError::Usage(format!("there is no step '{name}'; the steps are {}", names.join(", ")))
}

fn abort(_: &GpuBenchParams, rows: Rows) -> Result<(), ViewerError> {
    rows(row_of("planted", &serde_json::json!({})));
    std::process::abort()
}

fn hang(_: &GpuBenchParams, rows: Rows) -> Result<(), ViewerError> {
    rows(row_of("planted", &serde_json::json!({})));
    loop {
        std::thread::sleep(std::time::Duration::from_secs(1));
    }
}
