//! Everything that can be wrong with a file's bytes, by name.

use crate::rule::{self, Rule};
use std::fmt::{self, Display, Formatter};

/// What messages call files of a format.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Names {
    /// The first four bytes.
    pub magic: [u8; 4],
    /// With its article.
    pub a_file: &'static str,
    /// What follows `the`.
    pub noun: &'static str,
    /// Where one comes from.
    pub make: &'static str,
    /// How one is renewed.
    pub again: &'static str,
}

/// An asset's.
pub(crate) const SPMM_NAMES: Names = Names {
    magic: *b"SPMM",
    a_file: "an SPMM asset",
    noun: "asset",
    make: "make one with btf-fit fit",
    again: "fit the capture again",
};

/// Why an asset was refused. Each message is one sentence; the caller prefixes the file's name.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum FormatError {
    /// Fewer bytes than a header, or none at all. Remedy: copy the file again.
    TooShort {
        /// Bytes that the part needs.
        expected: usize,
        /// Bytes that are there.
        got: usize,
    },
    /// The first four bytes are not `SPMM`.
    BadMagic {
        /// The bytes found.
        got: [u8; 4],
    },
    /// A version that this decoder does not know.
    Version {
        /// The version that is read.
        expected: u32,
        /// The version found.
        got: u32,
    },
    /// The asset has the other of the two forms. Remedy: `btf-fit convert`.
    Form {
        /// The form that is read.
        expected: &'static str,
        /// The form found.
        got: &'static str,
    },
    /// The file's length is neither the whole asset's nor one of its documented tiers'.
    Length {
        /// The whole asset's length in bytes.
        expected: u64,
        /// The length found.
        got: u64,
    },
    /// The header or the tables do not match their checksum.
    HeaderChecksum,
    /// A section's bytes do not match its checksum.
    SectionChecksum {
        /// The section's name.
        section: String,
    },
    /// A header field out of its documented range.
    Field {
        /// The field's name in format.md.
        field: &'static str,
        /// The value found.
        got: u64,
        /// The allowed range in words.
        allowed: &'static str,
    },
    /// A section that must be there is not.
    MissingSection {
        /// The section's name.
        section: String,
    },
    /// A required section of a kind that this decoder does not know.
    UnknownRequiredSection {
        /// The kind's number.
        kind: u32,
    },
    /// A section whose content breaks a rule of format.md.
    Section {
        /// The section's name.
        section: String,
        /// What does not hold.
        reason: Rule,
    },
    /// The source handed to the packer breaks a rule of format.md.
    Pack {
        /// What does not hold.
        reason: String,
    },
}

impl FormatError {
    /// The rule that is broken; `None` for what is no fault of the file: the other form, and what cannot be packed.
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
    /// The sentence about a file of this name.
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
                "the {noun} has format version {got}, this program reads version {expected}; {again} or update the program"
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
