//! A place of a leaf as an eye sees it: the half of shading that does not depend on the light, done once however many
//! lights there are; and directions drawn for a path. Twin: `shaders/viewed_leaf.wgsl`.
//!
//! Light on the eye's side: `pi f cos_i = F c(i, o) cos_i + g pi f_s cos_i` with the body's share F of the light that has entered
//! and the coupling `c(i, o) = (1 - g E(i)) (1 - g E(o)) / (1 - g E_mean)`, E the gloss's directional albedo [after Kelemen &
//! Szirmay-Kalos 2001]. Light on the other side: the body's other share, entered through that face's gloss, left through
//! the seen one's; no lobe.
//!
//! When it is wrong: transmission is diffuse and, between faces of unequal gloss, not reciprocal by the quotient of their
//! `1 - g E_mean`; tilted normals shade, but cast no shadow; what the lobe of a tilted normal sends below the horizon is lost.

use crate::leaf_body::{LeafBody, between_slopes, body};
use crate::leaf_lobe::{LeafFace, LeafLobe, albedo, lobe, lobe_density, lobe_direction};
use crate::leaf_texture::{LeafTexel, texel_at};
use crate::lobe::{cross, dot};
use crate::sample::sample_about_z;
use std::f32::consts::PI;

/// Least cosine between a tilted normal and the eye.
pub(crate) const LEAST_EYE: f32 = 1e-3;
/// Least square of a normal's z.
pub(crate) const LEAST_UP: f32 = 0.04;
/// Least share of the directions that either side of the body and the gloss are drawn with.
pub(crate) const LEAST_SHARE: f32 = 0.02;
/// Luminance of linear sRGB.
pub(crate) const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// A place of a leaf as an eye sees it. See the head of this file.
#[derive(Debug, Clone, Copy)]
pub struct ViewedLeaf<'a> {
    words: &'a [u32],
    gloss: LeafLobe,
    /// 1 where the front is seen, -1 where the back is: z of what is in the frame of the seen face.
    side: f32,
    /// In the seen face's frame.
    wo: [f32; 3],
    cos_o: f32,
    seen: LeafFace,
    far: LeafFace,
    /// The body's two shares, times what the seen gloss lets out to the eye.
    reflected: [f32; 3],
    transmitted: [f32; 3],
    /// How often the body's two sides and the gloss are drawn.
    shares: [f32; 3],
}

/// A face of a normal whose x and y are given, under veins along the angle that twice is given.
fn face(tilt: [f32; 2], veins: [f32; 2], gloss: f32) -> LeafFace {
    let [x, y] = tilt;
    let z = (1.0 - x * x - y * y).max(LEAST_UP).sqrt();
    let scale = 1.0 / (x * x + y * y + z * z).sqrt();
    let normal = [x * scale, y * scale, z * scale];
    // Half the angle; without a direction, along y.
    let length = (veins[0] * veins[0] + veins[1] * veins[1]).sqrt();
    let cos2 = if length > 1e-6 { veins[0] / length } else { -1.0 };
    let [vx, vy] = [(0.5 + 0.5 * cos2).max(0.0).sqrt(), (0.5 - 0.5 * cos2).max(0.0).sqrt()];
    let vx = if veins[1] < 0.0 { -vx } else { vx };
    // On the surface above the vein's image: it rises with the slope.
    let vz = -(normal[0] * vx + normal[1] * vy) / normal[2];
    let scale = 1.0 / (1.0 + vz * vz).sqrt();
    let along = [vx * scale, vy * scale, vz * scale];
    LeafFace { normal, along, across: cross(normal, along), gloss }
}

/// Share of the light of cosine `cosine` at the direction `w` that a face's gloss reflects.
fn reflected_by(words: &[u32], gloss: &LeafLobe, face: &LeafFace, cosine: f32, w: [f32; 3]) -> f32 {
    face.gloss * albedo(words, gloss, cosine, [dot(face.along, w), dot(face.across, w)])
}

/// A direction of the other face's frame.
fn turned(w: [f32; 3]) -> [f32; 3] {
    [w[0], w[1], -w[2]]
}

impl<'a> ViewedLeaf<'a> {
    /// The leaf whose words begin `words` at `uv` (u to the right, v up, one repetition a unit) of `level` (0 the finest; the coarsest
    /// if there are fewer), seen from `wo`, a unit vector in the frame of the front (x along u, y along v; z < 0 sees the
    /// back). `factors` are the plant's own, on top of the textures': on chlorophyll, on carotenoids, on brown pigment and
    /// anthocyanins, on thickness; 0 up, 1 for none.
    ///
    /// # Panics
    /// Where `words` are not those of a [`crate::Leaf`].
    pub fn new(words: &'a [u32], uv: [f32; 2], level: u32, factors: [f32; 4], wo: [f32; 3]) -> ViewedLeaf<'a> {
        let float = |i: usize| f32::from_bits(words[i]);
        let gloss = LeafLobe { index: float(6), gamma: [float(7), float(8)], mean_albedo: float(9) };
        let texel = texel_at(words, uv, level);
        let LeafTexel { tilt: [fx, fy, bx, by], .. } = texel;
        let front = face([fx, fy], texel.veins, texel.gloss[0]);
        let back = face([bx, by], texel.veins, texel.gloss[1]);
        let (side, seen, far) = if wo[2] < 0.0 { (-1.0, back, front) } else { (1.0, front, back) };
        let wo = [wo[0], wo[1], wo[2] * side];
        let cos_o = dot(seen.normal, wo).max(LEAST_EYE);
        let lost = reflected_by(words, &gloss, &seen, cos_o, wo);
        let out = (1.0 - lost) / (1.0 - seen.gloss * gloss.mean_albedo);
        let hidden = [seen, far].map(|face| 0.5 - 0.5 * face.normal[2]);
        let LeafBody { reflectance, transmittance } =
            between_slopes(body(words, [0, 1, 2, 3].map(|i| texel.factors[i] * factors[i])), hidden);
        let (reflected, transmitted) = (reflectance.map(|c| c * out), transmittance.map(|c| c * out));
        let shares = [dot(LUMINANCE, reflected), dot(LUMINANCE, transmitted), lost].map(|x| x.max(LEAST_SHARE));
        let total: f32 = shares.iter().sum();
        ViewedLeaf {
            words,
            gloss,
            side,
            wo,
            cos_o,
            seen,
            far,
            reflected,
            transmitted,
            shares: shares.map(|share| share / total),
        }
    }

    /// `pi * BRDF * |cos_i|` for a light at `wi`, a unit vector in the same frame as the eye's, or `pi * BTDF * |cos_i|` where it
    /// lies on the other side; linear sRGB, the cosine inside. 0 where either lies in the leaf's plane.
    pub fn light(&self, wi: [f32; 3]) -> [f32; 3] {
        let wi = [wi[0], wi[1], wi[2] * self.side];
        if wi[2] == 0.0 || self.wo[2] == 0.0 {
            return [0.0; 3];
        }
        if wi[2] < 0.0 {
            let wi = turned(wi);
            let cos_i = dot(self.far.normal, wi).max(0.0);
            let enters = 1.0 - reflected_by(self.words, &self.gloss, &self.far, cos_i, wi);
            return self.transmitted.map(|c| c * enters * cos_i);
        }
        let cos_i = dot(self.seen.normal, wi).max(0.0);
        let enters = 1.0 - reflected_by(self.words, &self.gloss, &self.seen, cos_i, wi);
        let shine = self.seen.gloss * lobe(&self.gloss, &self.seen, wi, self.wo, cos_i, self.cos_o);
        self.reflected.map(|c| c * enters * cos_i + shine)
    }

    /// A direction to light that matters to this eye, on either side, from three numbers in [0, 1): about the normals by the
    /// cosine, on either side as often as the body's luminance there, or by the gloss's facets. It may lie where the
    /// value is 0.
    pub fn sample_direction(&self, at: [f32; 3]) -> [f32; 3] {
        let [reflected, transmitted, _] = self.shares;
        let about = |face: &LeafFace| {
            let [x, y, z] = sample_about_z(1.0, [at[0], at[1]]);
            [0, 1, 2].map(|i| x * face.along[i] + y * face.across[i] + z * face.normal[i])
        };
        let wi = if at[2] < reflected {
            about(&self.seen)
        } else if at[2] < reflected + transmitted {
            turned(about(&self.far))
        } else {
            lobe_direction(&self.gloss, &self.seen, self.wo, [at[0], at[1]])
        };
        [wi[0], wi[1], wi[2] * self.side]
    }

    /// Density of [`ViewedLeaf::sample_direction`] at the unit vector `wi`, per steradian; over the whole sphere it sums up to 1.
    pub fn sample_density(&self, wi: [f32; 3]) -> f32 {
        let wi = [wi[0], wi[1], wi[2] * self.side];
        let [reflected, transmitted, shine] = self.shares;
        let sum = reflected * dot(self.seen.normal, wi).max(0.0)
            + transmitted * dot(self.far.normal, turned(wi)).max(0.0)
            + shine * lobe_density(&self.gloss, &self.seen, wi, self.wo);
        sum / PI
    }
}
