//! Estimates how much of each of several covariances is in observed samples: variance components by maximum likelihood.

use nalgebra::DMatrix;

/// Rounds of the estimate.
const ROUNDS: usize = 40;
/// Variance of the samples' own noise, relative to their mean square: also what keeps matrices invertible, whose sums are of single
/// precision.
pub const NOISE: f64 = 1e-5;

/// Returns the variances `w` for which `sum w[k] parts[k]` makes the second moments `observed` most likely, for samples that
/// are normal with mean 0. Each is at least 0.
///
/// Minorisation and maximisation (Zhou, Hu, Zhou & Lange 2019, "MM algorithms for variance components models"): every round
/// multiplies each variance by the root of a ratio, so that none becomes negative and the likelihood never falls.
///
/// Cost: 40 rounds of an inversion of `n x n` and of `parts` sums over `n x n`.
pub fn variance_components(parts: &[DMatrix<f64>], observed: &DMatrix<f64>) -> Vec<f64> {
    let n = observed.nrows();
    let energy = observed.trace();
    let own = |part: &DMatrix<f64>| energy / part.trace().max(1e-30) / parts.len() as f64;
    let mut variances: Vec<f64> = parts.iter().map(own).collect();
    let noise = DMatrix::identity(n, n) * (NOISE * energy / n as f64);
    for _ in 0..ROUNDS {
        let sum = parts.iter().zip(&variances).fold(noise.clone(), |sum, (part, variance)| sum + part * *variance);
        let Some(inverse) = sum.cholesky().map(|factor| factor.inverse()) else { break };
        let weighted = &inverse * observed * &inverse;
        for (part, variance) in parts.iter().zip(&mut variances) {
            let (found, expected) = (part.dot(&weighted), part.dot(&inverse));
            *variance *= (found.max(0.0) / expected.max(1e-30)).sqrt();
        }
    }
    variances
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_variances_of_a_known_mixture_are_found() {
        let n = 24;
        let smooth = DMatrix::from_fn(n, n, |i, j| (-(i as f64 - j as f64).abs() / 8.0).exp());
        let wave = DMatrix::from_fn(n, n, |i, j| ((i as f64 - j as f64) * 0.9).cos());
        let parts = [smooth, wave, DMatrix::identity(n, n)];
        let wanted = [2.0, 0.5, 0.05];
        let observed = parts.iter().zip(wanted).fold(DMatrix::zeros(n, n), |sum, (part, w)| sum + part * w);
        let found = variance_components(&parts, &observed);
        for (found, wanted) in found.iter().zip(wanted) {
            // The rounds end before the smallest share has quite come down to its place.
            assert!((found - wanted).abs() < 0.05 * wanted + 0.02, "{found} {wanted}");
        }
        // Planted difference: what is not in the samples gets next to nothing.
        let found = variance_components(&parts, &(&parts[1] + &parts[2] * 0.1));
        assert!(found[0] < 1e-2 && found[1] > 0.9, "{found:?}");
    }
}
