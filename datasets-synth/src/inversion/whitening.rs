//! Errors of a model along the wavelengths, made independent.
//!
//! A leaf model misses a measured spectrum by smooth curves, not by noise: neighbouring wavelengths err alike, and
//! reflectance errs against transmittance. Least squares that take them for independent trust the level of a plateau of a
//! thousand wavelengths too much, and tell standard errors that are far too small. Here an error keeps the share
//! `exp(-step / length)` of its neighbour's [generalised least squares with first-order autoregressive errors, Prais &
//! Winsten 1954], and the rest of both shares of light is scaled by its covariance.

use crate::inversion::forward::{MAX_UNKNOWNS, Values};

/// What is known of the errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Whitening {
    /// Distance in nanometres over which an error falls to 1/e; 0 where they are independent.
    pub(crate) length_nm: f64,
    /// Rows of the lower triangle that turns the two shares' errors into independent ones of variance 1.
    pub(crate) triangle: [[f64; 2]; 2],
}

impl Whitening {
    /// Returns what takes errors for independent, all of standard deviation `error`.
    pub(crate) const fn even(error: f64) -> Whitening {
        Whitening { length_nm: 0.0, triangle: [[1.0 / error, 0.0], [0.0, 1.0 / error]] }
    }
}

/// Error of one share of light with its derivatives.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    pub(crate) error: f64,
    pub(crate) by: Values,
}

impl Row {
    fn scaled(mut self, factor: f64) -> Row {
        self.error *= factor;
        self.by.iter_mut().for_each(|by| *by *= factor);
        self
    }

    fn plus(mut self, factor: f64, other: &Row) -> Row {
        self.error += factor * other.error;
        self.by.iter_mut().zip(&other.by).for_each(|(by, other)| *by += factor * other);
        self
    }
}

/// Walker over ascending wavelengths that makes errors independent.
pub(crate) struct Whitener<'a> {
    whitening: &'a Whitening,
    before: [Option<(f64, Row)>; 2],
}

impl<'a> Whitener<'a> {
    pub(crate) fn new(whitening: &'a Whitening) -> Whitener<'a> {
        Whitener { whitening, before: [None; 2] }
    }

    /// Takes the rows of a wavelength, of those shares that were measured there, and returns independent ones.
    pub(crate) fn next(&mut self, wavelength_nm: f64, rows: [Option<Row>; 2]) -> [Option<Row>; 2] {
        let Whitening { length_nm, triangle } = *self.whitening;
        let mut fresh = rows;
        if length_nm > 0.0 {
            for (fresh, before) in fresh.iter_mut().zip(&mut self.before) {
                let Some(row) = *fresh else { continue };
                if let Some((nm, earlier)) = before.replace((wavelength_nm, row)) {
                    let kept = (-(wavelength_nm - nm) / length_nm).exp();
                    *fresh = Some(row.plus(-kept, &earlier).scaled(1.0 / (1.0 - kept * kept).sqrt()));
                }
            }
        }
        match fresh {
            [Some(r), Some(t)] => {
                [Some(r.scaled(triangle[0][0])), Some(t.scaled(triangle[1][1]).plus(triangle[1][0], &r))]
            }
            // Alone, a share has its own variance.
            [Some(r), None] => [Some(r.scaled(triangle[0][0])), None],
            [None, Some(t)] => [None, Some(t.scaled(1.0 / (spread(&triangle)).max(1e-12)))],
            [None, None] => [None, None],
        }
    }
}

/// Returns the standard deviation of the second share's errors.
fn spread(triangle: &[[f64; 2]; 2]) -> f64 {
    // The inverse of the triangle is the covariance's: its second row has the length that is asked for.
    let [[a, _], [b, c]] = *triangle;
    (1.0 / (c * c) + (b / (a * c)).powi(2)).sqrt()
}

/// Errors of a leaf along the wavelengths, from which a [`Whitening`] is learnt.
#[derive(Debug, Default)]
pub(crate) struct Errors {
    /// Wavelength and errors of reflectance and transmittance, as far as measured.
    pub(crate) rows: Vec<(f64, [Option<f64>; 2])>,
}

impl Errors {
    /// Learns how errors hang together; lengths beyond `most_nm` are cut there.
    pub(crate) fn learn(&self, most_nm: f64) -> Whitening {
        let length_nm = self.length_nm().min(most_nm);
        // Covariance of what is fresh at each wavelength.
        let unscaled = Whitening { length_nm, ..Whitening::even(1.0) };
        let mut whitener = Whitener::new(&unscaled);
        let row = |error: f64| Row { error, by: [0.0; MAX_UNKNOWNS] };
        let (mut squares, mut counts, mut product, mut pairs) = ([0.0f64; 2], [0.0f64; 2], 0.0, 0.0f64);
        for (nm, errors) in &self.rows {
            let fresh = whitener.next(*nm, errors.map(|error| error.map(row)));
            for side in 0..2 {
                if let Some(row) = fresh[side] {
                    squares[side] += row.error * row.error;
                    counts[side] += 1.0;
                }
            }
            if let [Some(r), Some(t)] = fresh {
                product += r.error * t.error;
                pairs += 1.0;
            }
        }
        let [r, t] = [0, 1].map(|side| (squares[side] / counts[side].max(1.0)).max(MIN_ERROR * MIN_ERROR));
        let both = if pairs > 0.0 {
            (product / pairs).clamp(-MAX_SHARED * (r * t).sqrt(), MAX_SHARED * (r * t).sqrt())
        } else {
            0.0
        };
        // Inverse of the Cholesky factor of [[r, both], [both, t]].
        let a = r.sqrt();
        let c = (t - both * both / r).sqrt();
        Whitening { length_nm, triangle: [[1.0 / a, 0.0], [-both / (r * c), 1.0 / c]] }
    }

    /// Returns the standard deviation of all errors of a fit of `unknowns` unknowns; at least `expected` where they are too few
    /// to tell.
    pub(crate) fn deviation(&self, unknowns: usize, expected: f64) -> f64 {
        let errors = self.rows.iter().flat_map(|(_, errors)| errors.iter().flatten());
        let (squares, count) = errors.fold((0.0, 0usize), |(squares, count), x| (squares + x * x, count + 1));
        let freedom = count.saturating_sub(unknowns);
        let deviation = f64::sqrt(squares / freedom.max(1) as f64);
        deviation.max(if freedom < MIN_FREEDOM { expected } else { MIN_ERROR })
    }

    /// Returns the root mean square errors of reflectance and transmittance, as far as measured.
    pub(crate) fn rmse(&self) -> [Option<f64>; 2] {
        [0, 1].map(|side| {
            let errors = self.rows.iter().filter_map(|(_, errors)| errors[side]);
            let (squares, count) = errors.fold((0.0, 0), |(squares, count), x| (squares + x * x, count + 1));
            (count > 0).then(|| f64::sqrt(squares / f64::from(count)))
        })
    }

    /// Returns the distance over which errors fall to 1/e, from neighbouring wavelengths.
    fn length_nm(&self) -> f64 {
        let (mut products, mut squares, mut step_nm, mut count) = (0.0, 0.0, 0.0, 0.0);
        for side in 0..2 {
            let mut before: Option<(f64, f64)> = None;
            for (nm, errors) in &self.rows {
                let Some(error) = errors[side] else { continue };
                if let Some((earlier_nm, earlier)) = before {
                    products += error * earlier;
                    squares += 0.5 * (error * error + earlier * earlier);
                    step_nm += nm - earlier_nm;
                    count += 1.0;
                }
                before = Some((*nm, error));
            }
        }
        let shared = products / f64::max(squares, 1e-300);
        // As much as noise shows by chance is none.
        if count == 0.0 || shared <= CHANCE / f64::sqrt(count) {
            0.0
        } else {
            -step_nm / count / shared.min(1.0 - 1e-9).ln()
        }
    }
}

/// Standard deviation of errors at least: a millionth of the light, finer than any instrument.
const MIN_ERROR: f64 = 1e-6;
/// Errors beyond the number of unknowns that tell their own standard deviation.
const MIN_FREEDOM: usize = 10;
/// Correlation of neighbours below which it is chance, over the root of their number: two standard errors.
const CHANCE: f64 = 2.0;
/// Correlation of the errors of both shares at most.
const MAX_SHARED: f64 = 0.95;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inversion::simulated::normal;
    use rand::SeedableRng;
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// Draws errors of standard deviation 0.01 every 5 nm that fall to 1/e over `length_nm`; those of transmittance follow
    /// reflectance's by the correlation -0.6.
    fn errors(length_nm: f64, seed: u64) -> Errors {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut normal = || normal(&mut random);
        let kept = if length_nm > 0.0 { f64::exp(-5.0 / length_nm) } else { 0.0 };
        let mut now = [0.0; 2];
        let mut rows = Vec::new();
        for i in 0..3000 {
            let r = normal();
            let fresh = [r, -0.6 * r + 0.8 * normal()];
            for side in 0..2 {
                now[side] = kept * now[side] + (1.0 - kept * kept).sqrt() * fresh[side];
            }
            rows.push((5.0 * f64::from(i), now.map(|error| Some(0.01 * error))));
        }
        Errors { rows }
    }

    #[test]
    fn errors_that_hang_together_are_learnt_and_made_independent() {
        for length_nm in [0.0, 20.0, 40.0] {
            let errors = errors(length_nm, 1);
            let whitening = errors.learn(60.0);
            assert!((whitening.length_nm - length_nm).abs() < 0.15 * length_nm + 1e-9, "{length_nm}: {whitening:?}");
            let mut whitener = Whitener::new(&whitening);
            let row = |error: f64| Row { error, by: [error; MAX_UNKNOWNS] };
            let fresh: Vec<[f64; 2]> = errors
                .rows
                .iter()
                .map(|(nm, errors)| {
                    whitener.next(*nm, errors.map(|error| error.map(row))).map(|row| row.unwrap().error)
                })
                .collect();
            let mean = |of: &dyn Fn(&[f64; 2]) -> f64| fresh.iter().map(of).sum::<f64>() / fresh.len() as f64;
            for side in 0..2 {
                let variance = mean(&|x| x[side] * x[side]);
                assert!((variance - 1.0).abs() < 0.05, "{length_nm}: {variance}");
                let along = fresh.windows(2).map(|x| x[0][side] * x[1][side]).sum::<f64>() / fresh.len() as f64;
                assert!(along.abs() < 0.06, "{length_nm}: {along}");
            }
            assert!(mean(&|x| x[0] * x[1]).abs() < 0.05);
        }
        // Planted difference: what takes these errors for independent leaves them as they are.
        let (together, none) = (errors(40.0, 1), Whitening::even(0.01));
        let mut whitener = Whitener::new(&none);
        let row = |error: f64| Row { error, by: [0.0; MAX_UNKNOWNS] };
        let left = together.rows.iter().map(|(nm, x)| whitener.next(*nm, x.map(|x| x.map(row)))[0].unwrap().error);
        let left: Vec<f64> = left.collect();
        assert!(left.windows(2).map(|x| x[0] * x[1]).sum::<f64>() / left.len() as f64 > 0.7);
    }

    #[test]
    fn a_share_alone_has_its_own_variance_and_few_errors_are_as_large_as_expected() {
        let mut errors = errors(0.0, 2);
        let whitening = errors.learn(60.0);
        errors.rows.iter_mut().for_each(|(_, errors)| errors[0] = None);
        let mut whitener = Whitener::new(&whitening);
        let row = |error: f64| Row { error, by: [0.0; MAX_UNKNOWNS] };
        let alone = errors.rows.iter().map(|(nm, x)| whitener.next(*nm, x.map(|x| x.map(row)))[1].unwrap().error);
        let variance = alone.map(|x| x * x).sum::<f64>() / errors.rows.len() as f64;
        assert!((variance - 1.0).abs() < 0.05, "{variance}");
        assert!((errors.deviation(7, 1.0) - 0.01).abs() < 5e-4);
        errors.rows.truncate(8);
        assert_eq!(errors.deviation(7, 1.0), 1.0);
    }
}
