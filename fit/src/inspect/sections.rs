//! Sizes of a file's sections by kind.

use btf_runtime::SectionEntry;
use serde::Serialize;

/// Bytes of one kind of section.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SectionSize {
    /// Name of the kind in FORMAT.md.
    pub kind: String,
    /// Number of sections.
    pub count: usize,
    /// Bytes of all of them, without padding.
    pub bytes: u64,
}

/// Returns the sizes by kind of the sections within the first `bytes` bytes, in the order of the file.
pub(crate) fn section_sizes(
    entries: &[SectionEntry],
    bytes: usize,
    kind_name: impl Fn(u32) -> Option<String>,
) -> Vec<SectionSize> {
    let mut sections: Vec<SectionSize> = Vec::new();
    for entry in entries.iter().filter(|entry| (entry.offset as usize) < bytes) {
        let kind = kind_name(entry.kind).unwrap_or(format!("kind {}", entry.kind));
        let at = sections.iter().position(|size| size.kind == kind).unwrap_or_else(|| {
            sections.push(SectionSize { kind, count: 0, bytes: 0 });
            sections.len() - 1
        });
        sections[at].count += 1;
        sections[at].bytes += u64::from(entry.length);
    }
    sections
}
