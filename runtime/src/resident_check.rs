//! Checks the words of a resident asset that came from a file: afterwards no decoder reads outside of them, and every number
//! that it reads is finite and in its range. One pass over the words, without building anything.

use crate::asset::{EPSILON_RANGE, level_sizes};
use crate::edit::EDIT_WORDS;
use crate::format::{MAX_CLUSTERS, MAX_COMPONENTS, MAX_DICTIONARY, MAX_LAYERS, MAX_SIDE, MOST_LEVELS};
use crate::lobe::{LobeFamily, RESIDENT_WORDS};
use crate::parallax::MOST_HEIGHT_STEP;
use crate::resident::{
    ASSET_LAYERS, ASSET_WORDS, HORIZON_COS, LAYER_BLOCK_WORDS, LEAST_HORIZON_COS, PART_WORDS, block,
};
use crate::sphere::{Sphere, cells_a_side};
use crate::threads::{Threads, map};

/// What a check says: the rule that does not hold.
type Checked = Result<(), &'static str>;

/// Words of halves that one piece of work looks at.
const HALVES_AT_ONCE: usize = 1 << 20;

/// Checks the words of an asset of `width`, `height` and `layers`.
///
/// Errors: the first rule of FORMAT.md, chapter "Resident form", that does not hold.
pub(crate) fn check_resident(words: &[u32], [width, height, layers]: [u32; 3], threads: Threads) -> Checked {
    if words.len() < ASSET_WORDS || words[3] as usize != words.len() || words[5] as usize > words.len() {
        return Err("its length does not match its words");
    }
    if words[..3] != [width, height, layers] || words[6] | words[7] != 0 {
        return Err("its size or its layers are not the header's");
    }
    let [width, height] = [width, height].map(|side| side.clamp(1, MAX_SIDE) as usize);
    let mut sizes = vec![[width, height]];
    sizes.extend(level_sizes([width, height]));
    let (levels, layers) = (words[4] as usize, layers as usize);
    if levels == 0 || levels > sizes.len().min(MOST_LEVELS) || layers == 0 || layers > MAX_LAYERS {
        return Err("its number of levels is out of range");
    }
    let mut sides = Vec::new();
    for number in 0..levels * layers {
        let (level, of_level) = (number / layers, number % layers);
        let block = Block::at(words, words[ASSET_LAYERS + number])?;
        let of_block = [block::LIGHT_SIDE, block::VIEW_SIDE].map(|field| block.field(field));
        if of_block.iter().any(|side| *side > 1) || sides[level * layers..].contains(&of_block) {
            return Err("a layer's side is neither 0 nor 1, or an earlier layer has the same sides");
        }
        sides.push(of_block);
        if level > 0 && of_block != sides[of_level] {
            return Err("a level has its layers in another order");
        }
        block.check(sizes[level], threads)?;
    }
    Ok(())
}

/// A layer's block at a level.
struct Block<'a> {
    words: &'a [u32],
    at: usize,
}

/// A part of the words; `None` where it reaches beyond them.
fn part(words: &[u32], first: usize, count: usize) -> Option<&[u32]> {
    words.get(first..first.checked_add(count)?)
}

fn float(word: u32) -> f32 {
    f32::from_bits(word)
}

impl<'a> Block<'a> {
    fn at(words: &'a [u32], at: u32) -> Result<Block<'a>, &'static str> {
        let at = at as usize;
        if at < ASSET_WORDS || !at.is_multiple_of(PART_WORDS) || part(words, at, LAYER_BLOCK_WORDS).is_none() {
            return Err("a layer's block is not where one may be");
        }
        Ok(Block { words, at })
    }

    fn field(&self, field: usize) -> usize {
        self.words[self.at + field] as usize
    }

    fn float(&self, field: usize) -> f32 {
        float(self.words[self.at + field])
    }

    /// The part whose offset stands in `field`.
    fn part(&self, field: usize, count: usize) -> Result<&'a [u32], &'static str> {
        let first = self.field(field);
        if !first.is_multiple_of(PART_WORDS) {
            return Err("a part does not begin at a multiple of 64 words");
        }
        part(self.words, first, count).ok_or("a part reaches beyond the words")
    }

    fn check(&self, [width, rows]: [usize; 2], threads: Threads) -> Checked {
        let texels = width * rows;
        let (bases, clusters) = (self.field(block::BASES), self.field(block::CLUSTERS));
        if [self.field(block::WIDTH), self.field(block::ROWS)] != [width, rows] {
            return Err("a level has not half the size of the one before");
        }
        if self.field(block::RESIDUAL_KIND) > 2
            || self.field(block::LOBE_ROLE) > 1
            || !EPSILON_RANGE.contains(&self.float(block::EPSILON))
            || !(LEAST_HORIZON_COS..=HORIZON_COS).contains(&self.float(block::HORIZON))
            || bases > MAX_COMPONENTS + 1
            || clusters == 0
            || clusters > MAX_CLUSTERS
            || self.words[self.at + 28..self.at + LAYER_BLOCK_WORDS].iter().any(|word| *word != 0)
        {
            return Err("a layer's parameter is out of its range");
        }
        let [lights, views] = [self.sphere(block::LIGHTS)?, self.sphere(block::VIEWS)?];
        if self.field(block::LIGHT_COUNT) != lights || self.field(block::PAIRS) != lights * views {
            return Err("a layer's pairs are not its lights times its views");
        }
        let lobes = self.dictionaries(self.field(block::DICTIONARIES), clusters)?;
        self.edits(clusters)?;
        self.texels(texels, &lobes)?;
        self.heights(texels)?;
        if bases > 0 {
            let channel_words = self.field(block::CHANNEL_WORDS);
            let codes = self.field(block::CODE_WORDS);
            if channel_words < bases.div_ceil(2) || channel_words > MAX_COMPONENTS.div_ceil(2) + 1 {
                return Err("a pair has too few words for its bases, or too many");
            }
            if codes != (bases - 1).div_ceil(4) {
                return Err("a texel's codes do not match the bases");
            }
            self.part(block::CODES, texels * codes)?;
            let basis = self.part(block::BASIS, clusters * lights * views * 3 * channel_words)?;
            // Levels share what the finest has.
            if self.words[ASSET_LAYERS..ASSET_LAYERS + self.words[2] as usize].contains(&(self.at as u32)) {
                let pieces: Vec<&[u32]> = basis.chunks(HALVES_AT_ONCE).collect();
                if map(threads, pieces.len(), |i| halves_are_finite(pieces[i])).contains(&false) {
                    return Err("a basis is not finite");
                }
            } else if !self.is_of_the_finest(&[block::BASIS, block::CHANNEL_WORDS, block::CLUSTERS, block::PAIRS]) {
                return Err("a level has other bases than the finest");
            }
        }
        Ok(())
    }

    /// Whether some layer of the finest level has the same in all these fields.
    fn is_of_the_finest(&self, fields: &[usize]) -> bool {
        let finest = &self.words[ASSET_LAYERS..ASSET_LAYERS + self.words[2] as usize];
        finest
            .iter()
            .any(|at| fields.iter().all(|field| self.words[*at as usize + field] as usize == self.field(*field)))
    }

    /// Number of directions of a set.
    fn sphere(&self, field: usize) -> Result<usize, &'static str> {
        let first = self.field(field);
        let length = part(self.words, first, 5).and_then(Sphere::words_told_by).ok_or("a direction set is too long")?;
        let sphere = Sphere::from_words(self.part(field, length)?.to_vec())?;
        let [triangles, side] = [1, 3].map(|word| sphere.words()[word] as usize);
        if side != cells_a_side(triangles) {
            return Err("a grid has not the cells that its triangles ask for");
        }
        Ok(sphere.len())
    }

    /// Number of lobes of each dictionary of the table at word `table`.
    fn dictionaries(&self, table: usize, clusters: usize) -> Result<Vec<usize>, &'static str> {
        let offsets =
            part(self.words, table, clusters + 1).ok_or("a table of dictionaries reaches beyond the words")?;
        let mut counts = Vec::with_capacity(clusters);
        for ends in offsets.windows(2) {
            let [first, end] = [ends[0] as usize, ends[1] as usize];
            let lobes = (first <= end).then(|| part(self.words, first, end - first)).flatten();
            let Some(lobes) = lobes.filter(|lobes| lobes.len().is_multiple_of(RESIDENT_WORDS)) else {
                return Err("a dictionary is not where one may be");
            };
            if lobes.len() / RESIDENT_WORDS > MAX_DICTIONARY || !lobes.chunks_exact(RESIDENT_WORDS).all(lobe_is_fine) {
                return Err("a dictionary has more than 256 lobes, or one out of its range");
            }
            counts.push(lobes.len() / RESIDENT_WORDS);
        }
        Ok(counts)
    }

    fn edits(&self, clusters: usize) -> Checked {
        let (list, count) = (self.field(block::EDITS), self.field(block::EDIT_COUNT));
        if (list == 0) != (count == 0) || count > crate::edit::MOST_EDITS {
            return Err("its edits are not 0 to 255");
        }
        if count == 0 {
            return Ok(());
        }
        let lobes = self.dictionaries(self.field(block::DICTIONARIES), clusters)?;
        for edit in
            part(self.words, list, EDIT_WORDS * count).ok_or("its edits reach beyond the words")?.chunks(EDIT_WORDS)
        {
            let tints = edit[..3].iter().all(|tint| (0.0..=16.0).contains(&float(*tint)));
            if !tints || !(0.0..=1.0).contains(&float(edit[3])) {
                return Err("an edit is out of its range");
            }
            if self.dictionaries(edit[4] as usize, clusters)? != lobes {
                return Err("an edited dictionary has other lobes than the measured one");
            }
        }
        Ok(())
    }

    /// Records name clusters, edits, references and lobes that are there.
    fn texels(&self, texels: usize, lobes: &[usize]) -> Checked {
        let records = self.part(block::RECORDS, 2 * texels)?;
        let refs = self.part(block::REFS, self.field(block::REF_COUNT))?;
        let edits = self.field(block::EDIT_COUNT) as u32;
        for record in records.chunks_exact(2) {
            let (cluster, edit, count) = (record[0] & 0xff, record[0] >> 8 & 0xff, record[0] >> 16);
            let own = part(refs, record[1] as usize, count as usize);
            let (Some(lobes), Some(own)) = (lobes.get(cluster as usize), own.filter(|_| count < 256 && edit <= edits))
            else {
                return Err("a texel names a cluster, an edit or references that are not there");
            };
            if own.iter().any(|reference| (reference & 0xff) as usize >= *lobes) {
                return Err("a texel names a lobe that its cluster does not have");
            }
        }
        Ok(())
    }

    fn heights(&self, texels: usize) -> Checked {
        if self.field(block::HEIGHTS) == 0 {
            return Ok(());
        }
        self.part(block::HEIGHTS, texels.div_ceil(4))?;
        let [step, least, most] =
            [block::HEIGHT_STEP, block::LEAST_HEIGHT, block::MOST_HEIGHT].map(|field| self.float(field));
        let reach = 128.0 * MOST_HEIGHT_STEP;
        let fine = step > 0.0 && step <= MOST_HEIGHT_STEP && least >= -reach && most <= reach && least <= most;
        if fine { Ok(()) } else { Err("its heights are out of range") }
    }
}

/// Whether a lobe of the resident form has numbers that its family allows.
fn lobe_is_fine(words: &[u32]) -> bool {
    let Some(family) = LobeFamily::from_number(words[0]) else { return false };
    let number = |i: usize| float(words[i]);
    let unit = |at: usize| {
        let length2: f32 = (at..at + 3).map(|i| number(i) * number(i)).sum();
        (0.998..=1.002).contains(&length2)
    };
    // A thousandth more, as in the file form.
    let ranges = family.ranges();
    let fits = |i: usize| {
        let (least, most) = ranges[i];
        (least - 1e-3 * least.abs()..=most + 1e-3 * most.abs()).contains(&number(7 + i))
    };
    // A windowed cosine has its axis in full.
    let params_fit = if family == LobeFamily::WindowedCosine { fits(0) && unit(8) } else { (0..4).all(fits) };
    let scale = number(11);
    unit(1) && unit(4) && number(3) > 0.0 && params_fit && scale >= 0.0 && scale.is_finite() && words[12..] == [0; 4]
}

/// Whether both halves of all words are finite.
fn halves_are_finite(words: &[u32]) -> bool {
    // An exponent of all ones, in either half: adding one to it carries out of its field.
    let carries = |word: &u32| ((word & 0x7c00_7c00) + 0x0400_0400) & 0x8000_8000;
    words.chunks(4096).all(|chunk| chunk.iter().fold(0, |any, word| any | carries(word)) == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn infinite_and_undefined_halves_are_found_wherever_they_are() {
        let fine = [0x3c00_0000u32, 0xfbff_7bff, 0x0000_8000, 0x7bff_fbff];
        assert!(halves_are_finite(&fine));
        for odd in [0x7c00u32, 0xfc00, 0x7e01, 0xffff] {
            for (at, shift) in [(0, 0), (1, 16), (3, 16), (3, 0)] {
                let mut words = fine;
                words[at] = words[at] & !(0xffff << shift) | odd << shift;
                assert!(!halves_are_finite(&words), "{odd:x}");
            }
        }
    }
}
