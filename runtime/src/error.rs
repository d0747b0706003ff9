//! Everything that can be wrong with an asset's bytes, by name.

use crate::rule::{self, Rule};
use thiserror::Error;

/// Why an asset was refused. Each message is one sentence; the caller prefixes the file's name.
#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum FormatError {
    /// Fewer bytes than a header, or none at all. Remedy: copy the file again.
    #[error("the file is too short for an SPMM asset: {got} bytes, the header alone has {expected}; copy it again")]
    TooShort {
        /// Bytes that the part needs.
        expected: usize,
        /// Bytes that are there.
        got: usize,
    },
    /// The first four bytes are not `SPMM`.
    #[error("this is not an SPMM asset (its first four bytes are {got:02x?}, not \"SPMM\"); make one with btf-fit fit")]
    BadMagic {
        /// The bytes found.
        got: [u8; 4],
    },
    /// A version that this decoder does not know.
    #[error(
        "the asset has format version {got}, this program reads version {expected}; fit the capture again or update the program"
    )]
    Version {
        /// The version that is read.
        expected: u32,
        /// The version found.
        got: u32,
    },
    /// The asset has the other of the two forms. Remedy: `btf-fit convert`.
    #[error("this is an asset in its {got} form, the {expected} form is needed here; see btf-fit convert")]
    Form {
        /// The form that is read.
        expected: &'static str,
        /// The form found.
        got: &'static str,
    },
    /// The file's length is neither the whole asset's nor one of its documented tiers'.
    #[error("the asset is cut off or has bytes appended: {got} bytes, {expected} expected; copy it again")]
    Length {
        /// The whole asset's length in bytes.
        expected: u64,
        /// The length found.
        got: u64,
    },
    /// The header or the tables do not match their checksum.
    #[error("the asset's header is damaged (its checksum does not match); copy the file again")]
    HeaderChecksum,
    /// A section's bytes do not match its checksum.
    #[error("section {section} of the asset is damaged (its checksum does not match); copy the file again")]
    SectionChecksum {
        /// The section's name.
        section: String,
    },
    /// A header field out of its documented range.
    #[error("the asset's field {field} is {got}, allowed is {allowed}; it was written by a faulty or newer program")]
    Field {
        /// The field's name in FORMAT.md.
        field: &'static str,
        /// The value found.
        got: u64,
        /// The allowed range in words.
        allowed: &'static str,
    },
    /// A section that must be there is not.
    #[error("the asset has no section {section}; it was written by a faulty program")]
    MissingSection {
        /// The section's name.
        section: String,
    },
    /// A required section of a kind that this decoder does not know.
    #[error("the asset needs section kind {kind}, which this program does not know; update the program")]
    UnknownRequiredSection {
        /// The kind's number.
        kind: u32,
    },
    /// A section whose content breaks a rule of FORMAT.md.
    #[error("section {section} of the asset is invalid: {reason}; it was written by a faulty program")]
    Section {
        /// The section's name.
        section: String,
        /// What does not hold.
        reason: Rule,
    },
    /// The source handed to the packer breaks a rule of FORMAT.md.
    #[error("the asset cannot be packed: {reason}")]
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
