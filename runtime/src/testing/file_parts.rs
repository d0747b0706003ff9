//! Takes files apart, to be changed and put together again.

use crate::container::directory::Directory;
use crate::container::file_format::{ALIGNMENT, HEADER_WORDS, SECTION_ENTRY_WORDS, checksum};
use crate::error::FormatError;
use crate::file::format::{Form, header, read_directory};
use crate::voltex::{VoltexError, read_voltex_directory};

/// A section taken out of a file, to be changed and put back.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SectionPart {
    /// Kind number, layer, index and flags, as in the section table.
    pub head: [u32; 4],
    /// Bytes of the section, without padding.
    pub bytes: Vec<u8>,
    /// True where a tier ends behind the section.
    pub ends_tier: bool,
}

/// A file in parts. Putting the parts together computes offsets, lengths and checksums anew, so that a reader sees the
/// change and not the damage.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileParts {
    /// Words of the header; lengths, counts and checksum are overwritten.
    pub header: [u32; HEADER_WORDS],
    /// Sections in the order of the file.
    pub sections: Vec<SectionPart>,
}

impl FileParts {
    /// Takes a valid file, or a tier of one, apart. Errors: those of [`read_directory`].
    pub fn from_bytes(bytes: &[u8]) -> Result<FileParts, FormatError> {
        let directory = read_directory(bytes)?;
        Ok(FileParts::of(bytes, &directory, directory.head.form.alignment()))
    }

    /// Takes the file of a volumetric texture, or a tier of one, apart. Errors: those of [`read_voltex_directory`].
    pub fn from_voltex_bytes(bytes: &[u8]) -> Result<FileParts, VoltexError> {
        Ok(FileParts::of(bytes, &read_voltex_directory(bytes)?, ALIGNMENT))
    }

    fn of<H>(bytes: &[u8], directory: &Directory<H>, alignment: usize) -> FileParts {
        let mut header = [0; HEADER_WORDS];
        for (word, b) in header.iter_mut().zip(bytes.chunks_exact(4)) {
            *word = u32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        }
        let sections = directory
            .sections
            .iter()
            .filter(|entry| entry.offset as usize + entry.length as usize <= bytes.len())
            .map(|entry| {
                let (start, end) = (entry.offset as usize, (entry.offset + entry.length) as usize);
                SectionPart {
                    head: [entry.kind, entry.layer, entry.index, entry.flags],
                    bytes: bytes[start..end].to_vec(),
                    ends_tier: directory.tiers.contains(&(end.next_multiple_of(alignment) as u32)),
                }
            })
            .collect();
        FileParts { header, sections }
    }

    /// Puts the file together, with every derived number right.
    pub fn to_bytes(&self) -> Vec<u8> {
        let tiers = self.sections.iter().filter(|section| section.ends_tier).count();
        let tables_end = 4 * (HEADER_WORDS + self.sections.len() * SECTION_ENTRY_WORDS + tiers);
        let alignment =
            if self.header[header::FORM] == Form::Resident as u32 { Form::Resident } else { Form::File }.alignment();
        let mut words = self.header.to_vec();
        let mut body = vec![0; tables_end.next_multiple_of(alignment)];
        let mut ends = Vec::new();
        for section in &self.sections {
            let hash = checksum(&section.bytes);
            words.extend(section.head);
            words.extend([body.len() as u32, section.bytes.len() as u32, hash as u32, (hash >> 32) as u32]);
            body.extend_from_slice(&section.bytes);
            body.resize(body.len().next_multiple_of(alignment), 0);
            if section.ends_tier {
                ends.push(body.len() as u32);
            }
        }
        words.extend(ends);
        words[header::LENGTH_LOW] = body.len() as u32;
        words[header::LENGTH_HIGH] = 0;
        words[header::SECTIONS] = self.sections.len() as u32;
        words[header::TIERS] = tiers as u32;
        for (place, word) in body.chunks_exact_mut(4).zip(&words) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        repair_header_checksum(&mut body);
        body
    }
}

/// Corrects the header's checksum after a change to header or tables. A header whose counts reach beyond the file stays
/// as it is.
pub fn repair_header_checksum(bytes: &mut [u8]) {
    let word = |index: usize| u32::from_le_bytes([0, 1, 2, 3].map(|i| bytes[4 * index + i])) as usize;
    let (sections, tiers) = (word(header::SECTIONS), word(header::TIERS));
    let words = sections.saturating_mul(SECTION_ENTRY_WORDS).saturating_add(tiers).saturating_add(HEADER_WORDS);
    let Some(tables) = words.checked_mul(4).and_then(|end| bytes.get_mut(..end)) else {
        return;
    };
    tables[4 * header::CHECKSUM_LOW..][..8].fill(0);
    let hash = checksum(tables);
    tables[4 * header::CHECKSUM_LOW..][..8].copy_from_slice(&hash.to_le_bytes());
}
