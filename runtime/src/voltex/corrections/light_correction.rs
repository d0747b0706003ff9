//! The correction of a level's light by the directions of eye and light: what the fit of its shadows leaves.

use crate::numeric::vector::dot;

/// Number of coefficients of [`LightCorrection`].
pub const LIGHT_TERMS: usize = 26;
/// Largest coefficient.
pub const MAX_LIGHT_COEFFICIENT: f32 = 64.0;
/// Largest logarithm of the factor on a level's light.
pub const MAX_BRIGHTER: f32 = 1.5;
/// Least squared length of a direction: what is shorter has none.
pub const MIN_DIRECTION2: f32 = 1e-30;

/// The correction of a level's light: the factor on what its microflakes send to the eye is the exponential of a
/// polynomial in the directions of eye and light.
///
/// With the unit vectors o to the eye and i to the light, and `s = o_x i_x + o_y i_y`, the coefficients are those of 1,
/// s, s^2; i_z, o_z, i_z o_z; their squares; i_z s, o_z s, i_z o_z s; i_x i_y, i_x i_z, i_y i_z; the same of o; i_x, i_y,
/// i_x^2 - i_y^2; the same of o; i_z^2 o_z, i_z o_z^2. The first twelve and the last two turn with a plant about z.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LightCorrection(pub [f32; LIGHT_TERMS]);

impl LightCorrection {
    /// Returns the term that each coefficient multiplies, for unit vectors.
    pub fn terms(o: [f32; 3], i: [f32; 3]) -> [f32; LIGHT_TERMS] {
        let s = o[0] * i[0] + o[1] * i[1];
        let [a, b] = [i[2], o[2]];
        let products = |[x, y, z]: [f32; 3]| [x * y, x * z, y * z];
        let across = |[x, y, _]: [f32; 3]| [x, y, x * x - y * y];
        let groups = [
            [1.0, s, s * s],
            [a, b, a * b],
            [a * a, b * b, a * b * a * b],
            [a * s, b * s, a * b * s],
            products(i),
            products(o),
            across(i),
            across(o),
        ];
        let mut terms = [0.0; LIGHT_TERMS];
        terms[..24].copy_from_slice(groups.as_flattened());
        terms[24..].copy_from_slice(&[a * a * b, a * b * b]);
        terms
    }

    /// Returns the factor on the light that comes from `light` and goes to `eye`, vectors of texture space towards
    /// them, of any length.
    pub fn brighter(&self, eye: [f32; 3], light: [f32; 3]) -> f32 {
        let unit = |v: [f32; 3]| {
            let scale = dot(v, v).max(MIN_DIRECTION2).sqrt().recip();
            v.map(|x| x * scale)
        };
        let terms = LightCorrection::terms(unit(eye), unit(light));
        let sum: f32 = self.0.iter().zip(terms).map(|(coefficient, term)| coefficient * term).sum();
        sum.clamp(-MAX_BRIGHTER, MAX_BRIGHTER).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, sphere_direction};

    #[test]
    fn terms_are_those_of_the_text_and_fourteen_of_them_turn_about_z() {
        let mut random = Random::new(27);
        for _ in 0..1000 {
            let [o, i] = [0; 2].map(|_| sphere_direction(&mut random));
            let ([ox, oy, oz], [ix, iy, iz]) = (o, i);
            let s = ox * ix + oy * iy;
            let expected = [
                [
                    1.0,
                    s,
                    s * s,
                    iz,
                    oz,
                    iz * oz,
                    iz.powi(2),
                    oz.powi(2),
                    (iz * oz).powi(2),
                    iz * s,
                    oz * s,
                    iz * oz * s,
                ],
                [ix * iy, ix * iz, iy * iz, ox * oy, ox * oz, oy * oz, ix, iy, ix.powi(2) - iy.powi(2), ox, oy, 0.0],
            ];
            let terms = LightCorrection::terms(o, i);
            let apart = |a: f32, b: f32| (a - b).abs() < 1e-6;
            assert!(expected.as_flattened()[..23].iter().zip(terms).all(|(a, b)| apart(*a, b)), "{o:?} {i:?}");
            let last = [ox.powi(2) - oy.powi(2), iz.powi(2) * oz, iz * oz.powi(2)];
            assert!(last.iter().zip(&terms[23..]).all(|(a, b)| apart(*a, *b)), "{o:?} {i:?}");
            let (sin, cos) = random.within(0.0, 6.0).sin_cos();
            let turned = |[x, y, z]: [f32; 3]| [cos * x - sin * y, sin * x + cos * y, z];
            let of_turned = LightCorrection::terms(turned(o), turned(i));
            let turn = |k: &usize| *k < 12 || *k >= 24;
            assert!((0..LIGHT_TERMS).filter(turn).all(|k| apart(terms[k], of_turned[k])));
            // Planted: the others do not.
            let most = (12..24).map(|k| (terms[k] - of_turned[k]).abs()).fold(0.0, f32::max);
            assert!(most > 1e-6, "{most}");
        }
    }

    #[test]
    fn the_factor_is_that_of_directions_alone_within_its_limits() {
        let mut random = Random::new(28);
        let correction = LightCorrection(std::array::from_fn(|_| random.within(-0.1, 0.1)));
        for _ in 0..1000 {
            let [eye, light] = [0; 2].map(|_| sphere_direction(&mut random));
            let factor = correction.brighter(eye, light);
            let longer = correction.brighter(eye.map(|x| 9.0 * x), light.map(|x| 1e-9 * x));
            assert!((longer / factor - 1.0).abs() < 1e-4 && factor.ln().abs() < MAX_BRIGHTER);
            assert_eq!(LightCorrection::default().brighter(eye, light), 1.0);
            let most = LightCorrection([MAX_LIGHT_COEFFICIENT; LIGHT_TERMS]).brighter([1.0; 3], light.map(f32::abs));
            assert_eq!(most, MAX_BRIGHTER.exp());
        }
        // No direction: the constant alone.
        assert_eq!(correction.brighter([0.0; 3], [0.0; 3]), correction.0[0].exp());
    }
}
