//! `btf-fit export-gltf`.

use super::failure::Failure;
use super::maps::{MapsArg, line_of_part};
use super::options::Shared;
use super::output::{check_distinct, check_file, tell};
use super::progress;
use btf_capture::write_file_atomically;
use btf_fit::{AssetPlace, GltfExport, export_gltf, read_file, text_from_bytes, with_path};
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Write a .glb that shows an asset in every glTF viewer
///
/// The material points at the asset in the extension BTF_materials_spmm, for viewers that decode it, btf-view among
/// them. For all others it has textures of glTF's own material model, fitted to the asset: base colour, roughness,
/// normal and, where they help, specular, sheen and diffuse transmission. The mesh is a quad of the asset's physical
/// size, 0.1 m wide where that is not known.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  btf-fit export-gltf wool.spmm -o wool.glb
  btf-fit export-gltf wool.spmm -o wool.glb --embed")]
pub(super) struct ExportGltfArgs {
    /// The asset, in either form, or a tier of one
    #[arg(value_name = "ASSET.spmm")]
    asset: PathBuf,
    /// The .glb to write
    #[arg(short = 'o', long, value_name = "FILE")]
    out: PathBuf,
    /// Put the asset into the .glb; without it the .glb names the file, relative to itself
    #[arg(long)]
    embed: bool,
    /// Which optional textures to write
    #[arg(long, value_enum, default_value = "auto")]
    maps: MapsArg,
    /// Write what was written as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Result that `export-gltf --json` writes.
#[derive(Debug, Serialize)]
struct Exported<'a> {
    file: String,
    bytes: usize,
    seconds: f64,
    #[serde(flatten)]
    export: &'a GltfExport,
}

pub(super) fn run(args: &ExportGltfArgs, shared: &Shared) -> Result<(), Failure> {
    let start = Instant::now();
    let bytes = read_file(&args.asset)?;
    let inputs = std::slice::from_ref(&args.asset);
    check_file(&args.out, inputs)?;
    if let Some(target) = &args.json {
        check_file(target, inputs)?;
        check_distinct(&[&args.out, target])?;
    }
    let place = if args.embed { AssetPlace::Embedded } else { AssetPlace::beside(&args.asset, &args.out)? };
    let monitor = progress::monitor(shared, None)?;
    let name = args.asset.file_stem().unwrap_or_default().to_string_lossy();
    let export =
        export_gltf(bytes, &name, place, args.maps.into(), &monitor).map_err(|error| with_path(&args.asset, error))?;
    write_file_atomically(&args.out, &export.glb)?;
    let result = Exported {
        file: args.out.display().to_string(),
        bytes: export.glb.len(),
        seconds: start.elapsed().as_secs_f64(),
        export: &export,
    };
    tell(args.json.as_deref(), shared.quiet, &result, || text(&args.out, &export))
}

/// Returns the summary of an export for people.
fn text(file: &Path, export: &GltfExport) -> String {
    let mut lines = vec![format!(
        "{}: {}, {} x {} texels on {:.4} x {:.4} m",
        file.display(),
        text_from_bytes(export.glb.len() as u64),
        export.width,
        export.height,
        export.size_m[0],
        export.size_m[1]
    )];
    lines.extend(export.tried.iter().map(line_of_part));
    lines.push(format!("fallback   {:.2} dB against the asset (8-bit sRGB)", export.psnr_db));
    if let Some(db) = export.psnr_transmitted_db {
        lines.push(format!("           {db:.2} dB where the light comes through"));
    }
    lines.join("\n")
}
