//! The resident form: one array of words that the GPU binds and the CPU decoder reads. Made at load from the file form, with
//! the bases of each cluster expanded to half precision, or mapped from a file of its own ([`crate::ResidentFile`]).
//!
//! All offsets are in words, relative to the asset's first word, so that several assets share one
//! buffer. Twin of the offsets: `shaders/texel.wgsl`.

use crate::asset::asset::{Asset, Layer, LobeRef};
use crate::asset::edit::{Edits, push_dictionaries};
use crate::asset::residual::Residual;
use crate::asset::sphere::direction;
use crate::decode::parallax::Heights;
use crate::decode::texel;
use crate::file::format::{MAX_LAYERS, MAX_LEVELS};
use crate::resident::expansion::Expansion;
use crate::threads::{Threads, fill, serial};
use half::f16;
use half::slice::{HalfBitsSliceExt, HalfFloatSliceExt};
use std::ops::Range;
use std::sync::Arc;

/// Asset words: width, height, layers, total words, levels, words without the edits (0 if none were ever made), two zeros;
/// then the offset of each layer's block, level by level.
pub const ASSET_LAYERS: usize = 8;
/// Words before the first layer block.
pub const ASSET_WORDS: usize = (ASSET_LAYERS + MAX_LAYERS * MAX_LEVELS).next_multiple_of(PART_WORDS);
/// Words of a layer block.
pub const LAYER_BLOCK_WORDS: usize = 32;
/// Blocks and parts begin at multiples of this many words, 256 bytes: where a GPU lets a binding begin.
pub const PART_WORDS: usize = 64;

/// Words of a layer block, by name.
pub mod block {
    /// Side of the light.
    pub const LIGHT_SIDE: usize = 0;
    /// Side of the eye.
    pub const VIEW_SIDE: usize = 1;
    /// Residual kind.
    pub const RESIDUAL_KIND: usize = 2;
    /// The curve's epsilon (f32).
    pub const EPSILON: usize = 3;
    /// Basis count: 0 without residual, else 1 + components.
    pub const BASES: usize = 4;
    /// Words per pair and channel: `ceil(bases / 2)`.
    pub const CHANNEL_WORDS: usize = 5;
    /// Offset of the light set.
    pub const LIGHTS: usize = 6;
    /// Offset of the view set.
    pub const VIEWS: usize = 7;
    /// Offset of the texel records.
    pub const RECORDS: usize = 8;
    /// Offset of the lobe references.
    pub const REFS: usize = 9;
    /// Offset of the table of dictionary offsets, one per cluster.
    pub const DICTIONARIES: usize = 10;
    /// Offset of the expanded bases.
    pub const BASIS: usize = 11;
    /// Offset of the coefficient codes.
    pub const CODES: usize = 12;
    /// Words of a texel's codes.
    pub const CODE_WORDS: usize = 13;
    /// Number of lights.
    pub const LIGHT_COUNT: usize = 14;
    /// Pairs, views times lights.
    pub const PAIRS: usize = 15;
    /// Cosine below which the light fades to the horizon (f32).
    pub const HORIZON: usize = 16;
    /// What the lobes are to the residual, see [`crate::LobeRole`].
    pub const LOBE_ROLE: usize = 17;
    /// Offset of the height codes, 0 without heights.
    pub const HEIGHTS: usize = 18;
    /// Texel widths per height code (f32).
    pub const HEIGHT_STEP: usize = 19;
    /// Least height, texel widths (f32).
    pub const MIN_HEIGHT: usize = 20;
    /// Greatest height, texel widths (f32).
    pub const MAX_HEIGHT: usize = 21;
    /// Texels per row of the level.
    pub const WIDTH: usize = 22;
    /// Rows of the level.
    pub const ROWS: usize = 23;
    /// Offset of the list of edits, 0 without edits.
    pub const EDITS: usize = 24;
    /// Number of clusters.
    pub const CLUSTERS: usize = 25;
    /// Number of lobe references.
    pub const REF_COUNT: usize = 26;
    /// Number of edits.
    pub const EDIT_COUNT: usize = 27;
}

/// The light fades to 0 below this cosine (84 degrees), or below the set's own least cosine.
pub const HORIZON_COS: f32 = 0.1;
/// Least cosine at which the fade starts, so that no decoder divides by a denormal.
pub(crate) const MIN_HORIZON_COS: f32 = 1e-6;
/// Largest half-precision number: what a basis is clamped to, because infinity times a zero weight is NaN.
const MAX_HALF: f32 = 65504.0;

/// Bytes that someone else keeps, such as a mapped file.
pub type ResidentBytes = Arc<dyn AsRef<[u8]> + Send + Sync>;

/// Where the words lie.
#[derive(Clone)]
enum Words {
    Own(Vec<u32>),
    /// At these bytes, which begin and end at whole words.
    Shared(ResidentBytes, Range<usize>),
}

/// An asset ready to bind.
#[derive(Clone)]
pub struct Resident {
    words: Words,
}

impl PartialEq for Resident {
    fn eq(&self, other: &Resident) -> bool {
        self.words() == other.words()
    }
}

impl std::fmt::Debug for Resident {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let [width, height, layers, levels] = [self.width(), self.height(), self.layers(), self.levels()];
        write!(f, "Resident({width} x {height}, {layers} layers, {levels} levels, {} words)", self.words().len())
    }
}

impl Resident {
    /// Expands an asset, with its levels and edits, on the calling thread.
    pub fn from_asset(asset: &Asset) -> Resident {
        Resident::from_asset_on(asset, &serial)
    }

    /// The same on `threads`. Cost: that of [`Resident::without_bases`] and [`Resident::expand_bases`].
    pub fn from_asset_on(asset: &Asset, threads: Threads) -> Resident {
        let mut resident = Resident::without_bases(asset);
        resident.expand_bases(asset, threads);
        resident
    }

    /// The same with zeros where the bases belong ([`Resident::bases_of`]), for who expands them elsewhere: nobody has
    /// written these, so that a system that gives memory page by page gives none for them. Cost: a pass over the other words.
    pub fn without_bases(asset: &Asset) -> Resident {
        let mut words = vec![0u32; ASSET_WORDS];
        words[0] = asset.width as u32;
        words[1] = asset.height as u32;
        words[2] = asset.layers.len() as u32;
        words[4] = 1 + asset.levels.len() as u32;
        for (number, layer) in asset.layers.iter().enumerate() {
            let block = words.len();
            words[ASSET_LAYERS + number] = block as u32;
            push_layer(&mut words, layer);
            push_texels(&mut words, block, &Texels::of_layer(asset, layer));
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
                    &Texels {
                        size: [texels.width, texels.height],
                        has_residual: asset.layers[number].residual.is_some(),
                        heights: of_layer.heights.as_ref(),
                        clusters: &of_layer.clusters,
                        lobe_counts: &of_layer.lobe_counts,
                        lobe_refs: &of_layer.lobe_refs,
                        codes: of_layer.codes.iter().map(Vec::as_slice).collect(),
                    },
                );
            }
        }
        let mut resident = Resident { words: Words::Own(with_room_for_bases(words, asset)) };
        if !asset.edits.list.is_empty() {
            resident.set_edits(&asset.edits, &asset.layers);
        }
        resident
    }

    /// Fills in the bases of the asset that this was made from. Cost: with B bases of K clusters, V views, L lights, ranks rv
    /// and rl and E entries of the shared cores that are not 0, `B K (E + V rl (rv + L))` multiply-adds a channel, in vectors;
    /// then one pass over the words.
    pub fn expand_bases(&mut self, asset: &Asset, threads: Threads) {
        if let Words::Shared(..) = self.words {
            self.words = Words::Own(self.words().to_vec());
        }
        let places: Vec<_> = (0..asset.layers.len()).map(|layer| self.bases_of(layer as u32)).collect();
        let Words::Own(words) = &mut self.words else { return };
        for (layer, place) in asset.layers.iter().zip(places) {
            let Some(residual) = &layer.residual else { continue };
            let expansion = Expansion::new(residual);
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

    /// Where the bases of `layer` lie, cluster after cluster; empty without a residual.
    pub fn bases_of(&self, layer: u32) -> Range<usize> {
        let count = |field: usize| self.field(layer, field) as usize;
        if count(block::BASES) == 0 {
            return 0..0;
        }
        let first = count(block::BASIS);
        first..first + count(block::CLUSTERS) * count(block::PAIRS) * 3 * count(block::CHANNEL_WORDS)
    }

    /// Puts `edits` in place of those at hand, at all levels. `layers` are those of the asset that this was made from.
    /// Cost: a word a texel, and the edits' lobes.
    pub fn set_edits(&mut self, edits: &Edits, layers: &[Layer]) {
        let finest = [self.width() as usize, self.height() as usize];
        if let Words::Shared(..) = self.words {
            self.words = Words::Own(self.words().to_vec());
        }
        let Words::Own(words) = &mut self.words else { return };
        if words[5] == 0 {
            words[5] = words.len() as u32;
        }
        words.truncate(words[5] as usize);
        let count = words[2] as usize;
        for (number, layer) in layers.iter().enumerate().take(count) {
            begin_part(words);
            let list = if edits.list.is_empty() { 0 } else { words.len() as u32 };
            edits.push(words, layer);
            for level in 0..words[4] as usize {
                let at = words[ASSET_LAYERS + level * count + number] as usize;
                words[at + block::EDITS] = list;
                words[at + block::EDIT_COUNT] = edits.list.len() as u32;
                let size = texel::size(words, at);
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

    /// Ranges of words that [`Resident::set_edits`] changes.
    pub fn edited_ranges(&self) -> Vec<Range<usize>> {
        let words = self.words();
        let blocks = (0..(words[4] * words[2]) as usize).map(|number| words[ASSET_LAYERS + number] as usize);
        let mut ranges = Vec::new();
        ranges.push(0..ASSET_LAYERS);
        for at in blocks {
            let ([width, rows], records) = (texel::size(words, at), words[at + block::RECORDS] as usize);
            ranges.extend([at..at + LAYER_BLOCK_WORDS, records..records + 2 * width * rows]);
        }
        ranges.push(if words[5] == 0 { words.len() } else { words[5] as usize }..words.len());
        ranges
    }

    /// The array that a storage buffer holds.
    pub fn words(&self) -> &[u32] {
        match &self.words {
            Words::Own(words) => words,
            // Checked by `from_bytes`.
            Words::Shared(bytes, place) => bytemuck::cast_slice(&(**bytes).as_ref()[place.clone()]),
        }
    }

    /// The words that lie at `place` of `bytes`, copied only where they do not lie at whole words.
    pub(crate) fn from_bytes(bytes: ResidentBytes, place: Range<usize>) -> Resident {
        let there = &(*bytes).as_ref()[place.clone()];
        let words = match bytemuck::try_cast_slice::<u8, u32>(there) {
            Ok(_) => Words::Shared(bytes, place),
            Err(_) => Words::Own(there.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()),
        };
        Resident { words }
    }

    /// Texels per row.
    pub fn width(&self) -> u32 {
        self.words()[0]
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.words()[1]
    }

    /// Layers.
    pub fn layers(&self) -> u32 {
        self.words()[2]
    }

    /// Levels, the finest included.
    pub fn levels(&self) -> u32 {
        self.words()[4]
    }

    /// A word of the block of `layer` at a level: `level * layers + layer`.
    fn field(&self, layer: u32, field: usize) -> u32 {
        let words = self.words();
        words[words[ASSET_LAYERS + layer as usize] as usize + field]
    }

    /// Components of the residual of `layer`, as [`Resident::layer_for_sides`] numbers it.
    pub fn components(&self, layer: u32) -> u32 {
        self.field(layer, block::BASES).saturating_sub(1)
    }

    /// Residual components of the layer that has most.
    pub fn most_components(&self) -> u32 {
        (0..self.layers()).map(|layer| self.components(layer)).max().unwrap_or(0)
    }

    /// Lobes of the texel of the finest level that has most. Cost: a pass over the texels.
    pub fn most_lobes(&self) -> u32 {
        let words = self.words();
        let of_layer = |layer: u32| {
            let [width, height] = self.size(layer);
            let records = self.field(layer, block::RECORDS) as usize;
            words[records..records + 2 * (width * height) as usize].chunks_exact(2).map(|record| record[0] >> 16).max()
        };
        (0..self.layers()).filter_map(of_layer).max().unwrap_or(0)
    }

    /// Number of the layer for a light and an eye on these sides of the surface (true: back), at `level`, 0 the finest:
    /// what decoders take.
    pub fn layer_for_sides(&self, level: u32, light_back: bool, view_back: bool) -> Option<u32> {
        let first = level * self.layers();
        (first..first + self.layers()).find(|layer| {
            self.field(*layer, block::LIGHT_SIDE) == u32::from(light_back)
                && self.field(*layer, block::VIEW_SIDE) == u32::from(view_back)
        })
    }

    /// The measured lights of `layer`, numbered like that: unit vectors in the layer's frame, z above 0.
    pub fn lights(&self, layer: u32) -> Vec<[f32; 3]> {
        self.directions(layer, block::LIGHTS)
    }

    /// The measured views of `layer`, likewise.
    pub fn views(&self, layer: u32) -> Vec<[f32; 3]> {
        self.directions(layer, block::VIEWS)
    }

    fn directions(&self, layer: u32, set: usize) -> Vec<[f32; 3]> {
        let (words, at) = (self.words(), self.field(layer, set) as usize);
        (0..words[at]).map(|id| direction(words, at, id)).collect()
    }

    /// Columns and rows of `layer`, numbered like that.
    pub fn size(&self, layer: u32) -> [u32; 2] {
        let words = self.words();
        texel::size(words, words[ASSET_LAYERS + layer as usize] as usize).map(|side| side as u32)
    }

    /// Texel of `layer` nearest to a texture coordinate; u to the right, v up, both wrap. Twin: `btf_texel`.
    pub fn texel(&self, layer: u32, uv: [f32; 2]) -> u32 {
        let [width, rows] = self.size(layer);
        let wrap = |x: f32| x - x.floor();
        let x = ((wrap(uv[0]) * width as f32) as u32).min(width - 1);
        let y = ((wrap(1.0 - uv[1]) * rows as f32) as u32).min(rows - 1);
        y * width + x
    }
}

/// Fills up with zeros to where a part may begin.
fn begin_part(words: &mut Vec<u32>) {
    words.resize(words.len().next_multiple_of(PART_WORDS), 0);
}

/// The block of a layer at the finest level, its direction sets and dictionaries.
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
    set(words, block::CHANNEL_WORDS, bases.div_ceil(2) as u32);
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

/// What a level's texels have, behind the words at hand; `base` is its layer block, which has all else.
fn push_texels(words: &mut Vec<u32>, base: usize, texels: &Texels) {
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
        words.extend([u32::from(*cluster) | u32::from(*count) << 16, first]);
        first += u32::from(*count);
    }
    begin_part(words);
    let here = words.len() as u32;
    set(words, block::REFS, here);
    set(words, block::REF_COUNT, texels.lobe_refs.len() as u32);
    words.extend(texels.lobe_refs.iter().map(|reference| {
        let [r, g, b] = reference.weight;
        u32::from_le_bytes([reference.lobe, r, g, b])
    }));
    begin_part(words);
    if !texels.has_residual {
        return;
    }

    let code_words = texels.codes.len().div_ceil(4);
    let here = words.len();
    set(words, block::CODES, here as u32);
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

/// The words with room for each layer's bases behind them.
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

/// Words of one cluster's bases.
fn cluster_words(residual: &Residual) -> usize {
    residual.factors.shape.iter().product::<usize>() * 3 * residual.bases.len().div_ceil(2)
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
