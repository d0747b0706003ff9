//! The nine lobe families: `pi * BRDF * max(0, n.wi)` of an analytic reflection model about a rotated normal. Twin:
//! `asset/lobe.wgsl`. Equations and symbols: docs/reference/model.md, section 3.
//!
//! The seven families of [Wu 2011] (Lambertian, Oren-Nayar, Blinn-Phong, Ward, Cook-Torrance, Lafortune,
//! Ashikhmin-Shirley), GGX [Walter 2007] and a view-windowed cosine that absorbs masking and parallax. Every lobe is
//! finite for every pair of unit vectors: `n.wo` is clamped from below at [`MIN_COS_VIEW`].

use crate::numeric::power::{exp, exp2, log2};
use crate::numeric::quantize::{half_at, word_from_halves};
use crate::numeric::vector::{cross, dot};
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

    /// Returns the allowed range `(least, most)` of each parameter; unused ones are `(0, 0)`.
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

    /// Returns the family with a number; `None` for an unknown one.
    pub fn from_number(number: u32) -> Option<LobeFamily> {
        LobeFamily::ALL.get(number as usize).copied()
    }
}

/// A lobe: a reflection model with its parameters and its rotated frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lobe {
    /// Reflection model.
    pub family: LobeFamily,
    /// Coordinates x and y of the lobe's unit normal in the texel's frame; z is positive. `x^2 + y^2 <= 0.98`.
    pub normal_xy: [f32; 2],
    /// Rotation of the tangent about the normal, radians.
    pub tangent_rad: f32,
    /// Parameters of the family, see [`LobeFamily`].
    pub params: [f32; 4],
}

impl Lobe {
    /// Returns the lobe with parameters and normal clamped to their ranges.
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

    /// Returns the five words of the file form (halves), which include the weight scale of the dictionary's entry.
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

    /// Reads lobe and weight scale from the file form; `None` where a field is out of its range.
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

    /// Returns the lobe after a round trip through the file form. Weights must be fitted against this lobe, because the
    /// file form rounds.
    pub fn rounded(&self) -> Lobe {
        let clamped = self.clamped();
        Lobe::from_words(clamped.to_words(0.0)).map_or(clamped, |(lobe, _)| lobe)
    }

    /// Computes everything that does not depend on the directions, for [`LobeSetup::eval`].
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

/// The frame and the parameters of a lobe, as the resident form stores them.
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

/// Returns `base^exponent` for a base in [0, 1]; 0 stays 0 and nothing overflows.
#[inline(always)]
pub(crate) fn power(base: f32, exponent: f32) -> f32 {
    let result = exp2(exponent * log2(base));
    if base > 1e-12 { result } else { 0.0 }
}

#[inline(always)]
pub(crate) fn schlick(f0: f32, cos: f32) -> f32 {
    let m = 1.0 - cos.clamp(0.0, 1.0);
    f0 + (1.0 - f0) * m * m * m * m * m
}

/// Products of the half vector with a lobe's frame: `n.h`, `t.h`, `b.h`, and `v.h` with the direction to the eye.
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
    /// Returns `pi * BRDF * max(0, n.wi)` for unit `wi` (to the light) and `wo` (to the eye) in the texel's frame. The
    /// result is finite and at least 0; it is 0 where the light is below the lobe's own horizon.
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

    /// Returns the words of the resident form.
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

    /// Reads the setup from the resident form.
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

/// Reads the family from the resident form.
pub(crate) fn lobe_family(words: &ResidentLobe) -> LobeFamily {
    LobeFamily::from_number(words[0]).unwrap_or(LobeFamily::Lambertian)
}

/// Reads the weight scale from the resident form.
pub(crate) fn weight_scale(words: &ResidentLobe) -> f32 {
    f32::from_bits(words[11])
}

#[cfg(test)]
mod tests;
