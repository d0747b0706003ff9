//! Bases of the clusters in few bits, for a resident form that is an eighth as large: each component is rounded as coarsely
//! as its coefficients are small, and each of its numbers takes as many bits as its component and channel need.
//!
//! In the colour frame most chroma takes no bits at all. The order and the widths of the numbers are those of the cluster;
//! a pair's numbers are a *row* of whole words, which a decoder reads from front to back, and a shorter sum reads a shorter
//! part. Numbers stand for levels that lie twice as close at zero as at the end, because most values are small: at equal
//! error that takes an eighth fewer bits than equal steps. `packed_widths.rs` chooses steps and widths.
//!
//! docs/reference/format.md, chapter "Packed bases", has the layout.

use crate::asset::asset::{Asset, Layer};
use crate::resident::expansion::Expansion;
use crate::resident::packed_part::{
    PACKED_PLACES, PLACE_WORDS, PackedBasis, WORD_BITS, code_words, packed_number, row_words,
};
use crate::resident::packed_widths::{ChosenCluster, PackedGoal, chosen_clusters, chosen_noise, spreads};
use crate::threads::{Threads, map};

/// Writes the low `width` bits of `code` behind the first `bit` bits of `words`.
fn push_bits(words: &mut [u32], bit: u32, width: u32, code: i32) {
    let (word, first) = ((bit / WORD_BITS) as usize, bit % WORD_BITS);
    let code = code as u32 & ((1u64 << width) - 1) as u32;
    words[word] |= code << first;
    if first + width > WORD_BITS {
        words[word + 1] |= code >> (WORD_BITS - first);
    }
}

/// The packed bases of a layer.
pub(crate) struct PackedLayer {
    /// Words of the part.
    pub words: Vec<u32>,
    /// Bits of a texel's codes, `[cluster][component]`.
    code_widths: Vec<Vec<u32>>,
    /// Number of words of a texel's codes, by cluster.
    pub code_words: Vec<usize>,
}

/// Packs the bases of all layers of `asset`; `None` for those without a residual. A goal in bytes is that of bases and codes
/// here. The same asset and goal give the same words on any number of threads.
///
/// Cost: two expansions of all bases, and some tens of passes over what the first one counted.
pub(crate) fn packed_bases(asset: &Asset, goal: PackedGoal, threads: Threads) -> Vec<Option<PackedLayer>> {
    let spreads: Vec<_> = (0..asset.layers.len()).map(|number| spreads(asset, number, threads)).collect();
    let noise = chosen_noise(&spreads, goal, threads);
    let layers = asset.layers.iter().zip(&spreads);
    layers
        .map(|(layer, spreads)| {
            let (unit, chosen) = chosen_clusters(spreads, noise, threads);
            packed_layer(layer, &chosen, unit, threads)
        })
        .collect()
}

/// Packs the bases of a layer; `None` without a residual.
fn packed_layer(layer: &Layer, chosen: &[ChosenCluster], unit: f32, threads: Threads) -> Option<PackedLayer> {
    let expansion = Expansion::of_layer(layer)?;
    let bases = layer.residual.as_ref()?.bases.len();
    let rows =
        map(threads, chosen.len(), |cluster| packed_rows(&expansion, cluster, layer, &chosen[cluster].bases, unit));
    let at_bases = PACKED_PLACES + PLACE_WORDS * chosen.len();
    let mut words = vec![unit.to_bits(), bases as u32, at_bases as u32, 0];
    let mut first = at_bases + bases * chosen.len();
    for (chosen, rows) in chosen.iter().zip(&rows) {
        words.extend([first, row_words(&chosen.bases), code_words(&chosen.bases)].map(|word| word as u32));
        first += rows.len();
    }
    words.extend(chosen.iter().flat_map(|chosen| &chosen.bases).map(|basis| basis.to_word()));
    words.extend(rows.iter().flatten());
    let widths = |chosen: &ChosenCluster| chosen.bases[1..].iter().map(|basis| basis.code_width).collect();
    Some(PackedLayer {
        words,
        code_widths: chosen.iter().map(widths).collect(),
        code_words: chosen.iter().map(|chosen| code_words(&chosen.bases)).collect(),
    })
}

impl PackedLayer {
    /// Appends the codes of a texel of `cluster`; `codes` are those of the components at hand.
    pub(crate) fn push_codes(&self, words: &mut Vec<u32>, cluster: u8, codes: impl Iterator<Item = i8>) {
        let (first, cluster) = (words.len(), usize::from(cluster));
        words.resize(first + self.code_words[cluster], 0);
        let mut bit = 0;
        for (code, width) in codes.zip(&self.code_widths[cluster]).filter(|(_, width)| **width > 0) {
            push_bits(&mut words[first..], bit, *width, i32::from(code));
            bit += width;
        }
    }
}

/// Returns the rows of a cluster, pair after pair.
fn packed_rows(expansion: &Expansion, cluster: usize, layer: &Layer, bases: &[PackedBasis], unit: f32) -> Vec<u32> {
    let [lights, length] = [layer.lights.len(), row_words(bases)];
    let mut words = vec![0u32; layer.views.len() * lights * length];
    let padded = expansion.padded();
    let inverses: Vec<f32> = bases.iter().map(|basis| 1.0 / (basis.step() * unit).max(1e-38)).collect();
    expansion.frame_rows(cluster, |pair, values| {
        let row = &mut words[pair * length..(pair + 1) * length];
        let mut bit = 0;
        for (j, (basis, inverse)) in bases.iter().zip(&inverses).enumerate() {
            for (channel, width) in basis.widths.iter().enumerate().filter(|(_, width)| **width > 0) {
                push_bits(row, bit, *width, packed_number(values[channel * padded + j] * inverse, *width));
                bit += width;
            }
        }
    });
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::residual::ResidualKind;
    use crate::decode::decode::{decode, decode_single};
    use crate::decode::options::{DecodeOptions, Interpolation};
    use crate::levels::levels::with_levels;
    use crate::resident::packed_part::packed_bits;
    use crate::resident::resident::Resident;
    use crate::resident::single::SingleBases;
    use crate::testing::{Random, sample_asset, sample_grouped_asset, sample_relief_asset};
    use crate::threads::serial;

    /// Returns the root mean square of what packing changes the residual by, over all texels, pairs and channels of layer 0.
    fn added(asset: &Asset, packed: &Resident) -> f64 {
        let layer = &asset.layers[0];
        let [exact, rounded] = [SingleBases::from_asset_on(asset, &serial), SingleBases::of_packed(packed, &serial)];
        let planes: Vec<&[i8]> = layer.coefficient_planes();
        let padded = (planes.len() + 1).next_multiple_of(2);
        let rows = layer.views.len() * layer.lights.len() * 3;
        let mut sum = 0.0;
        for (texel, cluster) in layer.texel_clusters.iter().enumerate() {
            let first = usize::from(*cluster) * rows * padded;
            for row in 0..rows {
                let at = first + row * padded;
                let change = |basis: usize| exact.layer(0)[at + basis] - rounded.layer(0)[at + basis];
                let of_components = (0..planes.len()).map(|j| f32::from(planes[j][texel]) * change(1 + j));
                sum += f64::from(change(0) + of_components.sum::<f32>()).powi(2);
            }
        }
        (sum / (rows * layer.texel_clusters.len()) as f64).sqrt()
    }

    #[test]
    fn packed_bases_decode_as_the_numbers_that_they_tell() {
        for (seed, kind) in [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root].into_iter().enumerate() {
            let assets = [
                sample_asset(20 + seed as u64, 6, 5, kind),
                sample_grouped_asset(seed as u64, 9, 7, kind),
                sample_relief_asset(seed as u64, 8, 8),
            ];
            for asset in assets {
                let asset = with_levels(&asset, &serial);
                let packed = Resident::packed_on(&asset, PackedGoal::Noise(0.01), &serial);
                let (plain, singles) = (Resident::from_asset(&asset), SingleBases::of_packed(&packed, &serial));
                let mut random = Random::new(7);
                let mut differs = 0;
                for i in 0..600u32 {
                    let (wi, wo) = (random.direction(), random.direction());
                    let level = i % plain.levels();
                    let [width, rows] = plain.size(level * plain.layers());
                    let texel = random.below((width * rows) as usize) as u32;
                    let interpolation = if i % 3 == 0 { Interpolation::Exact } else { Interpolation::Fast };
                    let options = DecodeOptions { interpolation, components: i % 9, ..DecodeOptions::default() };
                    let layer = level * plain.layers();
                    let value = decode(&packed, layer, texel, wi, wo, &options);
                    if level == 0 {
                        let expected = decode_single(&plain, &singles, layer, texel, wi, wo, &options);
                        let near = (0..3).all(|c| (value[c] - expected[c]).abs() <= 1e-4 + 1e-4 * expected[c].abs());
                        assert!(near, "{kind:?} {i}: {value:?} {expected:?}");
                    }
                    let whole = decode(&plain, layer, texel, wi, wo, &options);
                    differs += usize::from((0..3).any(|c| (value[c] - whole[c]).abs() > 1e-4 + 1e-4 * whole[c].abs()));
                    let near = (0..3).all(|c| (value[c] - whole[c]).abs() <= 0.3 + 0.3 * whole[c].abs());
                    assert!(near, "{kind:?} {i}: {value:?} {whole:?}");
                }
                // Planted difference: the bases that were packed.
                assert!(differs > 20, "{differs}");
            }
        }
    }

    #[test]
    fn goals_are_kept_and_nearly_used() {
        let asset = sample_grouped_asset(3, 24, 18, ResidualKind::Root);
        let plain = Resident::from_asset(&asset);
        let bases = 4 * plain.bases_of(0).len() as u64;
        let others = 4 * plain.words().len() as u64 - bases;
        let of_noise = |noise: f32| {
            let packed = Resident::packed_on(&asset, PackedGoal::Noise(noise), &serial);
            (added(&asset, &packed), 4 * packed.words().len() as u64 - others.min(4 * packed.words().len() as u64))
        };
        let mut before = u64::MAX;
        for noise in [1e-4, 1e-3, 1e-2] {
            let (error, bytes) = of_noise(noise);
            assert!(error < 1.1 * f64::from(noise) && error > 0.6 * f64::from(noise), "{noise}: {error}");
            assert!(bytes < before && bytes < bases, "{bytes} of {bases}");
            before = bytes;
        }
        for share in [3, 6, 12] {
            let packed = packed_bases(&asset, PackedGoal::Bytes(bases / share), &serial);
            let codes = |layer: &PackedLayer| {
                let of_texels = asset.layers[0].texel_clusters.iter();
                of_texels.map(|cluster| layer.code_words[usize::from(*cluster)]).sum::<usize>()
            };
            let words: usize = packed.iter().flatten().map(|layer| layer.words.len() + codes(layer)).sum();
            let bytes = 4 * words as u64;
            assert!(bytes <= bases / share && bytes > bases / share / 2, "{share}: {bytes} of {bases}");
        }
        // What cannot be kept is as small as it gets.
        let packed = packed_bases(&asset, PackedGoal::Bytes(1), &serial);
        let words = packed[0].as_ref().unwrap().words.len();
        assert!(words < 100, "{words}");
    }

    #[test]
    fn numbers_come_back_from_their_bits() {
        let mut words = [0; 3];
        let numbers = [(15, -16_384), (15, 16_383), (12, -1), (2, 1), (2, -2), (15, 77), (8, -128)];
        let mut bit = 0;
        for (width, code) in numbers {
            push_bits(&mut words, bit, width, code);
            bit += width;
        }
        bit = 0;
        for (width, code) in numbers {
            assert_eq!(packed_bits(&words, bit, width), code);
            bit += width;
        }
    }
}
