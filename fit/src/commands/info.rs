//! `btf-fit info`.

use super::failure::Failure;
use super::output::{check_file, is_stdout, say, write_json};
use btf_fit::describe_file;
use clap::Args;
use std::path::PathBuf;

/// Tell what is in an asset or a volumetric texture
#[derive(Debug, Args)]
#[command(after_help = "Example:
  btf-fit info wool.spmm
  btf-fit info grass.voltex")]
pub(super) struct InfoArgs {
    /// The asset or the volumetric texture, or a tier of one
    #[arg(value_name = "FILE")]
    asset: PathBuf,
    /// Write it as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

pub(super) fn run(args: &InfoArgs) -> Result<(), Failure> {
    let description = describe_file(&args.asset)?;
    if let Some(target) = &args.json {
        check_file(target, std::slice::from_ref(&args.asset))?;
        write_json(target, &description)?;
    }
    if !args.json.as_deref().is_some_and(is_stdout) {
        say(description.to_string().trim_end());
    }
    Ok(())
}
