//! The resident form: one array of words that the GPU binds and the CPU decoder reads. Built once at
//! load from the file form; per-cluster bases expanded to half precision.
//!
//! All offsets are in words, relative to the asset's first word, so that several assets share one
//! buffer. Twin of the offsets: `shaders/texel.wgsl`.

use crate::asset::{Asset, Layer};
use crate::edit::{Edits, push_dictionaries};
use crate::format::MAX_LAYERS;
use crate::quantize::word_from_halves;
use crate::residual::{Residual, expand_core};
use crate::texel;

/// Asset words: width, height, layers, total words, levels, words without the edits (0 if none were ever made), two zeros;
/// then the offset of each layer's block, level by level.
pub const ASSET_LAYERS: usize = 8;
/// Most levels: down to one texel from the widest asset.
pub const MOST_LEVELS: usize = 15;
/// Words before the first layer block.
pub const ASSET_WORDS: usize = ASSET_LAYERS + MAX_LAYERS * MOST_LEVELS;
/// Words of a layer block.
pub const LAYER_BLOCK_WORDS: usize = 32;

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
    pub const LEAST_HEIGHT: usize = 20;
    /// Greatest height, texel widths (f32).
    pub const MOST_HEIGHT: usize = 21;
    /// Texels per row of the level.
    pub const WIDTH: usize = 22;
    /// Rows of the level.
    pub const ROWS: usize = 23;
    /// Offset of the list of edits, 0 without edits.
    pub const EDITS: usize = 24;
}

/// The light fades to 0 below this cosine (84 degrees), or below the set's own least cosine.
pub const HORIZON_COS: f32 = 0.1;
/// Least cosine at which the fade starts, so that no decoder divides by a denormal.
const LEAST_HORIZON_COS: f32 = 1e-6;
/// Largest half-precision number: what a basis is clamped to, because infinity times a zero weight is NaN.
const MAX_HALF: f32 = 65504.0;

/// An asset ready to bind.
#[derive(Debug, Clone, PartialEq)]
pub struct Resident {
    words: Vec<u32>,
}

impl Resident {
    /// Expands an asset on the calling thread. Cost: about 0.3 MFLOP per cluster, basis and channel for
    /// Bonn's 81 x 81 at rank 32.
    pub fn from_asset(asset: &Asset) -> Resident {
        Resident::from_asset_with(asset, |count, expand| (0..count).map(expand).collect())
    }

    /// The same; `map(n, f)` returns `[f(0), ..., f(n - 1)]`, on as many threads as the caller likes.
    pub fn from_asset_with<M>(asset: &Asset, map: M) -> Resident
    where
        M: Fn(usize, &(dyn Fn(usize) -> Vec<u32> + Sync)) -> Vec<Vec<u32>>,
    {
        let mut words = vec![0u32; ASSET_WORDS];
        words[0] = asset.width as u32;
        words[1] = asset.height as u32;
        words[2] = asset.layers.len() as u32;
        words[4] = 1;
        for (number, layer) in asset.layers.iter().enumerate() {
            let block = words.len();
            words[ASSET_LAYERS + number] = block as u32;
            push_layer(&mut words, layer, &map);
            push_texels(&mut words, block, layer, [asset.width, asset.height]);
        }
        words[3] = words.len() as u32;
        let mut resident = Resident { words };
        if !asset.edits.list.is_empty() {
            resident.set_edits(&asset.edits, &asset.layers);
        }
        resident
    }

    /// Expands the last cluster's bases anew, of a residual of the same shape.
    pub(crate) fn replace_last_cluster(&mut self, layer: usize, residual: &Residual) {
        let Some(last) = residual.bases.first().and_then(|basis| basis.steps.len().checked_sub(1)) else { return };
        let at = self.words[ASSET_LAYERS + layer] as usize;
        let expanded = expand_cluster(residual, last);
        let first = self.words[at + block::BASIS] as usize + last * expanded.len();
        self.words[first..first + expanded.len()].copy_from_slice(&expanded);
    }

    /// Adds coarser levels: their texels; everything else is the finest level's.
    pub(crate) fn push_levels(&mut self, levels: &[Asset]) {
        let words = &mut self.words;
        let layers = words[2] as usize;
        for asset in levels {
            let first = ASSET_LAYERS + words[4] as usize * layers;
            words[4] += 1;
            for (number, layer) in asset.layers.iter().enumerate() {
                let (finest, block) = (words[ASSET_LAYERS + number] as usize, words.len());
                words[first + number] = block as u32;
                words.extend_from_within(finest..finest + LAYER_BLOCK_WORDS);
                push_texels(words, block, layer, [asset.width, asset.height]);
            }
        }
        words[3] = words.len() as u32;
    }

    /// Puts `edits` in place of those at hand, at all levels. `layers` are the file form's of any level
    /// but the finest, or of the finest where there is no other. Cost: a word a texel, and the edits' lobes.
    pub fn set_edits(&mut self, edits: &Edits, layers: &[Layer]) {
        let finest = [self.width() as usize, self.height() as usize];
        let words = &mut self.words;
        if words[5] == 0 {
            words[5] = words.len() as u32;
        }
        words.truncate(words[5] as usize);
        let count = words[2] as usize;
        for (number, layer) in layers.iter().enumerate().take(count) {
            let list = if edits.list.is_empty() { 0 } else { words.len() as u32 };
            edits.push(words, layer);
            for level in 0..words[4] as usize {
                let at = words[ASSET_LAYERS + level * count + number] as usize;
                words[at + block::EDITS] = list;
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
    pub fn edited_ranges(&self) -> Vec<std::ops::Range<usize>> {
        let words = &self.words;
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
        &self.words
    }

    /// Texels per row.
    pub fn width(&self) -> u32 {
        self.words[0]
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.words[1]
    }

    /// Layers.
    pub fn layers(&self) -> u32 {
        self.words[2]
    }

    /// Levels, the finest included.
    pub fn levels(&self) -> u32 {
        self.words[4]
    }

    /// A word of the block of `layer` at a level: `level * layers + layer`.
    fn field(&self, layer: u32, field: usize) -> u32 {
        self.words[self.words[ASSET_LAYERS + layer as usize] as usize + field]
    }

    /// Components of the residual of `layer`, as [`Resident::layer_for_sides`] numbers it.
    pub fn components(&self, layer: u32) -> u32 {
        self.field(layer, block::BASES).saturating_sub(1)
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

    /// Columns and rows of `layer`, numbered like that.
    pub fn size(&self, layer: u32) -> [u32; 2] {
        texel::size(&self.words, self.words[ASSET_LAYERS + layer as usize] as usize).map(|side| side as u32)
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

fn push_layer<M>(words: &mut Vec<u32>, layer: &Layer, map: &M)
where
    M: Fn(usize, &(dyn Fn(usize) -> Vec<u32> + Sync)) -> Vec<Vec<u32>>,
{
    let base = words.len();
    words.resize(base + LAYER_BLOCK_WORDS, 0);
    let bases = layer.residual.as_ref().map_or(0, |residual| residual.bases.len());
    let channel_words = bases.div_ceil(2);
    let horizon = HORIZON_COS.min(layer.lights.least_cosine()).max(LEAST_HORIZON_COS);
    let set = |words: &mut Vec<u32>, field: usize, value: u32| words[base + field] = value;
    set(words, block::LIGHT_SIDE, layer.light_side as u32);
    set(words, block::VIEW_SIDE, layer.view_side as u32);
    set(words, block::RESIDUAL_KIND, layer.residual_kind as u32);
    set(words, block::EPSILON, layer.epsilon.to_bits());
    set(words, block::CHANNEL_WORDS, channel_words as u32);
    set(words, block::LIGHT_COUNT, layer.lights.len() as u32);
    set(words, block::PAIRS, (layer.lights.len() * layer.views.len()) as u32);
    set(words, block::HORIZON, horizon.to_bits());
    set(words, block::LOBE_ROLE, layer.lobe_role as u32);

    let here = words.len() as u32;
    set(words, block::LIGHTS, here);
    words.extend_from_slice(layer.lights.words());
    let here = words.len() as u32;
    set(words, block::VIEWS, here);
    words.extend_from_slice(layer.views.words());

    let here = words.len() as u32;
    set(words, block::DICTIONARIES, here);
    push_dictionaries(words, &layer.dictionary, |entry| *entry);

    let Some(residual) = &layer.residual else {
        return;
    };
    let here = words.len() as u32;
    set(words, block::BASIS, here);
    let expand = |cluster: usize| expand_cluster(residual, cluster);
    for cluster in map(layer.dictionary.len(), &expand) {
        words.extend(cluster);
    }
}

/// What a level's texels have, behind the words at hand; `base` is its layer block, which has all else.
fn push_texels(words: &mut Vec<u32>, base: usize, layer: &Layer, [width, height]: [usize; 2]) {
    let set = |words: &mut Vec<u32>, field: usize, value: u32| words[base + field] = value;
    set(words, block::WIDTH, width as u32);
    set(words, block::ROWS, height as u32);
    set(words, block::BASES, layer.residual.as_ref().map_or(0, |residual| residual.bases.len()) as u32);

    set(words, block::HEIGHTS, 0);
    if let Some(heights) = &layer.heights {
        let (here, [least, most]) = (words.len() as u32, heights.range());
        set(words, block::HEIGHTS, here);
        set(words, block::HEIGHT_STEP, heights.step.to_bits());
        set(words, block::LEAST_HEIGHT, least.to_bits());
        set(words, block::MOST_HEIGHT, most.to_bits());
        words.extend(heights.to_words());
    }

    let here = words.len() as u32;
    set(words, block::RECORDS, here);
    let mut first = 0u32;
    for (cluster, count) in layer.texel_clusters.iter().zip(&layer.texel_lobe_counts) {
        words.push(u32::from(*cluster) | u32::from(*count) << 16);
        words.push(first);
        first += u32::from(*count);
    }
    let here = words.len() as u32;
    set(words, block::REFS, here);
    words.extend(layer.lobe_refs.iter().map(|reference| {
        let [r, g, b] = reference.weight;
        u32::from_le_bytes([reference.lobe, r, g, b])
    }));

    let Some(residual) = &layer.residual else {
        return;
    };
    let components = residual.coefficients.len();
    let code_words = components.div_ceil(4);
    let here = words.len() as u32;
    set(words, block::CODES, here);
    set(words, block::CODE_WORDS, code_words as u32);
    for texel in 0..layer.texel_clusters.len() {
        for word in 0..code_words {
            let byte =
                |slot: usize| residual.coefficients.get(word * 4 + slot).map_or(0, |plane| plane.codes[texel] as u8);
            words.push(u32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)]));
        }
    }
}

/// One cluster's bases, `[basis][view, light, rgb]`; the step of a component's codes is multiplied in.
pub(crate) fn expand_bases(residual: &Residual, cluster: usize) -> Vec<Vec<f32>> {
    (0..residual.bases.len())
        .map(|index| {
            let step = if index == 0 { 1.0 } else { residual.coefficients[index - 1].step };
            let mut expanded = expand_core(&residual.factors, &residual.core(index, cluster));
            expanded.iter_mut().for_each(|x| *x *= step);
            expanded
        })
        .collect()
}

/// One cluster's bases as halves `[pair, channel, basis]`, bases padded to an even count.
fn expand_cluster(residual: &Residual, cluster: usize) -> Vec<u32> {
    let mut bases = expand_bases(residual, cluster);
    bases.iter_mut().flatten().for_each(|x| *x = x.clamp(-MAX_HALF, MAX_HALF));
    let entries = residual.factors.shape[0] * residual.factors.shape[1] * 3;
    let mut words = Vec::with_capacity(entries * bases.len().div_ceil(2));
    for entry in 0..entries {
        for pair in bases.chunks(2) {
            words.push(word_from_halves(pair[0][entry], pair.get(1).map_or(0.0, |basis| basis[entry])));
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lobe::RESIDENT_WORDS;
    use crate::residual::ResidualKind;
    use crate::sphere::Sphere;
    use crate::testing::{direction_from_degrees, sample_asset};

    #[test]
    fn clusters_expanded_in_any_order_give_the_same_words() {
        let asset = sample_asset(1, 6, 5, ResidualKind::Root);
        let one_by_one = Resident::from_asset(&asset);
        let backwards = Resident::from_asset_with(&asset, |count, expand| {
            let mut clusters: Vec<_> = (0..count).rev().map(expand).collect();
            clusters.reverse();
            clusters
        });
        assert_eq!(one_by_one, backwards);
        // Planted difference: clusters left in the wrong order.
        let wrong = Resident::from_asset_with(&asset, |count, expand| (0..count).rev().map(expand).collect());
        assert_ne!(one_by_one, wrong);
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
        let lengths = [
            (block::LIGHTS, layer.lights.words().len()),
            (block::VIEWS, layer.views.words().len()),
            (block::DICTIONARIES, 3 + 3 * 9 * RESIDENT_WORDS),
            (block::BASIS, 3 * layer.lights.len() * layer.views.len() * 3 * 3),
            (block::RECORDS, 2 * 30),
            (block::REFS, layer.lobe_refs.len()),
            (block::CODES, 30),
        ];
        let mut next = at + LAYER_BLOCK_WORDS;
        for (name, length) in lengths {
            assert_eq!(field(name), next, "field {name}");
            next += length;
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
            let words = Resident::from_asset(&asset).words;
            f32::from_bits(words[words[ASSET_LAYERS] as usize + block::HORIZON])
        };
        assert_eq!(horizon(75.0), HORIZON_COS);
        assert!((horizon(87.0) - 87.0f32.to_radians().cos()).abs() < 1e-6);
        assert_eq!(horizon(90.0), LEAST_HORIZON_COS);
    }
}
