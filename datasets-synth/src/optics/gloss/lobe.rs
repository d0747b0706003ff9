//! Specular lobe of the cuticle: Cook-Torrance with Beckmann facets, corrected, and its coupling to the body below.
//! Parameters: [`GlossParams`].
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
use crate::optics::gloss::params::{GlossCoupling, GlossForm, GlossParams};
use crate::vector::cross;

/// Number of entries of the table of directional albedo for one roughness, even in the root of the cosine: dense
/// towards grazing, where the albedo rises.
const ALBEDO_ENTRIES: usize = 257;

/// Number of entries of the table of directional albedo for two roughnesses, where every entry is a row.
const ALONG_ENTRIES: usize = 129;

/// Number of entries of a row, even in the roughness that the plane of incidence cuts ([`CookTorrance::cut`]), from the
/// smaller to the larger, on which the albedo at one cosine depends.
const CUT_ENTRIES: usize = 17;

/// Strata per axis of the quadrature of one entry.
const QUADRATURE: usize = 96;

/// Smallest n.h; steeper facets have density 0 in single precision, and the fourth power of a smaller n.h underflows.
const MIN_COS_H: f32 = 1e-4;

/// Smallest v.h; for v = -l there is no half vector.
const MIN_O_DOT_H: f32 = 1e-6;

/// Exponent below which the lobe counts as 0: the sample is below 1e-31, and smaller results pass through denormal
/// numbers, which are slow.
const MIN_EXPONENT: f32 = -80.0;

impl GlossParams {
    /// Returns the directional albedo of the lobe in the requested form, `printed` above 1 included: the share of light
    /// from (or towards) the angle of cosine `cosine` (0 to 1), at `azimuth_rad` from the vein direction, that the lobe
    /// reflects. Costs 0.1 to 0.5 ms.
    pub fn directional_albedo(&self, cosine: f64, azimuth_rad: f64) -> f64 {
        let squared = azimuth_rad.cos().powi(2);
        self.form.gain() * lobe_albedo(self, self.form, cosine.clamp(1e-6, 1.0), squared)
    }
}

/// Specular lobe with its directional albedo tabulated.
#[derive(Debug, Clone)]
pub struct CookTorrance {
    params: GlossParams,
    /// Factor 1/4 of the corrected lobe, times the gain of the form.
    scale: f32,
    /// Coupling to the body: 1 where coupled, 0 where not.
    coupled: f32,
    /// Inverse square of the one roughness, or of the one with the mean slope variance.
    inverse_roughness_squared: f32,
    /// Factors 1 / gamma_along^2, 1 / gamma_across^2, 1 / (gamma_along gamma_across).
    inverse_along: f32,
    inverse_across: f32,
    inverse_product: f32,
    /// Directional albedo of the corrected form over the root of the cosine; with two roughnesses, its mean
    /// over the azimuth.
    albedo: Vec<f32>,
    /// Directional albedo of two roughnesses, `[root of the cosine, roughness cut by the plane of incidence]`.
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
    /// Returns the corrected, coupled lobe of refractive index `index` and one `roughness`, raised to
    /// [`MIN_ROUGHNESS`](crate::MIN_ROUGHNESS). Takes some tens of milliseconds for the table.
    pub fn new(index: f64, roughness: f64) -> CookTorrance {
        CookTorrance::from_params(&GlossParams::isotropic(index, roughness))
    }

    /// Returns the lobe of `params`, with roughness below [`MIN_ROUGHNESS`](crate::MIN_ROUGHNESS) raised to it. The
    /// caller must have called [`GlossParams::check`]. Takes some tens of milliseconds for the table, with two
    /// roughnesses some hundreds over the threads of the current pool.
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

    /// Fills the tables of directional albedo. They are those of the corrected form under every form, because the
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

    /// Returns the parameters with the roughness after the floor.
    pub fn params(&self) -> &GlossParams {
        &self.params
    }

    /// Returns the roughness after the floor; with two, the one along the vein direction.
    pub fn roughness(&self) -> f64 {
        self.params.gamma_along
    }

    /// Returns whether the roughness along and across the vein direction differ, so that the functions with `_along`
    /// are needed.
    pub fn is_anisotropic(&self) -> bool {
        self.params.gamma_along != self.params.gamma_across
    }

    /// Returns the Fresnel reflectance at the cosine `wo.h`.
    pub fn fresnel(&self, o_dot_h: f32) -> f32 {
        fresnel(self.params.index, f64::from(o_dot_h)) as f32
    }

    /// Returns `pi * f_s * cos_i`, for the Fresnel reflectance `fresnel` at `angles.o_dot_h`, which is constant over a
    /// surface under parallel light and view, so the caller computes it once; `printed` does not use it. Returns 0
    /// where a cosine is not positive or not a number; the result is finite everywhere.
    ///
    /// A lobe with two roughnesses is replaced by one of a single roughness with the same mean slope variance, for a
    /// surface whose vein direction is not known.
    #[inline]
    pub fn pi_brdf_cos(&self, fresnel: f32, angles: LobeAngles) -> f32 {
        let slope2_over_gamma2 = |cos2_h: f32| (1.0 - cos2_h).max(0.0) / cos2_h * self.inverse_roughness_squared;
        self.facets_seen(fresnel, angles, self.inverse_roughness_squared, slope2_over_gamma2)
    }

    /// Returns [`CookTorrance::pi_brdf_cos`] for a known vein direction: `half_tangent` holds the components of h along
    /// and across it, both in the tangent plane ([`vein_frame`]).
    #[inline]
    pub fn pi_brdf_cos_along(&self, fresnel: f32, angles: LobeAngles, half_tangent: [f32; 2]) -> f32 {
        let [along, across] = half_tangent;
        let weighted = along * along * self.inverse_along + across * across * self.inverse_across;
        self.facets_seen(fresnel, angles, self.inverse_product, |cos2_h| weighted / cos2_h)
    }

    /// Returns the lobe of facets of density `exp(-slope2_over_gamma2(cos_h^2)) * inverse_product / (pi cos_h^4)`.
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

    /// Evaluates eq. 7 to the letter.
    #[cold]
    fn printed(&self, angles: LobeAngles, pi_d: f32) -> f32 {
        let LobeAngles { cos_i, cos_o, cos_h, .. } = angles;
        let g = printed_masking(f64::from(cos_i), f64::from(cos_o), f64::from(cos_h)) as f32;
        self.scale * self.fresnel(cos_h) * pi_d * g / cos_o.max(MIN_O_DOT_H)
    }

    /// Returns the directional albedo of the corrected form: the share of light from (or towards) an angle of this
    /// cosine that the lobe reflects; with two roughnesses, the mean over the azimuth.
    #[inline]
    pub fn albedo(&self, cosine: f32) -> f32 {
        let position = cosine.clamp(0.0, 1.0).sqrt() * (ALBEDO_ENTRIES - 1) as f32;
        let cell = (position as usize).min(ALBEDO_ENTRIES - 2);
        let t = position - cell as f32;
        self.albedo[cell] * (1.0 - t) + self.albedo[cell + 1] * t
    }

    /// Returns [`CookTorrance::albedo`] for a known vein direction: `tangent` holds the components along and across it
    /// of the direction to the light or eye; only their ratio counts.
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

    /// Returns the roughness that a vertical plane through `tangent` cuts, scaled so that 0 is the smaller and 1 the
    /// larger roughness. The square of the cut roughness is the mean of both squares with the squared direction cosines
    /// as weights.
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

    /// Returns the mean of [`CookTorrance::albedo`] over the hemisphere with the cosine as weight.
    pub fn mean_albedo(&self) -> f32 {
        self.mean_albedo
    }

    /// Returns the share of the light from one direction that enters the body below a lobe of strength `gloss` (0 to 1)
    /// and directional albedo `albedo_i`; 1 where not coupled.
    #[inline]
    pub fn lets_in(&self, gloss: f32, albedo_i: f32) -> f32 {
        1.0 - self.coupled * gloss * albedo_i
    }

    /// Returns the factor on a Lambertian body of albedo `a` below a lobe of strength `gloss` (0 to 1):
    /// `pi f_d = a * (1 - g E(i)) (1 - g E(o)) / (1 - g E_mean)`. The sum of body and lobe is reciprocal and reflects
    /// `g E(i) + a (1 - g E(i))`, never more than what came in [after Kelemen & Szirmay-Kalos 2001]. Returns 1 where
    /// not coupled.
    #[inline]
    pub fn coupling(&self, gloss: f32, albedo_i: f32, albedo_o: f32) -> f32 {
        self.lets_in(gloss, albedo_i) * self.lets_in(gloss, albedo_o) / (1.0 - self.coupled * gloss * self.mean_albedo)
    }
}

/// Returns the unit vectors along and across the vein in the tangent plane of the unit `normal`, for a vein that runs
/// along `vein` (any length, either sense) seen from above. The components that [`CookTorrance::pi_brdf_cos_along`] and
/// [`CookTorrance::albedo_along`] need are dot products with them. No vein, `[0, 0]`, is taken as along x.
///
/// The z of `normal` must be positive.
#[inline]
pub fn vein_frame(normal: [f32; 3], vein: [f32; 2]) -> [[f32; 3]; 2] {
    let length = (vein[0] * vein[0] + vein[1] * vein[1]).sqrt();
    let [x, y] = if length > 0.0 { vein.map(|c| c / length) } else { [1.0, 0.0] };
    // On the surface above the vein's image: rises with the slope.
    let z = -(normal[0] * x + normal[1] * y) / normal[2].max(MIN_COS_H);
    let scale = 1.0 / (1.0 + z * z).sqrt();
    let along = [x * scale, y * scale, z * scale];
    let across = cross(normal, along);
    [along, across]
}

/// Evaluates G of Miao's eq. 7 to the letter, with the half angle in radians in the denominator.
fn printed_masking(cos_i: f64, cos_o: f64, cos_h: f64) -> f64 {
    let theta_h = cos_h.clamp(0.0, 1.0).acos();
    if theta_h == 0.0 {
        return 1.0;
    }
    1f64.min(2.0 * cos_h * cos_o / theta_h).min(2.0 * cos_h * cos_i / theta_h)
}

/// Returns the directional albedo of a form without its gain, by a stratified midpoint rule over facets drawn from
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
mod tests;
