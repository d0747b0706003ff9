//! `btf-fit expand`.

use super::failure::Failure;
use super::options::{Decoding, Shared};
use super::output::{check_file, tell};
use super::progress;
use btf_capture::{DirectionSet, ImageFormat};
use btf_fit::{ExpandParams, expand, load_asset, resident_in_parallel};
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use std::time::Instant;

/// Decode an asset back into a capture folder
///
/// With the asset's own directions (the default) and png, the files hold exactly the 8-bit values that
/// psnr_db is computed from. A layer of the back is written as a camera sees the sample turned over, like
/// the capture that it was fitted from.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  btf-fit expand wool.spmm WOOL_DECODED
  btf-fit expand wool.spmm WOOL_151 --directions dome151 --format exr")]
pub(super) struct ExpandArgs {
    /// The asset
    #[arg(value_name = "ASSET.spmm")]
    asset: PathBuf,
    /// The folder to make; it must be empty or absent
    #[arg(value_name = "OUT_DIR")]
    directory: PathBuf,
    /// Directions of view and light: bonn81, dome151, random:N, or a file of theta and phi in degrees;
    /// the asset's own if not given
    #[arg(long, value_name = "NAME|FILE")]
    directions: Option<String>,
    /// Format of the images; exr if the capture was exr, else png. A jpg adds its own error
    #[arg(long, value_enum)]
    format: Option<FormatArg>,
    /// Write the colours of an asset with a spectrum, under D65, in exr files, too; png and jpg always hold colours
    #[arg(long)]
    colours: bool,
    /// Layer of the asset, from 0; `info` lists them
    #[arg(long, value_name = "N", default_value_t = 0)]
    layer: usize,
    #[command(flatten)]
    decoding: Decoding,
    /// Write what was written as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum FormatArg {
    Png,
    Jpg,
    Exr,
}

/// Result that `expand --json` writes.
#[derive(Debug, serde::Serialize)]
struct ExpandResult {
    directory: String,
    width: usize,
    height: usize,
    views: usize,
    lights: usize,
    images: usize,
    format: String,
    side: String,
    seconds: f64,
}

pub(super) fn run(args: &ExpandArgs, shared: &Shared) -> Result<(), Failure> {
    let start = Instant::now();
    let (_, asset) = load_asset(&args.asset)?;
    let params = ExpandParams {
        layer: args.layer,
        options: args.decoding.options(),
        directions: args.directions.as_deref().map(DirectionSet::by_name).transpose()?,
        format: args.format.map(|format| match format {
            FormatArg::Png => ImageFormat::Png,
            FormatArg::Jpg => ImageFormat::Jpg,
            FormatArg::Exr => ImageFormat::Exr,
        }),
        colours: args.colours,
    };
    if let Some(target) = &args.json {
        check_file(target, std::slice::from_ref(&args.asset))?;
    }
    let monitor = progress::monitor(shared, None)?;
    let resident = resident_in_parallel(&asset);
    let info = expand(&asset, &resident, &args.directory, &params, &monitor)?;
    let result = ExpandResult {
        directory: args.directory.display().to_string(),
        width: info.width,
        height: info.height,
        views: info.views.len(),
        lights: info.lights.len(),
        images: info.pair_count(),
        format: info.format.to_string(),
        side: info.side.to_string(),
        seconds: start.elapsed().as_secs_f64(),
    };
    tell(args.json.as_deref(), shared.quiet, &result, || {
        format!(
            "{}: {} images ({} views x {} lights) of {} x {} texels, {}",
            args.directory.display(),
            result.images,
            result.views,
            result.lights,
            result.width,
            result.height,
            result.format
        )
    })
}
