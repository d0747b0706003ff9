//! Reads and checks the header and the tables of a file of any format. Normative text: docs/reference/format.md, chapter "File".

use crate::container::fault::Faults;
use crate::container::file_format::{
    FileFormat, HEADER_WORDS, HeaderReader, MAX_SECTIONS, SECTION_ENTRY_WORDS, SECTION_REQUIRED, checksum, header, word,
};
use crate::error::FormatError;
use crate::rule;
use crate::threads::{Threads, map};

/// One row of the section table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SectionEntry {
    /// Number of the section's kind, see [`crate::SectionKind`] and [`crate::voltex::VoltexSection`]; unknown kinds may
    /// stand here.
    pub kind: u32,
    /// Number of the layer that the section belongs to; 0 for a section of the whole asset.
    pub layer: u32,
    /// Number of the section among those of its kind and layer.
    pub index: u32,
    /// Flags. Bit 0: a reader that does not know the kind must refuse the file.
    pub flags: u32,
    /// Offset in bytes from the start of the file, a multiple of [`crate::ALIGNMENT`].
    pub offset: u32,
    /// Length in bytes, without padding.
    pub length: u32,
    /// First eight bytes of the BLAKE3 hash of the section's bytes.
    pub checksum: u64,
}

impl SectionEntry {
    /// Returns the section's name for messages, such as `Basis 3 of layer 0`.
    pub(crate) fn name_in<F: FileFormat>(&self) -> String {
        match F::kind(self.kind) {
            Some(kind) => F::section_name(kind, self.layer, self.index),
            None => format!("kind {}", self.kind),
        }
    }
}

/// The header and the tables of a file, checked.
#[derive(Debug, Clone)]
pub struct Directory<H> {
    /// Contents of the header about the whole file.
    pub head: H,
    /// Section table of the whole file.
    pub sections: Vec<SectionEntry>,
    /// Documented prefix lengths in bytes, ascending; the last is the length of the whole file.
    pub tiers: Vec<u32>,
    /// Index in `tiers` of the length that the bytes at hand have.
    pub tier: usize,
    /// Indices in `sections` of those with a wrong checksum. Empty in a directory that was read without a fault.
    pub(crate) damaged: Vec<usize>,
    /// Checksum of the header and the tables. The tables hold the checksums of all sections, so this number identifies
    /// the file.
    pub checksum: u64,
}

impl<H> Directory<H> {
    /// Returns the sections that begin within the first `bytes` bytes of the file.
    pub(crate) fn at_hand(&self, bytes: usize) -> impl Iterator<Item = &SectionEntry> {
        self.sections.iter().filter(move |entry| (entry.offset as usize) < bytes)
    }

    /// Returns whether the bytes at hand are the whole file.
    pub(crate) fn is_whole(&self) -> bool {
        self.tier + 1 == self.tiers.len()
    }
}

/// Checks header, tables, section bounds, padding, and the checksum of every section at hand. The checksums run on
/// `threads`.
pub(crate) fn read_directory_of<F: FileFormat>(
    bytes: &[u8],
    threads: Threads,
) -> Result<Directory<F::Head>, FormatError> {
    let mut faults = Faults::default();
    let directory = examine_directory_of::<F>(bytes, threads, &mut faults);
    faults.or_first(directory)
}

/// Examines header, tables, section bounds, padding and checksums like [`read_directory_of`], but continues after a
/// fault as far as more can be found, and adds every fault to `faults`. Returns `None` where the places of the sections
/// are not known.
pub(crate) fn examine_directory_of<F: FileFormat>(
    bytes: &[u8],
    threads: Threads,
    faults: &mut Faults,
) -> Option<Directory<F::Head>> {
    let [section_count, tier_count] = faults.keep(read_counts::<F>(bytes))?;
    let before = faults.len();
    let mut reader = HeaderReader { bytes, faults };
    reader.within("length_high", header::LENGTH_HIGH, [0, 0], "0");
    let head = F::read_head(&mut reader);
    let head = head.filter(|_| faults.len() == before)?;
    let (tiers, tier) = read_tiers(bytes, [section_count, tier_count], F::alignment(&head), faults)?;
    let sections: Vec<SectionEntry> = entries_of(bytes, section_count).collect();
    let (bodies, placed) = place_sections::<F>(bytes, &head, &sections, tier_count, faults);
    let intact = map(threads, bodies.len(), |i| checksum(bodies[i].1) == sections[bodies[i].0].checksum);
    let damaged: Vec<usize> = bodies.iter().zip(intact).filter(|(_, intact)| !intact).map(|(body, _)| body.0).collect();
    for number in &damaged {
        faults.push(FormatError::SectionChecksum { section: sections[*number].name_in::<F>() });
    }
    placed.then_some(Directory { head, sections, tiers, tier, checksum: stored_checksum(bytes), damaged })
}

/// Reads the lengths of all tiers in bytes, ascending, from a file's beginning, which need not end with a tier.
pub(crate) fn tier_lengths_of<F: FileFormat>(beginning: &[u8]) -> Result<Vec<u32>, FormatError> {
    let counts = read_counts::<F>(beginning)?;
    Ok(tier_table(beginning, counts))
}

/// Returns the first `count` rows of the section table, from a file's beginning that holds them.
pub(crate) fn entries_of(beginning: &[u8], count: usize) -> impl Iterator<Item = SectionEntry> {
    (0..count).map(|number| read_entry(beginning, number))
}

/// Returns the tier table; `counts` are the numbers of sections and of tiers.
fn tier_table(bytes: &[u8], counts: [usize; 2]) -> Vec<u32> {
    let tier_at = HEADER_WORDS + counts[0] * SECTION_ENTRY_WORDS;
    (0..counts[1]).map(|tier| word(bytes, tier_at + tier)).collect()
}

/// Reads the tier table. Returns the lengths of all tiers, and the index of the one that `bytes` has. `counts` are the
/// numbers of sections and of tiers.
fn read_tiers(bytes: &[u8], counts: [usize; 2], alignment: usize, faults: &mut Faults) -> Option<(Vec<u32>, usize)> {
    let (got, total) = (bytes.len(), word(bytes, header::LENGTH_LOW));
    let tier_at = HEADER_WORDS + counts[0] * SECTION_ENTRY_WORDS;
    let tiers = tier_table(bytes, counts);
    let ascending = tiers.windows(2).all(|pair| pair[0] < pair[1]);
    let aligned = tiers.iter().all(|length| (*length as usize).is_multiple_of(alignment));
    if !ascending || !aligned || tiers.last() != Some(&total) {
        let error = FormatError::Section { section: "tier table".into(), reason: rule::TIERS };
        faults.push_at(error, None, Some(4 * tier_at as u64));
        return None;
    }
    let Some(tier) = tiers.iter().position(|length| *length as usize == got) else {
        faults.push(FormatError::Length { expected: total.into(), got: got as u64 });
        return None;
    };
    Some((tiers, tier))
}

/// Reads row `number` of the section table.
fn read_entry(bytes: &[u8], number: usize) -> SectionEntry {
    let at = |field: usize| word(bytes, HEADER_WORDS + number * SECTION_ENTRY_WORDS + field);
    SectionEntry {
        kind: at(0),
        layer: at(1),
        index: at(2),
        flags: at(3),
        offset: at(4),
        length: at(5),
        checksum: u64::from(at(6)) | u64::from(at(7)) << 32,
    }
}

/// Finds the bytes of each section. Returns index and bytes of the sections at hand, and whether every section is where
/// it must be.
///
/// Sections follow each other in order, and the bytes between them are zero, so that no byte is unaccounted for.
fn place_sections<'a, F: FileFormat>(
    bytes: &'a [u8],
    head: &F::Head,
    sections: &[SectionEntry],
    tier_count: usize,
    faults: &mut Faults,
) -> (Vec<(usize, &'a [u8])>, bool) {
    let (got, total, alignment) = (bytes.len(), word(bytes, header::LENGTH_LOW), F::alignment(head));
    let mut end = (HEADER_WORDS + sections.len() * SECTION_ENTRY_WORDS + tier_count) * 4;
    let mut bodies: Vec<(usize, &[u8])> = Vec::new();
    for (number, entry) in sections.iter().enumerate() {
        let start = end.next_multiple_of(alignment);
        let broken = |reason| FormatError::Section { section: entry.name_in::<F>(), reason };
        if entry.offset as usize != start {
            faults.push(broken(rule::SECTION_START));
            return (bodies, false);
        }
        if F::kind(entry.kind).is_none() && entry.flags & SECTION_REQUIRED != 0 {
            faults.push(FormatError::UnknownRequiredSection { kind: entry.kind });
        }
        if entry.flags & !SECTION_REQUIRED != 0 {
            faults.push(broken(rule::SECTION_FLAGS));
        }
        if entry.layer >= F::layers(head) {
            faults.push(broken(rule::SECTION_LAYER));
        }
        let Some(new_end) = start.checked_add(entry.length as usize).filter(|new_end| *new_end <= total as usize)
        else {
            faults.push(broken(rule::SECTION_BEYOND));
            return (bodies, false);
        };
        if end < got {
            if bytes[end..start.min(got)].iter().any(|byte| *byte != 0) {
                faults.push(broken(rule::PADDING_BEFORE));
            }
            if start < got {
                match bytes.get(start..new_end) {
                    Some(body) => bodies.push((number, body)),
                    None => {
                        faults.push(broken(rule::TIER_INSIDE));
                        return (bodies, false);
                    }
                }
            }
        }
        end = new_end;
    }
    if end.next_multiple_of(alignment) != total as usize {
        faults.push(FormatError::Section { section: "section table".into(), reason: rule::SECTIONS_END });
        return (bodies, false);
    }
    if end < got && bytes[end..].iter().any(|byte| *byte != 0) {
        let error = FormatError::Section { section: "padding at the end".into(), reason: rule::PADDING_AT_END };
        faults.push_at(error, None, Some(end as u64));
    }
    (bodies, true)
}

/// Returns the checksum of header and tables that the header holds.
fn stored_checksum(bytes: &[u8]) -> u64 {
    u64::from(word(bytes, header::CHECKSUM_LOW)) | u64::from(word(bytes, header::CHECKSUM_HIGH)) << 32
}

/// Checks magic number, version, length and checksum of the header, and returns the numbers of sections and of tiers.
fn read_counts<F: FileFormat>(bytes: &[u8]) -> Result<[usize; 2], FormatError> {
    let (got, head) = (bytes.len(), HEADER_WORDS * 4);
    if got >= 4 && bytes[..4] != F::NAMES.magic {
        return Err(FormatError::BadMagic { got: [bytes[0], bytes[1], bytes[2], bytes[3]] });
    }
    if got < head {
        return Err(FormatError::TooShort { expected: head, got });
    }
    let version = word(bytes, header::VERSION);
    if !(1..=F::VERSION).contains(&version) {
        return Err(FormatError::Version { expected: F::VERSION, got: version });
    }
    let mut counts = [0; 2];
    for (count, (field, at)) in
        counts.iter_mut().zip([("section_count", header::SECTIONS), ("tier_count", header::TIERS)])
    {
        *count = word(bytes, at) as usize;
        if !(1..=MAX_SECTIONS).contains(count) {
            return Err(FormatError::Field { field, got: *count as u64, allowed: "1 to 4096" });
        }
    }
    let tables_end = (HEADER_WORDS + counts[0] * SECTION_ENTRY_WORDS + counts[1]) * 4;
    if got < tables_end {
        return Err(FormatError::TooShort { expected: tables_end, got });
    }
    let mut head_bytes = bytes[..tables_end].to_vec();
    head_bytes[header::CHECKSUM_LOW * 4..header::CHECKSUM_LOW * 4 + 8].fill(0);
    if checksum(&head_bytes) != stored_checksum(bytes) {
        return Err(FormatError::HeaderChecksum);
    }
    Ok(counts)
}
