//! `btf-fit bench gemm`.

use crate::commands::failure::Failure;
use crate::commands::options::Shared;
use crate::commands::output::tell;
use btf_fit::{GemmBench, GpuChoice, bench_gemm};
use clap::Args;
use std::path::PathBuf;

/// Time the matrix product of `fit --gpu` on an adapter, beside the CPU
///
/// The peak is measured, too: fused multiply-adds in registers. The size is that of a fit's products: texels by direction pairs
/// and channels, by shared bases.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  btf-fit bench gemm
  btf-fit bench gemm --rows 8192 --inner 19683 --columns 336 --json -")]
pub(super) struct GemmArgs {
    /// The adapter: auto, or a part of its name
    #[arg(long, value_name = "auto|NAME", default_value = "auto", value_parser = GpuChoice::from_words)]
    gpu: GpuChoice,
    /// Rows of the result
    #[arg(long, value_name = "N", default_value_t = 4096, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    rows: u32,
    /// Length of the sums
    #[arg(long, value_name = "N", default_value_t = 6561, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    inner: u32,
    /// Columns of the result
    #[arg(long, value_name = "N", default_value_t = 336, value_parser = clap::value_parser!(u32).range(1..=65_536))]
    columns: u32,
    /// Repeats, of which the quickest counts
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: u32,
    /// Write the figures as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

pub(super) fn run(args: &GemmArgs, shared: &Shared) -> Result<(), Failure> {
    if args.gpu == GpuChoice::Off {
        return Err(Failure::Usage(
            "--gpu off leaves nothing to time; give auto or a part of an adapter's name".into(),
        ));
    }
    let size = [args.rows, args.inner, args.columns].map(|number| number as usize);
    let found = bench_gemm(&args.gpu, size, args.repeats as usize)?.map_err(Failure::Path)?;
    tell(args.json.as_deref(), shared.quiet, &found, || summary(&found))
}

fn summary(bench: &GemmBench) -> String {
    let kind = if bench.software { ", a driver that computes on the CPU" } else { "" };
    let mut lines =
        vec![format!("{}{kind}: {:.0} GFLOP/s at most, measured in registers", bench.adapter, bench.peak_gflops)];
    for product in &bench.products {
        let [rows, inner, columns] = product.size;
        lines.push(format!(
            "{} {}: {rows} x {inner} x {columns}: {:.1} GFLOP/s, {:.0} % of that; {:.1} with copying; CPU {:.1}",
            product.precision,
            if product.transposed { "by columns" } else { "by rows" },
            product.gflops,
            100.0 * product.share_of_peak,
            product.gflops_with_copy,
            product.cpu_gflops
        ));
    }
    lines.join("\n")
}
