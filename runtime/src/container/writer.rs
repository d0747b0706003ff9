//! Writes the container: header, tables and sections.

use crate::container::file_format::{
    FileFormat, HEADER_WORDS, MAX_SECTIONS, SECTION_ENTRY_WORDS, SECTION_REQUIRED, checksum, header,
};
use crate::error::FormatError;

/// A section that the packer is about to write.
pub(crate) struct SectionSource<K> {
    /// Kind of the section.
    pub kind: K,
    /// Number of the layer that the section belongs to; 0 for a section of the whole asset.
    pub layer: u32,
    /// Number of the section among those of its kind and layer.
    pub index: u32,
    /// Bytes of the section, without padding.
    pub bytes: Vec<u8>,
    /// True where a prefix of the file that ends after this section is a valid, coarser asset.
    pub ends_tier: bool,
}

/// Writes header, tables and sections. The last section always ends a tier.
///
/// Errors: no section or more than 4096 of them, a section or a file of more than 4 GiB.
pub(crate) fn write_file_of<F: FileFormat>(
    head: &F::Head,
    sections: &[SectionSource<F::Kind>],
) -> Result<Vec<u8>, FormatError> {
    let alignment = F::alignment(head);
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
            F::number(section.kind),
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
    F::write_head(head, &mut words);
    words[header::MAGIC] = u32::from_le_bytes(F::NAMES.magic);
    words[header::VERSION] = F::version(head);
    words[header::LENGTH_LOW] = total;
    words[header::SECTIONS] = sections.len() as u32;
    words[header::TIERS] = tiers.len() as u32;
    let tier_at = HEADER_WORDS + sections.len() * SECTION_ENTRY_WORDS;
    words[tier_at..tier_at + tiers.len()].copy_from_slice(&tiers);
    let hash = checksum(bytemuck::cast_slice(&words));
    words[header::CHECKSUM_LOW] = hash as u32;
    words[header::CHECKSUM_HIGH] = (hash >> 32) as u32;
    body[..tables_end].copy_from_slice(bytemuck::cast_slice(&words));
    Ok(body)
}
