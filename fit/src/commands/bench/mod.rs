//! `btf-fit bench`: speed and cost of the fitter on this machine.

mod cost;
mod gemm;

use crate::commands::failure::Failure;
use crate::commands::options::Shared;
use clap::{Args, Subcommand};

/// Measure the fitter on this machine
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  btf-fit bench gemm
  btf-fit bench cost WOOL SILK LEAF -o cost.toml --held-out DENIM")]
pub(super) struct BenchArgs {
    #[command(subcommand)]
    command: BenchCommand,
}

#[derive(Debug, Subcommand)]
enum BenchCommand {
    Cost(cost::CostArgs),
    Gemm(gemm::GemmArgs),
}

pub(super) fn run(args: &BenchArgs, shared: &Shared) -> Result<(), Failure> {
    match &args.command {
        BenchCommand::Cost(args) => cost::run(args, shared),
        BenchCommand::Gemm(args) => gemm::run(args, shared),
    }
}
