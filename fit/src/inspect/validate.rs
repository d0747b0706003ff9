//! Validation of files: the runtime's findings about the bytes, and this package's findings about the description of
//! the material or the volume. The numbers of the findings are those of docs/FINDINGS.md and docs/VOLTEX.md.

use crate::error::FitError;
use crate::input::layer_frame::sides_of_capture;
use crate::inspect::describe_voltex::is_voltex;
use crate::inspect::load::{parallel, read_file};
use crate::provenance::Material;
use btf_capture::Side;
use btf_runtime::{Finding, Report, Severity, rule, voltex};
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;

/// Result of a validation. The names are the keys of `validate --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Validation {
    /// Whether readers accept the file: no finding is an error.
    pub valid: bool,
    /// The first error in a sentence; `null` where the file is valid.
    pub error: Option<String>,
    /// Sides of the layers, in order; empty where the file is not valid.
    pub layers: Vec<String>,
    /// Summary of the contents for people; empty where the file is not valid.
    #[serde(skip)]
    pub holds: String,
    /// Errors in the order in which a reader meets them, then warnings, then information.
    pub findings: Vec<FindingRecord>,
    /// Number of findings of each severity.
    pub counts: FindingCounts,
}

/// A finding as one flat record.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FindingRecord {
    /// Severity: `error`, `warning` or `information`.
    pub severity: &'static str,
    /// Number of the finding, as `SPMM1201`.
    pub number: String,
    /// Sentence of the rule that is broken.
    pub message: &'static str,
    /// Detail of what was found.
    pub detail: String,
    /// Remedy.
    pub remedy: &'static str,
    /// Name of the section, where the finding is about one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub section: Option<String>,
    /// Layer, where the finding is about one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layer: Option<u32>,
    /// Offset in the file in bytes, where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<u64>,
    /// The whole finding in a line.
    #[serde(skip)]
    pub line: String,
}

/// Findings by severity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct FindingCounts {
    /// Number of errors.
    pub error: usize,
    /// Number of warnings.
    pub warning: usize,
    /// Number of findings for information.
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

/// Examines the asset in `bytes`, in either form, or the tier of one: header, tables, checksums, every section's
/// content, and the description of the material. `bytes` are not copied.
pub fn validate(bytes: Vec<u8>) -> Validation {
    let report = btf_runtime::validate(Arc::new(bytes), &parallel);
    let about = report.material.as_deref().and_then(about_description);
    let of_sides = |[light, view]: [_; 2]| Side::ALL.into_iter().find(|side| sides_of_capture(*side) == (light, view));
    let layers: Vec<String> =
        report.sides.iter().filter_map(|sides| of_sides(*sides)).map(|side| side.to_string()).collect();
    let word = if layers.len() == 1 { "layer" } else { "layers" };
    let holds = format!("{} {word} ({})", layers.len(), layers.join(", "));
    Validation::new(report, about, layers, holds)
}

/// Examines the volumetric texture in `bytes`, or the tier of one: header, tables, checksums, every section's content,
/// and the description.
pub fn validate_voltex(bytes: &[u8]) -> Validation {
    let report = voltex::validate(bytes, &parallel);
    let not_json = |text: &String| serde_json::from_str::<serde_json::Value>(text).err();
    let description = voltex::rule::all().into_iter().find(|own| own.number == rule::DESCRIPTION.number);
    let about = report.material.as_ref().and_then(not_json).zip(description);
    let about = about.map(|(error, rule)| Finding::new(rule, error.to_string()));
    let voxels = report.findings.iter().find(|finding| finding.rule == voltex::rule::VOXELS);
    let holds = voxels.map_or(String::new(), |finding| format!("voxels {}", finding.detail));
    Validation::new(report, about, Vec::new(), holds)
}

impl Validation {
    fn new(report: Report, about_description: Option<Finding>, layers: Vec<String>, holds: String) -> Validation {
        let mut findings = report.findings.clone();
        findings.extend(about_description);
        findings.sort_by_key(Finding::severity);
        Validation {
            valid: report.is_valid(),
            error: findings.first().filter(|_| !report.is_valid()).map(Finding::to_string),
            layers,
            holds: if report.is_valid() { holds } else { String::new() },
            counts: FindingCounts {
                error: report.count(Severity::Error),
                warning: findings.iter().filter(|finding| finding.severity() == Severity::Warning).count(),
                information: report.count(Severity::Information),
            },
            findings: findings.iter().map(FindingRecord::of).collect(),
        }
    }
}

/// Returns a finding about the material's description, if there is one. Decoders do without the description, so it is
/// no error.
fn about_description(text: &str) -> Option<Finding> {
    match serde_json::from_str::<Material>(text) {
        Err(error) => Some(Finding::new(rule::DESCRIPTION, error.to_string())),
        Ok(Material { error: None, .. }) => {
            Some(Finding::new(rule::NO_ERROR_FIGURES, "its key \"error\" is absent".into()))
        }
        Ok(_) => None,
    }
}

/// Examines a file by [`validate`] or [`validate_voltex`], as its first bytes say.
///
/// # Errors
/// If it cannot be read; the message names it.
pub fn validate_file(path: &Path) -> Result<Validation, FitError> {
    let bytes = read_file(path)?;
    Ok(if is_voltex(path, &bytes) { validate_voltex(&bytes) } else { validate(bytes) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::describe::describe;
    use crate::sample_asset::sample_asset;
    use btf_runtime::testing::{FileParts, sample_volume};
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
    fn a_volumetric_texture_is_examined_by_its_own_rules() {
        let bytes = sample_volume(2, 4, 30).pack().unwrap();
        let good = validate_voltex(&bytes);
        assert!(good.valid && good.holds.ends_with("in 4 levels, the finest first"), "{good:?}");
        assert_eq!(numbers(&good, "warning"), [""; 0]);
        let mut volume = sample_volume(2, 4, 30);
        volume.description = "not json".into();
        assert_eq!(numbers(&validate_voltex(&volume.pack().unwrap()), "warning"), ["VTEX5201"]);
        let mut damaged = bytes.clone();
        *damaged.last_mut().unwrap() ^= 1;
        let found = validate_voltex(&damaged);
        assert!(!found.valid && found.holds.is_empty() && numbers(&found, "error").len() == 1, "{found:?}");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.voltex");
        std::fs::write(&path, &bytes[..100]).unwrap();
        let error = validate_file(&path).unwrap().error.unwrap();
        assert!(error.starts_with("error VTEX1"), "{error}");
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
