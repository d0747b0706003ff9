//! `btf-fit library`: many captures, one plan.

mod collect;
mod plan;
mod run;

use crate::commands::failure::Failure;
use crate::commands::options::Shared;
use clap::{Args, Subcommand};

/// Fit many captures by one plan, with any number of workers, and make a catalogue
#[derive(Debug, Args)]
#[command(after_help = "Example:
  btf-fit library plan CAPTURES -o library.toml --bytes 2MB
  btf-fit library run library.toml        # on as many machines as there are, at the same time
  btf-fit library collect library.toml    # library.html, .json and .csv")]
pub(super) struct LibraryArgs {
    #[command(subcommand)]
    command: LibraryCommand,
}

#[derive(Debug, Subcommand)]
enum LibraryCommand {
    Plan(plan::PlanArgs),
    Run(run::RunArgs),
    Collect(collect::CollectArgs),
}

pub(super) fn run(args: &LibraryArgs, shared: &Shared) -> Result<(), Failure> {
    match &args.command {
        LibraryCommand::Plan(args) => plan::run(args, shared),
        LibraryCommand::Run(args) => run::run(args, shared),
        LibraryCommand::Collect(args) => collect::run(args, shared),
    }
}
