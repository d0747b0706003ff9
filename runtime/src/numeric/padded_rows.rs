//! Rows of single-precision numbers that are padded to whole vectors, and their sums with SIMD. Every operation is rounded by
//! itself and sums go from row to row, so that every processor gives the same bits.

use pulp::Simd;

/// Numbers of a vector; rows are padded with zeros to whole ones.
pub(crate) const LANES: usize = 16;
/// Numbers that are added side by side.
pub(crate) type Vector = [f32; LANES];
/// Vectors of a row that are kept in registers while rows are added up.
const TOGETHER: usize = 5;

/// Returns the number of vectors that hold `numbers` numbers.
pub(crate) fn vectors(numbers: usize) -> usize {
    numbers.div_ceil(LANES)
}

/// Returns rows of zeros, padded to whole vectors.
pub(crate) fn zeros(rows: usize, numbers: usize) -> Vec<Vector> {
    vec![[0.0; LANES]; rows * vectors(numbers)]
}

/// Returns numbers in whole vectors.
pub(crate) fn padded(numbers: &[f32]) -> Vec<Vector> {
    let mut row = zeros(1, numbers.len());
    row.as_flattened_mut()[..numbers.len()].copy_from_slice(numbers);
    row
}

/// Adds rows of `length` vectors times their inputs to `out`, which may be shorter. Where there is something to be learnt,
/// each row gets its factor times `before` first.
#[inline(always)]
pub(crate) fn add_rows<S: Simd>(
    simd: S,
    (rows, length): (&mut [Vector], usize),
    inputs: &[f32],
    learnt: Option<(&[f32], &[Vector])>,
    out: &mut [Vector],
) {
    let (rows, out) = (S::as_mut_simd_f32s(rows.as_flattened_mut()).0, S::as_mut_simd_f32s(out.as_flattened_mut()).0);
    let learnt = learnt.map(|(factors, before)| (factors, S::as_simd_f32s(before.as_flattened()).0));
    let stride = length * LANES / S::F32_LANES;
    for first in (0..out.len()).step_by(TOGETHER) {
        let out = &mut out[first..];
        // Without inputs there are no rows.
        let rows = rows.get_mut(first..).unwrap_or_default();
        let learnt = learnt.map(|(factors, before)| (factors, &before[first..]));
        match out.len() {
            1 => add_columns::<S, 1>(simd, rows, stride, inputs, learnt, out),
            2 => add_columns::<S, 2>(simd, rows, stride, inputs, learnt, out),
            3 => add_columns::<S, 3>(simd, rows, stride, inputs, learnt, out),
            4 => add_columns::<S, 4>(simd, rows, stride, inputs, learnt, out),
            _ => add_columns::<S, TOGETHER>(simd, rows, stride, inputs, learnt, out),
        }
    }
}

/// Does the work of [`add_rows`] for the first `N` vectors of rows that lie `stride` vectors apart: their sums stay in
/// registers.
#[inline(always)]
fn add_columns<S: Simd, const N: usize>(
    simd: S,
    rows: &mut [S::f32s],
    stride: usize,
    inputs: &[f32],
    learnt: Option<(&[f32], &[S::f32s])>,
    out: &mut [S::f32s],
) {
    let Some(out) = out.first_chunk_mut::<N>() else { return };
    let mut sums = *out;
    let rows = rows.chunks_mut(stride).zip(inputs);
    match learnt.and_then(|(factors, before)| Some((factors, *before.first_chunk::<N>()?))) {
        Some((factors, before)) => {
            for ((row, x), factor) in rows.zip(factors) {
                let Some(row) = row.first_chunk_mut::<N>() else { return };
                let (x, factor) = (simd.splat_f32s(*x), simd.splat_f32s(*factor));
                for n in 0..N {
                    row[n] = simd.add_f32s(row[n], simd.mul_f32s(factor, before[n]));
                    sums[n] = simd.add_f32s(sums[n], simd.mul_f32s(x, row[n]));
                }
            }
        }
        None => {
            for (row, x) in rows {
                let Some(row) = row.first_chunk::<N>() else { return };
                let x = simd.splat_f32s(*x);
                for n in 0..N {
                    sums[n] = simd.add_f32s(sums[n], simd.mul_f32s(x, row[n]));
                }
            }
        }
    }
    *out = sums;
}

/// Adds `factor` times `row` to `sums`.
#[inline(always)]
pub(crate) fn add_scaled<S: Simd>(simd: S, sums: &mut [Vector], factor: f32, row: &[Vector]) {
    let factor = simd.splat_f32s(factor);
    let sums = S::as_mut_simd_f32s(sums.as_flattened_mut()).0;
    for (sum, x) in sums.iter_mut().zip(S::as_simd_f32s(row.as_flattened()).0) {
        *sum = simd.add_f32s(*sum, simd.mul_f32s(factor, *x));
    }
}
