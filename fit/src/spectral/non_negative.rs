//! Non-negative matrix factorisation with weights [Lee & Seung 2001; Blondel 2008]: spectra as sums of a few spectra of which
//! none is negative.

use ndarray::{Array1, Array2, Axis, Zip};

/// Rounds of multiplicative updates.
const ROUNDS: usize = 300;
/// Least divisor and least start value, relative to the mean.
const TINY: f32 = 1e-9;

/// Returns `count` spectra, `[band, spectrum]`, and the shares `[sample, spectrum]` in which they make up `samples`,
/// `[sample, band]`, none negative, so that the squared errors, each times its weight in `weights`, are least. Deterministic.
///
/// Cost: 300 products of `samples x bands x count`, four times.
pub(crate) fn factorise(samples: &Array2<f32>, weights: &Array2<f32>, count: usize) -> [Array2<f32>; 2] {
    let mut spectra = first_spectra(samples, count);
    let mean = samples.mean().unwrap_or(0.0).max(TINY);
    let mut shares = Array2::from_shape_fn((samples.nrows(), count), |(row, _)| {
        samples.row(row).mean().unwrap_or(0.0).max(1e-3 * mean) / count as f32
    });
    let wanted = samples * weights;
    for _ in 0..ROUNDS {
        let told = weights * &shares.dot(&spectra.t());
        update(&mut shares, &wanted.dot(&spectra), &told.dot(&spectra));
        let told = weights * &shares.dot(&spectra.t());
        update(&mut spectra, &wanted.t().dot(&shares), &told.t().dot(&shares));
    }
    [spectra, shares]
}

/// Multiplies each number by the ratio of what is wanted to what is told.
fn update(numbers: &mut Array2<f32>, wanted: &Array2<f32>, told: &Array2<f32>) {
    Zip::from(numbers).and(wanted).and(told).for_each(|x, wanted, told| *x *= wanted / told.max(TINY));
}

/// Returns the spectra that are farthest from each other in their form: each is the one that is worst told by those before
/// it (successive projections [Araujo 2001]).
fn first_spectra(samples: &Array2<f32>, count: usize) -> Array2<f32> {
    let mean = samples.mean().unwrap_or(0.0).max(TINY);
    let mut left = samples.clone();
    for mut row in left.rows_mut() {
        let size = row.mean().unwrap_or(0.0) + 0.01 * mean;
        row /= size;
    }
    let forms = left.clone();
    let mut spectra = Array2::<f32>::ones((samples.ncols(), count));
    for mut spectrum in spectra.columns_mut() {
        let lengths: Vec<f32> = left.rows().into_iter().map(|row| row.dot(&row)).collect();
        let far = (0..lengths.len()).fold(0, |far, i| if lengths[i] > lengths[far] { i } else { far });
        if lengths.get(far).is_none_or(|length| *length < 1e-6) {
            break;
        }
        spectrum.assign(&forms.row(far).mapv(|x| x.max(1e-3)));
        let axis: Array1<f32> = &left.row(far) / lengths[far].sqrt();
        let along = left.dot(&axis);
        left -= &along.insert_axis(Axis(1)).dot(&axis.insert_axis(Axis(0)));
    }
    spectra
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(band: usize, at: f32) -> f32 {
        (-((band as f32 - at) / 4.0).powi(2)).exp() + 0.05
    }

    #[test]
    fn sums_of_three_spectra_are_told_by_three_and_not_by_two() {
        let own = Array2::from_shape_fn((31, 3), |(band, i)| wave(band, [4.0, 14.0, 25.0][i]));
        let shares = Array2::from_shape_fn((400, 3), |(row, i)| ((row * (i + 3) * 7919) % 101) as f32 / 101.0);
        let samples = shares.dot(&own.t());
        let weights = Array2::ones((400, 31));
        let error = |count: usize| {
            let [spectra, shares] = factorise(&samples, &weights, count);
            assert!(spectra.iter().chain(&shares).all(|x| *x >= 0.0 && x.is_finite()));
            (&shares.dot(&spectra.t()) - &samples).mapv(|x| x * x).mean().unwrap().sqrt()
        };
        assert!(error(3) < 0.01, "{}", error(3));
        // Planted difference: a spectrum too few.
        assert!(error(2) > 0.05, "{}", error(2));
    }

    #[test]
    fn black_grey_and_one_band_are_told_without_numbers_that_are_none() {
        for samples in [Array2::zeros((9, 5)), Array2::from_elem((9, 5), 0.4), Array2::from_elem((9, 1), 0.4)] {
            let [spectra, shares] = factorise(&samples, &Array2::ones(samples.raw_dim()), 3);
            let error = (&shares.dot(&spectra.t()) - &samples).mapv(f32::abs).sum();
            assert!(error < 1e-2 && spectra.iter().chain(&shares).all(|x| x.is_finite()), "{error}");
        }
    }
}
