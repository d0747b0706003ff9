//! A leaf of a plate model before the camera: a Lambertian body below a gloss, coupled by what the gloss
//! lets in and out.
//!
//! Reflection: `pi f cos_i = a c(i, o) cos_i + g pi f_s cos_i` with the body's share `a` of entered light and
//! the coupling `c(i, o) = (1 - g E(i)) (1 - g E(o)) / (1 - g E_mean)`. Transmission: the body's other share,
//! entered through the far face's gloss and left through the seen one's; no lobe. `plate-paper` has neither
//! coupling nor the corrected lobe: what it prints is added up.

use rayon::prelude::*;

use crate::leaf::face::{Seen, Tint};
use crate::optics::contents::LeafContents;
use crate::optics::cook_torrance::{CookTorrance, LobeAngles};
use crate::optics::plate_body::PlateBody;
use crate::optics::scatter_table::Passage;
use crate::surface::height_field::{HeightField, LightVisibility};
use crate::surface::rig::{Hit, Material, dot};

/// How gloss and body add up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Coupling {
    /// What the gloss reflects does not enter.
    Energy,
    /// The two are added, as printed.
    None,
}

/// The leaf. See the notes at the top of this file.
pub(crate) struct PlateLeaf {
    seen: Seen,
    /// Per node: the body's share on the eye's side, linear sRGB; gloss of the seen and of the far face.
    surface: Vec<[f32; 5]>,
    lobe: CookTorrance,
    coupling: Coupling,
}

/// The view's half of a point's shading.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlatePoint {
    cos_o: f32,
    far_normal: [f32; 3],
    /// Body colour, times what the gloss lets out towards the view.
    body: [f32; 3],
    /// Of the face that the light falls on.
    gloss: f32,
}

/// The constants of one image. Light and view are parallel, so the angle at the facets is one for
/// the whole image.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlatePair {
    half: [f32; 3],
    o_dot_h: f32,
    fresnel: f32,
}

impl PlateLeaf {
    /// Colours the nodes of `seen`: `tints` scale `contents`, `gloss` holds the strengths of the seen and of
    /// the far face.
    pub fn new(
        seen: Seen,
        contents: &LeafContents,
        tints: &[Tint],
        gloss: &[[f32; 2]],
        body: &PlateBody,
        lobe: CookTorrance,
        coupling: Coupling,
    ) -> PlateLeaf {
        let surface = tints
            .par_iter()
            .zip(gloss)
            .map(|(tint, &[gloss, far_gloss])| {
                let scaled = LeafContents {
                    chlorophyll_ug_per_cm2: contents.chlorophyll_ug_per_cm2 * f64::from(tint.chlorophyll),
                    carotenoid_ug_per_cm2: contents.carotenoid_ug_per_cm2 * f64::from(tint.carotenoid),
                    anthocyanin_ug_per_cm2: contents.anthocyanin_ug_per_cm2 * f64::from(tint.brown),
                    brown: contents.brown * f64::from(tint.brown),
                    ..*contents
                };
                let rgb = body.rgb(&scaled, f64::from(tint.thickness));
                let [r, g, b] = match seen.passage {
                    Passage::Reflection => rgb.reflectance,
                    Passage::Transmission => rgb.transmittance,
                };
                [r, g, b, gloss, far_gloss]
            })
            .collect();
        PlateLeaf { seen, surface, lobe, coupling }
    }
}

impl Material for PlateLeaf {
    type Point = PlatePoint;
    type Pair = PlatePair;

    fn size(&self) -> usize {
        self.seen.size
    }

    fn face(&self) -> &HeightField {
        &self.seen.face
    }

    fn visibility(&self, wi: [f32; 3]) -> LightVisibility {
        self.seen.visibility(wi)
    }

    fn point(&self, place: [f32; 2], normal: [f32; 3], wo: [f32; 3]) -> PlatePoint {
        let [r, g, b, gloss, far_gloss] = self.seen.face.grid.corners(place).sample_all(&self.surface);
        // Interpolated normals may turn from the eye at a silhouette, where the surface itself does not.
        let cos_o = dot(normal, wo).max(1e-3);
        let lets_out = match self.coupling {
            Coupling::Energy => self.lobe.coupling(gloss, 0.0, self.lobe.albedo(cos_o)),
            Coupling::None => 1.0,
        };
        let gloss = match self.seen.passage {
            Passage::Reflection => gloss,
            Passage::Transmission => far_gloss,
        };
        PlatePoint { cos_o, far_normal: self.seen.far_normal(place), body: [r, g, b].map(|c| c * lets_out), gloss }
    }

    fn pair(&self, wi: [f32; 3], wo: [f32; 3]) -> PlatePair {
        let sum: [f32; 3] = std::array::from_fn(|k| wi[k] + wo[k]);
        let inverse_length = 1.0 / dot(sum, sum).max(1e-20).sqrt();
        let half = sum.map(|c| c * inverse_length);
        let o_dot_h = dot(wo, half);
        PlatePair { half, o_dot_h, fresnel: self.lobe.fresnel(o_dot_h) }
    }

    #[inline]
    fn cos_i(&self, hit: &Hit<PlatePoint>, wi: [f32; 3]) -> f32 {
        self.seen.cos_i(hit.normal, hit.point.far_normal, wi)
    }

    #[inline]
    fn shade(&self, pair: &PlatePair, hit: &Hit<PlatePoint>, cos_i: f32) -> [f32; 3] {
        let PlatePoint { cos_o, body: body_rgb, gloss, .. } = hit.point;
        let lets_in = match self.coupling {
            Coupling::Energy => 1.0 - gloss * self.lobe.albedo(cos_i),
            Coupling::None => 1.0,
        };
        let body = lets_in * cos_i;
        let reflected = match self.seen.passage {
            Passage::Reflection => {
                let angles = LobeAngles { cos_i, cos_o, cos_h: dot(hit.normal, pair.half), o_dot_h: pair.o_dot_h };
                gloss * self.lobe.pi_brdf_cos(pair.fresnel, angles)
            }
            Passage::Transmission => 0.0,
        };
        body_rgb.map(|c| c * body + reflected)
    }
}
