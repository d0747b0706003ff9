//! The gloss of a leaf's face: Cook-Torrance with Beckmann facets of two roughnesses, and the share of light that it
//! reflects. Twin: `leaf/lobe.wgsl`.
//!
//! `f_s = F D G / (4 cos_i cos_o)`, `D = exp(-((h_along / gamma_along)^2 + (h_across / gamma_across)^2) / (n.h)^2) /
//! (pi gamma_along gamma_across (n.h)^4)`, V-cavity G, F at wo.h [Cook & Torrance 1982; Ward 1992; Comar 2014]. Differs
//! from [Miao, eq. 7], which lacks the 1/4, takes F at n.h and misprints G.

use crate::leaf::words::{ALBEDO_AT, ALBEDO_COLUMNS, ALBEDO_ROWS};
use crate::numeric::vector::dot;

/// Least `n.h` of a facet.
pub const MIN_FACET: f32 = 1e-4;
/// Least `wo.h`: opposite directions have no half vector.
pub const LEAF_MIN_HALF: f32 = 1e-6;
/// Largest exponent of the facets' density: a density below e^-80 counts as 0.
pub const MAX_EXPONENT: f32 = 80.0;

/// The parameters of the gloss of a face seen from its own side: words 6 to 9 of a leaf.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LeafLobe {
    pub index: f32,
    /// Roughness along and across the veins.
    pub gamma: [f32; 2],
    pub mean_albedo: f32,
}

/// A face of a leaf at one place, in the face's own frame (z away from the leaf).
#[derive(Debug, Clone, Copy)]
pub(crate) struct LeafFace {
    pub normal: [f32; 3],
    /// Unit vector along the veins, in the tangent plane of the normal; the one across follows.
    pub along: [f32; 3],
    pub across: [f32; 3],
    /// Strength of the gloss, 0 to 1.
    pub gloss: f32,
}

/// Returns the reflectance of unpolarised light at an interface from air into `index` (1 and more), at an angle of
/// cosine `cosine` [Cook & Torrance 1982].
pub fn fresnel(index: f32, cosine: f32) -> f32 {
    let c = cosine.clamp(0.0, 1.0);
    let g = (index * index + c * c - 1.0).max(0.0).sqrt();
    let ratio = (g - c) / (g + c).max(1e-9);
    let other = (c * (g + c) - 1.0) / (c * (g - c) + 1.0);
    0.5 * ratio * ratio * (1.0 + other * other)
}

/// Returns where a vertical plane through `w` cuts the roughness: 0 for the smaller, 1 for the larger. The square of
/// the roughness in the plane is the mean of both squares, weighted by the squared components of `w`.
fn cut(lobe: &LeafLobe, w: [f32; 2]) -> f32 {
    let [a, c] = lobe.gamma;
    let [along, across] = w.map(|x| x * x);
    let share = along / (along + across).max(1e-20);
    let gamma = (c * c + (a * a - c * c) * share).max(0.0).sqrt();
    ((gamma - a.min(c)) / (a - c).abs().max(1e-6)).clamp(0.0, 1.0)
}

/// Returns the share of the light to or from a direction of cosine `cosine` to the normal that the gloss at full
/// strength reflects, interpolated in the table. `w` are the direction's components along and across the veins.
pub(crate) fn albedo(words: &[u32], lobe: &LeafLobe, cosine: f32, w: [f32; 2]) -> f32 {
    let x = cut(lobe, w) * (ALBEDO_COLUMNS - 1) as f32;
    let y = cosine.clamp(0.0, 1.0).sqrt() * (ALBEDO_ROWS - 1) as f32;
    let (column, row) = ((x as usize).min(ALBEDO_COLUMNS - 2), (y as usize).min(ALBEDO_ROWS - 2));
    let (s, t) = (x - column as f32, y - row as f32);
    let entry = |row: usize, column: usize| f32::from_bits(words[ALBEDO_AT + row * ALBEDO_COLUMNS + column]);
    let mixed = |row: usize| entry(row, column) * (1.0 - s) + entry(row, column + 1) * s;
    mixed(row) * (1.0 - t) + mixed(row + 1) * t
}

/// Returns the density of facets about the unit vector `h`, times pi; 0 below the surface.
fn facets(lobe: &LeafLobe, face: &LeafFace, h: [f32; 3]) -> f32 {
    let z = dot(face.normal, h);
    if z <= MIN_FACET {
        return 0.0;
    }
    let [along, across] = [dot(face.along, h) / lobe.gamma[0], dot(face.across, h) / lobe.gamma[1]];
    let exponent = (along * along + across * across) / (z * z);
    if exponent >= MAX_EXPONENT {
        return 0.0;
    }
    (-exponent).exp() / (lobe.gamma[0] * lobe.gamma[1] * z * z * z * z)
}

/// Returns the half vector of two unit vectors on the side of the face, and its cosine to `wo`, which is 0 where there
/// is no half vector.
fn half_vector(face: &LeafFace, wi: [f32; 3], wo: [f32; 3]) -> ([f32; 3], f32) {
    let sum = [0, 1, 2].map(|i| wi[i] + wo[i]);
    let side = if dot(face.normal, sum) < 0.0 { -1.0 } else { 1.0 };
    let scale = side / dot(sum, sum).sqrt().max(LEAF_MIN_HALF);
    let h = sum.map(|x| x * scale);
    (h, dot(wo, h))
}

/// Returns `pi f_s cos_i` at full strength for light at `wi` and an eye at `wo`, whose cosines to the face's normal are
/// `cos_i` and `cos_o`; 0 where either is not positive.
pub(crate) fn lobe(lobe: &LeafLobe, face: &LeafFace, wi: [f32; 3], wo: [f32; 3], cos_i: f32, cos_o: f32) -> f32 {
    let (h, o_dot_h) = half_vector(face, wi, wo);
    if cos_i <= 0.0 || cos_o <= 0.0 || o_dot_h <= LEAF_MIN_HALF {
        return 0.0;
    }
    // G / cos_o, the minimum taken before the division: finite towards grazing eyes.
    let shading = 2.0 * dot(face.normal, h) / o_dot_h;
    let masked = ((shading * cos_i).min(1.0) / cos_o).min(shading);
    0.25 * fresnel(lobe.index, o_dot_h) * facets(lobe, face, h) * masked
}

/// Draws the light direction that a facet reflects to `wo`, with the facet drawn from its density from two numbers in
/// [0, 1).
pub(crate) fn lobe_direction(lobe: &LeafLobe, face: &LeafFace, wo: [f32; 3], at: [f32; 2]) -> [f32; 3] {
    let slope = (-(1.0 - at[0]).max(1e-12).ln()).max(0.0).sqrt();
    let (sin, cos) = (std::f32::consts::TAU * at[1]).sin_cos();
    let (x, y) = (lobe.gamma[0] * slope * cos, lobe.gamma[1] * slope * sin);
    let scale = 1.0 / (1.0 + x * x + y * y).sqrt();
    let h = [0, 1, 2].map(|i| (x * face.along[i] + y * face.across[i] + face.normal[i]) * scale);
    let twice = 2.0 * dot(wo, h);
    [0, 1, 2].map(|i| twice * h[i] - wo[i])
}

/// Returns the density of [`lobe_direction`] per steradian, times pi.
pub(crate) fn lobe_density(lobe: &LeafLobe, face: &LeafFace, wi: [f32; 3], wo: [f32; 3]) -> f32 {
    let (h, o_dot_h) = half_vector(face, wi, wo);
    facets(lobe, face, h) * dot(face.normal, h).max(0.0) / (4.0 * o_dot_h.abs().max(LEAF_MIN_HALF))
}
