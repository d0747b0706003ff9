//! Everything that can be said of an asset's file: what the runtime finds in its bytes, and what this package finds in the
//! description of the material. The numbers of the findings are those of docs/FINDINGS.md.

use crate::describe::{parallel, read_file};
use crate::error::FitError;
use crate::material::{Material, sides_of_capture};
use btf_capture::Side;
use btf_runtime::{Finding, Severity, rule};
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;

/// What is in the file, good or bad. The names are the keys of `validate --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Validation {
    /// Whether readers take it: nothing found is an error.
    pub valid: bool,
    /// The first error in a sentence; `null` where it is valid.
    pub error: Option<String>,
    /// The layers' sides, in order; empty where it is not valid.
    pub layers: Vec<String>,
    /// Errors in the order in which a reader meets them, then warnings, then information.
    pub findings: Vec<FindingRecord>,
    /// How many there are of each.
    pub counts: FindingCounts,
}

/// A finding, flat.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FindingRecord {
    /// `error`, `warning` or `information`.
    pub severity: &'static str,
    /// `SPMM1201`.
    pub number: String,
    /// The rule's sentence.
    pub message: &'static str,
    /// What was found.
    pub detail: String,
    /// What helps.
    pub remedy: &'static str,
    /// The section's name, where it is one's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub section: Option<String>,
    /// The layer, where it is one's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layer: Option<u32>,
    /// Byte of the file, where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<u64>,
    /// All of it in a line.
    #[serde(skip)]
    pub line: String,
}

/// Findings by severity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct FindingCounts {
    /// Errors.
    pub error: usize,
    /// Warnings.
    pub warning: usize,
    /// Information.
    pub information: usize,
}

impl FindingRecord {
    fn of(finding: &Finding) -> FindingRecord {
        FindingRecord {
            severity: finding.severity().name(),
            number: finding.rule.id(),
            message: finding.rule.message,
            detail: finding.detail.clone(),
            remedy: finding.rule.remedy,
            section: finding.section.clone(),
            layer: finding.layer,
            offset: finding.offset,
            line: finding.to_string(),
        }
    }
}

/// Examines the asset in `bytes`, in either form, or the tier of one: header, tables, checksums, every section's content, and the
/// description of the material. `bytes` are not copied.
pub fn validate(bytes: Vec<u8>) -> Validation {
    let report = btf_runtime::validate(Arc::new(bytes), &parallel);
    let mut findings = report.findings.clone();
    findings.extend(report.material.iter().filter_map(|text| about_description(text)));
    findings.sort_by_key(Finding::severity);
    let of_sides = |[light, view]: [_; 2]| Side::ALL.into_iter().find(|side| sides_of_capture(*side) == (light, view));
    Validation {
        valid: report.is_valid(),
        error: findings.first().filter(|_| !report.is_valid()).map(Finding::to_string),
        layers: report.sides.iter().filter_map(|sides| of_sides(*sides)).map(|side| side.to_string()).collect(),
        counts: FindingCounts {
            error: report.count(Severity::Error),
            warning: findings.iter().filter(|finding| finding.severity() == Severity::Warning).count(),
            information: report.count(Severity::Information),
        },
        findings: findings.iter().map(FindingRecord::of).collect(),
    }
}

/// What may be said of the material's description. Decoders do without it, so it is no error.
fn about_description(text: &str) -> Option<Finding> {
    match serde_json::from_str::<Material>(text) {
        Err(error) => Some(Finding::new(rule::DESCRIPTION, error.to_string())),
        Ok(Material { error: None, .. }) => {
            Some(Finding::new(rule::NO_ERROR_FIGURES, "its key \"error\" is absent".into()))
        }
        Ok(_) => None,
    }
}

/// [`validate`] of a file.
///
/// # Errors
/// If it cannot be read; the message names it.
pub fn validate_file(path: &Path) -> Result<Validation, FitError> {
    read_file(path).map(validate)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::describe::describe;
    use crate::sample_asset::sample_asset;
    use btf_runtime::testing::FileParts;
    use btf_runtime::{Asset, pack};

    fn numbers(validation: &Validation, severity: &str) -> Vec<String> {
        let of_severity = validation.findings.iter().filter(|finding| finding.severity == severity);
        of_severity.map(|finding| finding.number.clone()).collect()
    }

    #[test]
    fn every_flipped_byte_and_every_cut_is_an_error() {
        let bytes = pack(&sample_asset()).unwrap();
        let good = validate(bytes.clone());
        assert!(good.valid && good.error.is_none() && good.layers == ["front"], "{good:?}");
        for at in (0..bytes.len()).step_by(7) {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x40;
            let found = validate(damaged);
            assert!(!found.valid && found.counts.error > 0 && found.layers.is_empty(), "byte {at}");
        }
        let tiers: Vec<usize> = describe(&bytes).unwrap().tiers.iter().map(|tier| tier.bytes as usize).collect();
        for length in (0..bytes.len()).step_by(13).filter(|length| !tiers.contains(length)) {
            assert!(!validate(bytes[..length].to_vec()).valid, "{length} bytes");
        }
    }

    #[test]
    fn every_damaged_section_is_named_with_its_place() {
        let bytes = pack(&sample_asset()).unwrap();
        let sections = btf_runtime::read_directory(&bytes).unwrap().sections;
        let mut damaged = bytes.clone();
        let chosen = [2, 5, sections.len() - 1];
        for at in chosen {
            damaged[sections[at].offset as usize] ^= 1;
        }
        let found = validate(damaged);
        assert_eq!(numbers(&found, "error"), ["SPMM1201"; 3]);
        for (finding, at) in found.findings.iter().zip(chosen) {
            assert_eq!(finding.section, Some(sections[at].name()));
            assert_eq!((finding.layer, finding.offset), (Some(0), Some(sections[at].offset.into())));
        }
    }

    #[test]
    fn a_description_that_is_not_understood_is_a_warning_as_are_missing_figures() {
        let material = |text: &str| pack(&Asset { material: text.into(), ..sample_asset() }).unwrap();
        let found = validate(material("not json"));
        assert!(found.valid && numbers(&found, "warning").contains(&"SPMM5201".into()), "{found:?}");
        let found = validate(material("{}"));
        assert!(numbers(&found, "warning").contains(&"SPMM5202".into()), "{found:?}");
        let json = serde_json::to_value(&found).unwrap();
        assert_eq!(json["counts"]["warning"].as_u64().unwrap() as usize, numbers(&found, "warning").len());
        assert!(json["findings"][0]["remedy"].is_string() && json["error"].is_null());
    }

    #[test]
    fn errors_come_alone() {
        let mut parts = FileParts::from_bytes(&pack(&sample_asset()).unwrap()).unwrap();
        parts.sections.remove(1);
        let found = validate(parts.to_bytes());
        assert_eq!(numbers(&found, "error"), ["SPMM1202"]);
        assert_eq!(found.findings.len(), 1);
        assert!(found.error.unwrap().contains("Layer 0 of layer 0"));
    }
}
