//! `btf-view bench`: measures how the time of a frame grows.

use super::assets::load_assets;
use super::gpu_bench::{self, GpuBenchArguments};
use super::parse::parse_size;
use super::progress::with_progress;
use super::render_arguments::RenderArguments;
use super::report::write_json;
use btf_viewer::{BenchKind, BenchParams, BenchReport, SceneAsset, ViewerError, bench_svg, run_bench};
use std::path::PathBuf;
use std::sync::Arc;

#[derive(clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(super) struct BenchArguments {
    #[command(subcommand)]
    pub(super) whole: Option<WholeBench>,
    /// What is varied
    #[arg(value_enum, required = true)]
    pub(super) kind: Option<BenchKind>,
    /// Packed assets [default: a small one that comes with the program]
    pub(super) assets: Vec<PathBuf>,
    /// Model that `triangles` places ever more often, and `resolution` if it is given: an .obj, .gltf or .glb file
    #[arg(long, value_name = "FILE")]
    pub(super) mesh: Option<PathBuf>,
    /// Size of the picture in pixels
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "512x512")]
    pub(super) size: [u32; 2],
    #[command(flatten)]
    pub(super) render: RenderArguments,
    /// Writes the rows as JSON; - is stdout
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
    /// Writes a plot
    #[arg(long, value_name = "FILE.svg")]
    pub(super) plot: Option<PathBuf>,
}

#[derive(clap::Subcommand)]
pub(super) enum WholeBench {
    /// Measures a GPU by everything in one run, and compares it with the CPU
    #[command(after_help = "Example: btf-view bench gpu cloth.spmm --mesh canopy.glb -o gpu-run")]
    Gpu(GpuBenchArguments),
}

/// Runs the command.
///
/// # Errors
/// The errors of [`run_bench`] and of writing files.
pub(super) fn run(arguments: &BenchArguments) -> Result<(), ViewerError> {
    let kind = match (&arguments.whole, arguments.kind) {
        (Some(WholeBench::Gpu(gpu)), _) => return gpu_bench::run(gpu),
        (None, Some(kind)) => kind,
        (None, None) => return Err(ViewerError::Usage("say what is varied, as in `bench lights`".into())),
    };
    let render = &arguments.render;
    let mut assets = load_assets(&arguments.assets)?;
    if assets.is_empty() {
        assets.push(Arc::new(SceneAsset::built_in()));
    }
    render.pack(&mut assets)?;
    let params = BenchParams {
        kind,
        mesh: arguments.mesh.clone(),
        size: arguments.size,
        backend: render.backend(),
        adapter: render.adapter.clone(),
        shade: render.shade(),
    };
    let report = with_progress(render.quiet, |control| run_bench(&assets, &params, control))?;
    if let Some(path) = &arguments.plot {
        let svg = bench_svg(&report).map_err(ViewerError::Usage)?;
        btf_capture::atomic::write_file_atomically(path, svg.as_bytes())?;
    }
    match arguments.json.as_deref() {
        path @ Some(_) => write_json(path, &report)?,
        None if render.quiet => {}
        None => print_rows(&report),
    }
    Ok(())
}

/// Prints a line for each measured point, and one for each mode of a live leaf.
fn print_rows(report: &BenchReport) {
    println!("{} on {} ({}), {}", report.backend, report.adapter, report.timer, report.assets.join(", "));
    println!("mesh       lights materials coverage       size components  triangles    ms a frame   dB  variant");
    for row in &report.rows {
        println!(
            "{:<10} {:>6} {:>9} {:>8.3} {:>10} {:>10} {:>10} {:>13.3} {:>5} {} {}{}",
            row.mesh,
            row.lights,
            row.materials,
            row.coverage,
            format!("{}x{}", row.width, row.height),
            row.components,
            row.triangles,
            row.frame_ms,
            row.psnr_db.map_or(String::new(), |psnr| format!("{psnr:.1}")),
            row.interpolation,
            row.variant,
            if row.front { " *" } else { "" }
        );
    }
    for row in &report.leaf_modes {
        println!(
            "live leaf, {:<11}: Delta E00 {:.2} mean, {:.2} max; {:.0} ns for place and eye, {:.0} ns for a light",
            row.mode, row.delta_e00_mean, row.delta_e00_max, row.view_ns, row.light_ns
        );
    }
}
