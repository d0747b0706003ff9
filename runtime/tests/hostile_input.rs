//! Tests damaged, truncated and forged assets: each is refused by a named error or decodes to finite values. Nothing
//! may panic, and nothing may make the reader allocate beyond the file's size.

use btf_runtime::testing::{
    FileParts, Random, SectionPart, huge_asset, repair_header_checksum, sample_asset, sample_heights,
    sample_spectral_asset,
};
use btf_runtime::{
    Asset, DecodeOptions, Edit, Edits, FormatError, Interpolation, LevelTexels, Resident, ResidualKind, SectionKind,
    decode, pack, read_directory, rule, serial, with_levels,
};

/// Header words that the tests rewrite (docs/reference/format.md, "Header").
const VERSION_WORD: usize = 1;
const LENGTH_LOW_WORD: usize = 2;
const LENGTH_HIGH_WORD: usize = 3;
const SECTION_COUNT_WORD: usize = 4;
const TIER_COUNT_WORD: usize = 5;
const HEADER_WORDS: usize = 20;

fn sample_bytes(kind: ResidualKind) -> Vec<u8> {
    let mut asset = sample_asset(7, 6, 5, kind);
    asset.layers[0].heights = Some(sample_heights(7, 30));
    if kind == ResidualKind::Root {
        asset.spectrum = sample_spectral_asset(7, 6, 5).spectrum;
    }
    asset.edits = Edits {
        list: vec![Edit { tint: [0.5, 1.0, 2.0], roughness: 2.0, ..Edit::default() }],
        texels: (0..30).map(|texel| u8::from(texel % 4 == 0)).collect(),
    };
    pack(&with_levels(&asset, &serial)).expect("the sample can be packed")
}

fn set_word(bytes: &mut [u8], index: usize, value: u32) {
    bytes[4 * index..4 * index + 4].copy_from_slice(&value.to_le_bytes());
}

fn word(bytes: &[u8], index: usize) -> u32 {
    u32::from_le_bytes([0, 1, 2, 3].map(|i| bytes[4 * index + i]))
}

/// Builds the resident form and decodes some directions with every rule; asserts that all values are finite.
fn decode_everywhere(asset: &Asset, random: &mut Random) {
    let resident = Resident::from_asset(asset);
    for layer in 0..resident.layers() * resident.levels() {
        let of_level = &asset.layers[(layer % resident.layers()) as usize];
        let [width, height] = resident.size(layer).map(|side| side as usize);
        for _ in 0..8 {
            let (mut wi, mut wo) = (random.direction(), random.direction());
            for (z, side) in [(&mut wi[2], of_level.light_side), (&mut wo[2], of_level.view_side)] {
                *z *= if side as u32 == 1 { -1.0 } else { 1.0 };
            }
            let texel = random.below(width * height) as u32;
            for interpolation in [Interpolation::Fast, Interpolation::Exact] {
                let options = DecodeOptions { interpolation, ..DecodeOptions::default() };
                let value = decode(&resident, layer, texel, wi, wo, &options);
                assert!(value.iter().all(|x| x.is_finite() && *x >= 0.0), "{value:?}");
            }
        }
    }
}

/// Returns the bytes that a parsed asset holds in its arrays.
fn held_bytes(asset: &Asset) -> usize {
    let layer = |layer: &btf_runtime::Layer| {
        let residual = layer.residual.as_ref().map_or(0, |residual| {
            let factors: usize = residual.factors.view.iter().chain(&residual.factors.light).map(|m| 2 * m.len()).sum();
            let numbers = |steps: &[f32], values: &[i16]| 4 * steps.len() + 2 * values.len();
            let bases: usize = residual.bases.iter().map(|basis| numbers(&basis.steps, &basis.values)).sum();
            factors
                + numbers(&residual.shared.steps, &residual.shared.values)
                + bases
                + residual.coefficients.iter().map(|plane| plane.codes.len()).sum::<usize>()
        });
        let dictionary: usize = layer.dictionary.iter().map(|lobes| 24 + size_of_val(&lobes[..])).sum();
        let sets = 4 * (layer.lights.words().len() + layer.views.words().len());
        2 * layer.texel_clusters.len() + dictionary + 4 * layer.lobe_refs.len() + sets + residual
    };
    let texels = |texels: &LevelTexels| {
        2 * texels.clusters.len() + 4 * texels.lobe_refs.len() + texels.codes.iter().map(Vec::len).sum::<usize>()
    };
    let levels: usize = asset.levels.iter().flat_map(|level| &level.layers).map(texels).sum();
    asset.material.len() + asset.layers.iter().map(layer).sum::<usize>() + levels
}

#[test]
fn every_prefix_that_is_not_a_tier_is_refused_and_every_tier_decodes() {
    let bytes = sample_bytes(ResidualKind::Root);
    let tiers = read_directory(&bytes).unwrap().tiers;
    assert_eq!(tiers.len(), 7, "the lobes, the mean, four components, the levels");
    let mut random = Random::new(1);
    for length in 0..=bytes.len() {
        let parsed = Asset::parse(&bytes[..length]);
        match tiers.iter().position(|tier| *tier as usize == length) {
            Some(tier) => {
                let asset = parsed.unwrap();
                let bases = asset.layers[0].residual.as_ref().map_or(0, |residual| residual.bases.len());
                assert_eq!(bases, tier.min(5), "tier {tier} holds the lobes, the mean and {tier} - 1 components");
                assert_eq!(asset.levels.len(), if tier == 6 { 2 } else { 0 });
                decode_everywhere(&asset, &mut random);
            }
            None => {
                let refused = parsed.unwrap_err();
                let named = matches!(refused, FormatError::TooShort { .. } | FormatError::Length { .. });
                assert!(named, "{length} bytes: {refused}");
            }
        }
    }
    let mut longer = bytes.clone();
    longer.push(0);
    assert_eq!(
        Asset::parse(&longer),
        Err(FormatError::Length { expected: bytes.len() as u64, got: bytes.len() as u64 + 1 })
    );
}

#[test]
fn every_flipped_byte_is_refused() {
    let bytes = sample_bytes(ResidualKind::Additive);
    assert!(Asset::parse(&bytes).is_ok(), "the control must pass");
    let mut damaged = bytes.clone();
    for at in 0..bytes.len() {
        for flip in [0x01, 0x80, 0xff] {
            damaged[at] ^= flip;
            let refused = Asset::parse(&damaged);
            assert!(refused.is_err(), "byte {at} of {} flipped by {flip:#x} was not seen", bytes.len());
            damaged[at] ^= flip;
        }
    }
    assert_eq!(damaged, bytes);
}

#[test]
fn every_tier_sees_a_flipped_byte_as_the_whole_file_does() {
    let bytes = sample_bytes(ResidualKind::Log);
    for length in read_directory(&bytes).unwrap().tiers {
        let mut damaged = bytes[..length as usize].to_vec();
        for at in (0..damaged.len()).step_by(7) {
            damaged[at] ^= 0x10;
            assert!(Asset::parse(&damaged).is_err(), "byte {at} of tier {length}");
            damaged[at] ^= 0x10;
        }
    }
}

#[test]
fn each_damage_is_named() {
    let bytes = sample_bytes(ResidualKind::Log);
    let with = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut damaged = bytes.clone();
        change(&mut damaged);
        Asset::parse(&damaged).unwrap_err()
    };
    assert!(matches!(Asset::parse(&[]), Err(FormatError::TooShort { got: 0, .. })));
    assert!(matches!(with(&|b| b[0] = b'X'), FormatError::BadMagic { got: [b'X', b'P', b'M', b'M'] }));
    assert!(matches!(Asset::parse(b"PNG, or anything"), Err(FormatError::BadMagic { .. })));
    let version = with(&|b| set_word(b, VERSION_WORD, 4));
    assert_eq!(version, FormatError::Version { expected: 3, got: 4 });
    assert_eq!(
        version.to_string(),
        "the asset has format version 4, this program reads versions up to 3; fit the capture again or update the program"
    );
    assert_eq!(with(&|b| b[40] ^= 1), FormatError::HeaderChecksum);
    let last = bytes.len();
    let section = with(&|b| b[last - 32] ^= 1);
    assert!(
        matches!(&section, FormatError::SectionChecksum { section } if section == "Level 2 of layer 0"),
        "{section}"
    );
    // Behind the first section that does not end where the next one starts.
    let sections = read_directory(&bytes).unwrap().sections;
    let end = sections.iter().map(|entry| entry.offset + entry.length).find(|end| end % 16 != 0).unwrap();
    let padding = with(&|b| b[end as usize] = 1);
    assert!(padding.to_string().contains("padding"), "{padding}");
    for message in [version, section, padding] {
        assert_eq!(message.to_string().lines().count(), 1);
    }
}

#[test]
fn header_words_out_of_their_range_are_refused_though_the_checksum_is_right() {
    let bytes = sample_bytes(ResidualKind::Log);
    let mut random = Random::new(3);
    let tables = HEADER_WORDS + word(&bytes, SECTION_COUNT_WORD) as usize * 8 + word(&bytes, TIER_COUNT_WORD) as usize;
    let (mut read, mut refused) = (0, 0);
    for index in (1..tables).filter(|index| ![12, 13].contains(index)) {
        let old = word(&bytes, index);
        let few = [0, 1, 3, 5, 255, 256, 4096, 16_384, 1 << 31, u32::MAX, old ^ 1, old + 256, old.wrapping_sub(256)];
        let random_values: Vec<u32> = (0..8).map(|_| random.bits() as u32).collect();
        for value in few.into_iter().chain(random_values) {
            if value == old {
                continue;
            }
            let mut forged = bytes.clone();
            set_word(&mut forged, index, value);
            repair_header_checksum(&mut forged);
            match Asset::parse(&forged) {
                Ok(asset) => {
                    read += 1;
                    decode_everywhere(&asset, &mut random);
                }
                Err(_) => refused += 1,
            }
        }
    }
    // What may change unseen: whether a known section is required, and a tier that nobody asked for.
    assert!(refused > 20 * read && read > 0, "{read} read, {refused} refused");
    for (index, value) in [
        (LENGTH_LOW_WORD, 0),
        (LENGTH_HIGH_WORD, 1),
        (9, 4),
        (10, 1),
        (11, 1),
        (11, 8),
        (14, 1),
        (15, 0),
        (16, 0x7fc0_0000),
        (19, 1),
    ] {
        let mut forged = bytes.clone();
        set_word(&mut forged, index, value);
        repair_header_checksum(&mut forged);
        assert!(Asset::parse(&forged).is_err(), "header word {index} = {value}");
    }
}

#[test]
fn random_words_in_any_section_decode_safely_or_are_refused() {
    let (mut read, mut refused) = (0, 0);
    for (seed, kind) in [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root].into_iter().enumerate() {
        let bytes = sample_bytes(kind);
        let parts = FileParts::from_bytes(&bytes).unwrap();
        let mut random = Random::new(seed as u64);
        for _ in 0..2500 {
            let mut forged = parts.clone();
            for _ in 0..1 + random.below(3) {
                let at = random.below(forged.sections.len());
                let bytes = &mut forged.sections[at].bytes;
                if bytes.is_empty() {
                    continue;
                }
                let index = random.below(bytes.len());
                match random.below(6) {
                    0 => bytes[index] = random.bits() as u8,
                    1 => bytes[index] ^= 1 << random.below(8),
                    2 => bytes.truncate(index),
                    3 => bytes.extend((0..random.below(40)).map(|i| i as u8)),
                    _ => {
                        // A whole word: small counts, huge counts, floats that are none.
                        let value = match random.below(5) {
                            0 => random.below(300) as u32,
                            1 => u32::MAX - random.below(3) as u32,
                            2 => 0x7f80_0000 | random.below(2) as u32,
                            3 => random.within(-4.0, 4.0).to_bits(),
                            _ => random.bits() as u32,
                        };
                        let word = index / 4 * 4;
                        if let Some(place) = bytes.get_mut(word..word + 4) {
                            place.copy_from_slice(&value.to_le_bytes());
                        }
                    }
                }
            }
            let forged = forged.to_bytes();
            match Asset::parse(&forged) {
                Ok(asset) => {
                    read += 1;
                    // A coded byte holds at most 1024 numbers of two bytes.
                    assert!(held_bytes(&asset) < 2048 * forged.len(), "more is held than the file has bytes for");
                    decode_everywhere(&asset, &mut random);
                    let again = pack(&asset).expect("what was read can be written");
                    assert_eq!(Asset::parse(&again).as_ref(), Ok(&asset), "and read again");
                }
                Err(_) => refused += 1,
            }
        }
    }
    assert!(read > 500 && refused > 1000, "both outcomes must be tried: {read} read, {refused} refused");
}

fn unknown_section(flags: u32) -> SectionPart {
    SectionPart { head: [999, 0, 0, flags], bytes: b"from a later version".to_vec(), ends_tier: false }
}

#[test]
fn an_unknown_section_is_skipped_unless_it_is_required() {
    let bytes = sample_bytes(ResidualKind::Root);
    let expected = Asset::parse(&bytes).unwrap();
    let parts = FileParts::from_bytes(&bytes).unwrap();
    for at in [0, 3, parts.sections.len() - 1] {
        let mut optional = parts.clone();
        optional.sections.insert(at, unknown_section(0));
        assert_eq!(Asset::parse(&optional.to_bytes()).unwrap(), expected);
        let mut required = parts.clone();
        required.sections.insert(at, unknown_section(1));
        assert_eq!(Asset::parse(&required.to_bytes()), Err(FormatError::UnknownRequiredSection { kind: 999 }));
    }
}

#[test]
fn a_section_that_is_missing_doubled_or_promised_in_vain_is_named() {
    let bytes = sample_bytes(ResidualKind::Root);
    let (parts, whole) = (FileParts::from_bytes(&bytes).unwrap(), Asset::parse(&bytes).unwrap());
    for at in 0..parts.sections.len() {
        let mut missing = parts.clone();
        missing.sections.remove(at);
        let last = missing.sections.len() - 1;
        missing.sections[last].ends_tier = true;
        let [kind, layer, index, _] = parts.sections[at].head;
        let name = format!("{:?} {index} of layer {layer}", SectionKind::from_number(kind).unwrap());
        let read = Asset::parse(&missing.to_bytes());
        // An asset may do without these.
        let optional = [SectionKind::Height, SectionKind::Edits, SectionKind::Level].map(|kind| kind as u32);
        if optional.contains(&kind) {
            assert_ne!(read.expect("it is an asset without"), whole);
        } else {
            assert!(read == Err(FormatError::MissingSection { section: name.clone() }), "{name}");
        }

        let mut doubled = parts.clone();
        doubled.sections.insert(at, SectionPart { ends_tier: false, ..parts.sections[at].clone() });
        let refused = Asset::parse(&doubled.to_bytes());
        assert_eq!(refused, Err(FormatError::Section { section: name, reason: rule::TWICE }));
    }
}

#[test]
fn a_small_file_that_promises_a_huge_resident_form_is_refused() {
    // Rank 0 factors are free in the file, and the expanded bases are not.
    let asset = huge_asset();
    let fits = pack(&asset).expect("257 x 257 x 3 x 3 x 256 words are below the limit");
    let mut parts = FileParts::from_bytes(&fits).unwrap();
    // 63 components promised instead of 4: 32 words for each pair, channel and cluster.
    let layer = parts.sections.iter_mut().find(|section| section.head[0] == SectionKind::Layer as u32).unwrap();
    set_word(&mut layer.bytes, 5, 63);
    let refused = Asset::parse(&parts.to_bytes()).unwrap_err();
    assert!(refused.to_string().contains("1 GiB"), "{refused}");
}

#[test]
fn two_layers_of_the_same_sides_are_refused_though_the_checksums_are_right() {
    let mut asset = sample_asset(7, 3, 2, ResidualKind::Root);
    let front = asset.layers[0].clone();
    for (light_side, view_side) in [
        (btf_runtime::SurfaceSide::Back, btf_runtime::SurfaceSide::Back),
        (btf_runtime::SurfaceSide::Back, btf_runtime::SurfaceSide::Front),
        (btf_runtime::SurfaceSide::Front, btf_runtime::SurfaceSide::Back),
    ] {
        asset.layers.push(btf_runtime::Layer { light_side, view_side, ..front.clone() });
    }
    let good = pack(&asset).unwrap();
    assert_eq!(Asset::parse(&good).unwrap(), asset, "the control must pass");
    let mut parts = FileParts::from_bytes(&good).unwrap();
    let mut layers = parts.sections.iter_mut().filter(|section| section.head[0] == SectionKind::Layer as u32);
    // The third layer's light comes to the front.
    set_word(&mut layers.nth(2).unwrap().bytes, 0, 0);
    let refused = Asset::parse(&parts.to_bytes()).unwrap_err();
    assert_eq!(refused, FormatError::Section { section: "Layer 0 of layer 2".into(), reason: rule::SAME_SIDES });
}
