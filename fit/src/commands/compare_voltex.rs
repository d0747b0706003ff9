//! `btf-fit compare` of a volumetric texture.

use super::failure::Failure;
use super::options::Shared;
use super::output::{check_file, tell};
use super::progress;
use btf_runtime::voltex::{Voltex, Volume};
use btf_voxelize::{Ablation, TRIANGLE_BYTES, TriangleModel, VoltexRow, measure_voltex};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

/// A volumetric texture and the model that it is compared with.
pub(super) struct Compared<'a> {
    pub model: &'a Path,
    pub file: &'a Path,
    /// Bytes of the file.
    pub bytes: usize,
    pub volume: &'a Volume,
}

/// Result that `compare --json` writes for a volumetric texture.
#[derive(Debug, serde::Serialize)]
struct VoltexResult {
    model: String,
    asset: String,
    bytes: usize,
    /// Bytes that a decoder holds.
    resident_bytes: usize,
    triangles: usize,
    /// Bytes of the triangles' corners.
    mesh_bytes: usize,
    rows: Vec<VoltexRow>,
    seconds: f64,
}

pub(super) fn run(compared: &Compared, ablate: bool, json: Option<&Path>, shared: &Shared) -> Result<(), Failure> {
    let start = Instant::now();
    if let Some(path) = json {
        check_file(path, &[compared.model.to_path_buf(), compared.file.to_path_buf()])?;
    }
    let model = TriangleModel::read(compared.model)?;
    let monitor = progress::monitor(shared, None)?;
    let ablations: &[Ablation] = if ablate { &Ablation::ALL } else { &[] };
    let progress = |done, total| match monitor.report("measure", done, total) {
        Ok(()) => ControlFlow::Continue(()),
        Err(_) => ControlFlow::Break(()),
    };
    let rows = measure_voltex(&model, compared.volume, compared.bytes, ablations, progress)
        .map_err(|error| error.of_model(compared.model))?;
    let result = VoltexResult {
        model: compared.model.display().to_string(),
        asset: compared.file.display().to_string(),
        bytes: compared.bytes,
        resident_bytes: 4 * Voltex::new(compared.volume).words().len(),
        triangles: model.triangles.len(),
        mesh_bytes: model.triangles.len() * TRIANGLE_BYTES,
        rows,
        seconds: start.elapsed().as_secs_f64(),
    };
    tell(json, shared.quiet, &result, || summary(&result))
}

fn summary(result: &VoltexResult) -> String {
    let mut text = format!(
        "{} bytes, {} in memory; {} triangles of {} bytes\n{:46} pixel  opacity  T RMSE  relative  energy",
        result.bytes, result.resident_bytes, result.triangles, result.mesh_bytes, ""
    );
    for row in &result.rows {
        for of_pixel in &row.pixels {
            let [least, most] = of_pixel.energy();
            text += &format!(
                "\n{:46} {:>5}  {:7.3}  {:.4}  {:8.3}  {least:.3} to {most:.3}",
                row.rule,
                format!("1/{}", of_pixel.pixels),
                of_pixel.opacity_ratio,
                of_pixel.transmittance_rmse,
                of_pixel.rel_rmse,
            );
        }
    }
    text
}
