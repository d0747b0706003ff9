//! Mean of several measured leaves at the wavelengths of a model.

use crate::inversion::spectra::{LeafSpectra, SHARES};

/// Mean spectra of leaves.
#[derive(Debug, Clone, PartialEq)]
pub struct MeanSpectra {
    /// Number of leaves of each share of light, as in [`LeafSpectra::shares`]; 0 where it was not measured.
    pub leaves: [usize; SHARES],
    /// Mean of each share at the wavelengths that were asked for; NaN where fewer leaves were measured.
    pub shares: [Vec<f64>; SHARES],
}

impl MeanSpectra {
    /// Returns the mean of `leaves` at `wavelengths_nm`, each leaf interpolated linearly between its own.
    pub fn of(leaves: &[LeafSpectra], wavelengths_nm: &[f64]) -> MeanSpectra {
        let mut mean = MeanSpectra { leaves: [0; SHARES], shares: [const { Vec::new() }; SHARES] };
        for share in 0..SHARES {
            let measured: Vec<&LeafSpectra> = leaves.iter().filter(|leaf| leaf.has(share)).collect();
            let count = measured.len();
            let at = |nm: f64| measured.iter().map(|leaf| interpolated(leaf, share, nm)).sum::<f64>() / count as f64;
            mean.leaves[share] = count;
            mean.shares[share] = wavelengths_nm.iter().map(|nm| at(*nm)).collect();
        }
        mean
    }

    /// Returns the root mean square difference of a model's values to the mean of a share, over the wavelengths where both
    /// are; `None` where there is none.
    pub fn error_of(&self, share: usize, values: &[f64]) -> Option<f64> {
        let squares = self.shares[share].iter().zip(values).map(|(measured, value)| (value - measured).powi(2));
        let squares: Vec<f64> = squares.filter(|square| square.is_finite()).collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }
}

/// Returns a share of light between two measured wavelengths; NaN outside of them or beside a gap.
fn interpolated(leaf: &LeafSpectra, share: usize, nm: f64) -> f64 {
    let (nms, values) = (&leaf.wavelengths_nm, &leaf.shares[share]);
    let above = nms.partition_point(|known| *known < nm);
    match (above.checked_sub(1), nms.get(above)) {
        (_, Some(known)) if *known == nm => values[above],
        (Some(below), Some(known)) => {
            let t = (nm - nms[below]) / (known - nms[below]);
            values[below] + t * (values[above] - values[below])
        }
        _ => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaves_are_interpolated_and_averaged_where_all_were_measured() {
        let nm = [400.0, 500.0, 600.0];
        let one = LeafSpectra::new("one", &nm, &[0.1, 0.2, f64::NAN], &[]).unwrap();
        let other = LeafSpectra::new("other", &nm, &[0.3, 0.4, 0.5], &[0.1, 0.1, 0.1]).unwrap();
        let mean = MeanSpectra::of(&[one, other], &[350.0, 400.0, 450.0, 550.0, 600.0]);
        assert_eq!(mean.leaves, [2, 1, 0, 0]);
        assert!((mean.shares[0][1] - 0.2).abs() < 1e-12 && (mean.shares[0][2] - 0.25).abs() < 1e-12);
        assert!([0, 3, 4].iter().all(|at: &usize| mean.shares[0][*at].is_nan()));
        assert!(mean.shares[1][0].is_nan() && (mean.shares[1][3] - 0.1).abs() < 1e-12);
        // An error of 0.1 everywhere is one of 0.1; without a measurement there is none.
        let told = mean.error_of(0, &[9.0, 0.3, 0.35, 9.0, 9.0]).unwrap();
        assert!((told - 0.1).abs() < 1e-12);
        assert_eq!(mean.error_of(2, &[0.0; 5]), None);
    }
}
