//! `btf-fit validate`.

use super::failure::Failure;
use super::options::Shared;
use super::output::{check_file, is_stdout, say, write_json};
use btf_fit::{FitError, Validation, validate_file};
use clap::Args;
use std::path::{Path, PathBuf};

/// Check an asset or a volumetric texture: everything in it, checksums included
///
/// Every error and every warning is a line with a number that docs/FINDINGS.md or docs/VOLTEX.md explains. Exits with 0
/// if there is no error and with 1 if there is one.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  btf-fit validate wool.spmm
  btf-fit validate grass.voltex")]
pub(super) struct ValidateArgs {
    /// The asset or the volumetric texture, or a tier of one
    #[arg(value_name = "FILE")]
    asset: PathBuf,
    /// Write the findings as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Result that `validate --json` writes.
#[derive(Debug, serde::Serialize)]
struct Verdict<'a> {
    file: &'a Path,
    #[serde(flatten)]
    found: &'a Validation,
}

pub(super) fn run(args: &ValidateArgs, shared: &Shared) -> Result<(), Failure> {
    let found = validate_file(&args.asset)?;
    if let Some(target) = &args.json {
        check_file(target, std::slice::from_ref(&args.asset))?;
        write_json(target, &Verdict { file: &args.asset, found: &found })?;
    }
    if !shared.quiet && !args.json.as_deref().is_some_and(is_stdout) {
        // What the asset is, `info` tells better.
        for finding in found.findings.iter().filter(|finding| finding.severity != "information") {
            say(&finding.line);
        }
        if found.valid {
            say(&format!("ok: {}", found.holds));
        }
    }
    match found.error {
        None => Ok(()),
        Some(first) => {
            let first = first.trim_start_matches("error ").to_string();
            Err(FitError::Invalid { path: args.asset.clone(), errors: found.counts.error, first }.into())
        }
    }
}
