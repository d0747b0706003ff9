//! Gloss: Cook-Torrance with Beckmann facets, corrected, and its coupling to what lies below.
//!
//! | parameter | unit | default | valid |
//! |---|---|---|---|
//! | index | - | 1.42 | 1.01 to 3 |
//! | roughness gamma (rms slope) | - | 0.3 | 0.05 to 1 |
//!
//! `f_s = F(v.h) D(h) G / (4 cos_i cos_o)` with `D = exp(-(tan th_h / gamma)^2) / (pi gamma^2
//! cos^4 th_h)` and the V-cavity `G = min(1, 2 (n.h)(n.v)/(v.h), 2 (n.h)(n.l)/(v.h))`
//! [Cook & Torrance 1982; Miao, eq. 7].
//!
//! Differs from the papers in: the factor 1/4 instead of 1 (the printed lobe is four times too
//! bright), Fresnel at `v.h` instead of `n.h`, and G's denominator `v.h`.
//!
//! When it is wrong: single scattering only, so a rough lobe loses some energy; facets are
//! isotropic, while a leaf's run along its veins; the index is one number, so the gloss is white.

use std::f64::consts::PI;

use crate::optics::fresnel::fresnel;

/// Smallest roughness: a narrower lobe falls between the directions of every known sampling.
pub const MIN_ROUGHNESS: f64 = 0.05;

/// Refractive index of a leaf's cuticle, for the gloss [Miao, text after eq. 6].
pub const CUTICLE_INDEX: f64 = 1.42;

/// Entries of the table of directional albedo, even in the root of the cosine: dense towards
/// grazing, where the albedo rises.
const ALBEDO_ENTRIES: usize = 257;

/// Strata per axis of the quadrature of one entry.
const QUADRATURE: usize = 96;

/// A gloss lobe with its directional albedo tabulated.
#[derive(Debug, Clone)]
pub struct CookTorrance {
    index: f64,
    roughness: f64,
    inverse_roughness_squared: f32,
    /// Directional albedo over the root of the cosine.
    albedo: Vec<f32>,
    mean_albedo: f32,
}

/// Cosines of one light and one view against a surface normal.
#[derive(Debug, Clone, Copy)]
pub struct LobeAngles {
    /// n.wi, positive.
    pub cos_i: f32,
    /// n.wo, positive.
    pub cos_o: f32,
    /// n.h for the half vector h of wi and wo.
    pub cos_h: f32,
    /// wo.h, positive.
    pub o_dot_h: f32,
}

impl CookTorrance {
    /// The lobe of refractive index `index` and `roughness`, raised to [`MIN_ROUGHNESS`]. Takes
    /// some tens of milliseconds for the table.
    pub fn new(index: f64, roughness: f64) -> CookTorrance {
        let roughness = roughness.max(MIN_ROUGHNESS);
        let entry = |i: usize| {
            let root = i as f64 / (ALBEDO_ENTRIES - 1) as f64;
            // The first entry is the limit towards 90 degrees.
            directional_albedo(index, roughness, (root * root).max(1e-6))
        };
        let albedo: Vec<f32> = (0..ALBEDO_ENTRIES).map(|i| entry(i).min(1.0) as f32).collect();
        let mut lobe = CookTorrance {
            index,
            roughness,
            inverse_roughness_squared: (1.0 / (roughness * roughness)) as f32,
            albedo,
            mean_albedo: 0.0,
        };
        // Mean over the hemisphere with the cosine's weight: even steps of sin^2.
        let count = 4096;
        let mean: f64 = (0..count)
            .map(|i| f64::from(lobe.albedo((1.0 - (f64::from(i) + 0.5) / f64::from(count)).sqrt() as f32)))
            .sum::<f64>()
            / f64::from(count);
        lobe.mean_albedo = mean as f32;
        lobe
    }

    /// Roughness after the floor.
    pub fn roughness(&self) -> f64 {
        self.roughness
    }

    /// Fresnel reflectance at the cosine `wo.h`.
    pub fn fresnel(&self, o_dot_h: f32) -> f32 {
        fresnel(self.index, f64::from(o_dot_h)) as f32
    }

    /// `pi * f_s * cos_i`, for the Fresnel reflectance `fresnel` at `angles.o_dot_h` (constant over
    /// a surface under parallel light and view, so the caller takes it once). 0 where a cosine is
    /// not positive; finite everywhere.
    #[inline]
    pub fn pi_brdf_cos(&self, fresnel: f32, angles: LobeAngles) -> f32 {
        let LobeAngles { cos_i, cos_o, cos_h, o_dot_h } = angles;
        if cos_i <= 0.0 || cos_o <= 0.0 || cos_h <= 0.0 || o_dot_h <= 0.0 {
            return 0.0;
        }
        let cos2_h = cos_h * cos_h;
        let tan2_h = (1.0 - cos2_h).max(0.0) / cos2_h;
        let pi_d =
            (-tan2_h * self.inverse_roughness_squared).exp() * self.inverse_roughness_squared / (cos2_h * cos2_h);
        // G / cos_o with the minimum taken before the division, so that grazing views stay finite.
        let shading = 2.0 * cos_h / o_dot_h;
        let g_over_cos_o = (1.0f32.min(shading * cos_i) / cos_o).min(shading);
        0.25 * fresnel * pi_d * g_over_cos_o
    }

    /// Directional albedo: the share of light from (or towards) an angle of this cosine that the
    /// lobe reflects.
    #[inline]
    pub fn albedo(&self, cosine: f32) -> f32 {
        let position = cosine.clamp(0.0, 1.0).sqrt() * (ALBEDO_ENTRIES - 1) as f32;
        let cell = (position as usize).min(ALBEDO_ENTRIES - 2);
        let t = position - cell as f32;
        self.albedo[cell] * (1.0 - t) + self.albedo[cell + 1] * t
    }

    /// Mean of [`CookTorrance::albedo`] over the hemisphere, with the cosine's weight.
    pub fn mean_albedo(&self) -> f32 {
        self.mean_albedo
    }

    /// Factor on a Lambertian body of albedo `a` below a gloss layer of strength `gloss` (0 to 1):
    /// `pi f_d = a * (1 - g E(i)) (1 - g E(o)) / (1 - g E_mean)`. Reciprocal, and together with the
    /// gloss it reflects `g E(i) + a (1 - g E(i))`, never more than what came in
    /// [after Kelemen & Szirmay-Kalos 2001].
    #[inline]
    pub fn coupling(&self, gloss: f32, albedo_i: f32, albedo_o: f32) -> f32 {
        (1.0 - gloss * albedo_i) * (1.0 - gloss * albedo_o) / (1.0 - gloss * self.mean_albedo)
    }
}

/// Directional albedo by a stratified midpoint rule over facets drawn from `D cos th_h`: the mean
/// of `F G (v.h) / (cos_v cos_h)` over facets that reflect above the surface.
fn directional_albedo(index: f64, roughness: f64, cos_v: f64) -> f64 {
    let sin_v = (1.0 - cos_v * cos_v).max(0.0).sqrt();
    let mut sum = 0.0;
    for i in 0..QUADRATURE {
        let u = (i as f64 + 0.5) / QUADRATURE as f64;
        let tan_h = roughness * (-u.ln()).sqrt();
        let cos_h = 1.0 / (1.0 + tan_h * tan_h).sqrt();
        let sin_h = tan_h * cos_h;
        for j in 0..QUADRATURE {
            // Symmetric about the plane of incidence, so half a turn does.
            let phi = PI * (j as f64 + 0.5) / QUADRATURE as f64;
            let v_dot_h = sin_v * sin_h * phi.cos() + cos_v * cos_h;
            if v_dot_h <= 0.0 {
                continue;
            }
            let cos_l = 2.0 * v_dot_h * cos_h - cos_v;
            if cos_l <= 0.0 {
                continue;
            }
            let g = 1f64.min(2.0 * cos_h * cos_v / v_dot_h).min(2.0 * cos_h * cos_l / v_dot_h);
            sum += fresnel(index, v_dot_h) * g * v_dot_h / (cos_v * cos_h);
        }
    }
    sum / (QUADRATURE * QUADRATURE) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn direction(theta_deg: f64, phi_deg: f64) -> [f64; 3] {
        let (s, c) = theta_deg.to_radians().sin_cos();
        let (sp, cp) = phi_deg.to_radians().sin_cos();
        [s * cp, s * sp, c]
    }

    fn angles(wi: [f64; 3], wo: [f64; 3]) -> LobeAngles {
        let sum: [f64; 3] = std::array::from_fn(|k| wi[k] + wo[k]);
        let length = sum.iter().map(|c| c * c).sum::<f64>().sqrt();
        let o_dot_h: f64 = (0..3).map(|k| wo[k] * sum[k] / length).sum();
        LobeAngles {
            cos_i: wi[2] as f32,
            cos_o: wo[2] as f32,
            cos_h: (sum[2] / length) as f32,
            o_dot_h: o_dot_h as f32,
        }
    }

    fn pi_brdf_cos(lobe: &CookTorrance, wi: [f64; 3], wo: [f64; 3]) -> f64 {
        let angles = angles(wi, wo);
        f64::from(lobe.pi_brdf_cos(lobe.fresnel(angles.o_dot_h), angles))
    }

    /// Directional albedo at 0, 60, 80, 89 degrees of the corrected lobe of index 1.42, computed
    /// independently of this code.
    #[test]
    fn directional_albedo_agrees_with_independent_figures() {
        const EXPECTED: [(f64, [f64; 4]); 5] = [
            (0.05, [0.030, 0.076, 0.359, 0.746]),
            (0.1, [0.030, 0.077, 0.306, 0.658]),
            (0.3, [0.030, 0.065, 0.197, 0.434]),
            (0.5, [0.028, 0.053, 0.152, 0.328]),
            (1.0, [0.014, 0.037, 0.102, 0.219]),
        ];
        for (roughness, row) in EXPECTED {
            let lobe = CookTorrance::new(1.42, roughness);
            for (theta, expected) in [0.0f64, 60.0, 80.0, 89.0].into_iter().zip(row) {
                let albedo = f64::from(lobe.albedo(theta.to_radians().cos() as f32));
                assert!((albedo - expected).abs() < 1e-2, "gamma {roughness} at {theta}: {albedo}");
                // Planted difference: the printed lobe, four times brighter.
                assert!((4.0 * albedo - expected).abs() > 1e-2);
            }
        }
    }

    #[test]
    fn the_table_is_the_integral_of_the_lobe_itself() {
        // Plain midpoint rule over the outgoing hemisphere: another route than the table's.
        for roughness in [0.2, 0.5] {
            let lobe = CookTorrance::new(1.42, roughness);
            for theta in [10.0, 45.0, 70.0] {
                let (wi, steps) = (direction(theta, 0.0), 500);
                let mut sum = 0.0;
                for i in 0..steps {
                    let cos_o: f64 = (f64::from(i) + 0.5) / f64::from(steps);
                    let theta_o = cos_o.acos().to_degrees();
                    for j in 0..steps {
                        let wo = direction(theta_o, 360.0 * (f64::from(j) + 0.5) / f64::from(steps));
                        sum += pi_brdf_cos(&lobe, wi, wo) / PI / wi[2] * wo[2];
                    }
                }
                let integral = sum * 2.0 * PI / f64::from(steps * steps);
                let table = f64::from(lobe.albedo(wi[2] as f32));
                assert!((integral - table).abs() < 2e-3, "{roughness} {theta}: {integral} {table}");
            }
        }
    }

    #[test]
    fn a_white_furnace_gains_nothing() {
        // Facets that reflect everything: an index so high that Fresnel is nearly 1.
        for roughness in [0.05, 0.1, 0.3, 0.5, 1.0] {
            for theta in [0.0, 30.0, 60.0, 80.0, 89.0, 89.9] {
                let albedo = directional_albedo(1e6, roughness, f64::cos(f64::to_radians(theta)));
                assert!(albedo <= 1.0 + 1e-3, "{roughness} {theta}: {albedo}");
            }
        }
    }

    #[test]
    fn gloss_over_a_white_body_never_reflects_more_than_it_gets() {
        for roughness in [0.05, 0.3, 1.0] {
            let lobe = CookTorrance::new(1.42, roughness);
            for gloss in [0.0f32, 0.5, 1.0] {
                for theta in [0.0f64, 45.0, 75.0, 89.0, 89.9] {
                    let cos_i = theta.to_radians().cos() as f32;
                    let steps = 2000;
                    let body: f32 = (0..steps)
                        .map(|i| (1.0 - (i as f32 + 0.5) / steps as f32).sqrt())
                        .map(|cos_o| lobe.coupling(gloss, lobe.albedo(cos_i), lobe.albedo(cos_o)))
                        .sum::<f32>()
                        / steps as f32;
                    let total = body + gloss * lobe.albedo(cos_i);
                    assert!((total - 1.0).abs() < 1e-3, "{roughness} {gloss} {theta}: {total}");
                }
            }
        }
    }

    #[test]
    fn swapping_light_and_view_changes_nothing() {
        let lobe = CookTorrance::new(1.42, 0.3);
        for (a, b) in [((10.0, 0.0), (70.0, 200.0)), ((45.0, 20.0), (60.0, 190.0)), ((85.0, 0.0), (5.0, 90.0))] {
            let (a, b) = (direction(a.0, a.1), direction(b.0, b.1));
            let forward = pi_brdf_cos(&lobe, a, b) / a[2];
            let backward = pi_brdf_cos(&lobe, b, a) / b[2];
            assert!((forward - backward).abs() <= 1e-5 * forward.abs() + 1e-9, "{forward} {backward}");
        }
        let (i, o) = (0.2, 0.6);
        assert_eq!(lobe.coupling(0.7, i, o), lobe.coupling(0.7, o, i));
    }

    #[test]
    fn the_lobe_is_finite_at_the_horizon_and_dark_below_it() {
        let lobe = CookTorrance::new(1.42, 1e-4);
        assert_eq!(lobe.roughness(), MIN_ROUGHNESS);
        for cos_i in [1e-6f32, 1e-3, 1.0] {
            for cos_o in [1e-6f32, 1e-3, 1.0] {
                for o_dot_h in [1e-6f32, 0.5, 1.0] {
                    let value = lobe.pi_brdf_cos(1.0, LobeAngles { cos_i, cos_o, cos_h: 1.0, o_dot_h });
                    assert!(value.is_finite() && value >= 0.0);
                }
            }
        }
        let below = LobeAngles { cos_i: -0.1, cos_o: 0.5, cos_h: 0.9, o_dot_h: 0.5 };
        assert_eq!(lobe.pi_brdf_cos(1.0, below), 0.0);
    }
}
