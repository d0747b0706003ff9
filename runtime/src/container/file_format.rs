//! What a file format has of its own, and the words that all formats share.
//!
//! A file is an array of little-endian `u32` words: header, section table, tier table, then the sections, each aligned and
//! zero-padded. Each format has its own magic number, header words and kinds of sections: [`FileFormat`]. Normative text:
//! docs/FORMAT.md, chapter "File".

use crate::container::fault::Faults;
use crate::error::{FormatError, Names};
use crate::rule::Rule;

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

/// Flag of a section that a reader may not skip.
pub const SECTION_REQUIRED: u32 = 1;

/// First eight bytes of the BLAKE3 hash, as a little-endian integer.
pub fn checksum(bytes: &[u8]) -> u64 {
    let hash = blake3::hash(bytes);
    u64::from_le_bytes(hash.as_bytes()[..8].try_into().unwrap_or([0; 8]))
}

/// Returns word `index` of a file that has it.
pub(crate) fn word(bytes: &[u8], index: usize) -> u32 {
    let start = index * 4;
    u32::from_le_bytes([bytes[start], bytes[start + 1], bytes[start + 2], bytes[start + 3]])
}

/// The words of a header, and the faults of those that are out of their ranges.
pub(crate) struct HeaderReader<'a> {
    /// The file's bytes, whose header is whole.
    pub bytes: &'a [u8],
    /// Faults are added here.
    pub faults: &'a mut Faults,
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
