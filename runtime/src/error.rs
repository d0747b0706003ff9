//! Everything that can be wrong with a file's bytes, by name.

use crate::rule::{self, Rule};
use std::fmt::{self, Display, Formatter};

/// The words that messages use for the files of a format.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Names {
    /// Magic number: the first four bytes of a file.
    pub magic: [u8; 4],
    /// Name of a file with its article, such as `an SPMM asset`.
    pub a_file: &'static str,
    /// Noun that follows `the`, such as `asset`.
    pub noun: &'static str,
    /// Instruction how to make a file.
    pub make: &'static str,
    /// Instruction how to make the file again.
    pub again: &'static str,
}

/// Words for assets (`.spmm`).
pub(crate) const SPMM_NAMES: Names = Names {
    magic: *b"SPMM",
    a_file: "an SPMM asset",
    noun: "asset",
    make: "make one with btf-fit fit",
    again: "fit the capture again",
};

/// Error that refuses an asset. Each message is one sentence; the caller prefixes the file's name.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum FormatError {
    /// The file has fewer bytes than a header, or none at all. Remedy: copy the file again.
    TooShort {
        /// Number of bytes that the part needs.
        expected: usize,
        /// Number of bytes that are there.
        got: usize,
    },
    /// The first four bytes are not `SPMM`.
    BadMagic {
        /// First four bytes of the file.
        got: [u8; 4],
    },
    /// The format version is not one that this decoder reads.
    Version {
        /// Newest version that this decoder reads.
        expected: u32,
        /// Version of the file.
        got: u32,
    },
    /// The asset has the other of the two forms. Remedy: `btf-fit convert`.
    Form {
        /// Form that is read here.
        expected: &'static str,
        /// Form of the file.
        got: &'static str,
    },
    /// The length of the file is neither that of the whole asset nor that of a documented tier.
    Length {
        /// Length of the whole asset in bytes.
        expected: u64,
        /// Length of the file in bytes.
        got: u64,
    },
    /// The header or the tables do not match their checksum.
    HeaderChecksum,
    /// A section's bytes do not match its checksum.
    SectionChecksum {
        /// Name of the section.
        section: String,
    },
    /// A header field is out of its documented range.
    Field {
        /// Name of the field in format.md.
        field: &'static str,
        /// Value of the field.
        got: u64,
        /// Allowed range in words.
        allowed: &'static str,
    },
    /// A section that must be there is missing.
    MissingSection {
        /// Name of the section.
        section: String,
    },
    /// A required section is of a kind that this decoder does not know.
    UnknownRequiredSection {
        /// Number of the kind.
        kind: u32,
    },
    /// The content of a section breaks a rule of format.md.
    Section {
        /// Name of the section.
        section: String,
        /// Rule that is broken.
        reason: Rule,
    },
    /// The asset or volume handed to the packer breaks a rule of format.md or voltex.md.
    Pack {
        /// Rule that is broken, as a clause.
        reason: String,
    },
}

impl FormatError {
    /// Returns the rule that is broken. Returns `None` for errors that are no fault of a file: the other form, and an
    /// asset that cannot be packed.
    pub fn rule(&self) -> Option<Rule> {
        match self {
            FormatError::TooShort { .. } => Some(rule::TOO_SHORT),
            FormatError::BadMagic { .. } => Some(rule::BAD_MAGIC),
            FormatError::Version { .. } => Some(rule::VERSION),
            FormatError::Length { .. } => Some(rule::LENGTH),
            FormatError::HeaderChecksum => Some(rule::HEADER_CHECKSUM),
            FormatError::SectionChecksum { .. } => Some(rule::SECTION_CHECKSUM),
            FormatError::Field { .. } => Some(rule::HEADER_FIELD),
            FormatError::MissingSection { .. } => Some(rule::MISSING_SECTION),
            FormatError::UnknownRequiredSection { .. } => Some(rule::UNKNOWN_REQUIRED),
            FormatError::Section { reason, .. } => Some(*reason),
            FormatError::Form { .. } | FormatError::Pack { .. } => None,
        }
    }
}

impl std::error::Error for FormatError {}

impl Display for FormatError {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.say(&SPMM_NAMES, f)
    }
}

impl FormatError {
    /// Writes the message with the words of a format.
    pub(crate) fn say(&self, names: &Names, f: &mut Formatter<'_>) -> fmt::Result {
        let Names { a_file, noun, make, again, .. } = names;
        match self {
            FormatError::TooShort { expected, got } => write!(
                f,
                "the file is too short for {a_file}: {got} bytes, the header alone has {expected}; copy it again"
            ),
            FormatError::BadMagic { got } => {
                let magic = String::from_utf8_lossy(&names.magic);
                write!(f, "this is not {a_file} (its first four bytes are {got:02x?}, not {magic:?}); {make}")
            }
            FormatError::Version { expected, got } => write!(
                f,
                "the {noun} has format version {got}, this program reads versions up to {expected}; {again} or update the program"
            ),
            FormatError::Form { expected, got } => write!(
                f,
                "this is an {noun} in its {got} form, the {expected} form is needed here; see btf-fit convert"
            ),
            FormatError::Length { expected, got } => write!(
                f,
                "the {noun} is cut off or has bytes appended: {got} bytes, {expected} expected; copy it again"
            ),
            FormatError::HeaderChecksum => {
                write!(f, "the {noun}'s header is damaged (its checksum does not match); copy the file again")
            }
            FormatError::SectionChecksum { section } => write!(
                f,
                "section {section} of the {noun} is damaged (its checksum does not match); copy the file again"
            ),
            FormatError::Field { field, got, allowed } => write!(
                f,
                "the {noun}'s field {field} is {got}, allowed is {allowed}; it was written by a faulty or newer program"
            ),
            FormatError::MissingSection { section } => {
                write!(f, "the {noun} has no section {section}; it was written by a faulty program")
            }
            FormatError::UnknownRequiredSection { kind } => {
                write!(f, "the {noun} needs section kind {kind}, which this program does not know; update the program")
            }
            FormatError::Section { section, reason } => {
                write!(f, "section {section} of the {noun} is invalid: {reason}; it was written by a faulty program")
            }
            FormatError::Pack { reason } => write!(f, "the {noun} cannot be packed: {reason}"),
        }
    }
}
