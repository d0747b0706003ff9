//! What bounds the error of volumes: too few rays for a pixel, and voxels that are even within.
//!
//! Prints the errors of the model itself and of volumes with few and many rays, docs/results/voltex.md, "What bounds the
//! error": `cargo run --release -p btf-tests -- voxel_bounds MODEL FILE.voltex...`.

use btf_runtime::voltex::{Voltex, Volume};
use btf_voxelize::{MarchParams, TriangleModel, VoltexRow, VoltexTruth};
use std::error::Error;
use std::path::Path;

/// Name, rays along each side of a pixel, and voxels along it as a binary logarithm.
const LOOKS: [(&str, usize, u32); 5] = [
    ("4 rays, voxels of half a pixel", 2, 1),
    ("16 rays, voxels of half a pixel", 4, 1),
    ("16 rays, voxels of a quarter", 4, 2),
    ("64 rays, voxels of half a pixel", 8, 1),
    ("64 rays, voxels of an eighth", 8, 3),
];

/// Prints the errors of volumes of a model, of files from coarse to fine, with few and many rays, and those of the
/// model itself with as many.
///
/// # Errors
/// Those of the model's and the volumes' files.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let [model, files @ ..] = arguments else { return Err("voxel_bounds MODEL FILE.voltex...".into()) };
    let truth = VoltexTruth::new(&TriangleModel::read(Path::new(model))?)?;
    println!("| | opacity ratio | T RMSE | relative image error |\n|---|---|---|---|");
    for rays in [2, 4] {
        print(&truth.measure_rays(&format!("the model, {} rays", rays * rays), rays));
    }
    for file in files {
        let voltex = Voltex::new(&Volume::parse(&std::fs::read(file)?)?);
        for (name, rays, finer) in LOOKS {
            let params = MarchParams { rays, finer, ..MarchParams::default() };
            print(&truth.measure(&format!("{} voxels a side, {name}", 1 << voltex.level_count()), &voltex, &params));
        }
    }
    Ok(())
}

fn print(row: &VoltexRow) {
    let figures = |of: &dyn Fn(usize) -> String| (0..row.pixels.len()).map(of).collect::<Vec<_>>().join(", ");
    println!(
        "| {} | {} | {} | {} |",
        row.rule,
        figures(&|i| format!("{:.3}", row.pixels[i].opacity_ratio)),
        figures(&|i| format!("{:.4}", row.pixels[i].transmittance_rmse)),
        figures(&|i| format!("{:.3}", row.pixels[i].rel_rmse))
    );
}
