//! The file of a volume, `.voltex`: the container of [`crate::container`] with a description, the materials and the
//! levels, the coarsest first, each of which ends a tier; levels of more than 128 voxels a side are stored by brick.
//! Normative text: docs/reference/voltex.md.

use super::bricks::{BRICK_LEVEL, BrickCount, MAX_WHOLE_LEVEL, brick_index, bricks_of, within_brick};
use super::codes::VoxelCodes;
use super::coding::CodedVoxel;
use super::corrections::facets::{Facets, MAX_FACETS};
use super::corrections::light_correction::{LightCorrection, MAX_LIGHT_COEFFICIENT};
use super::error::{VOLTEX_NAMES, VoltexError};
use super::level_stream::{CodedVoxels, PlacedVoxel, code_stream, read_stream};
use super::matrix::Sym3;
use super::rule;
use super::volume::{
    LevelShadow, MAX_CLUMPING, MAX_LEVELS, MIN_SHARED, MicroflakeMaterial, Volume, VolumeLevel, order,
};
use super::voxel::Voxel;
use super::words::{CLUMPING_AT, FACETS_AT, LEVEL_WORDS, LIGHT_CORRECTION_AT};
use crate::container::directory::{Directory, read_directory_of};
use crate::container::fault::Faults;
use crate::container::file_format::{ALIGNMENT, FileFormat, HeaderReader};
use crate::container::sections::{Reader, Sections};
use crate::container::writer::{SectionSource, write_file_of};
use crate::error::{FormatError, Names};
use crate::rule::Rule;
use crate::threads::{Threads, fill, map, serial};
use half::f16;

/// Format version that this package writes and reads.
pub const VOLTEX_VERSION: u32 = 1;
/// Largest number of materials of a volume: their numbers are 16 bits.
pub const MAX_MATERIALS: usize = 1 << 16;
/// Largest side of a volume, metres.
pub const MAX_SIDE_M: f32 = 1e9;
/// Largest offset of a shadow, voxels.
const MAX_OFFSET: f32 = 1024.0;
/// Number of voxels that one piece of work decodes.
const VOXELS_AT_A_TIME: usize = 4096;

/// Positions of the header words of volumetric textures.
pub(super) mod header {
    /// Number of levels.
    pub const LEVELS: usize = 6;
    /// Number of materials.
    pub const MATERIALS: usize = 7;
    /// Flags: bit 0 cyclic in x, bit 1 in y.
    pub const FLAGS: usize = 8;
    /// Extent: three numbers (f32), the used part of the unit cube.
    pub const EXTENT: usize = 9;
    /// Side of the unit cube in metres (f32).
    pub const SIDE_M: usize = 15;
    /// Reserved words, which are 0.
    pub const RESERVED: [usize; 5] = [14, 16, 17, 18, 19];
}

/// The kinds of sections of a volumetric texture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u32)]
pub enum VoltexSection {
    /// UTF-8 JSON: name, source, how it was built.
    Description = 1,
    /// Materials of the microflakes.
    Materials = 2,
    /// The numbers of a level, and its voxels where it is stored whole; index 0 the coarsest, which is one voxel.
    Level = 3,
    /// The voxels of a level within a brick; index 512 times that of the level, and the brick's Morton number.
    Brick = 4,
}

impl VoltexSection {
    /// Returns the kind with a number; `None` if this version does not know it.
    pub fn from_number(number: u32) -> Option<VoltexSection> {
        use VoltexSection::*;
        [Description, Materials, Level, Brick].into_iter().find(|kind| *kind as u32 == number)
    }
}

/// The header of a volumetric texture: everything it says about the whole file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VoltexHead {
    /// Number of levels, 1 to 13; with n levels the finest has 2^(n - 1) voxels a side.
    pub levels: u32,
    /// Number of materials.
    pub materials: u32,
    /// Axes along which the volume repeats, as [`Volume::cyclic`].
    pub cyclic: [bool; 2],
    /// Used part of the unit cube, as [`Volume::extent`].
    pub extent: [f32; 3],
    /// Side of the unit cube in metres, as [`Volume::side_m`].
    pub side_m: f32,
}

/// The file format of volumetric textures, for [`FileFormat`].
pub(crate) enum VoltexFormat {}

impl FileFormat for VoltexFormat {
    type Head = VoltexHead;
    type Kind = VoltexSection;
    const NAMES: Names = VOLTEX_NAMES;
    const VERSION: u32 = VOLTEX_VERSION;

    fn read_head(header: &mut HeaderReader) -> Option<VoltexHead> {
        let levels = header.within("level_count", header::LEVELS, [1, MAX_LEVELS + 1], "1 to 13");
        let materials = header.within("material_count", header::MATERIALS, [1, MAX_MATERIALS as u32], "1 to 65536");
        let flags = header.within("flags", header::FLAGS, [0, 3], "0 to 3 in version 1");
        for at in header::RESERVED {
            header.within("reserved", at, [0, 0], "0");
        }
        let extent = [0, 1, 2].map(|axis| f32::from_bits(header.word(header::EXTENT + axis)));
        for axis in (0..3).filter(|axis| !extent_in_range(extent[*axis])) {
            header.refuse("extent", header::EXTENT + axis, "above 0 and at most 1");
        }
        let side_m = f32::from_bits(header.word(header::SIDE_M));
        if !side_in_range(side_m) {
            header.refuse("side_m", header::SIDE_M, "above 0 m and at most 1000000000 m");
        }
        Some(VoltexHead { levels, materials, cyclic: [flags & 1 == 1, flags & 2 == 2], extent, side_m })
    }

    fn write_head(head: &VoltexHead, words: &mut [u32]) {
        words[header::LEVELS] = head.levels;
        words[header::MATERIALS] = head.materials;
        words[header::FLAGS] = u32::from(head.cyclic[0]) | u32::from(head.cyclic[1]) << 1;
        words[header::EXTENT..header::EXTENT + 3].copy_from_slice(&head.extent.map(f32::to_bits));
        words[header::SIDE_M] = head.side_m.to_bits();
    }

    fn alignment(_: &VoltexHead) -> usize {
        ALIGNMENT
    }

    fn layers(_: &VoltexHead) -> u32 {
        1
    }

    fn kind(number: u32) -> Option<VoltexSection> {
        VoltexSection::from_number(number)
    }

    fn number(kind: VoltexSection) -> u32 {
        kind as u32
    }

    fn section_name(kind: VoltexSection, _: u32, index: u32) -> String {
        format!("{kind:?} {index}")
    }

    fn rule(shared: Rule) -> Rule {
        rule::of_voltex(shared)
    }
}

fn extent_in_range(extent: f32) -> bool {
    extent > 0.0 && extent <= 1.0
}

fn side_in_range(side_m: f32) -> bool {
    side_m > 0.0 && side_m <= MAX_SIDE_M
}

impl MicroflakeMaterial {
    fn halves(&self) -> [f16; 8] {
        let ([a, b, c], [d, e, f]) = (self.reflectance, self.transmittance);
        [a, b, c, d, e, f, self.specular, self.roughness].map(f16::from_f32)
    }

    fn from_halves(halves: &[f16]) -> MicroflakeMaterial {
        let number = |i: usize| halves[i].to_f32();
        MicroflakeMaterial {
            reflectance: [number(0), number(1), number(2)],
            transmittance: [number(3), number(4), number(5)],
            specular: number(6),
            roughness: number(7),
        }
    }
}

fn material_in_range(halves: &[f16]) -> bool {
    halves.iter().all(|x| (f16::ZERO..=f16::ONE).contains(x))
}

impl LevelShadow {
    fn in_range(&self) -> bool {
        (0.0..=MAX_OFFSET).contains(&self.offset) && self.shared.iter().all(|share| (MIN_SHARED..=1.0).contains(share))
    }
}

fn clumping_in_range(clumping: &Sym3) -> bool {
    clumping.0.iter().all(|x| (-MAX_CLUMPING..=MAX_CLUMPING).contains(x))
}

fn facets_in_range(facets: &Facets) -> bool {
    facets.0.iter().all(|x| (-MAX_FACETS..=MAX_FACETS).contains(x))
}

fn light_correction_in_range(correction: &LightCorrection) -> bool {
    correction.0.iter().all(|x| (-MAX_LIGHT_COEFFICIENT..=MAX_LIGHT_COEFFICIENT).contains(x))
}

/// Reads the directory of a `.voltex` file. Checks header, tables, section bounds, padding and the checksum of every
/// section that `bytes` holds whole, as [`crate::read_directory`] does for an asset.
pub fn read_voltex_directory(bytes: &[u8]) -> Result<Directory<VoltexHead>, VoltexError> {
    Ok(read_directory_of::<VoltexFormat>(bytes, &serial)?)
}

impl Volume {
    /// Returns whether these bytes begin like a volumetric texture's.
    pub fn is_one(bytes: &[u8]) -> bool {
        bytes.starts_with(&VOLTEX_NAMES.magic)
    }

    /// Packs the volume into bytes, which are written to a `.voltex` file. Voxels are rounded to [`VoxelCodes`].
    ///
    /// Errors name the rule of docs/reference/voltex.md that the volume breaks.
    pub fn pack(&self) -> Result<Vec<u8>, VoltexError> {
        self.check().map_err(|reason| FormatError::Pack { reason: reason.into() })?;
        let section = |kind, index: usize, bytes, ends_tier| SectionSource {
            kind,
            layer: 0,
            index: index as u32,
            bytes,
            ends_tier,
        };
        let materials = self.materials.iter().flat_map(MicroflakeMaterial::halves);
        let mut sections = vec![
            section(VoltexSection::Description, 0, self.description.clone().into_bytes(), false),
            section(VoltexSection::Materials, 0, materials.flat_map(f16::to_le_bytes).collect(), false),
        ];
        let mut coarser: Vec<PlacedVoxel> = Vec::new();
        let mut bricks: Vec<u64> = Vec::new();
        for (index, level) in (0u32..).zip(self.levels.iter().rev()) {
            let coded = coded(level)?;
            let numbers = std::iter::once(level.shadow.offset).chain(level.shadow.shared);
            let numbers = numbers.chain(level.clumping.0).chain(level.facets.0).chain(level.light_correction.0);
            let mut bytes: Vec<u8> = numbers.flat_map(f32::to_le_bytes).collect();
            if index <= MAX_WHOLE_LEVEL {
                bytes.extend(code_stream(&coarser, &coded.voxels, &coded.others, 0));
                sections.push(section(VoltexSection::Level, index as usize, bytes, true));
            } else {
                let streams = brick_streams(&bricks, index, &coarser, &coded);
                let counts = streams.iter().flat_map(|(_, count, _)| [count.voxels, count.others]);
                bytes.extend(counts.flat_map(u32::to_le_bytes));
                sections.push(section(VoltexSection::Level, index as usize, bytes, false));
                let last = bricks.last().copied();
                sections.extend(streams.into_iter().map(|(brick, _, stream)| {
                    let index = brick_index(index, brick) as usize;
                    section(VoltexSection::Brick, index, stream, Some(brick) == last)
                }));
            }
            if index == BRICK_LEVEL {
                bricks = bricks_of(&coded.voxels);
            }
            coarser = coded.voxels;
        }
        let head = VoltexHead {
            levels: self.levels.len() as u32,
            materials: self.materials.len() as u32,
            cyclic: self.cyclic,
            extent: self.extent,
            side_m: self.side_m,
        };
        Ok(write_file_of::<VoltexFormat>(&head, &sections)?)
    }

    /// Reads a file, or a tier of one: the volume down to the finest level that is at hand. Runs on the calling thread.
    ///
    /// Never panics. Allocates for voxels what `bytes` can hold.
    pub fn parse(bytes: &[u8]) -> Result<Volume, VoltexError> {
        Volume::parse_on(bytes, &serial)
    }

    /// Reads a file like [`Volume::parse`], on `threads`.
    pub fn parse_on(bytes: &[u8], threads: Threads) -> Result<Volume, VoltexError> {
        let directory = read_directory_of::<VoltexFormat>(bytes, threads)?;
        let mut faults = Faults::default();
        let volume = examine_volume(bytes, &directory, threads, &mut faults);
        Ok(faults.or_first(volume)?)
    }

    /// Checks the volume; the error is the rule that does not hold.
    fn check(&self) -> Result<(), &'static str> {
        let must = |holds: bool, reason| if holds { Ok(()) } else { Err(reason) };
        must(self.extent.iter().all(|x| extent_in_range(*x)), "its extent must be above 0 and at most 1")?;
        must(side_in_range(self.side_m), "its side must be above 0 m and at most 1000000000 m")?;
        must((1..=MAX_MATERIALS).contains(&self.materials.len()), "it needs 1 to 65536 materials")?;
        must(
            self.materials.iter().all(|material| material_in_range(&material.halves())),
            "a material's shares and roughness must be within 0 to 1",
        )?;
        must((1..=MAX_LEVELS as usize + 1).contains(&self.levels.len()), "it needs 1 to 13 levels")?;
        let last = &self.levels[self.levels.len() - 1];
        must(last.voxels.len() == 1 && last.voxels[0].0 == [0; 3], "its coarsest level must be one voxel")?;
        for (number, level) in self.levels.iter().enumerate() {
            must(level.shadow.in_range(), "a level's shadow is out of its range")?;
            must(clumping_in_range(&level.clumping), "a level's clumping is out of its range")?;
            must(facets_in_range(&level.facets), "a level's facets are out of their range")?;
            must(
                light_correction_in_range(&level.light_correction),
                "a level's correction of light is out of its range",
            )?;
            let rising = level.voxels.windows(2).all(|pair| order(pair[0].0) < order(pair[1].0));
            let side = 1 << (self.levels.len() - 1 - number);
            let inside = level.voxels.iter().all(|(at, _)| at.iter().all(|x| *x < side));
            must(rising && inside, "a level's voxels are not in order, or outside it")?;
            if let Some(coarser) = self.levels.get(number + 1) {
                let mut parents: Vec<u64> = level.voxels.iter().map(|(at, _)| order(*at) >> 3).collect();
                parents.dedup();
                let own = coarser.voxels.iter().map(|(at, _)| order(*at));
                must(own.eq(parents), "a voxel has no parent or no child")?;
            }
            let voxel_in_range = |voxel: &Voxel| {
                let s = &voxel.extinction.0;
                s.iter().all(|x| x.is_finite()) && s[..3].iter().all(|x| *x >= 0.0)
            };
            let rising = level.others.windows(2).all(|pair| pair[0].0 < pair[1].0);
            let beside = level.others.last().is_none_or(|(last, _)| (*last as usize) < level.voxels.len());
            must(rising && beside, "a level's second sorts are not in order, or in no voxel's cell")?;
            must(
                level.microflakes().all(voxel_in_range),
                "a voxel's extinction is not finite or negative along an axis",
            )?;
            must(
                level.microflakes().all(|voxel| (voxel.material as usize) < self.materials.len()),
                "a voxel names a material that is not there",
            )?;
        }
        Ok(())
    }
}

/// Returns the codes of a level's voxels.
fn coded(level: &VolumeLevel) -> Result<CodedVoxels, FormatError> {
    let code = |voxel: &Voxel| {
        let codes = VoxelCodes::of(&voxel.extinction);
        let codes = codes.ok_or(FormatError::Pack { reason: "a voxel is too dense".into() })?;
        Ok::<_, FormatError>(CodedVoxel { codes, material: voxel.material })
    };
    let voxels = level.voxels.iter().map(|(at, voxel)| Ok((*at, code(voxel)?)));
    let others = level.others.iter().map(|(number, voxel)| Ok((*number, code(voxel)?)));
    let (voxels, others): (Result<_, FormatError>, Result<_, FormatError>) = (voxels.collect(), others.collect());
    Ok(CodedVoxels { voxels: voxels?, others: others? })
}

/// Returns the stream of each brick of a level that is stored by brick, with the numbers of its voxels.
fn brick_streams(
    bricks: &[u64],
    level: u32,
    coarser: &[PlacedVoxel],
    coded: &CodedVoxels,
) -> Vec<(u64, BrickCount, Vec<u8>)> {
    let mut others = coded.others.as_slice();
    let stream = |brick: &u64| {
        let parents = within_brick(coarser, level - 1, *brick);
        let own = within_brick(&coded.voxels, level, *brick);
        let (mine, rest) = others.split_at(others.partition_point(|(number, _)| (*number as usize) < own.end));
        others = rest;
        let count = BrickCount { voxels: own.len() as u32, others: mine.len() as u32 };
        (*brick, count, code_stream(&coarser[parents], &coded.voxels[own.clone()], mine, own.start as u32))
    };
    bricks.iter().map(stream).collect()
}

/// Reads the volume with this directory, and continues after a fault with every section that does not depend on a
/// faulty one. Returns `None` if there is any fault.
pub(crate) fn examine_volume(
    bytes: &[u8],
    directory: &Directory<VoltexHead>,
    threads: Threads,
    faults: &mut Faults,
) -> Option<Volume> {
    let before = faults.len();
    let head = directory.head;
    let sections = Sections::<VoltexFormat>::new(bytes, directory, faults);
    let description = sections.get(VoltexSection::Description, 0, 0, faults);
    let description = description.and_then(|reader| faults.keep(reader.text()));
    let materials = sections.get(VoltexSection::Materials, 0, 0, faults);
    let materials = materials.and_then(|reader| faults.keep(read_materials(reader, head.materials as usize)));
    let mut levels: Vec<VolumeLevel> = Vec::new();
    let mut coarser: Vec<PlacedVoxel> = Vec::new();
    let mut bricks: Vec<u64> = Vec::new();
    for index in 0..head.levels {
        // Every tier has the coarsest.
        let reader = match index {
            0 => sections.get(VoltexSection::Level, 0, 0, faults),
            _ => sections.get_in_tier(VoltexSection::Level, 0, index, faults),
        };
        let level = reader.and_then(|reader| {
            let (numbers, reader) = faults.keep(read_numbers(reader))?;
            let coded = if index <= MAX_WHOLE_LEVEL {
                faults.keep(read_whole(reader, &coarser, head.materials))?
            } else {
                let readers: Option<Vec<Reader>> = bricks
                    .iter()
                    .map(|brick| sections.get_in_tier(VoltexSection::Brick, 0, brick_index(index, *brick), faults))
                    .collect();
                let readers = readers?;
                let counts = faults.keep(read_counts(reader, bricks.len()))?;
                let parts: Vec<&[PlacedVoxel]> =
                    bricks.iter().map(|brick| &coarser[within_brick(&coarser, index - 1, *brick)]).collect();
                let read = |i: usize| read_brick(&readers[i], counts[i], parts[i], head.materials);
                let read = map(threads, readers.len(), read);
                let mut coded = CodedVoxels::default();
                for brick in read {
                    coded.append(faults.keep(brick)?);
                }
                coded
            };
            Some((numbers, coded))
        });
        let Some((numbers, coded)) = level else { break };
        levels.push(level_of(&numbers, &coded, threads));
        if index == BRICK_LEVEL {
            bricks = bricks_of(&coded.voxels);
        }
        coarser = coded.voxels;
    }
    levels.reverse();
    let volume = Volume {
        description: description?,
        side_m: head.side_m,
        extent: head.extent,
        cyclic: head.cyclic,
        materials: materials?,
        levels,
    };
    (faults.len() == before && directory.damaged.is_empty()).then_some(volume)
}

/// Decodes voxels from their codes, on `threads`.
fn decoded<T: Copy + Default + Send + Sync>(threads: Threads, coded: &[(T, CodedVoxel)]) -> Vec<(T, Voxel)> {
    let mut voxels = vec![(T::default(), Voxel::default()); coded.len()];
    fill(threads, &mut voxels, VOXELS_AT_A_TIME, |chunk, voxels| {
        for (voxel, (at, coded)) in voxels.iter_mut().zip(&coded[chunk * VOXELS_AT_A_TIME..]) {
            *voxel = (*at, coded.codes.voxel(coded.material));
        }
    });
    voxels
}

pub(super) fn read_materials(mut reader: Reader, count: usize) -> Result<Vec<MicroflakeMaterial>, FormatError> {
    let halves = reader.halves(8 * count)?;
    reader.end()?;
    if !material_in_range(&halves) {
        return reader.bad(rule::MATERIAL_RANGE);
    }
    Ok(halves.chunks_exact(8).map(MicroflakeMaterial::from_halves).collect())
}

/// The numbers of a level.
#[derive(Debug, Clone, Copy)]
pub(super) struct LevelNumbers {
    shadow: LevelShadow,
    clumping: Sym3,
    facets: Facets,
    light_correction: LightCorrection,
}

/// Returns a level of voxels that are decoded on `threads`.
pub(super) fn level_of(numbers: &LevelNumbers, coded: &CodedVoxels, threads: Threads) -> VolumeLevel {
    let LevelNumbers { shadow, clumping, facets, light_correction } = *numbers;
    let (voxels, others) = (decoded(threads, &coded.voxels), decoded(threads, &coded.others));
    VolumeLevel { shadow, clumping, facets, light_correction, voxels, others }
}

/// Reads the numbers of a level; what follows them is left to read.
pub(super) fn read_numbers(mut reader: Reader) -> Result<(LevelNumbers, Reader), FormatError> {
    let numbers = reader.words(LEVEL_WORDS)?;
    let number = |i: usize| f32::from_bits(numbers[i]);
    let shadow = LevelShadow { offset: number(0), shared: std::array::from_fn(|i| number(1 + i)) };
    if !shadow.in_range() {
        return reader.bad(rule::SHADOW_RANGE);
    }
    let clumping = Sym3(std::array::from_fn(|i| number(CLUMPING_AT + i)));
    if !clumping_in_range(&clumping) {
        return reader.bad(rule::CLUMPING_RANGE);
    }
    let facets = Facets(std::array::from_fn(|i| number(FACETS_AT + i)));
    if !facets_in_range(&facets) {
        return reader.bad(rule::FACETS_RANGE);
    }
    let light_correction = LightCorrection(std::array::from_fn(|i| number(LIGHT_CORRECTION_AT + i)));
    if !light_correction_in_range(&light_correction) {
        return reader.bad(rule::LIGHT_CORRECTION_RANGE);
    }
    Ok((LevelNumbers { shadow, clumping, facets, light_correction }, reader))
}

/// Reads the voxels of a level that is stored whole, or of a brick.
pub(super) fn read_whole(reader: Reader, coarser: &[PlacedVoxel], materials: u32) -> Result<CodedVoxels, FormatError> {
    read_stream(reader.bytes, coarser, materials).or_else(|rule| reader.bad(rule))
}

/// Reads how many voxels each of so many bricks of a level has.
pub(super) fn read_counts(mut reader: Reader, bricks: usize) -> Result<Vec<BrickCount>, FormatError> {
    let words = reader.words(2 * bricks)?;
    reader.end()?;
    Ok(words.chunks_exact(2).map(|pair| BrickCount { voxels: pair[0], others: pair[1] }).collect())
}

/// Reads a brick, which must have as many voxels as its level says.
pub(super) fn read_brick(
    reader: &Reader,
    count: BrickCount,
    parents: &[PlacedVoxel],
    materials: u32,
) -> Result<CodedVoxels, FormatError> {
    let coded = read_whole(reader.clone(), parents, materials)?;
    let found = BrickCount { voxels: coded.voxels.len() as u32, others: coded.others.len() as u32 };
    if found == count { Ok(coded) } else { reader.bad(rule::BRICK_COUNT) }
}
