//! Finish of leather: a clear coat of two roughnesses over pigmented, absorbing layers on a diffuse hide.
//!
//! | parameter | symbol | unit | default | valid |
//! |---|---|---|---|---|
//! | index | eta | - | 1.49 (acrylic) | 1.05 to 3 |
//! | roughness where the finish is whole | alpha | - | 0.24 | 0.03 to 1 |
//! | roughness where it is broken | alpha_b | - | 0.5 | 0.03 to 1 |
//! | tail of both | gamma | - | 2.6 | 1.55 to 20 |
//!
//! A share w of the surface at a point is finished, the rest is broken; each reflects as [`Facets`], together
//! `E(cos) = w E_whole + (1 - w) E_broken`. Light that is not reflected enters, passes pigment of the optical depth tau
//! twice on its slanted paths, meets the hide of reflectance `rho` = 0.92 and leaves as
//!
//! ```text
//! pi f = (1 - E_i)(1 - E_o) / (1 - E_mean)
//!        rho exp(-tau (1/cos_it + 1/cos_ot)) (1 - r) / (1 - rho r exp(-4 tau))
//! ```
//!
//! with the refracted cosines, the inner reflectance `r = 1 - (1 - E_mean) / eta^2` of diffuse light [Stern 1964], and
//! the mean path of diffuse light, two depths each way, between inner reflections. The normalisation of the first
//! factor is that of [Kelemen 2001].
//!
//! Energy and reciprocity: without pigment on a white hide all light comes back, up to the precision of the tables
//! (2e-3 within 84 degrees); swapping directions changes nothing but rounding.
//!
//! When it is wrong: the hide scatters where light enters (no translucency), the interface of the coat is rough for
//! reflection and flat for the refracted paths, and pigment does not scatter.

use crate::error::{SynthError, check_ranges};
use crate::leather::facets::{FacetDirection, Facets};
use crate::optics::fresnel::fresnel;

/// Diffuse reflectance of the hide without pigment, which is bleached collagen, at all wavelengths.
const HIDE_REFLECTANCE: f64 = 0.92;

/// Largest optical depth of the pigment.
const MAX_OPTICAL_DEPTH: f64 = 6.0;

/// Parameters of a finish; see the table of the module.
#[derive(Debug, Clone, PartialEq)]
pub struct FinishParams {
    /// Refractive index, 1.05 to 3.
    pub index: f64,
    /// Roughness where the finish is whole, 0.03 to 1.
    pub roughness: f64,
    /// Roughness where the finish is broken, 0.03 to 1.
    pub broken_roughness: f64,
    /// Length of the tail of both roughnesses, 1.55 (long) to 20.
    pub tail: f64,
}

impl Default for FinishParams {
    /// Returns the parameters of a satin acrylic finish.
    fn default() -> FinishParams {
        FinishParams { index: 1.49, roughness: 0.24, broken_roughness: 0.5, tail: 2.6 }
    }
}

impl FinishParams {
    /// Checks every range.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for the first that is out of its range.
    pub fn check(&self) -> Result<(), SynthError> {
        check_ranges(&[
            ("--finish-index", self.index, 1.05, 3.0),
            ("--roughness", self.roughness, 0.03, 1.0),
            ("--broken-roughness", self.broken_roughness, 0.03, 1.0),
            ("--tail", self.tail, 1.55, 20.0),
        ])
    }
}

/// A finish with its tables, which serve pigments of every colour.
#[derive(Debug, Clone)]
pub struct Finish {
    index: f64,
    inverse_index_squared: f32,
    hide: f32,
    /// Facets of the whole and of the broken finish.
    facets: [Facets; 2],
}

/// View-dependent half of the shading at a point.
#[derive(Debug, Clone, Copy)]
pub struct FinishView {
    /// Parts of the view direction for the whole and the broken finish.
    out: [FacetDirection; 2],
    whole: f32,
    depth: [f32; 3],
    /// Factors of the body that do not depend on the light.
    body: [f32; 3],
}

impl Finish {
    /// Returns the finish of `params`, with its tables.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`].
    pub fn new(params: &FinishParams) -> Result<Finish, SynthError> {
        params.check()?;
        let facets = |roughness: f64| Facets::new(params.index, roughness, params.tail);
        Ok(Finish {
            index: params.index,
            inverse_index_squared: (1.0 / (params.index * params.index)) as f32,
            hide: HIDE_REFLECTANCE as f32,
            facets: [facets(params.roughness), facets(params.broken_roughness)],
        })
    }

    /// Returns the Fresnel reflectance at the cosine `wi.h`.
    pub fn fresnel(&self, cosine: f32) -> f32 {
        fresnel(self.index, f64::from(cosine)) as f32
    }

    /// Returns the optical depth per channel of the pigment that gives the body this colour, lit and seen from above
    /// below whole finish; colours out of reach give the nearest pigment.
    pub fn depth_from_colour(&self, colour: [f64; 3]) -> [f32; 3] {
        colour.map(|wanted| {
            let (mut low, mut high) = (0.0, MAX_OPTICAL_DEPTH);
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                let [body, ..] = self.view(1.0, 1.0, [middle as f32; 3]).body;
                let enters = 1.0 - self.albedo(1.0, 1.0);
                if f64::from(body * enters * (-middle as f32).exp()) > wanted { low = middle } else { high = middle }
            }
            (0.5 * (low + high)) as f32
        })
    }

    /// Returns the view-dependent half of the shading, from the cosine towards the eye, the share of whole finish and
    /// the optical depth of the pigment.
    pub fn view(&self, cos_o: f32, whole: f32, depth: [f32; 3]) -> FinishView {
        let mean_enters = 1.0 - self.mean_albedo(whole);
        let inner = 1.0 - mean_enters * self.inverse_index_squared;
        let coupled = (1.0 - self.albedo(cos_o, whole)) / mean_enters;
        let way = self.way(cos_o);
        FinishView {
            out: [0, 1].map(|k| self.facets[k].direction(cos_o)),
            whole,
            depth,
            body: depth.map(|depth| {
                let back = self.hide * (1.0 - inner) / (1.0 - self.hide * inner * (-4.0 * depth).exp());
                coupled * back * (-depth * way).exp()
            }),
        }
    }

    /// Returns `pi * BRDF * cos_i` per channel, for the Fresnel reflectance at `wi.h` and the cosines `n.h` and `n.wi`.
    #[inline]
    pub fn pi_brdf_cos(&self, fresnel: f32, cos_h: f32, cos_i: f32, view: &FinishView) -> [f32; 3] {
        let gloss: f32 = [view.whole, 1.0 - view.whole]
            .iter()
            .zip(self.facets.iter().zip(view.out))
            .map(|(share, (facets, out))| share * facets.pi_brdf_cos(fresnel, cos_h, facets.direction(cos_i), out))
            .sum();
        let enters = (1.0 - self.albedo(cos_i, view.whole)) * cos_i;
        let way = self.way(cos_i);
        std::array::from_fn(|k| gloss + enters * view.body[k] * (-view.depth[k] * way).exp())
    }

    /// Returns the share of diffuse light that leaves towards an angle of cosine `cos_o`.
    pub fn diffuse_reflectance(&self, cos_o: f32, view: &FinishView) -> [f32; 3] {
        let gloss = self.albedo(cos_o, view.whole);
        let enters = 1.0 - self.mean_albedo(view.whole);
        // Entered at the mean angle of diffuse light, of cosine 2/3.
        let way = self.way(2.0 / 3.0);
        std::array::from_fn(|k| gloss + enters * view.body[k] * (-view.depth[k] * way).exp())
    }

    /// Returns the reflectance of diffuse light to all sides, for a share of whole finish and a pigment.
    pub fn mean_reflectance(&self, whole: f32, depth: [f32; 3]) -> [f32; 3] {
        let cos_o = 2.0 / 3.0;
        self.diffuse_reflectance(cos_o, &self.view(cos_o, whole, depth))
    }

    /// Returns the path of a ray through a layer of unit depth, for its cosine outside.
    #[inline]
    fn way(&self, cosine: f32) -> f32 {
        1.0 / (1.0 - (1.0 - cosine * cosine) * self.inverse_index_squared).sqrt()
    }

    #[inline]
    fn albedo(&self, cosine: f32, whole: f32) -> f32 {
        whole * self.facets[0].albedo(cosine) + (1.0 - whole) * self.facets[1].albedo(cosine)
    }

    fn mean_albedo(&self, whole: f32) -> f32 {
        whole * self.facets[0].mean_albedo() + (1.0 - whole) * self.facets[1].mean_albedo()
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::vector::dot;

    fn unit(theta_deg: f32, phi_deg: f32) -> [f32; 3] {
        let ((st, ct), (sp, cp)) = (theta_deg.to_radians().sin_cos(), phi_deg.to_radians().sin_cos());
        [st * cp, st * sp, ct]
    }

    fn pi_brdf_cos(finish: &Finish, whole: f32, depth: [f32; 3], wi: [f32; 3], wo: [f32; 3]) -> [f32; 3] {
        let sum: [f32; 3] = std::array::from_fn(|k| wi[k] + wo[k]);
        let length = dot(sum, sum).sqrt();
        let half = sum.map(|c| c / length);
        finish.pi_brdf_cos(finish.fresnel(dot(wo, half)), half[2], wi[2], &finish.view(wo[2], whole, depth))
    }

    /// Returns the share of the light from `wi` that leaves.
    fn albedo(finish: &Finish, whole: f32, depth: [f32; 3], wi: [f32; 3]) -> [f64; 3] {
        let steps = 120;
        let mut sum = [0f64; 3];
        for i in 0..steps {
            let theta = (f64::from(i) + 0.5) / f64::from(steps) * 90.0;
            for j in 0..2 * steps {
                let wo = unit(theta as f32, (j as f32 + 0.5) / steps as f32 * 180.0);
                let area = PI / 2.0 / f64::from(steps) * PI / f64::from(steps);
                let weight = area * theta.to_radians().sin() * f64::from(wo[2]) / PI;
                for (sum, value) in sum.iter_mut().zip(pi_brdf_cos(finish, whole, depth, wi, wo)) {
                    *sum += f64::from(value) / f64::from(wi[2]) * weight;
                }
            }
        }
        sum
    }

    fn white_hide(params: &FinishParams) -> Finish {
        Finish { hide: 1.0, ..Finish::new(params).unwrap() }
    }

    #[test]
    fn a_white_hide_without_pigment_gives_back_all_light() {
        for params in [
            FinishParams::default(),
            FinishParams { roughness: 0.15, broken_roughness: 0.9, tail: 1.7, ..FinishParams::default() },
            FinishParams { index: 2.5, tail: 8.0, ..FinishParams::default() },
        ] {
            let finish = white_hide(&params);
            for whole in [0.0, 0.5, 1.0] {
                for theta in [0.0, 40.0, 70.0, 84.0] {
                    let [white, grey, black] = albedo(&finish, whole, [0.0, 0.4, 6.0], unit(theta, 0.0));
                    assert!((white - 1.0).abs() < 2e-3, "{params:?} {whole} {theta}: {white}");
                    assert!(black < grey && grey < 0.95 * white, "{grey} {black}");
                }
            }
        }
    }

    #[test]
    fn swapping_light_and_view_changes_nothing() {
        let finish = Finish::new(&FinishParams::default()).unwrap();
        for (a, b) in [((10.0, 0.0), (70.0, 200.0)), ((45.0, 20.0), (60.0, 190.0)), ((85.0, 0.0), (5.0, 90.0))] {
            let (a, b) = (unit(a.0, a.1), unit(b.0, b.1));
            let forward = pi_brdf_cos(&finish, 0.6, [0.5; 3], a, b)[1] / a[2];
            let backward = pi_brdf_cos(&finish, 0.6, [0.5; 3], b, a)[1] / b[2];
            assert!((forward - backward).abs() < 1e-4 * forward, "{forward} {backward}");
        }
    }

    #[test]
    fn whole_finish_has_the_higher_and_narrower_highlight() {
        let finish = Finish::new(&FinishParams::default()).unwrap();
        let dark = |whole, theta| pi_brdf_cos(&finish, whole, [6.0; 3], unit(30.0, 0.0), unit(theta, 180.0))[0];
        assert!(dark(1.0, 30.0) > 2.0 * dark(0.0, 30.0));
        assert!(dark(1.0, 75.0) < dark(0.0, 75.0));
    }

    #[test]
    fn a_colour_is_what_the_body_shows_from_above() {
        let finish = Finish::new(&FinishParams::default()).unwrap();
        let colour = [0.3, 0.1, 0.02];
        let depth = finish.depth_from_colour(colour);
        let up = [0.0, 0.0, 1.0];
        let value = pi_brdf_cos(&finish, 1.0, depth, up, up);
        let gloss = pi_brdf_cos(&finish, 1.0, [60.0; 3], up, up)[0];
        for k in 0..3 {
            assert!((f64::from(value[k] - gloss) - colour[k]).abs() < 2e-3, "{value:?} {gloss}");
        }
    }
}
