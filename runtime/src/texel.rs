//! A texel within a layer: what does not depend on the directions, its lobes and its residual. Twin:
//! `shaders/texel.wgsl`.

use crate::decode::DecodeOptions;
use crate::edit::EDIT_WORDS;
use crate::lobe::{LobeSetup, RESIDENT_WORDS};
use crate::quantize::{coefficient_from_byte, half_at, weight_from_byte};
use crate::resident::{ASSET_LAYERS, Resident, block};

/// Columns and rows of the level whose layer's block begins at word `layer`.
pub(crate) fn size(words: &[u32], layer: usize) -> [usize; 2] {
    [block::WIDTH, block::ROWS].map(|field| words[layer + field] as usize)
}

/// A texel's record, with the options' limits applied.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Texel<'a> {
    pub words: &'a [u32],
    /// First word of the layer's block.
    pub layer: usize,
    pub texel: usize,
    pub cluster: usize,
    pub lobes: usize,
    pub first_ref: usize,
    /// The mean and the components that are used; 0 without residual.
    pub bases: usize,
    /// Number of the texel's edit, counted from 1; 0 for none.
    pub edit: usize,
}

impl<'a> Texel<'a> {
    pub(crate) fn new(resident: &'a Resident, layer: u32, texel: u32, options: &DecodeOptions) -> Texel<'a> {
        let words = resident.words();
        Texel::of_words(words, words[ASSET_LAYERS + layer as usize] as usize, texel, options)
    }

    /// Another texel of the same layer.
    pub(crate) fn at(&self, texel: u32, options: &DecodeOptions) -> Texel<'a> {
        Texel::of_words(self.words, self.layer, texel, options)
    }

    fn of_words(words: &'a [u32], layer: usize, texel: u32, options: &DecodeOptions) -> Texel<'a> {
        let record = words[layer + block::RECORDS] as usize + 2 * texel as usize;
        Texel {
            words,
            layer,
            texel: texel as usize,
            cluster: (words[record] & 0xff) as usize,
            lobes: (words[record] >> 16).min(options.lobes) as usize,
            first_ref: words[record + 1] as usize,
            bases: words[layer + block::BASES].min(options.components.saturating_add(1)) as usize,
            edit: (words[record] >> 8 & 0xff) as usize,
        }
    }

    /// A word of the layer's block.
    pub(crate) fn field(&self, field: usize) -> usize {
        self.words[self.layer + field] as usize
    }

    /// A number of the layer's block.
    pub(crate) fn float(&self, field: usize) -> f32 {
        f32::from_bits(self.words[self.layer + field])
    }

    /// The lobe that a reference names in the dictionary at word `dictionary`, and its weights, RGB.
    pub(crate) fn lobe(&self, dictionary: usize, reference: u32) -> (LobeSetup, [f32; 3]) {
        let at = dictionary + (reference & 0xff) as usize * RESIDENT_WORDS;
        let (lobe, scale) = LobeSetup::from_resident_words(&self.words[at..at + RESIDENT_WORDS]);
        (lobe, [8, 16, 24].map(|shift| weight_from_byte(reference >> shift & 0xff, scale)))
    }

    /// First word of the dictionary of the texel's cluster, as it was measured or as the edit numbered `edit` has it.
    pub(crate) fn dictionary(&self, edit: usize) -> usize {
        let table = if edit == 0 {
            self.field(block::DICTIONARIES)
        } else {
            self.words[self.field(block::EDITS) + (edit - 1) * EDIT_WORDS + 4] as usize
        };
        self.words[table + self.cluster] as usize
    }

    /// Sum of the lobes of that dictionary, RGB.
    pub(crate) fn lobe_sum(&self, edit: usize, wi: [f32; 3], wo: [f32; 3]) -> [f32; 3] {
        let dictionary = self.dictionary(edit);
        let refs = self.field(block::REFS) + self.first_ref;
        let mut sum = [0.0; 3];
        for slot in 0..self.lobes {
            let (lobe, weights) = self.lobe(dictionary, self.words[refs + slot]);
            let value = lobe.eval(wi, wo);
            (0..3).for_each(|c| sum[c] += weights[c] * value);
        }
        sum
    }

    /// Weight of basis `index`: 1 for the mean, the decoded code for a component.
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

    /// Residual at the pairs of `view` with those of three `lights` that are `wanted`, RGB each; 0 at the others.
    pub(crate) fn residual(&self, bases: Bases, view: u32, lights: [u32; 3], wanted: [bool; 3]) -> [[f32; 3]; 3] {
        match bases {
            Bases::Halves(words) => self.residual_of(view, lights, wanted, |index| {
                let halves = words[index];
                [half_at(halves, 0), half_at(halves, 1)]
            }),
            Bases::Singles(values) => {
                self.residual_of(view, lights, wanted, |index| [values[2 * index], values[2 * index + 1]])
            }
        }
    }

    fn residual_of(
        &self,
        view: u32,
        lights: [u32; 3],
        wanted: [bool; 3],
        two_at: impl Fn(usize) -> [f32; 2],
    ) -> [[f32; 3]; 3] {
        let channel_words = self.field(block::CHANNEL_WORDS);
        let pair = self.cluster * self.field(block::PAIRS) + view as usize * self.field(block::LIGHT_COUNT);
        let mut sum = [[0.0; 3]; 3];
        for word in 0..self.bases.div_ceil(2) {
            let (even, odd) = (self.basis_weight(2 * word), self.basis_weight(2 * word + 1));
            for l in 0..3 {
                if wanted[l] {
                    let at = (pair + lights[l] as usize) * 3 * channel_words + word;
                    for (c, sum) in sum[l].iter_mut().enumerate() {
                        let two = two_at(at + c * channel_words);
                        *sum += even * two[0] + odd * two[1];
                    }
                }
            }
        }
        sum
    }
}

/// Where a layer's expanded bases are read from, two at a time.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Bases<'a> {
    /// The resident form's words.
    Halves(&'a [u32]),
    /// As [`crate::SingleBases`] has them.
    Singles(&'a [f32]),
}
