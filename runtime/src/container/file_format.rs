//! The parts that all file formats share, and [`FileFormat`], which tells what a format has of its own.
//!
//! A file is an array of little-endian `u32` words: header, section table, tier table, then the sections, each aligned
//! and zero-padded. Each format has its own magic number, header words and kinds of sections. Normative text:
//! docs/reference/format.md, chapter "File".

use crate::container::fault::Faults;
use crate::error::{FormatError, Names};
use crate::rule::Rule;

/// Alignment of the sections of a file form, bytes.
pub const ALIGNMENT: usize = 16;
/// Number of words of the header.
pub const HEADER_WORDS: usize = 20;
/// Number of words of a row of the section table.
pub const SECTION_ENTRY_WORDS: usize = 8;
/// Largest number of sections in a file.
pub const MAX_SECTIONS: usize = 4096;

/// Positions of the header words that all formats have.
pub mod header {
    /// Magic number: four letters.
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

/// A file format: its header words, its kinds of sections and its name.
pub(crate) trait FileFormat {
    /// Contents of the header about the whole file.
    type Head: Copy;
    /// Kinds of sections.
    type Kind: Copy;
    /// Names of the format's files in messages.
    const NAMES: Names;
    /// Newest format version that is read.
    const VERSION: u32;

    /// Returns the version of a file with this header.
    fn version(_head: &Self::Head) -> u32 {
        Self::VERSION
    }

    /// Reads the format's own header words. Returns `None` where one of them is out of its range.
    fn read_head(header: &mut HeaderReader) -> Option<Self::Head>;

    /// Writes the format's own header words.
    fn write_head(head: &Self::Head, words: &mut [u32]);

    /// Returns the alignment of the sections, bytes.
    fn alignment(head: &Self::Head) -> usize;

    /// Returns the number of layers that sections may belong to.
    fn layers(head: &Self::Head) -> u32;

    /// Returns the kind with a number; `None` if this version does not know it.
    fn kind(number: u32) -> Option<Self::Kind>;

    /// Returns the number of a kind.
    fn number(kind: Self::Kind) -> u32;

    /// Returns the name of a section of a known kind, for messages.
    fn section_name(kind: Self::Kind, layer: u32, index: u32) -> String;

    /// Returns a rule in the words of this format.
    fn rule(shared: Rule) -> Rule {
        shared
    }
}

/// Flag of a section that a reader may not skip.
pub const SECTION_REQUIRED: u32 = 1;

/// Returns the first eight bytes of the BLAKE3 hash as a little-endian integer.
pub fn checksum(bytes: &[u8]) -> u64 {
    let hash = blake3::hash(bytes);
    u64::from_le_bytes(hash.as_bytes()[..8].try_into().unwrap_or([0; 8]))
}

/// Returns word `index` of a file, which must have it.
pub(crate) fn word(bytes: &[u8], index: usize) -> u32 {
    let start = index * 4;
    u32::from_le_bytes([bytes[start], bytes[start + 1], bytes[start + 2], bytes[start + 3]])
}

/// Reads header words and collects the faults of those that are out of their ranges.
pub(crate) struct HeaderReader<'a> {
    /// Bytes of the file; the header must be whole.
    pub bytes: &'a [u8],
    /// Faults found so far.
    pub faults: &'a mut Faults,
}

impl HeaderReader<'_> {
    /// Returns header word `at`.
    pub(crate) fn word(&self, at: usize) -> u32 {
        word(self.bytes, at)
    }

    pub(crate) fn refuse(&mut self, field: &'static str, at: usize, allowed: &'static str) {
        let got = self.word(at).into();
        self.faults.push_at(FormatError::Field { field, got, allowed }, None, Some(4 * at as u64));
    }

    /// Returns header word `at`. Adds a fault if it is outside `range`; `allowed` is the range in words.
    pub(crate) fn within(&mut self, field: &'static str, at: usize, range: [u32; 2], allowed: &'static str) -> u32 {
        let got = self.word(at);
        if !(range[0]..=range[1]).contains(&got) {
            self.refuse(field, at, allowed);
        }
        got
    }
}
