//! The findings of a validation: each fault, warning or piece of information about a file.

use crate::container::directory::{Directory, SectionEntry};
use crate::container::fault::Fault;
use crate::container::file_format::FileFormat;
use crate::error::{FormatError, Names};
use crate::rule::{self, Rule, Severity};
use std::fmt::{self, Display};

/// A fault, a warning or a piece of information about a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// Number, message, severity and remedy.
    pub rule: Rule,
    /// Description of what was found, one clause.
    pub detail: String,
    /// Name of the section that the finding is about, such as `Basis 3 of layer 0`; `None` if it is about none.
    pub section: Option<String>,
    /// Layer that the finding is about, if any.
    pub layer: Option<u32>,
    /// Byte of the file at which it was found, if known.
    pub offset: Option<u64>,
}

impl Finding {
    /// Makes a finding about the whole file.
    pub fn new(rule: Rule, detail: String) -> Finding {
        Finding { rule, detail, section: None, layer: None, offset: None }
    }

    /// Returns how severe the finding is.
    pub fn severity(&self) -> Severity {
        self.rule.severity()
    }

    /// Makes the finding of a fault. `sections` are those at hand. Returns `None` for an error that is no fault of the
    /// file.
    pub(crate) fn of_fault<F: FileFormat>(fault: &Fault, sections: &[&SectionEntry]) -> Option<Finding> {
        let rule = F::rule(fault.error.rule()?);
        let (detail, section) = detail_of(&fault.error, &F::NAMES);
        let entry = sections.iter().find(|entry| section.as_ref() == Some(&entry.name_in::<F>()));
        let place = entry.map_or(String::new(), |entry| format!(", {} bytes at byte {}", entry.length, entry.offset));
        Some(Finding {
            rule,
            detail: detail + &place,
            layer: fault.layer.or(entry.map(|entry| entry.layer)),
            offset: fault.offset.or(entry.map(|entry| entry.offset.into())),
            section,
        })
    }
}

impl Display for Finding {
    /// Writes one line, such as `error SPMM1201: a section is damaged (Basis 3 of layer 0, 214 bytes at byte 9040);
    /// copy the file again`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Rule { message, remedy, .. } = self.rule;
        write!(f, "{} {}: {message} ({})", self.severity().name(), self.rule.id(), self.detail)?;
        if remedy.is_empty() { Ok(()) } else { write!(f, "; {remedy}") }
    }
}

/// Returns the clause about an error, and the name of the section that it is about.
fn detail_of(error: &FormatError, names: &Names) -> (String, Option<String>) {
    match error {
        FormatError::TooShort { expected, got } => (format!("{got} bytes, {expected} are needed"), None),
        FormatError::BadMagic { got } => {
            let magic = String::from_utf8_lossy(&names.magic);
            (format!("its first four bytes are {got:02x?}, not {magic:?}"), None)
        }
        FormatError::Version { expected, got } => (format!("version {got}, this program reads up to {expected}"), None),
        FormatError::Length { expected, got } => {
            (format!("{got} bytes, the whole file has {expected} and no tier ends here"), None)
        }
        FormatError::HeaderChecksum => ("the checksum does not match".into(), None),
        FormatError::Field { field, got, allowed } => (format!("{field} is {got}, allowed is {allowed}"), None),
        FormatError::UnknownRequiredSection { kind } => (format!("kind {kind}"), Some(format!("kind {kind}"))),
        FormatError::SectionChecksum { section }
        | FormatError::MissingSection { section }
        | FormatError::Section { section, .. } => (section.clone(), Some(section.clone())),
        FormatError::Form { .. } | FormatError::Pack { .. } => (error.to_string(), None),
    }
}

impl SectionEntry {
    /// Makes a finding about this section that is no error.
    fn finding_in<F: FileFormat>(&self, rule: Rule, detail: String) -> Finding {
        Finding {
            section: Some(self.name_in::<F>()),
            layer: Some(self.layer),
            offset: Some(self.offset.into()),
            ..Finding::new(F::rule(rule), detail)
        }
    }

    /// Makes the finding that the section is of a known kind but nothing refers to it.
    pub(crate) fn unused_in<F: FileFormat>(&self) -> Finding {
        self.finding_in::<F>(rule::SECTION_UNUSED, format!("{}, {} bytes", self.name_in::<F>(), self.length))
    }
}

/// Returns the findings about the tables of a file without faults. `bytes` is the number of bytes at hand.
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
