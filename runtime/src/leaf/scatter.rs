//! The light of a leaf of an algorithmic model: a table of `pi f` over the directions of light and eye, by the length of the way
//! through the tissue, so that contents may change. Twin: `leaf/scatter.wgsl`.
//!
//! A way of length w (in straight crossings) leaves `exp(-k w)` of the light of a wavelength, k being the optical depth of a
//! straight crossing. Ways fall into [`CLASSES`] classes, the first of which is the surface, where nothing is absorbed; a
//! place turns each class into a colour once, and a pair of directions costs an interpolation and a sum over the classes
//! (docs/reference/model.md, section 10).

use crate::leaf::body::absorption;
use crate::leaf::error::LeafError;
use crate::leaf::figures::LEAF_BANDS;
use crate::leaf::words::{
    AZIMUTHS, BAND_WORDS, BANDS_AT, CELL_WORDS, CELLS_AFTER, CHANNELS_AT, CLASSES, COSINES, INCIDENCES, SCATTER_AT,
    TOTALS_AFTER,
};
use half::f16;

/// How a leaf scatters light: what an algorithmic model was traced to.
#[derive(Debug, Clone, PartialEq)]
pub struct LeafScattering {
    /// Optical depth of a straight crossing in each band that live leaves sum over: for 1 ug/cm2 of chlorophyll, for 1 ug/cm2 of
    /// carotenoids, and that of all else.
    pub depths: [[f32; 3]; LEAF_BANDS],
    /// Length of the ways of each class in straight crossings, ascending from 0: for light on the front, on the side of the eye and
    /// on the other, then for light on the back.
    pub ways: [[f32; CLASSES]; 4],
    /// Values of `pi f` as half floats, by class: for light on the front and on the back, on the side of the eye and on the other,
    /// for one channel or each of three, by [`INCIDENCES`] cosines of the light, even in their root, by [`COSINES`] classes of the
    /// cosine of the eye and by [`AZIMUTHS`] of the cosine of half the azimuth between light and eye.
    pub cells: Vec<[u16; CLASSES]>,
}

/// Number of cells of a face, a side and a channel.
const CELLS: usize = INCIDENCES * COSINES * AZIMUTHS;

impl LeafScattering {
    /// Returns the number of channels: 1 or 3.
    ///
    /// # Errors
    /// [`LeafError::Scattering`] for another number of cells, ways that do not ascend from 0, or a number that is none.
    pub(crate) fn channels(&self) -> Result<usize, LeafError> {
        let is_good = |value: &u16| f16::from_bits(*value).is_finite() && !f16::from_bits(*value).is_sign_negative();
        let ascends = |ways: &[f32; CLASSES]| {
            ways[0] == 0.0 && ways.windows(2).all(|pair| pair[0] < pair[1] && pair[1].is_finite())
        };
        let ascend = self.ways.iter().all(ascends);
        let depths = self.depths.iter().flatten().all(|depth| depth.is_finite() && *depth >= 0.0);
        match self.cells.len() {
            count if !(ascend && depths && self.cells.iter().flatten().all(is_good)) => {
                Err(LeafError::Scattering { cells: count })
            }
            count if count == 4 * CELLS => Ok(1),
            count if count == 12 * CELLS => Ok(3),
            count => Err(LeafError::Scattering { cells: count }),
        }
    }

    /// Returns the words that follow the texels: the ways, the shares of light from all around that each class carries by face and
    /// side, and the cells.
    pub(crate) fn words(&self, channels: usize) -> Vec<u32> {
        let mut words: Vec<u32> = self.ways.iter().flatten().map(|way| way.to_bits()).collect();
        for table in self.cells.chunks(channels * CELLS) {
            let mut totals = [0.0; CLASSES];
            for (number, cell) in table.iter().enumerate() {
                let weight = cell_weight(number % CELLS) / channels as f32;
                (0..CLASSES).for_each(|class| totals[class] += weight * f16::from_bits(cell[class]).to_f32());
            }
            words.extend(totals.map(f32::to_bits));
        }
        let cells = self.cells.iter().flat_map(|cell| [[cell[0], cell[1]], [cell[2], cell[3]]]);
        words.extend(cells.map(|[low, high]| u32::from(low) | u32::from(high) << 16));
        words
    }
}

/// Returns the share of light from all around and to all around that a cell stands for: the projected solid angles of its eye and
/// its light over pi, of which the latter is that of the root of the cosine about its place.
fn cell_weight(cell: usize) -> f32 {
    let (i, c, a) = (cell / (COSINES * AZIMUTHS), cell / AZIMUTHS % COSINES, cell % AZIMUTHS);
    let edge = |j: usize| j as f32 / COSINES as f32;
    let phi = |j: usize| 2.0 * (j as f32 / AZIMUTHS as f32).min(1.0).acos();
    let eye = (phi(a) - phi(a + 1)) * (edge(c + 1).powi(2) - edge(c).powi(2)) / std::f32::consts::PI;
    // 2 cos d cos = d (root^4).
    let root = |place: f32| (place / (INCIDENCES - 1) as f32).clamp(0.0, 1.0).powi(4);
    eye * (root(i as f32 + 0.5) - root(i as f32 - 0.5))
}

/// Colour of each class of ways at a place, linear sRGB, at most 1 in a channel.
pub(crate) type WayColours = [[f32; 3]; CLASSES];

/// Returns the colour of each class of the ways from a face (0 the front) to a side (0 where the light came from), where the
/// textures and the plant multiply the contents of the leaf by `factors`.
pub(crate) fn way_colours(words: &[u32], factors: [f32; 4], face: usize, side: usize) -> WayColours {
    let at = words[SCATTER_AT] as usize + CLASSES * (2 * face + side);
    let mut colours = [[0.0; 3]; CLASSES];
    for band in 0..words[5] as usize {
        let [pigments, rest] = absorption(words, band, factors);
        let k = factors[3] * (pigments + rest);
        for (class, colour) in colours.iter_mut().enumerate() {
            let left = (-k * f32::from_bits(words[at + class])).exp();
            for (channel, value) in colour.iter_mut().enumerate() {
                *value += left * f32::from_bits(words[BANDS_AT + band * BAND_WORDS + 4 + channel]);
            }
        }
    }
    // The red of a pure yellow is more than a white has.
    colours.map(|colour| colour.map(|value| value.min(1.0)))
}

/// Returns the share of light from all around on a face (0 the front) that leaves on a side (0 where it came from) by each class.
pub(crate) fn way_totals(words: &[u32], face: usize, side: usize) -> [f32; CLASSES] {
    let at = words[SCATTER_AT] as usize + TOTALS_AFTER + CLASSES * (2 * face + side);
    std::array::from_fn(|class| f32::from_bits(words[at + class]))
}

/// Returns the lower of two neighbouring places of `count` and the share of the upper one.
fn between(place: f32, count: usize) -> (usize, f32) {
    let place = place.clamp(0.0, (count - 1) as f32);
    let cell = (place as usize).min(count - 2);
    (cell, place - cell as f32)
}

/// Returns `pi f` for light on a face (0 the front) seen on a side (0 where it came from), for the cosines of light and eye from
/// the normals of their own sides and the cosine of the azimuth between them; linear between the middles of cells.
pub(crate) fn scattered(words: &[u32], colours: &WayColours, place: [usize; 2], cosines: [f32; 3]) -> [f32; 3] {
    let [face, side] = place;
    let [cos_i, cos_o, cos_phi] = cosines;
    let channels = words[CHANNELS_AT] as usize;
    let first = words[SCATTER_AT] as usize + CELLS_AFTER + CELL_WORDS * channels * CELLS * (2 * face + side);
    let (i, ti) = between(cos_i.max(0.0).sqrt() * (INCIDENCES - 1) as f32, INCIDENCES);
    let (c, tc) = between(cos_o * COSINES as f32 - 0.5, COSINES);
    let half = (0.5 + 0.5 * cos_phi.clamp(-1.0, 1.0)).sqrt();
    let (a, ta) = between(half * AZIMUTHS as f32 - 0.5, AZIMUTHS);
    let mut light = [0.0; 3];
    for channel in 0..channels {
        let mut values = [0.0; CLASSES];
        for corner in 0..8 {
            let (di, dc, da) = (corner & 1, corner >> 1 & 1, corner >> 2);
            let share = |d: usize, t: f32| if d == 0 { 1.0 - t } else { t };
            let weight = share(di, ti) * share(dc, tc) * share(da, ta);
            let cell = channel * CELLS + ((i + di) * COSINES + c + dc) * AZIMUTHS + a + da;
            let at = first + CELL_WORDS * cell;
            for (class, value) in values.iter_mut().enumerate() {
                let halves = words[at + class / 2] >> (16 * (class % 2));
                *value += weight * f16::from_bits(halves as u16).to_f32();
            }
        }
        for class in 0..CLASSES {
            match channels {
                1 => (0..3).for_each(|rgb| light[rgb] += values[class] * colours[class][rgb]),
                _ => light[channel] += values[class] * colours[class][channel],
            }
        }
    }
    light
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leaf::leaf::Leaf;
    use crate::leaf::state::{LeafMode, LeafState};
    use crate::leaf::texture::{LeafTexel, LeafTexture};
    use crate::leaf::viewed::ViewedLeaf;
    use crate::testing::direction_from_degrees;

    /// Value of the first class inside the leaf by face, side and channel.
    fn value(face: usize, side: usize, channel: usize) -> f32 {
        [[0.3, 0.2], [0.4, 0.1]][face][side] + 0.05 * channel as f32
    }

    /// Returns a table that is alike in all directions: [`value`] inside, and 0.02 from the surface on the side of the light.
    fn matt(channels: usize) -> LeafScattering {
        let half = |x: f32| f16::from_f32(x).to_bits();
        let mut cells = Vec::new();
        for face in 0..2 {
            for side in 0..2 {
                for channel in 0..channels {
                    let surface = if side == 0 { 0.02 } else { 0.0 };
                    cells.extend(vec![[half(surface), half(value(face, side, channel)), 0, 0]; CELLS]);
                }
            }
        }
        LeafScattering { depths: [[0.01, 0.02, 0.0]; LEAF_BANDS], ways: [[0.0, 1.5, 3.0, 6.0]; 4], cells }
    }

    fn state(chlorophyll: f32) -> LeafState {
        LeafState {
            mode: LeafMode::Tissue,
            chlorophyll_ug_per_cm2: chlorophyll,
            carotenoid_ug_per_cm2: 0.0,
            ..LeafState::default()
        }
    }

    fn tissue(state: &LeafState, texture: &LeafTexture, table: &LeafScattering) -> Result<Leaf, LeafError> {
        let mut leaf = Leaf::new(&LeafState { mode: LeafMode::NLayers, ..*state }, texture)?;
        leaf.add_scattering(table)?;
        leaf.set_state(state)?;
        Ok(leaf)
    }

    fn light(leaf: &Leaf, wi_deg: f64, wo_deg: f64, tint: [f32; 3]) -> [f32; 3] {
        let [wi, wo] = [direction_from_degrees(wi_deg, 20.0), direction_from_degrees(wo_deg, 70.0)];
        ViewedLeaf::new(leaf.words(), [0.4, 0.2], 0, [1.0; 4], wo).tinted(tint).light(wi)
    }

    #[test]
    fn each_face_and_side_has_its_own_light_and_ways_lose_what_they_absorb() {
        let texture = LeafTexture::uniform(LeafTexel::default());
        for channels in [1, 3] {
            for chlorophyll in [0.0, 40.0] {
                let leaf = tissue(&state(chlorophyll), &texture, &matt(channels)).unwrap();
                // A grey absorption and white light: all bands and their shares add up to one value.
                let left = (-0.01 * chlorophyll * 1.5).exp();
                for (wi, wo, face, side) in
                    [(30f64, 50.0, 0, 0), (130.0, 160.0, 1, 0), (150.0, 40.0, 1, 1), (20.0, 110.0, 0, 1)]
                {
                    let tint = [1.0, 0.5, 1.0];
                    let found = light(&leaf, wi, wo, tint);
                    let cos_i = wi.to_radians().cos().abs() as f32;
                    for (rgb, found) in found.into_iter().enumerate() {
                        let surface = if side == 0 { 0.02 } else { 0.0 };
                        let inside = value(face, side, if channels == 1 { 0 } else { rgb });
                        let expected = cos_i * (surface + tint[rgb] * inside * left);
                        assert!((found - expected).abs() < 2e-4, "{channels} {wi} {wo} {rgb}: {found} {expected}");
                    }
                }
                let totals = way_totals(leaf.words(), 1, 1);
                let mean = if channels == 1 { 0.1 } else { 0.15 };
                assert!((totals[1] - mean).abs() < 1e-3 && totals[0] == 0.0, "{totals:?}");
            }
        }
    }

    #[test]
    fn a_leaf_with_a_table_may_be_plates_and_be_tissue_again() {
        let texture = LeafTexture { width: 3, texels: vec![LeafTexel::default(); 15] };
        let mut leaf = tissue(&state(30.0), &texture, &matt(3)).unwrap();
        let before = leaf.clone();
        leaf.set_state(&LeafState { mode: LeafMode::NLayers, ..state(30.0) }).unwrap();
        let plates = Leaf::new(leaf.state(), &texture).unwrap();
        let seen = |leaf: &Leaf| light(leaf, 30.0, 50.0, [1.0; 3]);
        assert_eq!(seen(&leaf), seen(&plates));
        assert_ne!(seen(&leaf), seen(&before));
        leaf.set_state(&state(30.0)).unwrap();
        assert_eq!(leaf, before);
        // Another table takes the place of the first.
        leaf.add_scattering(&matt(1)).unwrap();
        assert_eq!(leaf, tissue(&state(30.0), &texture, &matt(1)).unwrap());
        // Without a table there is no tissue.
        assert!(before.has_scattering() && !plates.has_scattering());
        assert_eq!(Leaf::new(&state(1.0), &texture), Err(LeafError::NoTable));
        assert_eq!(plates.clone().set_state(&state(1.0)), Err(LeafError::NoTable));
    }

    #[test]
    fn what_is_no_table_is_refused() {
        let texture = LeafTexture::uniform(LeafTexel::default());
        let is_refused = |change: &dyn Fn(&mut LeafScattering)| {
            let mut table = matt(1);
            change(&mut table);
            matches!(tissue(&state(1.0), &texture, &table), Err(LeafError::Scattering { .. }))
        };
        assert!(!is_refused(&|_| ()));
        assert!(is_refused(&|table| table.cells.truncate(CELLS)));
        assert!(is_refused(&|table| table.cells[7][2] = f16::NAN.to_bits()));
        assert!(is_refused(&|table| table.cells[7][2] = f16::from_f32(-1.0).to_bits()));
        assert!(is_refused(&|table| table.ways[2] = [0.0, 2.0, 1.0, 3.0]));
        assert!(is_refused(&|table| table.ways[1][0] = 0.1));
        assert!(is_refused(&|table| table.depths[3][1] = f32::NAN));
    }
}
