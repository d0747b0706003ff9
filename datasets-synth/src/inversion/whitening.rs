//! Errors of a model along the wavelengths, made independent.
//!
//! A leaf model misses a measured spectrum by smooth curves, not by noise: neighbouring wavelengths err alike,
//! reflectance errs against transmittance, and one face like the other. Least squares that take them for independent trust
//! the level of a plateau of a thousand wavelengths too much, and tell standard errors that are far too small. Here an error
//! keeps the share `exp(-step / length)` of its neighbour's [generalised least squares with first-order autoregressive
//! errors, Prais & Winsten 1954], and the rest of all shares of light is scaled by its covariance.

use nalgebra::Matrix4;

use crate::inversion::forward::{MAX_UNKNOWNS, Values};
use crate::inversion::spectra::SHARES;

/// What is known of the errors.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Whitening {
    /// Distance in nanometres over which an error falls to 1/e; 0 where they are independent.
    pub(crate) length_nm: f64,
    /// Rows of the lower triangle that turns errors into independent ones of variance 1, for every set of shares that are
    /// measured together: the set's index has the bit `i` for share `i`.
    triangles: [Triangle; 1 << SHARES],
}

type Triangle = [[f64; SHARES]; SHARES];

impl Whitening {
    /// Returns what takes errors for independent, all of standard deviation `error`.
    pub(crate) fn even(error: f64) -> Whitening {
        let triangle = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { 1.0 / error } else { 0.0 }));
        Whitening { length_nm: 0.0, triangles: [triangle; 1 << SHARES] }
    }

    /// Returns what scales errors by their covariance; correlations shrink until no error is told by the others.
    fn of_covariance(length_nm: f64, mut covariance: Matrix4<f64>) -> Whitening {
        for _ in 0..MAX_SHRINKS {
            let triangle = |set| triangle_of(&covariance, set);
            let whole = triangle_of(&covariance, (1 << SHARES) - 1);
            // The diagonal of an inverse triangle: what of an error the ones before it do not tell.
            let is_told = |i: usize, triangle: &Triangle| {
                triangle[i][i].powi(2) * covariance[(i, i)] > 1.0 / (1.0 - MAX_SHARED * MAX_SHARED) * (1.0 + 1e-9)
            };
            if whole.is_some_and(|whole| !(0..SHARES).any(|i| is_told(i, &whole))) {
                let triangles = std::array::from_fn(|set| triangle(set).unwrap_or_default());
                return Whitening { length_nm, triangles };
            }
            covariance = covariance.map_with_location(|i, j, x| if i == j { x } else { SHRINK * x });
        }
        let triangles = std::array::from_fn(|set| triangle_of(&Matrix4::from_diagonal(&covariance.diagonal()), set));
        Whitening { length_nm, triangles: triangles.map(Option::unwrap_or_default) }
    }
}

/// Returns the inverse of the Cholesky factor of the covariance of a set of shares.
fn triangle_of(covariance: &Matrix4<f64>, set: usize) -> Option<Triangle> {
    let is_in = |i: usize| set >> i & 1 == 1;
    let part = Matrix4::from_fn(|i, j| match is_in(i) && is_in(j) {
        true => covariance[(i, j)],
        false => f64::from(u8::from(i == j)),
    });
    let inverse = part.cholesky()?.l().solve_lower_triangular(&Matrix4::identity())?;
    Some(std::array::from_fn(|i| std::array::from_fn(|j| inverse[(i, j)])))
}

/// Error of one share of light with its derivatives.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    pub(crate) error: f64,
    pub(crate) by: Values,
}

impl Row {
    fn scale(&mut self, factor: f64) {
        self.error *= factor;
        self.by.iter_mut().for_each(|by| *by *= factor);
    }

    fn add(&mut self, factor: f64, other: &Row) {
        self.error += factor * other.error;
        self.by.iter_mut().zip(&other.by).for_each(|(by, other)| *by += factor * other);
    }
}

/// Rows of a wavelength, of those shares of light that were measured there.
pub(crate) type Rows = [Option<Row>; SHARES];

/// Walker over ascending wavelengths that makes errors independent.
pub(crate) struct Whitener<'a> {
    whitening: &'a Whitening,
    before: [Option<(f64, Row)>; SHARES],
}

impl<'a> Whitener<'a> {
    pub(crate) fn new(whitening: &'a Whitening) -> Whitener<'a> {
        Whitener { whitening, before: [None; SHARES] }
    }

    /// Makes the rows of the next wavelength independent.
    #[inline]
    pub(crate) fn whiten(&mut self, wavelength_nm: f64, rows: &mut Rows) {
        let Whitening { length_nm, triangles } = self.whitening;
        let mut set = 0;
        for (i, row) in rows.iter_mut().enumerate() {
            let Some(row) = row else { continue };
            set |= 1 << i;
            if *length_nm > 0.0
                && let Some((nm, earlier)) = self.before[i].replace((wavelength_nm, *row))
            {
                let kept = (-(wavelength_nm - nm) / length_nm).exp();
                row.add(-kept, &earlier);
                row.scale(1.0 / (1.0 - kept * kept).sqrt());
            }
        }
        let triangle = &triangles[set];
        // From the last on, each from those before it, which are still as they were.
        for i in (0..SHARES).rev() {
            let (before, rest) = rows.split_at_mut(i);
            let Some(row) = &mut rest[0] else { continue };
            row.scale(triangle[i][i]);
            for (factor, earlier) in triangle[i].iter().zip(before) {
                if let Some(earlier) = earlier.as_ref().filter(|_| *factor != 0.0) {
                    row.add(*factor, earlier);
                }
            }
        }
    }
}

/// Errors of a leaf along the wavelengths, from which a [`Whitening`] is learnt.
#[derive(Debug, Default)]
pub(crate) struct Errors {
    /// Wavelength and errors of the shares of light, as far as measured.
    pub(crate) rows: Vec<(f64, [Option<f64>; SHARES])>,
}

impl Errors {
    /// Learns how errors hang together; lengths beyond `most_nm` are cut there.
    pub(crate) fn learn(&self, most_nm: f64) -> Whitening {
        let length_nm = self.length_nm().min(most_nm);
        // Covariance of what is fresh at each wavelength.
        let unscaled = Whitening { length_nm, ..Whitening::even(1.0) };
        let mut whitener = Whitener::new(&unscaled);
        let row = |error: f64| Row { error, by: [0.0; MAX_UNKNOWNS] };
        let (mut products, mut pairs) = (Matrix4::zeros(), Matrix4::zeros());
        for (nm, errors) in &self.rows {
            let mut fresh = errors.map(|error| error.map(row));
            whitener.whiten(*nm, &mut fresh);
            for i in 0..SHARES {
                for j in 0..SHARES {
                    if let (Some(x), Some(y)) = (fresh[i], fresh[j]) {
                        products[(i, j)] += x.error * y.error;
                        pairs[(i, j)] += 1.0;
                    }
                }
            }
        }
        let mean = products.component_div(&pairs.map(|pairs: f64| pairs.max(1.0)));
        let variance = |i: usize| mean[(i, i)].max(MIN_ERROR * MIN_ERROR);
        let covariance = Matrix4::from_fn(|i, j| {
            let most = MAX_SHARED * (variance(i) * variance(j)).sqrt();
            if i == j { variance(i) } else { mean[(i, j)].clamp(-most, most) }
        });
        Whitening::of_covariance(length_nm, covariance)
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

    /// Returns the root mean square errors of the shares of light, as far as measured.
    pub(crate) fn rmse(&self) -> [Option<f64>; SHARES] {
        std::array::from_fn(|side| {
            let errors = self.rows.iter().filter_map(|(_, errors)| errors[side]);
            let (squares, count) = errors.fold((0.0, 0), |(squares, count), x| (squares + x * x, count + 1));
            (count > 0).then(|| f64::sqrt(squares / f64::from(count)))
        })
    }

    /// Returns the distance over which errors fall to 1/e, from neighbouring wavelengths.
    fn length_nm(&self) -> f64 {
        let (mut products, mut squares, mut step_nm, mut count) = (0.0, 0.0, 0.0, 0.0);
        for side in 0..SHARES {
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
/// Correlation of an error with the others at most.
const MAX_SHARED: f64 = 0.95;
/// Factor by which correlations shrink where they are larger together, and how often at most.
const SHRINK: f64 = 0.9;
const MAX_SHRINKS: usize = 40;

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
            let [r, t] = now.map(|error| Some(0.01 * error));
            rows.push((5.0 * f64::from(i), [r, t, None, None]));
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
                    let mut rows = errors.map(|error| error.map(row));
                    whitener.whiten(*nm, &mut rows);
                    let [r, t, ..] = rows;
                    [r, t].map(|row| row.unwrap().error)
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
        let left = together.rows.iter().map(|(nm, x)| {
            let mut rows = x.map(|x| x.map(row));
            whitener.whiten(*nm, &mut rows);
            rows[0].unwrap().error
        });
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
        let alone = errors.rows.iter().map(|(nm, x)| {
            let mut rows = x.map(|x| x.map(row));
            whitener.whiten(*nm, &mut rows);
            rows[1].unwrap().error
        });
        let variance = alone.map(|x| x * x).sum::<f64>() / errors.rows.len() as f64;
        assert!((variance - 1.0).abs() < 0.05, "{variance}");
        assert!((errors.deviation(7, 1.0) - 0.01).abs() < 5e-4);
        errors.rows.truncate(8);
        assert_eq!(errors.deviation(7, 1.0), 1.0);
    }

    #[test]
    fn four_shares_are_made_independent_and_none_is_told_by_the_others() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(3);
        let mut normal = || normal(&mut random);
        let rows: Vec<(f64, [Option<f64>; SHARES])> = (0..4000)
            .map(|i| {
                let [a, b, c, d] = [normal(), normal(), normal(), normal()];
                (f64::from(i), [a, 0.8 * b - 0.6 * a, 0.6 * c + 0.8 * a, 0.5 * d + b - 0.3 * c].map(Some))
            })
            .collect();
        let covariance = |rows: &[(f64, [Option<f64>; SHARES])], whitening: &Whitening| {
            let mut whitener = Whitener::new(whitening);
            let row = |error: f64| Row { error, by: [error; MAX_UNKNOWNS] };
            let mut sums = Matrix4::<f64>::zeros();
            for (nm, errors) in rows {
                let mut fresh = errors.map(|error| error.map(row));
                whitener.whiten(*nm, &mut fresh);
                let value = |i: usize| fresh[i].map_or(0.0, |row| row.error);
                sums += Matrix4::from_fn(|i, j| value(i) * value(j));
            }
            sums / rows.len() as f64
        };
        let errors = Errors { rows };
        let whitening = errors.learn(60.0);
        assert!((covariance(&errors.rows, &whitening) - Matrix4::identity()).amax() < 0.05);
        // Without the first share the other three are independent, too.
        let without: Vec<_> = errors.rows.iter().map(|(nm, [_, b, c, d])| (*nm, [None, *b, *c, *d])).collect();
        let expected = Matrix4::from_fn(|i, j| f64::from(u8::from(i == j && i > 0)));
        assert!((covariance(&without, &whitening) - expected).amax() < 0.05);
        // Planted difference: taken for independent, they are not.
        assert!((covariance(&errors.rows, &Whitening::even(1.0)) - Matrix4::identity()).amax() > 0.5);
        // Faces that err alike to the last digit still count as two.
        let alike = errors.rows.iter().map(|(nm, [a, b, ..])| (*nm, [*a, *b, *a, *b])).collect();
        let alike = Errors { rows: alike }.learn(60.0);
        assert!(alike.triangles.iter().flatten().flatten().all(|x| x.is_finite() && x.abs() < 10.0), "{alike:?}");
    }
}
