//! `btf-fit library plan`.

use crate::commands::failure::Failure;
use crate::commands::options::Shared;
use crate::commands::output::{check_distinct, check_file, complain, is_stdout, say, tell};
use crate::commands::progress;
use btf_capture::{text_from_bytes, write_file_atomically};
use btf_fit::{
    CostModel, LibraryEstimate, LibraryPlan, MaterialOptions, PlanRule, Scheduler, WorkerLimits, bytes_from_text,
    discover_captures, estimate_library, library_script, real_path,
};
use clap::Args;
use std::path::{Path, PathBuf};

/// List the captures below a folder, and how each is to be fitted, in a file to edit
///
/// The plan is a TOML file: options for all materials, rules for those whose names match a glob, and options of single
/// materials. With --update captures that have come are added to a plan; its settings stay, its comments do not.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  btf-fit library plan CAPTURES -o library.toml --bytes 2MB
  btf-fit library plan CAPTURES -o library.toml --psnr 36 --rule 'leather*: bytes=4MB priority=2' --match 'shoes/*'
  btf-fit library plan CAPTURES -o library.toml --update --slurm library.sh --workers 16 --worker-threads 8
  btf-fit library plan CAPTURES -o library.toml --update --estimate --workers 16    # hours, memory and disk of what is left")]
pub(super) struct PlanArgs {
    /// Folder with captures, in folders of any depth
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// The plan to write
    #[arg(short, long, value_name = "PLAN.toml")]
    output: PathBuf,
    /// Only captures whose path below DIR matches this glob; may be given several times
    #[arg(long = "match", value_name = "GLOB")]
    globs: Vec<String>,
    /// Folder of the assets, relative to the plan
    #[arg(long, value_name = "DIR", default_value = "assets")]
    assets: PathBuf,
    /// Largest size of each asset, as 2MB
    #[arg(long, value_name = "SIZE", value_parser = size, conflicts_with = "psnr")]
    bytes: Option<String>,
    /// Least PSNR of each asset, dB
    #[arg(long, value_name = "DB")]
    psnr: Option<f64>,
    /// Options of the materials whose names match a glob, as 'leather*: bytes=4MB heights=true priority=2'; may be given
    /// several times, later ones win
    #[arg(long = "rule", value_name = "RULE", value_parser = rule)]
    rules: Vec<PlanRule>,
    /// Add what has come to the plan that is there
    #[arg(long, conflicts_with_all = ["bytes", "psnr", "rules", "assets"])]
    update: bool,
    /// Write an array job for Slurm's sbatch
    #[arg(long, value_name = "JOB.sh")]
    slurm: Option<PathBuf>,
    /// Write a Python script that submits the workers to OpenCue
    #[arg(long, value_name = "JOB.py")]
    opencue: Option<PathBuf>,
    /// Write a shell command a line, one for each worker, as for GNU parallel
    #[arg(long, value_name = "COMMANDS.txt")]
    commands: Option<PathBuf>,
    /// Tell what the fits that are not yet done will cost: core hours, memory and disk. Opens every capture, and decodes a
    /// few images of some; fits that this library has already correct it
    #[arg(long)]
    estimate: bool,
    /// Constants of the estimate, from `btf-fit bench cost`, in place of those that come with the program
    #[arg(long, value_name = "COST.toml", requires = "estimate")]
    cost: Option<PathBuf>,
    /// Write the estimate as JSON; - for standard output
    #[arg(long, value_name = "FILE", requires = "estimate")]
    json: Option<PathBuf>,
    /// Workers of these scripts and of the estimate
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    workers: u32,
    /// Threads of each worker
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1024))]
    worker_threads: u32,
    /// Memory of each worker
    #[arg(long, value_name = "SIZE", value_parser = bytes_from_text, default_value = "6GB")]
    worker_memory: u64,
}

fn size(text: &str) -> Result<String, String> {
    bytes_from_text(text).map(|_| text.to_string())
}

fn rule(text: &str) -> Result<PlanRule, String> {
    text.parse()
}

pub(super) fn run(args: &PlanArgs, shared: &Shared) -> Result<(), Failure> {
    if is_stdout(&args.output) {
        return Err(Failure::Usage("a plan is a file that its workers read; give -o a file name".into()));
    }
    let scripts =
        [(Scheduler::Slurm, &args.slurm), (Scheduler::OpenCue, &args.opencue), (Scheduler::Shell, &args.commands)];
    let scripts: Vec<(Scheduler, &Path)> =
        scripts.into_iter().filter_map(|(kind, path)| Some((kind, path.as_deref()?))).collect();
    if scripts.iter().any(|(_, path)| is_stdout(path)) {
        return Err(Failure::Usage("a script is a file; give --slurm, --opencue or --commands a file name".into()));
    }
    let outputs: Vec<&Path> =
        scripts.iter().map(|(_, path)| *path).chain([args.output.as_path()]).chain(args.json.as_deref()).collect();
    check_distinct(&outputs)?;
    for path in &outputs {
        check_file(path, &[])?;
    }
    if args.output.exists() && !args.update {
        return Err(Failure::Path(format!(
            "{} is there already; --update adds captures to it and leaves the rest, or give another name",
            args.output.display()
        )));
    }
    let cost = if args.estimate { Some(cost_model(args)?) } else { None };
    let found = discover_captures(&args.folder, &args.globs)?;
    let captures: Vec<PathBuf> = found.iter().map(|below| relative(&args.folder.join(below), &args.output)).collect();
    let (plan, added) = if args.update {
        let mut plan = LibraryPlan::read(&args.output)?;
        let added = plan.add_captures(&captures);
        (plan, added)
    } else {
        let options = MaterialOptions { bytes: args.bytes.clone(), psnr: args.psnr, ..MaterialOptions::default() };
        let plan = LibraryPlan::of_captures(args.assets.clone(), options, args.rules.clone(), &captures);
        (plan, captures.len())
    };
    if plan.materials.is_empty() {
        return Err(Failure::Path(format!(
            "{} has no captures{}; docs/guide/captures.md tells how they are recognised",
            args.folder.display(),
            if args.globs.is_empty() { "" } else { " that match" }
        )));
    }
    plan.check_options(&args.output)?;
    write_file_atomically(&args.output, plan.to_toml().as_bytes())?;
    let program = std::env::current_exe().unwrap_or_else(|_| PathBuf::from("btf-fit"));
    let limits = WorkerLimits {
        workers: args.workers as usize,
        threads: args.worker_threads as usize,
        memory_bytes: args.worker_memory,
    };
    for (kind, path) in scripts {
        let script = library_script(kind, &real_path(&args.output), &program, limits);
        write_file_atomically(path, script.as_bytes())?;
    }
    let quiet = shared.quiet || args.json.as_deref().is_some_and(is_stdout);
    if !quiet {
        say(&format!("{}: {} materials, {added} of them new", args.output.display(), plan.materials.len()));
    }
    let Some(cost) = cost else { return Ok(()) };
    let monitor = progress::monitor(shared, None)?;
    let estimate = estimate_library(&plan, &args.output, &cost, limits, &monitor)?;
    tell(args.json.as_deref(), quiet, &estimate, || estimate_in_words(&estimate, limits))?;
    for (name, reason) in &estimate.unknown {
        complain(&format!("{name} is left out: {reason}"));
    }
    Ok(())
}

fn cost_model(args: &PlanArgs) -> Result<CostModel, Failure> {
    Ok(match &args.cost {
        Some(path) => CostModel::read(path)?,
        None => CostModel::built_in()?,
    })
}

fn estimate_in_words(estimate: &LibraryEstimate, limits: WorkerLimits) -> String {
    let failed = match estimate.failed {
        0 => String::new(),
        count => format!(", {count} failed before and are tried only with --retry"),
    };
    if estimate.open == 0 {
        return format!("to fit: nothing that can be told about ({} done{failed})", estimate.done);
    }
    let size = |bytes: f64| text_from_bytes(bytes.max(0.0) as u64);
    let hours = |hours: f64| match hours {
        0.0..0.05 => format!("{:.1} minutes", 60.0 * hours),
        0.05..2.0 => format!("{:.0} minutes", 60.0 * hours),
        _ => format!("{hours:.1} hours"),
    };
    let [least, most] = estimate.asset_bytes_range;
    let range = if most > least { format!(" (likely {} to {})", size(least), size(most)) } else { String::new() };
    let mut lines = vec![
        format!(
            "to fit: {} materials ({} done{failed}), {:.2} core hours, {} with {} workers of {} threads",
            estimate.open,
            estimate.done,
            estimate.core_hours,
            hours(estimate.hours),
            limits.workers,
            limits.threads
        ),
        format!("memory: {} of a worker's {}", size(estimate.memory_bytes), text_from_bytes(limits.memory_bytes)),
        format!(
            "disk: {} of assets{range}, {} of records, at most {} of temporary files",
            size(estimate.asset_bytes),
            size(estimate.record_bytes),
            size(estimate.temporary_bytes)
        ),
    ];
    if estimate.corrected_by > 0 {
        let factor = estimate.correction;
        lines.push(format!(
            "times are multiplied by {factor:.2}, as {} fits of this library were",
            estimate.corrected_by
        ));
    }
    lines.join("\n")
}

/// Returns `path` relative to the folder of `plan` where it lies below it, else absolute.
fn relative(path: &Path, plan: &Path) -> PathBuf {
    let real = real_path(path);
    let folder = real_path(plan).parent().map(Path::to_path_buf).unwrap_or_default();
    real.strip_prefix(&folder).map(Path::to_path_buf).unwrap_or(real)
}
