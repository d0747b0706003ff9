//! `btf-fit export-usd`.

use super::failure::Failure;
use super::maps::{MapsArg, line_of_part};
use super::options::Shared;
use super::output::{check_file, tell, write_with_files_beside};
use super::progress;
use btf_fit::{AssetPlace, UsdExport, export_usd, read_file, text_from_bytes, with_path};
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// Write an asset as OpenUSD: UsdPreviewSurface and OpenPBR Surface with fitted textures
///
/// FILE is a plane of the asset's physical size. Its material has UsdPreviewSurface, which every program of USD shows, and an
/// OpenPBR Surface of MaterialX for those that know it; it names the asset in its custom data. A .usda is text, with its
/// textures beside it as PNG files whose names start with FILE's; a .usdz is one file that holds them.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  btf-fit export-usd wool.spmm -o wool.usda
  btf-fit export-usd wool.spmm -o wool.usdz")]
pub(super) struct ExportUsdArgs {
    /// The asset, in either form, or a tier of one
    #[arg(value_name = "ASSET.spmm")]
    asset: PathBuf,
    /// The file to write; its name ends in .usda or .usdz
    #[arg(short = 'o', long, value_name = "FILE")]
    out: PathBuf,
    /// Which optional parts of OpenPBR to fit
    #[arg(long, value_enum, default_value = "auto")]
    maps: MapsArg,
    /// Write what was written as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Result that `export-usd --json` writes.
#[derive(Debug, Serialize)]
struct Exported<'a> {
    file: String,
    textures: Vec<String>,
    bytes: usize,
    seconds: f64,
    #[serde(flatten)]
    export: &'a UsdExport,
}

pub(super) fn run(args: &ExportUsdArgs, shared: &Shared) -> Result<(), Failure> {
    let start = Instant::now();
    let bytes = read_file(&args.asset)?;
    let inputs = std::slice::from_ref(&args.asset);
    let name = args.out.file_name().unwrap_or_default().to_string_lossy();
    let ending = [".usda", ".usdz"].into_iter().find(|ending| name.ends_with(ending) && name.len() > ending.len());
    let Some(ending) = ending else {
        return Err(Failure::Usage(format!(
            "{} ends neither in .usda nor in .usdz; give the output such a name, programs know USD by it",
            args.out.display()
        )));
    };
    let stem = &name[..name.len() - ending.len()];
    check_file(&args.out, inputs)?;
    if let Some(target) = &args.json {
        check_file(target, inputs)?;
    }
    let asset = AssetPlace::uri_beside(&args.asset, &args.out)?;
    let monitor = progress::monitor(shared, None)?;
    let export =
        export_usd(bytes, stem, &asset, args.maps.into(), &monitor).map_err(|error| with_path(&args.asset, error))?;
    let (whole, beside): (_, &[(String, Vec<u8>)]) = match ending {
        ".usdz" => (export.package(&format!("{stem}.usda"))?, &[]),
        _ => (export.layer.clone().into_bytes(), &export.textures),
    };
    let paths = write_with_files_beside(&args.out, &whole, beside, args.json.as_deref(), inputs)?;
    let result = Exported {
        file: args.out.display().to_string(),
        textures: paths.iter().map(|path| path.display().to_string()).collect(),
        bytes: whole.len() + beside.iter().map(|(_, bytes)| bytes.len()).sum::<usize>(),
        seconds: start.elapsed().as_secs_f64(),
        export: &export,
    };
    tell(args.json.as_deref(), shared.quiet, &result, || text(&result))
}

/// Returns the summary of an export for people.
fn text(result: &Exported<'_>) -> String {
    let figures = &result.export.figures;
    let mut lines = vec![format!(
        "{}: {} with {} textures of {} x {} texels",
        result.file,
        text_from_bytes(result.bytes as u64),
        result.export.textures.len(),
        figures.width,
        figures.height,
    )];
    lines.extend(figures.tried.iter().map(line_of_part));
    lines.push(format!("OpenPBR    {:.2} dB against the asset (8-bit sRGB)", figures.psnr_db));
    lines.push(format!("preview    {:.2} dB, UsdPreviewSurface", result.export.psnr_preview_db));
    lines.join("\n")
}
