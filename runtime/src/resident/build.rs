//! Makes the resident form of an asset's file form: lays out the words, expands the bases, adds the edits.

use crate::asset::asset::{Asset, Layer};
use crate::asset::dictionary::{DictionaryLobe, LobeRef};
use crate::asset::edit::{EDIT_WORDS, Edits};
use crate::asset::heights::Heights;
use crate::asset::limits::channel_words;
use crate::asset::residual::Residual;
use crate::resident::expansion::Expansion;
use crate::resident::layout::{
    ASSET_LAYERS, ASSET_WORDS, HORIZON_COS, LAYER_BLOCK_WORDS, MIN_HORIZON_COS, PART_WORDS, SPECTRUM, block, level_size,
};
use crate::resident::packed_bases::{PackedLayer, packed_bases};
use crate::resident::packed_widths::PackedGoal;
use crate::resident::relief_records::relief_records;
use crate::resident::resident::Resident;
use crate::threads::{Threads, fill, serial};
use half::f16;
use half::slice::{HalfBitsSliceExt, HalfFloatSliceExt};

/// Largest half-precision number. Bases are clamped to it, because infinity times a zero weight is NaN.
const MAX_HALF: f32 = 65504.0;

impl Resident {
    /// Expands an asset, with its levels and edits, on the calling thread.
    pub fn from_asset(asset: &Asset) -> Resident {
        Resident::from_asset_on(asset, &serial)
    }

    /// Expands an asset like [`Resident::from_asset`], on `threads`. Cost: that of [`Resident::without_bases`] and
    /// [`Resident::expand_bases`].
    pub fn from_asset_on(asset: &Asset, threads: Threads) -> Resident {
        let mut resident = Resident::without_bases(asset);
        resident.expand_bases(asset, threads);
        resident
    }

    /// Lays out an asset like [`Resident::from_asset_on`], with bases in as few bits as `goal` allows: a renderer then holds
    /// an eighth of the bytes and reads a quarter. Where the goal cannot be met, the bases take the least bytes.
    ///
    /// Cost: twice that of [`Resident::from_asset_on`], and a search for the step.
    pub fn packed_on(asset: &Asset, goal: PackedGoal, threads: Threads) -> Resident {
        let goal = match goal {
            PackedGoal::Bytes(most) => PackedGoal::Bytes(most.saturating_sub(bytes_beside_bases(asset))),
            PackedGoal::Noise(_) => goal,
        };
        let packed = packed_bases(asset, goal, threads);
        let mut words = words_without_bases(asset, &packed);
        let layers = asset.layers.len();
        for (number, packed) in packed.iter().enumerate() {
            let Some(packed) = packed else { continue };
            let here = words.len() as u32;
            for level in 0..words[4] as usize {
                let at = words[ASSET_LAYERS + level * layers + number] as usize;
                words[at + block::BASIS] = here;
                words[at + block::CHANNEL_WORDS] = 0;
            }
            words.extend(&packed.words);
            begin_part(&mut words);
        }
        words[3] = words.len() as u32;
        with_edits(words, asset)
    }

    /// Lays out an asset with zeros in place of the bases ([`Resident::bases_of`]), for callers who expand them
    /// elsewhere. The zeros are never written, so that a system that commits memory page by page commits none for them.
    /// Cost: a pass over the other words.
    pub fn without_bases(asset: &Asset) -> Resident {
        with_edits(with_room_for_bases(words_without_bases(asset, &[]), asset), asset)
    }

    /// Expands the bases of `asset`, of which this must be made, on `threads`.
    ///
    /// Cost: with B bases of K clusters, V views, L lights, ranks rv and rl and E entries of the shared cores that are
    /// not 0, `B K (E + V rl (rv + L))` multiply-adds a channel, with SIMD; then one pass over the words.
    pub fn expand_bases(&mut self, asset: &Asset, threads: Threads) {
        let places: Vec<_> = (0..asset.layers.len()).map(|layer| self.bases_of(layer as u32)).collect();
        let words = self.own_words();
        for (layer, place) in asset.layers.iter().zip(places) {
            let (Some(residual), Some(expansion)) = (&layer.residual, Expansion::of_layer(layer)) else { continue };
            fill(threads, &mut words[place], cluster_words(residual), |cluster, words| {
                let halves: &mut [u16] = bytemuck::cast_slice_mut(words);
                let halves: &mut [f16] = halves.reinterpret_cast_mut();
                let mut clamped = Vec::new();
                expansion.rows(cluster, |view, rows| {
                    clamped.clear();
                    clamped.extend(rows.iter().map(|x| x.clamp(-MAX_HALF, MAX_HALF)));
                    halves[view * rows.len()..(view + 1) * rows.len()].convert_from_f32_slice(&clamped);
                });
            });
        }
    }

    /// Replaces the edits at all levels. `layers` must be those of the asset of which this is made. Cost: a word a
    /// texel, and the edits' lobes.
    pub fn set_edits(&mut self, edits: &Edits, layers: &[Layer]) {
        let finest = [self.width() as usize, self.height() as usize];
        let words = self.own_words();
        if words[5] == 0 {
            words[5] = words.len() as u32;
        }
        words.truncate(words[5] as usize);
        let count = words[2] as usize;
        for (number, layer) in layers.iter().enumerate().take(count) {
            begin_part(words);
            let list = if edits.list.is_empty() { 0 } else { words.len() as u32 };
            push_edits(words, edits, layer);
            for level in 0..words[4] as usize {
                let at = words[ASSET_LAYERS + level * count + number] as usize;
                words[at + block::EDITS] = list;
                words[at + block::EDIT_COUNT] = edits.list.len() as u32;
                let size = level_size(words, at);
                let of_level = edits.coarser(finest, size);
                let records = words[at + block::RECORDS] as usize;
                for texel in 0..size[0] * size[1] {
                    let edit = of_level.texels.get(texel).copied().unwrap_or(0);
                    let word = &mut words[records + 2 * texel];
                    *word = *word & !0xff00 | u32::from(edit) << 8;
                }
            }
        }
        words[3] = words.len() as u32;
    }
}

/// Adds the edits of `asset` to its words.
fn with_edits(words: Vec<u32>, asset: &Asset) -> Resident {
    let mut resident = Resident::from_own_words(words);
    if !asset.edits.list.is_empty() {
        resident.set_edits(&asset.edits, &asset.layers);
    }
    resident
}

/// Returns the bytes of the resident form of `asset` but for bases and codes, at most one part too many for each level.
fn bytes_beside_bases(asset: &Asset) -> u64 {
    let words = with_edits(words_without_bases(asset, &[]), asset).words().len();
    let components = asset.layers.iter().map(|layer| layer.coefficient_planes().len().div_ceil(4));
    let codes = components.sum::<usize>() * asset.texel_count();
    let codes_of_levels = asset.levels.iter().map(|level| {
        let texels = level.width * level.height;
        level.layers.iter().map(|layer| texels * layer.codes.len().div_ceil(4)).sum::<usize>()
    });
    let parts = PART_WORDS * asset.layers.len() * (2 + asset.levels.len());
    4 * (words + parts - codes - codes_of_levels.sum::<usize>()) as u64
}

/// Returns the words of an asset but for its bases and edits; the codes are those of `packed` layers, where there are any.
fn words_without_bases(asset: &Asset, packed: &[Option<PackedLayer>]) -> Vec<u32> {
    let packed = |number: usize| packed.get(number).and_then(Option::as_ref);
    let mut words = vec![0u32; ASSET_WORDS];
    words[0] = asset.width as u32;
    words[1] = asset.height as u32;
    words[2] = asset.layers.len() as u32;
    words[4] = 1 + asset.levels.len() as u32;
    if let Some(spectrum) = &asset.spectrum {
        words[SPECTRUM] = words.len() as u32;
        words.extend(spectrum.to_words());
        begin_part(&mut words);
    }
    for (number, layer) in asset.layers.iter().enumerate() {
        let block = words.len();
        words[ASSET_LAYERS + number] = block as u32;
        push_layer(&mut words, layer);
        push_texels(&mut words, block, layer, &Texels::of_layer(asset, layer), packed(number));
    }
    for (level, texels) in asset.levels.iter().enumerate() {
        for (number, of_layer) in texels.layers.iter().enumerate() {
            let (finest, block) = (words[ASSET_LAYERS + number] as usize, words.len());
            words[ASSET_LAYERS + (level + 1) * asset.layers.len() + number] = block as u32;
            words.extend_from_within(finest..finest + LAYER_BLOCK_WORDS);
            begin_part(&mut words);
            push_texels(
                &mut words,
                block,
                &asset.layers[number],
                &Texels {
                    size: [texels.width, texels.height],
                    has_residual: asset.layers[number].residual.is_some(),
                    heights: of_layer.heights.as_ref(),
                    clusters: &of_layer.clusters,
                    lobe_counts: &of_layer.lobe_counts,
                    lobe_refs: &of_layer.lobe_refs,
                    codes: of_layer.codes.iter().map(Vec::as_slice).collect(),
                },
                packed(number),
            );
        }
    }
    words
}

/// Pads the words with zeros to where a part may begin.
fn begin_part(words: &mut Vec<u32>) {
    words.resize(words.len().next_multiple_of(PART_WORDS), 0);
}

/// Appends the block of a layer at the finest level, its direction sets and dictionaries.
fn push_layer(words: &mut Vec<u32>, layer: &Layer) {
    let base = words.len();
    words.resize(base + LAYER_BLOCK_WORDS, 0);
    let set = |words: &mut Vec<u32>, field: usize, value: u32| words[base + field] = value;
    let horizon = HORIZON_COS.min(layer.lights.least_cosine()).max(MIN_HORIZON_COS);
    let bases = layer.residual.as_ref().map_or(0, |residual| residual.bases.len());
    set(words, block::LIGHT_SIDE, layer.light_side as u32);
    set(words, block::VIEW_SIDE, layer.view_side as u32);
    set(words, block::RESIDUAL_KIND, layer.residual_kind as u32);
    set(words, block::EPSILON, layer.epsilon.to_bits());
    set(words, block::CHANNEL_WORDS, channel_words(bases) as u32);
    set(words, block::LIGHT_COUNT, layer.lights.len() as u32);
    set(words, block::PAIRS, (layer.lights.len() * layer.views.len()) as u32);
    set(words, block::HORIZON, horizon.to_bits());
    set(words, block::LOBE_ROLE, layer.lobe_role as u32);
    set(words, block::CLUSTERS, layer.dictionary.len() as u32);
    for (field, sphere) in [(block::LIGHTS, &layer.lights), (block::VIEWS, &layer.views)] {
        begin_part(words);
        let here = words.len() as u32;
        set(words, field, here);
        words.extend_from_slice(sphere.words());
    }
    begin_part(words);
    let here = words.len() as u32;
    set(words, block::DICTIONARIES, here);
    push_dictionaries(words, &layer.dictionary, |entry| *entry);
    begin_part(words);
}

/// The texels of a layer at one level.
struct Texels<'a> {
    size: [usize; 2],
    has_residual: bool,
    heights: Option<&'a Heights>,
    clusters: &'a [u8],
    lobe_counts: &'a [u8],
    lobe_refs: &'a [LobeRef],
    codes: Vec<&'a [i8]>,
}

impl<'a> Texels<'a> {
    fn of_layer(asset: &Asset, layer: &'a Layer) -> Texels<'a> {
        let planes = layer.residual.iter().flat_map(|residual| &residual.coefficients);
        Texels {
            size: [asset.width, asset.height],
            has_residual: layer.residual.is_some(),
            heights: layer.heights.as_ref(),
            clusters: &layer.texel_clusters,
            lobe_counts: &layer.texel_lobe_counts,
            lobe_refs: &layer.lobe_refs,
            codes: planes.map(|plane| plane.codes.as_slice()).collect(),
        }
    }
}

/// Appends the texels of a level of `layer`. `base` is the level's layer block, which has all else.
fn push_texels(words: &mut Vec<u32>, base: usize, layer: &Layer, texels: &Texels, packed: Option<&PackedLayer>) {
    let set = |words: &mut Vec<u32>, field: usize, value: u32| words[base + field] = value;
    set(words, block::WIDTH, texels.size[0] as u32);
    set(words, block::ROWS, texels.size[1] as u32);
    set(words, block::BASES, if texels.has_residual { 1 + texels.codes.len() as u32 } else { 0 });

    set(words, block::HEIGHTS, 0);
    if let Some(heights) = texels.heights {
        let (here, [least, most]) = (words.len() as u32, heights.range());
        set(words, block::HEIGHTS, here);
        set(words, block::HEIGHT_STEP, heights.step.to_bits());
        set(words, block::MIN_HEIGHT, least.to_bits());
        set(words, block::MAX_HEIGHT, most.to_bits());
        words.extend(heights.to_words());
        begin_part(words);
    }

    let here = words.len() as u32;
    set(words, block::RECORDS, here);
    words.reserve(2 * texels.clusters.len());
    let mut first = 0u32;
    for (cluster, count) in texels.clusters.iter().zip(texels.lobe_counts) {
        // Packed codes of a texel lie before its references.
        first += packed.map_or(0, |packed| packed.code_words[usize::from(*cluster)]) as u32;
        words.extend([u32::from(*cluster) | u32::from(*count) << 16, first]);
        first += u32::from(*count);
    }
    begin_part(words);
    let here = words.len() as u32;
    set(words, block::REFS, here);
    set(words, block::REF_COUNT, first);
    let mut refs = texels.lobe_refs.iter().map(|reference| {
        let [r, g, b] = reference.weight;
        u32::from_le_bytes([reference.lobe, r, g, b])
    });
    match packed {
        Some(packed) => {
            for (texel, (cluster, count)) in texels.clusters.iter().zip(texels.lobe_counts).enumerate() {
                packed.push_codes(words, *cluster, texels.codes.iter().map(|plane| plane[texel]));
                words.extend(refs.by_ref().take(usize::from(*count)));
            }
            set(words, block::CODES, here);
            set(words, block::CODE_WORDS, 0);
        }
        None => words.extend(refs),
    }
    begin_part(words);
    if !texels.has_residual {
        return;
    }

    if packed.is_none() {
        let here = words.len();
        set(words, block::CODES, here as u32);
        let code_words = texels.codes.len().div_ceil(4);
        set(words, block::CODE_WORDS, code_words as u32);
        words.resize(here + code_words * texels.clusters.len(), 0);
        for (word, planes) in texels.codes.chunks(4).enumerate() {
            for (slot, codes) in planes.iter().enumerate() {
                let column = words[here + word..].iter_mut().step_by(code_words);
                column.zip(*codes).for_each(|(word, code)| *word |= u32::from(*code as u8) << (8 * slot));
            }
        }
        begin_part(words);
    }

    set(words, block::RELIEF, 0);
    if let (Some(relief), Some(heights)) = (&layer.relief, texels.heights) {
        let here = words.len() as u32;
        words.extend(relief_records(layer, texels.size, heights, texels.clusters, &texels.codes));
        begin_part(words);
        block::RELIEF_NUMBERS.iter().zip(relief.numbers()).for_each(|(field, x)| set(words, *field, x.to_bits()));
        set(words, block::RELIEF, here);
    }
}

/// Returns the words with room for each layer's bases behind them.
fn with_room_for_bases(head: Vec<u32>, asset: &Asset) -> Vec<u32> {
    let mut total = head.len();
    let mut firsts = Vec::new();
    for layer in &asset.layers {
        firsts.push(total);
        let of_layer = layer.residual.as_ref().map_or(0, |residual| layer.dictionary.len() * cluster_words(residual));
        total = (total + of_layer).next_multiple_of(PART_WORDS);
    }
    // Zeros that the system gives: nothing is written before the threads do.
    let mut words = vec![0u32; total];
    words[..head.len()].copy_from_slice(&head);
    words[3] = total as u32;
    let layers = asset.layers.len();
    for level in 0..words[4] as usize {
        for (number, first) in firsts.iter().enumerate().filter(|(number, _)| asset.layers[*number].residual.is_some())
        {
            let at = words[ASSET_LAYERS + level * layers + number] as usize;
            words[at + block::BASIS] = *first as u32;
        }
    }
    words
}

/// Returns the number of words of one cluster's bases.
fn cluster_words(residual: &Residual) -> usize {
    residual.factors.shape.iter().product::<usize>() * 3 * channel_words(residual.bases.len())
}

/// Appends a layer's edits: the list that the layer's block points to, then each edit's dictionaries.
fn push_edits(words: &mut Vec<u32>, edits: &Edits, layer: &Layer) {
    let list = words.len();
    words.resize(list + EDIT_WORDS * edits.list.len(), 0);
    for (number, edit) in edits.list.iter().enumerate() {
        let at = list + EDIT_WORDS * number;
        (0..3).for_each(|c| words[at + c] = edit.tint[c].to_bits());
        words[at + 3] = edit.keep().to_bits();
        words[at + 4] = words.len() as u32;
        push_dictionaries(words, &layer.dictionary, |entry| edit.lobe(entry));
    }
}

/// Appends a table with the offset of each cluster's dictionary and of the end of the last, then the dictionaries.
fn push_dictionaries(
    words: &mut Vec<u32>,
    dictionaries: &[Vec<DictionaryLobe>],
    changed: impl Fn(&DictionaryLobe) -> DictionaryLobe,
) {
    let table = words.len();
    words.resize(table + dictionaries.len() + 1, 0);
    for (cluster, lobes) in dictionaries.iter().enumerate() {
        words[table + cluster] = words.len() as u32;
        for entry in lobes.iter().map(&changed) {
            words.extend(entry.lobe.setup().to_resident_words(entry.weight_scale));
        }
        words[table + cluster + 1] = words.len() as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::edit::Edit;
    use crate::asset::lobe::RESIDENT_WORDS;
    use crate::asset::residual::ResidualKind;
    use crate::asset::sphere::Sphere;
    use crate::testing::{direction_from_degrees, sample_asset};

    #[test]
    fn clusters_expanded_in_any_order_give_the_same_words() {
        let asset = sample_asset(1, 6, 5, ResidualKind::Root);
        let one_by_one = Resident::from_asset(&asset);
        assert_eq!(one_by_one, Resident::from_asset_on(&asset, &|n, work| (0..n).rev().for_each(work)));
        // Planted difference: a cluster left out.
        assert_ne!(one_by_one, Resident::from_asset_on(&asset, &|n, work| (0..n.min(2)).for_each(work)));
    }

    #[test]
    fn without_bases_all_else_is_there_and_they_can_follow() {
        let mut asset = sample_asset(6, 6, 5, ResidualKind::Root);
        asset.edits = Edits { list: vec![Edit::default()], texels: vec![1; 30] };
        let whole = Resident::from_asset(&asset);
        let mut without = Resident::without_bases(&asset);
        let bases = without.bases_of(0);
        assert!(without.words()[bases.clone()].iter().all(|word| *word == 0));
        assert_eq!(without.words()[..bases.start], whole.words()[..bases.start]);
        assert_eq!(without.words()[bases.end..], whole.words()[bases.end..]);
        assert_ne!(without, whole);
        without.expand_bases(&asset, &serial);
        assert_eq!(without, whole);
        asset.layers[0].residual = None;
        assert!(Resident::without_bases(&asset).bases_of(0).is_empty());
    }

    #[test]
    fn the_parts_of_a_layer_follow_each_other_without_gaps() {
        let asset = sample_asset(2, 6, 5, ResidualKind::Log);
        let resident = Resident::from_asset(&asset);
        let (words, layer) = (resident.words(), &asset.layers[0]);
        assert_eq!((resident.width(), resident.height(), resident.layers(), words.len()), (6, 5, 1, words[3] as usize));
        let at = words[ASSET_LAYERS] as usize;
        let field = |field: usize| words[at + field] as usize;
        assert_eq!(at, ASSET_WORDS);
        let parts = [
            (block::LIGHTS, layer.lights.words().len()),
            (block::VIEWS, layer.views.words().len()),
            (block::DICTIONARIES, 4 + 3 * 9 * RESIDENT_WORDS),
            (block::RECORDS, 2 * 30),
            (block::REFS, layer.lobe_refs.len()),
            (block::CODES, 30),
            (block::BASIS, 3 * layer.lights.len() * layer.views.len() * 3 * 3),
        ];
        let mut next = at + PART_WORDS;
        for (name, length) in parts {
            assert_eq!(field(name), next, "field {name}");
            next = (next + length).next_multiple_of(PART_WORDS);
        }
        assert_eq!(next, words.len());
        let counts =
            [block::BASES, block::CHANNEL_WORDS, block::CODE_WORDS, block::LIGHT_COUNT, block::PAIRS].map(field);
        assert_eq!(counts, [5, 3, 1, 20, 340]);
    }

    #[test]
    fn the_fade_starts_below_the_lowest_measured_light_and_never_at_zero() {
        let horizon = |theta: f64| {
            let mut asset = sample_asset(3, 2, 2, ResidualKind::Log);
            asset.layers[0].residual = None;
            asset.layers[0].lights =
                Sphere::new(&[direction_from_degrees(0.0, 0.0), direction_from_degrees(theta, 0.0)]).unwrap();
            let resident = Resident::from_asset(&asset);
            let words = resident.words();
            f32::from_bits(words[words[ASSET_LAYERS] as usize + block::HORIZON])
        };
        assert_eq!(horizon(75.0), HORIZON_COS);
        assert!((horizon(87.0) - 87.0f32.to_radians().cos()).abs() < 1e-6);
        assert_eq!(horizon(90.0), MIN_HORIZON_COS);
    }
}
