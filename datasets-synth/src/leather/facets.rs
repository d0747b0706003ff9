//! Rough dielectric surface whose facet slopes have a Student t distribution, with multiple reflection between facets.
//!
//! | parameter | symbol | unit | default | valid |
//! |---|---|---|---|---|
//! | roughness | alpha | - | - | 0.03 to 1 |
//! | tail (small = long) | gamma | - | - | 1.55 to 20 |
//! | refractive index | eta | - | - | 1.05 to 3 |
//!
//! `D = (gamma - 1)^gamma alpha^(2 gamma - 2) / (pi cos^4 th_h ((gamma - 1) alpha^2 + tan^2 th_h)^gamma)`
//! [Ribardiere 2017, eq. 11]: longer tails than GGX below gamma = 2, towards Beckmann's above.
//! Masking is Smith's with correlated heights, `G = 1 / (1 + L_i + L_o)` with
//! `L = tan th integral from cot th of (m - cot th) P(m) dm` over the slopes' marginal P
//! [Walter 2007; Heitz 2014], tabulated. `f = F(wi.h) D G / (4 cos_i cos_o)`.
//!
//! The energy that single reflection loses for perfect mirrors is added back as
//! `(1 - E_i)(1 - E_o) / (pi (1 - E_mean))` times `F_m^2 E_mean / (1 - F_m (1 - E_mean))` with the mean Fresnel
//! reflectance F_m [Kulla & Conty 2017].
//!
//! Differs from the paper in: the masking integral is taken numerically from its definition.
//!
//! When it is wrong: facets are isotropic; multiple reflection is spread evenly.

use std::f64::consts::PI;

use crate::optics::fresnel::fresnel;
use crate::surface::table::CosineTable;

/// Number of steps of the integral over the tail of the slopes.
const TAIL_STEPS: usize = 400;

/// Strata per axis of the quadrature of the albedo.
const QUADRATURE: usize = 48;

/// Rough dielectric surface with its tables.
#[derive(Debug, Clone)]
pub struct Facets {
    /// Constant (gamma - 1) alpha^2.
    spread: f32,
    tail: f32,
    /// Constant of pi D.
    factor: f32,
    /// Product of the cosine and Smith's L over the cosine: finite at grazing, where L is not.
    shadow: CosineTable,
    /// Table of `1 - E` of perfect mirrors.
    missing: CosineTable,
    /// Directional albedo of single and multiple reflection.
    albedo: CosineTable,
    mean_albedo: f32,
    /// Factor of multiple reflection: the Fresnel term over `1 - E_mean`.
    several: f32,
}

/// Part of the shading that depends on one direction.
#[derive(Debug, Clone, Copy)]
pub struct FacetDirection {
    cosine: f32,
    shadow: f32,
    missing: f32,
}

impl Facets {
    /// Returns the surface of `index`, `roughness` and `tail` with its tables. Cost: some hundredths of a second.
    pub fn new(index: f64, roughness: f64, tail: f64) -> Facets {
        let spread = (tail - 1.0) * roughness * roughness;
        let shadow = CosineTable::new(|cosine| cosine_lambda(cosine, spread, tail));
        let mut facets = Facets {
            spread: spread as f32,
            tail: tail as f32,
            factor: ((tail - 1.0) * spread.powf(tail - 1.0)) as f32,
            shadow,
            missing: CosineTable::new(|_| 0.0),
            albedo: CosineTable::new(|_| 0.0),
            mean_albedo: 0.0,
            several: 0.0,
        };
        let of_mirrors = CosineTable::new(|cosine| facets.single_albedo(cosine, |_| 1.0));
        let mean = of_mirrors.mean();
        let mean_fresnel = CosineTable::new(|cosine| fresnel(index, cosine)).mean();
        let several = mean_fresnel * mean_fresnel * mean / (1.0 - mean_fresnel * (1.0 - mean));
        facets.missing = CosineTable::new(|cosine| 1.0 - f64::from(of_mirrors.at(cosine as f32)));
        facets.albedo = CosineTable::new(|cosine| {
            facets.single_albedo(cosine, |o_dot_h| fresnel(index, o_dot_h))
                + several * f64::from(facets.missing.at(cosine as f32))
        });
        facets.mean_albedo = facets.albedo.mean() as f32;
        facets.several = (several / (1.0 - mean)) as f32;
        facets
    }

    /// Returns the part of the shading of a direction, for its positive cosine to the normal.
    #[inline]
    pub fn direction(&self, cosine: f32) -> FacetDirection {
        FacetDirection { cosine, shadow: self.shadow.at(cosine), missing: self.missing.at(cosine) }
    }

    /// Returns `pi * BRDF * cos_i` for the Fresnel reflectance at `wi.h` and the cosine `n.h`. Finite and not negative.
    #[inline]
    pub fn pi_brdf_cos(&self, fresnel: f32, cos_h: f32, i: FacetDirection, o: FacetDirection) -> f32 {
        let several = self.several * i.missing * o.missing * i.cosine;
        if cos_h <= 1e-4 {
            return several;
        }
        // G / (4 cos_i cos_o), free of divisions by small cosines.
        let geometry = 0.25 / (i.cosine * o.cosine + o.cosine * i.shadow + i.cosine * o.shadow).max(1e-9);
        fresnel * self.pi_d(cos_h) * geometry * i.cosine + several
    }

    /// Returns pi times the density of facets.
    #[inline]
    fn pi_d(&self, cos_h: f32) -> f32 {
        let cos2 = cos_h * cos_h;
        let tan2 = (1.0 - cos2).max(0.0) / cos2;
        self.factor * (self.spread + tan2).powf(-self.tail) / (cos2 * cos2)
    }

    /// Returns the share of the light from an angle of this cosine that is reflected.
    #[inline]
    pub fn albedo(&self, cosine: f32) -> f32 {
        self.albedo.at(cosine)
    }

    /// Returns the mean of [`Facets::albedo`] over the hemisphere.
    pub fn mean_albedo(&self) -> f32 {
        self.mean_albedo
    }

    /// Returns the directional albedo of single reflection with the Fresnel factor `f`, by facets drawn from their
    /// density.
    fn single_albedo(&self, cos_o: f64, f: impl Fn(f64) -> f64) -> f64 {
        let (spread, tail) = (f64::from(self.spread), f64::from(self.tail));
        let sin_o = (1.0 - cos_o * cos_o).max(0.0).sqrt();
        let out = self.direction(cos_o as f32);
        let mut sum = 0.0;
        for ring in 0..QUADRATURE {
            let share = (ring as f64 + 0.5) / QUADRATURE as f64;
            // The share of facets below tan^2 = t is 1 - (1 + t / spread)^(1 - tail).
            let tan2 = spread * ((1.0 - share).powf(1.0 / (1.0 - tail)) - 1.0);
            let cos_h = 1.0 / (1.0 + tan2).sqrt();
            let sin_h = (1.0 - cos_h * cos_h).max(0.0).sqrt();
            for step in 0..QUADRATURE {
                let phi = (step as f64 + 0.5) / QUADRATURE as f64 * PI;
                let o_dot_h = sin_o * sin_h * phi.cos() + cos_o * cos_h;
                let cos_i = 2.0 * o_dot_h * cos_h - cos_o;
                if o_dot_h <= 0.0 || cos_i <= 0.0 {
                    continue;
                }
                let shadow_i = f64::from(self.shadow.at(cos_i as f32));
                let g_over_cos_o =
                    cos_i / (cos_i * cos_o + cos_o * shadow_i + cos_i * f64::from(out.shadow)).max(1e-12);
                sum += f(o_dot_h) * g_over_cos_o * o_dot_h / cos_h;
            }
        }
        (sum / (QUADRATURE * QUADRATURE) as f64).min(1.0)
    }
}

/// Returns cos th times Smith's L: `sin th integral from cot th of (m - cot th) P(m) dm`, with the marginal
/// `P = C (1 + m^2 / spread)^(1/2 - tail)` of the slopes.
fn cosine_lambda(cosine: f64, spread: f64, tail: f64) -> f64 {
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    if sine < 1e-6 {
        return 0.0;
    }
    let (cot, scale) = (cosine / sine, spread.sqrt());
    // m = scale tan t turns P(m) dm into cos(t)^(2 tail - 3) dt.
    let integral = |from: f64| {
        let step = (PI / 2.0 - from) / TAIL_STEPS as f64;
        (0..TAIL_STEPS).map(|i| (from + (i as f64 + 0.5) * step).cos().powf(2.0 * tail - 3.0) * step).sum::<f64>()
    };
    let whole = 2.0 * integral(0.0);
    let beyond = integral((cot / scale).atan()) / whole;
    let mean_beyond = scale / whole * (1.0 + cot * cot / spread).powf(1.5 - tail) / (2.0 * tail - 3.0);
    sine * (mean_beyond - cot * beyond).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_density_of_facets_covers_the_ground_once() {
        for (roughness, tail) in [(0.2, 1.7), (0.4, 2.0), (0.1, 6.0)] {
            let facets = Facets::new(1.5, roughness, tail);
            // Even steps of ln tan.
            let mut sum = 0.0;
            let step = 0.005f64;
            for i in -2000..2000 {
                let tan = (f64::from(i) * step).exp();
                let cos = 1.0 / (1.0 + tan * tan).sqrt();
                // cos dw / pi = 2 tan cos^4 dtan.
                sum += f64::from(facets.pi_d(cos as f32)) * 2.0 * tan * cos.powi(4) * tan * step;
            }
            assert!((sum - 1.0).abs() < 5e-3, "{roughness} {tail}: {sum}");
        }
    }

    #[test]
    fn masking_at_a_tail_of_2_is_the_closed_form_and_at_other_tails_it_is_not() {
        let closed = |cosine: f64, roughness: f64| {
            let tan2 = (1.0 - cosine * cosine) / (cosine * cosine);
            cosine * 0.5 * ((1.0 + roughness * roughness * tan2).sqrt() - 1.0)
        };
        for cosine in [0.02, 0.2, 0.5, 0.9] {
            for roughness in [0.1f64, 0.4, 0.9] {
                let found = |tail: f64| cosine_lambda(cosine, (tail - 1.0) * roughness * roughness, tail);
                let expected = closed(cosine, roughness);
                assert!((found(2.0) - expected).abs() < 2e-3 * expected + 1e-6, "{cosine} {roughness}");
                assert!((found(1.6) - expected).abs() > 0.02 * expected, "a longer tail masks more");
            }
        }
    }

    #[test]
    fn a_smaller_tail_spreads_light_farther_from_the_mirror() {
        let at = |tail: f64, theta: f32| {
            let facets = Facets::new(1.5, 0.2, tail);
            facets.pi_d((0.5 * theta).to_radians().cos())
        };
        assert!(at(1.7, 100.0) > 1.5 * at(2.0, 100.0) && at(2.0, 100.0) > 5.0 * at(6.0, 100.0));
    }

    #[test]
    fn shading_is_finite_and_reciprocal_at_the_horizon() {
        let facets = Facets::new(1.5, 0.2, 1.7);
        for cos_i in [1e-6f32, 1e-3, 0.3, 1.0] {
            for cos_o in [1e-3f32, 0.3, 1.0] {
                for cos_h in [0.0f32, 0.5, 1.0] {
                    let (i, o) = (facets.direction(cos_i), facets.direction(cos_o));
                    let forward = facets.pi_brdf_cos(1.0, cos_h, i, o);
                    assert!((0.0..200.0).contains(&forward), "{forward}");
                    let backward = facets.pi_brdf_cos(1.0, cos_h, o, i);
                    assert!((forward * cos_o - backward * cos_i).abs() <= 1e-4 * forward * cos_o + 1e-9);
                }
            }
        }
    }
}
