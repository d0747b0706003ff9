//! `btf-fit convert`.

use super::failure::Failure;
use super::options::{Packing, Shared};
use super::output::{check_file, tell};
use btf_capture::write_file_atomically;
use btf_fit::{Shape, convert, load_asset, text_from_bytes};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Write an asset in another shape: with coarser levels, or as a renderer holds it
///
/// A fitted asset is small and holds its finest level; renderers make the coarser ones when they load it. `levels`
/// stores them, too, for about a quarter more bytes. `resident` is what renderers hold in memory: many times the bytes,
/// and nothing to decode; it is mapped and bound as it lies. `--level` writes one level for what is never seen closer.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  btf-fit convert wool.spmm --to levels -o wool_levels.spmm
  btf-fit convert wool.spmm --to resident -o wool.resident.spmm
  btf-fit convert wool.spmm --to resident --resident-bytes 15MB -o wool.resident.spmm
  btf-fit convert wool.spmm --level 2 -o wool_a_quarter.spmm")]
pub(super) struct ConvertArgs {
    /// The asset, or a tier of one
    #[arg(value_name = "ASSET.spmm")]
    asset: PathBuf,
    /// The file to write
    #[arg(short = 'o', long, value_name = "FILE")]
    out: PathBuf,
    /// The shape to write
    #[arg(long, value_enum, default_value = "resident")]
    to: ShapeArg,
    #[command(flatten)]
    packing: Packing,
    /// Write one level alone as an asset of its own: 0 is the finest, 1 has half its side, and so on
    #[arg(long, value_name = "N", conflicts_with_all = ["to", "Packing"])]
    level: Option<usize>,
    /// Write what was written as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ShapeArg {
    /// The file form without levels
    Plain,
    /// The file form with levels
    Levels,
    /// The resident form with levels
    Resident,
}

/// Result that `convert --json` writes.
#[derive(Debug, serde::Serialize)]
struct Converted {
    file: String,
    bytes: usize,
    bytes_before: usize,
}

pub(super) fn run(args: &ConvertArgs, shared: &Shared) -> Result<(), Failure> {
    let (before, asset) = load_asset(&args.asset)?;
    let inputs = std::slice::from_ref(&args.asset);
    check_file(&args.out, inputs)?;
    if let Some(target) = &args.json {
        check_file(target, inputs)?;
    }
    let goal = args.packing.goal();
    if goal.is_some() && args.to != ShapeArg::Resident {
        return Err(Failure::Usage("only the resident form has packed bases; leave --to away".into()));
    }
    let shape = match (args.level, args.to) {
        (Some(number), _) => Shape::Level(number),
        (None, ShapeArg::Plain) => Shape::Plain,
        (None, ShapeArg::Levels) => Shape::Levels,
        (None, ShapeArg::Resident) => goal.map_or(Shape::Resident, Shape::Packed),
    };
    let bytes = convert(&asset, shape)?;
    write_file_atomically(&args.out, &bytes)?;
    let result = Converted { file: args.out.display().to_string(), bytes: bytes.len(), bytes_before: before.len() };
    tell(args.json.as_deref(), shared.quiet, &result, || {
        format!(
            "{}: {} ({} before)",
            result.file,
            text_from_bytes(bytes.len() as u64),
            text_from_bytes(before.len() as u64)
        )
    })
}
