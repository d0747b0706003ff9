//! `btf-fit learn-priors`.

use crate::commands::failure::Failure;
use crate::commands::options::Shared;
use crate::commands::output::{check_distinct, check_file, is_stdout, tell};
use crate::commands::progress;
use btf_capture::{Capture, write_file_atomically};
use btf_fit::{FitParams, bytes_from_text, fit_and_measure, prior_capture, text_from_bytes};
use clap::Args;
use std::path::{Path, PathBuf};

/// Clusters for each capture: what one material does in the light has a few kinds.
const CLUSTERS_A_CAPTURE: usize = 2;

/// Learn what materials have in common from complete captures, for `fit --priors`
///
/// The captures must have the same directions. The priors are an asset of texels of all of them; any fitted asset can
/// serve as priors as well.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  btf-fit learn-priors WOOL SILK DENIM -o my-priors.spmm
  btf-fit fit LINEN_OF_FEW_IMAGES -o linen.spmm --bytes 2MB --priors my-priors.spmm")]
pub(in crate::commands) struct LearnPriorsArgs {
    /// Complete captures of the same directions, the more kinds the better
    #[arg(required = true, value_name = "CAPTURE")]
    captures: Vec<PathBuf>,
    /// The asset to write
    #[arg(short, long, value_name = "PRIORS.spmm")]
    output: PathBuf,
    /// Texels that are taken of each capture
    #[arg(long, value_name = "N", default_value_t = 256)]
    texels: usize,
    /// Largest size of the asset
    #[arg(long, value_name = "SIZE", value_parser = bytes_from_text, default_value = "300kB")]
    bytes: u64,
    /// Seed of every random choice
    #[arg(long, default_value_t = FitParams::default().seed)]
    seed: u64,
    /// Write the figures as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Result that `learn-priors --json` writes.
#[derive(Debug, serde::Serialize)]
struct LearnResult {
    asset: String,
    bytes: usize,
    captures: usize,
    texels: usize,
    clusters: usize,
    psnr_db: f64,
}

pub(in crate::commands) fn run(args: &LearnPriorsArgs, shared: &Shared) -> Result<(), Failure> {
    if is_stdout(&args.output) {
        return Err(Failure::Usage("an asset cannot be written to standard output; give -o a file name".into()));
    }
    let outputs: Vec<&Path> =
        [Some(&args.output), args.json.as_ref()].into_iter().flatten().map(PathBuf::as_path).collect();
    check_distinct(&outputs)?;
    let captures = args.captures.iter().map(Capture::open).collect::<Result<Vec<_>, _>>()?;
    for path in &outputs {
        check_file(path, &args.captures)?;
    }
    let params = FitParams {
        bytes: Some(args.bytes),
        clusters: (CLUSTERS_A_CAPTURE * captures.len()).min(256),
        lobes: 1,
        seed: args.seed,
        ..FitParams::default()
    };
    let params = params.check().map_err(|error| Failure::Usage(error.to_string()))?;
    let monitor = progress::monitor(shared, None)?;
    let mosaic = prior_capture(&captures, args.texels, args.seed, &monitor)?;
    let fitted = fit_and_measure(&[mosaic], &params, &monitor)?;
    monitor.check()?;
    write_file_atomically(&args.output, &fitted.bytes)?;
    let result = LearnResult {
        asset: args.output.display().to_string(),
        bytes: fitted.bytes.len(),
        captures: captures.len(),
        texels: args.texels * captures.len(),
        clusters: fitted.clusters,
        psnr_db: fitted.metrics.psnr_db,
    };
    tell(args.json.as_deref(), shared.quiet, &result, || {
        format!(
            "{}: {}, {} texels of {} captures in {} clusters, {:.2} dB",
            result.asset,
            text_from_bytes(result.bytes as u64),
            result.texels,
            result.captures,
            result.clusters,
            result.psnr_db
        )
    })
}
