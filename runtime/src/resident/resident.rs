//! The resident form: one array of words that the GPU binds and the CPU decoder reads. It is built at load from the
//! file form, with the bases of each cluster expanded to half precision, or mapped from a file of its own
//! ([`crate::ResidentFile`]).

use crate::asset::asset::SurfaceSide;
use crate::asset::relief::Relief;
use crate::asset::spectrum::{Channels, MAX_BAND_WEIGHT, SPECTRUM_HEAD, Spectrum};
use crate::asset::sphere::direction;
use crate::resident::layout::{ASSET_LAYERS, LAYER_BLOCK_WORDS, SPECTRUM, block, level_size};
use crate::resident::packed_table::PackedTable;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// Bytes that the caller keeps, such as a mapped file.
pub type ResidentBytes = Arc<dyn AsRef<[u8]> + Send + Sync>;

/// The storage of the words.
#[derive(Clone)]
enum Words {
    Own(Vec<u32>),
    /// Range of these bytes; it begins and ends at whole words.
    Shared(ResidentBytes, Range<usize>),
}

/// An asset in the resident form, ready to bind.
#[derive(Clone)]
pub struct Resident {
    words: Words,
    /// Tables of the layers, made when packed bases are read for the first time.
    packed: OnceLock<Vec<PackedTable>>,
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
    /// Takes words that are laid out as [`Resident::from_asset`] does it.
    pub(crate) fn from_own_words(words: Vec<u32>) -> Resident {
        Resident { words: Words::Own(words), packed: OnceLock::new() }
    }

    /// Returns the words to be changed; those of a shared file are copied first.
    pub(crate) fn own_words(&mut self) -> &mut Vec<u32> {
        if let Words::Shared(..) = self.words {
            self.words = Words::Own(self.words().to_vec());
        }
        match &mut self.words {
            Words::Own(words) => words,
            Words::Shared(..) => unreachable!("the words were copied above"),
        }
    }

    /// Returns the range of words of the bases of `layer`, cluster after cluster; empty without a residual.
    pub fn bases_of(&self, layer: u32) -> Range<usize> {
        let count = |field: usize| self.field(layer, field) as usize;
        if count(block::BASES) == 0 {
            return 0..0;
        }
        let first = count(block::BASIS);
        first..first + count(block::CLUSTERS) * count(block::PAIRS) * 3 * count(block::CHANNEL_WORDS)
    }

    /// Returns the ranges of words that [`Resident::set_edits`] changes.
    pub fn edited_ranges(&self) -> Vec<Range<usize>> {
        let words = self.words();
        let blocks = (0..(words[4] * words[2]) as usize).map(|number| words[ASSET_LAYERS + number] as usize);
        let mut ranges = Vec::new();
        ranges.push(0..ASSET_LAYERS);
        for at in blocks {
            let ([width, rows], records) = (level_size(words, at), words[at + block::RECORDS] as usize);
            ranges.extend([at..at + LAYER_BLOCK_WORDS, records..records + 2 * width * rows]);
        }
        ranges.push(if words[5] == 0 { words.len() } else { words[5] as usize }..words.len());
        ranges
    }

    /// Replaces the shares of relief of one level of a layer, which [`Resident::layer_for_sides`] numbers. A layer that was
    /// made without relief stays so.
    pub fn set_relief(&mut self, layer: u32, relief: Relief) {
        let at = self.words()[ASSET_LAYERS + layer as usize] as usize;
        if self.field(layer, block::RELIEF) > 0 {
            let words = self.own_words();
            block::RELIEF_NUMBERS.iter().zip(relief.numbers()).for_each(|(field, x)| words[at + field] = x.to_bits());
        }
    }

    /// Returns whether the asset's channels are no colours.
    pub fn is_spectral(&self) -> bool {
        self.words()[SPECTRUM] != 0
    }

    /// Returns the bands of the asset; `None` where its channels are colours. Cost: a copy.
    pub fn spectrum(&self) -> Option<Spectrum> {
        let at = self.words()[SPECTRUM] as usize;
        if at == 0 {
            return None;
        }
        Spectrum::from_words(&self.words()[at..]).map(|(spectrum, _)| spectrum)
    }

    /// Replaces [`Spectrum::shown`], what decoders give; each number is clamped to [`MAX_BAND_WEIGHT`]. An asset of colours
    /// stays as it is. Returns the range of words that changed.
    pub fn set_shown(&mut self, shown: [Channels; 3]) -> Range<usize> {
        let range = self.shown_range();
        let used = range.len() / 3;
        let held = |x: &f32| x.clamp(-MAX_BAND_WEIGHT, MAX_BAND_WEIGHT);
        let numbers = shown.iter().flat_map(|row| &row[..used]).map(|x| if x.is_nan() { 0.0 } else { held(x) });
        self.own_words()[range.clone()].iter_mut().zip(numbers).for_each(|(word, x)| *word = x.to_bits());
        range
    }

    /// Returns the place of the words that [`Resident::set_shown`] changes; none for an asset of colours.
    pub fn shown_range(&self) -> Range<usize> {
        match self.words()[SPECTRUM] as usize {
            0 => 0..0,
            at => at + SPECTRUM_HEAD..at + SPECTRUM_HEAD + 9 * self.words()[at + 1] as usize,
        }
    }

    /// Returns the words, which a storage buffer holds as they are.
    pub fn words(&self) -> &[u32] {
        match &self.words {
            Words::Own(words) => words,
            // Checked by `from_bytes`.
            Words::Shared(bytes, place) => bytemuck::cast_slice(&(**bytes).as_ref()[place.clone()]),
        }
    }

    /// Uses the words at `place` of `bytes`; they are copied only where they are not aligned to whole words.
    pub(crate) fn from_bytes(bytes: ResidentBytes, place: Range<usize>) -> Resident {
        let there = &(*bytes).as_ref()[place.clone()];
        let words = match bytemuck::try_cast_slice::<u8, u32>(there) {
            Ok(_) => Words::Shared(bytes, place),
            Err(_) => Words::Own(there.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()),
        };
        Resident { words, packed: OnceLock::new() }
    }

    /// Returns the number of texels in a row of the finest level.
    pub fn width(&self) -> u32 {
        self.words()[0]
    }

    /// Returns the number of rows of the finest level.
    pub fn height(&self) -> u32 {
        self.words()[1]
    }

    /// Returns the number of layers.
    pub fn layers(&self) -> u32 {
        self.words()[2]
    }

    /// Returns the number of levels, the finest included.
    pub fn levels(&self) -> u32 {
        self.words()[4]
    }

    /// Returns a word of the block of `layer` at a level: `level * layers + layer`.
    fn field(&self, layer: u32, field: usize) -> u32 {
        let words = self.words();
        words[words[ASSET_LAYERS + layer as usize] as usize + field]
    }

    /// Returns whether the bases of `layer` are packed ([`Resident::packed_on`]).
    pub fn is_packed(&self, layer: u32) -> bool {
        self.field(layer, block::BASES) > 0 && self.field(layer, block::CHANNEL_WORDS) == 0
    }

    /// Returns whether any level of a layer has heights.
    pub fn has_heights(&self) -> bool {
        (0..self.levels() * self.layers()).any(|layer| self.field(layer, block::HEIGHTS) > 0)
    }

    /// Returns whether texels are edited.
    pub fn has_edits(&self) -> bool {
        (0..self.layers()).any(|layer| self.field(layer, block::EDIT_COUNT) > 0)
    }

    /// Returns whether the bases of any layer are packed.
    pub fn has_packed_bases(&self) -> bool {
        (0..self.layers()).any(|layer| self.is_packed(layer))
    }

    /// Returns whether the rows of any layer's bases, not packed, are not whole quads of words: shaders read those word by word.
    pub fn has_uneven_rows(&self) -> bool {
        (0..self.layers()).any(|layer| !self.field(layer, block::CHANNEL_WORDS).is_multiple_of(4))
    }

    /// Returns whether the rows of any layer's bases, not packed, are whole quads of words.
    pub fn has_even_rows(&self) -> bool {
        let words = |layer| self.field(layer, block::CHANNEL_WORDS);
        (0..self.layers()).any(|layer| words(layer) > 0 && words(layer).is_multiple_of(4))
    }

    /// Returns where the numbers of the packed bases of `layer` stand.
    pub(crate) fn packed_table(&self, layer: u32) -> &PackedTable {
        let table = |layer: u32| match self.is_packed(layer) {
            true => PackedTable::of_layer(self.words(), self.words()[ASSET_LAYERS + layer as usize] as usize),
            false => PackedTable::default(),
        };
        &self.packed.get_or_init(|| (0..self.levels() * self.layers()).map(table).collect())[layer as usize]
    }

    /// Returns the number of the lobes' role in `layer`, see [`crate::LobeRole`].
    pub(crate) fn lobe_role(&self, layer: u32) -> u32 {
        self.field(layer, block::LOBE_ROLE)
    }

    /// Returns the number of components of the residual of a layer; [`Resident::layer_for_sides`] gives its index.
    pub fn components(&self, layer: u32) -> u32 {
        self.field(layer, block::BASES).saturating_sub(1)
    }

    /// Returns the largest number of residual components that a layer has.
    pub fn most_components(&self) -> u32 {
        (0..self.layers()).map(|layer| self.components(layer)).max().unwrap_or(0)
    }

    /// Returns the largest number of lobes that a texel of the finest level has. Cost: a pass over the texels.
    pub fn most_lobes(&self) -> u32 {
        let words = self.words();
        let of_layer = |layer: u32| {
            let [width, height] = self.size(layer);
            let records = self.field(layer, block::RECORDS) as usize;
            words[records..records + 2 * (width * height) as usize].chunks_exact(2).map(|record| record[0] >> 16).max()
        };
        (0..self.layers()).filter_map(of_layer).max().unwrap_or(0)
    }

    /// Returns the number that decoders take of the layer for a light and an eye on these sides of the surface, at
    /// `level`, 0 the finest; `None` where the asset has no such layer.
    pub fn layer_for_sides(&self, level: u32, light: SurfaceSide, view: SurfaceSide) -> Option<u32> {
        let first = level * self.layers();
        (first..first + self.layers()).find(|layer| {
            self.field(*layer, block::LIGHT_SIDE) == light as u32 && self.field(*layer, block::VIEW_SIDE) == view as u32
        })
    }

    /// Returns the measured light directions of a layer, whose index [`Resident::layer_for_sides`] gives: unit
    /// vectors in the layer's frame, z above 0.
    pub fn lights(&self, layer: u32) -> Vec<[f32; 3]> {
        self.directions(layer, block::LIGHTS)
    }

    /// Returns the measured view directions of a layer, whose index [`Resident::layer_for_sides`] gives: unit
    /// vectors in the layer's frame, z above 0.
    pub fn views(&self, layer: u32) -> Vec<[f32; 3]> {
        self.directions(layer, block::VIEWS)
    }

    fn directions(&self, layer: u32, set: usize) -> Vec<[f32; 3]> {
        let (words, at) = (self.words(), self.field(layer, set) as usize);
        (0..words[at]).map(|id| direction(words, at, id)).collect()
    }

    /// Returns columns and rows of a layer; [`Resident::layer_for_sides`] gives its index.
    pub fn size(&self, layer: u32) -> [u32; 2] {
        let words = self.words();
        level_size(words, words[ASSET_LAYERS + layer as usize] as usize).map(|side| side as u32)
    }

    /// Returns the texel of `layer` nearest to a texture coordinate; u to the right, v up, both wrap. Twin:
    /// `btf_texel`.
    pub fn texel(&self, layer: u32, uv: [f32; 2]) -> u32 {
        let [width, rows] = self.size(layer);
        let wrap = |x: f32| x - x.floor();
        let x = ((wrap(uv[0]) * width as f32) as u32).min(width - 1);
        let y = ((wrap(1.0 - uv[1]) * rows as f32) as u32).min(rows - 1);
        y * width + x
    }

    /// Returns one of the four texels of `layer` around a texture coordinate, drawn by two numbers `at` in [0, 1): values at
    /// evenly spread numbers have the bilinear interpolation of the four texels' values as their mean [pharr2024, filtering
    /// after shading]. With 0.5 twice it is the nearest one. Twin: `btf_texel_between`.
    pub fn texel_between(&self, layer: u32, uv: [f32; 2], at: [f32; 2]) -> u32 {
        let [width, rows] = self.size(layer);
        let wrap = |x: f32| x - x.floor();
        let place = |x: f32, at: f32, count: u32| {
            let moved = (wrap(x) * count as f32 + (at - 0.5)).floor();
            // Moved by one texel at most.
            let moved = if moved < 0.0 { moved + count as f32 } else { moved };
            if moved >= count as f32 { 0 } else { moved as u32 }
        };
        place(1.0 - uv[1], at[1], rows) * width + place(uv[0], at[0], width)
    }

    /// Returns the middle of one of the four texels of `level` around a texture coordinate, drawn as by
    /// [`Resident::texel_between`]: [`crate::evaluate`], [`crate::sample`] and [`crate::density`] there use that texel.
    pub fn uv_between(&self, level: u32, uv: [f32; 2], at: [f32; 2]) -> [f32; 2] {
        // All layers of a level have the same size.
        let layer = level * self.layers();
        let ([width, rows], texel) = (self.size(layer), self.texel_between(layer, uv, at));
        [((texel % width) as f32 + 0.5) / width as f32, 1.0 - ((texel / width) as f32 + 0.5) / rows as f32]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::residual::ResidualKind;
    use crate::testing::sample_asset;

    #[test]
    fn texels_between_are_drawn_with_bilinear_weights() {
        let resident = Resident::from_asset(&sample_asset(1, 6, 5, ResidualKind::Root));
        for uv in [[0.31, 0.77], [0.02, 0.99], [-3.2, 5.01], [0.999, 0.001]] {
            assert_eq!(resident.texel_between(0, uv, [0.5; 2]), resident.texel(0, uv));
            let mut counts = [0u32; 30];
            for (i, j) in (0..100).flat_map(|i| (0..100).map(move |j| (i, j))) {
                let at = [i, j].map(|x| (x as f32 + 0.5) / 100.0);
                let texel = resident.texel_between(0, uv, at);
                assert_eq!(resident.texel(0, resident.uv_between(0, uv, at)), texel);
                counts[texel as usize] += 1;
            }
            // Bilinear weights of the middles of texels, repeated.
            let place = [uv[0] * 6.0 - 0.5, (1.0 - uv[1]) * 5.0 - 0.5];
            let [x, y] = place.map(f32::floor);
            for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
                let weight = (1.0 - (place[0] - x - dx).abs()) * (1.0 - (place[1] - y - dy).abs());
                let texel = (y + dy).rem_euclid(5.0) as usize * 6 + (x + dx).rem_euclid(6.0) as usize;
                assert!((counts[texel] as f32 / 1e4 - weight).abs() < 0.02, "{uv:?} {texel}: {counts:?} {weight}");
            }
            assert_eq!(counts.iter().sum::<u32>(), 10_000);
        }
    }
}
