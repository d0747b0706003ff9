//! Symmetric matrices of 3 x 3. Twin: `voltex/matrix.wgsl`.

use crate::numeric::vector::dot;

/// A symmetric matrix of 3 x 3: xx, yy, zz, xy, xz, yz.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sym3(pub [f32; 6]);

impl Sym3 {
    /// Returns `a n n'`.
    pub fn outer(n: [f32; 3], a: f32) -> Sym3 {
        Sym3([a * n[0] * n[0], a * n[1] * n[1], a * n[2] * n[2], a * n[0] * n[1], a * n[0] * n[2], a * n[1] * n[2]])
    }

    /// Returns `M v`. Twin: `voltex_times`.
    pub fn times(&self, v: [f32; 3]) -> [f32; 3] {
        let m = &self.0;
        [
            m[0] * v[0] + m[3] * v[1] + m[4] * v[2],
            m[3] * v[0] + m[1] * v[1] + m[5] * v[2],
            m[4] * v[0] + m[5] * v[1] + m[2] * v[2],
        ]
    }

    /// Returns `u' M v`. Twin: `voltex_form`.
    pub fn form(&self, u: [f32; 3], v: [f32; 3]) -> f32 {
        dot(u, self.times(v))
    }

    /// Returns the sum of the diagonal.
    pub fn trace(&self) -> f32 {
        self.0[0] + self.0[1] + self.0[2]
    }

    /// Returns the sum of two matrices.
    pub fn plus(&self, other: &Sym3) -> Sym3 {
        Sym3(std::array::from_fn(|i| self.0[i] + other.0[i]))
    }

    /// Returns the adjugate: the inverse times the determinant. Twin: `voltex_adjugate`.
    pub fn adjugate(&self) -> Sym3 {
        let [xx, yy, zz, xy, xz, yz] = self.0;
        Sym3([
            yy * zz - yz * yz,
            xx * zz - xz * xz,
            xx * yy - xy * xy,
            xz * yz - xy * zz,
            xy * yz - xz * yy,
            xy * xz - yz * xx,
        ])
    }

    /// Multiplies all entries by a number. Twin: `voltex_scale`.
    pub fn scale(&self, s: f32) -> Sym3 {
        Sym3(self.0.map(|x| x * s))
    }

    /// Returns the eigenvalues, and an eigenvector for each, by Jacobi's rotations.
    pub fn eigen(&self) -> ([f32; 3], [[f32; 3]; 3]) {
        let m = &self.0;
        let mut a = [[m[0], m[3], m[4]], [m[3], m[1], m[5]], [m[4], m[5], m[2]]].map(|row| row.map(f64::from));
        let mut v = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0f64]];
        for _ in 0..SWEEPS {
            for (p, q) in [(0, 1), (0, 2), (1, 2)] {
                if a[p][q].abs() < 1e-30 {
                    continue;
                }
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let t = if theta == 0.0 { 1.0 } else { t };
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for k in 0..3 {
                    let (x, y) = (a[k][p], a[k][q]);
                    (a[k][p], a[k][q]) = (c * x - s * y, s * x + c * y);
                }
                for k in 0..3 {
                    let (x, y) = (a[p][k], a[q][k]);
                    (a[p][k], a[q][k]) = (c * x - s * y, s * x + c * y);
                }
                for row in &mut v {
                    let (x, y) = (row[p], row[q]);
                    (row[p], row[q]) = (c * x - s * y, s * x + c * y);
                }
            }
        }
        ([0, 1, 2].map(|i| a[i][i] as f32), [0, 1, 2].map(|i| [v[0][i] as f32, v[1][i] as f32, v[2][i] as f32]))
    }

    /// Returns the matrix with the same eigenvectors and each eigenvalue mapped by `map`.
    pub fn mapped(&self, map: impl Fn(f32) -> f32) -> Sym3 {
        let (values, vectors) = self.eigen();
        (0..3).fold(Sym3::default(), |sum, i| sum.plus(&Sym3::outer(vectors[i], map(values[i]))))
    }
}

/// Number of sweeps of Jacobi's rotations; three are enough for single precision.
const SWEEPS: usize = 8;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::vector::cross;
    use crate::testing::{Random, sphere_direction};

    #[test]
    fn a_matrix_is_what_its_eigenvectors_make() {
        let mut random = Random::new(1);
        for round in 0..1000 {
            // One, two, three or more microflakes: rank and equal values.
            let microflakes =
                (0..1 + round % 5).map(|_| Sym3::outer(sphere_direction(&mut random), random.within(0.0, 2.0)));
            let m = microflakes.fold(Sym3::default(), |sum, microflake| sum.plus(&microflake));
            let same = m.mapped(|x| x);
            let distance = |a: &Sym3| a.0.iter().zip(&m.0).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max);
            assert!(distance(&same) <= 1e-6 * m.trace(), "{m:?} {same:?}");
            assert!(distance(&m.mapped(|x| 1.001 * x)) > 1e-6 * m.trace(), "planted");
            let v = sphere_direction(&mut random);
            let (values, vectors) = m.eigen();
            let form: f32 = (0..3).map(|i| values[i] * dot(vectors[i], v).powi(2)).sum();
            assert!((form - m.form(v, v)).abs() <= 1e-6 * m.trace());
            assert!(dot(cross(v, m.times(v)), v).abs() <= 1e-6 * m.trace());
            // Its adjugate takes what it made of a vector back, times the product of the eigenvalues.
            let back = m.adjugate().times(m.times(v));
            let determinant: f32 = values.iter().product();
            assert!((0..3).all(|i| (back[i] - determinant * v[i]).abs() <= 3e-6 * m.trace().powi(3)), "{back:?}");
        }
        let diagonal = Sym3([3.0, 2.0, 1.0, 0.0, 0.0, 0.0]);
        assert_eq!(diagonal.eigen().0, [3.0, 2.0, 1.0]);
        assert_eq!(diagonal.mapped(|x| x * x).0[..3], [9.0, 4.0, 1.0]);
    }
}
