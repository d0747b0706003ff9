//! Whether the GPU's decoder gives what the CPU's does, for places and directions at random.

use crate::bench::gpu::params::GpuBenchParams;
use crate::bench::gpu::rows::{Rows, row_of};
use crate::bench::gpu::workload::{ResidentForm, Workload};
use crate::error::ViewerError;
use crate::gpu::queries::decode_queries::{DecodeQuery, gpu_decode};
use btf_runtime::testing::Random;
use btf_runtime::{DecodeOptions, HeightField, HeightUse, Interpolation, Resident, decode};
use rayon::prelude::*;
use serde::Serialize;

/// Absolute and relative tolerance of a decoded channel. Half-precision bases are steps of 2^-11 relative; both
/// decoders read the same bytes, so what is left is the rounding of f32 sums and of the drivers' powers and
/// exponentials.
pub const ABSOLUTE: f32 = 1e-3;
/// See [`ABSOLUTE`].
pub const RELATIVE: f32 = 1e-3;
/// Samples that are compared; in a quick run fewer.
const SAMPLES: usize = 100_000;
const QUICK_SAMPLES: usize = 10_000;
/// With heights, one in so many samples may differ: a ray that grazes an edge of rough heights may hit it on one machine
/// and miss it on another.
const GRAZING: usize = 100;

/// A comparison of the decoders.
#[derive(Serialize)]
struct ParityRow<'a> {
    asset: &'a str,
    form: ResidentForm,
    interpolation: &'static str,
    samples: usize,
    /// Samples that differ by more than the tolerance, and how many may.
    differing: usize,
    allowed: usize,
    /// The largest difference, in tolerances.
    worst: f32,
}

/// Returns random texels of all layers and levels of an asset, with directions over the half sphere, some of them along
/// the normal, at the horizon and below it.
pub fn random_queries(resident: &Resident, seed: u64, count: usize) -> Vec<DecodeQuery> {
    let mut random = Random::new(seed);
    let query = |_| {
        let layer = random.below((resident.levels() * resident.layers()) as usize) as u32;
        let [width, rows] = resident.size(layer);
        let texel = random.below((width * rows) as usize) as u32;
        DecodeQuery { layer, texel, wi: direction(&mut random), wo: direction(&mut random) }
    };
    (0..count).map(query).collect()
}

/// Returns a direction over the half sphere; one in eight at, just above or below the horizon, one in 64 along the normal.
fn direction(random: &mut Random) -> [f32; 3] {
    let mut d = random.direction();
    match random.below(64) {
        0 => d = [0.0, 0.0, 1.0],
        1 | 2 => d[2] = 0.0,
        3 | 4 => d[2] = 1e-4,
        5 | 6 => d[2] = -d[2],
        7 | 8 => d[2] = 0.02,
        _ => {}
    }
    let length = d.iter().map(|x| x * x).sum::<f32>().sqrt();
    d.map(|x| x / length)
}

/// Returns the largest difference of two values, in tolerances; infinite where one is no number.
pub fn difference(expected: &[f32; 3], found: &[f32; 3]) -> f32 {
    let of_channel = |c: usize| {
        let difference = (expected[c] - found[c]).abs() / (ABSOLUTE + RELATIVE * expected[c].abs());
        if difference.is_nan() { f32::INFINITY } else { difference }
    };
    (0..3).map(of_channel).fold(0.0, f32::max)
}

/// Counts the values of which a channel differs by more than the tolerance.
///
/// # Panics
/// Where there are not as many of both.
pub fn count_differences(expected: &[[f32; 3]], found: &[[f32; 3]]) -> usize {
    assert_eq!(expected.len(), found.len());
    expected.iter().zip(found).filter(|(a, b)| difference(a, b) > 1.0).count()
}

/// Compares the decoders: every asset in both forms, by both rules of interpolation.
///
/// # Errors
/// [`ViewerError::Gpu`] where more samples differ than may, after all comparisons.
pub(super) fn compare_decoders(params: &GpuBenchParams, rows: Rows) -> Result<(), ViewerError> {
    compare(params, rows, &|options| options)
}

/// Compares decoders of which that on the CPU leaves out all components: as [`compare_decoders`], which must not accept it.
///
/// # Errors
/// As [`compare_decoders`].
pub(super) fn compare_wrong_decoders(params: &GpuBenchParams, rows: Rows) -> Result<(), ViewerError> {
    compare(params, rows, &|options| DecodeOptions { components: 0, ..options })
}

/// Compares decoders, with the options of the CPU's as `cpu_options` makes them.
fn compare(
    params: &GpuBenchParams,
    rows: Rows,
    cpu_options: &dyn Fn(DecodeOptions) -> DecodeOptions,
) -> Result<(), ViewerError> {
    let workload = Workload::open(params)?;
    let samples = if params.quick { QUICK_SAMPLES } else { SAMPLES };
    let mut faults = Vec::new();
    for form in [ResidentForm::Expanded, ResidentForm::Packed] {
        for asset in workload.assets(form) {
            let resident = asset.resident();
            let queries = random_queries(resident, 1, samples);
            let heights = HeightField::of_resident(resident, 0).is_some();
            for interpolation in [Interpolation::Fast, Interpolation::Exact] {
                let heights_use = if heights { DecodeOptions::default().heights } else { HeightUse::None };
                let options = DecodeOptions { interpolation, heights: heights_use, ..DecodeOptions::default() };
                let on_cpu = cpu_options(options);
                let expected: Vec<[f32; 3]> =
                    queries.par_iter().map(|q| decode(resident, q.layer, q.texel, q.wi, q.wo, &on_cpu)).collect();
                let found = gpu_decode(&workload.gpu, workload.tracer, resident, &options, &queries)?;
                let row = ParityRow {
                    asset: &asset.name,
                    form,
                    interpolation: interpolation.name(),
                    samples,
                    differing: count_differences(&expected, &found),
                    allowed: if heights { samples / GRAZING } else { 0 },
                    worst: expected.iter().zip(&found).map(|(a, b)| difference(a, b)).fold(0.0, f32::max).min(f32::MAX),
                };
                if row.differing > row.allowed {
                    faults.push(format!("{} of {samples} ({form:?}, {interpolation:?})", row.differing));
                }
                rows(row_of("parity", &row));
            }
        }
    }
    workload.judge("decoded values", &faults)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_off_by_two_tolerances_counts_and_so_does_no_number() {
        let expected = [[0.5, 0.2, 0.1], [3.0, 0.0, 0.0]];
        let mut found = expected;
        assert_eq!(count_differences(&expected, &found), 0);
        found[1][0] += 0.9 * (ABSOLUTE + RELATIVE * 3.0);
        assert_eq!(count_differences(&expected, &found), 0);
        found[1][0] += 1.1 * (ABSOLUTE + RELATIVE * 3.0);
        found[0][2] = f32::NAN;
        assert_eq!(count_differences(&expected, &found), 2);
    }
}
