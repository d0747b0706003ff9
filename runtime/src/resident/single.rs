//! Bases expanded in single precision beside the resident form, for measuring the error of its half precision.

use crate::asset::asset::Asset;
use crate::asset::limits::channel_words;
use crate::asset::residual::COLOUR_FRAME;
use crate::resident::expansion::Expansion;
use crate::resident::layout::{ASSET_LAYERS, block};
use crate::resident::packed_part::PackedPart;
use crate::resident::resident::Resident;
use crate::threads::{Threads, fill};

/// The expanded bases of every layer in single precision, `[cluster, pair, channel, basis]`, bases padded: the order of the resident form's halves. They take twice the memory of those.
#[derive(Debug, Clone, PartialEq)]
pub struct SingleBases {
    layers: Vec<Vec<f32>>,
}

impl SingleBases {
    /// Expands the bases of `asset`. Cost: as [`crate::Resident::from_asset_on`].
    pub fn from_asset_on(asset: &Asset, threads: Threads) -> SingleBases {
        let layers = asset.layers.iter().map(|layer| {
            let Some(expansion) = Expansion::of_layer(layer) else {
                return Vec::new();
            };
            let length = expansion.entries() * expansion.padded();
            let mut values = vec![0.0f32; layer.dictionary.len() * length];
            fill(threads, &mut values, length, |cluster, values| {
                expansion.rows(cluster, |view, rows| {
                    values[view * rows.len()..(view + 1) * rows.len()].copy_from_slice(rows);
                });
            });
            values
        });
        SingleBases { layers: layers.collect() }
    }

    /// Returns the packed bases of `resident` ([`Resident::packed_on`]) as single numbers, in the same order; empty for
    /// layers whose bases are not packed.
    pub fn of_packed(resident: &Resident, threads: Threads) -> SingleBases {
        let words = resident.words();
        let layers = (0..resident.layers()).map(|layer| {
            if !resident.is_packed(layer) {
                return Vec::new();
            }
            let at = words[ASSET_LAYERS + layer as usize] as usize;
            let field = |field: usize| words[at + field] as usize;
            let (bases, pairs) = (field(block::BASES), field(block::PAIRS));
            let padded = 2 * channel_words(bases);
            let part = PackedPart::new(words, field(block::BASIS));
            let mut values = vec![0.0f32; field(block::CLUSTERS) * pairs * 3 * padded];
            fill(threads, &mut values, pairs * 3 * padded, |cluster, values| {
                for (pair, rgb) in values.chunks_exact_mut(3 * padded).enumerate() {
                    part.unpack(cluster, pair, bases, |basis, channel, value| {
                        (0..3).for_each(|c| rgb[c * padded + basis] += COLOUR_FRAME[channel][c] * value);
                    });
                }
            });
            values
        });
        SingleBases { layers: layers.collect() }
    }

    /// Returns the values of layer `layer`; empty without residual.
    ///
    /// # Panics
    /// If `layer` is out of range.
    pub fn layer(&self, layer: usize) -> &[f32] {
        &self.layers[layer]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::residual::ResidualKind;
    use crate::decode::decode::{decode, decode_single};
    use crate::decode::options::{DecodeOptions, Interpolation};
    use crate::numeric::quantize::word_from_halves;
    use crate::resident::layout::{ASSET_LAYERS, block};
    use crate::resident::resident::Resident;
    use crate::testing::{Random, sample_asset};
    use crate::threads::serial;
    use half::f16;

    #[test]
    fn single_precision_bases_are_those_that_the_resident_form_rounds() {
        let asset = sample_asset(4, 6, 5, ResidualKind::Root);
        let resident = Resident::from_asset(&asset);
        let bases = SingleBases::from_asset_on(&asset, &serial);
        let words = resident.words();
        let at = words[words[ASSET_LAYERS] as usize + block::BASIS] as usize;
        let values = bases.layer(0);
        let halves: Vec<u32> = values.chunks_exact(2).map(|two| word_from_halves(two[0], two[1])).collect();
        assert_eq!(words[at..at + halves.len()], halves);
        assert!(values.iter().any(|x| f16::from_f32(*x).to_f32() != *x), "some are not halves");
    }

    #[test]
    fn both_precisions_decode_alike_but_not_equally() {
        let asset = sample_asset(5, 6, 5, ResidualKind::Root);
        let resident = Resident::from_asset(&asset);
        let bases = SingleBases::from_asset_on(&asset, &serial);
        let mut rounded = bases.clone();
        rounded.layers[0].iter_mut().for_each(|x| *x = f16::from_f32(*x).to_f32());
        let mut random = Random::new(3);
        let mut differs = 0;
        for i in 0..400u32 {
            let (wi, wo, texel) = (random.direction(), random.direction(), random.below(30) as u32);
            let interpolation = if i % 2 == 0 { Interpolation::Fast } else { Interpolation::Exact };
            let options = DecodeOptions { interpolation, components: i % 7, ..DecodeOptions::default() };
            let half = decode(&resident, 0, texel, wi, wo, &options);
            let single = decode_single(&resident, &bases, 0, texel, wi, wo, &options);
            assert_eq!(decode_single(&resident, &rounded, 0, texel, wi, wo, &options), half);
            assert!((0..3).all(|c| (half[c] - single[c]).abs() <= 2e-3 + 2e-3 * half[c].abs()), "{half:?} {single:?}");
            differs += usize::from(half != single);
        }
        assert!(differs > 100, "{differs}");
    }
}
