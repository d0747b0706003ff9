//! Material of a leaf of an algorithmic model: per texel the colour of every class of paths through the mesophyll, per
//! direction pair the weight of every class.
//!
//! The surface reflection of the model itself (paths of length 0) is the highlight, so the gloss texture and the
//! roughness of the plates do not apply. Maps of pigment and thickness act on the optical depth. Models with
//! spectral indices are traced at the mean wavelength of each channel, or of all three where these lie close together.

use rayon::prelude::*;

use crate::leaf::face::{Seen, Tint};
use crate::leaf::patch::Leaf;
use crate::optics::abm::path_lengths::Face;
use crate::optics::abm::scatter_table::{Passage, ScatterTable, WAYS};
use crate::optics::abm::tissue::{DepthParts, Tissue};
use crate::optics::colour::{RgbBands, RgbFromSpectrum};
use crate::optics::units::Nanometres;
use crate::surface::height_field::{HeightField, LightVisibility};
use crate::surface::rig::{Hit, Material};
use crate::vector::dot;

/// Wavelength at which a model is traced whose refractive indices are constant.
const TABLE_WAVELENGTH: Nanometres = Nanometres(550.0);

/// Distance in nanometres of the channels' mean wavelengths up to which one table serves all three.
const MAX_SPAN_NM: f64 = 60.0;

/// Number of rays for each incidence of the table.
pub(crate) const TABLE_RAYS: u64 = 1_000_000;

/// Linear sRGB of every class of paths, white for no absorption.
type WayColours = [[f32; 3]; WAYS];

/// Material of a leaf of an algorithmic model; see the notes of the module.
pub(crate) struct TissueLeaf {
    seen: Seen,
    /// Table of all channels, or of each.
    tables: Vec<ScatterTable>,
    colours: Vec<[f32; 3 * WAYS]>,
}

/// View-dependent half of the shading at a point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TissuePoint {
    cos_o: f32,
    far_normal: [f32; 3],
    colours: WayColours,
}

/// Constants of one image.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TissuePair {
    i_dot_o: f32,
    /// Cosine of the azimuth between light and eye about the mean normal.
    cos_phi: f32,
}

impl TissueLeaf {
    /// Traces the tables with `rays` rays per incidence and computes the colours of the nodes of `leaf` in `bands`.
    pub fn new(tissue: &dyn Tissue, leaf: &Leaf, bands: RgbBands, rays: u64, seed: u64) -> TissueLeaf {
        let seen = leaf.seen.clone();
        let light = match (seen.side, seen.passage) {
            (side, Passage::Reflection) => side,
            (Face::Adaxial, Passage::Transmission) => Face::Abaxial,
            (Face::Abaxial, Passage::Transmission) => Face::Adaxial,
        };
        let convert = RgbFromSpectrum::new(bands);
        let trace = |nm| ScatterTable::trace(&tissue.stack(nm), light, seen.passage, rays, seed);
        let tables: Vec<ScatterTable> = traced_at(tissue, &convert).into_iter().map(trace).collect();
        let bands: Vec<(DepthParts, [f64; 3])> = convert
            .wavelengths_nm()
            .iter()
            .zip(convert.weights())
            .map(|(&nm, &weights)| (tissue.depth_parts(Nanometres(nm)), weights))
            .collect();
        let ways: Vec<[f32; WAYS]> = (0..3).map(|channel| of_channel(&tables, channel).ways()).collect();
        let colours = leaf.tints.par_iter().map(|tint| way_colours(&bands, &ways, tint)).collect();
        TissueLeaf { seen, tables, colours }
    }
}

/// Returns the wavelengths that tables are traced at: of all channels, or of each.
pub(crate) fn traced_at(tissue: &dyn Tissue, convert: &RgbFromSpectrum) -> Vec<Nanometres> {
    if tissue.has_constant_indices() {
        return vec![TABLE_WAVELENGTH];
    }
    let nm = convert.mean_wavelengths_nm();
    let [least, most] = [f64::min, f64::max].map(|of| nm.into_iter().fold(nm[0], of));
    if most - least <= MAX_SPAN_NM { vec![Nanometres(0.5 * (least + most))] } else { nm.map(Nanometres).to_vec() }
}

/// Returns the table of a channel.
fn of_channel(tables: &[ScatterTable], channel: usize) -> &ScatterTable {
    &tables[channel.min(tables.len() - 1)]
}

/// Returns the colour of each class of paths, `sum over wavelengths of weight exp(-k way)`.
fn way_colours(bands: &[(DepthParts, [f64; 3])], ways: &[[f32; WAYS]], tint: &Tint) -> [f32; 3 * WAYS] {
    let mut colours = [0f64; 3 * WAYS];
    for (depth, weights) in bands {
        let k = f64::from(tint.thickness)
            * (depth.chlorophyll.0 * f64::from(tint.chlorophyll)
                + depth.carotenoid.0 * f64::from(tint.carotenoid)
                + depth.rest.0);
        for (channel, ways) in ways.iter().enumerate().filter(|(channel, _)| weights[*channel] != 0.0) {
            for (class, way) in ways.iter().enumerate() {
                colours[3 * class + channel] += weights[channel] * (-k * f64::from(*way)).exp();
            }
        }
    }
    colours.map(|c| c as f32)
}

impl Material for TissueLeaf {
    type Point = TissuePoint;
    type Pair = TissuePair;

    fn size(&self) -> usize {
        self.seen.size
    }

    fn face(&self) -> &HeightField {
        &self.seen.face
    }

    fn visibility(&self, wi: [f32; 3]) -> LightVisibility {
        self.seen.visibility(wi)
    }

    fn point(&self, place: [f32; 2], normal: [f32; 3], wo: [f32; 3]) -> TissuePoint {
        let flat = self.seen.face.grid.corners(place).sample_all(&self.colours);
        TissuePoint {
            cos_o: dot(normal, wo).max(1e-3),
            far_normal: self.seen.far_normal(place),
            colours: std::array::from_fn(|class| std::array::from_fn(|channel| flat[3 * class + channel])),
        }
    }

    fn pair(&self, wi: [f32; 3], wo: [f32; 3]) -> TissuePair {
        let lateral = (wi[0].hypot(wi[1])) * (wo[0].hypot(wo[1]));
        let cos_phi = if lateral > 1e-12 { (wi[0] * wo[0] + wi[1] * wo[1]) / lateral } else { -1.0 };
        TissuePair { i_dot_o: dot(wi, wo), cos_phi }
    }

    #[inline]
    fn cos_i(&self, hit: &Hit<TissuePoint>, wi: [f32; 3]) -> f32 {
        self.seen.cos_i(hit.normal, hit.point.far_normal, wi)
    }

    fn shade(&self, pair: &TissuePair, hit: &Hit<TissuePoint>, cos_i: f32) -> [f32; 3] {
        let TissuePoint { cos_o, colours, .. } = hit.point;
        let cos_phi = match self.seen.passage {
            // About the point's own normal.
            Passage::Reflection => {
                let sines = ((1.0 - cos_i * cos_i) * (1.0 - cos_o * cos_o)).max(0.0).sqrt();
                if sines > 1e-6 { (pair.i_dot_o - cos_i * cos_o) / sines } else { -1.0 }
            }
            // The two faces have two normals; the blade's plane decides.
            Passage::Transmission => pair.cos_phi,
        };
        let mut sum = [0f32; 3];
        for (number, table) in self.tables.iter().enumerate() {
            let channels = if self.tables.len() == 1 { 0..3 } else { number..number + 1 };
            let weights = table.pi_f(cos_i.min(1.0), cos_o.min(1.0), cos_phi);
            for (weight, colour) in weights.iter().zip(&colours) {
                for channel in channels.clone() {
                    sum[channel] += weight * colour[channel];
                }
            }
        }
        sum.map(|c| c * cos_i)
    }
}

#[cfg(test)]
mod tests {
    use btf_capture::Direction;

    use super::*;
    use crate::optics::abm::abm97::Abm97;
    use crate::optics::abm::path_lengths::{Parallel, trace_path_lengths};
    use crate::surface::height_field;
    use crate::surface::rig::{Illumination, ViewHits, render};

    const PLAIN: Tint = Tint { chlorophyll: 1.0, carotenoid: 1.0, brown: 1.0, thickness: 1.0 };

    fn flat(side: Face, passage: Passage, tint: Tint) -> TissueLeaf {
        let face = height_field::tests::shaped(|_| 0.0);
        let seen = Seen { side, passage, size: 64, far: face.clone(), face };
        let count = seen.face.grid.len();
        let leaf = Leaf { seen, tints: vec![tint; count], gloss: Vec::new(), veins: Vec::new() };
        TissueLeaf::new(&Abm97::default(), &leaf, RgbBands::Spectral31, 40_000, 1)
    }

    fn first(leaf: &TissueLeaf, wi: Direction, wo: Direction) -> [f32; 3] {
        let image = render(leaf, &ViewHits::new(leaf, wo.unit()), &Illumination::new(leaf, wi.unit()));
        [image[0], image[1], image[2]]
    }

    /// The images of a flat leaf, integrated over the views, against the model's own spectrum.
    #[test]
    fn images_add_up_to_the_models_reflectance_and_transmittance() {
        let tissue = Abm97::default();
        let stack = tissue.stack(Nanometres(550.0));
        let convert = RgbFromSpectrum::new(RgbBands::Spectral31);
        for side in [Face::Adaxial, Face::Abaxial] {
            // cos = (15/19)^2, an incidence of the table.
            let theta = (15f64 / 19.0).powi(2).acos().to_degrees();
            let traced = trace_path_lengths(&stack, &Parallel::onto(side, theta), 200_000, 3);
            for passage in [Passage::Reflection, Passage::Transmission] {
                let spectrum: Vec<f64> = convert
                    .wavelengths_nm()
                    .iter()
                    .map(|&nm| {
                        let k = tissue.optical_depth(Nanometres(nm)).0;
                        match passage {
                            Passage::Reflection => traced.reflectance(k).mean,
                            Passage::Transmission => traced.transmittance(k).mean,
                        }
                    })
                    .collect();
                let expected = convert.rgb(&spectrum);
                let (seen, light_deg) = match (passage, side) {
                    (Passage::Reflection, side) => (side, theta),
                    (Passage::Transmission, Face::Adaxial) => (Face::Abaxial, 180.0 - theta),
                    (Passage::Transmission, Face::Abaxial) => (Face::Adaxial, 180.0 - theta),
                };
                let leaf = flat(seen, passage, PLAIN);
                let light = Direction::new(light_deg, 0.0);
                let (steps, turns) = (16, 24);
                let mut sum = [0f64; 3];
                for i in 0..steps {
                    let cos: f64 = (f64::from(i) + 0.5) / f64::from(steps);
                    for j in 0..turns {
                        let phi = 360.0 * (f64::from(j) + 0.5) / f64::from(turns);
                        let rgb = first(&leaf, light, Direction::new(cos.acos().to_degrees(), phi));
                        (0..3).for_each(|c| sum[c] += f64::from(rgb[c]) * cos);
                    }
                }
                let scale = 2.0 / f64::from(steps * turns) / (15f64 / 19.0).powi(2);
                for channel in 0..3 {
                    let found = sum[channel] * scale;
                    assert!(
                        (found - expected[channel]).abs() < 0.012,
                        "{side:?} {passage:?} {channel}: {found} {expected:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn thicker_and_greener_places_are_darker() {
        let at = |tint| {
            first(
                &flat(Face::Adaxial, Passage::Transmission, tint),
                Direction::new(180.0, 0.0),
                Direction::new(0.0, 0.0),
            )
        };
        let plain = at(PLAIN);
        let thick = at(Tint { thickness: 1.5, ..PLAIN });
        let pale = at(Tint { chlorophyll: 0.3, ..PLAIN });
        for channel in 0..3 {
            assert!(thick[channel] < plain[channel] && pale[channel] > plain[channel]);
        }
    }
}
