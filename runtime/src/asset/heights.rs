//! The displacement of a layer: a height per texel.

/// A height per texel.
#[derive(Debug, Clone, PartialEq)]
pub struct Heights {
    /// Texel widths per code, more than 0 and at most [`crate::MAX_HEIGHT_STEP`].
    pub step: f32,
    /// Per texel: height above the plane that the capture is rectified to, in steps.
    pub codes: Vec<i8>,
}

impl Heights {
    /// Four codes a word, as the resident form has them.
    pub fn to_words(&self) -> Vec<u32> {
        let word = |codes: &[i8]| codes.iter().rev().fold(0, |word, code| word << 8 | u32::from(*code as u8));
        self.codes.chunks(4).map(word).collect()
    }

    /// Least and greatest height, texel widths.
    pub fn range(&self) -> [f32; 2] {
        let codes = || self.codes.iter().map(|code| f32::from(*code));
        [codes().fold(f32::INFINITY, f32::min), codes().fold(f32::NEG_INFINITY, f32::max)].map(|x| x * self.step)
    }
}
