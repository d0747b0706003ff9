//! `btf-fit validate`.

use super::output::{check_file, is_stdout, say, write_json};
use super::{Failure, Shared};
use btf_fit::validate_file;
use clap::Args;
use std::path::PathBuf;

/// Check an asset: everything in it, checksums included
///
/// Exits with 0 if it is valid and with 1 if it is not.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  btf-fit validate wool.spmm")]
pub(super) struct ValidateArgs {
    /// The asset, or a tier of one
    #[arg(value_name = "ASSET.spmm")]
    asset: PathBuf,
    /// Write the verdict as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What `validate --json` writes.
#[derive(Debug, serde::Serialize)]
struct Verdict {
    valid: bool,
    error: Option<String>,
    /// The layers' sides, in order; empty where it is not valid.
    layers: Vec<String>,
}

pub(super) fn run(args: &ValidateArgs, shared: &Shared) -> Result<(), Failure> {
    let result = validate_file(&args.asset);
    if let Some(target) = &args.json {
        check_file(target, std::slice::from_ref(&args.asset))?;
        let error = result.as_ref().err().map(ToString::to_string);
        let layers = result.iter().flatten().map(ToString::to_string).collect();
        write_json(target, &Verdict { valid: error.is_none(), error, layers })?;
    }
    let layers = result?;
    if !shared.quiet && !args.json.as_deref().is_some_and(is_stdout) {
        let sides: Vec<String> = layers.iter().map(ToString::to_string).collect();
        let word = if sides.len() == 1 { "layer" } else { "layers" };
        say(&format!("ok: {} {word} ({})", sides.len(), sides.join(", ")));
    }
    Ok(())
}
