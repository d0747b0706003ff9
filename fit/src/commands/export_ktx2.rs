//! `btf-fit export-ktx2`.

use super::failure::Failure;
use super::options::Shared;
use super::output::{check_file, tell, write_with_files_beside};
use super::progress;
use btf_capture::Capture;
use btf_fit::{
    FilteredFigures, FilteredParams, bytes_from_text, export_filtered, export_ktx2, load_asset, read_file,
    text_from_bytes, with_path,
};
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;

/// Write an asset as KTX2 textures, for engines without a reader of .spmm
///
/// FILE holds what each texel has, as planes of one array with mip levels, and says in its key/value data where
/// everything lies. The bases of each layer stand beside it, in FILE's name with .bases-front.ktx2 and so on in place
/// of .ktx2. docs/reference/ktx2.md tells how a value is decoded from them.
///
/// With --bc textures are block-compressed (BC5, BC7) and hold the material without clusters and lobes, so that samplers
/// filter them; a short shader decodes them. They are fitted anew, at some loss that is told;
/// docs/reference/ktx2-filtered.md.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  btf-fit export-ktx2 wool.spmm -o wool.ktx2
  btf-fit export-ktx2 wool.spmm -o wool.ktx2 --bc --bytes 12MB
  btf-fit export-ktx2 wool.spmm -o wool.ktx2 --bc --capture WOOL")]
pub(super) struct ExportKtx2Args {
    /// The asset, in either form, or a tier of one
    #[arg(value_name = "ASSET.spmm")]
    asset: PathBuf,
    /// The file of the planes; its name ends in .ktx2
    #[arg(short = 'o', long, value_name = "FILE")]
    out: PathBuf,
    /// Write block-compressed textures that samplers filter
    #[arg(long)]
    bc: bool,
    /// Most memory that the textures may take on the GPU, such as 12MB; 183 bytes a texel and layer if not given, or
    /// what 128 components take
    #[arg(long, value_name = "SIZE", value_parser = bytes_from_text, requires = "bc")]
    bytes: Option<u64>,
    /// Fit the finest texels to this capture, which the asset was fitted to, in place of the asset: less is lost. One
    /// for each layer
    #[arg(long = "capture", value_name = "CAPTURE", requires = "bc")]
    captures: Vec<PathBuf>,
    /// Most memory to use for the captures' images
    #[arg(long, value_name = "SIZE", value_parser = bytes_from_text, default_value = "4GB", requires = "bc")]
    memory: u64,
    /// Write what was written as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Result that `export-ktx2 --json` writes.
#[derive(Debug, Serialize)]
struct Exported {
    files: Vec<Written>,
    width: usize,
    height: usize,
    planes: usize,
    levels: usize,
}

/// Result that `export-ktx2 --bc --json` writes.
#[derive(Debug, Serialize)]
struct ExportedFiltered {
    files: Vec<Written>,
    memory_bytes: usize,
    layers: Vec<FilteredFigures>,
}

#[derive(Debug, Serialize)]
struct Written {
    file: String,
    bytes: usize,
}

pub(super) fn run(args: &ExportKtx2Args, shared: &Shared) -> Result<(), Failure> {
    let name = args.out.file_name().unwrap_or_default().to_string_lossy();
    let Some(stem) = name.strip_suffix(".ktx2").filter(|stem| !stem.is_empty()) else {
        return Err(Failure::Usage(format!(
            "{} does not end in .ktx2; give the output such a name, others are made of it",
            args.out.display()
        )));
    };
    check_file(&args.out, &inputs(args))?;
    if let Some(target) = &args.json {
        check_file(target, &inputs(args))?;
    }
    if args.bc { run_filtered(args, stem, shared) } else { run_planes(args, stem, shared) }
}

fn run_planes(args: &ExportKtx2Args, stem: &str, shared: &Shared) -> Result<(), Failure> {
    let bytes = read_file(&args.asset)?;
    let export = export_ktx2(bytes, stem).map_err(|error| with_path(&args.asset, error))?;
    let files = write(args, &export.files)?;
    let [width, height] = export.size;
    let result = Exported { files, width, height, planes: export.planes, levels: export.levels };
    tell(args.json.as_deref(), shared.quiet, &result, || {
        format!(
            "{}\n{} planes of {width} x {height} texels, {} levels",
            lines(&result.files),
            result.planes,
            result.levels
        )
    })
}

fn run_filtered(args: &ExportKtx2Args, stem: &str, shared: &Shared) -> Result<(), Failure> {
    let (_, asset) = load_asset(&args.asset)?;
    let captures = args.captures.iter().map(Capture::open).collect::<Result<Vec<_>, _>>()?;
    let monitor = progress::monitor(shared, None)?;
    let params = FilteredParams { bytes: args.bytes, memory_bytes: args.memory };
    let export =
        export_filtered(&asset, stem, &captures, &params, &monitor).map_err(|error| with_path(&args.asset, error))?;
    if asset.width % 4 != 0 || asset.height % 4 != 0 {
        monitor.remark(&format!(
            "{} x {} texels are no whole blocks of 4: Vulkan takes these textures, Direct3D and WebGPU do not",
            asset.width, asset.height
        ));
    }
    let files = write(args, &export.files)?;
    let result = ExportedFiltered { files, memory_bytes: export.memory_bytes, layers: export.layers };
    tell(args.json.as_deref(), shared.quiet, &result, || {
        let layers: Vec<String> = result.layers.iter().map(layer_line).collect();
        format!(
            "{}\n{}\n{} in memory",
            lines(&result.files),
            layers.join("\n"),
            text_from_bytes(result.memory_bytes as u64)
        )
    })
}

/// Says what a layer's textures are and what is lost.
fn layer_line(layer: &FilteredFigures) -> String {
    let error = &layer.error;
    let mut line = format!(
        "{}: {} components, {} of them with mip levels; {} texture reads at the finest level; {:.2} dB to the asset",
        layer.side, layer.components, layer.coarse_components, layer.reads[0], error.psnr_to_asset_db
    );
    if let (Some(textures), Some(asset)) = (error.psnr_to_capture_db, error.asset_psnr_to_capture_db) {
        line += &format!(", {textures:.2} dB to the capture (the asset: {asset:.2})");
    }
    line
}

fn lines(files: &[Written]) -> String {
    let lines: Vec<String> =
        files.iter().map(|written| format!("{}: {}", written.file, text_from_bytes(written.bytes as u64))).collect();
    lines.join("\n")
}

/// Writes the files, the first one, which names the others, last.
fn write(args: &ExportKtx2Args, files: &[(String, Vec<u8>)]) -> Result<Vec<Written>, Failure> {
    let (_, first) = &files[0];
    let paths = write_with_files_beside(&args.out, first, &files[1..], args.json.as_deref(), &inputs(args))?;
    let paths = std::iter::once(&args.out).chain(&paths);
    let written = paths.zip(files);
    Ok(written.map(|(path, (_, bytes))| Written { file: path.display().to_string(), bytes: bytes.len() }).collect())
}

/// Returns the files and folders that are read.
fn inputs(args: &ExportKtx2Args) -> Vec<PathBuf> {
    std::iter::once(&args.asset).chain(&args.captures).cloned().collect()
}
