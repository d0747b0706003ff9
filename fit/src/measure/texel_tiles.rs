//! Texels of a layer in tiles of one cluster each, laid out so that a decoder's loops run over neighbouring texels in
//! vectors: at one pair all texels of a tile share their lobes' values and their bases' rows.

use btf_runtime::{Layer, weight_from_byte};
use pulp::Simd;

/// Texels of a tile at most: with 80 components the weights of a tile still fit in a core's first cache.
pub const TILE_TEXELS: usize = 64;
/// Vectors of texels whose sums are held in registers at a time: with three channels each, enough that no addition
/// waits for the one before.
const STRIP: usize = 2;

/// A number per channel and texel of a tile. Places behind the tile's last texel hold any finite number.
pub type TileRgb = [[f32; TILE_TEXELS]; 3];

/// Rows of two successive bases at one pair: `[channel][basis]`.
pub type RowWord = [[f32; 2]; 3];

/// A tile: texels of one cluster.
pub struct TexelTile {
    /// Cluster of the texels.
    pub cluster: usize,
    /// Numbers of the texels in the layer.
    pub texels: Vec<u32>,
    slots: Vec<LobeSlot>,
    /// Codes `[basis, texel]`: 1 for the mean, then coefficient codes, then 0 up to an even number of bases.
    codes: Vec<[i8; TILE_TEXELS]>,
}

/// The n-th lobe of every texel of a tile; weight 0 where a texel has fewer.
struct LobeSlot {
    /// Index into the cluster's dictionary.
    lobes: [u8; TILE_TEXELS],
    weights: TileRgb,
}

/// Weights of a tile's bases, unpacked for as many pairs as follow.
#[derive(Default)]
pub struct BasisWeights {
    /// `[basis, texel]`.
    weights: Vec<[f32; TILE_TEXELS]>,
}

/// Returns all texels of `layer` in tiles, with at most `most_lobes` lobes and `bases` bases (0 without residual; the
/// first is the mean).
///
/// Memory: a byte per texel and basis, and 13 per texel and lobe.
pub fn texel_tiles(layer: &Layer, bases: usize, most_lobes: usize) -> Vec<TexelTile> {
    let lobe_count = |texel: u32| usize::from(layer.texel_lobe_counts[texel as usize]).min(most_lobes);
    let mut first_ref = Vec::with_capacity(layer.texel_lobe_counts.len());
    let mut next = 0usize;
    for count in &layer.texel_lobe_counts {
        first_ref.push(next);
        next += usize::from(*count);
    }
    // Texels with equally many lobes together: a tile has as many slots as its texel with the most.
    let mut order: Vec<u32> = (0..layer.texel_clusters.len() as u32).collect();
    order.sort_by_key(|texel| (layer.texel_clusters[*texel as usize], lobe_count(*texel)));
    order
        .chunk_by(|a, b| layer.texel_clusters[*a as usize] == layer.texel_clusters[*b as usize])
        .flat_map(|members| members.chunks(TILE_TEXELS))
        .map(|texels| {
            let cluster = usize::from(layer.texel_clusters[texels[0] as usize]);
            let slot_count = texels.iter().map(|texel| lobe_count(*texel)).max().unwrap_or(0);
            let slots = (0..slot_count).map(|slot| {
                let mut found = LobeSlot { lobes: [0; TILE_TEXELS], weights: [[0.0; TILE_TEXELS]; 3] };
                for (i, texel) in texels.iter().enumerate().filter(|(_, texel)| slot < lobe_count(**texel)) {
                    let reference = layer.lobe_refs[first_ref[*texel as usize] + slot];
                    let scale = layer.dictionary[cluster][usize::from(reference.lobe)].weight_scale;
                    found.lobes[i] = reference.lobe;
                    for c in 0..3 {
                        found.weights[c][i] = weight_from_byte(reference.weight[c].into(), scale);
                    }
                }
                found
            });
            TexelTile { cluster, texels: texels.to_vec(), slots: slots.collect(), codes: codes(layer, bases, texels) }
        })
        .collect()
}

fn codes(layer: &Layer, bases: usize, texels: &[u32]) -> Vec<[i8; TILE_TEXELS]> {
    let Some(residual) = layer.residual.as_ref().filter(|_| bases > 0) else {
        return Vec::new();
    };
    let mut codes = vec![[0; TILE_TEXELS]; bases.next_multiple_of(2)];
    codes[0] = [1; TILE_TEXELS];
    for (codes, plane) in codes[1..bases].iter_mut().zip(&residual.coefficients) {
        for (code, texel) in codes.iter_mut().zip(texels) {
            *code = plane.codes[*texel as usize];
        }
    }
    codes
}

impl TexelTile {
    /// Returns the number of lobes of the texel that has the most.
    pub fn slot_count(&self) -> usize {
        self.slots.len()
    }

    /// Tells whether any texel has a lobe.
    pub fn has_lobes(&self) -> bool {
        !self.slots.is_empty()
    }

    /// Unpacks the weights of the tile's bases.
    #[inline(always)]
    pub fn unpack(&self, into: &mut BasisWeights) {
        into.weights.clear();
        into.weights.extend(self.codes.iter().map(|codes| codes.map(f32::from)));
    }

    /// Appends the tile's codes in words of four successive bases: `[quad of bases, texel]`.
    pub fn push_quads(&self, words: &mut Vec<u32>) {
        for quad in self.codes.chunks(4) {
            let code = |basis: usize, texel: usize| quad.get(basis).map_or(0, |codes| codes[texel]);
            let word = |texel| u32::from_le_bytes([0, 1, 2, 3].map(|basis| code(basis, texel) as u8));
            words.extend((0..TILE_TEXELS).map(word));
        }
    }

    /// Appends the tile's lobes, `[slot, texel]`: each the number of the lobe, from `first` on, and the bits of the weights of
    /// red, green and blue.
    pub fn push_slots(&self, first: u32, slots: &mut Vec<[u32; 4]>) {
        for slot in &self.slots {
            let weight = |c: usize, texel: usize| slot.weights[c][texel].to_bits();
            let entry =
                |texel| [first + u32::from(slot.lobes[texel]), weight(0, texel), weight(1, texel), weight(2, texel)];
            slots.extend((0..TILE_TEXELS).map(entry));
        }
    }

    /// Sums the lobes of every texel into `sums`; `values` are those of the cluster's dictionary at one pair.
    ///
    /// A texel's additions have the order of its lobes; places without texel get 0.
    #[inline(always)]
    pub fn lobe_sums(&self, values: &[f32], sums: &mut TileRgb) {
        *sums = [[0.0; TILE_TEXELS]; 3];
        for slot in &self.slots {
            let value = slot.lobes.map(|lobe| values[usize::from(lobe)]);
            for c in 0..3 {
                for i in 0..TILE_TEXELS {
                    sums[c][i] += slot.weights[c][i] * value[i];
                }
            }
        }
    }
}

impl BasisWeights {
    /// Sums the bases of every texel into `sums`; `rows` are those of the tile's cluster at one pair, one per two
    /// bases.
    ///
    /// A texel's additions have the order of the bases, two by two; products are rounded before they are added.
    #[inline(always)]
    pub fn residual_sums<S: Simd>(&self, simd: S, rows: &[RowWord], sums: &mut TileRgb) {
        let lanes = S::F32_LANES;
        for first in (0..TILE_TEXELS).step_by(STRIP * lanes) {
            let mut sum = [[simd.splat_f32s(0.0); STRIP]; 3];
            for (weights, row) in self.weights.chunks_exact(2).zip(rows) {
                let [even, odd] = [0, 1].map(|basis| strip::<S>(&weights[basis], first));
                for c in 0..3 {
                    let [h, k] = row[c].map(|x| simd.splat_f32s(x));
                    for i in 0..STRIP {
                        let both = simd.add_f32s(simd.mul_f32s(even[i], h), simd.mul_f32s(odd[i], k));
                        sum[c][i] = simd.add_f32s(sum[c][i], both);
                    }
                }
            }
            for c in 0..3 {
                let (to, _) = S::as_mut_simd_f32s(&mut sums[c][first..first + STRIP * lanes]);
                to.copy_from_slice(&sum[c]);
            }
        }
    }
}

/// Returns the vectors of `row` from texel `first` on.
#[inline(always)]
fn strip<S: Simd>(row: &[f32; TILE_TEXELS], first: usize) -> [S::f32s; STRIP] {
    let (vectors, _) = S::as_simd_f32s(&row[first..first + STRIP * S::F32_LANES]);
    [vectors[0], vectors[1]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_asset::sample_asset_with;
    use btf_capture::DirectionSet;
    use btf_runtime::ResidualKind;

    #[test]
    fn every_texel_lies_in_one_tile_of_its_cluster_with_its_weights() {
        let (views, lights) = (DirectionSet::random(3, 3).unwrap(), DirectionSet::random(2, 4).unwrap());
        let asset = sample_asset_with(31, 23, &views, &lights, ResidualKind::Root);
        let layer = &asset.layers[0];
        let residual = layer.residual.as_ref().unwrap();
        let bases = residual.bases.len();
        let tiles = texel_tiles(layer, bases, 3);
        let mut met: Vec<u32> = tiles.iter().flat_map(|tile| tile.texels.clone()).collect();
        met.sort_unstable();
        assert_eq!(met, (0..31 * 23).collect::<Vec<_>>());
        let (mut weights, mut first) = (BasisWeights::default(), vec![0]);
        layer.texel_lobe_counts.iter().for_each(|count| first.push(first[first.len() - 1] + usize::from(*count)));
        let (mut partial, mut wrong) = (0, 0);
        for tile in &tiles {
            assert!(tile.texels.len() <= TILE_TEXELS);
            partial += usize::from(tile.texels.len() < TILE_TEXELS);
            // A row of one basis and one channel at a time picks a single weight out.
            tile.unpack(&mut weights);
            for basis in 0..bases {
                let mut rows = vec![[[0.0; 2]; 3]; bases.div_ceil(2)];
                rows[basis / 2][basis % 3][basis % 2] = 1.0;
                let mut sums = [[f32::NAN; TILE_TEXELS]; 3];
                weights.residual_sums(pulp::Scalar, &rows, &mut sums);
                for (i, texel) in tile.texels.iter().enumerate() {
                    assert_eq!(usize::from(layer.texel_clusters[*texel as usize]), tile.cluster);
                    let code = basis.checked_sub(1).map_or(1, |j| residual.coefficients[j].codes[*texel as usize]);
                    assert_eq!(sums[basis % 3][i], f32::from(code));
                    assert_eq!(sums[(basis + 1) % 3][i], 0.0);
                    wrong += usize::from(i > 0 && sums[basis % 3][i - 1] != f32::from(code));
                }
            }
            // Lobe values in powers of 2 tell the lobes apart.
            let dictionary = &layer.dictionary[tile.cluster];
            let values: Vec<f32> = (0..dictionary.len()).map(|lobe| 0.5f32.powi(lobe as i32)).collect();
            let mut sums = [[f32::NAN; TILE_TEXELS]; 3];
            tile.lobe_sums(&values, &mut sums);
            for (i, texel) in tile.texels.iter().enumerate() {
                let all = &layer.lobe_refs[first[*texel as usize]..first[*texel as usize + 1]];
                for c in 0..3 {
                    let by_hand: f32 = all.iter().take(3).fold(0.0, |sum, reference| {
                        let lobe = usize::from(reference.lobe);
                        sum + weight_from_byte(reference.weight[c].into(), dictionary[lobe].weight_scale) * values[lobe]
                    });
                    assert_eq!(sums[c][i], by_hand);
                }
            }
        }
        assert!(partial > 0 && wrong > 100, "a strip that is not full, and neighbours with other weights: {wrong}");
    }
}
