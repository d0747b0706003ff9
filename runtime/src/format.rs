//! The byte layout of an asset: the one file that knows offsets. Normative text: docs/FORMAT.md.
//!
//! A file is an array of little-endian `u32` words: header, section table, tier table, then the
//! sections, each aligned to [`ALIGNMENT`] bytes and zero-padded.

use crate::error::FormatError;
use crate::fault::Faults;
use crate::rule;
use crate::threads::{Threads, map, serial};

/// `SPMM` as a little-endian word.
pub const MAGIC: u32 = u32::from_le_bytes(*b"SPMM");
/// The version that this crate writes and reads.
pub const VERSION: u32 = 1;
/// Every section of the file form starts at a multiple of this many bytes.
pub const ALIGNMENT: usize = 16;
/// Every section of the resident form does: where a GPU lets a binding begin.
pub const RESIDENT_ALIGNMENT: usize = 256;
/// Bytes of each section of the resident form's words but the last: what WebGPU binds at least.
pub const PIECE_BYTES: usize = 1 << 27;
/// Words of the header.
pub const HEADER_WORDS: usize = 20;
/// Largest physical side, millimetres.
pub const MOST_SIDE_MM: f32 = 1e6;
/// Words of a section table entry.
pub const SECTION_ENTRY_WORDS: usize = 8;
/// Most sections in a file.
pub const MAX_SECTIONS: usize = 4096;
/// Most layers in a file (front, back, and the two transmissions).
pub const MAX_LAYERS: usize = 4;
/// Largest width or height in texels.
pub const MAX_SIDE: u32 = 16_384;
/// Most levels: down to one texel from the widest asset.
pub const MOST_LEVELS: usize = 15;
/// Most clusters in a layer: a cluster id is one byte.
pub const MAX_CLUSTERS: usize = 256;
/// Most lobes in one cluster's dictionary: a lobe id is one byte.
pub const MAX_DICTIONARY: usize = 256;
/// Most directions in a set.
pub const MAX_DIRECTIONS: usize = 4096;
/// Most residual components.
pub const MAX_COMPONENTS: usize = 128;
/// Most shared bases of a layer.
pub const MAX_SHARED: usize = 1024;
/// Largest step of a shared basis or of a cluster's mixture: bounded, so that no expanded basis overflows to NaN.
pub const MAX_BASIS_STEP: f32 = 1e4;
/// Largest step of a coefficient.
pub const MAX_COEFFICIENT_STEP: f32 = 1e9;
/// Largest rank of a factor matrix.
pub const MAX_RANK: usize = 256;
/// Most words that one layer's expanded bases may take (1 GiB): a few hundred bytes of factors must not
/// make a reader allocate without bound.
pub const MAX_BASIS_WORDS: u64 = 1 << 28;

/// Words of a layer's expanded bases: halves `[cluster, pair, channel, basis]`, bases padded to an even count.
pub fn basis_words(shape: [usize; 2], clusters: usize, bases: usize) -> u64 {
    [shape[0], shape[1], 3, clusters, bases.div_ceil(2)].iter().map(|n| *n as u64).product()
}

/// Header words, by name.
pub mod header {
    /// `SPMM`.
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
    /// Number of layers.
    pub const LAYERS: usize = 6;
    /// Texels per row.
    pub const WIDTH: usize = 7;
    /// Rows.
    pub const HEIGHT: usize = 8;
    /// Channels per sample (3).
    pub const CHANNELS: usize = 9;
    /// Channel basis (0: linear sRGB primaries, D65).
    pub const BASIS: usize = 10;
    /// Flags: bit 1 left and right edge continue each other, bit 2 top and bottom; bit 0 is reserved for signed weights.
    pub const FLAGS: usize = 11;
    /// Checksum of header (these two words as 0), section table and tier table.
    pub const CHECKSUM_LOW: usize = 12;
    /// High word of the checksum.
    pub const CHECKSUM_HIGH: usize = 13;
    /// Form: 0 the file form, 1 the resident form.
    pub const FORM: usize = 14;
    /// Physical width in millimetres (f32); 0 with the height where it is not known.
    pub const WIDTH_MM: usize = 15;
    /// Physical height in millimetres (f32).
    pub const HEIGHT_MM: usize = 16;
}

/// What the sections of a file make up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Form {
    /// Small: entropy-coded, bases shared. What is stored and sent.
    File = 0,
    /// Large: the words that decoders read, to be mapped and bound as they lie.
    Resident = 1,
}

impl Form {
    /// What its sections' offsets are multiples of, bytes.
    pub fn alignment(self) -> usize {
        match self {
            Form::File => ALIGNMENT,
            Form::Resident => RESIDENT_ALIGNMENT,
        }
    }
}

/// What a section holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u32)]
pub enum SectionKind {
    /// UTF-8 JSON: name, capture source, error figures, fit parameters.
    Material = 1,
    /// A layer's parameters.
    Layer = 2,
    /// A direction set with triangles and hull edges; index 0 light, 1 view.
    Directions = 3,
    /// Cluster id per texel.
    TexelClusters = 4,
    /// Lobe count per texel.
    TexelLobeCounts = 5,
    /// Per cluster a dictionary of lobes.
    Dictionary = 6,
    /// Lobe references with RGB weights, texel by texel.
    LobeRefs = 7,
    /// Factor matrices of the residual bases.
    Factors = 8,
    /// Cores of the bases that all clusters share.
    SharedBases = 9,
    /// One basis of every cluster as a mixture of the shared ones; index 0 the mean, j the j-th component.
    Basis = 10,
    /// Coefficients of the j-th component for all texels (index j from 1).
    Coefficients = 11,
    /// Height per texel.
    Height = 12,
    /// A layer's texels at a coarser level; index 1 half as wide and high, and so on.
    Level = 13,
    /// Edits of the whole asset, and each texel's.
    Edits = 14,
    /// The resident form's words, [`PIECE_BYTES`] a section.
    Words = 15,
}

impl SectionKind {
    /// The kind with number `kind`, if this version knows it.
    pub fn from_number(kind: u32) -> Option<SectionKind> {
        use SectionKind::*;
        [
            Material,
            Layer,
            Directions,
            TexelClusters,
            TexelLobeCounts,
            Dictionary,
            LobeRefs,
            Factors,
            SharedBases,
            Basis,
            Coefficients,
            Height,
            Level,
            Edits,
            Words,
        ]
        .into_iter()
        .find(|known| *known as u32 == kind)
    }
}

/// One row of the section table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SectionEntry {
    /// Number of the kind (see [`SectionKind`]; unknown ones may stand here).
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
    /// For messages: `Basis 3 of layer 0`.
    pub fn name(&self) -> String {
        match SectionKind::from_number(self.kind) {
            Some(kind) => format!("{kind:?} {} of layer {}", self.index, self.layer),
            None => format!("kind {}", self.kind),
        }
    }
}

/// Bit of the first flag of [`Head::seamless`].
const SEAMLESS_BIT: u32 = 1;

/// Whether a physical size is one.
pub(crate) fn in_mm_range(size: [f32; 2]) -> bool {
    size.iter().all(|mm| *mm > 0.0 && *mm <= MOST_SIDE_MM)
}

/// First eight bytes of the BLAKE3 hash, as a little-endian integer.
pub fn checksum(bytes: &[u8]) -> u64 {
    let hash = blake3::hash(bytes);
    u64::from_le_bytes(hash.as_bytes()[..8].try_into().unwrap_or([0; 8]))
}

/// What header and sections say of the whole asset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Head {
    /// What the sections make up.
    pub form: Form,
    /// Texels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Number of layers, 1 to 4.
    pub layers: u32,
    /// Physical width and height in millimetres, where known; above 0, at most [`MOST_SIDE_MM`].
    pub size_mm: Option<[f32; 2]>,
    /// Whether the left edge continues the right one, and the bottom edge the top one.
    pub seamless: [bool; 2],
}

/// A file's header with its tables, checked.
#[derive(Debug, Clone)]
pub struct Directory {
    /// The header's description of the asset.
    pub head: Head,
    /// Section table, whole file.
    pub sections: Vec<SectionEntry>,
    /// Documented prefix lengths in bytes, ascending; the last is the whole file's.
    pub tiers: Vec<u32>,
    /// Which of `tiers` the bytes at hand are.
    pub tier: usize,
    /// Numbers of the sections whose checksum is wrong; none in what [`read_directory`] gives.
    pub(crate) damaged: Vec<usize>,
    /// Checksum of header and tables, which hold those of all sections: what tells one asset from another.
    pub checksum: u64,
}

fn word(bytes: &[u8], index: usize) -> u32 {
    let start = index * 4;
    u32::from_le_bytes([bytes[start], bytes[start + 1], bytes[start + 2], bytes[start + 3]])
}

/// Checks header, tables, section bounds, padding and every present section's checksum.
///
/// Cost: one hash of the bytes. Allocation: bounded by the tables, which are bounded by `bytes`.
pub fn read_directory(bytes: &[u8]) -> Result<Directory, FormatError> {
    read_directory_on(bytes, &serial)
}

/// The same with the sections' checksums on `threads`.
pub(crate) fn read_directory_on(bytes: &[u8], threads: Threads) -> Result<Directory, FormatError> {
    let mut faults = Faults::default();
    let directory = examine_directory(bytes, threads, &mut faults);
    faults.or_first(directory)
}

/// The same, going on behind a fault as far as more can be told. `None` where the sections' places are not known.
pub(crate) fn examine_directory(bytes: &[u8], threads: Threads, faults: &mut Faults) -> Option<Directory> {
    let got = bytes.len();
    let [section_count, tier_count] = faults.keep(read_counts(bytes))?;
    let tables_end = (HEADER_WORDS + section_count * SECTION_ENTRY_WORDS + tier_count) * 4;
    let head = read_head(bytes, faults)?;
    let alignment = head.form.alignment();

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
        let broken = |reason| FormatError::Section { section: entry.name(), reason };
        if entry.offset as usize != start {
            faults.push(broken(rule::SECTION_START));
            placed = false;
            break;
        }
        if SectionKind::from_number(entry.kind).is_none() && entry.flags & SECTION_REQUIRED != 0 {
            faults.push(FormatError::UnknownRequiredSection { kind: entry.kind });
        }
        if entry.flags & !SECTION_REQUIRED != 0 {
            faults.push(broken(rule::SECTION_FLAGS));
        }
        if entry.layer >= head.layers {
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
        faults.push(FormatError::SectionChecksum { section: sections[*number].name() });
    }
    placed.then_some(Directory { head, sections, tiers, tier, checksum: stored_checksum(bytes), damaged })
}

/// The checksum of header and tables as the header has it.
fn stored_checksum(bytes: &[u8]) -> u64 {
    u64::from(word(bytes, header::CHECKSUM_LOW)) | u64::from(word(bytes, header::CHECKSUM_HIGH)) << 32
}

/// Numbers of sections and tiers of a header that is whole, as far as it reaches.
fn read_counts(bytes: &[u8]) -> Result<[usize; 2], FormatError> {
    let (got, head) = (bytes.len(), HEADER_WORDS * 4);
    if got >= 4 && word(bytes, header::MAGIC) != MAGIC {
        return Err(FormatError::BadMagic { got: [bytes[0], bytes[1], bytes[2], bytes[3]] });
    }
    if got < head {
        return Err(FormatError::TooShort { expected: head, got });
    }
    let version = word(bytes, header::VERSION);
    if version != VERSION {
        return Err(FormatError::Version { expected: VERSION, got: version });
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

/// The header's other words; `None` where one of them is out of its range.
fn read_head(bytes: &[u8], faults: &mut Faults) -> Option<Head> {
    let before = faults.len();
    let mut refuse = |field: &'static str, at: usize, got: u32, allowed: &'static str| {
        faults.push_at(FormatError::Field { field, got: got.into(), allowed }, None, Some(4 * at as u64));
    };
    let mut within = |field, at, least, most, allowed| {
        let got = word(bytes, at);
        if !(least..=most).contains(&got) {
            refuse(field, at, got, allowed);
        }
        got
    };
    within("length_high", header::LENGTH_HIGH, 0, 0, "0");
    let layers = within("layer_count", header::LAYERS, 1, MAX_LAYERS as u32, "1 to 4");
    let width = within("width", header::WIDTH, 1, MAX_SIDE, "1 to 16384");
    let height = within("height", header::HEIGHT, 1, MAX_SIDE, "1 to 16384");
    within("channels", header::CHANNELS, 3, 3, "3 in version 1");
    within("basis", header::BASIS, 0, 0, "0 (linear sRGB) in version 1");
    let form = if within("form", header::FORM, 0, 1, "0 or 1") == 0 { Form::File } else { Form::Resident };
    for reserved in header::HEIGHT_MM + 1..HEADER_WORDS {
        within("reserved", reserved, 0, 0, "0");
    }
    let flags = word(bytes, header::FLAGS);
    if flags & !(3 << SEAMLESS_BIT) != 0 {
        refuse("flags", header::FLAGS, flags, "0, 2, 4 or 6 in version 1");
    }
    let seamless = [0, 1].map(|axis| flags >> (SEAMLESS_BIT + axis) & 1 == 1);
    let size_words = [header::WIDTH_MM, header::HEIGHT_MM].map(|field| word(bytes, field));
    let size_mm = (size_words != [0, 0]).then(|| size_words.map(f32::from_bits));
    if !size_mm.is_none_or(in_mm_range) {
        let allowed = "a size above 0 mm and at most 1000000 mm, or both 0";
        refuse("width_mm or height_mm", header::WIDTH_MM, size_words[0], allowed);
    }
    (faults.len() == before).then_some(Head { form, width, height, layers, size_mm, seamless })
}

/// A section that the packer is about to write.
pub struct SectionSource {
    /// What it holds.
    pub kind: SectionKind,
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
pub fn write_file(head: &Head, sections: &[SectionSource]) -> Result<Vec<u8>, FormatError> {
    let alignment = head.form.alignment();
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
            section.kind as u32,
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
    words[header::MAGIC] = MAGIC;
    words[header::VERSION] = VERSION;
    words[header::LENGTH_LOW] = total;
    words[header::SECTIONS] = sections.len() as u32;
    words[header::TIERS] = tiers.len() as u32;
    words[header::LAYERS] = head.layers;
    words[header::WIDTH] = head.width;
    words[header::HEIGHT] = head.height;
    words[header::CHANNELS] = 3;
    words[header::FLAGS] = (0..2).map(|axis| u32::from(head.seamless[axis]) << (SEAMLESS_BIT + axis as u32)).sum();
    words[header::FORM] = head.form as u32;
    let size_mm = head.size_mm.unwrap_or_default();
    words[header::WIDTH_MM] = size_mm[0].to_bits();
    words[header::HEIGHT_MM] = size_mm[1].to_bits();
    let tier_at = HEADER_WORDS + sections.len() * SECTION_ENTRY_WORDS;
    words[tier_at..tier_at + tiers.len()].copy_from_slice(&tiers);
    let hash = checksum(bytemuck::cast_slice(&words));
    words[header::CHECKSUM_LOW] = hash as u32;
    words[header::CHECKSUM_HIGH] = (hash >> 32) as u32;
    body[..tables_end].copy_from_slice(bytemuck::cast_slice(&words));
    Ok(body)
}
