//! Weaves: which yarn lies on top where warp and weft cross.

use std::fmt;

/// Interlacing of warp and weft.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weave {
    /// Plain weave: over one, under one.
    Plain,
    /// Twill: over two, under two, one further in every row, which gives diagonal ribs.
    Twill,
    /// Satin: warp over four, under one, the bindings scattered by a counter of two, which gives long floats.
    Satin,
}

impl Weave {
    /// Returns whether warp yarn `warp` (counted to the right) lies on top of weft yarn `weft` (counted upwards).
    pub fn warp_on_top(self, warp: i32, weft: i32) -> bool {
        match self {
            Weave::Plain => (warp + weft).rem_euclid(2) == 0,
            Weave::Twill => (warp - weft).rem_euclid(4) < 2,
            Weave::Satin => (warp + 2 * weft).rem_euclid(5) != 0,
        }
    }
}

impl fmt::Display for Weave {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Weave::Plain => "plain",
            Weave::Twill => "twill",
            Weave::Satin => "satin",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_yarn_is_bound_and_floats_have_their_length() {
        for (weave, period, on_top, longest) in
            [(Weave::Plain, 2, 1, 1), (Weave::Twill, 4, 2, 2), (Weave::Satin, 5, 4, 4)]
        {
            for i in -7..7 {
                let along_warp: Vec<bool> = (0..2 * period).map(|j| weave.warp_on_top(i, j)).collect();
                let along_weft: Vec<bool> = (0..2 * period).map(|j| weave.warp_on_top(j, i)).collect();
                for row in [&along_warp, &along_weft] {
                    assert_eq!(row.iter().filter(|top| **top).count(), 2 * on_top as usize, "{weave}");
                    assert_eq!(row[..period as usize], row[period as usize..], "{weave} repeats");
                    let doubled: String = row.iter().map(|top| if *top { 'w' } else { '.' }).collect();
                    let run = doubled.split('.').map(str::len).max().unwrap();
                    assert_eq!(run, longest, "{weave}");
                }
            }
        }
    }

    #[test]
    fn satin_bindings_never_touch() {
        let bound = |i, j| !Weave::Satin.warp_on_top(i, j);
        for i in 0..5 {
            for j in 0..5 {
                for (di, dj) in [(1, 0), (0, 1), (1, 1), (1, -1)] {
                    assert!(!(bound(i, j) && bound(i + di, j + dj)));
                }
            }
        }
    }
}
