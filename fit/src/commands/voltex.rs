//! `btf-fit voltex`.

use super::failure::Failure;
use super::options::Shared;
use super::output::{check_file, tell};
use btf_capture::write_file_atomically;
use btf_fit::{FitError, text_from_bytes};
use btf_models::shapes::{SCRIPT_ENDING, Script};
use btf_voxelize::shapes::{Paints, build_painted, coats_of, paint};
use btf_voxelize::{TRIANGLE_BYTES, TriangleModel, VoltexParams, VoxelizeError, build_voltex};
use clap::Args;
use std::path::PathBuf;

/// Make a volumetric texture of a model: a small volume that looks like it from afar
///
/// Leaves, stems and whatever else the model has become voxels of microflakes, at levels from fine to coarse, fitted to
/// what rays past the model see. A renderer draws them with one ray a pixel.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  btf-synth plants tree.glb --species tree
  btf-fit voltex tree.glb -o tree.voltex
  btf-fit voltex tree.glb -o tree_fine.voltex --resolution 256
  btf-fit voltex patch.shapes.toml -o patch.voltex --resolution 128")]
pub(super) struct VoltexArgs {
    /// The model: .obj, .gltf or .glb, in metres, y up; or a script of shapes, .shapes.toml, z up
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// The file to write
    #[arg(short = 'o', long, value_name = "FILE.voltex")]
    out: PathBuf,
    /// Voxels a side of the finest level: a power of two
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = resolution)]
    resolution: u32,
    /// Directions from which each level is fitted to the model; 0 leaves it as the voxels' contents say
    #[arg(long, value_name = "N", default_value_t = 24, value_parser = clap::value_parser!(u16).range(0..=512))]
    views: u16,
    /// Write what was built as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Most voxels along a side.
const MAX_RESOLUTION: u32 = 1 << btf_runtime::voltex::MAX_LEVELS;

fn resolution(text: &str) -> Result<u32, String> {
    let number: u32 = text.parse().map_err(|_| "not a whole number".to_string())?;
    if number.is_power_of_two() && number <= MAX_RESOLUTION {
        Ok(number)
    } else {
        Err(format!("a power of two from 1 to {MAX_RESOLUTION} is needed"))
    }
}

/// Result that `voltex --json` writes.
#[derive(Debug, serde::Serialize)]
struct Built {
    file: String,
    bytes: usize,
    triangles: usize,
    mesh_bytes: usize,
    side_m: f32,
    materials: usize,
    /// Voxels of each level, finest first.
    voxels: Vec<usize>,
    seconds: f64,
}

pub(super) fn run(args: &VoltexArgs, shared: &Shared) -> Result<(), Failure> {
    let start = std::time::Instant::now();
    let inputs = std::slice::from_ref(&args.model);
    check_file(&args.out, inputs)?;
    if let Some(target) = &args.json {
        check_file(target, inputs)?;
    }
    let mut params = VoltexParams { resolution: args.resolution, ..VoltexParams::default() };
    params.refit.views = usize::from(args.views);
    let (volume, triangles) = if args.model.to_string_lossy().ends_with(SCRIPT_ENDING) {
        let script = Script::read(&args.model).map_err(VoxelizeError::from)?;
        let coats = coats_of(&args.model, &script.materials)?;
        let canvas = paint(&script, params.resolution, &Paints { script: &args.model, coats: &coats })?;
        (build_painted(&canvas, &params), canvas.triangles.len())
    } else {
        let model = TriangleModel::read(&args.model)?;
        (build_voltex(&model, &params), model.triangles.len())
    };
    let mut volume = volume.map_err(|error| error.of_model(&args.model))?;
    let name = args.model.file_stem().map_or_else(|| "volume".into(), |stem| stem.to_string_lossy().into_owned());
    volume.description = serde_json::json!({
        "name": name,
        "triangles": triangles,
        "resolution": params.resolution,
        "views": params.refit.views,
    })
    .to_string();
    let bytes = volume.pack().map_err(FitError::from)?;
    write_file_atomically(&args.out, &bytes)?;
    let result = Built {
        file: args.out.display().to_string(),
        bytes: bytes.len(),
        triangles,
        mesh_bytes: triangles * TRIANGLE_BYTES,
        side_m: volume.side_m,
        materials: volume.materials.len(),
        voxels: volume.levels.iter().map(|level| level.voxels.len()).collect(),
        seconds: start.elapsed().as_secs_f64(),
    };
    tell(args.json.as_deref(), shared.quiet, &result, || {
        format!(
            "{}: {}, {} triangles in {} voxels of {:.1} mm",
            result.file,
            text_from_bytes(bytes.len() as u64),
            result.triangles,
            result.voxels.first().unwrap_or(&0),
            1000.0 * result.side_m / params.resolution as f32,
        )
    })
}
