//! Runs the steps one after the other, each in a process of its own, and writes down what they measured after each.

use crate::bench::gpu::child::run_child;
use crate::bench::gpu::params::GpuBenchParams;
use crate::bench::gpu::results::{GPU_RESULTS_FILE, GpuResults, StepRecord};
use crate::bench::gpu::step::{STEPS, Step, find, no_such_step};
use crate::error::ViewerError;
use crate::render::control::Control;
use btf_capture::atomic::{create_folder, write_file_atomically};
use std::path::Path;
use std::process::Command;
use std::time::Duration;
use web_time::Instant;

/// Seconds without which a step is not begun.
const MIN_S: f64 = 5.0;

/// How a measurement goes about it.
pub struct GpuBenchRun<'a> {
    /// Folder for `gpu.json`; made where it is missing.
    pub out: &'a Path,
    /// When the measurement began.
    pub start: Instant,
    /// Minutes from the start to the end of all steps, above 0.
    pub minutes: f64,
    /// Names of the steps to run; all of them where it is empty.
    pub only: &'a [String],
    /// Makes the command of a process that calls [`run_gpu_step`](crate::run_gpu_step) for the step of this name.
    pub command: &'a dyn Fn(&str) -> Command,
    /// Arguments of this process, for the results.
    pub arguments: Vec<String>,
}

/// Runs the steps. Those that fail, hang or find no time are told by their records, and the others go on.
///
/// # Errors
/// [`ViewerError::Usage`] for a step that there is none of, [`ViewerError::Write`] where the folder takes no file,
/// [`ViewerError::Interrupted`]; then `gpu.json` has the steps so far.
pub fn run_gpu_bench(params: &GpuBenchParams, run: &GpuBenchRun, control: &Control) -> Result<GpuResults, ViewerError> {
    let steps: Vec<&Step> = match run.only {
        [] => STEPS.iter().collect(),
        only => only.iter().map(|name| find(name).ok_or_else(|| no_such_step(name))).collect::<Result<_, _>>()?,
    };
    let mut results = GpuResults {
        version: env!("CARGO_PKG_VERSION").into(),
        commit: option_env!("BTF_COMMIT").map(String::from),
        command: run.arguments.clone(),
        assets: params.assets.iter().map(|asset| asset.name.clone()).collect(),
        mesh: params.mesh.as_ref().and_then(|path| path.file_name()).map(|name| name.to_string_lossy().into_owned()),
        quick: params.quick,
        threads: rayon::current_num_threads(),
        seconds: 0.0,
        finished: false,
        steps: Vec::new(),
    };
    create_folder(run.out)?;
    write(run.out, &results)?;
    for (number, step) in steps.iter().enumerate() {
        let left_s = 60.0 * run.minutes - run.start.elapsed().as_secs_f64();
        let skipped = |why: &str| StepRecord {
            name: step.name.into(),
            status: format!("skipped: {why}"),
            seconds: 0.0,
            rows: Vec::new(),
        };
        let record = if params.quick && !step.in_quick_runs {
            skipped("not in a quick run")
        } else if left_s < MIN_S {
            skipped("no time")
        } else {
            let deadline = Duration::from_secs_f64(left_s.min(step.deadline_s as f64));
            run_child(step.name, &mut (run.command)(step.name), deadline, control.cancelled)?
        };
        results.steps.push(record);
        results.seconds = run.start.elapsed().as_secs_f64();
        results.finished = results.steps.len() == steps.len();
        write(run.out, &results)?;
        (control.progress)((number + 1) as f32 / steps.len() as f32);
    }
    Ok(results)
}

fn write(folder: &Path, results: &GpuResults) -> Result<(), ViewerError> {
    let json = serde_json::to_string_pretty(results).unwrap_or_default();
    Ok(write_file_atomically(folder.join(GPU_RESULTS_FILE), json.as_bytes())?)
}
