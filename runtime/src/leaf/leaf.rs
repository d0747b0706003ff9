//! A leaf whose optics are evaluated live, as renderers hold it: one array of words.

use crate::leaf::error::LeafError;
use crate::leaf::figures::{BAND_SHARES, LEAF_BANDS, LEAF_ROWS, LeafRow, PRINTED_ROWS, THREE_ROWS};
use crate::leaf::gloss::albedo_table;
use crate::leaf::optics::{Faces, absorption, n_plates, plates_in_air};
use crate::leaf::scatter::LeafScattering;
use crate::leaf::state::{LeafMode, LeafState, TwoHalves};
use crate::leaf::texture::LeafTexture;
use crate::leaf::theta::exact_theta;
use crate::leaf::words::{
    ALBEDO_AT, BANDS_AT, CHANNELS_AT, HALVES_AT, LEAF_MAGIC, LEVELS_AT, SCATTER_AT, STATE_AT, TABLE_AT, TABLE_ENTRIES,
    TABLE_HALF,
};
use std::ops::Range;

/// Largest absorption of a layer; theta is 0 long before.
const MAX_K: f64 = 1e6;

/// Shares of the channels if each band is one channel.
const ONE_EACH: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// A leaf: its words, and the state from which they were made. `leaf/words.rs` has the layout.
#[derive(Debug, Clone, PartialEq)]
pub struct Leaf {
    state: LeafState,
    words: Vec<u32>,
    /// Optical depths of the bands of an algorithmic model, where the leaf has its table.
    depths: Option<[[f32; 3]; LEAF_BANDS]>,
}

impl Leaf {
    /// Lays out a leaf of `state` under `texture`. Costs that of [`Leaf::set_state`], and 21 bytes per texel.
    ///
    /// A quantity beyond the ranges of [`LeafState::check`] is evaluated at the nearest value that can be.
    ///
    /// # Errors
    /// [`LeafError::OutOfRange`] for a quantity that is not finite, [`LeafError::Texels`].
    pub fn new(state: &LeafState, texture: &LeafTexture) -> Result<Leaf, LeafError> {
        state.check_finite()?;
        if state.mode == LeafMode::Tissue {
            return Err(LeafError::NoTable);
        }
        let rows = texture.rows()?;
        let (texels, levels) = texture.words(rows);
        let mut words = vec![LEAF_MAGIC, levels, texture.width as u32, rows as u32];
        words.extend(state_words(state, albedo_words(state), None));
        words.extend(texels);
        Ok(Leaf { state: *state, words, depths: None })
    }

    /// Adds the table of an algorithmic model, which [`LeafMode::Tissue`] needs: 0.13 MB, or 0.38 MB for three channels. The state stays
    /// as it is.
    ///
    /// # Errors
    /// [`LeafError::Scattering`]; the leaf then stays as it was.
    pub fn add_scattering(&mut self, scattering: &LeafScattering) -> Result<(), LeafError> {
        let channels = scattering.channels()?;
        if self.has_scattering() {
            self.words.truncate(self.words[SCATTER_AT] as usize);
        }
        self.words[SCATTER_AT] = self.words.len() as u32;
        self.words[CHANNELS_AT] = channels as u32;
        self.words.extend(scattering.words(channels));
        self.depths = Some(scattering.depths);
        // A leaf that is tissue already holds the depths of the table before.
        let state = self.state;
        self.set_state(&state).map(|_| ())
    }

    /// Returns whether the leaf has the table of an algorithmic model, which [`LeafMode::Tissue`] needs.
    pub fn has_scattering(&self) -> bool {
        self.depths.is_some()
    }

    /// Returns the words, which a renderer copies to its buffer.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// Returns the number of texels in a row of the finest level, and of its rows.
    pub fn size(&self) -> [u32; 2] {
        [self.words[2], self.words[3]]
    }

    /// Returns the number of levels of the textures.
    pub fn levels(&self) -> u32 {
        self.words[1]
    }

    /// Returns the state as it was given.
    pub fn state(&self) -> &LeafState {
        &self.state
    }

    /// Returns the share of light from all directions that the leaf's surface reflects before any enters the leaf,
    /// where the weight of gloss is 1: 0 to 1.
    pub fn gloss_albedo(&self) -> f32 {
        f32::from_bits(self.words[STATE_AT + 5])
    }

    /// Changes the state and returns the range of words that changed; the textures stay. docs/results/trade.md has the times:
    /// contents and structure can change in every frame, two unequal roughnesses cannot.
    ///
    /// # Errors
    /// [`LeafError::OutOfRange`] for a quantity that is not finite, [`LeafError::NoTable`]; the leaf then stays as it was.
    pub fn set_state(&mut self, state: &LeafState) -> Result<Range<usize>, LeafError> {
        state.check_finite()?;
        if state.mode == LeafMode::Tissue && self.depths.is_none() {
            return Err(LeafError::NoTable);
        }
        let gloss = |state: &LeafState| state.values()[7..].to_vec();
        let albedo = match gloss(state) == gloss(&self.state) {
            true => (self.words[ALBEDO_AT..TABLE_AT].to_vec(), self.words[STATE_AT + 5]),
            false => albedo_words(state),
        };
        let mut new = state_words(state, albedo, self.depths.as_ref());
        for kept in [SCATTER_AT, CHANNELS_AT] {
            new[kept - STATE_AT] = self.words[kept];
        }
        let old = &mut self.words[STATE_AT..LEVELS_AT];
        let differs = |i: &usize| old[*i] != new[*i];
        let first = (0..new.len()).find(differs).unwrap_or(0);
        let end = (first..new.len()).rfind(differs).map_or(first, |last| last + 1);
        old[first..end].copy_from_slice(&new[first..end]);
        self.state = *state;
        Ok(STATE_AT + first..STATE_AT + end)
    }
}

/// Returns the words of the table of directional albedo, and its mean.
fn albedo_words(state: &LeafState) -> (Vec<u32>, u32) {
    let (table, mean) = albedo_table(&state.evaluable());
    (table.into_iter().map(f32::to_bits).collect(), mean.to_bits())
}

/// Returns the words from [`STATE_AT`] to [`LEVELS_AT`], but for those of [`SCATTER_AT`] and [`CHANNELS_AT`]. `depths` are those of
/// an algorithmic model.
fn state_words(
    state: &LeafState,
    (albedo, mean_albedo): (Vec<u32>, u32),
    depths: Option<&[[f32; 3]; LEAF_BANDS]>,
) -> Vec<u32> {
    let mode = state.mode;
    let state = state.evaluable();
    let bands: Vec<(LeafRow, [f32; 3])> = match mode {
        LeafMode::ThreePiece => PRINTED_ROWS.into_iter().zip(ONE_EACH).collect(),
        LeafMode::Rational => THREE_ROWS.into_iter().zip(ONE_EACH).collect(),
        LeafMode::NLayers | LeafMode::TwoSided | LeafMode::Tissue => {
            BAND_SHARES.iter().filter_map(|(nm, shares)| Some((row_at(*nm)?, *shares))).collect()
        }
    };
    let gloss = [state.gloss_index, state.gamma_along, state.gamma_across].map(f32::to_bits);
    let mut words = vec![mode as u32, bands.len() as u32, gloss[0], gloss[1], gloss[2], mean_albedo];
    words.resize(HALVES_AT - STATE_AT, 0);
    let halves = TwoHalves::BROAD_LEAF.of_layers();
    if mode == LeafMode::TwoSided {
        words.extend(halves.iter().flat_map(|half| [half[1], half[2]]).map(|ratio| (ratio as f32).to_bits()));
    }
    words.resize(BANDS_AT - STATE_AT, 0);
    for (band, (row, shares)) in bands.iter().enumerate() {
        // Brown pigment and anthocyanins share a factor, and so do water and dry matter, which have none.
        let per_layer =
            |contents: Range<usize>| (absorption(row, &state, contents) / f64::from(state.structure)).min(MAX_K) as f32;
        let parts = match depths {
            Some(depths) if mode == LeafMode::Tissue => {
                let [chlorophyll, carotenoid, rest] = depths[band];
                let pigments = [chlorophyll * state.chlorophyll_ug_per_cm2, carotenoid * state.carotenoid_ug_per_cm2];
                [pigments[0], pigments[1], 0.0, rest].map(|depth| depth.min(MAX_K as f32))
            }
            _ => [0..1, 1..2, 2..4, 4..6].map(per_layer),
        };
        let faces = Faces::new(row.index);
        let passes = if mode == LeafMode::TwoSided { faces.entry } else { faces.exit } as f32;
        words.extend(parts.iter().chain(shares).chain([&passes]).map(|x| x.to_bits()));
    }
    words.resize(ALBEDO_AT - STATE_AT, 0);
    words.extend(albedo);
    let structure = f64::from(state.structure);
    let mut tables = |of: &dyn Fn(f64, Faces) -> [f64; 2]| {
        for row in BAND_SHARES.iter().filter_map(|(nm, _)| row_at(*nm)) {
            let faces = Faces::new(row.index);
            words.extend(table(|theta| of(theta, faces)));
        }
    };
    match mode {
        LeafMode::TwoSided => {
            for [share, ..] in halves {
                tables(&|theta, faces| plates_in_air(theta, faces, share * structure));
            }
        }
        _ => tables(&|theta, faces| n_plates(theta, faces, structure)),
    }
    words.resize(LEVELS_AT - STATE_AT, 0);
    words
}

/// Returns the row of a wavelength.
fn row_at(wavelength_nm: f32) -> Option<LeafRow> {
    LEAF_ROWS.iter().find(|row| row.wavelength_nm == wavelength_nm).copied()
}

/// Computes a band's table of reflectance and transmittance, which `of` returns for the transmission theta of a layer. Both are
/// rounded so that they never add up to more than 1, and to exactly 1 without absorption.
fn table(of: impl Fn(f64) -> [f64; 2]) -> Vec<u32> {
    (0..TABLE_ENTRIES)
        .map(|i| {
            let u = i as f64 / (TABLE_ENTRIES - 1) as f64;
            let k = f64::from(TABLE_HALF) * u / (1.0 - u);
            let [front, behind] = of(exact_theta(k));
            let front = (front * 65535.0).round();
            let behind = (behind * 65535.0).round().min(65535.0 - front);
            front as u32 | (behind as u32) << 16
        })
        .collect()
}

const _: () = assert!(BAND_SHARES.len() == LEAF_BANDS);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leaf::figures::LEAF_BAND_NM;
    use crate::leaf::texture::LeafTexel;

    #[test]
    fn a_changed_state_rewrites_what_it_touches_and_leaves_what_a_new_leaf_has() {
        let texture = LeafTexture { width: 3, texels: vec![LeafTexel::default(); 15] };
        let mut leaf = Leaf::new(&LeafState::default(), &texture).unwrap();
        assert_eq!(leaf.words()[0], LEAF_MAGIC);
        let state = LeafState { chlorophyll_ug_per_cm2: 10.0, ..LeafState::default() };
        let touched = leaf.set_state(&state).unwrap();
        assert!(touched.start >= BANDS_AT && touched.end <= ALBEDO_AT, "{touched:?}");
        let steps = [
            LeafState { structure: 2.0, ..state },
            LeafState { gamma_along: 0.4, ..state },
            LeafState { mode: LeafMode::Rational, ..state },
            LeafState { mode: LeafMode::TwoSided, ..state },
            LeafState { mode: LeafMode::ThreePiece, brown: 0.5, gamma_across: 0.1, ..state },
        ];
        for state in steps {
            let before = leaf.words().to_vec();
            let touched = leaf.set_state(&state).unwrap();
            assert!(touched.start >= STATE_AT && touched.end <= LEVELS_AT && !touched.is_empty());
            assert_eq!(leaf, Leaf::new(&state, &texture).unwrap());
            let elsewhere = |words: &[u32]| [&words[..touched.start], &words[touched.end..]].concat();
            assert_eq!(elsewhere(&before), elsewhere(leaf.words()));
        }
        assert!(leaf.set_state(&steps[4]).unwrap().is_empty());
        let before = leaf.clone();
        assert!(leaf.set_state(&LeafState { water_cm: f32::NAN, ..state }).is_err());
        assert_eq!(leaf, before);
    }

    #[test]
    fn tables_lose_no_light_and_make_none() {
        for row in LEAF_ROWS {
            for layers in [1.0, 1.5, 3.0, 40.0] {
                let faces = Faces::new(row.index);
                let sum = |word: &u32| (word & 0xffff) + (word >> 16);
                let whole = table(|theta| n_plates(theta, faces, layers));
                assert_eq!(whole[TABLE_ENTRIES - 1], 0);
                for table in [whole, table(|theta| plates_in_air(theta, faces, 0.1 * layers))] {
                    assert_eq!(sum(&table[0]), 65535);
                    assert!(table.iter().all(|word| sum(word) <= 65535));
                }
            }
        }
    }

    #[test]
    fn every_band_has_a_row_and_the_shares_of_each_channel_add_up_to_1() {
        for ((nm, _), told) in BAND_SHARES.into_iter().zip(LEAF_BAND_NM) {
            assert!(row_at(nm).is_some() && nm == told, "{nm}");
        }
        for channel in 0..3 {
            let sum: f32 = BAND_SHARES.iter().map(|(_, shares)| shares[channel]).sum();
            assert!((sum - 1.0).abs() < 2e-6, "{sum}");
        }
    }
}
