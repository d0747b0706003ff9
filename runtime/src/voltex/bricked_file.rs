//! A file of which bricks are read as they are needed. Normative text: docs/reference/voltex.md, chapter "Brick".

use super::bricks::{BRICK_LEVEL, BrickCount, MAX_WHOLE_LEVEL, brick_index, bricks_of, within_brick};
use super::error::VoltexError;
use super::file::header::LEVELS;
use super::file::{
    LevelNumbers, VoltexFormat, VoltexHead, VoltexSection, level_of, read_brick, read_counts, read_materials,
    read_numbers, read_whole,
};
use super::level_stream::{CodedVoxels, PlacedVoxel};
use super::node::NODE_WORDS;
use super::volume::{MicroflakeMaterial, Volume};
use super::voxel::VOXEL_WORDS;
use super::words::{HEADER_WORDS as FIRST_WORDS, LEVEL_WORDS, MATERIAL_WORDS};
use crate::container::directory::{SectionEntry, entries_of, read_directory_of, tier_lengths_of};
use crate::container::fault::Faults;
use crate::container::file_format::{HEADER_WORDS, SECTION_ENTRY_WORDS, checksum, header, word};
use crate::container::sections::{Reader, Sections};
use crate::error::FormatError;
use crate::threads::{Threads, map};
use std::fmt::{self, Display, Formatter};
use std::ops::Range;

/// A way to read a part of a file: the bytes of a range, fewer where the file ends before.
pub type ReadRange<'a> = &'a (dyn Fn(Range<u64>) -> std::io::Result<Vec<u8>> + Sync);

/// Error of reading a part of a volumetric texture.
#[derive(Debug)]
pub enum BrickError {
    /// The file cannot be read.
    Read(std::io::Error),
    /// The file breaks a rule of its format.
    File(VoltexError),
}

impl From<std::io::Error> for BrickError {
    fn from(error: std::io::Error) -> BrickError {
        BrickError::Read(error)
    }
}

impl From<FormatError> for BrickError {
    fn from(error: FormatError) -> BrickError {
        BrickError::File(error.into())
    }
}

impl std::error::Error for BrickError {}

impl Display for BrickError {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            BrickError::Read(error) => Display::fmt(error, f),
            BrickError::File(error) => Display::fmt(error, f),
        }
    }
}

/// A volumetric texture whose coarse levels, to 128 voxels a side, are at hand and whose bricks are read from its file.
#[derive(Debug, Clone)]
pub struct BrickedFile {
    head: VoltexHead,
    description: String,
    materials: Vec<MicroflakeMaterial>,
    /// Levels that are stored whole, the coarsest first.
    whole: Vec<(LevelNumbers, CodedVoxels)>,
    /// Levels that are stored by brick, the coarsest first.
    fine: Vec<FineLevel>,
    /// Morton numbers of the bricks, ascending.
    bricks: Vec<u64>,
}

/// A level that is stored by brick.
#[derive(Debug, Clone)]
struct FineLevel {
    numbers: LevelNumbers,
    counts: Vec<BrickCount>,
    /// Sections of the bricks.
    sections: Vec<SectionEntry>,
}

impl BrickedFile {
    /// Length of the beginning of a file that tells whether it is stored by brick.
    pub const HEAD_BYTES: u64 = 4 * HEADER_WORDS as u64;

    /// Tells by the beginning of a file, of [`BrickedFile::HEAD_BYTES`] or less, whether it is a volume with levels that
    /// are stored by brick. Nothing is checked.
    pub fn is_one(beginning: &[u8]) -> bool {
        let is_long = beginning.len() as u64 >= BrickedFile::HEAD_BYTES;
        Volume::is_one(beginning) && is_long && word(beginning, LEVELS) > MAX_WHOLE_LEVEL + 1
    }

    /// Reads what has to be at hand of a file of `length` bytes, or of a tier of one: header, tables, materials, the
    /// levels that are stored whole, and of finer ones how many voxels their bricks have.
    ///
    /// # Errors
    /// [`BrickError::Read`] where `read` fails, [`BrickError::File`] for a file that [`Volume::parse`] refuses for what
    /// is read here.
    pub fn open(read: ReadRange, length: u64, threads: Threads) -> Result<BrickedFile, BrickError> {
        let beginning = read_beginning(read, length)?;
        let directory = read_directory_of::<VoltexFormat>(&beginning, threads)?;
        if !directory.tiers.iter().any(|tier| u64::from(*tier) == length) {
            let expected = directory.tiers.last().copied().unwrap_or(0).into();
            return Err(FormatError::Length { expected, got: length }.into());
        }
        let head = directory.head;
        let mut faults = Faults::default();
        let sections = Sections::<VoltexFormat>::new(&beginning, &directory, &mut faults);
        let mut section = |kind, index| -> Result<Reader, FormatError> {
            let reader = sections.get(kind, 0, index, &mut faults);
            std::mem::take(&mut faults).or_first(reader)
        };
        let description = section(VoltexSection::Description, 0)?.text()?;
        let materials = read_materials(section(VoltexSection::Materials, 0)?, head.materials as usize)?;
        let mut whole: Vec<(LevelNumbers, CodedVoxels)> = Vec::new();
        let entry = |kind: VoltexSection, index: u32| {
            let is_it = |entry: &&SectionEntry| (entry.kind, entry.index) == (kind as u32, index);
            let missing = || FormatError::MissingSection { section: format!("{kind:?} {index}") };
            directory.sections.iter().find(is_it).copied().ok_or_else(missing)
        };
        let is_at_hand = |entry: &SectionEntry| u64::from(entry.offset) + u64::from(entry.length) <= length;
        for index in 0..head.levels.min(MAX_WHOLE_LEVEL + 1) {
            // Every tier has the coarsest.
            if index > 0 && !is_at_hand(&entry(VoltexSection::Level, index)?) {
                break;
            }
            let (numbers, reader) = read_numbers(section(VoltexSection::Level, index)?)?;
            let coarser = whole.last().map_or(&[][..], |(_, coarser)| &coarser.voxels);
            let coded = read_whole(reader, coarser, head.materials)?;
            whole.push((numbers, coded));
        }
        let bricks = whole.get(BRICK_LEVEL as usize).map_or(Vec::new(), |(_, level)| bricks_of(&level.voxels));
        let mut file = BrickedFile { head, description, materials, whole, fine: Vec::new(), bricks };
        for level in MAX_WHOLE_LEVEL + 1..head.levels {
            let own = entry(VoltexSection::Level, level)?;
            let sections = file.bricks.iter().map(|brick| entry(VoltexSection::Brick, brick_index(level, *brick)));
            let sections = sections.collect::<Result<Vec<_>, _>>()?;
            // A tier has the levels that are at hand with all their bricks.
            if !is_at_hand(&own) || !sections.iter().all(is_at_hand) {
                break;
            }
            let bytes = read_section(read, &own)?;
            let (numbers, reader) = read_numbers(Reader { name: name_of(&own), bytes: &bytes })?;
            let counts = read_counts(reader, file.bricks.len())?;
            file.fine.push(FineLevel { numbers, counts, sections });
        }
        Ok(file)
    }

    /// Returns the number of the finest level, counted from the coarsest: it has two to the power of it voxels a side.
    pub fn finest_level(&self) -> u32 {
        (self.whole.len() + self.fine.len()) as u32 - 1
    }

    /// Returns the coordinates of the bricks among eight a side; none where there are no finer levels than theirs.
    pub fn bricks(&self) -> impl ExactSizeIterator<Item = [u32; 3]> {
        let level = self.whole.get(BRICK_LEVEL as usize);
        level.map_or(&[][..], |(_, level)| &level.voxels).iter().map(|(at, _)| *at)
    }

    /// Returns the level to which a brick is loaded where that is asked for and the volume's finest level is `finest`:
    /// the tree of voxels takes two levels at once, so it may be the next finer one.
    pub fn loaded_level(finest: u32, asked: u32) -> u32 {
        let asked = asked.clamp(BRICK_LEVEL, finest.max(BRICK_LEVEL));
        (asked + (finest.max(asked) - asked) % 2).min(finest)
    }

    /// Returns the bytes of the resident form of a volume as [`BrickedFile::load`] loads it.
    pub fn resident_bytes(&self, finest: u32, levels: &[u32]) -> u64 {
        let finest = finest.min(self.finest_level());
        let fixed =
            FIRST_WORDS + MATERIAL_WORDS * self.materials.len() + LEVEL_WORDS * (finest as usize + 1) + NODE_WORDS;
        // Where the root covers a coarser level than there is.
        let coarser = if finest.is_multiple_of(2) { VOXEL_WORDS } else { 0 };
        let mut words = (fixed + coarser) as u64;
        for level in 0..=finest {
            let counts = self.loaded_counts(finest, levels, level);
            words += VOXEL_WORDS as u64 * (u64::from(counts.voxels) + u64::from(counts.others));
            // A node for each cell of an even level, counted from the finest, and the root.
            if level < finest && (finest - level).is_multiple_of(2) {
                words += NODE_WORDS as u64 * u64::from(counts.voxels);
            }
        }
        4 * words
    }

    /// Counts the voxels of a level that are loaded.
    fn loaded_counts(&self, finest: u32, levels: &[u32], level: u32) -> BrickCount {
        let mut sum = BrickCount::default();
        if level <= BRICK_LEVEL {
            let coded = &self.whole[level as usize].1;
            return BrickCount { voxels: coded.voxels.len() as u32, others: coded.others.len() as u32 };
        }
        for (i, brick) in self.bricks.iter().enumerate() {
            if BrickedFile::loaded_level(finest, levels[i]) >= level {
                let own = match level.checked_sub(MAX_WHOLE_LEVEL + 1) {
                    Some(fine) => self.fine[fine as usize].counts[i],
                    None => count_within(&self.whole[level as usize].1, level, *brick),
                };
                sum = BrickCount { voxels: sum.voxels + own.voxels, others: sum.others + own.others };
            }
        }
        sum
    }

    /// Reads the volume down to the level `finest`, each brick to its own of `levels`, in the order of
    /// [`BrickedFile::bricks`], or as near to it as [`BrickedFile::loaded_level`] says. What is not loaded is met at
    /// the finest level that is.
    ///
    /// # Errors
    /// Those of [`BrickedFile::open`], for the bricks that are read.
    ///
    /// # Panics
    /// If `levels` has not a level for each brick.
    pub fn load(&self, read: ReadRange, finest: u32, levels: &[u32], threads: Threads) -> Result<Volume, BrickError> {
        let finest = finest.min(self.finest_level());
        let levels: Vec<u32> = levels.iter().map(|level| BrickedFile::loaded_level(finest, *level)).collect();
        let mut volume = Volume {
            description: self.description.clone(),
            side_m: self.head.side_m,
            extent: self.head.extent,
            cyclic: self.head.cyclic,
            materials: self.materials.clone(),
            levels: Vec::new(),
        };
        for (level, (numbers, coded)) in (0..=finest).zip(&self.whole) {
            let mut kept = CodedVoxels::default();
            for (i, brick) in self.bricks.iter().enumerate().filter(|_| level > BRICK_LEVEL) {
                if levels[i] >= level {
                    kept.append(part_of(coded, level, *brick));
                }
            }
            let coded = if level > BRICK_LEVEL { &kept } else { coded };
            volume.levels.push(level_of(numbers, coded, threads));
        }
        if finest > MAX_WHOLE_LEVEL {
            let bricks = map(threads, self.bricks.len(), |i| self.read_brick(read, i, levels[i]));
            let mut fine = vec![CodedVoxels::default(); (finest - MAX_WHOLE_LEVEL) as usize];
            for brick in bricks {
                fine.iter_mut().zip(brick?).for_each(|(level, own)| level.append(own));
            }
            for (coded, level) in fine.iter().zip(&self.fine) {
                volume.levels.push(level_of(&level.numbers, coded, threads));
            }
        }
        volume.levels.reverse();
        Ok(volume)
    }

    /// Reads the levels of brick `i` that are stored by brick, down to `level`.
    fn read_brick(&self, read: ReadRange, i: usize, level: u32) -> Result<Vec<CodedVoxels>, BrickError> {
        let mut levels: Vec<CodedVoxels> = Vec::new();
        let whole = &self.whole[MAX_WHOLE_LEVEL as usize].1.voxels;
        let first = &whole[within_brick(whole, MAX_WHOLE_LEVEL, self.bricks[i])];
        for (fine, _) in self.fine.iter().zip(MAX_WHOLE_LEVEL..level) {
            let entry = &fine.sections[i];
            let bytes = read_section(read, entry)?;
            let parents: &[PlacedVoxel] = levels.last().map_or(first, |coarser| &coarser.voxels);
            let reader = Reader { name: name_of(entry), bytes: &bytes };
            levels.push(read_brick(&reader, fine.counts[i], parents, self.head.materials)?);
        }
        Ok(levels)
    }
}

/// Returns the part of a level that lies in a brick, its second sorts numbered from 0.
fn part_of(coded: &CodedVoxels, level: u32, brick: u64) -> CodedVoxels {
    let own = within_brick(&coded.voxels, level, brick);
    let others = &coded.others[others_within(coded, &own)];
    CodedVoxels {
        voxels: coded.voxels[own.clone()].to_vec(),
        others: others.iter().map(|(number, voxel)| (number - own.start as u32, *voxel)).collect(),
    }
}

/// Returns where a level has the second sorts of a range of voxels.
fn others_within(coded: &CodedVoxels, own: &Range<usize>) -> Range<usize> {
    let first = |end: usize| coded.others.partition_point(|(number, _)| (*number as usize) < end);
    first(own.start)..first(own.end)
}

/// Counts the voxels of a level within a brick.
fn count_within(coded: &CodedVoxels, level: u32, brick: u64) -> BrickCount {
    let own = within_brick(&coded.voxels, level, brick);
    BrickCount { voxels: own.len() as u32, others: others_within(coded, &own).len() as u32 }
}

fn name_of(entry: &SectionEntry) -> String {
    entry.name_in::<VoltexFormat>()
}

/// Reads a section, whose checksum must be right.
fn read_section(read: ReadRange, entry: &SectionEntry) -> Result<Vec<u8>, BrickError> {
    let start = u64::from(entry.offset);
    let bytes = read(start..start + u64::from(entry.length))?;
    if checksum(&bytes) == entry.checksum {
        return Ok(bytes);
    }
    Err(FormatError::SectionChecksum { section: name_of(entry) }.into())
}

/// Reads the first tier with all levels that are stored whole, or all of a file of `length` bytes where it has less.
fn read_beginning(read: ReadRange, length: u64) -> Result<Vec<u8>, BrickError> {
    let head = read(0..BrickedFile::HEAD_BYTES)?;
    if (head.len() as u64) < BrickedFile::HEAD_BYTES {
        return Ok(head);
    }
    let [sections, tiers] = [header::SECTIONS, header::TIERS].map(|at| word(&head, at) as usize);
    // More are refused, and not read.
    let [sections, tiers] = [sections, tiers].map(|count| count.min(crate::container::file_format::MAX_SECTIONS));
    let tables = read(0..4 * (HEADER_WORDS + sections * SECTION_ENTRY_WORDS + tiers) as u64)?;
    let lengths = tier_lengths_of::<VoltexFormat>(&tables)?;
    let last = entries_of(&tables, sections)
        .filter(|entry| entry.kind == VoltexSection::Level as u32 && entry.index <= MAX_WHOLE_LEVEL);
    let end = last.map(|entry| u64::from(entry.offset) + u64::from(entry.length)).max().unwrap_or(0);
    let tier = lengths.iter().map(|tier| u64::from(*tier)).find(|tier| *tier >= end);
    Ok(read(0..tier.unwrap_or(length).min(length))?)
}
