//! The container that every file of this package is: header, section table, tier table, sections. Each format has its own magic
//! number, words of the header and kinds of sections, told by [`FileFormat`]; what holds of all of them is here, once. Normative
//! text: docs/reference/format.md, chapter "File".
//!
//! A file is an array of little-endian `u32` words: header, section table, tier table, then the sections, each aligned and
//! zero-padded.

use crate::container::fault::Faults;
use crate::container::finding::Finding;
use crate::error::{FormatError, Names};
use crate::rule::{self, Rule};
use crate::threads::{Threads, map};

/// Every section of a file form starts at a multiple of this many bytes.
pub const ALIGNMENT: usize = 16;
/// Words of the header.
pub const HEADER_WORDS: usize = 20;
/// Words of a section table entry.
pub const SECTION_ENTRY_WORDS: usize = 8;
/// Most sections in a file.
pub const MAX_SECTIONS: usize = 4096;

/// Header words that all formats have, by name.
pub mod header {
    /// Four letters.
    pub const MAGIC: usize = 0;
    /// Format version.
    pub const VERSION: usize = 1;
    /// Length of the whole file in bytes, low word.
    pub const LENGTH_LOW: usize = 2;
    /// Length of the whole file in bytes, high word (0 in version 1).
    pub const LENGTH_HIGH: usize = 3;
    /// Number of sections.
    pub const SECTIONS: usize = 4;
    /// Number of tiers.
    pub const TIERS: usize = 5;
    /// Checksum of header (these two words as 0), section table and tier table.
    pub const CHECKSUM_LOW: usize = 12;
    /// High word of the checksum.
    pub const CHECKSUM_HIGH: usize = 13;
}

/// What a format has of its own.
pub(crate) trait FileFormat {
    /// What header and sections say of the whole file.
    type Head: Copy;
    /// What a section holds.
    type Kind: Copy;
    /// What messages call it.
    const NAMES: Names;
    /// The version that is written and read.
    const VERSION: u32;

    /// The header's own words; `None` where one of them is out of its range.
    fn read_head(header: &mut HeaderReader) -> Option<Self::Head>;

    /// Writes them.
    fn write_head(head: &Self::Head, words: &mut [u32]);

    /// What sections' offsets are multiples of, bytes.
    fn alignment(head: &Self::Head) -> usize;

    /// How many layers sections may belong to.
    fn layers(head: &Self::Head) -> u32;

    /// The kind with a number, if this version knows it.
    fn kind(number: u32) -> Option<Self::Kind>;

    /// The number of a kind.
    fn number(kind: Self::Kind) -> u32;

    /// For messages: a section of a known kind.
    fn section_name(kind: Self::Kind, layer: u32, index: u32) -> String;

    /// The rule as this format words it.
    fn rule(shared: Rule) -> Rule {
        shared
    }
}

/// One row of the section table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SectionEntry {
    /// Number of the kind (see [`crate::SectionKind`] and [`crate::voltex::VoltexSection`]; unknown ones may stand here).
    pub kind: u32,
    /// Layer, or 0 for sections of the whole asset.
    pub layer: u32,
    /// Index among sections of one kind and layer.
    pub index: u32,
    /// Bit 0: a reader that does not know the kind must refuse the file.
    pub flags: u32,
    /// Byte offset from the start of the file, a multiple of [`ALIGNMENT`].
    pub offset: u32,
    /// Bytes, without padding.
    pub length: u32,
    /// First eight bytes of the BLAKE3 hash of the section's bytes.
    pub checksum: u64,
}

/// Flag of a section that a reader may not skip.
pub const SECTION_REQUIRED: u32 = 1;

impl SectionEntry {
    /// Something about it that is no error.
    fn finding_in<F: FileFormat>(&self, rule: Rule, detail: String) -> Finding {
        Finding {
            section: Some(self.name_in::<F>()),
            layer: Some(self.layer),
            offset: Some(self.offset.into()),
            ..Finding::new(F::rule(rule), detail)
        }
    }

    /// That it is of a known kind, and nothing refers to it.
    pub(crate) fn unused_in<F: FileFormat>(&self) -> Finding {
        self.finding_in::<F>(rule::SECTION_UNUSED, format!("{}, {} bytes", self.name_in::<F>(), self.length))
    }

    /// For messages.
    pub(crate) fn name_in<F: FileFormat>(&self) -> String {
        match F::kind(self.kind) {
            Some(kind) => F::section_name(kind, self.layer, self.index),
            None => format!("kind {}", self.kind),
        }
    }
}

/// First eight bytes of the BLAKE3 hash, as a little-endian integer.
pub fn checksum(bytes: &[u8]) -> u64 {
    let hash = blake3::hash(bytes);
    u64::from_le_bytes(hash.as_bytes()[..8].try_into().unwrap_or([0; 8]))
}

/// A file's header with its tables, checked.
#[derive(Debug, Clone)]
pub struct Directory<H = crate::file::format::Head> {
    /// What the header says of the whole file.
    pub head: H,
    /// Section table, whole file.
    pub sections: Vec<SectionEntry>,
    /// Documented prefix lengths in bytes, ascending; the last is the whole file's.
    pub tiers: Vec<u32>,
    /// Which of `tiers` the bytes at hand are.
    pub tier: usize,
    /// Numbers of the sections whose checksum is wrong; none in what is read without a fault.
    pub(crate) damaged: Vec<usize>,
    /// Checksum of header and tables, which hold those of all sections: what tells one file from another.
    pub checksum: u64,
}

impl<H> Directory<H> {
    /// The sections that begin within so many bytes at hand.
    pub(crate) fn at_hand(&self, bytes: usize) -> impl Iterator<Item = &SectionEntry> {
        self.sections.iter().filter(move |entry| (entry.offset as usize) < bytes)
    }

    /// Whether the bytes at hand are the whole file.
    pub(crate) fn is_whole(&self) -> bool {
        self.tier + 1 == self.tiers.len()
    }
}

fn word(bytes: &[u8], index: usize) -> u32 {
    let start = index * 4;
    u32::from_le_bytes([bytes[start], bytes[start + 1], bytes[start + 2], bytes[start + 3]])
}

/// The words of a header, and the faults of those that are out of their ranges.
pub(crate) struct HeaderReader<'a> {
    bytes: &'a [u8],
    faults: &'a mut Faults,
}

impl HeaderReader<'_> {
    /// A word as it is.
    pub(crate) fn word(&self, at: usize) -> u32 {
        word(self.bytes, at)
    }

    pub(crate) fn refuse(&mut self, field: &'static str, at: usize, allowed: &'static str) {
        let got = self.word(at).into();
        self.faults.push_at(FormatError::Field { field, got, allowed }, None, Some(4 * at as u64));
    }

    /// A word; a fault where it is out of its range, which `allowed` names.
    pub(crate) fn within(&mut self, field: &'static str, at: usize, range: [u32; 2], allowed: &'static str) -> u32 {
        let got = self.word(at);
        if !(range[0]..=range[1]).contains(&got) {
            self.refuse(field, at, allowed);
        }
        got
    }
}

/// Checks header, tables, section bounds, padding and every present section's checksum, these on `threads`.
pub(crate) fn read_directory_of<F: FileFormat>(
    bytes: &[u8],
    threads: Threads,
) -> Result<Directory<F::Head>, FormatError> {
    let mut faults = Faults::default();
    let directory = examine_directory_of::<F>(bytes, threads, &mut faults);
    faults.or_first(directory)
}

/// The same, going on behind a fault as far as more can be told. `None` where the sections' places are not known.
pub(crate) fn examine_directory_of<F: FileFormat>(
    bytes: &[u8],
    threads: Threads,
    faults: &mut Faults,
) -> Option<Directory<F::Head>> {
    let got = bytes.len();
    let [section_count, tier_count] = faults.keep(read_counts::<F>(bytes))?;
    let tables_end = (HEADER_WORDS + section_count * SECTION_ENTRY_WORDS + tier_count) * 4;
    let before = faults.len();
    let mut reader = HeaderReader { bytes, faults };
    reader.within("length_high", header::LENGTH_HIGH, [0, 0], "0");
    let head = F::read_head(&mut reader);
    let head = head.filter(|_| faults.len() == before)?;
    let alignment = F::alignment(&head);
    let layers = F::layers(&head);

    let total = word(bytes, header::LENGTH_LOW);
    let tier_at = HEADER_WORDS + section_count * SECTION_ENTRY_WORDS;
    let tiers: Vec<u32> = (0..tier_count).map(|i| word(bytes, tier_at + i)).collect();
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

    let sections: Vec<SectionEntry> = (0..section_count)
        .map(|i| {
            let at = |field: usize| word(bytes, HEADER_WORDS + i * SECTION_ENTRY_WORDS + field);
            SectionEntry {
                kind: at(0),
                layer: at(1),
                index: at(2),
                flags: at(3),
                offset: at(4),
                length: at(5),
                checksum: u64::from(at(6)) | u64::from(at(7)) << 32,
            }
        })
        .collect();

    // Sections follow each other in order; what lies between them is zero, so no byte is unaccounted for.
    let mut end = tables_end;
    let mut bodies: Vec<(usize, &[u8])> = Vec::new();
    let mut placed = true;
    for (number, entry) in sections.iter().enumerate() {
        let start = end.next_multiple_of(alignment);
        let broken = |reason| FormatError::Section { section: entry.name_in::<F>(), reason };
        if entry.offset as usize != start {
            faults.push(broken(rule::SECTION_START));
            placed = false;
            break;
        }
        if F::kind(entry.kind).is_none() && entry.flags & SECTION_REQUIRED != 0 {
            faults.push(FormatError::UnknownRequiredSection { kind: entry.kind });
        }
        if entry.flags & !SECTION_REQUIRED != 0 {
            faults.push(broken(rule::SECTION_FLAGS));
        }
        if entry.layer >= layers {
            faults.push(broken(rule::SECTION_LAYER));
        }
        let Some(new_end) = start.checked_add(entry.length as usize).filter(|new_end| *new_end <= total as usize)
        else {
            faults.push(broken(rule::SECTION_BEYOND));
            placed = false;
            break;
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
                        placed = false;
                        break;
                    }
                }
            }
        }
        end = new_end;
    }
    if placed && end.next_multiple_of(alignment) != total as usize {
        faults.push(FormatError::Section { section: "section table".into(), reason: rule::SECTIONS_END });
        placed = false;
    }
    if placed && end < got && bytes[end..].iter().any(|byte| *byte != 0) {
        let error = FormatError::Section { section: "padding at the end".into(), reason: rule::PADDING_AT_END };
        faults.push_at(error, None, Some(end as u64));
    }
    let intact = map(threads, bodies.len(), |i| checksum(bodies[i].1) == sections[bodies[i].0].checksum);
    let damaged: Vec<usize> = bodies.iter().zip(intact).filter(|(_, intact)| !intact).map(|(body, _)| body.0).collect();
    for number in &damaged {
        faults.push(FormatError::SectionChecksum { section: sections[*number].name_in::<F>() });
    }
    placed.then_some(Directory { head, sections, tiers, tier, checksum: stored_checksum(bytes), damaged })
}

/// The checksum of header and tables as the header has it.
fn stored_checksum(bytes: &[u8]) -> u64 {
    u64::from(word(bytes, header::CHECKSUM_LOW)) | u64::from(word(bytes, header::CHECKSUM_HIGH)) << 32
}

/// Numbers of sections and tiers of a header that is whole, as far as it reaches.
fn read_counts<F: FileFormat>(bytes: &[u8]) -> Result<[usize; 2], FormatError> {
    let (got, head) = (bytes.len(), HEADER_WORDS * 4);
    if got >= 4 && bytes[..4] != F::NAMES.magic {
        return Err(FormatError::BadMagic { got: [bytes[0], bytes[1], bytes[2], bytes[3]] });
    }
    if got < head {
        return Err(FormatError::TooShort { expected: head, got });
    }
    let version = word(bytes, header::VERSION);
    if version != F::VERSION {
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

/// What the tables of a file without an error say.
pub(crate) fn about_container<F: FileFormat>(directory: &Directory<F::Head>, bytes: usize) -> Vec<Finding> {
    let lengths: Vec<String> = directory.tiers.iter().map(u32::to_string).collect();
    let listed = format!("{} of {} bytes", lengths.len(), lengths.join(", "));
    let mut told = vec![Finding::new(F::rule(rule::TIERS_LISTED), listed)];
    if !directory.is_whole() {
        let whole = directory.tiers.last().copied().unwrap_or(0);
        let detail = format!("tier {}, {bytes} of {whole} bytes", directory.tier);
        told.push(Finding::new(F::rule(rule::TIER_AT_HAND), detail));
    }
    for entry in directory.sections.iter().filter(|entry| (entry.offset as usize) < bytes) {
        if F::kind(entry.kind).is_none() {
            told.push(Finding {
                section: Some(entry.name_in::<F>()),
                layer: Some(entry.layer),
                offset: Some(entry.offset.into()),
                ..Finding::new(F::rule(rule::UNKNOWN_SKIPPED), format!("kind {}, {} bytes", entry.kind, entry.length))
            });
        }
    }
    told
}

/// A section that the packer is about to write.
pub(crate) struct SectionSource<K> {
    /// What it holds.
    pub kind: K,
    /// Layer.
    pub layer: u32,
    /// Index among its kind.
    pub index: u32,
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// True where a prefix of the file that ends after this section is a valid, coarser asset.
    pub ends_tier: bool,
}

/// Writes header, tables and sections. The last section always ends a tier.
pub(crate) fn write_file_of<F: FileFormat>(
    head: &F::Head,
    sections: &[SectionSource<F::Kind>],
) -> Result<Vec<u8>, FormatError> {
    let alignment = F::alignment(head);
    let refuse = |reason: &str| FormatError::Pack { reason: reason.to_string() };
    if sections.is_empty() || sections.len() > MAX_SECTIONS {
        return Err(refuse("it needs 1 to 4096 sections"));
    }
    let tier_ends: Vec<usize> =
        (0..sections.len()).filter(|&i| sections[i].ends_tier || i + 1 == sections.len()).collect();
    let tables_end = (HEADER_WORDS + sections.len() * SECTION_ENTRY_WORDS + tier_ends.len()) * 4;
    let mut words: Vec<u32> = vec![0; tables_end / 4];
    let mut body: Vec<u8> = vec![0; tables_end.next_multiple_of(alignment)];
    let mut tiers = Vec::new();
    for (i, section) in sections.iter().enumerate() {
        let offset = u32::try_from(body.len()).map_err(|_| refuse("it is larger than 4 GiB"))?;
        let hash = checksum(&section.bytes);
        let at = HEADER_WORDS + i * SECTION_ENTRY_WORDS;
        words[at..at + SECTION_ENTRY_WORDS].copy_from_slice(&[
            F::number(section.kind),
            section.layer,
            section.index,
            SECTION_REQUIRED,
            offset,
            u32::try_from(section.bytes.len()).map_err(|_| refuse("a section is larger than 4 GiB"))?,
            hash as u32,
            (hash >> 32) as u32,
        ]);
        body.extend_from_slice(&section.bytes);
        body.resize(body.len().next_multiple_of(alignment), 0);
        if tier_ends.contains(&i) {
            tiers.push(u32::try_from(body.len()).map_err(|_| refuse("it is larger than 4 GiB"))?);
        }
    }
    let total = *tiers.last().unwrap_or(&0);
    F::write_head(head, &mut words);
    words[header::MAGIC] = u32::from_le_bytes(F::NAMES.magic);
    words[header::VERSION] = F::VERSION;
    words[header::LENGTH_LOW] = total;
    words[header::SECTIONS] = sections.len() as u32;
    words[header::TIERS] = tiers.len() as u32;
    let tier_at = HEADER_WORDS + sections.len() * SECTION_ENTRY_WORDS;
    words[tier_at..tier_at + tiers.len()].copy_from_slice(&tiers);
    let hash = checksum(bytemuck::cast_slice(&words));
    words[header::CHECKSUM_LOW] = hash as u32;
    words[header::CHECKSUM_HIGH] = (hash >> 32) as u32;
    body[..tables_end].copy_from_slice(bytemuck::cast_slice(&words));
    Ok(body)
}
