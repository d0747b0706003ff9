//! The displacement of a layer: a height per texel.

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

    /// Interpolates bilinearly in a map of `size` columns and rows; the edges continue outside. Texel centres are at whole
    /// numbers.
    pub fn at(&self, size: [usize; 2], place: [f32; 2]) -> f32 {
        let [column, row] = [0, 1].map(|i| place[i].clamp(0.0, (size[i] - 1) as f32));
        let (c, r) = (column as usize, row as usize);
        let (next_c, next_r) = ((c + 1).min(size[0] - 1), (r + 1).min(size[1] - 1));
        let height = |c: usize, r: usize| self.step * f32::from(self.codes[r * size[0] + c]);
        let part = [column - c as f32, row - r as f32];
        let upper = height(c, r) + (height(next_c, r) - height(c, r)) * part[0];
        let lower = height(c, next_r) + (height(next_c, next_r) - height(c, next_r)) * part[0];
        upper + (lower - upper) * part[1]
    }

    /// Returns the least and the greatest height in texel widths.
    pub fn range(&self) -> [f32; 2] {
        let codes = || self.codes.iter().map(|code| f32::from(*code));
        [codes().fold(f32::INFINITY, f32::min), codes().fold(f32::NEG_INFINITY, f32::max)].map(|x| x * self.step)
    }
}
