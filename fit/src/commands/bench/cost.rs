//! `btf-fit bench cost`.

use crate::commands::failure::Failure;
use crate::commands::options::Shared;
use crate::commands::output::{check_distinct, check_file, complain, is_stdout, tell};
use crate::commands::progress;
use btf_capture::{Capture, toml_text::bounded_text, write_file_atomically};
use btf_fit::{
    CostModel, FitParams, FitWork, ImageProbe, MaterialOptions, MeasuredFit, Monitor, learn_cost, product_gflops,
};
use clap::Args;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Bytes a texel of the sizes that are fitted.
const BYTES_A_TEXEL: [u64; 2] = [4, 30];
/// Smallest size that is fitted, bytes.
const MIN_BYTES: u64 = 12_000;
/// Errors that are fitted, PSNR in dB.
const PSNR_DB: [f64; 3] = [28.0, 31.0, 34.0];
/// Pixels of a capture up to which fits without a goal and with heights are timed, too.
const MAX_SLOW_PIXELS: usize = 60_000_000;
/// Largest file of measured fits that is read.
const MAX_MEASURED_BYTES: u64 = 64 << 20;
/// Relative error of an estimate that counts as right.
const RIGHT: f64 = 0.2;

/// Time fits of captures, and learn from them what other fits will cost
///
/// The result is what `btf-fit library plan --estimate` tells hours by (--cost). Each capture is fitted with several sizes and
/// errors, each time by a program of its own, so nothing else should run meanwhile.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  btf-fit bench cost WOOL SILK LEAF -o cost.toml --held-out DENIM --measured fits.json
  btf-fit library plan CAPTURES -o library.toml --bytes 2MB --estimate --cost cost.toml")]
pub(super) struct CostArgs {
    /// Captures of many numbers of texels and directions
    #[arg(required = true, value_name = "CAPTURE")]
    captures: Vec<PathBuf>,
    /// The constants to write
    #[arg(short, long, value_name = "COST.toml")]
    output: PathBuf,
    /// Captures on which the estimate is judged and that it is not learnt from; may be given several times
    #[arg(long, value_name = "CAPTURE")]
    held_out: Vec<PathBuf>,
    /// Timed fits: those in this file are not run again, new ones are added. Of another version of the program they tell
    /// what that one cost
    #[arg(long, value_name = "FITS.json")]
    measured: Option<PathBuf>,
    /// Write the figures as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// A timed fit and what it was a fit of.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Timed {
    capture: PathBuf,
    options: MaterialOptions,
    /// Speed of the processor then; `None` counts as that of now.
    #[serde(default)]
    product_gflops: Option<f64>,
    /// `None` where the capture cannot be fitted so.
    #[serde(default)]
    fit: Option<MeasuredFit>,
}

/// What an estimate told of a fit, beside the truth.
#[derive(Debug, Serialize)]
struct Judged {
    capture: String,
    options: MaterialOptions,
    core_seconds: [f64; 2],
    memory_bytes: Option<[f64; 2]>,
    asset_bytes: [f64; 2],
}

/// Result that `bench cost --json` writes; pairs are what was told and what is true.
#[derive(Debug, Serialize)]
struct CostResult {
    fits: usize,
    product_gflops: f64,
    threads: usize,
    /// Fits that the constants were learnt from, and the held-out ones.
    learnt: Vec<Judged>,
    held_out: Vec<Judged>,
}

pub(super) fn run(args: &CostArgs, shared: &Shared) -> Result<(), Failure> {
    if is_stdout(&args.output) {
        return Err(Failure::Usage("constants are a file that --cost reads; give -o a file name".into()));
    }
    let outputs: Vec<&Path> = [Some(&args.output), args.json.as_ref(), args.measured.as_ref()]
        .into_iter()
        .flatten()
        .map(PathBuf::as_path)
        .collect();
    check_distinct(&outputs)?;
    for path in &outputs {
        check_file(path, &[args.captures.clone(), args.held_out.clone()].concat())?;
    }
    let monitor = progress::monitor(shared, None)?;
    let threads = shared.threads.map_or_else(rayon::current_num_threads, usize::from);
    if threads < 2 {
        return Err(Failure::Usage(
            "on one thread nothing tells what the others would idle; time fits on two threads or more".into(),
        ));
    }
    let mut measured = match &args.measured {
        Some(path) if path.exists() => read_measured(path)?,
        _ => Vec::new(),
    };
    let gflops = product_gflops();
    let captures: Vec<&PathBuf> = args.captures.iter().chain(&args.held_out).collect();
    for (number, path) in captures.iter().enumerate() {
        let capture = Capture::open(path)?;
        for options in settings(&capture) {
            monitor.report("fits", number, captures.len())?;
            if measured.iter().any(|timed| timed.capture == **path && timed.options == options) {
                continue;
            }
            let fit = time_fit(path, &options, threads)?;
            // Ctrl-C has reached the fit, too: that it ended says nothing about the capture.
            monitor.check()?;
            measured.push(Timed { capture: path.to_path_buf(), options, product_gflops: Some(gflops), fit });
            if let Some(path) = &args.measured {
                write_file_atomically(path, &serde_json::to_vec_pretty(&measured).unwrap_or_default())?;
            }
        }
    }
    let limit = FitParams::default().memory_bytes;
    let with_work = |paths: &[PathBuf]| with_work(&measured, paths, gflops, threads, &monitor);
    let (learnt, held_out) = (with_work(&args.captures)?, with_work(&args.held_out)?);
    let rows: Vec<(FitWork, MeasuredFit)> = learnt.iter().map(|(_, work, fit)| (work.clone(), fit.clone())).collect();
    if rows.is_empty() {
        return Err(Failure::Path("none of the captures could be fitted; give others".into()));
    }
    let model = learn_cost(&rows, gflops, limit).completed_by(&CostModel::built_in()?);
    monitor.check()?;
    write_file_atomically(&args.output, model.to_toml().as_bytes())?;
    let judge = |fits: &[(Timed, FitWork, MeasuredFit)]| fits.iter().map(|fit| judged(&model, fit, limit)).collect();
    let result = CostResult {
        fits: rows.len(),
        product_gflops: gflops,
        threads,
        learnt: judge(&learnt),
        held_out: judge(&held_out),
    };
    tell(args.json.as_deref(), shared.quiet, &result, || summary(&result, args))
}

fn read_measured(path: &Path) -> Result<Vec<Timed>, Failure> {
    let text = bounded_text(path, MAX_MEASURED_BYTES, "a list of timed fits")
        .map_err(|reason| Failure::Path(format!("{} {reason}", path.display())))?;
    serde_json::from_str(&text).map_err(|error| {
        Failure::Path(format!("{} holds no timed fits ({error}); give another name to --measured", path.display()))
    })
}

/// Returns the options with which a capture is fitted.
fn settings(capture: &Capture) -> Vec<MaterialOptions> {
    let info = capture.info();
    let texels = info.texel_count() as u64;
    let size = |a_texel: u64| format!("{}B", (a_texel * texels).max(MIN_BYTES));
    let of_size = |a_texel: u64| MaterialOptions { bytes: Some(size(a_texel)), ..MaterialOptions::default() };
    let mut all: Vec<MaterialOptions> = BYTES_A_TEXEL.map(of_size).into();
    all.extend(PSNR_DB.map(|db| MaterialOptions { psnr: Some(db), ..MaterialOptions::default() }));
    if info.texel_count() * info.pair_count() <= MAX_SLOW_PIXELS {
        all.push(MaterialOptions::default());
        all.push(MaterialOptions { heights: Some(true), ..of_size(BYTES_A_TEXEL[0]) });
    }
    all
}

/// Fits a capture by a program of its own; `None` where it cannot be fitted so, which is told.
fn time_fit(capture: &Path, options: &MaterialOptions, threads: usize) -> Result<Option<MeasuredFit>, Failure> {
    #[derive(Deserialize)]
    struct Told {
        bytes: f64,
        seconds: f64,
        processor_seconds: f64,
        stages: BTreeMap<String, f64>,
        stages_processor: BTreeMap<String, f64>,
        peak_memory_bytes: Option<f64>,
    }
    let failed = |reason: String| Failure::Path(format!("timing a fit of {} failed: {reason}", capture.display()));
    let folder = tempfile::tempdir().map_err(|error| failed(error.to_string()))?;
    let [asset, json] = ["asset.spmm", "figures.json"].map(|name| folder.path().join(name));
    let program = std::env::current_exe().map_err(|error| failed(error.to_string()))?;
    let mut command = Command::new(program);
    command.arg("fit").arg(capture).arg("-o").arg(&asset).arg("--json").arg(&json);
    command.args(["--quiet", "--threads", &threads.to_string()]);
    if let Some(bytes) = &options.bytes {
        command.args(["--bytes", bytes]);
    }
    if let Some(db) = options.psnr {
        command.args(["--psnr", &db.to_string()]);
    }
    if options.heights == Some(true) {
        command.arg("--heights");
    }
    let output = command.stdin(Stdio::null()).output().map_err(|error| failed(error.to_string()))?;
    // A fit that fails by itself ends with 1; any other end is no word about the capture.
    if !output.status.success() && output.status.code() != Some(1) {
        return Err(failed(format!("the fit ended with {}", output.status)));
    }
    if !output.status.success() {
        complain(&format!("left out: {}", String::from_utf8_lossy(&output.stderr).trim()));
        return Ok(None);
    }
    let text = std::fs::read_to_string(&json).map_err(|error| failed(error.to_string()))?;
    let told: Told = serde_json::from_str(&text).map_err(|error| failed(error.to_string()))?;
    let processor = |stage: &str| told.stages_processor.get(stage).copied().unwrap_or(0.0);
    Ok(Some(MeasuredFit {
        threads,
        seconds: told.seconds,
        processor_s: told.processor_seconds,
        stages: told.stages.iter().map(|(stage, seconds)| (stage.clone(), [*seconds, processor(stage)])).collect(),
        memory_bytes: told.peak_memory_bytes,
        bytes: told.bytes,
    }))
}

/// Returns the timed fits of `paths` with their work, with times as on a processor of `gflops`.
fn with_work(
    measured: &[Timed],
    paths: &[PathBuf],
    gflops: f64,
    threads: usize,
    monitor: &Monitor,
) -> Result<Vec<(Timed, FitWork, MeasuredFit)>, Failure> {
    let mut found = Vec::new();
    for path in paths {
        monitor.check()?;
        let captures = [Capture::open(path)?];
        let probes = [ImageProbe::of_capture(&captures[0])?];
        for timed in measured.iter().filter(|timed| timed.capture == *path) {
            let Some(fit) = &timed.fit else { continue };
            let mut params = timed.options.params(Path::new("."));
            params.suit(&captures, timed.options.clusters, timed.options.lobes);
            let work = FitWork::new(&captures, &params.check()?, &probes, threads)?;
            let quicker = timed.product_gflops.unwrap_or(gflops) / gflops;
            found.push((timed.clone(), work, fit.as_if_slower(quicker)));
        }
    }
    Ok(found)
}

fn judged(model: &CostModel, (timed, work, fit): &(Timed, FitWork, MeasuredFit), limit: u64) -> Judged {
    let cost = model.cost(work, model.product_gflops, fit.threads, limit);
    Judged {
        capture: timed.capture.display().to_string(),
        options: timed.options.clone(),
        core_seconds: [cost.core_seconds(fit.threads), fit.threads as f64 * fit.seconds],
        memory_bytes: fit.memory_bytes.map(|truth| [cost.memory_bytes, truth]),
        asset_bytes: [cost.asset_bytes, fit.bytes],
    }
}

fn summary(result: &CostResult, args: &CostArgs) -> String {
    let mut lines = vec![format!("{}: constants of {} fits", args.output.display(), result.fits)];
    for judged in &result.held_out {
        let options = serde_json::to_string(&judged.options).unwrap_or_default();
        let ratio = |[told, truth]: [f64; 2]| told / truth;
        lines.push(format!(
            "{} {options}: {:.1} core seconds told, {:.1} true; told / true: time {:.2}, memory {:.2}, bytes {:.2}",
            judged.capture,
            judged.core_seconds[0],
            judged.core_seconds[1],
            ratio(judged.core_seconds),
            judged.memory_bytes.map_or(f64::NAN, ratio),
            ratio(judged.asset_bytes)
        ));
    }
    for (name, fits) in [("learnt", &result.learnt), ("held out", &result.held_out)] {
        let of = |what: &str, pair: &dyn Fn(&Judged) -> Option<[f64; 2]>| {
            let pairs: Vec<[f64; 2]> = fits.iter().filter_map(pair).collect();
            let right = pairs.iter().filter(|[told, truth]| (told / truth - 1.0).abs() <= RIGHT).count();
            let sum = |number: usize| pairs.iter().map(|pair| pair[number]).sum::<f64>();
            format!("{what} {right} of {} within 20 %, sum {:.2}", pairs.len(), sum(0) / sum(1).max(1e-9))
        };
        if !fits.is_empty() {
            let all = [
                of("time", &|judged| Some(judged.core_seconds)),
                of("memory", &|judged| judged.memory_bytes),
                of("bytes", &|judged| Some(judged.asset_bytes)),
            ];
            lines.push(format!("{name}: {}", all.join("; ")));
        }
    }
    lines.join("\n")
}
