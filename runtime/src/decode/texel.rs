//! A texel within a layer: everything that does not depend on the directions, its lobes and its residual. Twin:
//! `decode/texel.wgsl`.

use crate::asset::edit::EDIT_WORDS;
use crate::asset::lobe::{RESIDENT_WORDS, ResidentLobe, weight_scale};
use crate::decode::options::DecodeOptions;
use crate::numeric::quantize::{coefficient_from_byte, weight_from_byte};
use crate::resident::layout::{ASSET_LAYERS, block};
use crate::resident::packed_part::{PackedBasis, PackedPart, packed_bits};
use crate::resident::packed_table::PackedTable;
use crate::resident::resident::Resident;

/// The record of a texel, with the limits of the options applied.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Texel<'a> {
    pub words: &'a [u32],
    /// Places of packed numbers, where the bases are packed.
    pub table: Option<&'a PackedTable>,
    /// First word of the layer's block.
    pub layer: usize,
    pub texel: usize,
    pub cluster: usize,
    pub lobes: usize,
    pub first_ref: usize,
    /// Number of bases in use: the mean and the components; 0 without residual.
    pub bases: usize,
    /// Number of the texel's edit, counted from 1; 0 for none.
    pub edit: usize,
}

impl<'a> Texel<'a> {
    pub(crate) fn new(resident: &'a Resident, layer: u32, texel: u32, options: &DecodeOptions) -> Texel<'a> {
        let words = resident.words();
        let table = resident.is_packed(layer).then(|| resident.packed_table(layer));
        Texel::of_words(words, words[ASSET_LAYERS + layer as usize] as usize, table, texel, options)
    }

    /// Returns the first word of a texel's record, and of its codes.
    pub(crate) fn own_words(resident: &Resident, layer: u32, texel: u32) -> [usize; 2] {
        let words = resident.words();
        let block = &words[words[ASSET_LAYERS + layer as usize] as usize..];
        let [records, codes, code_words] = [block::RECORDS, block::CODES, block::CODE_WORDS].map(|i| block[i] as usize);
        [records + 2 * texel as usize, codes + code_words * texel as usize]
    }

    /// Returns another texel of the same layer.
    pub(crate) fn at(&self, texel: u32, options: &DecodeOptions) -> Texel<'a> {
        Texel::of_words(self.words, self.layer, self.table, texel, options)
    }

    fn of_words(
        words: &'a [u32],
        layer: usize,
        table: Option<&'a PackedTable>,
        texel: u32,
        options: &DecodeOptions,
    ) -> Texel<'a> {
        let record = words[layer + block::RECORDS] as usize + 2 * texel as usize;
        Texel {
            words,
            table,
            layer,
            texel: texel as usize,
            cluster: (words[record] & 0xff) as usize,
            lobes: (words[record] >> 16).min(options.lobes) as usize,
            first_ref: words[record + 1] as usize,
            bases: words[layer + block::BASES].min(options.components.saturating_add(1)) as usize,
            edit: (words[record] >> 8 & 0xff) as usize,
        }
    }

    /// Returns a word of the layer's block.
    pub(crate) fn field(&self, field: usize) -> usize {
        self.words[self.layer + field] as usize
    }

    /// Returns a number of the layer's block.
    pub(crate) fn float(&self, field: usize) -> f32 {
        f32::from_bits(self.words[self.layer + field])
    }

    /// Returns whether the texel has a residual and a record of relief.
    pub(crate) fn has_relief(&self) -> bool {
        self.bases > 0 && self.field(block::RELIEF) > 0
    }

    /// Returns the word of the texel's first lobe reference.
    pub(crate) fn first_lobe(&self) -> usize {
        self.field(block::REFS) + self.first_ref
    }

    /// Returns the first word of the dictionary of the texel's cluster, as measured (`edit` 0) or as the edit numbered
    /// `edit` has it.
    pub(crate) fn dictionary(&self, edit: usize) -> usize {
        let table = if edit == 0 {
            self.field(block::DICTIONARIES)
        } else {
            self.words[self.field(block::EDITS) + (edit - 1) * EDIT_WORDS + 4] as usize
        };
        self.words[table + self.cluster] as usize
    }

    /// Returns the texel's lobes from the dictionary at word `dictionary`, with the references to them.
    pub(crate) fn lobes_of(&self, dictionary: usize) -> impl Iterator<Item = (&'a ResidentLobe, u32)> {
        let words = self.words;
        let first = self.first_lobe();
        words[first..first + self.lobes].iter().map(move |reference| {
            let at = dictionary + (reference & 0xff) as usize * RESIDENT_WORDS;
            (words[at..].first_chunk().unwrap_or(&[0; RESIDENT_WORDS]), *reference)
        })
    }

    /// Sums the texel's lobes from the dictionary of `edit`, RGB; `value` evaluates one lobe.
    pub(crate) fn lobe_sum(&self, edit: usize, mut value: impl FnMut(&ResidentLobe) -> f32) -> [f32; 3] {
        let mut sum = [0.0; 3];
        for (lobe, reference) in self.lobes_of(self.dictionary(edit)) {
            let (value, weights) = (value(lobe), lobe_weights(lobe, reference));
            (0..3).for_each(|c| sum[c] += weights[c] * value);
        }
        sum
    }

    /// Returns the weight of basis `index`: 1 for the mean, the decoded code for a component, 0 for an unused basis.
    pub(crate) fn basis_weight(&self, index: usize) -> f32 {
        if index == 0 {
            return 1.0;
        }
        if index >= self.bases {
            return 0.0;
        }
        let component = index - 1;
        let word = self.words[self.field(block::CODES) + self.texel * self.field(block::CODE_WORDS) + component / 4];
        coefficient_from_byte(word >> (8 * (component as u32 % 4)) & 0xff)
    }

    /// Returns whether the bases are packed.
    pub(crate) fn is_packed(&self) -> bool {
        self.bases > 0 && self.field(block::CHANNEL_WORDS) == 0
    }

    /// Returns the part of the packed bases.
    pub(crate) fn packed(&self) -> PackedPart<'a> {
        PackedPart::new(self.words, self.field(block::BASIS))
    }

    /// Returns the first word of the packed row at the pair of `view` and `light`.
    pub(crate) fn packed_row(&self, view: u32, light: u32) -> usize {
        self.packed().row(self.cluster, view as usize * self.field(block::LIGHT_COUNT) + light as usize)
    }

    /// Returns the texel's packed codes, which end where its lobe references begin.
    pub(crate) fn packed_codes(&self) -> &'a [u32] {
        let first = self.field(block::REFS) + self.first_ref;
        &self.words[first - self.packed().code_words(self.cluster)..first]
    }

    /// Returns the weights of the bases in use where they are packed: 1 for the mean, the code for a component.
    pub(crate) fn packed_weights(&self) -> Vec<f32> {
        let (codes, mut bit) = (self.packed_codes(), 0);
        let bases = self.packed().bases(self.cluster, self.bases).iter().enumerate();
        let of_basis = bases.map(|(index, word)| {
            let width = PackedBasis::from_word(*word).code_width;
            bit += width;
            match (index, width) {
                (0, _) => 1.0,
                (_, 0) => 0.0,
                _ => packed_bits(codes, bit - width, width) as f32,
            }
        });
        of_basis.collect()
    }

    /// Returns the first word of the bases at the pair of `view` and `light`, counted from the first word of all bases.
    pub(crate) fn bases_at(&self, view: u32, light: u32) -> usize {
        let pair = self.cluster * self.field(block::PAIRS) + view as usize * self.field(block::LIGHT_COUNT);
        (pair + light as usize) * 3 * self.field(block::CHANNEL_WORDS)
    }
}

/// Returns the weights of a lobe that `reference` names, RGB.
pub(crate) fn lobe_weights(lobe: &ResidentLobe, reference: u32) -> [f32; 3] {
    [8, 16, 24].map(|shift| weight_from_byte(reference >> shift & 0xff, weight_scale(lobe)))
}
