//! Error of a layer's textures at the measured pairs.

use crate::error::FitError;
use crate::export::ktx2::filtered::components::FilteredLayer;
use crate::export::ktx2::filtered::measured_rows::{CURVE, MeasuredRows};
use crate::input::tile_cache::TILE_TEXELS;
use crate::metrics::psnr_db_from_codes;
use crate::monitor::Monitor;
use crate::numeric::principal_directions::ROW_BLOCK;
use btf_capture::Transfer;
use ndarray::{Array2, ArrayView2};
use rayon::prelude::*;

/// Values of the root curve that 8-bit values are tabulated at, from 0 to 1.
const TABLE: usize = 1 << 16;

/// PSNR of 8-bit sRGB values of reflectance times cosine at the measured pairs, dB.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct LayerError {
    /// Of the textures against the asset.
    pub psnr_to_asset_db: f64,
    /// Of the textures against the capture; `None` where none was given.
    pub psnr_to_capture_db: Option<f64>,
    /// Of the asset against the capture.
    pub asset_psnr_to_capture_db: Option<f64>,
}

/// Measures the textures of `layer` against the asset and, where there is one, the capture.
///
/// # Errors
/// If values cannot be read, or the monitor was cancelled.
pub fn errors(
    layer: &FilteredLayer,
    asset: &dyn MeasuredRows,
    capture: Option<&dyn MeasuredRows>,
    monitor: &Monitor,
) -> Result<LayerError, FitError> {
    let bases = layer.bases.matrix();
    let planes: Vec<(usize, Vec<f32>)> =
        layer.components.par_iter().map(|component| (component.basis, component.plane.decoded())).collect();
    let codes: Vec<u8> = (0..=TABLE)
        .map(|i| (255.0 * Transfer::Srgb.encoded_from_linear(CURVE.decode(i as f32 / TABLE as f32, 0.0))).round() as u8)
        .collect();
    let mut order = asset.order();
    if capture.is_some() {
        // A capture gives its texels block by block.
        order.sort_by_key(|texel| *texel as usize / TILE_TEXELS);
    }
    let sums: Vec<[u64; 3]> = order
        .par_chunks(ROW_BLOCK)
        .map(|texels| {
            monitor.check()?;
            let mut coefficients = Array2::<f32>::zeros((texels.len(), bases.ncols()));
            for (basis, plane) in &planes {
                for (texel, mut row) in texels.iter().zip(coefficients.rows_mut()) {
                    row[*basis] += plane[*texel as usize];
                }
            }
            let textures = coefficients.dot(&bases.t()) + &layer.bases.mean;
            let rows = asset.rows(texels)?;
            let to_asset = squares(textures.view(), rows.view(), &codes);
            let Some(capture) = capture else { return Ok([to_asset, 0, 0]) };
            let photographs = capture.rows(texels)?;
            Ok([
                to_asset,
                squares(textures.view(), photographs.view(), &codes),
                squares(rows.view(), photographs.view(), &codes),
            ])
        })
        .collect::<Result<_, FitError>>()?;
    let samples = (order.len() * layer.bases.mean.len()) as u64;
    let psnr = |which: usize| psnr_db_from_codes(sums.iter().map(|sums| sums[which]).sum(), samples);
    Ok(LayerError {
        psnr_to_asset_db: psnr(0),
        psnr_to_capture_db: capture.map(|_| psnr(1)),
        asset_psnr_to_capture_db: capture.map(|_| psnr(2)),
    })
}

/// Returns the sum of squared differences of 8-bit values.
fn squares(a: ArrayView2<f32>, b: ArrayView2<f32>, codes: &[u8]) -> u64 {
    let code = |y: f32| i64::from(codes[(y.clamp(0.0, 1.0) * TABLE as f32).round() as usize]);
    a.iter().zip(b).map(|(a, b)| (code(*a) - code(*b)).pow(2) as u64).sum()
}
