//! Material of a leaf of a plate model: a Lambertian body below a specular lobe, coupled by the light that the lobe
//! lets in and out.
//!
//! Reflection: `pi f cos_i = a c(i, o) cos_i + g pi f_s cos_i` with the body's share `a` of entered light and
//! the coupling `c(i, o) = (1 - g E(i)) (1 - g E(o)) / (1 - g E_mean)`. Transmission: the body's other share,
//! entered through the far face's gloss and left through the seen one's; no lobe. `plate-paper` has neither
//! coupling nor the corrected lobe: what it prints is added up.

use btf_models::LeafContents;
use rayon::prelude::*;

use crate::leaf::face::{Seen, Tint};
use crate::leaf::venation::vein::direction_of;
use crate::optics::abm::scatter_table::Passage;
use crate::optics::gloss::lobe::{CookTorrance, LobeAngles, vein_frame};
use crate::optics::plates::body::PlateBody;
use crate::surface::height_field::{HeightField, LightVisibility};
use crate::surface::rig::{Hit, Material};
use crate::vector::dot;

/// Material of a leaf of a plate model; see the notes of the module.
pub(crate) struct PlateLeaf {
    seen: Seen,
    /// Per node: share of the body on the side of the eye, linear sRGB; strength of the lobe of the visible and of the
    /// far face.
    surface: Vec<[f32; 5]>,
    /// Per node: cosine and sine of twice the angle of the veins in the plane, a form that can be averaged.
    veins: Vec<[f32; 2]>,
    lobe: CookTorrance,
}

/// View-dependent half of the shading at a point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlatePoint {
    cos_o: f32,
    far_normal: [f32; 3],
    /// Body colour, times the share that the specular lobe lets out towards the view.
    body: [f32; 3],
    /// Strength of the lobe of the face that the light falls on.
    gloss: f32,
    /// Unit vectors along and across the veins; used where the lobe is anisotropic.
    frame: [[f32; 3]; 2],
}

/// Constants of one image. Light and view are parallel, so the angle to the half vector is one for the whole image.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlatePair {
    half: [f32; 3],
    o_dot_h: f32,
    fresnel: f32,
    wi: [f32; 3],
}

impl PlateLeaf {
    /// Computes the colours of the nodes of `seen`: `tints` scale `contents`, `gloss` holds the strengths of the lobe
    /// of the visible and of the far face, `veins` twice the angle of their direction in the plane.
    pub fn new(
        seen: Seen,
        contents: &LeafContents,
        tints: &[Tint],
        gloss: &[[f32; 2]],
        veins: Vec<[f32; 2]>,
        body: &PlateBody,
        lobe: CookTorrance,
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
        PlateLeaf { seen, surface, veins, lobe }
    }

    /// Returns the directional albedo of the lobe towards `w` at cosine `cosine`.
    #[inline]
    fn albedo(&self, cosine: f32, w: [f32; 3], frame: &[[f32; 3]; 2]) -> f32 {
        match self.lobe.is_anisotropic() {
            true => self.lobe.albedo_along(cosine, frame.map(|axis| dot(axis, w))),
            false => self.lobe.albedo(cosine),
        }
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
        let corners = self.seen.face.grid.corners(place);
        let [r, g, b, gloss, far_gloss] = corners.sample_all(&self.surface);
        let frame = match self.lobe.is_anisotropic() {
            true => vein_frame(normal, direction_of(corners.sample_all(&self.veins))),
            false => [[0.0; 3]; 2],
        };
        // Interpolated normals may turn from the eye at a silhouette, where the surface itself does not.
        let cos_o = dot(normal, wo).max(1e-3);
        let lets_out = self.lobe.coupling(gloss, 0.0, self.albedo(cos_o, wo, &frame));
        let gloss = match self.seen.passage {
            Passage::Reflection => gloss,
            Passage::Transmission => far_gloss,
        };
        let body = [r, g, b].map(|c| c * lets_out);
        PlatePoint { cos_o, far_normal: self.seen.far_normal(place), body, gloss, frame }
    }

    fn pair(&self, wi: [f32; 3], wo: [f32; 3]) -> PlatePair {
        let sum: [f32; 3] = std::array::from_fn(|k| wi[k] + wo[k]);
        let inverse_length = 1.0 / dot(sum, sum).max(1e-20).sqrt();
        let half = sum.map(|c| c * inverse_length);
        let o_dot_h = dot(wo, half);
        PlatePair { half, o_dot_h, fresnel: self.lobe.fresnel(o_dot_h), wi }
    }

    #[inline]
    fn cos_i(&self, hit: &Hit<PlatePoint>, wi: [f32; 3]) -> f32 {
        self.seen.cos_i(hit.normal, hit.point.far_normal, wi)
    }

    #[inline]
    fn shade(&self, pair: &PlatePair, hit: &Hit<PlatePoint>, cos_i: f32) -> [f32; 3] {
        let PlatePoint { cos_o, body: body_rgb, gloss, frame, .. } = &hit.point;
        let (body, reflected) = match self.seen.passage {
            Passage::Reflection => {
                let body = self.lobe.lets_in(*gloss, self.albedo(cos_i, pair.wi, frame));
                let cos_h = dot(hit.normal, pair.half);
                let angles = LobeAngles { cos_i, cos_o: *cos_o, cos_h, o_dot_h: pair.o_dot_h };
                let lobe = match self.lobe.is_anisotropic() {
                    true => self.lobe.pi_brdf_cos_along(pair.fresnel, angles, frame.map(|axis| dot(axis, pair.half))),
                    false => self.lobe.pi_brdf_cos(pair.fresnel, angles),
                };
                (body, gloss * lobe)
            }
            // The far face's veins run alike, but its normal is another: the mean over the azimuth does.
            Passage::Transmission => (self.lobe.lets_in(*gloss, self.lobe.albedo(cos_i)), 0.0),
        };
        body_rgb.map(|c| c * body * cos_i + reflected)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use btf_capture::{Direction, DirectionSet};

    use super::*;
    use crate::leaf::params::LeafParams;
    use crate::leaf::params::tests::small;
    use crate::leaf::patch::Leaf;
    use crate::leaf::venation::vein::double_angle;
    use crate::optics::abm::path_lengths::Face;
    use crate::optics::colour::RgbBands;
    use crate::optics::gloss::params::GlossParams;
    use crate::optics::plates::model::PlateModel;
    use crate::surface::capture_params::CaptureParams;
    use crate::surface::height_field;
    use crate::surface::rig::{Illumination, ViewHits, render};

    fn lobe() -> CookTorrance {
        CookTorrance::new(1.42, 0.3)
    }

    /// Returns a generated leaf of 64 x 64 texels.
    pub(crate) fn grown(side: Face, passage: Passage) -> PlateLeaf {
        let set = DirectionSet::new(vec![Direction::new(75.0, 0.0)]).unwrap();
        let params = LeafParams {
            capture: CaptureParams { size: 64, views: set.clone(), lights: set, ..small().capture },
            side,
            passage,
            ..small()
        };
        let leaf = Leaf::new(&params).unwrap();
        let body = PlateBody::new(PlateModel::N, PlateModel::N.default_table(), RgbBands::Spectral31).unwrap();
        PlateLeaf::new(leaf.seen, &params.contents, &leaf.tints, &leaf.gloss, leaf.veins, &body, lobe())
    }

    /// Returns a leaf of 64 x 64 texels whose face has `height` in millimetres over the position, one body colour and
    /// gloss; its far face is flat.
    pub(crate) fn shaped(height: impl Fn([f32; 2]) -> f32, gloss: f32, passage: Passage) -> PlateLeaf {
        let face = height_field::tests::shaped(height);
        let far = height_field::tests::shaped(|_| 0.0);
        let surface = vec![[0.5, 0.4, 0.3, gloss, gloss]; face.grid.len()];
        let seen = Seen { side: Face::Adaxial, passage, size: 64, face, far };
        let veins = vec![double_angle([0.0, 1.0]); surface.len()];
        PlateLeaf { seen, surface, veins, lobe: lobe() }
    }

    fn image(leaf: &PlateLeaf, wi: Direction, wo: Direction) -> Vec<f32> {
        render(leaf, &ViewHits::new(leaf, wo.unit()), &Illumination::new(leaf, wi.unit()))
    }

    #[test]
    fn light_from_behind_gives_the_transmitted_colour_times_its_cosine() {
        let flat = shaped(|_| 0.0, 0.0, Passage::Transmission);
        for (light, view) in [(180.0, 0.0), (120.0, 30.0), (105.0, 75.0)] {
            let image = image(&flat, Direction::new(light, 40.0), Direction::new(view, 200.0));
            let cos = -light.to_radians().cos() as f32;
            for texel in image.chunks_exact(3) {
                assert!((texel[0] - 0.5 * cos).abs() < 1e-5 && (texel[2] - 0.3 * cos).abs() < 1e-5, "{texel:?}");
            }
        }
        // Light in front gives nothing through.
        let front = image(&flat, Direction::new(30.0, 0.0), Direction::new(0.0, 0.0));
        assert!(front.iter().all(|x| *x == 0.0));
    }

    #[test]
    fn glossy_faces_let_less_through_and_never_more_than_fell_in() {
        // Diffuse light from behind, averaged over the views, must not exceed the body's share.
        let glossy = shaped(|_| 0.0, 1.0, Passage::Transmission);
        let dull = shaped(|_| 0.0, 0.0, Passage::Transmission);
        let at = |leaf: &PlateLeaf, light: f64, view: f64| {
            image(leaf, Direction::new(light, 0.0), Direction::new(view, 90.0))[0]
        };
        assert!(at(&glossy, 105.0, 10.0) < 0.95 * at(&dull, 105.0, 10.0), "grazing light is reflected");
        let mean = (0..40)
            .map(|i| f64::from(at(&glossy, 180.0, (1.0 - (f64::from(i) + 0.5) / 40.0).sqrt().acos().to_degrees())))
            .sum::<f64>()
            / 40.0;
        let entering = f64::from(1.0 - lobe().albedo(1.0));
        assert!((mean - 0.5 * entering).abs() < 5e-3, "{mean} {}", 0.5 * entering);
    }

    #[test]
    fn the_shadow_of_the_far_faces_relief_falls_on_transmitted_light_alone() {
        let mut walled = shaped(|_| 0.0, 0.0, Passage::Transmission);
        walled.seen.far = height_field::tests::shaped(|p| if (p[0] - 10.0).abs() < 0.5 { 0.4 } else { 0.0 });
        // From +x behind at 60 degrees from the normal: the shadow lies at smaller x.
        let lit = image(&walled, Direction::new(120.0, 0.0), Direction::new(0.0, 0.0));
        let row = 32 * 64;
        let column = |x: f32| 3 * (row + (x / 20.0 * 64.0) as usize);
        assert!(lit[column(9.1)] < 0.5 * lit[column(5.0)], "{} {}", lit[column(9.1)], lit[column(5.0)]);
        assert!((lit[column(12.0)] - lit[column(5.0)]).abs() < 0.02);
    }

    #[test]
    fn a_lobe_that_is_narrow_across_the_veins_is_brighter_there_and_still_reciprocal() {
        let mut leaf = shaped(|_| 0.0, 1.0, Passage::Reflection);
        let params = GlossParams { gamma_along: 0.5, gamma_across: 0.15, ..GlossParams::default() };
        leaf.lobe = CookTorrance::from_params(&params);
        let at = |wi: Direction, wo: Direction| image(&leaf, wi, wo)[2];
        // Veins run along y: half vectors tilted along y are common, tilted along x are not.
        let (up, side) = (Direction::new(50.0, 90.0), Direction::new(50.0, 0.0));
        let zenith = Direction::new(0.0, 0.0);
        assert!(at(up, zenith) > 1.02 * at(side, zenith), "{} {}", at(up, zenith), at(side, zenith));
        for (a, b) in [(Direction::new(20.0, 10.0), Direction::new(60.0, 150.0)), (up, side)] {
            let forward = at(a, b) / a.unit()[2];
            let backward = at(b, a) / b.unit()[2];
            assert!((forward - backward).abs() < 2e-3 * forward, "{forward} {backward}");
        }
    }

    #[test]
    fn both_faces_of_a_grown_leaf_show_and_transmit_green() {
        for side in [Face::Adaxial, Face::Abaxial] {
            for (passage, theta) in [(Passage::Reflection, 30.0), (Passage::Transmission, 150.0)] {
                let leaf = grown(side, passage);
                let image = image(&leaf, Direction::new(theta, 70.0), Direction::new(20.0, 200.0));
                let mean = |channel: usize| image.iter().skip(channel).step_by(3).sum::<f32>() / (64.0 * 64.0);
                let (r, g, b) = (mean(0), mean(1), mean(2));
                assert!(g > 1.1 * r && g > 1.5 * b && g < 0.6 && b > -0.02, "{side:?} {passage:?}: {r} {g} {b}");
                assert!(image.iter().all(|x| x.is_finite()));
            }
        }
    }
}
