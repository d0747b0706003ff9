//! Damped Gauss-Newton steps within bounds [Levenberg 1944; Marquardt 1963], for up to ten unknowns.
//!
//! A bound that the solution presses against is taken out of the step. Steps are solved with `nalgebra`; the loop is ours,
//! because those of the libraries know no bounds, and an inversion has a few microseconds for each step.

use nalgebra::{SMatrix, SVector};

use crate::inversion::forward::{MAX_UNKNOWNS, Unknown, Values};

/// Matrix over the unknowns.
pub(crate) type Square = SMatrix<f64, MAX_UNKNOWNS, MAX_UNKNOWNS>;

/// Steps at most; ten are usual.
const MAX_STEPS: usize = 60;
/// Step, relative to the bounds' distance, that ends the search; it is still taken.
const SMALL_STEP: f64 = 1e-5;
/// Damping at the start, and the largest before the search is given up.
const FIRST_DAMPING: f64 = 1e-3;
const MAX_DAMPING: f64 = 1e8;

/// Sums over the measurements that a step needs, by unknowns in units of their spans.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Normal {
    /// Sum of squared errors.
    pub(crate) squares: f64,
    /// Products of the derivatives.
    pub(crate) products: Square,
    /// Products of derivatives and errors.
    pub(crate) gradient: SVector<f64, MAX_UNKNOWNS>,
    /// Number of measurements.
    pub(crate) count: usize,
    /// Number of unknowns.
    unknowns: usize,
}

/// Number of unknowns of most models, for which sums are compiled by themselves.
const USUAL_UNKNOWNS: usize = 7;

impl Normal {
    pub(crate) fn new(unknowns: usize) -> Normal {
        Normal { squares: 0.0, products: Square::zeros(), gradient: SVector::zeros(), count: 0, unknowns }
    }

    /// Adds a measurement: its error, and its derivatives by the unknowns in units of their spans.
    pub(crate) fn add(&mut self, error: f64, by: &Values) {
        self.squares += error * error;
        self.count += 1;
        if self.unknowns <= USUAL_UNKNOWNS {
            self.add_some::<USUAL_UNKNOWNS>(error, by);
        } else {
            self.add_some::<MAX_UNKNOWNS>(error, by);
        }
    }

    fn add_some<const COUNT: usize>(&mut self, error: f64, by: &Values) {
        for i in 0..COUNT {
            self.gradient[i] += by[i] * error;
            for j in 0..=i {
                self.products[(i, j)] += by[i] * by[j];
            }
        }
    }

    /// Fills the upper triangle.
    pub(crate) fn mirrored(mut self) -> Normal {
        for i in 0..MAX_UNKNOWNS {
            for j in 0..i {
                self.products[(j, i)] = self.products[(i, j)];
            }
        }
        self
    }
}

/// Place where a search ended.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Minimum {
    /// Values of the unknowns.
    pub(crate) values: Values,
    /// Sums there.
    pub(crate) normal: Normal,
    /// Number of steps that were tried.
    pub(crate) steps: usize,
}

impl Minimum {
    /// Returns the covariance of what `moves`, in units of spans and of the squared errors; infinite where they do not tell it.
    pub(crate) fn covariance(&self, moves: &[bool; MAX_UNKNOWNS]) -> Square {
        let cholesky = restricted(&self.normal.products, moves).cholesky();
        cholesky.map_or_else(|| Square::from_diagonal_element(f64::INFINITY), |cholesky| cholesky.inverse())
    }
}

/// Returns the values of least squared error from `start` on. Unknowns that are not `free` stay.
pub(crate) fn minimum(
    unknowns: &[Unknown],
    free: &[bool; MAX_UNKNOWNS],
    start: Values,
    mut normal: impl FnMut(&Values) -> Normal,
) -> Minimum {
    let mut here = Minimum { values: start, normal: normal(&start), steps: 0 };
    let mut damping = FIRST_DAMPING;
    while here.steps < MAX_STEPS && damping < MAX_DAMPING {
        here.steps += 1;
        let moves = movable(unknowns, free, &here);
        let Some(step) = solved(&here.normal, &moves, damping) else {
            damping *= 10.0;
            continue;
        };
        let mut values = here.values;
        let mut largest = 0.0f64;
        for (i, unknown) in unknowns.iter().enumerate() {
            let [least, most] = unknown.bounds;
            values[i] = (values[i] - step[i] * unknown.span()).clamp(least, most);
            largest = largest.max((values[i] - here.values[i]).abs() / unknown.span());
        }
        if largest < SMALL_STEP {
            // Near the minimum steps shrink faster than by half, so that nothing is left to gain.
            here.values = values;
            break;
        }
        let there = normal(&values);
        if there.squares <= here.normal.squares {
            here = Minimum { values, normal: there, ..here };
            damping = (0.2 * damping).max(1e-12);
        } else {
            damping *= 8.0;
        }
    }
    here
}

/// Returns which unknowns move: those that are free and do not press against a bound.
pub(crate) fn movable(unknowns: &[Unknown], free: &[bool; MAX_UNKNOWNS], at: &Minimum) -> [bool; MAX_UNKNOWNS] {
    let mut moves = [false; MAX_UNKNOWNS];
    for (i, unknown) in unknowns.iter().enumerate() {
        let [least, most] = unknown.bounds;
        let pressed = (at.values[i] <= least && at.normal.gradient[i] > 0.0)
            || (at.values[i] >= most && at.normal.gradient[i] < 0.0);
        moves[i] = free[i] && !pressed;
    }
    moves
}

/// Returns the damped step in units of spans; 0 for what does not move.
fn solved(normal: &Normal, moves: &[bool; MAX_UNKNOWNS], damping: f64) -> Option<SVector<f64, MAX_UNKNOWNS>> {
    let mut gradient = normal.gradient;
    let mut matrix = restricted(&normal.products, moves);
    let largest = (0..MAX_UNKNOWNS).filter(|i| moves[*i]).map(|i| matrix[(i, i)]).fold(0.0, f64::max);
    for i in 0..MAX_UNKNOWNS {
        if moves[i] {
            matrix[(i, i)] += damping * matrix[(i, i)] + 1e-13 * largest;
        } else {
            gradient[i] = 0.0;
        }
    }
    Some(matrix.cholesky()?.solve(&gradient))
}

/// Returns a matrix without the rows and columns of what does not move: 1 on the diagonal there.
fn restricted(products: &Square, moves: &[bool; MAX_UNKNOWNS]) -> Square {
    Square::from_fn(|i, j| match moves[i] && moves[j] {
        true => products[(i, j)],
        false => f64::from(u8::from(i == j)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn unknown(bounds: [f64; 2]) -> Unknown {
        Unknown { key: "x", option: "x", name: "x", unit: "", bounds, range: bounds, start: 0.0, spread: 1.0 }
    }

    /// Rosenbrock's valley as two errors: 10 (y - x^2) and 1 - x.
    fn valley(unknowns: &[Unknown], values: &Values) -> Normal {
        let [x, y, ..] = *values;
        let mut normal = Normal::new(unknowns.len());
        let (sx, sy) = (unknowns[0].span(), unknowns[1].span());
        let by = |x: f64, y: f64| {
            let mut by = [0.0; MAX_UNKNOWNS];
            by[..2].copy_from_slice(&[x * sx, y * sy]);
            by
        };
        normal.add(10.0 * (y - x * x), &by(-20.0 * x, 10.0));
        normal.add(1.0 - x, &by(-1.0, 0.0));
        normal.mirrored()
    }

    fn search(unknowns: &[Unknown], start: [f64; 2]) -> Minimum {
        let free = std::array::from_fn(|i| i < 2);
        let start = std::array::from_fn(|i| if i < 2 { start[i] } else { 0.0 });
        minimum(unknowns, &free, start, |values| valley(unknowns, values))
    }

    #[test]
    fn rosenbrocks_valley_is_walked_to_its_end() {
        let wide = [unknown([-5.0, 5.0]); 2];
        for start in [[-1.2, 1.0], [4.0, -4.0], [0.0, 0.0]] {
            let found = search(&wide, start);
            assert!((found.values[0] - 1.0).abs() < 1e-6 && (found.values[1] - 1.0).abs() < 1e-6, "{found:?}");
            assert!(found.steps < MAX_STEPS);
        }
    }

    #[test]
    fn at_a_bound_the_rest_is_still_solved() {
        let cut = [unknown([-5.0, 0.5]), unknown([-5.0, 5.0])];
        let found = search(&cut, [-1.0, 1.0]);
        assert!(found.values[0] == 0.5 && (found.values[1] - 0.25).abs() < 1e-6, "{found:?}");
        let free = std::array::from_fn(|i| i < 2);
        assert_eq!(movable(&cut, &free, &found)[..2], [false, true]);
    }

    #[test]
    fn what_no_measurement_tells_stays_where_it_is() {
        let three = [unknown([-5.0, 5.0]); 3];
        let free = std::array::from_fn(|i| i < 3);
        let mut start = [0.0; MAX_UNKNOWNS];
        start[2] = 2.5;
        let found = minimum(&three, &free, start, |values| valley(&three, values));
        assert!((found.values[0] - 1.0).abs() < 1e-6 && found.values[2] == 2.5, "{found:?}");
    }
}
