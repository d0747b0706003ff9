//! The directories of a TIFF file: its pages with their tags, before anything of them is decoded.
//!
//! Everything that a tag points at is checked to lie within the file, so that nobody reads or allocates by a claim of
//! more.

use std::collections::BTreeMap;

use crate::images::bands::MAX_BANDS;

/// Most pages of a file: one for each band, and as many smaller ones.
const MAX_PAGES: usize = 2 * MAX_BANDS;

/// Most tags of a page; cameras write some dozens.
const MAX_TAGS: u64 = 256;

/// Most numbers of a tag, such as strips of an image. Each takes 8 bytes of memory.
pub(crate) const MAX_NUMBERS: usize = 1 << 18;

/// Tags by their numbers in the specification [TIFF 6.0], and those of GDAL.
pub(crate) mod tag {
    pub(crate) const NEW_SUBFILE_TYPE: u16 = 254;
    pub(crate) const WIDTH: u16 = 256;
    pub(crate) const LENGTH: u16 = 257;
    pub(crate) const BITS_PER_SAMPLE: u16 = 258;
    pub(crate) const COMPRESSION: u16 = 259;
    pub(crate) const PHOTOMETRIC: u16 = 262;
    pub(crate) const FILL_ORDER: u16 = 266;
    pub(crate) const STRIP_OFFSETS: u16 = 273;
    pub(crate) const SAMPLES_PER_PIXEL: u16 = 277;
    pub(crate) const ROWS_PER_STRIP: u16 = 278;
    pub(crate) const STRIP_BYTE_COUNTS: u16 = 279;
    pub(crate) const PLANAR_CONFIGURATION: u16 = 284;
    pub(crate) const PREDICTOR: u16 = 317;
    pub(crate) const TILE_WIDTH: u16 = 322;
    pub(crate) const TILE_LENGTH: u16 = 323;
    pub(crate) const TILE_OFFSETS: u16 = 324;
    pub(crate) const TILE_BYTE_COUNTS: u16 = 325;
    pub(crate) const EXTRA_SAMPLES: u16 = 338;
    pub(crate) const SAMPLE_FORMAT: u16 = 339;
    pub(crate) const GDAL_METADATA: u16 = 42112;
    pub(crate) const GDAL_NODATA: u16 = 42113;
}

/// A page's tags.
#[derive(Debug)]
pub(crate) struct Page<'a> {
    bytes: &'a [u8],
    pub is_big_endian: bool,
    entries: BTreeMap<u16, Entry>,
}

/// Value of a tag, which lies within the file.
#[derive(Debug)]
struct Entry {
    /// Size of a number in bytes.
    size: usize,
    /// Whether the numbers are whole and without a sign.
    is_whole: bool,
    count: usize,
    /// Place in the file in bytes.
    at: usize,
}

/// Reads a file's numbers.
#[derive(Clone, Copy)]
struct Reader<'a> {
    bytes: &'a [u8],
    is_big_endian: bool,
    /// Whether places have 64 bits, as in BigTIFF.
    is_wide: bool,
}

impl Reader<'_> {
    /// Returns the number of `size` bytes, at most 8, at `at`.
    fn number(&self, at: usize, size: usize) -> Result<u64, String> {
        let bytes = at.checked_add(size).and_then(|end| self.bytes.get(at..end)).ok_or("it is cut")?;
        Ok(whole(bytes, self.is_big_endian))
    }

    /// Returns the place at `at`.
    fn place(&self, at: usize) -> Result<usize, String> {
        let place = self.number(at, if self.is_wide { 8 } else { 4 })?;
        usize::try_from(place).map_err(|_| "it is cut".into())
    }

    /// Reads the entry at `at`, with its tag; `None` for one of an unknown type, which readers pass over.
    fn entry(&self, at: usize) -> Result<Option<(u16, Entry)>, String> {
        let (tag, kind) = (self.number(at, 2)? as u16, self.number(at + 2, 2)?);
        let size = match kind {
            1 | 2 | 6 | 7 => 1,
            3 | 8 => 2,
            4 | 9 | 11 | 13 => 4,
            5 | 10 | 12 | 16..=18 => 8,
            _ => return Ok(None),
        };
        let (count, value_at) = (self.place(at + 4)?, if self.is_wide { at + 12 } else { at + 8 });
        let length = count.checked_mul(size).ok_or_else(|| format!("its tag {tag} is longer than the file"))?;
        let at = if length <= if self.is_wide { 8 } else { 4 } { value_at } else { self.place(value_at)? };
        if at.checked_add(length).is_none_or(|end| end > self.bytes.len()) {
            return Err(format!("its tag {tag} is longer than the file"));
        }
        Ok(Some((tag, Entry { size, is_whole: matches!(kind, 1 | 3 | 4 | 16), count, at })))
    }
}

/// Returns the whole number in at most 8 bytes.
fn whole(bytes: &[u8], is_big_endian: bool) -> u64 {
    let add = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
    if is_big_endian { bytes.iter().fold(0, add) } else { bytes.iter().rev().fold(0, add) }
}

/// Returns the pages of a file, at least one.
pub(crate) fn pages(bytes: &[u8]) -> Result<Vec<Page<'_>>, String> {
    let is_big_endian = match bytes.get(..2) {
        Some(b"II") => false,
        Some(b"MM") => true,
        _ => return Err("it does not start like a TIFF file".into()),
    };
    let reader = Reader { bytes, is_big_endian, is_wide: false };
    let is_wide = match reader.number(2, 2)? {
        42 => false,
        43 if reader.number(4, 4)? == if is_big_endian { 0x8_0000 } else { 8 } => true,
        _ => return Err("it does not start like a TIFF file".into()),
    };
    let reader = Reader { is_wide, ..reader };
    let (count_size, entry_size) = if is_wide { (8, 20) } else { (2, 12) };
    let mut at = reader.place(if is_wide { 8 } else { 4 })?;
    let mut pages = Vec::new();
    while at != 0 {
        if pages.len() == MAX_PAGES {
            return Err(format!("it has more than {MAX_PAGES} pages, or they go round in a circle"));
        }
        let count = reader.number(at, count_size)?;
        if count > MAX_TAGS {
            return Err(format!("a page of it claims {count} tags; at most {MAX_TAGS} are allowed"));
        }
        let first = at + count_size;
        let mut entries = BTreeMap::new();
        for number in 0..count as usize {
            entries.extend(reader.entry(first + number * entry_size)?);
        }
        at = reader.place(first + count as usize * entry_size)?;
        pages.push(Page { bytes, is_big_endian, entries });
    }
    if pages.is_empty() { Err("it has no page".into()) } else { Ok(pages) }
}

impl Page<'_> {
    /// Returns the whole numbers of a tag; none where it is absent.
    pub(crate) fn numbers(&self, tag: u16) -> Result<Vec<u64>, String> {
        let Some(entry) = self.entries.get(&tag) else { return Ok(Vec::new()) };
        if !entry.is_whole {
            return Err(format!("its tag {tag} is of another type than whole numbers"));
        }
        if entry.count > MAX_NUMBERS {
            return Err(format!("its tag {tag} has {} numbers; at most {MAX_NUMBERS} are read", entry.count));
        }
        let bytes = &self.bytes[entry.at..][..entry.count * entry.size];
        Ok(bytes.chunks_exact(entry.size).map(|bytes| whole(bytes, self.is_big_endian)).collect())
    }

    /// Returns the number of a tag, of a list the first; `None` where it is absent.
    pub(crate) fn number(&self, tag: u16) -> Result<Option<u64>, String> {
        Ok(self.numbers(tag)?.first().copied())
    }

    /// Returns the text of a tag up to its end; `None` where it is absent.
    pub(crate) fn text(&self, tag: u16) -> Option<String> {
        let entry = self.entries.get(&tag).filter(|entry| entry.size == 1)?;
        let bytes = &self.bytes[entry.at..][..entry.count];
        let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
        Some(String::from_utf8_lossy(&bytes[..end]).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a file of one page with the tags `(tag, type, count, value)`.
    fn file(entries: &[(u16, u16, u32, u32)], next: u32) -> Vec<u8> {
        let mut bytes = b"II\x2a\0\x08\0\0\0".to_vec();
        bytes.extend((entries.len() as u16).to_le_bytes());
        for (tag, kind, count, value) in entries {
            bytes.extend(tag.to_le_bytes());
            bytes.extend(kind.to_le_bytes());
            bytes.extend(count.to_le_bytes());
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend(next.to_le_bytes());
        bytes
    }

    #[test]
    fn tags_are_found_within_the_entry_and_elsewhere() {
        let bytes = file(&[(256, 3, 1, 7), (258, 3, 2, 0x0010_0008), (270, 2, 6, 8), (273, 99, 1, 1)], 0);
        let pages = pages(&bytes).unwrap();
        assert_eq!(pages.len(), 1);
        assert_eq!(pages[0].numbers(256).unwrap(), [7]);
        assert_eq!(pages[0].numbers(258).unwrap(), [8, 16]);
        assert_eq!((pages[0].number(258).unwrap(), pages[0].number(273).unwrap()), (Some(8), None));
        assert!(pages[0].numbers(270).is_err() && pages[0].text(270).unwrap().starts_with('\u{4}'));
    }

    #[test]
    fn what_lies_outside_of_the_file_is_refused() {
        for (bytes, part) in [
            (file(&[(256, 4, 2, 40)], 0), "tag 256 is longer"),
            (file(&[(256, 4, u32::MAX, 8)], 0), "tag 256 is longer"),
            (file(&[(256, 3, 1, 7)], 8), "circle"),
            (file(&[(256, 3, 1, 7)], 4000), "cut"),
            (b"II\x2a\0\0\0\0\0".to_vec(), "no page"),
            (b"II\x2b\0\x08\0\0\0\x10\0\0\0\0\0\0\0\xff\xff\xff\xff\xff\xff\xff\xff".to_vec(), "tags"),
            (b"II\x2b\0\x04\0\0\0".to_vec(), "does not start"),
            (b"PNG".to_vec(), "does not start"),
        ] {
            let reason = pages(&bytes).unwrap_err();
            assert!(reason.contains(part), "{reason}");
        }
    }
}
