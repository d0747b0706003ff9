//! Scattering by a layer of parallel fibres: reflection at their surfaces, scattering inside dyed fibres, and multiple
//! scattering between fibres.
//!
//! | parameter | symbol | unit | default | valid |
//! |---|---|---|---|---|
//! | refractive index | eta | - | 1.53 (cotton) | 1.2 to 2 |
//! | width of the surface's reflection | gamma_s | degrees | 14 | 4 to 40 |
//! | width of the inner scattering | gamma_v | degrees | 28 | 4 to 60 |
//! | share scattered evenly inside | k_d | - | 0.35 | 0 to 1 |
//! | correlation of masking and shadowing | sigma | degrees | 22 | 5 to 90 |
//!
//! A fibre is a cylinder about the tangent t. With `s = w.t = sin theta` and the azimuth phi about t
//! from the normal n, radiance follows from `L_o = integral of S(wi, wo) L_i cos theta_i dwi`
//! [Marschner 2003, eq. 1] with the two parts of [Sadeghi 2013, eqs. 1 to 6]:
//!
//! ```text
//! S_r = F(wi.h) cos(phi_d / 2) / 4  g(gamma_s, s_i + s_o) / max(cos theta_i, cos theta_o)
//! S_v = T(theta_i) T(theta_o) / T(0)  exp(-tau l)
//!       [(1 - k_d) g(gamma_v, s_i + s_o) / (2 pi max(cos theta_i, cos theta_o)) + k_d / pi^2]
//! ```
//!
//! g is a Gaussian of unit integral over the sine, h the half vector, phi_d the difference of the
//! azimuths, T one minus the Fresnel reflectance averaged over the cylinder's width, tau the dye's
//! optical depth over a fibre, and `l = (1 / cos theta_it + 1 / cos theta_ot) / 2` the longer way
//! of a ray that is refracted along the fibre. A layer of fibres that touch has the BRDF
//! `(S_r + S_v) G / (cos phi_i cos phi_o)`, where G, the share of a fibre that both sides see, goes
//! from the product of both cosines to the smaller of them as the two directions meet
//! [Sadeghi 2013, eq. 12].
//!
//! The energy that white fibres lose this way goes down into the yarn and comes back after many fibres,
//! `(1 - E_i)(1 - E_o) / (pi (1 - E_mean))` of it [Kulla & Conty 2017], dyed by the two-stream reflectance
//! `(1 - q)/(1 + q)`, `q = sqrt(1 - exp(-tau))`, of a deep pad [Hapke 1981].
//!
//! Differs from the paper in: lobes are Gaussians over sines divided by `max(cos)` instead of over angles divided by
//! `cos^2 theta_d`, so that no fibre scatters more light than it receives at any angle; inner scattering is normalised;
//! the dye is an optical depth instead of a factor; scattering between fibres is added.
//!
//! Energy and reciprocity: white fibres scatter all light, up to the precision of the tables (5e-3 within 82 degrees);
//! swapping wi and wo changes nothing but rounding (1e-4).
//!
//! When it is wrong: fibres are round and smooth (cotton is a twisted ribbon, wool has scales); the azimuth of inner
//! scattering is uniform, so no light is transmitted towards an eye behind the cloth; there is one tangent per point.

use std::f64::consts::PI;

use crate::error::{SynthError, check_ranges};
use crate::optics::fresnel::fresnel;
use crate::surface::table::CosineTable;
use crate::vector::dot;

/// Entries per axis of the tables of directional albedo.
const ALBEDO_ENTRIES: usize = 25;

/// Samples per axis of the quadrature of one entry.
const QUADRATURE: usize = 40;

/// Largest optical depth of a fibre; a larger one cannot be told from it.
const MAX_OPTICAL_DEPTH: f64 = 9.0;

/// Lower clamp of cos theta, where a direction runs along the fibre.
const MIN_COS_THETA: f32 = 1e-3;

/// Parameters of a fibre; see the table of the module.
#[derive(Debug, Clone, PartialEq)]
pub struct FibreParams {
    /// Refractive index, 1.2 to 2.
    pub index: f64,
    /// Width of the surface's reflection along the fibre in degrees, 4 to 40.
    pub surface_width_deg: f64,
    /// Width of the inner scattering along the fibre in degrees, 4 to 60.
    pub volume_width_deg: f64,
    /// Share of the inner scattering that is even, 0 to 1.
    pub even_share: f64,
    /// Angle over which masking and shadowing stay correlated in degrees, 5 to 90.
    pub correlation_deg: f64,
}

impl Default for FibreParams {
    /// Returns the parameters of cotton.
    fn default() -> FibreParams {
        FibreParams {
            index: 1.53,
            surface_width_deg: 14.0,
            volume_width_deg: 28.0,
            even_share: 0.35,
            correlation_deg: 22.0,
        }
    }
}

impl FibreParams {
    /// Checks every range.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for the first that is out of its range.
    pub fn check(&self) -> Result<(), SynthError> {
        check_ranges(&[
            ("--fibre-index", self.index, 1.2, 2.0),
            ("--surface-width-deg", self.surface_width_deg, 4.0, 40.0),
            ("--volume-width-deg", self.volume_width_deg, 4.0, 60.0),
            ("--even-share", self.even_share, 0.0, 1.0),
            ("--correlation-deg", self.correlation_deg, 5.0, 90.0),
        ])
    }
}

/// A fibre with its tables, which serve fibres of every dye.
#[derive(Debug, Clone)]
pub struct Fibre {
    index: f64,
    /// Gaussians of the surface and of the inner scattering: factor and exponent.
    surface: Gaussian,
    volume: Gaussian,
    even_share: f32,
    inverse_correlation: f32,
    inverse_index_squared: f32,
    /// T over the cosine of theta.
    enters: CosineTable,
    inverse_enters_at_0: f32,
    /// Directional albedo of single scattering by white fibres, `[|s|][cos phi]`: at the surface, from inside.
    albedo: Vec<[f32; 2]>,
    /// Means of the directional albedo over the hemisphere.
    mean_albedo: [f64; 2],
}

#[derive(Debug, Clone, Copy)]
struct Gaussian {
    factor: f32,
    exponent: f32,
}

impl Gaussian {
    fn new(width_deg: f64) -> Gaussian {
        let sigma = width_deg.to_radians();
        Gaussian { factor: (1.0 / (sigma * (2.0 * PI).sqrt())) as f32, exponent: (-0.5 / (sigma * sigma)) as f32 }
    }

    #[inline]
    fn at(self, x: f32) -> f32 {
        self.factor * (x * x * self.exponent).exp()
    }
}

/// Direction relative to a fibre.
#[derive(Debug, Clone, Copy)]
pub struct FibreDirection {
    /// s = sin theta.
    sine: f32,
    cos_theta: f32,
    /// Cosine of the azimuth, not negative.
    cos_phi: f32,
}

impl FibreDirection {
    /// Returns the direction `w` with the fibre's unit tangent and the cosine of `w` against the layer's normal, which
    /// is perpendicular to the tangent.
    #[inline]
    pub fn new(w: [f32; 3], tangent: [f32; 3], cos_normal: f32) -> FibreDirection {
        let sine = dot(w, tangent).clamp(-1.0, 1.0);
        let cos_theta = (1.0 - sine * sine).sqrt().max(MIN_COS_THETA);
        FibreDirection { sine, cos_theta, cos_phi: (cos_normal / cos_theta).clamp(0.0, 1.0) }
    }
}

/// Part of the shading at a point that depends on the dye and the view.
#[derive(Debug, Clone, Copy)]
pub struct FibreView {
    out: FibreDirection,
    /// T(theta_o) / T(0).
    leaves: f32,
    /// Half of the path inside the fibre towards the view, in fibre widths.
    half_way_out: f32,
    /// `1 - E_o`.
    missing: f32,
    /// Optical depth of the dye per channel.
    depth: [f32; 3],
    /// Reflectance of the deep yarn over `1 - E_mean`.
    deep: [f32; 3],
}

/// Constants of one image.
#[derive(Debug, Clone, Copy)]
pub struct FibrePair {
    cosine: f32,
    fresnel: f32,
}

impl FibrePair {
    /// Returns the constants of the image of the directions `wi` and `wo`.
    pub fn new(fibre: &Fibre, wi: [f32; 3], wo: [f32; 3]) -> FibrePair {
        let cosine = dot(wi, wo).clamp(-1.0, 1.0);
        let half = f64::from(0.5 * (1.0 + cosine)).sqrt();
        FibrePair { cosine, fresnel: fresnel(fibre.index, half) as f32 }
    }
}

impl Fibre {
    /// Returns the fibre of `params` with its tables. Cost: some hundredths of a second.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`].
    pub fn new(params: &FibreParams) -> Result<Fibre, SynthError> {
        params.check()?;
        let index = params.index;
        // Mean over the width of a cylinder, where the angle of incidence has the cosine
        // cos theta cos gamma and sin gamma is even.
        let enters = CosineTable::new(|cos_theta| {
            let steps = 64;
            let reflected: f64 = (0..steps)
                .map(|i| (f64::from(i) + 0.5) / f64::from(steps))
                .map(|offset| fresnel(index, cos_theta * (1.0 - offset * offset).sqrt()))
                .sum();
            1.0 - reflected / f64::from(steps)
        });
        let correlation = params.correlation_deg.to_radians();
        let mut fibre = Fibre {
            index,
            surface: Gaussian::new(params.surface_width_deg),
            volume: Gaussian::new(params.volume_width_deg),
            even_share: params.even_share as f32,
            inverse_correlation: (1.0 / (correlation * correlation)) as f32,
            inverse_index_squared: (1.0 / (index * index)) as f32,
            inverse_enters_at_0: 1.0 / enters.at(1.0),
            enters,
            albedo: Vec::new(),
            mean_albedo: [0.0; 2],
        };
        let last = (ALBEDO_ENTRIES - 1) as f32;
        fibre.albedo = (0..ALBEDO_ENTRIES * ALBEDO_ENTRIES)
            .map(|entry| {
                // Just inside the ends, where a direction has an azimuth.
                let sine = ((entry / ALBEDO_ENTRIES) as f32 / last).min(0.999);
                let cos_phi = ((entry % ALBEDO_ENTRIES) as f32 / last).max(1e-3);
                fibre.directional_albedo(direction_of(sine, cos_phi))
            })
            .collect();
        fibre.mean_albedo = fibre.mean_of_table();
        Ok(fibre)
    }

    /// Returns the optical depth of a dye per channel that gives flat cloth the diffuse albedo `colour`, linear sRGB;
    /// albedos out of reach give the nearest dye.
    pub fn depth_from_albedo(&self, colour: [f64; 3]) -> [f32; 3] {
        colour.map(|albedo| {
            let (mut low, mut high) = (0.0, MAX_OPTICAL_DEPTH);
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                if self.mean_reflectance(middle) > albedo { low = middle } else { high = middle }
            }
            (0.5 * (low + high)) as f32
        })
    }

    /// Returns the diffuse albedo of a layer of fibres whose dye has the optical depth `depth`.
    pub fn mean_reflectance(&self, depth: f64) -> f64 {
        let [surface, volume] = self.mean_albedo;
        surface + volume * (-depth).exp() + (1.0 - surface - volume) * deep_reflectance(depth as f32) as f64
    }

    /// Returns the view-dependent half of the shading, for a direction towards the eye and the optical depth of the
    /// dye.
    pub fn view(&self, out: FibreDirection, depth: [f32; 3]) -> FibreView {
        let [surface, volume] = self.mean_albedo;
        let inverse_mean = (1.0 / (1.0 - surface - volume)) as f32;
        let [surface, volume] = self.albedo_at(out);
        FibreView {
            out,
            leaves: self.enters.at(out.cos_theta) * self.inverse_enters_at_0,
            half_way_out: self.half_way(out),
            missing: 1.0 - surface - volume,
            depth,
            deep: depth.map(|depth| deep_reflectance(depth) * inverse_mean),
        }
    }

    /// Returns `pi * BRDF * cos_i` per channel for light from the direction `incoming`. Finite and not negative.
    #[inline]
    pub fn pi_brdf_cos(&self, pair: &FibrePair, view: &FibreView, incoming: FibreDirection) -> [f32; 3] {
        let cos_i = incoming.cos_theta * incoming.cos_phi;
        let [surface, volume] = self.scattered(pair, view.leaves, incoming, view.out);
        let [albedo_surface, albedo_volume] = self.albedo_at(incoming);
        let deep = (1.0 - albedo_surface - albedo_volume) * view.missing * cos_i;
        let way = self.half_way(incoming) + view.half_way_out;
        let (surface, volume) = (std::f32::consts::PI * surface * cos_i, std::f32::consts::PI * volume * cos_i);
        std::array::from_fn(|k| surface + volume * (-view.depth[k] * way).exp() + deep * view.deep[k])
    }

    /// Returns the share of diffuse light that leaves towards the view, per channel.
    pub fn diffuse_reflectance(&self, view: &FibreView) -> [f32; 3] {
        let [surface, volume] = self.albedo_at(view.out);
        let mean_missing = (1.0 - self.mean_albedo[0] - self.mean_albedo[1]) as f32;
        // Light arrives at a mean of the angles; the way in is taken as the way out.
        let way = 2.0 * view.half_way_out;
        std::array::from_fn(|k| {
            surface + volume * (-view.depth[k] * way).exp() + view.missing * mean_missing * view.deep[k]
        })
    }

    /// Returns the BRDF of single scattering by white fibres: at the surface, inside. `leaves` = T(theta_o) / T(0).
    #[inline]
    fn scattered(&self, pair: &FibrePair, leaves: f32, i: FibreDirection, o: FibreDirection) -> [f32; 2] {
        let cos_phi_d = ((pair.cosine - i.sine * o.sine) / (i.cos_theta * o.cos_theta)).clamp(-1.0, 1.0);
        let correlated = (-(1.0 - cos_phi_d) * self.inverse_correlation).exp();
        let seen = (1.0 - correlated) + correlated / i.cos_phi.max(o.cos_phi).max(1e-4);
        let sum = i.sine + o.sine;
        let per_cosine = 1.0 / i.cos_theta.max(o.cos_theta);
        let half_azimuth = (0.5 * (1.0 + cos_phi_d)).sqrt();
        let surface = pair.fresnel * 0.25 * half_azimuth * self.surface.at(sum) * per_cosine;
        const EVEN: f32 = (1.0 / (PI * PI)) as f32;
        const PER_AZIMUTH: f32 = (0.5 / PI) as f32;
        let lobe = (1.0 - self.even_share) * self.volume.at(sum) * per_cosine * PER_AZIMUTH + self.even_share * EVEN;
        [surface * seen, self.enters.at(i.cos_theta) * leaves * lobe * seen]
    }

    /// Returns half of the path inside the fibre of a ray refracted along it, in widths.
    #[inline]
    fn half_way(&self, w: FibreDirection) -> f32 {
        0.5 / (1.0 - w.sine * w.sine * self.inverse_index_squared).sqrt()
    }

    /// Returns the tabulated directional albedo.
    #[inline]
    fn albedo_at(&self, w: FibreDirection) -> [f32; 2] {
        let last = (ALBEDO_ENTRIES - 1) as f32;
        let (x, y) = (w.cos_phi * last, w.sine.abs() * last);
        let (column, row) = ((x as usize).min(ALBEDO_ENTRIES - 2), (y as usize).min(ALBEDO_ENTRIES - 2));
        let (fx, fy) = (x - column as f32, y - row as f32);
        let first = row * ALBEDO_ENTRIES + column;
        let [a, b] = [&self.albedo[first..first + 2], &self.albedo[first + ALBEDO_ENTRIES..first + ALBEDO_ENTRIES + 2]];
        std::array::from_fn(|k| {
            (a[0][k] * (1.0 - fx) + a[1][k] * fx) * (1.0 - fy) + (b[0][k] * (1.0 - fx) + b[1][k] * fx) * fy
        })
    }

    /// Returns the share of the light from `incoming` that one scattering of white fibres sends out.
    fn directional_albedo(&self, incoming: FibreDirection) -> [f32; 2] {
        let wi = vector_of(incoming, 1.0);
        let mut sum = [0f64; 2];
        for (out, weight) in hemisphere() {
            for sign in [-1.0, 1.0] {
                let pair = FibrePair::new(self, wi, vector_of(out, sign));
                let leaves = self.enters.at(out.cos_theta) * self.inverse_enters_at_0;
                let scattered = self.scattered(&pair, leaves, incoming, out);
                for (sum, scattered) in sum.iter_mut().zip(scattered) {
                    *sum += f64::from(scattered) * weight;
                }
            }
        }
        sum.map(|sum| sum as f32)
    }

    fn mean_of_table(&self) -> [f64; 2] {
        let mut sum = [0f64; 2];
        for (w, weight) in hemisphere() {
            for (sum, albedo) in sum.iter_mut().zip(self.albedo_at(w)) {
                *sum += 2.0 * f64::from(albedo) * weight / PI;
            }
        }
        sum
    }
}

/// Returns the two-stream reflectance of a deep pad of fibres of an optical depth [Hapke 1981].
#[inline]
fn deep_reflectance(depth: f32) -> f32 {
    let q = (1.0 - (-depth).exp()).max(0.0).sqrt();
    (1.0 - q) / (1.0 + q)
}

fn direction_of(sine: f32, cos_phi: f32) -> FibreDirection {
    FibreDirection { sine, cos_theta: (1.0 - sine * sine).sqrt().max(MIN_COS_THETA), cos_phi }
}

/// Returns the vector of a direction about the tangent x and the normal z, to the side of y that `sign` says.
fn vector_of(w: FibreDirection, sign: f32) -> [f32; 3] {
    let sin_phi = (1.0 - w.cos_phi * w.cos_phi).max(0.0).sqrt();
    [w.sine, sign * w.cos_theta * sin_phi, w.cos_theta * w.cos_phi]
}

/// Returns the directions over half of the hemisphere (one side of the plane of tangent and normal), with their solid
/// angle times the cosine to the normal.
fn hemisphere() -> impl Iterator<Item = (FibreDirection, f64)> {
    (0..2 * QUADRATURE * QUADRATURE).map(|i| {
        // The solid angle is dsine dphi.
        let sine = -1.0 + ((i / QUADRATURE) as f64 + 0.5) / QUADRATURE as f64;
        let phi = ((i % QUADRATURE) as f64 + 0.5) / QUADRATURE as f64 * (PI / 2.0);
        let w = direction_of(sine as f32, phi.cos() as f32);
        let area = PI / 2.0 / (QUADRATURE * QUADRATURE) as f64;
        (w, area * f64::from(w.cos_theta * w.cos_phi))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TANGENT: [f32; 3] = [1.0, 0.0, 0.0];

    fn unit(theta_deg: f32, phi_deg: f32) -> [f32; 3] {
        let ((st, ct), (sp, cp)) = (theta_deg.to_radians().sin_cos(), phi_deg.to_radians().sin_cos());
        [st * cp, st * sp, ct]
    }

    fn pi_brdf_cos(fibre: &Fibre, depth: [f32; 3], wi: [f32; 3], wo: [f32; 3]) -> [f32; 3] {
        let view = fibre.view(FibreDirection::new(wo, TANGENT, wo[2]), depth);
        fibre.pi_brdf_cos(&FibrePair::new(fibre, wi, wo), &view, FibreDirection::new(wi, TANGENT, wi[2]))
    }

    /// Returns the share of the light from `wi` that leaves, by even steps of polar angle and azimuth, which is another
    /// quadrature than that of the tables.
    fn albedo(fibre: &Fibre, depth: [f32; 3], wi: [f32; 3]) -> [f64; 3] {
        let steps = 90;
        let mut sum = [0f64; 3];
        for i in 0..steps {
            let theta = (i as f64 + 0.5) / steps as f64 * 90.0;
            for j in 0..4 * steps {
                let wo = unit(theta as f32, (j as f32 + 0.5) / steps as f32 * 90.0);
                let weight = (PI / 2.0 / steps as f64).powi(2) * theta.to_radians().sin() * f64::from(wo[2]) / PI;
                for (sum, value) in sum.iter_mut().zip(pi_brdf_cos(fibre, depth, wi, wo)) {
                    *sum += f64::from(value) / f64::from(wi[2]) * weight;
                }
            }
        }
        sum
    }

    #[test]
    fn white_fibres_give_back_all_light_and_dyed_ones_less() {
        for params in [
            FibreParams::default(),
            FibreParams { surface_width_deg: 6.0, volume_width_deg: 12.0, even_share: 0.0, ..FibreParams::default() },
            FibreParams { index: 1.3, even_share: 1.0, correlation_deg: 60.0, ..FibreParams::default() },
        ] {
            let fibre = Fibre::new(&params).unwrap();
            for wi in [unit(0.0, 0.0), unit(35.0, 0.0), unit(60.0, 90.0), unit(75.0, 30.0), unit(82.0, 200.0)] {
                let [white, grey, black] = albedo(&fibre, [0.0, 0.3, 9.0], wi);
                assert!((white - 1.0).abs() < 5e-3, "{params:?} {wi:?}: {white}");
                assert!(grey < 0.7 && black < 0.4 && black < grey, "{grey} {black}");
            }
        }
    }

    #[test]
    fn no_fibre_sends_out_more_than_it_takes_in_at_any_angle() {
        let fibre = Fibre::new(&FibreParams::default()).unwrap();
        for entry in &fibre.albedo {
            assert!(entry[0] >= 0.0 && entry[1] >= 0.0 && entry[0] + entry[1] <= 1.0, "{entry:?}");
        }
    }

    #[test]
    fn swapping_light_and_view_changes_nothing() {
        let fibre = Fibre::new(&FibreParams::default()).unwrap();
        for (a, b) in [((10.0, 0.0), (70.0, 200.0)), ((45.0, 20.0), (60.0, 190.0)), ((80.0, 85.0), (5.0, 90.0))] {
            let (a, b) = (unit(a.0, a.1), unit(b.0, b.1));
            let (forward, backward) = (pi_brdf_cos(&fibre, [0.1; 3], a, b), pi_brdf_cos(&fibre, [0.1; 3], b, a));
            let (forward, backward) = (forward[0] / a[2], backward[0] / b[2]);
            assert!((forward - backward).abs() < 1e-4 * forward, "{forward} {backward}");
        }
    }

    #[test]
    fn the_highlight_is_a_band_across_the_fibre() {
        let fibre = Fibre::new(&FibreParams::default()).unwrap();
        let dark = |wi, wo| pi_brdf_cos(&fibre, [9.0; 3], wi, wo)[0];
        // Light from above: views turned about the fibre keep the highlight, views along it lose it.
        let (middle, across, along) = (
            dark(unit(0.0, 0.0), unit(0.0, 0.0)),
            dark(unit(0.0, 0.0), unit(50.0, 90.0)),
            dark(unit(0.0, 0.0), unit(50.0, 0.0)),
        );
        assert!(across > 0.25 * middle && along < 0.05 * across, "{middle} {across} {along}");
        // Light along the fibre at 50 degrees is reflected to the mirror angle, not back.
        assert!(dark(unit(50.0, 0.0), unit(50.0, 180.0)) > 20.0 * dark(unit(50.0, 0.0), unit(50.0, 0.0)));
    }

    #[test]
    fn a_colour_is_the_albedo_of_the_dye_that_is_found_for_it() {
        let fibre = Fibre::new(&FibreParams::default()).unwrap();
        let colour = [0.1, 0.4, 0.8];
        let depth = fibre.depth_from_albedo(colour);
        assert!(depth[0] > depth[1] && depth[1] > depth[2]);
        // The mean over directions of light, by six cosine-weighted rings.
        let mut mean = [0f64; 3];
        for i in 0..6 {
            let theta = (((f64::from(i) + 0.5) / 6.0).sqrt().asin()).to_degrees() as f32;
            for phi in [10.0, 35.0, 60.0, 85.0] {
                for (mean, albedo) in mean.iter_mut().zip(albedo(&fibre, depth, unit(theta, phi))) {
                    *mean += albedo / 24.0;
                }
            }
        }
        for (mean, colour) in mean.iter().zip(colour) {
            assert!((mean - colour).abs() < 0.02, "{mean} {colour}");
        }
        assert_eq!(fibre.depth_from_albedo([0.0; 3])[0], MAX_OPTICAL_DEPTH as f32);
    }

    #[test]
    fn shading_is_finite_at_the_horizon_and_along_the_fibre() {
        let fibre = Fibre::new(&FibreParams::default()).unwrap();
        for wi in [unit(89.99, 0.0), unit(89.99, 90.0), unit(0.0, 0.0), [1.0, 0.0, 1e-7]] {
            for wo in [unit(89.99, 180.0), unit(89.99, 90.0), unit(0.0, 0.0), [1.0, 0.0, 1e-7]] {
                let value = pi_brdf_cos(&fibre, [0.0, 1.0, 9.0], wi, wo);
                assert!(value.iter().all(|v| v.is_finite() && *v >= 0.0 && *v < 50.0), "{wi:?} {wo:?}: {value:?}");
            }
        }
    }
}
