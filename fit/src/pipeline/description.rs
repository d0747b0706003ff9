//! The bytes that an asset's own description takes, which are reserved before its figures are known.

use crate::params::{FitParams, ValidFitParams};
use crate::provenance::{FitRecord, Material};
use btf_capture::{Capture, CaptureInfo};
use btf_runtime::MAX_COMPONENTS;

/// Bytes reserved for the error figures in the material text and for its alignment, because the figures are known only
/// after the asset was measured.
pub const FIGURES_RESERVE: usize = 256;

/// Returns the bytes that the description of an asset of `captures` takes at most: what a byte budget leaves free for
/// it.
pub fn description_bytes(captures: &[Capture], params: &FitParams) -> usize {
    let infos: Vec<&CaptureInfo> = captures.iter().map(Capture::info).collect();
    Material::new(&infos, FitRecord::new(params, MAX_COMPONENTS)).to_json().len() + FIGURES_RESERVE
}

/// Returns the bytes of `bytes` that are left for everything but the description.
pub fn byte_budget(captures: &[Capture], params: &ValidFitParams, bytes: u64) -> usize {
    (bytes as usize).saturating_sub(description_bytes(captures, params.asked()))
}
