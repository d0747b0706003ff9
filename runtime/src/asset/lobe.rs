//! The nine lobe families: `pi * BRDF * max(0, n.wi)` of an analytic reflection model about a rotated
//! normal. Twin: `shaders/lobe.wgsl`. Equations and symbols: docs/reference/model.md, section 3.
//!
//! The seven families of [Wu 2011] (Lambertian, Oren-Nayar, Blinn-Phong, Ward, Cook-Torrance, Lafortune,
//! Ashikhmin-Shirley), GGX [Walter 2007] and a view-windowed cosine that absorbs masking and parallax.
//! Every lobe is finite for every pair of unit vectors: `n.wo` is clamped from below at [`MIN_COS_VIEW`].

use crate::numeric::power::{exp, exp2, log2};
use crate::numeric::quantize::{half_at, word_from_halves};
use std::f32::consts::{PI, TAU};

/// Lower clamp of `n.wo` where a model divides by it (tilted normals see the eye below their horizon).
pub const MIN_COS_VIEW: f32 = 0.02;
/// Lower clamp of `v.h` and of the half vector's length.
pub const MIN_HALF: f32 = 1e-3;
/// Words of a lobe in the file form.
pub const FILE_WORDS: usize = 5;
/// Words of a lobe in the resident form.
pub const RESIDENT_WORDS: usize = 16;
/// A lobe as the resident form has it.
pub type ResidentLobe = [u32; RESIDENT_WORDS];

/// A reflection model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum LobeFamily {
    /// `max(0, n.wi)`; no parameters.
    Lambertian = 0,
    /// [Oren 1994], qualitative model; `p0` = sigma, 0 to 1.5 rad.
    OrenNayar = 1,
    /// [Blinn 1977], normalised by `(s + 8) / 8`; `p0` = exponent s, 1 to 1000.
    BlinnPhong = 2,
    /// [Ward 1992], anisotropic; `p0`, `p1` = slopes along tangent and bitangent, 0.05 to 1.
    Ward = 3,
    /// [Cook 1982] with Beckmann D, V-cavity G, Schlick F; `p0` = slope m, 0.05 to 1; `p1` = F0, 0 to 1.
    CookTorrance = 4,
    /// [Lafortune 1997]; `p0`, `p1`, `p2` = Cx, Cy, Cz, -1 to 1; `p3` = exponent, 0.5 to 500.
    Lafortune = 5,
    /// [Ashikhmin 2000], specular part; `p0`, `p1` = exponents nu, nv, 1 to 1000; `p2` = Rs, 0 to 1.
    AshikhminShirley = 6,
    /// [Walter 2007] with height-correlated Smith G, Schlick F; `p0` = alpha, 0.05 to 1; `p1` = F0, 0 to 1.
    Ggx = 7,
    /// `max(0, n.wi) exp(k (m.wo - 1))`; `p0` = k, 0 to 60; `p1`, `p2` = m.x, m.y of the unit window axis m.
    WindowedCosine = 8,
}

impl LobeFamily {
    /// Every family, in the order of its number.
    pub const ALL: [LobeFamily; 9] = [
        LobeFamily::Lambertian,
        LobeFamily::OrenNayar,
        LobeFamily::BlinnPhong,
        LobeFamily::Ward,
        LobeFamily::CookTorrance,
        LobeFamily::Lafortune,
        LobeFamily::AshikhminShirley,
        LobeFamily::Ggx,
        LobeFamily::WindowedCosine,
    ];

    /// Allowed range `(least, most)` of each parameter; unused ones are `(0, 0)`.
    pub fn ranges(self) -> [(f32, f32); 4] {
        const NONE: (f32, f32) = (0.0, 0.0);
        match self {
            LobeFamily::Lambertian => [NONE; 4],
            LobeFamily::OrenNayar => [(0.0, 1.5), NONE, NONE, NONE],
            LobeFamily::BlinnPhong => [(1.0, 1000.0), NONE, NONE, NONE],
            LobeFamily::Ward => [(0.05, 1.0), (0.05, 1.0), NONE, NONE],
            LobeFamily::CookTorrance | LobeFamily::Ggx => [(0.05, 1.0), (0.0, 1.0), NONE, NONE],
            LobeFamily::Lafortune => [(-1.0, 1.0), (-1.0, 1.0), (-1.0, 1.0), (0.5, 500.0)],
            LobeFamily::AshikhminShirley => [(1.0, 1000.0), (1.0, 1000.0), (0.0, 1.0), NONE],
            LobeFamily::WindowedCosine => [(0.0, 60.0), (-0.98, 0.98), (-0.98, 0.98), NONE],
        }
    }

    /// The family with number `number`.
    pub fn from_number(number: u32) -> Option<LobeFamily> {
        LobeFamily::ALL.get(number as usize).copied()
    }
}

/// One rotated lobe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lobe {
    /// Reflection model.
    pub family: LobeFamily,
    /// x and y of the lobe's unit normal in the texel's frame; z is positive. `x^2 + y^2 <= 0.98`.
    pub normal_xy: [f32; 2],
    /// Rotation of the tangent about the normal, radians.
    pub tangent_rad: f32,
    /// The family's parameters, see [`LobeFamily`].
    pub params: [f32; 4],
}

impl Lobe {
    /// The lobe with parameters and normal brought into their ranges.
    pub fn clamped(mut self) -> Lobe {
        for (value, (least, most)) in self.params.iter_mut().zip(self.family.ranges()) {
            *value = if value.is_finite() { value.clamp(least, most) } else { least };
        }
        let shorten = |x: &mut f32, y: &mut f32| {
            let length2 = *x * *x + *y * *y;
            if length2.is_nan() || length2 > 0.98 {
                let scale = if length2.is_finite() { (0.97 / length2).sqrt() } else { 0.0 };
                (*x, *y) = if scale > 0.0 { (*x * scale, *y * scale) } else { (0.0, 0.0) };
            }
        };
        let [mut x, mut y] = self.normal_xy;
        shorten(&mut x, &mut y);
        self.normal_xy = [x, y];
        if self.family == LobeFamily::WindowedCosine {
            let [k, mut mx, mut my, unused] = self.params;
            shorten(&mut mx, &mut my);
            self.params = [k, mx, my, unused];
        }
        if !self.tangent_rad.is_finite() {
            self.tangent_rad = 0.0;
        } else if self.tangent_rad.abs() > PI {
            // Half precision is spent on the turn itself, not on full circles.
            self.tangent_rad = (self.tangent_rad + PI).rem_euclid(TAU) - PI;
        }
        self
    }

    /// The five words of the file form (halves), with the weight scale that travels with the lobe.
    pub fn to_words(&self, weight_scale: f32) -> [u32; FILE_WORDS] {
        let family = self.family as u32;
        let tangent = word_from_halves(0.0, self.tangent_rad) & 0xffff_0000;
        [
            family | tangent,
            word_from_halves(self.normal_xy[0], self.normal_xy[1]),
            word_from_halves(self.params[0], self.params[1]),
            word_from_halves(self.params[2], self.params[3]),
            word_from_halves(weight_scale, 0.0),
        ]
    }

    /// Lobe and weight scale from the file form; `None` where a field is out of its range.
    pub fn from_words(words: [u32; FILE_WORDS]) -> Option<(Lobe, f32)> {
        let lobe = Lobe {
            family: LobeFamily::from_number(words[0] & 0xffff)?,
            tangent_rad: half_at(words[0], 1),
            normal_xy: [half_at(words[1], 0), half_at(words[1], 1)],
            params: [half_at(words[2], 0), half_at(words[2], 1), half_at(words[3], 0), half_at(words[3], 1)],
        };
        let scale = half_at(words[4], 0);
        let [x, y] = lobe.normal_xy;
        let window2 = if lobe.family == LobeFamily::WindowedCosine {
            lobe.params[1] * lobe.params[1] + lobe.params[2] * lobe.params[2]
        } else {
            0.0
        };
        let in_range = lobe
            .params
            .iter()
            .zip(lobe.family.ranges())
            // Half precision rounds a parameter at its bound by up to 2^-11 of its size.
            .all(|(p, (least, most))| *p >= least - 1e-3 * least.abs() && *p <= most + 1e-3 * most.abs());
        let fine = in_range
            && x * x + y * y <= 0.99
            && window2 <= 0.99
            && lobe.tangent_rad.is_finite()
            && scale.is_finite()
            && scale >= 0.0
            && words[4] >> 16 == 0;
        fine.then_some((lobe, scale))
    }

    /// The lobe as the file form gives it back: fit weights against this one.
    pub fn rounded(&self) -> Lobe {
        let clamped = self.clamped();
        Lobe::from_words(clamped.to_words(0.0)).map_or(clamped, |(lobe, _)| lobe)
    }

    /// Everything that does not depend on the directions, ready for [`LobeSetup::eval`].
    pub fn setup(&self) -> LobeSetup {
        let [x, y] = self.normal_xy;
        let normal = [x, y, (1.0 - x * x - y * y).max(0.0).sqrt()];
        // A frame without a branch at the pole [Duff 2017], turned by the tangent angle.
        let a = -1.0 / (1.0 + normal[2]);
        let b = normal[0] * normal[1] * a;
        let t0 = [1.0 + normal[0] * normal[0] * a, b, -normal[0]];
        let b0 = [b, 1.0 + normal[1] * normal[1] * a, -normal[1]];
        let (sin, cos) = self.tangent_rad.sin_cos();
        let tangent = [0, 1, 2].map(|i| cos * t0[i] + sin * b0[i]);
        let [p0, p1, p2, p3] = self.params;
        let params = match self.family {
            LobeFamily::WindowedCosine => [p0, p1, p2, (1.0 - p1 * p1 - p2 * p2).max(0.0).sqrt()],
            _ => [p0, p1, p2, p3],
        };
        LobeSetup { family: self.family, normal, tangent, params }
    }
}

/// A lobe's frame and parameters, as the resident form stores them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LobeSetup {
    /// Reflection model.
    pub family: LobeFamily,
    /// Unit normal.
    pub normal: [f32; 3],
    /// Unit tangent, perpendicular to the normal.
    pub tangent: [f32; 3],
    /// Parameters; for the windowed cosine `[k, m.x, m.y, m.z]`.
    pub params: [f32; 4],
}

#[inline(always)]
pub(crate) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `base^exponent` for a base in [0, 1]; 0 stays 0 and nothing overflows.
#[inline(always)]
pub(crate) fn power(base: f32, exponent: f32) -> f32 {
    let result = exp2(exponent * log2(base));
    if base > 1e-12 { result } else { 0.0 }
}

#[inline(always)]
fn schlick(f0: f32, cos: f32) -> f32 {
    let m = 1.0 - cos.clamp(0.0, 1.0);
    f0 + (1.0 - f0) * m * m * m * m * m
}

/// The half vector's products with a lobe's frame.
struct HalfVector {
    nh: f32,
    th: f32,
    bh: f32,
    vh: f32,
}

#[inline(always)]
fn half_vector(lobe: &LobeSetup, wi: [f32; 3], wo: [f32; 3]) -> HalfVector {
    let sum = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
    let length = dot(sum, sum).sqrt().max(MIN_HALF);
    let h = [sum[0] / length, sum[1] / length, sum[2] / length];
    let bitangent = cross(lobe.normal, lobe.tangent);
    HalfVector {
        nh: dot(lobe.normal, h).clamp(0.0, 1.0),
        th: dot(lobe.tangent, h),
        bh: dot(bitangent, h),
        vh: dot(wo, h).clamp(MIN_HALF, 1.0),
    }
}

impl LobeSetup {
    /// `pi * BRDF * max(0, n.wi)` for unit `wi` (to the light) and `wo` (to the eye) in the texel's frame.
    /// Finite and at least 0; 0 where the light is below the lobe's own horizon.
    pub fn eval(&self, wi: [f32; 3], wo: [f32; 3]) -> f32 {
        let ci = dot(self.normal, wi);
        if ci <= 0.0 {
            return 0.0;
        }
        match self.family {
            LobeFamily::Lambertian => ci,
            LobeFamily::OrenNayar => self.oren_nayar(ci, wi, wo),
            LobeFamily::BlinnPhong => self.blinn_phong(ci, wi, wo),
            LobeFamily::Ward => self.ward(ci, wi, wo),
            LobeFamily::CookTorrance => self.cook_torrance(ci, wi, wo),
            LobeFamily::Lafortune => self.lafortune(ci, wi, wo),
            LobeFamily::AshikhminShirley => self.ashikhmin_shirley(ci, wi, wo),
            LobeFamily::Ggx => self.ggx(ci, wi, wo),
            LobeFamily::WindowedCosine => self.windowed_cosine(ci, wo),
        }
    }

    #[inline(always)]
    fn cos_view(&self, wo: [f32; 3]) -> f32 {
        dot(self.normal, wo).max(MIN_COS_VIEW)
    }

    #[inline(always)]
    pub(crate) fn oren_nayar(&self, ci: f32, wi: [f32; 3], wo: [f32; 3]) -> f32 {
        let co = self.cos_view(wo);
        let s2 = self.params[0] * self.params[0];
        let a = 1.0 - 0.5 * s2 / (s2 + 0.33);
        let b = 0.45 * s2 / (s2 + 0.09);
        // cos(dphi) sin(alpha) tan(beta) without trigonometry: both sines over the larger cosine.
        let s = (dot(wi, wo) - ci * co).max(0.0);
        ci * (a + b * s / ci.max(co))
    }

    #[inline(always)]
    pub(crate) fn blinn_phong(&self, ci: f32, wi: [f32; 3], wo: [f32; 3]) -> f32 {
        let h = half_vector(self, wi, wo);
        ci * (self.params[0] + 8.0) * 0.125 * power(h.nh, self.params[0])
    }

    #[inline(always)]
    pub(crate) fn ward(&self, ci: f32, wi: [f32; 3], wo: [f32; 3]) -> f32 {
        let h = half_vector(self, wi, wo);
        let (ax, ay) = (self.params[0], self.params[1]);
        let nh2 = (h.nh * h.nh).max(1e-6);
        let (x, y) = (h.th / ax, h.bh / ay);
        let e = exp((-(x * x + y * y) / nh2).max(-80.0));
        (ci / self.cos_view(wo)).sqrt() * e / (4.0 * ax * ay)
    }

    #[inline(always)]
    pub(crate) fn cook_torrance(&self, ci: f32, wi: [f32; 3], wo: [f32; 3]) -> f32 {
        let h = half_vector(self, wi, wo);
        let co = self.cos_view(wo);
        let m2 = self.params[0] * self.params[0];
        let c2 = (h.nh * h.nh).max(1e-6);
        // pi D of Beckmann.
        let d = exp(((c2 - 1.0) / (m2 * c2)).max(-80.0)) / (m2 * c2 * c2);
        let g = (2.0 * h.nh * ci.min(co) / h.vh).min(1.0);
        schlick(self.params[1], h.vh) * d * g / (4.0 * co)
    }

    #[inline(always)]
    pub(crate) fn lafortune(&self, ci: f32, wi: [f32; 3], wo: [f32; 3]) -> f32 {
        let bitangent = cross(self.normal, self.tangent);
        let base = self.params[0] * dot(self.tangent, wi) * dot(self.tangent, wo)
            + self.params[1] * dot(bitangent, wi) * dot(bitangent, wo)
            + self.params[2] * ci * dot(self.normal, wo);
        ci * power(base.clamp(0.0, 1.0), self.params[3])
    }

    #[inline(always)]
    pub(crate) fn ashikhmin_shirley(&self, ci: f32, wi: [f32; 3], wo: [f32; 3]) -> f32 {
        let h = half_vector(self, wi, wo);
        let (nu, nv) = (self.params[0], self.params[1]);
        let s2 = (1.0 - h.nh * h.nh).max(1e-6);
        let exponent = (nu * h.th * h.th + nv * h.bh * h.bh) / s2;
        let norm = ((nu + 1.0) * (nv + 1.0)).sqrt() * 0.125;
        ci * norm * power(h.nh, exponent) * schlick(self.params[2], h.vh) / (h.vh * ci.max(self.cos_view(wo)))
    }

    #[inline(always)]
    pub(crate) fn ggx(&self, ci: f32, wi: [f32; 3], wo: [f32; 3]) -> f32 {
        let h = half_vector(self, wi, wo);
        let co = self.cos_view(wo);
        let a2 = self.params[0] * self.params[0];
        let q = h.nh * h.nh * (a2 - 1.0) + 1.0;
        let d = a2 / (q * q).max(1e-12);
        let v = 0.5 / (ci * (co * co * (1.0 - a2) + a2).sqrt() + co * (ci * ci * (1.0 - a2) + a2).sqrt());
        schlick(self.params[1], h.vh) * d * v * ci
    }

    #[inline(always)]
    pub(crate) fn windowed_cosine(&self, ci: f32, wo: [f32; 3]) -> f32 {
        let m = [self.params[1], self.params[2], self.params[3]];
        ci * exp((self.params[0] * (dot(m, wo) - 1.0)).max(-80.0))
    }

    /// The words of the resident form.
    pub fn to_resident_words(&self, weight_scale: f32) -> ResidentLobe {
        let mut words = [0; RESIDENT_WORDS];
        words[0] = self.family as u32;
        for i in 0..3 {
            words[1 + i] = self.normal[i].to_bits();
            words[4 + i] = self.tangent[i].to_bits();
        }
        for i in 0..4 {
            words[7 + i] = self.params[i].to_bits();
        }
        words[11] = weight_scale.to_bits();
        words
    }

    /// The setup in the resident form.
    pub fn from_resident_words(words: &ResidentLobe) -> LobeSetup {
        let at = |i: usize| f32::from_bits(words[i]);
        LobeSetup {
            family: lobe_family(words),
            normal: [at(1), at(2), at(3)],
            tangent: [at(4), at(5), at(6)],
            params: [at(7), at(8), at(9), at(10)],
        }
    }
}

/// The family in the resident form.
pub(crate) fn lobe_family(words: &ResidentLobe) -> LobeFamily {
    LobeFamily::from_number(words[0]).unwrap_or(LobeFamily::Lambertian)
}

/// The weight scale in the resident form.
pub(crate) fn weight_scale(words: &ResidentLobe) -> f32 {
    f32::from_bits(words[11])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, direction_from_degrees, random_lobe};

    fn lobe(family: LobeFamily, params: [f32; 4]) -> Lobe {
        Lobe { family, normal_xy: [0.0; 2], tangent_rad: 0.3, params }
    }

    fn rotate_z(v: [f32; 3], angle_rad: f32) -> [f32; 3] {
        let (sin, cos) = angle_rad.sin_cos();
        [cos * v[0] - sin * v[1], sin * v[0] + cos * v[1], v[2]]
    }

    fn close(a: f32, b: f32) -> bool {
        (a - b).abs() <= 1e-3 * a.max(b) + 1e-6
    }

    /// `pi * BRDF`: the value without the light's cosine.
    fn brdf(setup: &LobeSetup, wi: [f32; 3], wo: [f32; 3]) -> f32 {
        setup.eval(wi, wo) / dot(setup.normal, wi)
    }

    /// Share of a white sky that reaches the eye: `1 / pi` of the value's integral over all lights,
    /// by the midpoint rule on half-degree by degree cells.
    fn albedo(setup: &LobeSetup, wo: [f32; 3]) -> f64 {
        let (rows, columns) = (180, 360);
        let (step_theta, step_phi) = (90.0 / f64::from(rows), 360.0 / f64::from(columns));
        let mut sum = 0.0;
        for i in 0..rows {
            let theta = (f64::from(i) + 0.5) * step_theta;
            let ring: f64 = (0..columns)
                .map(|j| {
                    let wi = direction_from_degrees(theta, (f64::from(j) + 0.5) * step_phi);
                    f64::from(setup.eval(wi, wo))
                })
                .sum();
            sum += ring * theta.to_radians().sin();
        }
        sum * step_theta.to_radians() * step_phi.to_radians() / std::f64::consts::PI
    }

    fn largest_albedo(setup: &LobeSetup) -> f64 {
        [0.0, 20.0, 40.0, 55.0, 65.0, 75.0, 80.0, 85.0, 88.0]
            .map(|theta| albedo(setup, direction_from_degrees(theta, 37.0)))
            .into_iter()
            .fold(0.0, f64::max)
    }

    #[test]
    fn every_lobe_is_finite_and_not_negative_for_any_pair_of_directions() {
        let mut random = Random::new(1);
        for family in LobeFamily::ALL {
            for _ in 0..2000 {
                let setup = random_lobe(&mut random, family).setup();
                let mut pairs = Vec::new();
                for _ in 0..6 {
                    let (mut wi, mut wo) = (random.direction(), random.direction());
                    pairs.push((wi, wo));
                    // Below the macroscopic horizon, and grazing.
                    wo[2] = -wo[2];
                    pairs.push((wi, wo));
                    wi = direction_from_degrees(90.0 - f64::from(random.within(0.0, 0.01)), wi[0].into());
                    pairs.push((wi, wo));
                    // Opposite directions have no half vector, equal ones no angle.
                    pairs.push((wi, wi.map(|x| -x)));
                    pairs.push((wi, wi));
                }
                pairs.push((setup.normal, setup.normal));
                for (wi, wo) in pairs {
                    let value = setup.eval(wi, wo);
                    assert!(value.is_finite() && value >= 0.0, "{setup:?} {wi:?} {wo:?}: {value}");
                    assert!(value == 0.0 || dot(setup.normal, wi) > 0.0);
                }
            }
        }
    }

    #[test]
    fn every_family_but_the_windowed_cosine_is_reciprocal_where_no_clamp_acts() {
        let mut random = Random::new(2);
        for family in LobeFamily::ALL {
            let (mut compared, mut unequal) = (0, 0);
            while compared < 3000 {
                let setup = random_lobe(&mut random, family).setup();
                let (wi, wo) = (random.direction(), random.direction());
                // Below MIN_COS_VIEW the eye's cosine is clamped and the light's is not: exchanging the two
                // then changes the value of every model that divides by them.
                if dot(setup.normal, wi).min(dot(setup.normal, wo)) < MIN_COS_VIEW {
                    continue;
                }
                compared += 1;
                if !close(brdf(&setup, wi, wo), brdf(&setup, wo, wi)) {
                    unequal += 1;
                }
            }
            if family == LobeFamily::WindowedCosine {
                assert!(unequal > 1000, "the comparison must see that a window on the eye is not reciprocal");
            } else {
                assert_eq!(unequal, 0, "{family:?}");
            }
        }
        // What the clamp costs: half a degree above the horizon, exchanged directions differ.
        let setup = lobe(LobeFamily::Ggx, [0.3, 1.0, 0.0, 0.0]).setup();
        let (steep, grazing) = (direction_from_degrees(60.0, 0.0), direction_from_degrees(89.5, 180.0));
        assert!(!close(brdf(&setup, steep, grazing), brdf(&setup, grazing, steep)));
    }

    #[test]
    fn turning_lobe_light_and_eye_together_changes_nothing() {
        let mut random = Random::new(3);
        for family in LobeFamily::ALL {
            let mut seen = 0;
            for _ in 0..2000 {
                let lobe = random_lobe(&mut random, family);
                let (wi, wo, angle) = (random.direction(), random.direction(), random.within(-3.0, 3.0));
                let turn = |x: f32, y: f32| {
                    let [x, y, _] = rotate_z([x, y, 0.0], angle);
                    [x, y]
                };
                let mut turned = lobe;
                turned.normal_xy = turn(lobe.normal_xy[0], lobe.normal_xy[1]);
                // The frame is the least rotation that brings z to the normal, so the tangent takes the turn.
                turned.tangent_rad += angle;
                if family == LobeFamily::WindowedCosine {
                    [turned.params[1], turned.params[2]] = turn(lobe.params[1], lobe.params[2]);
                }
                let (here, there) =
                    (lobe.setup().eval(wi, wo), turned.setup().eval(rotate_z(wi, angle), rotate_z(wo, angle)));
                assert!((here - there).abs() <= 3e-3 * here.max(there) + 1e-5, "{lobe:?}: {here} {there}");
                // Planted difference: a tangent left behind shows in the families that have one.
                turned.tangent_rad = lobe.tangent_rad;
                let left_behind = turned.setup().eval(rotate_z(wi, angle), rotate_z(wo, angle));
                seen += u32::from((here - left_behind).abs() > 3e-3 * here.max(left_behind) + 1e-5);
            }
            let has_tangent = [LobeFamily::Ward, LobeFamily::Lafortune, LobeFamily::AshikhminShirley];
            assert_eq!(seen > 100, has_tangent.contains(&family), "{family:?}: {seen}");
        }
    }

    #[test]
    fn no_lobe_returns_more_light_than_its_definition_allows() {
        use LobeFamily::*;
        // With F0 = 1 or no Fresnel term at all; 0.2 % is the quadrature's error at roughness 0.05.
        const UNIT: f64 = 1.002;
        let check = |family: LobeFamily, params: [f32; 4], limit: f64| {
            let most = largest_albedo(&lobe(family, params).setup());
            assert!(most <= limit, "{family:?} {params:?}: {most} is above {limit}");
            most
        };
        for roughness in [0.05, 0.1, 0.25, 0.5, 1.0] {
            check(CookTorrance, [roughness, 1.0, 0.0, 0.0], UNIT);
            check(Ggx, [roughness, 1.0, 0.0, 0.0], UNIT);
            check(Ward, [roughness, roughness, 0.0, 0.0], UNIT);
            check(Ward, [roughness, 0.3, 0.0, 0.0], UNIT);
        }
        for exponent in [1.0, 10.0, 100.0, 1000.0] {
            check(AshikhminShirley, [exponent, exponent, 1.0, 0.0], UNIT);
            check(AshikhminShirley, [exponent, 10.0, 1.0, 0.0], UNIT);
            // The usual (s + 8) / 8 approximates the norm from above, by up to 7.5 % near s = 10.
            check(BlinnPhong, [exponent, 0.0, 0.0, 0.0], 1.08);
        }
        // The qualitative model overshoots a little at grazing angles for small sigma.
        for sigma in [0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0, 1.5] {
            check(OrenNayar, [sigma, 0.0, 0.0, 0.0], 1.02);
        }
        // Never above the cosine itself.
        check(Lambertian, [0.0; 4], UNIT);
        check(Lafortune, [-1.0, -1.0, 1.0, 0.5], UNIT);
        check(WindowedCosine, [0.0; 4], UNIT);

        // The norms are right, not merely small: a narrow peak sends everything back ...
        for (family, params) in [
            (Lambertian, [0.0; 4]),
            (BlinnPhong, [1000.0, 0.0, 0.0, 0.0]),
            (Ward, [0.05, 0.05, 0.0, 0.0]),
            (CookTorrance, [0.05, 1.0, 0.0, 0.0]),
            (AshikhminShirley, [1000.0, 1000.0, 1.0, 0.0]),
            (Ggx, [0.05, 1.0, 0.0, 0.0]),
        ] {
            let upright = albedo(&lobe(family, params).setup(), [0.0, 0.0, 1.0]);
            assert!((0.98..=1.01).contains(&upright), "{family:?}: {upright}");
        }
        // ... and the Schlick term scales it: planted, F0 = 0.5 must not pass for 1.
        let halved = albedo(&lobe(Ggx, [0.05, 0.5, 0.0, 0.0]).setup(), [0.0, 0.0, 1.0]);
        assert!((halved - 0.5).abs() < 0.02, "{halved}");
    }

    #[test]
    fn a_lobe_falls_off_from_its_peak_and_narrows_as_it_sharpens() {
        use LobeFamily::*;
        let up = [0.0, 0.0, 1.0];
        let value = |setup: &LobeSetup, theta: f64| setup.eval(direction_from_degrees(theta, 20.0), up);
        // Up to rounding, which shows where the peak is flat, and to what is left where exp is clamped.
        let falls = |setup: &LobeSetup| {
            let at = |i: i32| value(setup, f64::from(i) * 0.1);
            (0..900).all(|i| at(i + 1) <= at(i) * (1.0 + 1e-5) + 1e-20)
        };
        for (family, blunt, sharp) in [
            (OrenNayar, [0.0; 4], [1.5, 0.0, 0.0, 0.0]),
            (BlinnPhong, [1.0, 0.0, 0.0, 0.0], [1000.0, 0.0, 0.0, 0.0]),
            (Ward, [1.0, 1.0, 0.0, 0.0], [0.05, 0.05, 0.0, 0.0]),
            // Beckmann's D peaks at the normal up to m = 1 / sqrt 2 only.
            (CookTorrance, [0.6, 1.0, 0.0, 0.0], [0.05, 1.0, 0.0, 0.0]),
            (Lafortune, [-1.0, -1.0, 1.0, 0.5], [-1.0, -1.0, 1.0, 500.0]),
            (AshikhminShirley, [1.0, 1.0, 1.0, 0.0], [1000.0, 1000.0, 1.0, 0.0]),
            (Ggx, [1.0, 1.0, 0.0, 0.0], [0.05, 1.0, 0.0, 0.0]),
            (WindowedCosine, [0.0; 4], [60.0, 0.0, 0.0, 0.0]),
        ] {
            let [blunt, sharp] = [blunt, sharp].map(|params| lobe(family, params).setup());
            assert!(falls(&blunt) && falls(&sharp), "{family:?}");
            if ![OrenNayar, WindowedCosine].contains(&family) {
                let rest = |setup: &LobeSetup| value(setup, 40.0) / value(setup, 0.0);
                assert!(rest(&sharp) < 0.2 * rest(&blunt), "{family:?}");
            }
        }
        // A window narrows in the eye's angle, not the light's.
        let window = lobe(WindowedCosine, [60.0, 0.0, 0.0, 0.0]).setup();
        assert!(window.eval(up, direction_from_degrees(30.0, 0.0)) < 0.01 * window.eval(up, up));
        // Planted difference: past the Beckmann bound the comparison sees the dip at the normal.
        assert!(!falls(&lobe(CookTorrance, [1.0, 1.0, 0.0, 0.0]).setup()));
    }

    #[test]
    fn a_lobe_survives_its_file_words() {
        let mut random = Random::new(5);
        for family in LobeFamily::ALL {
            for _ in 0..500 {
                let lobe = random_lobe(&mut random, family);
                let (back, scale) = Lobe::from_words(lobe.to_words(0.375)).unwrap();
                assert_eq!((back, scale), (lobe, 0.375), "an already rounded lobe comes back bit by bit");
                assert_eq!(lobe.rounded(), lobe);
                let words = lobe.setup().to_resident_words(0.375);
                let (setup, scale) = (LobeSetup::from_resident_words(&words), weight_scale(&words));
                assert_eq!((setup, scale), (lobe.setup(), 0.375));
            }
            // Anything at all can be clamped into the file's ranges.
            for wild in [f32::NAN, f32::INFINITY, -1e30, 1e30, 7.0, -0.5] {
                let wild = Lobe { family, normal_xy: [wild, 0.4], tangent_rad: wild, params: [wild; 4] };
                let words = wild.clamped().to_words(1.0);
                assert!(Lobe::from_words(words).is_some(), "{wild:?} -> {:?}", wild.clamped());
            }
        }
        let turned = Lobe { tangent_rad: 1e5, ..lobe(LobeFamily::Ward, [0.1, 0.4, 0.0, 0.0]) };
        let (a, b) = (turned.setup(), turned.rounded().setup());
        assert!((0..3).all(|i| (a.tangent[i] - b.tangent[i]).abs() < 0.01), "full circles do not count: {a:?} {b:?}");
    }

    #[test]
    fn every_lobe_word_out_of_its_range_is_refused() {
        for family in LobeFamily::ALL {
            let params = family.ranges().map(|(least, most)| 0.5 * (least + most));
            let good = Lobe { family, normal_xy: [0.1, -0.2], tangent_rad: 0.5, params };
            assert!(Lobe::from_words(good.to_words(1.0)).is_some(), "the control must pass");
            let refused = |bad: Lobe, scale: f32, what: &str| {
                assert!(Lobe::from_words(bad.to_words(scale)).is_none(), "{family:?}: {what} must be refused");
            };
            for (i, (least, most)) in family.ranges().into_iter().enumerate() {
                for value in
                    [least - 0.01 - 0.01 * least.abs(), most + 0.01 + 0.01 * most.abs(), f32::NAN, f32::INFINITY]
                {
                    let mut bad = good;
                    bad.params[i] = value;
                    refused(bad, 1.0, &format!("parameter {i} = {value}"));
                }
            }
            for xy in [[1.0, 0.0], [0.8, 0.8], [f32::NAN, 0.0], [0.0, f32::INFINITY]] {
                refused(Lobe { normal_xy: xy, ..good }, 1.0, "a normal at or below the horizon");
            }
            for tangent_rad in [f32::NAN, f32::INFINITY] {
                refused(Lobe { tangent_rad, ..good }, 1.0, "a tangent that is no angle");
            }
            for scale in [-1.0, f32::NAN, f32::INFINITY] {
                refused(good, scale, "a weight scale below 0 or not finite");
            }
            let mut words = good.to_words(1.0);
            words[4] |= 1 << 16;
            assert!(Lobe::from_words(words).is_none(), "the reserved half must be 0");
            let mut words = good.to_words(1.0);
            words[0] = words[0] & 0xffff_0000 | 9;
            assert!(Lobe::from_words(words).is_none(), "there are nine families");
        }
        let window = lobe(LobeFamily::WindowedCosine, [5.0, 0.9, 0.9, 0.0]);
        assert!(Lobe::from_words(window.to_words(1.0)).is_none(), "the window's axis must be above the horizon");
    }
}
