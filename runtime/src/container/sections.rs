//! Finds the sections of a file that are at hand, and reads their bytes front to back.

use crate::container::directory::Directory;
use crate::container::entropy::{Decoder, bounded, decode_plane};
use crate::container::fault::Faults;
use crate::container::file_format::FileFormat;
use crate::error::FormatError;
use crate::rule::{self, Rule};
use half::f16;
use std::collections::{HashMap, HashSet};
use std::marker::PhantomData;

/// A reader of a section's bytes, front to back.
#[derive(Clone)]
pub(crate) struct Reader<'a> {
    /// Name of the section, for messages.
    pub name: String,
    /// Bytes that are not yet read.
    pub bytes: &'a [u8],
}

impl<'a> Reader<'a> {
    pub(crate) fn bad<T>(&self, reason: Rule) -> Result<T, FormatError> {
        Err(FormatError::Section { section: self.name.clone(), reason })
    }

    pub(crate) fn take(&mut self, count: usize) -> Result<&'a [u8], FormatError> {
        if count > self.bytes.len() {
            return self.bad(rule::ENDS_EARLY);
        }
        let (head, tail) = self.bytes.split_at(count);
        self.bytes = tail;
        Ok(head)
    }

    pub(crate) fn words(&mut self, count: usize) -> Result<Vec<u32>, FormatError> {
        let bytes = count.checked_mul(4).map_or_else(|| self.bad(rule::ENDS_EARLY), Ok)?;
        Ok(self.take(bytes)?.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
    }

    /// Reads half-precision numbers, which are padded to a whole word. All must be finite.
    pub(crate) fn halves(&mut self, count: usize) -> Result<Vec<f16>, FormatError> {
        let padded = count.div_ceil(2).checked_mul(4).map_or_else(|| self.bad(rule::ENDS_EARLY), Ok)?;
        let all: Vec<f16> =
            self.take(padded)?.chunks_exact(2).map(|b| f16::from_bits(u16::from_le_bytes([b[0], b[1]]))).collect();
        if all.iter().any(|x| !x.is_finite()) {
            return self.bad(rule::NOT_FINITE);
        }
        if all[count..].iter().any(|x| x.to_bits() != 0) {
            return self.bad(rule::PADDING);
        }
        Ok(all[..count].to_vec())
    }

    /// Reads bytes, which are padded to a whole word.
    pub(crate) fn padded_bytes(&mut self, count: usize) -> Result<Vec<u8>, FormatError> {
        let all = self.take(count.next_multiple_of(4))?;
        if all[count..].iter().any(|byte| *byte != 0) {
            return self.bad(rule::PADDING);
        }
        Ok(all[..count].to_vec())
    }

    /// Reads quantisation steps. Each must be within 0 to `most`.
    pub(crate) fn steps(&mut self, count: usize, most: f32) -> Result<Vec<f32>, FormatError> {
        let steps: Vec<f32> = self.words(count)?.into_iter().map(f32::from_bits).collect();
        if steps.iter().all(|step| (0.0..=most).contains(step)) { Ok(steps) } else { self.bad(rule::STEP) }
    }

    /// Reads the remaining bytes as a coded plane of `count` numbers, `width` in a row.
    pub(crate) fn plane<T>(&mut self, count: usize, width: usize) -> Result<Vec<T>, FormatError>
    where
        T: Copy + Default + Into<i32> + TryFrom<i32>,
    {
        let bytes = self.take(self.bytes.len())?;
        decode_plane(bytes, count, width).or_else(|reason| self.bad(reason))
    }

    /// Reads the remaining bytes as `count` values, decoded by `code`.
    pub(crate) fn coded<T: Clone>(
        &mut self,
        count: usize,
        empty: T,
        code: impl FnOnce(&mut Decoder, &mut [T]),
    ) -> Result<Vec<T>, FormatError> {
        let bytes = self.take(self.bytes.len())?;
        bounded(count, bytes).or_else(|reason| self.bad(reason))?;
        let mut values = vec![empty; count];
        let mut decoder = Decoder::new(bytes);
        code(&mut decoder, &mut values);
        decoder.ended().or_else(|reason| self.bad(reason))?;
        Ok(values)
    }

    /// Returns the bytes as UTF-8.
    pub(crate) fn text(&self) -> Result<String, FormatError> {
        match std::str::from_utf8(self.bytes) {
            Ok(text) => Ok(text.to_string()),
            Err(_) => self.bad(rule::NOT_UTF8),
        }
    }

    pub(crate) fn end(&self) -> Result<(), FormatError> {
        if self.bytes.is_empty() { Ok(()) } else { self.bad(rule::TOO_LONG) }
    }
}

/// The sections that are present in the tier at hand, by kind, layer and index.
pub(crate) struct Sections<'a, F> {
    bytes: &'a [u8],
    entries: HashMap<(u32, u32, u32), (usize, usize)>,
    /// Sections with a wrong checksum. Their faults are already known, and they are not read.
    pub damaged: HashSet<(u32, u32, u32)>,
    /// True where the bytes are the whole file, so that every promised section must be there.
    pub whole: bool,
    format: PhantomData<F>,
}

impl<'a, F: FileFormat> Sections<'a, F> {
    pub(crate) fn new(bytes: &'a [u8], directory: &Directory<F::Head>, faults: &mut Faults) -> Self {
        let (mut entries, mut damaged) = (HashMap::new(), HashSet::new());
        for (number, entry) in directory.sections.iter().enumerate() {
            let (start, end) = (entry.offset as usize, entry.offset as usize + entry.length as usize);
            let key = (entry.kind, entry.layer, entry.index);
            if F::kind(entry.kind).is_none() || end > bytes.len() {
                continue;
            }
            if entries.insert(key, (start, end)).is_some() {
                faults.push(FormatError::Section { section: entry.name_in::<F>(), reason: rule::TWICE });
            }
            if directory.damaged.contains(&number) {
                damaged.insert(key);
            }
        }
        Sections { bytes, entries, damaged, whole: directory.is_whole(), format: PhantomData }
    }

    /// Returns a reader of a section; `None` where the section is absent or damaged.
    pub(crate) fn find(&self, kind: F::Kind, layer: u32, index: u32) -> Option<Reader<'a>> {
        let key = (F::number(kind), layer, index);
        let (start, end) = *self.entries.get(&key).filter(|_| !self.damaged.contains(&key))?;
        Some(Reader { name: F::section_name(kind, layer, index), bytes: self.bytes.get(start..end)? })
    }

    /// Returns a reader of a section like [`Sections::find`], and adds a fault if the section is absent.
    pub(crate) fn get(&self, kind: F::Kind, layer: u32, index: u32, faults: &mut Faults) -> Option<Reader<'a>> {
        if !self.entries.contains_key(&(F::number(kind), layer, index)) {
            faults.push(FormatError::MissingSection { section: F::section_name(kind, layer, index) });
        }
        self.find(kind, layer, index)
    }

    /// Returns a reader of a section that a coarser tier may lack. Its absence is a fault in a whole file only.
    pub(crate) fn get_in_tier(&self, kind: F::Kind, layer: u32, index: u32, faults: &mut Faults) -> Option<Reader<'a>> {
        if self.whole { self.get(kind, layer, index, faults) } else { self.find(kind, layer, index) }
    }

    /// Returns whether a section of the layer is damaged.
    pub(crate) fn damage_in(&self, layer: u32) -> bool {
        self.damaged.iter().any(|(_, of, _)| *of == layer)
    }
}
