//! Checks the words of a resident asset that came from a file: afterwards no decoder reads outside of them, and every
//! number that it reads is finite and in its range. One pass over the words, without building anything.

use crate::asset::asset::{LobeRole, level_sizes};
use crate::asset::disk::cells_a_side;
use crate::asset::edit::EDIT_WORDS;
use crate::asset::limits::EPSILON_RANGE;
use crate::asset::limits::MAX_HEIGHT_STEP;
use crate::asset::limits::{
    MAX_CHANNEL_WORDS, MAX_CLUSTERS, MAX_COMPONENTS, MAX_DICTIONARY, MAX_LAYERS, MAX_LEVELS, MAX_SIDE,
};
use crate::asset::lobe::{LobeFamily, RESIDENT_WORDS};
use crate::asset::relief::{RELIEF_WORDS, Relief};
use crate::asset::residual::ResidualKind;
use crate::asset::spectrum::Spectrum;
use crate::asset::sphere::Sphere;
use crate::resident::layout::{
    ASSET_LAYERS, ASSET_WORDS, HORIZON_COS, LAYER_BLOCK_WORDS, MIN_HORIZON_COS, PART_WORDS, SPECTRUM, block,
};
use crate::resident::packed_part::{
    MAX_UNIT, PACKED_PLACES, PLACE_WORDS, PackedBasis, code_words as code_words_of, row_words,
};
use crate::rule::{self, Rule};
use crate::threads::{Threads, map};

/// The result of a check: the rule that does not hold, if any.
type Checked = Result<(), Rule>;

/// Number of words of halves that one piece of work checks.
const HALVES_AT_ONCE: usize = 1 << 20;

/// A rule that does not hold, and its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BrokenWords {
    pub rule: Rule,
    /// Level and layer of the block that breaks the rule; `None` if the asset's own words do.
    pub block: Option<[u32; 2]>,
    /// Word that holds the place of the block, or 0.
    pub word: usize,
}

/// Checks the words of an asset of `width`, `height` and `layers` by the rules of format.md, chapter "Resident form".
/// Returns the rules that do not hold. Coarser levels are checked only if the finest, which they refer to, is correct.
pub(crate) fn check_resident(words: &[u32], head: [u32; 3], threads: Threads) -> Vec<BrokenWords> {
    let (levels, layers) = match check_head(words, head) {
        Ok(counts) => counts,
        Err(rule) => return vec![BrokenWords { rule, block: None, word: 0 }],
    };
    let finest = [head[0], head[1]].map(|side| side.clamp(1, MAX_SIDE) as usize);
    let sizes: Vec<[usize; 2]> = std::iter::once(finest).chain(level_sizes(finest)).collect();
    let (mut broken, mut sides) = (Vec::new(), Vec::new());
    for number in 0..levels * layers {
        let (level, of_level) = (number / layers, number % layers);
        if level == 1 && of_level == 0 && !broken.is_empty() {
            break;
        }
        let mut rules = Vec::new();
        let mut of_block = None;
        if let Some(block) = keep(&mut rules, Block::at(words, words[ASSET_LAYERS + number])) {
            let both = [block::LIGHT_SIDE, block::VIEW_SIDE].map(|field| block.field(field));
            if both.iter().any(|side| *side > 1) || sides[level * layers..].contains(&Some(both)) {
                rules.push(rule::BLOCK_SIDES);
            } else if level > 0 && Some(both) != sides[of_level] {
                rules.push(rule::BLOCK_ORDER);
            }
            of_block = Some(both);
            block.check(sizes[level], threads, &mut rules);
        }
        sides.push(of_block);
        let block = Some([level as u32, of_level as u32]);
        broken.extend(rules.into_iter().map(|rule| BrokenWords { rule, block, word: ASSET_LAYERS + number }));
    }
    let groups = if words[SPECTRUM] == 0 { 1 } else { words[words[SPECTRUM] as usize + 1] as usize };
    let checked = if groups > 1 && broken.is_empty() { levels * layers } else { 0 };
    for number in 0..checked {
        let repeats = Block::at(words, words[ASSET_LAYERS + number])
            .and_then(|block| block.sphere_words(block::LIGHTS))
            .and_then(|words| Sphere::from_words(words.to_vec()))
            .is_ok_and(|lights| lights.repeats(groups));
        if !repeats {
            let block = Some([(number / layers) as u32, (number % layers) as u32]);
            broken.push(BrokenWords { rule: rule::LIGHT_GROUPS, block, word: ASSET_LAYERS + number });
        }
    }
    broken
}

/// Checks the asset's own words; returns the numbers of levels and layers.
fn check_head(words: &[u32], [width, height, layers]: [u32; 3]) -> Result<(usize, usize), Rule> {
    if words.len() < ASSET_WORDS || words[3] as usize != words.len() || words[5] as usize > words.len() {
        return Err(rule::WORDS_LENGTH);
    }
    if words[..3] != [width, height, layers] || words[7] != 0 {
        return Err(rule::WORDS_HEAD);
    }
    let at = words[SPECTRUM] as usize;
    let is_place = at >= ASSET_WORDS && at.is_multiple_of(PART_WORDS) && at < words.len();
    if at != 0 && !(is_place && Spectrum::from_words(&words[at..]).is_some()) {
        return Err(rule::SPECTRUM_WORDS);
    }
    let (levels, layers) = (words[4] as usize, layers as usize);
    let most = 1 + level_sizes([width, height].map(|side| side.clamp(1, MAX_SIDE) as usize)).len();
    if levels == 0 || levels > most.min(MAX_LEVELS) || layers == 0 || layers > MAX_LAYERS {
        return Err(rule::LEVEL_COUNT);
    }
    Ok((levels, layers))
}

/// Returns the value of a successful read; keeps the rule of a failed one and returns `None`.
fn keep<T>(rules: &mut Vec<Rule>, read: Result<T, Rule>) -> Option<T> {
    read.map_err(|rule| rules.push(rule)).ok()
}

/// The block of a layer at a level.
struct Block<'a> {
    words: &'a [u32],
    at: usize,
}

/// Returns `count` of the words from `first` on; `None` where they reach beyond the end.
fn part(words: &[u32], first: usize, count: usize) -> Option<&[u32]> {
    words.get(first..first.checked_add(count)?)
}

fn float(word: u32) -> f32 {
    f32::from_bits(word)
}

impl<'a> Block<'a> {
    fn at(words: &'a [u32], at: u32) -> Result<Block<'a>, Rule> {
        let at = at as usize;
        if at < ASSET_WORDS || !at.is_multiple_of(PART_WORDS) || part(words, at, LAYER_BLOCK_WORDS).is_none() {
            return Err(rule::BLOCK_PLACE);
        }
        Ok(Block { words, at })
    }

    fn field(&self, field: usize) -> usize {
        self.words[self.at + field] as usize
    }

    fn float(&self, field: usize) -> f32 {
        float(self.words[self.at + field])
    }

    /// Returns the part of `count` words whose offset stands in `field`.
    fn part(&self, field: usize, count: usize) -> Result<&'a [u32], Rule> {
        let first = self.field(field);
        if !first.is_multiple_of(PART_WORDS) {
            return Err(rule::PART_START);
        }
        part(self.words, first, count).ok_or(rule::PART_BEYOND)
    }

    /// Checks the block, and adds the rules that do not hold to `rules`.
    fn check(&self, [width, rows]: [usize; 2], threads: Threads, rules: &mut Vec<Rule>) {
        let texels = width * rows;
        let (bases, clusters) = (self.field(block::BASES), self.field(block::CLUSTERS));
        if [self.field(block::WIDTH), self.field(block::ROWS)] != [width, rows] {
            rules.push(rule::BLOCK_SIZE);
        }
        if self.field(block::RESIDUAL_KIND) > 2
            || self.field(block::LOBE_ROLE) > 2
            || !EPSILON_RANGE.contains(&self.float(block::EPSILON))
            || !(MIN_HORIZON_COS..=HORIZON_COS).contains(&self.float(block::HORIZON))
            || bases > MAX_COMPONENTS + 1
            || clusters == 0
            || clusters > MAX_CLUSTERS
        {
            rules.push(rule::BLOCK_PARAMETER);
            return;
        }
        let sets = [block::LIGHTS, block::VIEWS].map(|field| keep(rules, self.sphere(field)));
        if let [Some(lights), Some(views)] = sets {
            if self.field(block::LIGHT_COUNT) != lights || self.field(block::PAIRS) != lights * views {
                rules.push(rule::BLOCK_PAIRS);
            }
            keep(rules, self.residual(texels, clusters * lights * views * 3, threads));
        }
        if let Some(lobes) = keep(rules, self.dictionaries(self.field(block::DICTIONARIES), clusters)) {
            keep(rules, self.edits(&lobes));
            keep(rules, self.texels(texels, &lobes));
        }
        keep(rules, self.heights(texels));
        keep(rules, self.relief(texels));
    }

    /// Checks bases and codes; `rows` is the number of the clusters' pairs and channels.
    fn residual(&self, texels: usize, rows: usize, threads: Threads) -> Checked {
        let bases = self.field(block::BASES);
        let (channel_words, codes) = (self.field(block::CHANNEL_WORDS), self.field(block::CODE_WORDS));
        if bases == 0 {
            // Nothing lies there, and decoders begin to look there all the same.
            return self.part(block::BASIS, 0).and(self.part(block::CODES, 0)).map(|_| ());
        }
        if channel_words == 0 {
            return self.packed(rows / (3 * self.field(block::CLUSTERS)));
        }
        if channel_words < bases.div_ceil(2) || channel_words > MAX_CHANNEL_WORDS {
            return Err(rule::CHANNEL_WORDS);
        }
        if codes != (bases - 1).div_ceil(4) {
            return Err(rule::CODE_WORDS);
        }
        self.part(block::CODES, texels * codes)?;
        let basis = self.part(block::BASIS, rows * channel_words)?;
        // Levels share what the finest has.
        if self.is_finest() {
            let pieces: Vec<&[u32]> = basis.chunks(HALVES_AT_ONCE).collect();
            if map(threads, pieces.len(), |i| halves_are_finite(pieces[i])).contains(&false) {
                return Err(rule::BASIS_NOT_FINITE);
            }
        } else if !self.is_of_the_finest(&[block::BASIS, block::CHANNEL_WORDS, block::CLUSTERS, block::PAIRS]) {
            return Err(rule::OTHER_BASES);
        }
        Ok(())
    }

    /// Checks packed bases of `pairs` pairs; their codes are checked with the records.
    fn packed(&self, pairs: usize) -> Checked {
        let [bases, clusters, code_words] =
            [block::BASES, block::CLUSTERS, block::CODE_WORDS].map(|field| self.field(field));
        if code_words != 0 {
            return Err(rule::CODE_WORDS);
        }
        self.part(block::CODES, 0)?;
        let at = self.field(block::BASIS);
        let first_basis = PACKED_PLACES + PLACE_WORDS * clusters;
        let head = self.part(block::BASIS, first_basis)?;
        let (unit, stored) = (float(head[0]), head[1] as usize);
        if !self.is_finest() {
            let shared = [block::BASIS, block::CHANNEL_WORDS, block::CLUSTERS, block::PAIRS];
            let is_shared = bases <= stored && self.is_of_the_finest(&shared);
            return if is_shared { Ok(()) } else { Err(rule::OTHER_BASES) };
        }
        if stored != bases || head[2] as usize != first_basis || head[3] != 0 {
            return Err(rule::PACKED_ROWS);
        }
        let words = self.part(block::BASIS, first_basis + clusters * stored)?;
        let places = head[PACKED_PLACES..].chunks_exact(PLACE_WORDS);
        for (words, place) in words[first_basis..].chunks_exact(stored).zip(places) {
            let own: Vec<PackedBasis> = words.iter().map(|word| PackedBasis::from_word(*word)).collect();
            let steps_are_good = unit > 0.0 && unit <= MAX_UNIT && own.iter().all(|basis| basis.has_good_step(unit));
            if !steps_are_good || own[0].code_width != 0 || own.iter().skip(1).any(|basis| !basis.has_good_widths()) {
                return Err(rule::PACKED_BASIS);
            }
            let [first, length, of_codes] = [0, 1, 2].map(|word| place[word] as usize);
            let rows = || part(self.words, first.checked_add(at)?, pairs.checked_mul(length)?);
            if length != row_words(&own) || of_codes != code_words_of(&own) || rows().is_none() {
                return Err(rule::PACKED_ROWS);
            }
        }
        Ok(())
    }

    /// Returns the words of the packed codes of a texel of each cluster; none where bases are not packed.
    fn packed_code_words(&self) -> Vec<usize> {
        if self.field(block::BASES) == 0 || self.field(block::CHANNEL_WORDS) != 0 {
            return Vec::new();
        }
        let first = self.field(block::BASIS).saturating_add(PACKED_PLACES);
        let places = part(self.words, first, PLACE_WORDS * self.field(block::CLUSTERS));
        places.map_or(Vec::new(), |places| {
            places.iter().skip(2).step_by(PLACE_WORDS).map(|word| *word as usize).collect()
        })
    }

    /// Returns whether this is a layer of the finest level.
    fn is_finest(&self) -> bool {
        self.words[ASSET_LAYERS..ASSET_LAYERS + self.words[2] as usize].contains(&(self.at as u32))
    }

    /// Returns whether some layer of the finest level has the same values in all these fields.
    fn is_of_the_finest(&self, fields: &[usize]) -> bool {
        let finest = &self.words[ASSET_LAYERS..ASSET_LAYERS + self.words[2] as usize];
        finest
            .iter()
            .any(|at| fields.iter().all(|field| self.words[*at as usize + field] as usize == self.field(*field)))
    }

    /// Checks a direction set and returns its number of directions.
    fn sphere(&self, field: usize) -> Result<usize, Rule> {
        let sphere = Sphere::from_words(self.sphere_words(field)?.to_vec())?;
        let [triangles, side] = [1, 3].map(|word| sphere.words()[word] as usize);
        if side != cells_a_side(triangles) {
            return Err(rule::GRID_CELLS);
        }
        Ok(sphere.len())
    }

    /// Returns the words of the direction set whose offset stands in `field`.
    fn sphere_words(&self, field: usize) -> Result<&'a [u32], Rule> {
        let first = self.field(field);
        let length = part(self.words, first, 5).and_then(Sphere::words_told_by).ok_or(rule::SET_BEYOND)?;
        self.part(field, length)
    }

    /// Checks the dictionaries of the table at word `table`, and returns the number of lobes of each.
    fn dictionaries(&self, table: usize, clusters: usize) -> Result<Vec<usize>, Rule> {
        let offsets = part(self.words, table, clusters + 1).ok_or(rule::TABLE_BEYOND)?;
        let mut counts = Vec::with_capacity(clusters);
        for ends in offsets.windows(2) {
            let [first, end] = [ends[0] as usize, ends[1] as usize];
            let lobes = (first <= end).then(|| part(self.words, first, end - first)).flatten();
            let Some(lobes) = lobes.filter(|lobes| lobes.len().is_multiple_of(RESIDENT_WORDS)) else {
                return Err(rule::DICTIONARY_PLACE);
            };
            if lobes.len() / RESIDENT_WORDS > MAX_DICTIONARY || !lobes.chunks_exact(RESIDENT_WORDS).all(lobe_is_fine) {
                return Err(rule::DICTIONARY_CONTENT);
            }
            counts.push(lobes.len() / RESIDENT_WORDS);
        }
        Ok(counts)
    }

    /// Checks the edits: each must have as many lobes as were measured, which are `lobes` of each cluster.
    fn edits(&self, lobes: &[usize]) -> Checked {
        let (list, count) = (self.field(block::EDITS), self.field(block::EDIT_COUNT));
        if (list == 0) != (count == 0) || count > crate::asset::edit::MAX_EDITS {
            return Err(rule::EDITS_COUNTED);
        }
        if count == 0 {
            return Ok(());
        }
        for edit in part(self.words, list, EDIT_WORDS * count).ok_or(rule::EDITS_BEYOND)?.chunks(EDIT_WORDS) {
            let tints = edit[..3].iter().all(|tint| (0.0..=16.0).contains(&float(*tint)));
            if !tints || !(0.0..=1.0).contains(&float(edit[3])) {
                return Err(rule::EDIT_RANGE);
            }
            if self.dictionaries(edit[4] as usize, lobes.len())? != lobes {
                return Err(rule::EDITED_DICTIONARY);
            }
        }
        Ok(())
    }

    /// Checks the records: they must name clusters, edits, references and lobes that exist.
    fn texels(&self, texels: usize, lobes: &[usize]) -> Checked {
        let records = self.part(block::RECORDS, 2 * texels)?;
        let refs = self.part(block::REFS, self.field(block::REF_COUNT))?;
        let edits = self.field(block::EDIT_COUNT) as u32;
        let code_words = self.packed_code_words();
        for record in records.chunks_exact(2) {
            let (cluster, edit, count) = (record[0] & 0xff, record[0] >> 8 & 0xff, record[0] >> 16);
            // Packed codes lie before the references.
            let codes = code_words.get(cluster as usize).copied().unwrap_or(0);
            let own = part(refs, record[1] as usize, count as usize).filter(|_| codes <= record[1] as usize);
            let (Some(lobes), Some(own)) = (lobes.get(cluster as usize), own.filter(|_| count < 256 && edit <= edits))
            else {
                return Err(rule::RECORD);
            };
            if own.iter().any(|reference| (reference & 0xff) as usize >= *lobes) {
                return Err(rule::NO_LOBE);
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
            [block::HEIGHT_STEP, block::MIN_HEIGHT, block::MAX_HEIGHT].map(|field| self.float(field));
        let reach = 128.0 * MAX_HEIGHT_STEP;
        let fine = step > 0.0 && step <= MAX_HEIGHT_STEP && least >= -reach && most <= reach && least <= most;
        if fine { Ok(()) } else { Err(rule::HEIGHT_RANGE) }
    }

    fn relief(&self, texels: usize) -> Checked {
        let fields = block::RELIEF_NUMBERS;
        let numbers = fields.map(|field| self.float(field));
        if self.field(block::RELIEF) == 0 {
            return if fields.iter().all(|field| self.field(*field) == 0) { Ok(()) } else { Err(rule::RELIEF_RANGE) };
        }
        self.part(block::RELIEF, RELIEF_WORDS * texels)?;
        let fits = self.field(block::HEIGHTS) > 0
            && self.field(block::BASES) > 0
            && self.field(block::RESIDUAL_KIND) == ResidualKind::Root as usize
            && self.field(block::LOBE_ROLE) == LobeRole::Base as usize
            && Relief::from_numbers(numbers).is_some();
        if fits { Ok(()) } else { Err(rule::RELIEF_RANGE) }
    }
}

/// Returns whether the numbers of a lobe of the resident form are within its family's ranges.
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

/// Returns whether both halves of all words are finite.
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
