//! The displacement of a layer: a height per texel.

use crate::asset::height_field::HeightField;

/// The displacement of a layer: a height for each texel.
#[derive(Debug, Clone, PartialEq)]
pub struct Heights {
    /// Height of one code in texel widths, more than 0 and at most [`crate::MAX_HEIGHT_STEP`].
    pub step: f32,
    /// Height of each texel above the plane that the capture is rectified to, in steps.
    pub codes: Vec<i8>,
}

impl Heights {
    /// Packs the codes, four in a word, as the resident form has them.
    pub fn to_words(&self) -> Vec<u32> {
        let word = |codes: &[i8]| codes.iter().rev().fold(0, |word, code| word << 8 | u32::from(*code as u8));
        self.codes.chunks(4).map(word).collect()
    }

    /// Returns the heights as a map of `size` columns and rows.
    pub fn field(&self, size: [usize; 2]) -> HeightField<'_> {
        HeightField { codes: &self.codes, size, step: self.step, range: self.range() }
    }

    /// Returns the least and the greatest height in texel widths.
    pub fn range(&self) -> [f32; 2] {
        let codes = || self.codes.iter().map(|code| f32::from(*code));
        [codes().fold(f32::INFINITY, f32::min), codes().fold(f32::NEG_INFINITY, f32::max)].map(|x| x * self.step)
    }
}
