//! `btf-view bench gpu`: everything that a GPU is measured by, in one run.

use super::assets::load_assets;
use super::parse::parse_positive;
use super::progress::with_progress;
use btf_viewer::{
    GPU_RESULTS_FILE, GpuBenchParams, GpuBenchRun, GpuResults, GpuTracer, StepRecord, ViewerError, run_gpu_bench,
    run_gpu_step, write_stand_in_asset,
};
use std::path::PathBuf;
use std::process::Command;
use web_time::Instant;

/// Arguments of the command.
#[derive(clap::Args)]
pub(super) struct GpuBenchArguments {
    /// Packed assets [default: one of random content, as large as measured ones]
    assets: Vec<PathBuf>,
    /// Folder for gpu.json, which is written anew after every step
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    /// Model that canopies are made of: an .obj, .gltf or .glb file [default: a plant that comes with the program]
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    /// Folder with the models of the landscapes' plants, as `cargo xtask volumes --models` writes them: measures where meshes should
    /// pass into volumes
    #[arg(long, value_name = "DIR")]
    plants: Option<PathBuf>,
    /// Minutes that all steps may take together; what finds no time is left out
    #[arg(long, value_name = "N", default_value = "8", value_parser = parse_positive)]
    minutes: f32,
    /// Small pictures, assets and canopies, for a software driver
    #[arg(long)]
    quick: bool,
    /// Only these steps, in this order
    #[arg(long, value_name = "STEP,...", value_delimiter = ',')]
    only: Vec<String>,
    /// What traces rays [default: ray queries where the adapter has them]
    #[arg(long, value_enum)]
    backend: Option<GpuTracer>,
    /// Part of the name of the adapter to use, where there are several
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Prints nothing but errors
    #[arg(long)]
    quiet: bool,
    /// Runs this step in this process and prints its rows
    #[arg(long, value_name = "STEP", hide = true)]
    step: Option<String>,
}

/// Runs the command: the steps, or one of them where this is a step's process.
///
/// # Errors
/// The errors of [`run_gpu_bench`]; [`ViewerError::Steps`] where a step failed.
pub(super) fn run(arguments: &GpuBenchArguments) -> Result<(), ViewerError> {
    let start = Instant::now();
    if let Some(mesh) = arguments.mesh.as_ref().filter(|mesh| !mesh.is_file()) {
        return Err(ViewerError::Usage(format!("{}: there is no such file, give --mesh a model", mesh.display())));
    }
    if let Some(plants) = arguments.plants.as_ref().filter(|plants| !plants.is_dir()) {
        return Err(ViewerError::Usage(format!("{}: there is no such folder, give --plants one", plants.display())));
    }
    let stands_in = arguments.assets.is_empty() && arguments.step.is_none();
    let stand_in = stands_in.then(|| write_stand_in_asset(&arguments.out, arguments.quick)).transpose()?;
    let params = GpuBenchParams {
        assets: load_assets(stand_in.as_ref().map_or(&arguments.assets, std::slice::from_ref))?,
        mesh: arguments.mesh.clone(),
        plants: arguments.plants.clone(),
        adapter: arguments.adapter.clone(),
        tracer: arguments.backend,
        quick: arguments.quick,
    };
    if let Some(step) = &arguments.step {
        return run_gpu_step(step, &params);
    }
    let program = std::env::current_exe().map_err(|error| {
        ViewerError::Usage(format!("the program does not find itself ({error}), run it by its path"))
    })?;
    let own = || std::env::args_os().skip(1);
    let command = |step: &str| {
        let mut command = Command::new(&program);
        command.args(own()).args(&stand_in).args(["--step", step]);
        command
    };
    let run = GpuBenchRun {
        out: &arguments.out,
        start,
        minutes: arguments.minutes.into(),
        only: &arguments.only,
        command: &command,
        arguments: own().map(|argument| argument.to_string_lossy().into_owned()).collect(),
    };
    let results = with_progress(arguments.quiet, |control| run_gpu_bench(&params, &run, control))?;
    let path = arguments.out.join(GPU_RESULTS_FILE);
    if !arguments.quiet {
        results.steps.iter().for_each(print_step);
        println!("{}", path.display());
    }
    failure_of(&results, &path.display().to_string())
}

fn print_step(step: &StepRecord) {
    println!("{:<16} {:>6.1} s  {:>3} rows  {}", step.name, step.seconds, step.rows.len(), step.status);
}

/// Returns the error of a measurement of which some steps failed.
fn failure_of(results: &GpuResults, path: &str) -> Result<(), ViewerError> {
    let failed: Vec<&str> =
        results.steps.iter().filter(|step| step.has_failed()).map(|step| step.name.as_str()).collect();
    match failed.is_empty() {
        true => Ok(()),
        false => Err(ViewerError::Steps(format!(
            "{} of {} steps did not come to their end ({}); {path} has what was measured, and why",
            failed.len(),
            results.steps.len(),
            failed.join(", ")
        ))),
    }
}
