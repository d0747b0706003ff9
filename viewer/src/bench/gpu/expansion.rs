//! How long an asset takes into the adapter's memory: expanded on the CPU and uploaded, expanded there, and packed.

use crate::bench::gpu::params::GpuBenchParams;
use crate::bench::gpu::rows::{Rows, row_of};
use crate::bench::gpu::workload::{ResidentForm, Workload};
use crate::error::ViewerError;
use crate::gpu::queries::expand_queries::{time_gpu_expand, time_upload};
use serde::Serialize;
use web_time::Instant;

/// What was measured of an asset.
#[derive(Serialize)]
struct ExpansionRow {
    asset: String,
    /// Bytes of the expanded form, levels included.
    expanded_bytes: usize,
    packed_bytes: usize,
    /// Expansion on all threads of the CPU, where the file form is at hand.
    cpu_ms: Option<f64>,
    /// Upload of the expanded form, the first and once more.
    upload_ms: [f64; 2],
    upload_gigabytes_per_s: f64,
    packed_upload_ms: f64,
    /// From what the bases are made of to expanded bases in the adapter's memory: the first time, with compiling, and once
    /// more. None where the file form is not at hand.
    gpu_ms: Option<[f64; 2]>,
}

/// Times expansion and upload of every asset.
///
/// # Errors
/// [`ViewerError::Gpu`] where the adapter has no room for an asset.
pub(super) fn measure(params: &GpuBenchParams, rows: Rows) -> Result<(), ViewerError> {
    let workload = Workload::open(params)?;
    let gpu = &workload.gpu;
    let assets = workload.assets(ResidentForm::Expanded);
    for (asset, packed) in assets.iter().zip(workload.assets(ResidentForm::Packed)) {
        let file = asset.file.as_ref();
        let start = Instant::now();
        let resident = asset.resident();
        let cpu_ms = file.map(|_| 1e3 * start.elapsed().as_secs_f64());
        let upload_ms = [time_upload(gpu, resident)?, time_upload(gpu, resident)?];
        let gpu_ms = match file {
            Some(file) => Some([time_gpu_expand(gpu, &file.whole)?, time_gpu_expand(gpu, &file.whole)?]),
            None => None,
        };
        let bytes = 4 * resident.words().len();
        let row = ExpansionRow {
            asset: asset.name.clone(),
            expanded_bytes: bytes,
            packed_bytes: 4 * packed.head().words().len(),
            cpu_ms,
            upload_ms,
            upload_gigabytes_per_s: bytes as f64 / upload_ms[1] * 1e-6,
            packed_upload_ms: time_upload(gpu, packed.head())?,
            gpu_ms,
        };
        rows(row_of("expansion", &row));
    }
    Ok(())
}
