//! What a point of a leaf's upper face does with light: body colour below, gloss on top.

use crate::leaf::patch::Leaf;
use crate::optics::cook_torrance::LobeAngles;
use crate::surface::height_field::HeightField;
use crate::surface::rig::{Hit, Material, dot};

/// The view's half of a point's shading.
#[derive(Debug, Clone, Copy)]
pub struct LeafPoint {
    cos_o: f32,
    /// Body colour, times what the gloss lets out towards the view.
    body: [f32; 3],
    gloss: f32,
}

/// The constants of one image. Light and view are parallel, so the angle at the facets is one for
/// the whole image.
#[derive(Debug, Clone, Copy)]
pub struct LeafPair {
    half: [f32; 3],
    o_dot_h: f32,
    fresnel: f32,
}

impl Material for Leaf {
    type Point = LeafPoint;
    type Pair = LeafPair;

    fn size(&self) -> usize {
        self.size
    }

    fn face(&self) -> &HeightField {
        &self.face
    }

    fn point(&self, place: [f32; 2], normal: [f32; 3], wo: [f32; 3]) -> LeafPoint {
        let [r, g, b, gloss] = self.face.grid.corners(place).sample_all(&self.surface);
        // Interpolated normals may turn from the eye at a silhouette, where the surface itself does not.
        let cos_o = dot(normal, wo).max(1e-3);
        let lets_out = self.lobe.coupling(gloss, 0.0, self.lobe.albedo(cos_o));
        LeafPoint { cos_o, body: [r, g, b].map(|c| c * lets_out), gloss }
    }

    fn pair(&self, wi: [f32; 3], wo: [f32; 3]) -> LeafPair {
        let sum: [f32; 3] = std::array::from_fn(|k| wi[k] + wo[k]);
        let inverse_length = 1.0 / dot(sum, sum).sqrt();
        let half = sum.map(|c| c * inverse_length);
        let o_dot_h = dot(wo, half);
        LeafPair { half, o_dot_h, fresnel: self.lobe.fresnel(o_dot_h) }
    }

    #[inline]
    fn shade(&self, pair: &LeafPair, hit: &Hit<LeafPoint>, cos_i: f32) -> [f32; 3] {
        let LeafPoint { cos_o, body: body_rgb, gloss } = hit.point;
        let angles = LobeAngles { cos_i, cos_o, cos_h: dot(hit.normal, pair.half), o_dot_h: pair.o_dot_h };
        let reflected = gloss * self.lobe.pi_brdf_cos(pair.fresnel, angles);
        let body = (1.0 - gloss * self.lobe.albedo(cos_i)) * cos_i;
        body_rgb.map(|c| c * body + reflected)
    }
}
