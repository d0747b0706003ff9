//! A shell as words for a GPU: the header, positions, texture coordinates, tetrahedra and the boundary, in this order.
//! What moves comes first, so that a refreshed shell is one upload.

use super::shell::{Shell, Tet};
use std::ops::Range;

/// Words of the header, by their places. Twins: the constants of `skin_walk.wgsl`. All places count from the shell's
/// first word.
const TETS: usize = 0;
const POSITIONS_AT: usize = 1;
const TEXTURES_AT: usize = 2;
const TETS_AT: usize = 3;
const BOUNDARY: usize = 4;
const BOUNDARY_AT: usize = 5;
const HEADER_WORDS: usize = 6;
/// Words of a tetrahedron.
const TET_WORDS: usize = size_of::<Tet>() / 4;
/// The constants that the shader has too, by name.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, usize)] = &[
    ("SHELL_TETS", TETS),
    ("SHELL_POSITIONS_AT", POSITIONS_AT),
    ("SHELL_TEXTURES_AT", TEXTURES_AT),
    ("SHELL_TETS_AT", TETS_AT),
    ("SHELL_BOUNDARY", BOUNDARY),
    ("SHELL_BOUNDARY_AT", BOUNDARY_AT),
    ("TET_WORDS", TET_WORDS),
    ("TET_LINKS", std::mem::offset_of!(Tet, links) / 4),
    ("TET_TEXTURES", std::mem::offset_of!(Tet, textures) / 4),
    ("TET_PATTERN", std::mem::offset_of!(Tet, pattern) / 4),
];

impl Shell {
    /// Returns all words of the shell.
    ///
    /// # Errors
    /// A sentence if they are more than a word can number.
    pub fn words(&self) -> Result<Vec<u32>, String> {
        let moving = self.moving_words();
        let tets_at = moving.end;
        let boundary_at = tets_at + TET_WORDS * self.tets().len();
        if boundary_at + self.boundary().len() > u32::MAX as usize {
            return Err(format!(
                "a shell of {} tetrahedra is too large for a GPU; raise its tolerance",
                self.tets().len()
            ));
        }
        let mut words = vec![0; HEADER_WORDS];
        words[TETS] = self.tets().len() as u32;
        words[POSITIONS_AT] = HEADER_WORDS as u32;
        words[TEXTURES_AT] = (HEADER_WORDS + 3 * self.positions().len()) as u32;
        words[TETS_AT] = tets_at as u32;
        words[BOUNDARY] = self.boundary().len() as u32;
        words[BOUNDARY_AT] = boundary_at as u32;
        words.resize(moving.end, 0);
        self.write_moving(&mut words);
        words.extend_from_slice(bytemuck::cast_slice(self.tets()));
        words.extend_from_slice(self.boundary());
        Ok(words)
    }

    /// Returns the words that [`refresh`](Shell::refresh) changes.
    pub fn moving_words(&self) -> Range<usize> {
        HEADER_WORDS..HEADER_WORDS + 3 * (self.positions().len() + self.textures().len())
    }

    /// Writes those words into all `words` of the shell.
    ///
    /// # Panics
    /// If `words` are fewer than [`moving_words`](Shell::moving_words) end at.
    pub fn write_moving(&self, words: &mut [u32]) {
        let points = self.positions().iter().chain(self.textures());
        for (words, point) in words[self.moving_words()].chunks_exact_mut(3).zip(points) {
            words.copy_from_slice(&point.to_array().map(f32::to_bits));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{grid, twisted};
    use super::*;

    #[test]
    fn words_hold_the_shell_and_only_what_moves_changes() {
        let mut shell = Shell::new(&grid(3, 2), &Default::default()).unwrap();
        let mut words = shell.words().unwrap();
        let tet = &words[words[TETS_AT] as usize + 5 * TET_WORDS..][..TET_WORDS];
        assert_eq!(tet, bytemuck::cast_slice::<Tet, u32>(&shell.tets()[5..6]));
        let at = words[TEXTURES_AT] as usize + 3 * 7;
        assert_eq!([0, 1, 2].map(|i| f32::from_bits(words[at + i])), shell.textures()[7].to_array());
        assert_eq!(words[words[BOUNDARY_AT] as usize..], *shell.boundary());
        let before = words.clone();
        shell.refresh(&grid(2, 3)).unwrap();
        shell.write_moving(&mut words);
        assert_eq!(words, shell.words().unwrap());
        let changed = (0..words.len()).filter(|i| words[*i] != before[*i]);
        assert!(changed.clone().count() > 0 && changed.into_iter().all(|i| shell.moving_words().contains(&i)));
        assert!(shell.refresh(&twisted(3)).is_err());
    }
}
