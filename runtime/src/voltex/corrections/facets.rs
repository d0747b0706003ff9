//! The SGGX correction of fourth degree for the specular lobe: how the normals of a level are spread beyond what the
//! ellipsoids of its voxels represent.

use crate::numeric::vector::dot;

/// Least squared length of a half vector: opposite directions have none.
pub const MIN_HALF2: f32 = 1e-10;

/// Number of coefficients of [`Facets`]: those of an even polynomial of fourth degree on the sphere.
pub const FACETS: usize = 15;
/// Largest coefficient.
pub const MAX_FACETS: f32 = 64.0;
/// Largest logarithm of the factor on a density of facets.
pub const MAX_DENSER: f32 = 4.0;

/// The SGGX correction of fourth degree of a level: the factor on the density of facets about a direction, relative to
/// the ellipsoids of the voxels, is the exponential of a form of fourth degree.
///
/// The coefficients are those of x^4, y^4, z^4; x^2 y^2, x^2 z^2, y^2 z^2; x^2 (xy, xz, yz), y^2 (xy, xz, yz), z^2 (xy,
/// xz, yz).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Facets(pub [f32; FACETS]);

impl Facets {
    /// Returns the monomial that each coefficient multiplies, for a unit vector.
    pub fn terms([x, y, z]: [f32; 3]) -> [f32; FACETS] {
        let ([a, b, c], [xy, xz, yz]) = ([x * x, y * y, z * z], [x * y, x * z, y * z]);
        let of_square = |s: f32| [s * xy, s * xz, s * yz];
        let ([d, e, f], [g, h, i], [j, k, l]) = (of_square(a), of_square(b), of_square(c));
        [a * a, b * b, c * c, a * b, a * c, b * c, d, e, f, g, h, i, j, k, l]
    }

    /// Returns the factor on the density of facets along `half`, of any length.
    pub fn denser(&self, half: [f32; 3]) -> f32 {
        let scale = dot(half, half).max(MIN_HALF2).sqrt().recip();
        let terms = Facets::terms(half.map(|x| x * scale));
        let form: f32 = self.0.iter().zip(terms).map(|(coefficient, term)| coefficient * term).sum();
        form.clamp(-MAX_DENSER, MAX_DENSER).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, sphere_direction};

    #[test]
    fn a_form_of_fourth_degree_is_even_and_tells_directions_apart_that_ellipsoids_do_not() {
        let mut random = Random::new(24);
        let facets = Facets(std::array::from_fn(|_| random.within(-1.0, 1.0)));
        let by_powers = |[x, y, z]: [f32; 3]| {
            let powers = [
                [4, 0, 0],
                [0, 4, 0],
                [0, 0, 4],
                [2, 2, 0],
                [2, 0, 2],
                [0, 2, 2],
                [3, 1, 0],
                [3, 0, 1],
                [2, 1, 1],
                [1, 3, 0],
                [1, 2, 1],
                [0, 3, 1],
                [1, 1, 2],
                [1, 0, 3],
                [0, 1, 3],
            ];
            powers.map(|[i, j, k]| x.powi(i) * y.powi(j) * z.powi(k))
        };
        for _ in 0..1000 {
            let h = sphere_direction(&mut random);
            let apart = Facets::terms(h).iter().zip(by_powers(h)).map(|(a, b)| (a - b).abs()).fold(0f32, f32::max);
            assert!(apart < 1e-6, "{h:?}");
            let along = facets.denser(h);
            let longer = facets.denser(h.map(|x| -3.0 * x));
            assert!((longer / along - 1.0).abs() < 1e-5 && along.ln().abs() < 4.0);
        }
        // All terms that squares make: one everywhere.
        let even = Facets([1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert!((even.denser([0.3, -0.5, 0.8]) - 1f32.exp()).abs() < 1e-5);
        // As far as the axes go a sphere, and less dense between them.
        let axes = Facets([1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert!(
            axes.denser([0.0, 1.0, 0.0]) == axes.denser([0.0, 0.0, 2.0]) && axes.denser([1.0; 3]) < 0.6 * 1f32.exp()
        );
        assert_eq!(Facets([MAX_FACETS; FACETS]).denser([1.0; 3]), MAX_DENSER.exp());
        assert_eq!(Facets::default().denser([0.0; 3]), 1.0);
    }
}
