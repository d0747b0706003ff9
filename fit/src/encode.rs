//! Turns the residual model into what the format stores: quantised bases, then coefficients refitted
//! by least squares on the decoded bases, then bit planes.

use crate::budget::Plan;
use crate::error::FitError;
use crate::factor::Rotated;
use crate::local_pca::ResidualSource;
use crate::monitor::Monitor;
use btf_runtime::{Basis, Coefficients, Residual, code_from_coefficient, coefficient_from_code, expand_core};
use half::f16;
use nalgebra::DMatrix;
use ndarray::{Array1, Array2};
use rayon::prelude::*;

/// Ridge of the refit, relative to the mean diagonal of the bases' Gram matrix.
const RIDGE: f64 = 1e-6;

/// A cluster's bases as the decoder will see them.
struct Decoded {
    mean: Array1<f32>,
    /// `[sample, component]`.
    components: Array2<f32>,
    /// Inverse of the components' Gram matrix, ridged.
    inverse: Array2<f32>,
    /// Texels and their coefficients, as they come.
    texels: Vec<usize>,
    coefficients: Vec<f32>,
}

/// Quantises the bases by `plan` and fits every texel's coefficients to them. Cost: one pass over the capture.
pub fn encode_residual(
    source: &ResidualSource,
    rotated: &Rotated,
    plan: &Plan,
    monitor: &Monitor,
) -> Result<Residual, FitError> {
    let factors = rotated.factors(plan.ranks);
    let count = plan.bits.len();
    let bases: Vec<Basis> =
        (0..=count).map(|index| Basis::quantize(&factors, &rotated.cores(&factors, index))).collect();
    let len = source.row_len();
    let mut decoded: Vec<Decoded> = (0..source.clusters.len())
        .into_par_iter()
        .map(|cluster| {
            let expand = |basis: &Basis| expand_core(&factors, &basis.core(&factors, cluster));
            let mut components = Array2::<f32>::zeros((len, count));
            for (j, basis) in bases[1..].iter().enumerate() {
                components.column_mut(j).assign(&Array1::from(expand(basis)));
            }
            let gram = components.t().dot(&components);
            let trace: f64 = (0..count).map(|j| f64::from(gram[[j, j]])).sum();
            let ridge = RIDGE * trace / count.max(1) as f64 + 1e-12;
            let matrix =
                DMatrix::from_fn(count, count, |i, j| f64::from(gram[[i, j]]) + if i == j { ridge } else { 0.0 });
            let inverse =
                matrix.cholesky().map(|cholesky| cholesky.inverse()).unwrap_or_else(|| DMatrix::identity(count, count));
            Decoded {
                mean: Array1::from(expand(&bases[0])),
                components,
                inverse: Array2::from_shape_fn((count, count), |(i, j)| inverse[(i, j)] as f32),
                texels: Vec::new(),
                coefficients: Vec::new(),
            }
        })
        .collect();
    source.for_each_block("residual", (2, 3), monitor, &mut decoded, |_, cluster, texels, mut rows| {
        rows -= &cluster.mean;
        let fitted = rows.dot(&cluster.components).dot(&cluster.inverse);
        cluster.texels.extend_from_slice(texels);
        cluster.coefficients.extend(fitted.iter());
    })?;

    let coefficients = (0..count)
        .into_par_iter()
        .map(|j| {
            let bits = plan.bits[j];
            let mut plane = Coefficients { bits, steps: Vec::new(), codes: vec![0; source.labels.len()] };
            for cluster in &decoded {
                let values: Vec<f32> = cluster.coefficients.iter().skip(j).step_by(count).copied().collect();
                let step = best_step(&values, bits);
                for (texel, value) in cluster.texels.iter().zip(&values) {
                    plane.codes[*texel] = code_from_coefficient(*value, step.to_f32(), bits);
                }
                plane.steps.push(step);
            }
            plane
        })
        .collect();
    Ok(Residual { factors, bases, coefficients })
}

/// The quantiser step of least squared error: the full range, or less of it with its tails clipped.
fn best_step(values: &[f32], bits: u32) -> f16 {
    let peak = values.iter().fold(0.0f32, |peak, x| peak.max(x.abs()));
    let half_range = (1u32 << (bits - 1)) as f32;
    // A step must be positive and finite in half precision.
    let floor = f16::from_f32(1e-6);
    if peak <= 0.0 || !peak.is_finite() {
        return floor;
    }
    let error = |step: f16| -> f64 {
        let step = step.to_f32();
        values
            .iter()
            .map(|value| {
                let code = code_from_coefficient(*value, step, bits);
                f64::from(value - step * coefficient_from_code(code.into(), bits)).powi(2)
            })
            .sum()
    };
    (0..14)
        .map(|i| f16::from_f32((peak / half_range * 0.85f32.powi(i)).clamp(1e-6, 60_000.0)))
        .map(|step| if step < floor { floor } else { step })
        .min_by(|a, b| error(*a).total_cmp(&error(*b)))
        .unwrap_or(floor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    /// Least-squares coefficients of one row on given bases, by the normal equations: the slow twin of the
    /// refit in [`encode_residual`].
    fn coefficients_by_normal_equations(components: &Array2<f32>, row: &[f32]) -> Vec<f32> {
        let n = components.ncols();
        let dot = |i: usize, j: usize| f64::from(components.column(i).dot(&components.column(j)));
        let right = DVector::from_fn(n, |i, _| {
            components.column(i).iter().zip(row).map(|(a, b)| f64::from(a * b)).sum::<f64>()
        });
        let solved = DMatrix::from_fn(n, n, dot).lu().solve(&right).unwrap_or_else(|| DVector::zeros(n));
        solved.iter().map(|x| *x as f32).collect()
    }

    #[test]
    fn the_step_clips_tails_where_that_pays() {
        // Mostly small values, one outlier: at four bits the best step ignores it.
        let mut values: Vec<f32> = (0..4000).map(|i| ((i * 37 % 201) as f32 - 100.0) / 100.0).collect();
        values.push(30.0);
        let step = best_step(&values, 4).to_f32();
        assert!(step < 30.0 / 8.0 * 0.5, "{step}");
        // At eight bits there is room for everything.
        assert!(best_step(&values[..4000], 8).to_f32() <= 1.0 / 128.0 * 1.01);
    }

    #[test]
    fn the_refit_solves_least_squares() {
        let components = Array2::from_shape_fn((30, 3), |(i, j)| ((i * (j + 2) * 7 % 23) as f32 - 11.0) / 11.0);
        let truth = [0.7f32, -0.2, 1.3];
        let row: Vec<f32> = (0..30).map(|i| (0..3).map(|j| truth[j] * components[[i, j]]).sum()).collect();
        let found = coefficients_by_normal_equations(&components, &row);
        assert!(found.iter().zip(truth).all(|(a, b)| (a - b).abs() < 1e-4), "{found:?}");
        assert!((found[0] - truth[1]).abs() > 0.1);
    }
}
