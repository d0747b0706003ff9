//! `btf-fit export-mtlx`.

use super::failure::Failure;
use super::maps::{MapsArg, line_of_part};
use super::options::Shared;
use super::output::{check_file, tell, write_with_files_beside};
use super::progress;
use btf_fit::{AssetPlace, MaterialXExport, export_materialx, read_file, text_from_bytes, with_path};
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// Write an asset as a MaterialX document: OpenPBR Surface with fitted textures
///
/// FILE has a material with an OpenPBR Surface, and another with a Standard Surface for programs that do not know OpenPBR.
/// Their textures lie beside it as PNG files whose names start with FILE's. Base, gloss with anisotropy, normal and, where
/// they help, a coat with a normal of its own and fuzz are fitted to the asset under many lights and views. The materials
/// name the asset in the attribute btf_asset. docs/reference/materialx.md tells what each texture holds.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  btf-fit export-mtlx wool.spmm -o wool.mtlx")]
pub(super) struct ExportMtlxArgs {
    /// The asset, in either form, or a tier of one
    #[arg(value_name = "ASSET.spmm")]
    asset: PathBuf,
    /// The document to write; its name ends in .mtlx
    #[arg(short = 'o', long, value_name = "FILE")]
    out: PathBuf,
    /// Which optional parts of the model to fit
    #[arg(long, value_enum, default_value = "auto")]
    maps: MapsArg,
    /// Write what was written as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Result that `export-mtlx --json` writes.
#[derive(Debug, Serialize)]
struct Exported<'a> {
    file: String,
    textures: Vec<String>,
    bytes: usize,
    seconds: f64,
    #[serde(flatten)]
    export: &'a MaterialXExport,
}

pub(super) fn run(args: &ExportMtlxArgs, shared: &Shared) -> Result<(), Failure> {
    let start = Instant::now();
    let bytes = read_file(&args.asset)?;
    let inputs = std::slice::from_ref(&args.asset);
    let name = args.out.file_name().unwrap_or_default().to_string_lossy();
    let Some(stem) = name.strip_suffix(".mtlx").filter(|stem| !stem.is_empty()) else {
        return Err(Failure::Usage(format!(
            "{} does not end in .mtlx; give the output such a name, programs know MaterialX by it",
            args.out.display()
        )));
    };
    check_file(&args.out, inputs)?;
    if let Some(target) = &args.json {
        check_file(target, inputs)?;
    }
    let asset = AssetPlace::uri_beside(&args.asset, &args.out)?;
    let monitor = progress::monitor(shared, None)?;
    let export = export_materialx(bytes, stem, &asset, args.maps.into(), &monitor)
        .map_err(|error| with_path(&args.asset, error))?;
    let paths =
        write_with_files_beside(&args.out, export.document.as_bytes(), &export.textures, args.json.as_deref(), inputs)?;
    let result = Exported {
        file: args.out.display().to_string(),
        textures: paths.iter().map(|path| path.display().to_string()).collect(),
        bytes: export.document.len() + export.textures.iter().map(|(_, bytes)| bytes.len()).sum::<usize>(),
        seconds: start.elapsed().as_secs_f64(),
        export: &export,
    };
    tell(args.json.as_deref(), shared.quiet, &result, || text(&result))
}

/// Returns the summary of an export for people.
fn text(result: &Exported<'_>) -> String {
    let figures = &result.export.figures;
    let mut lines = vec![format!(
        "{} and {} textures of {} x {} texels: {}",
        result.file,
        result.textures.len(),
        figures.width,
        figures.height,
        text_from_bytes(result.bytes as u64),
    )];
    lines.extend(figures.tried.iter().map(line_of_part));
    lines.push(format!("OpenPBR    {:.2} dB against the asset (8-bit sRGB)", figures.psnr_db));
    lines.push(format!("glTF       {:.2} dB, the material of export-gltf --maps all", figures.psnr_gltf_db));
    lines.join("\n")
}
