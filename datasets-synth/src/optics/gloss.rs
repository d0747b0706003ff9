//! Gloss: Cook-Torrance with Beckmann facets, corrected, and its coupling to what lies below. Parameters: [`GlossParams`].
//!
//! `f_s = F(v.h) D(h) G / (4 cos_i cos_o)` with the facets' distribution
//! `D = exp(-((h_along / gamma_along)^2 + (h_across / gamma_across)^2) / (n.h)^2) / (pi gamma_along gamma_across
//! (n.h)^4)`, which is `exp(-(tan th_h / gamma)^2) / (pi gamma^2 cos^4 th_h)` where both are equal, and the
//! V-cavity `G = min(1, 2 (n.h)(n.v)/(v.h), 2 (n.h)(n.l)/(v.h))` [Cook & Torrance 1982; Miao, eq. 7; two
//! roughnesses: Ward 1992, for leaves Comar 2014]. A groove takes its facets in pairs, whatever way it runs, so
//! the same G holds for two roughnesses.
//!
//! Differs from the papers in, as [`GlossForm`] says: Miao's eq. 7 lacks the factor 1/4 of this D (the printed
//! lobe is four times too bright), takes Fresnel at `n.h` instead of `v.h`, and prints the half angle itself as
//! G's denominator instead of `v.h`. Its body term holds the Lambertian reflection of the surface already, so
//! adding the lobe counts the surface twice: here the body is what has entered, and light that the lobe
//! reflects does not enter ([`CookTorrance::coupling`]). What it calls V_g in one place and V_B in another is
//! one factor, `gloss` here.
//!
//! When it is wrong: single scattering only, so a rough lobe loses some energy; the index is one number, so
//! the gloss is white; V-cavities mask more abruptly than Smith's surfaces (the same to 1e-3 up to 45 degrees,
//! 8 to 40 % brighter at mirror angles of 75 degrees with a roughness of 0.3 to 0.5).

use std::f64::consts::PI;

use rayon::prelude::*;

use crate::optics::fresnel::fresnel;
use crate::optics::gloss_params::{GlossCoupling, GlossForm, GlossParams};

/// Entries of the table of directional albedo, even in the root of the cosine: dense towards
/// grazing, where the albedo rises.
const ALBEDO_ENTRIES: usize = 257;

/// The same for two roughnesses, where every entry is a row.
const ALONG_ENTRIES: usize = 129;

/// Entries of a row, even in the roughness that the plane of incidence cuts ([`CookTorrance::cut`]), from the
/// smaller to the larger: what the albedo at one cosine depends on.
const CUT_ENTRIES: usize = 17;

/// Strata per axis of the quadrature of one entry.
const QUADRATURE: usize = 96;

/// Least n.h: facets this steep have density 0 in single precision, and below it its fourth power is lost.
const MIN_COS_H: f32 = 1e-4;

/// Least v.h: for v = -l there is no half vector.
const MIN_O_DOT_H: f32 = 1e-6;

/// Exponents below this count as no lobe: the sample is below 1e-31, and the way there is through denormal
/// numbers, which are slow.
const MIN_EXPONENT: f32 = -80.0;

impl GlossParams {
    /// Directional albedo of the lobe as asked for, `printed` above 1 and all: the share of light from (or
    /// towards) the angle of cosine `cosine` (0 to 1), at `azimuth_rad` from the vein direction, that it
    /// reflects. Costs 0.1 to 0.5 ms.
    pub fn directional_albedo(&self, cosine: f64, azimuth_rad: f64) -> f64 {
        let squared = azimuth_rad.cos().powi(2);
        self.form.gain() * lobe_albedo(self, self.form, cosine.clamp(1e-6, 1.0), squared)
    }
}

/// A gloss lobe with its directional albedo tabulated.
#[derive(Debug, Clone)]
pub struct CookTorrance {
    params: GlossParams,
    /// 1/4 of the corrected lobe, times what the form multiplies it with.
    scale: f32,
    /// 1 where coupled, 0 where not.
    coupled: f32,
    /// Of the one roughness, or of the one with the mean slope variance.
    inverse_roughness_squared: f32,
    /// 1 / gamma_along^2, 1 / gamma_across^2, 1 / (gamma_along gamma_across).
    inverse_along: f32,
    inverse_across: f32,
    inverse_product: f32,
    /// Directional albedo of the corrected form over the root of the cosine; with two roughnesses, its mean
    /// over the azimuth.
    albedo: Vec<f32>,
    /// With two roughnesses, `[root of the cosine, roughness cut by the plane of incidence]`.
    albedo_along: Option<Vec<[f32; CUT_ENTRIES]>>,
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
    /// The corrected, coupled lobe of refractive index `index` and one `roughness`, raised to
    /// [`MIN_ROUGHNESS`](crate::MIN_ROUGHNESS). Takes some tens of milliseconds for the table.
    pub fn new(index: f64, roughness: f64) -> CookTorrance {
        CookTorrance::from_params(&GlossParams::isotropic(index, roughness))
    }

    /// The lobe of `params`, with roughness below [`MIN_ROUGHNESS`](crate::MIN_ROUGHNESS) raised to it;
    /// [`GlossParams::check`] is the caller's. Takes some tens of milliseconds for the table, with two roughnesses some hundreds over the
    /// threads of the current pool.
    pub fn from_params(params: &GlossParams) -> CookTorrance {
        let [along, across] = params.gammas();
        let params = GlossParams { gamma_along: along, gamma_across: across, ..*params };
        let squared = if along == across { along * along } else { 0.5 * (along * along + across * across) };
        let mut lobe = CookTorrance {
            params,
            scale: (0.25 * params.form.gain()) as f32,
            coupled: if params.coupling == GlossCoupling::Energy { 1.0 } else { 0.0 },
            inverse_roughness_squared: (1.0 / squared) as f32,
            inverse_along: (1.0 / (along * along)) as f32,
            inverse_across: (1.0 / (across * across)) as f32,
            inverse_product: (1.0 / (along * across)) as f32,
            albedo: Vec::new(),
            albedo_along: None,
            mean_albedo: 0.0,
        };
        lobe.tabulate();
        lobe
    }

    /// Fills the tables of directional albedo. They are the corrected form's under every form, because the
    /// coupling needs a share below 1.
    fn tabulate(&mut self) {
        let params = self.params;
        let entry = |i: usize, entries: usize, azimuth_cos_squared: f64| {
            let root = i as f64 / (entries - 1) as f64;
            // The first entry is the limit towards 90 degrees.
            let albedo = lobe_albedo(&params, GlossForm::Corrected, (root * root).max(1e-6), azimuth_cos_squared);
            albedo.min(1.0) as f32
        };
        if self.is_anisotropic() {
            // Squared cosine of the azimuth whose plane cuts each roughness of a row.
            let [a, c] = params.gammas();
            let azimuth_cos_squared: [f64; CUT_ENTRIES] = std::array::from_fn(|j| {
                let cut = a.min(c) + (a - c).abs() * j as f64 / (CUT_ENTRIES - 1) as f64;
                ((cut * cut - c * c) / (a * a - c * c)).clamp(0.0, 1.0)
            });
            let rows: Vec<[f32; CUT_ENTRIES]> = (0..ALONG_ENTRIES)
                .into_par_iter()
                .map(|i| std::array::from_fn(|j| entry(i, ALONG_ENTRIES, azimuth_cos_squared[j])))
                .collect();
            self.albedo_along = Some(rows);
            let turns = 64;
            self.albedo = (0..ALBEDO_ENTRIES)
                .map(|i| {
                    let cosine = (i as f32 / (ALBEDO_ENTRIES - 1) as f32).powi(2);
                    let at = |turn: usize| {
                        let (s, c) = (PI / 2.0 * (turn as f64 + 0.5) / turns as f64).sin_cos();
                        f64::from(self.albedo_along(cosine, [c as f32, s as f32]))
                    };
                    ((0..turns).map(at).sum::<f64>() / turns as f64) as f32
                })
                .collect();
        } else {
            self.albedo = (0..ALBEDO_ENTRIES).map(|i| entry(i, ALBEDO_ENTRIES, 1.0)).collect();
        }
        // Mean over the hemisphere with the cosine's weight: even steps of sin^2.
        let count = 4096;
        let mean: f64 = (0..count)
            .map(|i| f64::from(self.albedo((1.0 - (f64::from(i) + 0.5) / f64::from(count)).sqrt() as f32)))
            .sum::<f64>()
            / f64::from(count);
        self.mean_albedo = mean as f32;
    }

    /// What was asked for, with the roughness after the floor.
    pub fn params(&self) -> &GlossParams {
        &self.params
    }

    /// Roughness after the floor; with two, the one along the vein direction.
    pub fn roughness(&self) -> f64 {
        self.params.gamma_along
    }

    /// Whether the roughness along and across the vein direction differ, so that the functions with `_along`
    /// are needed.
    pub fn is_anisotropic(&self) -> bool {
        self.params.gamma_along != self.params.gamma_across
    }

    /// Fresnel reflectance at the cosine `wo.h`.
    pub fn fresnel(&self, o_dot_h: f32) -> f32 {
        fresnel(self.params.index, f64::from(o_dot_h)) as f32
    }

    /// `pi * f_s * cos_i`, for the Fresnel reflectance `fresnel` at `angles.o_dot_h` (constant over
    /// a surface under parallel light and view, so the caller takes it once; `printed` does not use it). 0 where
    /// a cosine is not positive or not a number; finite everywhere.
    ///
    /// Of a lobe with two roughnesses, this is the stand-in of one roughness with the same mean slope variance,
    /// for a surface whose vein direction is not known.
    #[inline]
    pub fn pi_brdf_cos(&self, fresnel: f32, angles: LobeAngles) -> f32 {
        let slope2_over_gamma2 = |cos2_h: f32| (1.0 - cos2_h).max(0.0) / cos2_h * self.inverse_roughness_squared;
        self.facets_seen(fresnel, angles, self.inverse_roughness_squared, slope2_over_gamma2)
    }

    /// [`CookTorrance::pi_brdf_cos`] where the vein direction is known: `half_tangent` holds h's components
    /// along and across it, both in the tangent plane ([`vein_frame`]).
    #[inline]
    pub fn pi_brdf_cos_along(&self, fresnel: f32, angles: LobeAngles, half_tangent: [f32; 2]) -> f32 {
        let [along, across] = half_tangent;
        let weighted = along * along * self.inverse_along + across * across * self.inverse_across;
        self.facets_seen(fresnel, angles, self.inverse_product, |cos2_h| weighted / cos2_h)
    }

    /// The lobe of facets of density `exp(-slope2_over_gamma2(cos_h^2)) * inverse_product / (pi cos_h^4)`.
    #[inline]
    fn facets_seen(
        &self,
        fresnel: f32,
        angles: LobeAngles,
        inverse_product: f32,
        slope2_over_gamma2: impl Fn(f32) -> f32,
    ) -> f32 {
        let LobeAngles { cos_i, cos_o, cos_h, o_dot_h } = angles;
        // One condition over all of them, so that a NaN in any is dark, too.
        let lit = cos_i > 0.0 && cos_o > 0.0 && cos_h > MIN_COS_H && o_dot_h > MIN_O_DOT_H;
        if !lit {
            return 0.0;
        }
        let cos2_h = cos_h * cos_h;
        let exponent = -slope2_over_gamma2(cos2_h);
        // A NaN tangent falls through to here and is dark, too.
        let seen = exponent > MIN_EXPONENT;
        if !seen {
            return 0.0;
        }
        let pi_d = exponent.exp() * inverse_product / (cos2_h * cos2_h);
        if self.params.form == GlossForm::Printed {
            return self.printed(angles, pi_d);
        }
        // G / cos_o with the minimum taken before the division, so that grazing views stay finite.
        let shading = 2.0 * cos_h / o_dot_h;
        let g_over_cos_o = (1.0f32.min(shading * cos_i) / cos_o).min(shading);
        self.scale * fresnel * pi_d * g_over_cos_o
    }

    /// Eq. 7 to the letter.
    #[cold]
    fn printed(&self, angles: LobeAngles, pi_d: f32) -> f32 {
        let LobeAngles { cos_i, cos_o, cos_h, .. } = angles;
        let g = printed_masking(f64::from(cos_i), f64::from(cos_o), f64::from(cos_h)) as f32;
        self.scale * self.fresnel(cos_h) * pi_d * g / cos_o.max(MIN_O_DOT_H)
    }

    /// Directional albedo of the corrected form: the share of light from (or towards) an angle of this cosine
    /// that the lobe reflects; with two roughnesses, the mean over the azimuth.
    #[inline]
    pub fn albedo(&self, cosine: f32) -> f32 {
        let position = cosine.clamp(0.0, 1.0).sqrt() * (ALBEDO_ENTRIES - 1) as f32;
        let cell = (position as usize).min(ALBEDO_ENTRIES - 2);
        let t = position - cell as f32;
        self.albedo[cell] * (1.0 - t) + self.albedo[cell + 1] * t
    }

    /// [`CookTorrance::albedo`] where the vein direction is known: `tangent` holds the components along and
    /// across it of the way to the light or eye; only their ratio counts.
    #[inline]
    pub fn albedo_along(&self, cosine: f32, tangent: [f32; 2]) -> f32 {
        let Some(rows) = &self.albedo_along else {
            return self.albedo(cosine);
        };
        let position = self.cut(tangent) * (CUT_ENTRIES - 1) as f32;
        let column = (position as usize).min(CUT_ENTRIES - 2);
        let s = position - column as f32;
        let position = cosine.clamp(0.0, 1.0).sqrt() * (ALONG_ENTRIES - 1) as f32;
        let cell = (position as usize).min(ALONG_ENTRIES - 2);
        let t = position - cell as f32;
        let row = |i: usize| rows[i][column] * (1.0 - s) + rows[i][column + 1] * s;
        row(cell) * (1.0 - t) + row(cell + 1) * t
    }

    /// Roughness that a vertical plane through `tangent` cuts, whose square is the mean of both squares with the
    /// squared direction cosines as weights: 0 for the smaller roughness, 1 for the larger.
    #[inline]
    fn cut(&self, tangent: [f32; 2]) -> f32 {
        let [a, c] = self.params.gammas().map(|gamma| gamma as f32);
        let [along2, across2] = tangent.map(|c| c * c);
        let length2 = along2 + across2;
        // Along the normal any azimuth is right.
        let share = if length2 > 0.0 { along2 / length2 } else { 0.5 };
        let cut = (c * c + (a * a - c * c) * share).max(0.0).sqrt();
        ((cut - a.min(c)) / (a - c).abs()).clamp(0.0, 1.0)
    }

    /// Mean of [`CookTorrance::albedo`] over the hemisphere, with the cosine's weight.
    pub fn mean_albedo(&self) -> f32 {
        self.mean_albedo
    }

    /// Share of the light from one direction that enters the body below a gloss of strength `gloss` (0 to 1)
    /// and directional albedo `albedo_i`; 1 where not coupled.
    #[inline]
    pub fn lets_in(&self, gloss: f32, albedo_i: f32) -> f32 {
        1.0 - self.coupled * gloss * albedo_i
    }

    /// Factor on a Lambertian body of albedo `a` below a gloss layer of strength `gloss` (0 to 1):
    /// `pi f_d = a * (1 - g E(i)) (1 - g E(o)) / (1 - g E_mean)`. Reciprocal, and together with the
    /// gloss it reflects `g E(i) + a (1 - g E(i))`, never more than what came in
    /// [after Kelemen & Szirmay-Kalos 2001]. 1 where not coupled.
    #[inline]
    pub fn coupling(&self, gloss: f32, albedo_i: f32, albedo_o: f32) -> f32 {
        self.lets_in(gloss, albedo_i) * self.lets_in(gloss, albedo_o) / (1.0 - self.coupled * gloss * self.mean_albedo)
    }
}

/// Unit vectors along and across the vein in the tangent plane of the unit `normal`, for a vein that runs along
/// `vein` (any length, either sense) seen from above: the components that [`CookTorrance::pi_brdf_cos_along`] and
/// [`CookTorrance::albedo_along`] want are dot products with them. No vein, `[0, 0]`, is taken as along x.
///
/// The normal's z must be positive.
#[inline]
pub fn vein_frame(normal: [f32; 3], vein: [f32; 2]) -> [[f32; 3]; 2] {
    let length = (vein[0] * vein[0] + vein[1] * vein[1]).sqrt();
    let [x, y] = if length > 0.0 { vein.map(|c| c / length) } else { [1.0, 0.0] };
    // On the surface above the vein's image: rises with the slope.
    let z = -(normal[0] * x + normal[1] * y) / normal[2].max(MIN_COS_H);
    let scale = 1.0 / (1.0 + z * z).sqrt();
    let along = [x * scale, y * scale, z * scale];
    let across = [
        normal[1] * along[2] - normal[2] * along[1],
        normal[2] * along[0] - normal[0] * along[2],
        normal[0] * along[1] - normal[1] * along[0],
    ];
    [along, across]
}

/// G of Miao's eq. 7 to the letter, with the half angle in radians below the line.
fn printed_masking(cos_i: f64, cos_o: f64, cos_h: f64) -> f64 {
    let theta_h = cos_h.clamp(0.0, 1.0).acos();
    if theta_h == 0.0 {
        return 1.0;
    }
    1f64.min(2.0 * cos_h * cos_o / theta_h).min(2.0 * cos_h * cos_i / theta_h)
}

/// Directional albedo of a form without its gain, by a stratified midpoint rule over facets drawn from
/// `D cos th_h`: the mean of `F G (v.h) / (cos_v cos_h)` over facets that reflect above the surface.
fn lobe_albedo(params: &GlossParams, form: GlossForm, cos_v: f64, azimuth_cos_squared: f64) -> f64 {
    let [along, across] = params.gammas();
    let sin_v = (1.0 - cos_v * cos_v).max(0.0).sqrt();
    let (cos_azimuth, sin_azimuth) = (azimuth_cos_squared.sqrt(), (1.0 - azimuth_cos_squared).max(0.0).sqrt());
    // One roughness is symmetric about the plane of incidence, so half a turn does.
    let strata = if along == across { QUADRATURE } else { 2 * QUADRATURE };
    let turn = if along == across { PI } else { 2.0 * PI };
    // Of each stratum of the facets' azimuth: their slope over sqrt(-ln u), and the part of it in the plane of
    // incidence.
    let slopes: Vec<(f64, f64)> = (0..strata)
        .map(|j| {
            let phi = turn * (j as f64 + 0.5) / strata as f64;
            if along == across {
                return (along, phi.cos());
            }
            let (x, y) = (along * phi.cos(), across * phi.sin());
            let slope = (x * x + y * y).sqrt();
            (slope, (x * cos_azimuth + y * sin_azimuth) / slope)
        })
        .collect();
    let mut sum = 0.0;
    for i in 0..QUADRATURE {
        let u = (i as f64 + 0.5) / QUADRATURE as f64;
        let radius = (-u.ln()).sqrt();
        for &(slope, in_plane) in &slopes {
            let tan_h = slope * radius;
            let cos_h = 1.0 / (1.0 + tan_h * tan_h).sqrt();
            let sin_h = tan_h * cos_h;
            let v_dot_h = sin_v * sin_h * in_plane + cos_v * cos_h;
            if v_dot_h <= 0.0 {
                continue;
            }
            let cos_l = 2.0 * v_dot_h * cos_h - cos_v;
            if cos_l <= 0.0 {
                continue;
            }
            let (f, g) = match form {
                GlossForm::Printed => (fresnel(params.index, cos_h), printed_masking(cos_l, cos_v, cos_h)),
                GlossForm::Corrected | GlossForm::Legacy4x => (
                    fresnel(params.index, v_dot_h),
                    1f64.min(2.0 * cos_h * cos_v / v_dot_h).min(2.0 * cos_h * cos_l / v_dot_h),
                ),
            };
            sum += f * g * v_dot_h / (cos_v * cos_h);
        }
    }
    sum / (QUADRATURE * strata) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::gloss_params::{CUTICLE_INDEX, MIN_ROUGHNESS};

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
                let albedo =
                    GlossParams::isotropic(1e6, roughness).directional_albedo(f64::cos(f64::to_radians(theta)), 0.0);
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

    fn anisotropic(gamma_along: f64, gamma_across: f64) -> CookTorrance {
        CookTorrance::from_params(&GlossParams { gamma_along, gamma_across, ..GlossParams::default() })
    }

    fn form(form: GlossForm, gamma: f64) -> CookTorrance {
        CookTorrance::from_params(&GlossParams { form, ..GlossParams::isotropic(CUTICLE_INDEX, gamma) })
    }

    /// Components of the half vector along x and y, the vein running along x.
    fn half_tangent(wi: [f64; 3], wo: [f64; 3]) -> [f32; 2] {
        let sum: [f64; 3] = std::array::from_fn(|k| wi[k] + wo[k]);
        let length = sum.iter().map(|c| c * c).sum::<f64>().sqrt();
        [(sum[0] / length) as f32, (sum[1] / length) as f32]
    }

    fn pi_brdf_cos_along(lobe: &CookTorrance, wi: [f64; 3], wo: [f64; 3]) -> f64 {
        let angles = angles(wi, wo);
        f64::from(lobe.pi_brdf_cos_along(lobe.fresnel(angles.o_dot_h), angles, half_tangent(wi, wo)))
    }

    /// Pairs of a light and a view all over the hemisphere.
    fn pairs() -> Vec<([f64; 3], [f64; 3])> {
        let mut pairs = Vec::new();
        for (i, theta_i) in [0.0, 20.0, 45.0, 70.0, 85.0].into_iter().enumerate() {
            for (j, theta_o) in [3.0, 30.0, 50.0, 65.0, 80.0].into_iter().enumerate() {
                let turn = 37.0 * i as f64 + 61.0 * j as f64;
                pairs.push((direction(theta_i, turn), direction(theta_o, turn + 180.0 + 11.0 * j as f64)));
            }
        }
        pairs
    }

    #[test]
    fn two_equal_roughnesses_are_one() {
        for gamma in [0.05, 0.3, 1.0] {
            let one = CookTorrance::new(1.42, gamma);
            let two = anisotropic(gamma, gamma);
            assert!(!two.is_anisotropic());
            for (wi, wo) in pairs() {
                let (a, b) = (pi_brdf_cos(&one, wi, wo), pi_brdf_cos_along(&two, wi, wo));
                // h's components are rounded to single precision, and the exponent magnifies that.
                assert!((a - b).abs() <= 1e-4 * a + 1e-6, "{gamma}: {a} {b}");
                let tangent = [wi[0] as f32, wi[1] as f32];
                assert_eq!(one.albedo(wi[2] as f32), two.albedo_along(wi[2] as f32, tangent));
            }
            assert_eq!(one.mean_albedo(), two.mean_albedo());
        }
    }

    #[test]
    fn a_lobe_of_two_roughnesses_is_wide_where_the_facets_are_rough() {
        let lobe = anisotropic(0.1, 0.4);
        let mirror = |tilt: [f64; 2]| {
            // Light from above, facets tilted: the eye where they mirror it.
            let length = (1.0 + tilt[0] * tilt[0] + tilt[1] * tilt[1]).sqrt();
            let h = [tilt[0] / length, tilt[1] / length, 1.0 / length];
            let wo = std::array::from_fn(|k| 2.0 * h[2] * h[k] - if k == 2 { 1.0 } else { 0.0 });
            pi_brdf_cos_along(&lobe, [0.0, 0.0, 1.0], wo)
        };
        let (top, along, across) = (mirror([0.0, 0.0]), mirror([0.2, 0.0]), mirror([0.0, 0.2]));
        // exp(-(0.2/0.1)^2) against exp(-(0.2/0.4)^2); everything else is the same.
        let expected = (-4.0f64 + 0.25).exp();
        assert!((along / across / expected - 1.0).abs() < 1e-4, "{along} {across}");
        assert!(top > across && across > along);
        // Turning the leaf by a right angle swaps them.
        let turned = anisotropic(0.4, 0.1);
        let wo = direction(20.0, 0.0);
        let (a, b) = (pi_brdf_cos_along(&lobe, [0.0, 0.0, 1.0], wo), {
            pi_brdf_cos_along(&turned, [0.0, 0.0, 1.0], direction(20.0, 90.0))
        });
        assert!((a - b).abs() <= 1e-4 * a, "{a} {b}");
    }

    #[test]
    fn swapping_light_and_view_changes_nothing_with_two_roughnesses() {
        let lobe = anisotropic(0.15, 0.5);
        let mut planted = 0f64;
        for (a, b) in pairs() {
            let forward = pi_brdf_cos_along(&lobe, a, b) / a[2];
            let backward = pi_brdf_cos_along(&lobe, b, a) / b[2];
            assert!((forward - backward).abs() <= 1e-4 * forward.abs() + 1e-6, "{forward} {backward}");
            // Planted difference: the cosine left in.
            planted = planted.max((forward * a[2] - backward * b[2]).abs());
        }
        assert!(planted > 1e-2);
    }

    #[test]
    fn a_white_furnace_gains_nothing_with_two_roughnesses() {
        for (gamma_along, gamma_across) in [(0.05, 0.6), (0.6, 0.05), (0.2, 0.4), (1.0, 0.3)] {
            let white = GlossParams { gamma_along, gamma_across, ..GlossParams::isotropic(1e6, 0.3) };
            for theta in [0.0f64, 30.0, 60.0, 80.0, 89.0, 89.9] {
                for azimuth in [0.0f64, 30.0, 90.0] {
                    let albedo = white.directional_albedo(theta.to_radians().cos(), azimuth.to_radians());
                    assert!(albedo <= 1.0 + 1e-3, "{gamma_along} {gamma_across} {theta} {azimuth}: {albedo}");
                    // Planted difference: the printed factor.
                    let printed = GlossParams { form: GlossForm::Legacy4x, ..white };
                    let four = printed.directional_albedo(theta.to_radians().cos(), azimuth.to_radians());
                    assert!((four - 4.0 * albedo).abs() < 1e-12 && four > 1.0 + 1e-3);
                }
            }
        }
    }

    #[test]
    fn the_table_along_the_vein_is_the_integral_of_the_lobe_itself() {
        let lobe = anisotropic(0.2, 0.5);
        let mut swapped = 0f64;
        for (theta, azimuth) in [(10.0, 20.0), (50.0, 0.0), (50.0, 90.0), (70.0, 35.0), (80.0, 90.0)] {
            let (wi, steps) = (direction(theta, azimuth), 400);
            let mut sum = 0.0;
            for i in 0..steps {
                let cos_o: f64 = (f64::from(i) + 0.5) / f64::from(steps);
                let theta_o = cos_o.acos().to_degrees();
                for j in 0..steps {
                    let wo = direction(theta_o, 360.0 * (f64::from(j) + 0.5) / f64::from(steps));
                    sum += pi_brdf_cos_along(&lobe, wi, wo) / PI / wi[2] * wo[2];
                }
            }
            let integral = sum * 2.0 * PI / f64::from(steps * steps);
            let table = |x: usize, y: usize| f64::from(lobe.albedo_along(wi[2] as f32, [wi[x] as f32, wi[y] as f32]));
            assert!((integral - table(0, 1)).abs() < 2e-3, "{theta} {azimuth}: {integral} {}", table(0, 1));
            // Planted difference: along and across swapped.
            swapped = swapped.max((integral - table(1, 0)).abs());
        }
        assert!(swapped > 1e-2, "{swapped}");
    }

    #[test]
    fn the_tables_steps_are_fine_enough() {
        for (gamma_along, gamma_across, tolerance) in [(0.1, 0.4, 2e-3), (0.05, 0.6, 1e-2)] {
            let params = GlossParams { gamma_along, gamma_across, ..GlossParams::default() };
            let lobe = CookTorrance::from_params(&params);
            for i in 0..40 {
                let root = 0.02 + 0.98 * f64::from(i) / 39.0;
                let azimuth = f64::from(i * 7 % 40) / 39.0 * PI / 2.0;
                let (s, c) = azimuth.sin_cos();
                let table = f64::from(lobe.albedo_along((root * root) as f32, [c as f32, s as f32]));
                let expected = params.directional_albedo(root * root, azimuth);
                assert!((table - expected).abs() < tolerance, "{root} {azimuth}: {table} {expected}");
            }
        }
    }

    #[test]
    fn gloss_of_two_roughnesses_over_a_white_body_reflects_what_it_gets() {
        let lobe = anisotropic(0.1, 0.5);
        let (steps, turns) = (500, 64);
        for gloss in [0.5f32, 1.0] {
            for (theta, azimuth) in [(0.0f64, 0.0f64), (75.0, 0.0), (75.0, 90.0), (89.0, 40.0)] {
                let (cos_i, azimuth) = (theta.to_radians().cos() as f32, azimuth.to_radians());
                let albedo_i = lobe.albedo_along(cos_i, [azimuth.cos() as f32, azimuth.sin() as f32]);
                let mut body = 0f64;
                for i in 0..steps {
                    let cos_o = (1.0 - (i as f32 + 0.5) / steps as f32).sqrt();
                    for j in 0..turns {
                        let (s, c) = (2.0 * PI * (f64::from(j) + 0.5) / f64::from(turns)).sin_cos();
                        let albedo_o = lobe.albedo_along(cos_o, [c as f32, s as f32]);
                        body += f64::from(lobe.coupling(gloss, albedo_i, albedo_o));
                    }
                }
                let total = body / f64::from(steps * turns) + f64::from(gloss * albedo_i);
                assert!((total - 1.0).abs() < 1e-3, "{gloss} {theta} {azimuth}: {total}");
            }
        }
    }

    #[test]
    fn without_coupling_the_gloss_is_added_on_top() {
        let params = GlossParams { coupling: GlossCoupling::None, ..GlossParams::default() };
        let lobe = CookTorrance::from_params(&params);
        assert_eq!(lobe.lets_in(1.0, 0.4), 1.0);
        assert_eq!(lobe.coupling(1.0, 0.4, 0.9), 1.0);
        // The albedo is still told, so that a report can say what is gained.
        assert!(lobe.albedo(0.02) > 0.4);
    }

    #[test]
    fn the_legacy_lobe_is_four_times_the_corrected_one_to_the_bit() {
        for gamma in [0.05, 0.3, 1.0] {
            let (right, legacy) = (CookTorrance::new(CUTICLE_INDEX, gamma), form(GlossForm::Legacy4x, gamma));
            for (wi, wo) in pairs() {
                assert_eq!(pi_brdf_cos(&legacy, wi, wo), 4.0 * pi_brdf_cos(&right, wi, wo));
            }
            // What couples is the corrected albedo, so that the body below stays positive.
            assert_eq!(legacy.albedo(0.02), right.albedo(0.02));
            let cosine = 89.0f64.to_radians().cos();
            let albedo = |lobe: &CookTorrance| lobe.params().directional_albedo(cosine, 0.0);
            assert!((albedo(&legacy) - 4.0 * albedo(&right)).abs() < 1e-12);
        }
        // The figure that shows the slip: at 89 degrees the printed factor makes three lights of one.
        let legacy = GlossParams { form: GlossForm::Legacy4x, ..GlossParams::isotropic(CUTICLE_INDEX, 0.05) };
        let albedo = legacy.directional_albedo(89.0f64.to_radians().cos(), 0.0);
        assert!((albedo - 2.98).abs() < 0.02, "{albedo}");
    }

    #[test]
    fn the_printed_lobe_is_eq_7_to_the_letter() {
        let lobe = form(GlossForm::Printed, 0.3);
        let mut unlike = 0f64;
        for (wi, wo) in pairs() {
            let angles = angles(wi, wo);
            // Every factor as it stands in the paper.
            let (ci, cv, ch) = (f64::from(angles.cos_i), f64::from(angles.cos_o), f64::from(angles.cos_h));
            let theta_h = ch.min(1.0).acos();
            let g = (CUTICLE_INDEX.powi(2) + ch * ch - 1.0).sqrt();
            let f =
                0.5 * ((g - ch) / (g + ch)).powi(2) * (1.0 + ((ch * (g + ch) - 1.0) / (ch * (g - ch) + 1.0)).powi(2));
            let masking = 1f64.min(2.0 * ch * cv / theta_h).min(2.0 * ch * ci / theta_h);
            let d = (-(theta_h.tan() / 0.3).powi(2)).exp() / (0.3f64.powi(2) * ch.powi(4));
            let expected = f / PI * d * masking / (ci * cv) * PI * ci;
            let value = pi_brdf_cos(&lobe, wi, wo);
            assert!((value - expected).abs() <= 1e-4 * expected + 1e-6, "{value} {expected}");
            let legacy = pi_brdf_cos(&form(GlossForm::Legacy4x, 0.3), wi, wo);
            unlike = unlike.max((value - legacy).abs());
        }
        assert!(unlike > 1e-2, "{unlike}");
        // Fresnel at n.h loses the rise towards grazing.
        let at_80 = |form: GlossForm| {
            let params = GlossParams { form, ..GlossParams::isotropic(CUTICLE_INDEX, 0.1) };
            params.directional_albedo(80.0f64.to_radians().cos(), 0.0) / form.gain()
        };
        assert!(at_80(GlossForm::Printed) < 0.2 * at_80(GlossForm::Corrected), "{}", at_80(GlossForm::Printed));
    }

    #[test]
    fn extremes_are_finite_in_every_form() {
        for form in GlossForm::ALL {
            for gammas in [[1e-4, 1e-4], [0.0, 0.5], [f64::NAN, 1.0], [1.0, 1.0]] {
                let params =
                    GlossParams { gamma_along: gammas[0], gamma_across: gammas[1], form, ..GlossParams::default() };
                let lobe = CookTorrance::from_params(&params);
                assert!(lobe.params().gamma_along >= MIN_ROUGHNESS);
                for theta_i in [0.0f64, 45.0, 89.9, 90.0] {
                    for theta_o in [0.0f64, 45.0, 89.9, 90.0] {
                        for phi in [0.0, 90.0, 180.0] {
                            let (wi, wo) = (direction(theta_i, 0.0), direction(theta_o, phi));
                            for value in [pi_brdf_cos(&lobe, wi, wo), pi_brdf_cos_along(&lobe, wi, wo)] {
                                assert!(value.is_finite() && value >= 0.0, "{params:?} {theta_i} {theta_o} {phi}");
                            }
                        }
                    }
                }
                // Light and eye opposite: no half vector.
                let wi = direction(90.0, 30.0);
                assert_eq!(pi_brdf_cos(&lobe, wi, wi.map(|c| -c)), 0.0);
                assert_eq!(pi_brdf_cos_along(&lobe, wi, wi.map(|c| -c)), 0.0);
                let nan = LobeAngles { cos_i: 0.5, cos_o: 0.5, cos_h: f32::NAN, o_dot_h: f32::NAN };
                assert_eq!(lobe.pi_brdf_cos(1.0, nan), 0.0);
                let steep = LobeAngles { cos_i: 1e-20, cos_o: 1e-38, cos_h: 1e-3, o_dot_h: 2e-6 };
                for value in [lobe.pi_brdf_cos(1.0, steep), lobe.pi_brdf_cos_along(1.0, steep, [0.6, 0.8])] {
                    assert!(value.is_finite());
                }
                assert_eq!(lobe.pi_brdf_cos_along(1.0, LobeAngles { cos_h: 0.9, ..nan }, [f32::NAN, 0.1]), 0.0);
            }
        }
    }

    #[test]
    fn the_vein_frame_is_orthonormal_and_follows_the_vein() {
        for (normal, vein) in [
            ([0.0f32, 0.0, 1.0], [0.0f32, 2.0]),
            ([0.3, -0.4, 0.866_025_4], [1.0, 1.0]),
            ([-0.6, 0.0, 0.8], [-3.0, 0.5]),
            ([0.0, 0.8, 0.6], [0.0, 0.0]),
        ] {
            let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
            let [along, across] = vein_frame(normal, vein);
            for (a, b, expected) in [
                (along, along, 1.0),
                (across, across, 1.0),
                (along, across, 0.0),
                (along, normal, 0.0),
                (across, normal, 0.0),
            ] {
                assert!((dot(a, b) - expected).abs() < 1e-6, "{normal:?} {vein:?}");
            }
            // Seen from above, it is the vein's image.
            assert!((along[0] * vein[1] - along[1] * vein[0]).abs() < 1e-6);
            assert!(along[0] * vein[0] + along[1] * vein[1] >= 0.0);
        }
    }
}
