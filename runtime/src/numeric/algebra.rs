//! Small dense linear algebra for the levels of an asset. Matrices are square and row-major.

use crate::numeric::in_vectors::in_vectors;
use crate::numeric::vector::dot_slices;
use pulp::{Simd, WithSimd};

/// Number of orthogonal iterations that find principal directions.
const ITERATIONS: usize = 12;

/// Minimises `x'Gx / 2 - p'x` by coordinate descent over `x`, with `G` in `gram` and `p` in `products`. `allowed(sweep,
/// i, x_i)` may change each step. Returns `x`, and `2 p'x - x'Gx`: by how much `x` reduces a sum of squares.
pub(crate) fn descend(
    gram: &[f32],
    products: &[f32],
    sweeps: usize,
    allowed: impl Fn(usize, usize, f32) -> f32,
) -> (Vec<f32>, f32) {
    let count = products.len();
    let mut x = vec![0.0f32; count];
    let mut slope = products.to_vec();
    for sweep in 0..sweeps {
        for i in 0..count {
            let row = &gram[i * count..(i + 1) * count];
            if row[i] <= 0.0 {
                continue;
            }
            let moved = allowed(sweep, i, x[i] + slope[i] / row[i]) - x[i];
            if moved != 0.0 {
                x[i] += moved;
                slope.iter_mut().zip(row).for_each(|(slope, g)| *slope -= moved * g);
            }
        }
    }
    // Gx = p - slope.
    let gain = (0..count).map(|i| x[i] * (products[i] + slope[i])).sum();
    (x, gain)
}

/// Returns the products of the rows with each other: `[i, j]`.
pub(crate) fn gram_of(rows: &[Vec<f32>]) -> Vec<f32> {
    in_vectors(Gram(rows))
}

/// The argument of [`gram_of`], for [`pulp`].
struct Gram<'a>(&'a [Vec<f32>]);

impl WithSimd for Gram<'_> {
    type Output = Vec<f32>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Vec<f32> {
        let Gram(rows) = self;
        let count = rows.len();
        let mut gram = vec![0.0; count * count];
        for i in 0..count {
            for j in 0..=i {
                let product = dot_slices(&rows[i], &rows[j]);
                gram[i * count + j] = product;
                gram[j * count + i] = product;
            }
        }
        gram
    }
}

/// Returns the lower triangle `[i, j]` of the Cholesky factor of a matrix with `count` rows; `None` if the matrix is
/// not positive definite.
pub(crate) fn cholesky(matrix: &[f32], count: usize) -> Option<Vec<f32>> {
    let mut factor = vec![0.0f32; count * count];
    for i in 0..count {
        for j in 0..=i {
            let sum = matrix[i * count + j]
                - dot_slices(&factor[i * count..i * count + j], &factor[j * count..j * count + j]);
            if i == j && (sum.is_nan() || sum <= 0.0) {
                return None;
            }
            factor[i * count + j] = if i == j { sum.sqrt() } else { sum / factor[j * count + j] };
        }
    }
    Some(factor)
}

/// Returns the inverse of a positive definite matrix with `count` rows in double precision, by Gauss-Jordan elimination
/// without a search for pivots, which such a matrix does not need.
pub(crate) fn inverse_of_positive(matrix: &[f64], count: usize) -> Vec<f64> {
    let mut left = matrix.to_vec();
    let mut inverse: Vec<f64> = (0..count * count).map(|at| if at / count == at % count { 1.0 } else { 0.0 }).collect();
    for pivot in 0..count {
        let scale = 1.0 / left[pivot * count + pivot];
        for column in 0..count {
            left[pivot * count + column] *= scale;
            inverse[pivot * count + column] *= scale;
        }
        for row in (0..count).filter(|row| *row != pivot) {
            let factor = left[row * count + pivot];
            for column in 0..count {
                left[row * count + column] -= factor * left[pivot * count + column];
                inverse[row * count + column] -= factor * inverse[pivot * count + column];
            }
        }
    }
    inverse
}

/// Solves `L L' x = products` for `x`; `factor` is `L` of [`cholesky`].
pub(crate) fn solve(factor: &[f32], products: Vec<f32>) -> Vec<f32> {
    let (mut x, count) = (products, factor.len().isqrt());
    for i in 0..count {
        let row = &factor[i * count..i * count + i];
        x[i] = (x[i] - dot_slices(row, &x[..i])) / factor[i * count + i];
    }
    for i in (0..count).rev() {
        x[i] /= factor[i * count + i];
        let (head, tail) = x.split_at_mut(i);
        head.iter_mut().zip(&factor[i * count..i * count + i]).for_each(|(x, l)| *x -= l * tail[0]);
    }
    x
}

/// Returns at most `count` orthonormal directions of largest variance of centred points, the largest first, by
/// orthogonal iteration.
pub(crate) fn principal(points: &[Vec<f32>], count: usize) -> Vec<Vec<f32>> {
    let length = points.first().map_or(0, Vec::len);
    let count = count.min(length).min(points.len());
    let columns: Vec<Vec<f32>> = (0..length).map(|i| points.iter().map(|point| point[i]).collect()).collect();
    let covariance = gram_of(&columns);
    // The points themselves span the first guess.
    let mut directions: Vec<Vec<f32>> = (0..count).map(|i| points[i * points.len() / count].clone()).collect();
    for _ in 0..ITERATIONS {
        for direction in &mut directions {
            *direction =
                (0..length).map(|i| dot_slices(&covariance[i * length..(i + 1) * length], direction)).collect();
        }
        for i in 0..count {
            let (before, rest) = directions.split_at_mut(i);
            // Twice, because once leaves rounding errors as large as a faint direction.
            for _ in 0..2 {
                for other in before.iter() {
                    let along = dot_slices(other, &rest[0]);
                    rest[0].iter_mut().zip(other).for_each(|(x, y)| *x -= along * y);
                }
            }
            let norm = dot_slices(&rest[0], &rest[0]).sqrt();
            let scale = if norm > 1e-30 { 1.0 / norm } else { 0.0 };
            rest[0].iter_mut().for_each(|x| *x *= scale);
        }
    }
    directions
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    fn rows(random: &mut Random, count: usize, length: usize) -> Vec<Vec<f32>> {
        (0..count).map(|_| (0..length).map(|_| random.within(-1.0, 1.0)).collect()).collect()
    }

    fn times(matrix: &[f32], x: &[f32]) -> Vec<f32> {
        matrix.chunks_exact(x.len()).map(|row| dot_slices(row, x)).collect()
    }

    fn far(a: &[f32], b: &[f32]) -> f32 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn a_system_is_solved_and_by_descent_as_well() {
        let mut random = Random::new(1);
        let gram = gram_of(&rows(&mut random, 9, 60));
        let x: Vec<f32> = (0..9).map(|_| random.within(-2.0, 2.0)).collect();
        let products = times(&gram, &x);
        let factor = cholesky(&gram, 9).unwrap();
        assert!(far(&solve(&factor, products.clone()), &x) < 1e-4);
        let (found, gain) = descend(&gram, &products, 200, |_, _, x| x);
        assert!(far(&found, &x) < 1e-4);
        // 2 p'x - x'Gx is p'x where Gx = p.
        assert!(gain > 0.0 && (gain - dot_slices(&products, &x)).abs() < 1e-3 * gain);
        // What a step may not change stays 0, and the rest settles elsewhere.
        let (bound, less) = descend(&gram, &products, 200, |_, i, x| if i == 2 { 0.0 } else { x });
        assert!(bound[2] == 0.0 && less < gain && far(&bound, &x) > 1e-3);
        // Planted difference: a matrix that is not positive has no factor.
        let mut bad = gram;
        bad[4 * 9 + 4] = -1.0;
        assert_eq!(cholesky(&bad, 9), None);
    }

    #[test]
    fn principal_directions_are_orthonormal_and_the_largest_come_first() {
        let mut random = Random::new(2);
        // Spread along three known directions, far, less and least.
        let axes = [[0.6f32, 0.8, 0.0, 0.0], [-0.8, 0.6, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        let point = |random: &mut Random| -> Vec<f32> {
            let along = [5.0, 1.0, 0.2].map(|reach| random.within(-reach, reach));
            (0..4).map(|i| (0..3).map(|k| along[k] * axes[k][i]).sum()).collect()
        };
        let points: Vec<Vec<f32>> = (0..400).map(|_| point(&mut random)).collect();
        let found = principal(&points, 3);
        for (k, direction) in found.iter().enumerate() {
            assert!((dot_slices(direction, &axes[k]).abs() - 1.0).abs() < 0.02, "{k}: {direction:?}");
            for other in &found[..k] {
                assert!(dot_slices(direction, other).abs() < 1e-5);
            }
        }
        // Planted difference: the second is not the first.
        assert!(dot_slices(&found[1], &axes[0]).abs() < 0.1);
        assert_eq!(principal(&points, 9).len(), 4);
    }
}
