//! What is mapped on a skin: volumes, and how they differ from texel to texel by discrete jitter [Neyret 1996, section
//! 4.3]. Twin: `pattern.wgsl`, over the words of [`pattern_words`].

use super::cell::{cell_hash, cell_share};
use super::walk::TextureRay;
use glam::Vec3;
use std::sync::Arc;

/// Volumes that a pattern merges at most.
pub const MAX_MERGED: usize = 4;
/// The end of a list of merged volumes.
pub const NO_VOLUME: u32 = u32::MAX;
/// Words of a pattern before its volumes. Twin: `PATTERN_WORDS`.
const PATTERN_WORDS: usize = 11;
/// Bits of a pattern's flags. Twins: `PATTERN_TURNS`, `PATTERN_MIRRORS`.
const PATTERN_TURNS: u32 = 1;
/// See [`PATTERN_TURNS`].
const PATTERN_MIRRORS: u32 = 2;
/// Largest scale of a volume: its middle half fills a texel.
const MAX_SCALE: f32 = 2.0;
/// Numbers that are added to a texel's hash for each thing that is drawn from it.
const EMPTY: u32 = 0;
const ALTERNATIVE: u32 = 1;
const TURN: u32 = 3;
const MIRROR: u32 = 4;
const SCALE: u32 = 5;
const ALONG_U: u32 = 6;
const ALONG_V: u32 = 7;
/// The constants that the shader has too, by name.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, u32)] = &[
    ("PATTERN_WORDS", PATTERN_WORDS as u32),
    ("PATTERN_TURNS", PATTERN_TURNS),
    ("PATTERN_MIRRORS", PATTERN_MIRRORS),
    ("MAX_MERGED", MAX_MERGED as u32),
    ("DRAW_EMPTY", EMPTY),
    ("DRAW_ALTERNATIVE", ALTERNATIVE),
    ("DRAW_TURN", TURN),
    ("DRAW_MIRROR", MIRROR),
    ("DRAW_SCALE", SCALE),
    ("DRAW_ALONG_U", ALONG_U),
    ("DRAW_ALONG_V", ALONG_V),
];

/// Volumes that are present in the same place, each with materials of its own: their numbers, then [`NO_VOLUME`].
pub type Merged = [u32; MAX_MERGED];

/// The discrete jitter of isolated objects from texel to texel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DiscreteJitter {
    /// Share of texels without content, 0 to 1.
    pub empty: f32,
    /// Least and greatest scale of the content about the middle of its floor, above 0 and up to 2.
    pub scale: [f32; 2],
    /// Largest displacement along u and v, texels, 0 to 0.5. What would carry the content out of its texel is taken
    /// off.
    pub displacement: f32,
    /// Room between content and the sides of its volume, 0 to 0.5 of its edge: content may go so far nearer to the
    /// sides.
    pub margin: f32,
    /// Whether texels are turned about w by 0, 90, 180 or 270 degrees.
    pub turns: bool,
    /// Whether half of the texels are mirrored.
    pub mirrors: bool,
}

/// The content that is mapped on faces.
#[derive(Debug, Clone, PartialEq)]
pub struct Pattern {
    /// One of these is in each texel, chosen by chance; at least one. What differs in its materials alone is another
    /// volume.
    pub alternatives: Vec<Merged>,
    /// None for cyclic patterns, whose texels continue each other.
    pub jitter: Option<DiscreteJitter>,
    /// Which chances.
    pub seed: u32,
    /// What single texels hold; `None` where chance decides.
    pub cells: Option<Arc<CellMap>>,
}

/// What the texels of a rectangle hold. Those around it are empty.
#[derive(Debug, Clone, PartialEq)]
pub struct CellMap {
    /// Texels along u and along v, from (0, 0).
    pub size: [u32; 2],
    /// For each texel, row by row, 0 where it is empty, or 1 and the number of its alternative.
    pub content: Vec<u8>,
}

impl CellMap {
    /// Returns 0 where texel (i, j) is empty, or 1 and the number of its alternative. Twin: `pattern_cell_content`.
    fn cell_content(&self, cell: [i32; 2]) -> u32 {
        let [i, j] = cell.map(|x| x as u32);
        let [width, height] = self.size;
        if i >= width || j >= height { 0 } else { self.content[(j * width + i) as usize].into() }
    }
}

/// The content of one texel, and its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variant {
    /// Number of the alternative.
    pub alternative: u32,
    /// The texel's (i, j).
    pub cell: [i32; 2],
    /// Rows of the map of u - i and v - j to the volume's x and y.
    pub rows: [[f32; 2]; 2],
    /// What is added to them.
    pub offset: [f32; 2],
    /// The volume's z for w.
    pub upright: f32,
}

impl Pattern {
    /// Returns a pattern of one volume that continues itself from texel to texel.
    pub fn cyclic(volume: u32) -> Pattern {
        Pattern { alternatives: vec![merged(&[volume])], jitter: None, seed: 0, cells: None }
    }

    /// Returns a pattern of one isolated object.
    pub fn isolated(volume: u32, jitter: DiscreteJitter, seed: u32) -> Pattern {
        Pattern { jitter: Some(jitter), seed, ..Pattern::cyclic(volume) }
    }

    /// Returns the pattern with one of the first `count` volumes in each texel.
    pub(crate) fn one_of(self, count: u32) -> Pattern {
        Pattern { alternatives: (0..count).map(|volume| merged(&[volume])).collect(), ..self }
    }

    /// Checks the numbers of the pattern.
    ///
    /// # Errors
    /// A sentence that names what is out of range.
    pub fn check(&self) -> Result<(), String> {
        if self.alternatives.is_empty() || self.alternatives.iter().any(|volumes| volumes[0] == NO_VOLUME) {
            return Err("a pattern without a volume, give each alternative one at least".into());
        }
        let has_gap = |volumes: &Merged| volumes.windows(2).any(|two| two[0] == NO_VOLUME && two[1] != NO_VOLUME);
        if self.alternatives.iter().any(has_gap) {
            return Err("a pattern's alternative has a volume behind one that is missing, put its volumes first".into());
        }
        if let Some(CellMap { size: [width, height], content }) = self.cells.as_deref() {
            if content.len() as u64 != u64::from(*width) * u64::from(*height) {
                return Err(format!("a pattern's map has {} texels in place of {width} x {height}", content.len()));
            }
            if content.iter().any(|content| usize::from(*content) > self.alternatives.len()) {
                return Err("a pattern's map names an alternative that the pattern does not have".into());
            }
        }
        let Some(jitter) = self.jitter else { return Ok(()) };
        let [least, most] = jitter.scale;
        if !(least > 0.0 && least <= most && most <= MAX_SCALE) {
            return Err(format!("a pattern's scale is {least} to {most}, and must be above 0 and up to {MAX_SCALE}"));
        }
        for (name, value, most) in [
            ("share of empty texels", jitter.empty, 1.0),
            ("displacement", jitter.displacement, 0.5),
            ("margin", jitter.margin, 0.5),
        ] {
            if !(0.0..=most).contains(&value) {
                return Err(format!("a pattern's {name} is {value}, and must be 0 to {most}"));
            }
        }
        Ok(())
    }

    /// Returns what texel (i, j) holds; `None` where it is empty. A function of the texel and the seed alone. Twin:
    /// `pattern_variant`.
    pub fn variant(&self, cell: [i32; 2]) -> Option<Variant> {
        let jitter = self.jitter.unwrap_or(NO_JITTER);
        let hashed = cell_hash(cell, self.seed);
        let share = |draw: u32| cell_share(hashed, draw);
        if share(EMPTY) < jitter.empty {
            return None;
        }
        let among = |draw: u32, count: u32| among(hashed, draw, count);
        let alternative = match &self.cells {
            Some(cells) => cells.cell_content(cell).checked_sub(1)?,
            None => among(ALTERNATIVE, self.alternatives.len() as u32),
        };
        let scale = jitter.scale[0] + (jitter.scale[1] - jitter.scale[0]) * share(SCALE);
        // From the middle to the content's sides; what is left of half a texel is free.
        let free = (0.5 - scale * (0.5 - jitter.margin)).max(0.0);
        let furthest = jitter.displacement.min(free);
        let shift = [ALONG_U, ALONG_V].map(|draw| furthest * (2.0 * share(draw) - 1.0));
        let quarters = if jitter.turns { among(TURN, 4) } else { 0 };
        let (cos, sin) = QUARTERS[quarters as usize];
        let mirrored = if jitter.mirrors && share(MIRROR) < 0.5 { -1.0 } else { 1.0 };
        let inverse = 1.0 / scale;
        let rows = [[cos * inverse * mirrored, -sin * inverse], [sin * inverse * mirrored, cos * inverse]];
        let middle = shift.map(|shift| 0.5 + shift);
        Some(Variant {
            alternative,
            cell,
            rows,
            offset: rows.map(|[x, y]| 0.5 - (x * middle[0] + y * middle[1])),
            upright: inverse,
        })
    }
}

/// Returns one of so many, by chance.
fn among(hashed: u32, draw: u32, count: u32) -> u32 {
    ((cell_share(hashed, draw) * count as f32) as u32).min(count.max(1) - 1)
}

/// Cosine and sine of quarter turns.
const QUARTERS: [(f32, f32); 4] = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)];

/// Every texel as it is.
const NO_JITTER: DiscreteJitter =
    DiscreteJitter { empty: 0.0, scale: [1.0; 2], displacement: 0.0, margin: 0.0, turns: false, mirrors: false };

impl Variant {
    /// Transforms a point of the texture into the volume's unit cube, or outside where there is no content. Twin:
    /// `pattern_point`.
    pub fn point(&self, texture: Vec3) -> Vec3 {
        let local = Vec3::new(texture.x - self.cell[0] as f32, texture.y - self.cell[1] as f32, texture.z);
        self.direction(local) + Vec3::new(self.offset[0], self.offset[1], 0.0)
    }

    /// Transforms a direction of the texture into the volume; not unit. Twin: `pattern_direction`.
    pub fn direction(&self, direction: Vec3) -> Vec3 {
        let [[a, b], [c, d]] = self.rows;
        let Vec3 { x, y, z } = direction;
        Vec3::new(a * x + b * y, c * x + d * y, self.upright * z)
    }

    /// Transforms a ray of the texture into the volume, with the same t.
    pub fn ray(&self, ray: TextureRay) -> TextureRay {
        TextureRay { point: self.point(ray.point), direction: self.direction(ray.direction) }
    }

    /// Returns the three rows of the map, to compose with
    /// [`TextureMap::texture_from_world`](super::TextureMap::texture_from_world).
    pub fn volume_from_texture(&self) -> [[f32; 4]; 3] {
        let origin = self.point(Vec3::ZERO);
        let [[a, b], [c, d]] = self.rows;
        [[a, b, 0.0, origin.x], [c, d, 0.0, origin.y], [0.0, 0.0, self.upright, origin.z]]
    }
}

/// Merges up to four volumes in one place.
fn merged(volumes: &[u32]) -> Merged {
    std::array::from_fn(|i| volumes.get(i).copied().unwrap_or(NO_VOLUME))
}

/// Patterns as words for a GPU: their number, where each begins, and each one's numbers and volumes.
pub fn pattern_words(patterns: &[Pattern]) -> Vec<u32> {
    let mut words = vec![patterns.len() as u32];
    words.resize(1 + patterns.len(), 0);
    for (number, pattern) in patterns.iter().enumerate() {
        words[1 + number] = words.len() as u32;
        let jitter = pattern.jitter.unwrap_or(NO_JITTER);
        let flag = |on: bool, bit: u32| if on { bit } else { 0 };
        let (cells_at, size, content) = match pattern.cells.as_deref() {
            Some(CellMap { size, content }) => {
                (words.len() + PATTERN_WORDS + MAX_MERGED * pattern.alternatives.len(), *size, content.as_slice())
            }
            None => (0, [0; 2], &[][..]),
        };
        let numbers: [u32; PATTERN_WORDS] = [
            pattern.seed,
            jitter.empty.to_bits(),
            jitter.scale[0].to_bits(),
            jitter.scale[1].to_bits(),
            jitter.displacement.to_bits(),
            jitter.margin.to_bits(),
            flag(jitter.turns, PATTERN_TURNS) | flag(jitter.mirrors, PATTERN_MIRRORS),
            pattern.alternatives.len() as u32,
            cells_at as u32,
            size[0],
            size[1],
        ];
        words.extend(numbers);
        words.extend(pattern.alternatives.as_flattened());
        // Four texels a word.
        words.extend(content.chunks(4).map(|four| {
            let byte = |i: usize| u32::from(four.get(i).copied().unwrap_or(0)) << (8 * i);
            byte(0) | byte(1) | byte(2) | byte(3)
        }));
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    const WILD: DiscreteJitter =
        DiscreteJitter { empty: 0.25, scale: [0.5, 0.9], displacement: 0.5, margin: 0.1, turns: true, mirrors: true };

    const WILD_BUT_FULL: DiscreteJitter = DiscreteJitter { empty: 0.0, ..WILD };

    fn cells() -> impl Iterator<Item = [i32; 2]> {
        (-60..60).flat_map(|i| (-60..60).map(move |j| [i, j]))
    }

    #[test]
    fn a_cyclic_pattern_is_the_same_in_every_texel() {
        let pattern = Pattern::cyclic(7);
        assert_eq!(pattern.check(), Ok(()));
        for cell in cells() {
            let variant = pattern.variant(cell).unwrap();
            let texture = Vec3::new(cell[0] as f32 + 0.25, cell[1] as f32 + 0.75, 0.5);
            assert_eq!(variant.point(texture), Vec3::new(0.25, 0.75, 0.5));
            assert_eq!(variant.alternative, 0);
        }
    }

    #[test]
    fn chances_are_as_asked_and_independent_of_the_neighbours() {
        let pattern = Pattern {
            alternatives: vec![merged(&[0]), merged(&[1, 2]), merged(&[3])],
            ..Pattern::isolated(0, WILD, 11)
        };
        let variants: Vec<Option<Variant>> = cells().map(|cell| pattern.variant(cell)).collect();
        let count = |test: &dyn Fn(&Variant) -> bool| variants.iter().flatten().filter(|variant| test(variant)).count();
        let full = count(&|_| true) as f64;
        let near = |found: usize, share: f64| (found as f64 / full - share).abs() < 0.02;
        assert!((full / variants.len() as f64 - 0.75).abs() < 0.02);
        for alternative in 0..3 {
            assert!(near(count(&|variant| variant.alternative == alternative), 1.0 / 3.0));
        }
        let mirrored =
            |variant: &Variant| variant.rows[0][0] * variant.rows[1][1] - variant.rows[0][1] * variant.rows[1][0] < 0.0;
        assert!(near(count(&mirrored), 0.5));
        assert!(near(count(&|variant| variant.rows[0][0] == 0.0), 0.5), "half are turned by 90 or 270 degrees");
        // Neighbours have nothing to do with each other.
        let pairs = variants.windows(2).filter(|pair| pair[0].is_none() && pair[1].is_none()).count();
        assert!((pairs as f64 / variants.len() as f64 - 0.0625).abs() < 0.01, "{pairs}");
        // Another seed is another choice.
        let other = Pattern { seed: 12, ..pattern.clone() };
        assert!(
            cells().filter(|cell| other.variant(*cell).is_none() != pattern.variant(*cell).is_none()).count() > 4000
        );
    }

    #[test]
    fn content_stays_within_its_texel_and_maps_agree() {
        let pattern = Pattern::isolated(0, WILD, 3);
        let mut moved = 0;
        for variant in cells().filter_map(|cell| pattern.variant(cell)) {
            let [rows, cell] = [variant.volume_from_texture(), variant.volume_from_texture()];
            assert_eq!(rows, cell);
            // Where the texture has the content's corners, solved back by the map's own rows.
            let determinant = variant.rows[0][0] * variant.rows[1][1] - variant.rows[0][1] * variant.rows[1][0];
            for corner in [[0.1, 0.1], [0.9, 0.1], [0.1, 0.9], [0.9, 0.9]] {
                let [x, y] = [0, 1].map(|i| corner[i] - variant.offset[i]);
                let u = (variant.rows[1][1] * x - variant.rows[0][1] * y) / determinant;
                let v = (variant.rows[0][0] * y - variant.rows[1][0] * x) / determinant;
                assert!([u, v].iter().all(|x| (-1e-5..=1.0 + 1e-5).contains(x)), "{u} {v}");
                let texture = Vec3::new(u + variant.cell[0] as f32, v + variant.cell[1] as f32, 0.3);
                let volume = variant.point(texture);
                assert!((volume.truncate() - glam::Vec2::from(corner)).length() < 1e-4);
                let by_rows = rows.map(|row| texture.extend(1.0).dot(row.into()));
                assert!((volume - Vec3::from(by_rows)).length() < 1e-4);
            }
            moved += usize::from(variant.offset != [0.0; 2]);
        }
        assert!(moved > 1000);
    }

    #[test]
    fn a_map_says_what_its_texels_hold_and_the_others_are_empty() {
        let map = CellMap { size: [3, 2], content: vec![0, 1, 2, 2, 0, 1] };
        let alternatives = vec![merged(&[4]), merged(&[5])];
        let pattern = |content| Pattern {
            alternatives: alternatives.clone(),
            cells: Some(Arc::new(CellMap { content, ..map })),
            ..Pattern::isolated(0, WILD_BUT_FULL, 3)
        };
        let mapped = pattern(map.content.clone());
        assert_eq!(mapped.check(), Ok(()));
        let held: Vec<_> =
            (-1..3).flat_map(|j| (-1..4).map(move |i| [i, j])).map(|cell| mapped.variant(cell)).collect();
        let held: Vec<_> =
            held.iter().map(|variant| variant.map_or(-1, |variant| variant.alternative as i32)).collect();
        let rows = [[-1; 5], [-1, -1, 0, 1, -1], [-1, 1, -1, 0, -1], [-1; 5]];
        assert_eq!(held, rows.concat());
        assert!(pattern(vec![0, 1, 2, 2, 0]).check().unwrap_err().contains("3 x 2"));
        assert!(pattern(vec![0, 1, 2, 3, 0, 1]).check().unwrap_err().contains("alternative"));
    }

    #[test]
    fn says_what_is_out_of_range() {
        for (jitter, name) in [
            (DiscreteJitter { empty: 1.5, ..WILD }, "empty"),
            (DiscreteJitter { scale: [0.0, 1.0], ..WILD }, "scale"),
            (DiscreteJitter { scale: [0.9, 0.8], ..WILD }, "scale"),
            (DiscreteJitter { displacement: f32::NAN, ..WILD }, "displacement"),
            (DiscreteJitter { margin: -0.1, ..WILD }, "margin"),
        ] {
            assert!(Pattern::isolated(0, jitter, 0).check().unwrap_err().contains(name), "{name}");
        }
        assert!(Pattern { alternatives: Vec::new(), ..Pattern::cyclic(0) }.check().is_err());
        assert!(Pattern { alternatives: vec![merged(&[])], ..Pattern::cyclic(0) }.check().is_err());
        let gap = vec![merged(&[0, NO_VOLUME, 2])];
        assert!(Pattern { alternatives: gap, ..Pattern::cyclic(0) }.check().unwrap_err().contains("behind"));
    }
}
