//! The resident form as a file: its words as they lie in memory, to be mapped, checked and bound without a copy.

use crate::asset::asset::{Asset, LobeRole};
use crate::container::directory::{Directory, SectionEntry, read_directory_of};
use crate::container::fault::Faults;
use crate::container::file_format::HEADER_WORDS;
use crate::container::writer::{SectionSource, write_file_of};
use crate::error::FormatError;
use crate::file::format::{Form, Head, MAGIC, PIECE_BYTES, SectionKind, Spmm, header, in_mm_range, version_of};
use crate::resident::check::{BrokenWords, check_resident};
use crate::resident::layout::SPECTRUM;
use crate::resident::resident::{Resident, ResidentBytes};
use crate::rule;
use crate::threads::Threads;
use std::ops::Range;

/// A resident asset with the contents of its file besides the words.
#[derive(Debug, Clone, PartialEq)]
pub struct ResidentFile {
    /// Words of the asset.
    pub resident: Resident,
    /// Physical size, as [`crate::Asset::size_mm`].
    pub size_mm: Option<[f32; 2]>,
    /// Edges that continue each other, as [`crate::Asset::seamless`].
    pub seamless: [bool; 2],
    /// Material description, as [`crate::Asset::material`].
    pub material: String,
}

impl ResidentFile {
    /// Returns whether these bytes begin like a file of the resident form.
    pub fn is_one(bytes: &[u8]) -> bool {
        read_form(bytes) == Some(Form::Resident as u32)
    }

    /// Expands an asset, with its levels and edits, on `threads`, like [`Resident::from_asset_on`].
    pub fn of_asset(asset: Asset, threads: Threads) -> ResidentFile {
        let resident = Resident::from_asset_on(&asset, threads);
        ResidentFile::with_words(asset, resident)
    }

    /// Returns the file of an asset whose resident form is `resident`.
    pub fn with_words(asset: Asset, resident: Resident) -> ResidentFile {
        ResidentFile { resident, size_mm: asset.size_mm, seamless: asset.seamless, material: asset.material }
    }

    /// Checks a file and uses its words where they lie: `bytes` are kept, and copied only if their address is no
    /// multiple of 4.
    ///
    /// Errors: as [`crate::Asset::parse`], by the rules of format.md, chapter "Resident form". Never panics. Cost: one
    /// hash of the bytes and one pass over the words; on `threads`.
    pub fn open(bytes: ResidentBytes, threads: Threads) -> Result<ResidentFile, FormatError> {
        let directory = read_directory_of::<Spmm>((*bytes).as_ref(), threads)?;
        if directory.head.form != Form::Resident {
            return Err(FormatError::Form { expected: "resident", got: "file" });
        }
        let mut faults = Faults::default();
        let file = examine_resident(bytes, &directory, threads, &mut faults);
        faults.or_first(file)
    }

    /// Returns the bytes of the file: header, tables, material description, words.
    ///
    /// Errors: words of more than 4 GiB, or a physical size out of its range.
    pub fn pack(&self) -> Result<Vec<u8>, FormatError> {
        let resident = &self.resident;
        if !self.size_mm.is_none_or(in_mm_range) {
            return Err(FormatError::Pack {
                reason: "its physical size must be above 0 mm and at most 1000000 mm".into(),
            });
        }
        let material = self.material.clone().into_bytes();
        let mut sections =
            vec![SectionSource { kind: SectionKind::Material, layer: 0, index: 0, bytes: material, ends_tier: false }];
        for (index, piece) in bytemuck::cast_slice::<u32, u8>(resident.words()).chunks(PIECE_BYTES).enumerate() {
            let (kind, index, bytes) = (SectionKind::Words, index as u32, piece.to_vec());
            sections.push(SectionSource { kind, layer: 0, index, bytes, ends_tier: false });
        }
        let is_new = |layer| resident.lobe_role(layer) == LobeRole::Base as u32 || resident.is_packed(layer);
        let head = Head {
            version: version_of(resident.is_spectral(), (0..resident.layers()).any(is_new)),
            form: Form::Resident,
            width: resident.width(),
            height: resident.height(),
            layers: resident.layers(),
            size_mm: self.size_mm,
            seamless: self.seamless,
            spectral: resident.is_spectral(),
        };
        write_file_of::<Spmm>(&head, &sections)
    }
}

/// Reads the asset in the resident form with this directory, and continues after a fault as far as more can be found.
/// Returns `None` if there is any fault.
pub(crate) fn examine_resident(
    bytes: ResidentBytes,
    directory: &Directory<Head>,
    threads: Threads,
    faults: &mut Faults,
) -> Option<ResidentFile> {
    let (all, head): (&[u8], Head) = ((*bytes).as_ref(), directory.head);
    if directory.tiers.len() > 1 {
        faults.push(FormatError::Section { section: "tier table".into(), reason: rule::ONE_TIER });
        return None;
    }
    let of_kind = |kind: SectionKind| directory.sections.iter().filter(move |entry| entry.kind == kind as u32);
    let damaged = |kind| directory.damaged.iter().any(|number| directory.sections[*number].kind == kind as u32);
    let place = faults.keep(words_place(&of_kind(SectionKind::Words).collect::<Vec<_>>()));
    let mut material = of_kind(SectionKind::Material).next();
    if material.is_none() {
        faults.push(FormatError::MissingSection { section: "Material 0 of layer 0".into() });
    }
    material = material.filter(|_| !damaged(SectionKind::Material));
    let material = material.and_then(|entry| {
        let text = &all[entry.offset as usize..(entry.offset + entry.length) as usize];
        let text = std::str::from_utf8(text).map(str::to_string);
        let not_text = |_| FormatError::Section { section: entry.name(), reason: rule::NOT_UTF8 };
        faults.keep(text.map_err(not_text))
    });
    let place = place.filter(|_| !damaged(SectionKind::Words))?;
    let first_byte = place.start as u64;
    let resident = Resident::from_bytes(bytes.clone(), place);
    let broken = check_resident(resident.words(), [head.width, head.height, head.layers], threads);
    for BrokenWords { rule: reason, block, word } in &broken {
        let section = match block {
            Some([level, layer]) => format!("Words, level {level} of layer {layer}"),
            None => "Words".into(),
        };
        let error = FormatError::Section { section, reason: *reason };
        // Where the block is, or the word that tells a place where none can be.
        let at = match (block, resident.words().get(*word)) {
            (Some(_), Some(at)) if (*at as usize) < resident.words().len() => *at as usize,
            _ => *word,
        } as u64;
        faults.push_at(error, block.map(|[_, layer]| layer), Some(first_byte + 4 * at));
    }
    let mut whole = broken.is_empty();
    if whole && resident.is_spectral() != head.spectral {
        let error = FormatError::Section { section: "Words".into(), reason: rule::SPECTRUM_WORDS };
        faults.push_at(error, None, Some(first_byte + 4 * SPECTRUM as u64));
        whole = false;
    }
    let file = ResidentFile { resident, size_mm: head.size_mm, seamless: head.seamless, material: material? };
    whole.then_some(file)
}

/// Returns the range of bytes of the words that these sections hold in pieces.
fn words_place(pieces: &[&SectionEntry]) -> Result<Range<usize>, FormatError> {
    let [first, ..] = pieces else {
        return Err(FormatError::MissingSection { section: "Words 0 of layer 0".into() });
    };
    let mut end = first.offset as usize;
    for (index, entry) in pieces.iter().enumerate() {
        let broken = |reason| Err(FormatError::Section { section: entry.name(), reason });
        let full = index + 1 == pieces.len() || entry.length as usize == PIECE_BYTES;
        if entry.index as usize != index || entry.layer != 0 || entry.offset as usize != end || !full {
            return broken(rule::PIECES);
        }
        if entry.length as usize > PIECE_BYTES || entry.length % 4 != 0 {
            return broken(rule::PIECE_LENGTH);
        }
        end += entry.length as usize;
    }
    Ok(first.offset as usize..end)
}

/// Returns the header word of the form; `None` for bytes that are no asset's.
fn read_form(bytes: &[u8]) -> Option<u32> {
    let word = |index: usize| bytes.get(4 * index..4 * index + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    (bytes.len() >= 4 * HEADER_WORDS && word(header::MAGIC)? == MAGIC).then(|| word(header::FORM))?
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::asset::Asset;
    use crate::asset::edit::{Edit, Edits};
    use crate::asset::residual::ResidualKind;
    use crate::decode::evaluate::{Query, density, evaluate, sample};
    use crate::decode::options::{DecodeOptions, Interpolation};
    use crate::levels::levels::with_levels;
    use crate::pack;
    use crate::resident::layout::{ASSET_WORDS, PART_WORDS};
    use crate::testing::{FileParts, Random, sample_asset, sample_heights};
    use crate::threads::serial;
    use std::sync::Arc;

    fn sample_file() -> ResidentFile {
        let mut asset = sample_asset(5, 12, 10, ResidualKind::Root);
        asset.layers[0].heights = Some(sample_heights(4, 120));
        asset.edits = Edits {
            list: vec![Edit { tint: [0.5, 1.0, 2.0], roughness: 2.0, ..Edit::default() }],
            texels: (0..120).map(|texel| u8::from(texel % 3 == 0)).collect(),
        };
        let asset = with_levels(&asset, &serial);
        ResidentFile {
            resident: Resident::from_asset(&asset),
            size_mm: asset.size_mm,
            seamless: asset.seamless,
            material: asset.material,
        }
    }

    fn open(bytes: Vec<u8>) -> Result<ResidentFile, FormatError> {
        ResidentFile::open(Arc::new(bytes), &serial)
    }

    #[test]
    fn a_resident_file_comes_back_as_it_was_written() {
        let file = sample_file();
        let bytes = file.pack().unwrap();
        assert!(ResidentFile::is_one(&bytes));
        let mut read = open(bytes.clone()).unwrap();
        assert_eq!(read, file);
        assert_eq!(read.pack().unwrap(), bytes, "same asset, same bytes");
        // What is mapped is copied when it is changed.
        read.resident.set_edits(&Edits::default(), &sample_asset(5, 12, 10, ResidualKind::Root).layers);
        assert_ne!(read, file);
        // Neither form is taken for the other.
        assert!(matches!(Asset::parse(&bytes), Err(FormatError::Form { .. })));
        let other = pack(&sample_asset(5, 12, 10, ResidualKind::Root)).unwrap();
        assert!(!ResidentFile::is_one(&other));
        assert!(matches!(open(other), Err(FormatError::Form { .. })));
    }

    #[test]
    fn every_prefix_and_every_changed_byte_is_refused() {
        let bytes = sample_file().pack().unwrap();
        for length in (0..bytes.len()).step_by(997).chain([4, 79, 80, 200, bytes.len() - 1]) {
            assert!(open(bytes[..length].to_vec()).is_err(), "{length}");
        }
        for at in (0..bytes.len()).step_by(613).chain(0..300) {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x10;
            assert!(open(damaged).is_err(), "byte {at}");
        }
    }

    #[test]
    fn forged_words_are_refused_or_harmless() {
        let bytes = sample_file().pack().unwrap();
        let parts = FileParts::from_bytes(&bytes).unwrap();
        let words = sample_file().resident.words().len();
        let mut random = Random::new(17);
        let (mut refused, mut harmless) = (0, 0);
        for i in 0..3000 {
            let mut forged = parts.clone();
            // Half of the changes where offsets and counts are.
            let blocks = ASSET_WORDS + 2 * PART_WORDS;
            let at = if i % 2 == 0 { random.below(blocks) } else { random.below(words) };
            let value = match random.below(5) {
                0 => 0,
                1 => u32::MAX,
                2 => random.below(words) as u32,
                3 => 0x7fc0_0000,
                _ => random.bits() as u32,
            };
            forged.sections[1].bytes[4 * at..4 * at + 4].copy_from_slice(&value.to_le_bytes());
            let Ok(file) = open(forged.to_bytes()) else {
                refused += 1;
                continue;
            };
            harmless += 1;
            let resident = &file.resident;
            for _ in 0..20 {
                let uv = [random.within(0.0, 1.0), random.within(0.0, 1.0)];
                let (wi, wo) = (random.direction(), random.direction());
                let interpolation = [Interpolation::Fast, Interpolation::Exact][random.below(2)];
                let options = DecodeOptions { interpolation, ..DecodeOptions::default() };
                let level = random.below(resident.levels() as usize) as u32;
                let query = Query { uv, wi, wo };
                let value = evaluate(resident, level, &query, &options);
                assert!(value.iter().all(|x| x.is_finite()), "word {at} = {value:?}");
                assert!(density(resident, level, &query, &options).is_finite());
                sample(resident, level, uv, wo, [0.1, 0.7, 0.4], &options);
            }
        }
        assert!(refused > 500 && harmless > 500, "{refused} {harmless}");
    }
}
