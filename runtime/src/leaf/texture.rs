//! The appearance textures of a leaf: the channels of a texel packed into four words, coarser levels, and bilinear
//! lookup. Twin: `leaf/texture.wgsl`.

use crate::leaf::error::LeafError;
use crate::leaf::words::{LEVELS_AT, MAX_LEAF_LEVELS, TEXEL_WORDS, TEXELS_AT};

/// Largest number of texels in a row or column of a leaf's textures.
pub const MAX_LEAF_SIDE: usize = 1 << 14;

/// Code of a factor of 1.
pub const FACTOR_ONE: f32 = 127.0;

/// Largest factor that textures hold, 4.03.
pub const MAX_FACTOR: f32 = (255.0 / FACTOR_ONE) * (255.0 / FACTOR_ONE);

/// A texel of a leaf's appearance textures [Miao, eq. 9]. Each channel is kept in 8 bits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeafTexel {
    /// Factors on chlorophyll, on carotenoids, on brown pigment and anthocyanins, and on all absorption for thickness
    /// (V_a, V_c, V_b, V_t), 0 to [`MAX_FACTOR`]. Steps grow with the root of the factor, to 0.016 at 1, which is
    /// exact.
    pub factors: [f32; 4],
    /// Strength of the gloss of front and back (V_g), 0 to 1 in steps of 1/255.
    pub gloss: [f32; 2],
    /// Cosine and sine of twice the angle between u and the veins, -1 to 1 in steps of 1/127. Their length does not
    /// matter, and 0, 0 is along v.
    pub veins: [f32; 2],
    /// Shares of main vein, lesser veins and mesophyll, 0 to 1 in steps of 1/255. They only describe the place and do
    /// not change its colour.
    pub structure: [f32; 3],
    /// Coordinates x and y of the front's unit normal, then of the back's in its own frame (z away from the leaf), -1
    /// to 1 in steps that grow with the root, to 0.008 at 0.25.
    pub tilt: [f32; 4],
}

impl Default for LeafTexel {
    /// Returns mesophyll with the contents of the state, flat, with full gloss on both faces.
    fn default() -> LeafTexel {
        LeafTexel { factors: [1.0; 4], gloss: [1.0; 2], veins: [-1.0, 0.0], structure: [0.0, 0.0, 1.0], tilt: [0.0; 4] }
    }
}

impl LeafTexel {
    /// Adds all channels, weighted, to `sum`.
    fn add_to(&self, sum: &mut LeafTexel, weight: f32) {
        let pairs = [
            (&mut sum.factors[..], &self.factors[..]),
            (&mut sum.gloss, &self.gloss),
            (&mut sum.veins, &self.veins),
            (&mut sum.structure, &self.structure),
            (&mut sum.tilt, &self.tilt),
        ];
        for (sums, values) in pairs {
            sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
        }
    }

    /// Texel with all channels 0.
    const NONE: LeafTexel =
        LeafTexel { factors: [0.0; 4], gloss: [0.0; 2], veins: [0.0; 2], structure: [0.0; 3], tilt: [0.0; 4] };

    /// Packs the nearest codes. Values beyond their range are clamped; NaN counts as 0.
    fn words(&self) -> [u32; TEXEL_WORDS] {
        let unorm = |x: f32| u32::from((x.clamp(0.0, 1.0) * 255.0).round() as u8);
        let snorm = |x: f32| u32::from((x.clamp(-1.0, 1.0) * 127.0).round() as i8 as u8);
        let factor = |x: f32| u32::from((x.max(0.0).sqrt() * FACTOR_ONE).round() as u8);
        let tilt = |x: f32| snorm(x.abs().sqrt().copysign(x));
        let word = |bytes: [u32; 4]| bytes[0] | bytes[1] << 8 | bytes[2] << 16 | bytes[3] << 24;
        let [main, lesser, mesophyll] = self.structure.map(unorm);
        [
            word(self.factors.map(factor)),
            word([unorm(self.gloss[0]), unorm(self.gloss[1]), snorm(self.veins[0]), snorm(self.veins[1])]),
            word([main, lesser, mesophyll, 0]),
            word(self.tilt.map(tilt)),
        ]
    }
}

/// Unpacks four bytes of a word, the lowest first, to 0 to 1.
fn unorm_bytes(word: u32) -> [f32; 4] {
    word.to_le_bytes().map(|byte| f32::from(byte) / 255.0)
}

/// Unpacks four signed bytes of a word, the lowest first, to -1 to 1.
fn snorm_bytes(word: u32) -> [f32; 4] {
    word.to_le_bytes().map(|byte| (f32::from(byte as i8) / 127.0).max(-1.0))
}

/// Unpacks the texel whose first word is number `at`.
fn unpacked(words: &[u32], at: usize) -> LeafTexel {
    let factors = unorm_bytes(words[at]).map(|x| x * 255.0 / FACTOR_ONE);
    let gloss = unorm_bytes(words[at + 1]);
    let veins = snorm_bytes(words[at + 1]);
    let structure = unorm_bytes(words[at + 2]);
    LeafTexel {
        factors: factors.map(|x| x * x),
        gloss: [gloss[0], gloss[1]],
        veins: [veins[2], veins[3]],
        structure: [structure[0], structure[1], structure[2]],
        tilt: snorm_bytes(words[at + 3]).map(|x| x * x.abs()),
    }
}

/// Reads the textures at `uv` (u to the right, v up, one repetition a unit) of `level` (the coarsest if there are
/// fewer), bilinear between texels.
pub fn texel_at(words: &[u32], uv: [f32; 2], level: u32) -> LeafTexel {
    let level = level.min(words[1] - 1);
    let (width, rows) = ((words[2] >> level).max(1), (words[3] >> level).max(1));
    let first = words[LEVELS_AT + level as usize] as usize;
    let x = (uv[0] - uv[0].floor()) * width as f32 - 0.5;
    let y = (1.0 - uv[1] - (1.0 - uv[1]).floor()) * rows as f32 - 0.5;
    let (right, down) = (x - x.floor(), y - y.floor());
    let mut sum = LeafTexel::NONE;
    for (dy, share_y) in [(0, 1.0 - down), (1, down)] {
        for (dx, share_x) in [(0, 1.0 - right), (1, right)] {
            let column = (x.floor() as i32 + dx).rem_euclid(width as i32) as usize;
            let row = (y.floor() as i32 + dy).rem_euclid(rows as i32) as usize;
            unpacked(words, first + TEXEL_WORDS * (row * width as usize + column)).add_to(&mut sum, share_x * share_y);
        }
    }
    sum
}

/// The appearance textures of a leaf.
#[derive(Debug, Clone, PartialEq)]
pub struct LeafTexture {
    /// Number of texels in a row.
    pub width: usize,
    /// Texels `[row, column]`, the top row (v = 1) first.
    pub texels: Vec<LeafTexel>,
}

impl LeafTexture {
    /// Returns textures with the same texel everywhere.
    pub fn uniform(texel: LeafTexel) -> LeafTexture {
        LeafTexture { width: 1, texels: vec![texel] }
    }

    /// Returns the number of rows that the texels fill.
    ///
    /// # Errors
    /// [`LeafError::Texels`] if the texels do not fill whole rows, or are too many.
    pub(crate) fn rows(&self) -> Result<usize, LeafError> {
        let rows = self.texels.len() / self.width.max(1);
        let fills = rows * self.width == self.texels.len() && rows > 0;
        if fills && self.width.max(rows) <= MAX_LEAF_SIDE {
            return Ok(rows);
        }
        Err(LeafError::Texels { width: self.width, height: rows, texels: self.texels.len(), most: MAX_LEAF_SIDE })
    }

    /// Returns the words of all levels from [`LEVELS_AT`] on, and the number of levels. Each level averages the areas
    /// of its texels in the level before, unrounded.
    pub(crate) fn words(&self, rows: usize) -> (Vec<u32>, u32) {
        let mut offsets = vec![0; MAX_LEAF_LEVELS];
        let (mut words, mut level) = (Vec::new(), 0);
        let (mut width, mut rows) = (self.width, rows);
        let mut coarser: Vec<LeafTexel>;
        let mut texels = &self.texels;
        loop {
            offsets[level] = (TEXELS_AT + words.len()) as u32;
            words.extend(texels.iter().flat_map(LeafTexel::words));
            level += 1;
            if width == 1 && rows == 1 {
                break;
            }
            let half = [(width / 2).max(1), (rows / 2).max(1)];
            coarser = halved(texels, [width, rows], half);
            [width, rows] = half;
            texels = &coarser;
        }
        offsets.extend(words);
        (offsets, level as u32)
    }
}

/// Averages `texels` over the texels of a coarser grid.
fn halved(texels: &[LeafTexel], from: [usize; 2], to: [usize; 2]) -> Vec<LeafTexel> {
    // Cells of the finer grid below cell `i` of the coarser one, with the share of it that each covers.
    let below = |i: usize, axis: usize| -> Vec<(usize, f32)> {
        let scale = from[axis] as f32 / to[axis] as f32;
        let (start, end) = (i as f32 * scale, (i + 1) as f32 * scale);
        (start as usize..from[axis].min(end.ceil() as usize))
            .map(|cell| (cell, ((cell + 1) as f32).min(end) - (cell as f32).max(start)))
            .map(|(cell, overlap)| (cell, overlap / scale))
            .collect()
    };
    let columns: Vec<_> = (0..to[0]).map(|x| below(x, 0)).collect();
    let mean = |rows: &[(usize, f32)], columns: &[(usize, f32)]| {
        let mut sum = LeafTexel::NONE;
        for &(y, share_y) in rows {
            for &(x, share_x) in columns {
                texels[y * from[0] + x].add_to(&mut sum, share_x * share_y);
            }
        }
        sum
    };
    (0..to[1])
        .map(|y| below(y, 1))
        .flat_map(|rows| columns.iter().map(move |columns| (rows.clone(), columns)))
        .map(|(rows, columns)| mean(&rows, columns))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leaf::leaf::Leaf;
    use crate::leaf::state::LeafState;

    fn words(texture: &LeafTexture) -> Vec<u32> {
        Leaf::new(&LeafState::default(), texture).unwrap().words().to_vec()
    }

    fn near(a: &LeafTexel, b: &LeafTexel, tolerance: f32) -> bool {
        let all = |t: &LeafTexel| [&t.factors[..], &t.gloss, &t.veins, &t.structure, &t.tilt].concat();
        all(a).iter().zip(all(b)).all(|(x, y)| (x - y).abs() <= tolerance)
    }

    #[test]
    fn channels_survive_their_codes_and_a_factor_of_1_does_exactly() {
        let texel = |i: usize| {
            let x = i as f32 / 100.0;
            LeafTexel {
                factors: [x, 4.0 * x, 1.0, 0.9],
                gloss: [x, 1.0 - x],
                veins: [1.0 - 2.0 * x, x],
                structure: [x, 0.5, 1.0 - x],
                tilt: [0.5 * x, -0.3 * x, 0.7 * x, 0.0],
            }
        };
        for i in 0..=100 {
            let (whole, words) = (texel(i), texel(i).words());
            let back = unpacked(&words, 0);
            assert_eq!(back.factors[2], 1.0);
            for (x, y) in whole.factors.iter().zip(back.factors) {
                assert!((x - y).abs() <= x.sqrt() / 127.0 + 1e-4, "{x} {y}");
            }
            assert!(near(&whole, &LeafTexel { factors: whole.factors, ..back }, 0.008), "{whole:?} {back:?}");
        }
        // Beyond the range the end counts, and what is no number is none.
        let odd = LeafTexel { factors: [1e9, -3.0, f32::NAN, 1.0], gloss: [2.0, f32::NAN], ..LeafTexel::default() };
        let back = unpacked(&odd.words(), 0);
        assert_eq!(back.factors, [MAX_FACTOR, 0.0, 0.0, 1.0]);
        assert_eq!(back.gloss, [1.0, 0.0]);
    }

    #[test]
    fn levels_are_means_and_places_between_texels_are_mixed_and_repeat() {
        let texel = |x: f32| LeafTexel { gloss: [x, 0.5], ..LeafTexel::default() };
        // Two rows of three: the upper 0, 0.2, 0.4, the lower 0.6, 0.8, 1.
        let texture = LeafTexture { width: 3, texels: (0..6).map(|i| texel(0.2 * i as f32)).collect() };
        let words = words(&texture);
        assert_eq!(words[1..4], [2, 3, 2]);
        let gloss = |uv: [f32; 2], level| texel_at(&words, uv, level).gloss[0];
        let centre = |column: f32, row: f32| [(column + 0.5) / 3.0, 1.0 - (row + 0.5) / 2.0];
        assert!((gloss(centre(0.0, 0.0), 0) - 0.0).abs() < 1e-5);
        assert!((gloss(centre(2.0, 1.0), 0) - 1.0).abs() < 1e-5);
        assert!((gloss(centre(0.5, 1.0), 0) - 0.7).abs() < 1e-5);
        assert!((gloss(centre(1.0, 0.5), 0) - 0.5).abs() < 1e-5);
        // Around the edge, and periods away.
        assert!((gloss(centre(2.5, 0.0), 0) - 0.2).abs() < 1e-5);
        assert!((gloss([0.1 - 4.0, 0.3 + 5.0], 0) - gloss([0.1, 0.3], 0)).abs() < 1e-4);
        // The coarsest, whatever level beyond it is asked.
        for level in [1, 7] {
            assert!((gloss([0.3, 0.8], level) - 0.5).abs() < 3e-3);
        }
        assert!(near(&texel_at(&words, [0.4; 2], 1), &texel(0.5), 3e-3));
        assert!(!near(&texel_at(&words, [0.4; 2], 1), &texel(0.6), 3e-3), "planted");
    }

    #[test]
    fn levels_of_odd_sides_weigh_every_texel_alike() {
        let mut texture =
            LeafTexture { width: 5, texels: vec![LeafTexel { gloss: [0.0; 2], ..LeafTexel::default() }; 35] };
        for at in [0, 12, 34] {
            let mut texels = texture.texels.clone();
            texels[at].gloss = [1.0, 1.0];
            let coarse = halved(&texels, [5, 7], [2, 3]);
            let mean = coarse.iter().map(|texel| texel.gloss[0]).sum::<f32>() / 6.0;
            assert!((mean - 1.0 / 35.0).abs() < 1e-5, "{at}: {mean}");
        }
        texture.texels.truncate(34);
        assert!(Leaf::new(&LeafState::default(), &texture).is_err());
        for width in [0, MAX_LEAF_SIDE + 1] {
            let texels = vec![LeafTexel::default(); width];
            let error = Leaf::new(&LeafState::default(), &LeafTexture { width, texels }).unwrap_err();
            assert!(error.to_string().contains("texels"), "{error}");
        }
    }
}
