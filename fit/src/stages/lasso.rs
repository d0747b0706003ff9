//! Stagewise Lasso (BLasso) [Zhao 2007]: forward steps of size `epsilon` on the coordinate that lowers
//! the loss most, backward steps whenever they lower the L1-penalised loss, the penalty relaxed as the
//! path advances. Works on the Gram matrix, so that a step costs the number of atoms.

use std::ops::ControlFlow;

/// Loss `L(beta) = 1/2 beta' G beta - b' beta` (the constant `1/2 y'y` left out).
#[derive(Debug, Clone, Copy)]
pub struct LassoProblem<'a> {
    /// `G = X'X`, row-major `[atom, atom]`, symmetric, positive semi-definite.
    pub gram: &'a [f64],
    /// `b = X'y`.
    pub correlation: &'a [f64],
    /// Whether coefficients stay at or above 0.
    pub non_negative: bool,
}

/// Parameters of a path.
#[derive(Debug, Clone, Copy)]
pub struct LassoParams {
    /// Step size, in units of a coefficient.
    pub epsilon: f64,
    /// Penalty at which the path ends.
    pub least_penalty: f64,
    /// Steps at most.
    pub most_steps: usize,
}

/// A point of the path.
#[derive(Debug, Clone, Copy)]
pub struct LassoPoint<'a> {
    /// Coefficients.
    pub beta: &'a [f64],
    /// Penalty lambda for which `beta` is (within the step size) the Lasso's solution.
    pub penalty: f64,
    /// Whether the last step went backward.
    pub backward: bool,
    /// Number of coefficients that are not 0.
    pub active: usize,
}

/// Walks the path from 0 and calls `visit` after every step, until it breaks or the path ends.
///
/// Returns the final coefficients. Cost: one Gram row a step.
pub fn stagewise_lasso(
    problem: &LassoProblem,
    params: &LassoParams,
    mut visit: impl FnMut(&LassoPoint) -> ControlFlow<()>,
) -> Vec<f64> {
    let n = problem.correlation.len();
    let epsilon = params.epsilon;
    // A step counts as an improvement above this share of its own scale [Zhao 2007, section 3: xi].
    let tolerance = 1e-9 * epsilon;
    let mut beta = vec![0.0f64; n];
    // Steps as integers: a coefficient that returns to 0 is exactly 0.
    let mut counts = vec![0i64; n];
    let mut gradient: Vec<f64> = problem.correlation.iter().map(|b| -b).collect();
    let mut penalty = f64::INFINITY;
    let change =
        |gradient: &[f64], j: usize, step: f64| step * gradient[j] + 0.5 * step * step * problem.gram[j * n + j];

    for _ in 0..params.most_steps {
        let mut chosen: Option<(usize, i64, bool)> = None;
        // Backward: the step towards 0 that raises the loss least, taken if the penalised loss falls.
        if penalty.is_finite() {
            let best = (0..n)
                .filter(|&j| counts[j] != 0)
                .map(|j| (change(&gradient, j, -(counts[j].signum() as f64) * epsilon), j))
                .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            if let Some((rise, j)) = best
                && rise - penalty * epsilon < -tolerance
            {
                chosen = Some((j, -counts[j].signum(), true));
            }
        }
        if chosen.is_none() {
            let mut best: Option<(f64, usize, i64)> = None;
            for j in 0..n {
                let signs: &[i64] = if problem.non_negative { &[1] } else { &[1, -1] };
                for &sign in signs {
                    let fall = change(&gradient, j, sign as f64 * epsilon);
                    if best.is_none_or(|(least, ..)| fall < least) {
                        best = Some((fall, j, sign));
                    }
                }
            }
            let Some((fall, j, sign)) = best else { break };
            let reached = -(fall + tolerance) / epsilon;
            if reached <= params.least_penalty.max(0.0) {
                break;
            }
            penalty = penalty.min(reached);
            chosen = Some((j, sign, false));
        }
        let Some((j, sign, backward)) = chosen else { break };
        counts[j] += sign;
        beta[j] = counts[j] as f64 * epsilon;
        let row = &problem.gram[j * n..(j + 1) * n];
        gradient.iter_mut().zip(row).for_each(|(g, x)| *g += sign as f64 * epsilon * x);
        let active = counts.iter().filter(|count| **count != 0).count();
        if visit(&LassoPoint { beta: &beta, penalty, backward, active }).is_break() {
            break;
        }
    }
    beta
}

/// Returns the Lasso's solution for one penalty by cyclic coordinate descent [Friedman 2010]: the oracle of the tests.
pub fn coordinate_descent(problem: &LassoProblem, penalty: f64, sweeps: usize) -> Vec<f64> {
    let n = problem.correlation.len();
    let mut beta = vec![0.0f64; n];
    for _ in 0..sweeps {
        let mut moved = 0.0f64;
        for j in 0..n {
            let own = problem.gram[j * n + j];
            if own <= 0.0 {
                continue;
            }
            let others: f64 = (0..n).map(|i| problem.gram[j * n + i] * beta[i]).sum::<f64>() - own * beta[j];
            let raw = problem.correlation[j] - others;
            let shrunk = if raw > penalty {
                raw - penalty
            } else if raw < -penalty && !problem.non_negative {
                raw + penalty
            } else {
                0.0
            };
            moved = moved.max((shrunk / own - beta[j]).abs());
            beta[j] = shrunk / own;
        }
        if moved < 1e-12 {
            break;
        }
    }
    beta
}

/// Solves non-negative least squares on the atoms `active` (no penalty), a few atoms, by coordinate descent.
///
/// Returns the weights in the order of `active`. A ridge of 1e-4 of the diagonal keeps twins apart.
pub fn non_negative_weights(gram: &[f64], n: usize, correlation: &[f64], active: &[usize]) -> Vec<f64> {
    let m = active.len();
    let mut weights = vec![0.0f64; m];
    for _ in 0..200 {
        let mut moved = 0.0f64;
        let mut scale = 0.0f64;
        for i in 0..m {
            let row = active[i] * n;
            let own = gram[row + active[i]] * (1.0 + 1e-4);
            if own <= 0.0 {
                continue;
            }
            let others: f64 = (0..m).filter(|&k| k != i).map(|k| gram[row + active[k]] * weights[k]).sum();
            let next = ((correlation[active[i]] - others) / own).max(0.0);
            moved = moved.max((next - weights[i]).abs());
            scale = scale.max(next);
            weights[i] = next;
        }
        if moved <= 1e-6 * scale {
            break;
        }
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns Gram matrix and correlations of a design given by columns.
    fn problem(columns: &[Vec<f64>], y: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let gram = columns.iter().flat_map(|a| columns.iter().map(move |b| dot(a, b))).collect();
        (gram, columns.iter().map(|a| dot(a, y)).collect())
    }

    fn columns(n: usize, p: usize, shared: f64) -> Vec<Vec<f64>> {
        let number = |i: usize| {
            (((i as u64).wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407) >> 33) % 2000) as f64
                / 1000.0
                - 1.0
        };
        (0..p)
            .map(|j| {
                let raw: Vec<f64> =
                    (0..n).map(|i| number(i * 977 + j * 7919 + 13) + shared * number(i * 31 + 5)).collect();
                let norm = raw.iter().map(|x| x * x).sum::<f64>().sqrt();
                raw.into_iter().map(|x| x / norm).collect()
            })
            .collect()
    }

    fn response(columns: &[Vec<f64>]) -> Vec<f64> {
        (0..columns[0].len())
            .map(|i| 2.0 * columns[0][i] - 1.5 * columns[3][i] + 1.0 * columns[5][i] + 0.05 * (i as f64).sin())
            .collect()
    }

    /// Returns the largest distance between the stagewise path and coordinate descent, over the path.
    fn path_distance(
        gram: &[f64],
        b: &[f64],
        epsilon: f64,
        non_negative: bool,
        backward_allowed: bool,
    ) -> (f64, usize) {
        let p = LassoProblem { gram, correlation: b, non_negative };
        let top = b.iter().fold(0.0f64, |top, x| top.max(x.abs()));
        let mut worst = 0.0f64;
        let mut backward = 0;
        let mut next = 0.9 * top;
        let mut stop = false;
        stagewise_lasso(&p, &LassoParams { epsilon, least_penalty: 0.02 * top, most_steps: 1_000_000 }, |point| {
            backward += usize::from(point.backward);
            if point.backward && !backward_allowed {
                stop = true;
            }
            if point.penalty < next {
                let exact = coordinate_descent(&p, point.penalty, 20_000);
                let distance = point.beta.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                worst = worst.max(distance);
                next = 0.7 * point.penalty;
            }
            if stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        (worst, backward)
    }

    #[test]
    fn the_path_agrees_with_coordinate_descent_within_the_step_size() {
        for shared in [0.0, 0.8] {
            let x = columns(60, 12, shared);
            let (gram, b) = problem(&x, &response(&x));
            let fine = path_distance(&gram, &b, 1e-3, false, true).0;
            let coarse = path_distance(&gram, &b, 1e-2, false, true).0;
            // The distance is a small multiple of the step (the design's conditioning) and falls with it.
            assert!(fine < 12e-3, "fine {fine}");
            assert!(coarse < 12e-2 && fine < 0.5 * coarse, "fine {fine}, coarse {coarse}");
            assert!(path_distance(&gram, &b, 1e-3, true, true).0 < 12e-3);
            // Planted difference: another response's solution is far away.
            let wrong: Vec<f64> = b.iter().map(|x| -x).collect();
            let p = LassoProblem { gram: &gram, correlation: &wrong, non_negative: false };
            let right = LassoProblem { gram: &gram, correlation: &b, non_negative: false };
            let (a, c) = (coordinate_descent(&p, 0.1, 10_000), coordinate_descent(&right, 0.1, 10_000));
            assert!(a.iter().zip(&c).any(|(a, c)| (a - c).abs() > 0.5));
        }
    }

    #[test]
    fn on_an_orthonormal_design_the_path_agrees_within_one_step() {
        let mut gram = vec![0.0; 64];
        (0..8).for_each(|i| gram[i * 9] = 1.0);
        let b: Vec<f64> = (0..8).map(|i| 1.7 * (i as f64 * 1.3).sin()).collect();
        for epsilon in [1e-3, 1e-2] {
            let distance = path_distance(&gram, &b, epsilon, false, true).0;
            assert!(distance <= epsilon * 1.001, "{distance} at {epsilon}");
        }
    }

    #[test]
    fn a_correlated_design_needs_a_backward_step() {
        // x2 is close to y at first, but x0 and x1 together explain y: the Lasso drops x2 again.
        let x = vec![vec![1.0, 0.0, 0.0], vec![0.0, 1.0, 0.0], {
            let norm = (0.45f64 + 0.45 + 0.1).sqrt();
            vec![0.45f64.sqrt() / norm, 0.45f64.sqrt() / norm, 0.1f64.sqrt() / norm]
        }];
        let y = vec![1.0, 1.0, -0.4];
        let (gram, b) = problem(&x, &y);
        let (distance, backward) = path_distance(&gram, &b, 1e-3, true, true);
        assert!(backward > 50, "only {backward} backward steps");
        assert!(distance < 10e-3, "{distance}");
        // Without backward steps (forward stagewise) the answer is another one.
        let exact =
            coordinate_descent(&LassoProblem { gram: &gram, correlation: &b, non_negative: true }, 1e-3, 20_000);
        let mut forward = vec![0.0f64; 3];
        for _ in 0..3000 {
            let gradient: Vec<f64> =
                (0..3).map(|j| (0..3).map(|i| gram[j * 3 + i] * forward[i]).sum::<f64>() - b[j]).collect();
            let best = (0..3).min_by(|&i, &j| gradient[i].total_cmp(&gradient[j])).unwrap();
            if gradient[best] > -1e-3 {
                break;
            }
            forward[best] += 1e-3;
        }
        assert!(forward.iter().zip(&exact).any(|(a, b)| (a - b).abs() > 0.05), "{forward:?} {exact:?}");
    }

    #[test]
    fn non_negative_weights_solve_the_normal_equations_where_those_are_positive() {
        let x = columns(40, 4, 0.3);
        let y: Vec<f64> = (0..40).map(|i| 0.7 * x[1][i] + 0.2 * x[2][i]).collect();
        let (gram, b) = problem(&x, &y);
        let w = non_negative_weights(&gram, 4, &b, &[1, 2]);
        assert!((w[0] - 0.7).abs() < 1e-3 && (w[1] - 0.2).abs() < 1e-3, "{w:?}");
        let w = non_negative_weights(&gram, 4, &b.iter().map(|x| -x).collect::<Vec<_>>(), &[1, 2]);
        assert!(w.iter().all(|x| *x >= 0.0));
    }
}
