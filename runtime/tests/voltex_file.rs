//! Tests the files of volumetric textures: what is written is read, every damage is refused and named, and nothing
//! panics or allocates beyond what the bytes justify.

use btf_runtime::testing::{FileParts, Random, SectionPart, repair_header_checksum, sample_volume};
use btf_runtime::voltex::{
    LevelShadow, Sym3, VoltexError, VoltexSection, Volume, Voxel, read_voltex_directory, rule as own, validate,
};
use btf_runtime::{FormatError, Rule, Severity, rule, serial};

/// Rule of the description, which `btf-fit` checks: this package reads no JSON.
const OF_THE_DESCRIPTION: Rule = rule::DESCRIPTION;

fn sample() -> Volume {
    sample_volume(7, 6, 200)
}

fn parts_of(volume: &Volume) -> FileParts {
    FileParts::from_voltex_bytes(&volume.pack().unwrap()).unwrap()
}

fn set_word(bytes: &mut [u8], index: usize, value: u32) {
    bytes[4 * index..4 * index + 4].copy_from_slice(&value.to_le_bytes());
}

fn word(bytes: &[u8], index: usize) -> u32 {
    u32::from_le_bytes([0, 1, 2, 3].map(|i| bytes[4 * index + i]))
}

/// Returns the volume without the parts that quantisation changes: its voxels' matrices.
fn without_matrices(volume: &Volume) -> Volume {
    let mut bare = volume.clone();
    for level in &mut bare.levels {
        let others = level.others.iter_mut().map(|(_, voxel)| voxel);
        level.voxels.iter_mut().map(|(_, voxel)| voxel).chain(others).for_each(|voxel| {
            *voxel = Voxel::new(Sym3::default(), voxel.material);
        });
    }
    bare
}

#[test]
fn a_volume_is_read_as_it_was_written_and_written_as_it_was_read() {
    for (seed, levels, count) in [(1, 1, 1), (2, 2, 5), (3, 5, 300), (4, 13, 40), (5, 7, 3000)] {
        let volume = sample_volume(seed, levels, count);
        let bytes = volume.pack().unwrap();
        let read = Volume::parse(&bytes).unwrap();
        assert_eq!(without_matrices(&read), without_matrices(&volume));
        let microflakes =
            |volume: &Volume| volume.levels.iter().flat_map(|l| l.microflakes().copied()).collect::<Vec<_>>();
        for (given, got) in microflakes(&volume).iter().zip(microflakes(&read)) {
            // In shares of the largest entry, a few steps of the codes: codes.rs tests what is projected.
            let most = given.extinction.trace();
            for (a, b) in given.extinction.0.iter().zip(got.extinction.0) {
                assert!((a - b).abs() < 0.05 * most, "{given:?} {got:?}");
            }
            assert_eq!(got, Voxel::new(got.extinction, got.material), "its moment follows from its extinction");
        }
        assert!(read.pack().unwrap() == bytes, "written again it has other bytes");
        // Planted difference.
        assert!(sample_volume(seed + 100, levels, count).pack().unwrap() != bytes);
    }
}

#[test]
fn every_prefix_that_is_not_a_tier_is_refused_and_every_tier_is_the_coarser_volume() {
    let bytes = sample().pack().unwrap();
    let whole = Volume::parse(&bytes).unwrap();
    let tiers = read_voltex_directory(&bytes).unwrap().tiers;
    assert_eq!(tiers.len(), 6);
    for length in 0..=bytes.len() {
        let read = Volume::parse(&bytes[..length]);
        match tiers.iter().position(|tier| *tier as usize == length) {
            Some(tier) => {
                let coarser = Volume { levels: whole.levels[5 - tier..].to_vec(), ..whole.clone() };
                assert!(read == Ok(coarser), "tier {tier}");
            }
            None => {
                let refused = read.unwrap_err();
                let named = matches!(refused.0, FormatError::TooShort { .. } | FormatError::Length { .. });
                assert!(named, "{length} bytes: {refused}");
            }
        }
    }
    let longer = [&bytes[..], &[0]].concat();
    assert!(matches!(Volume::parse(&longer), Err(VoltexError(FormatError::Length { .. }))));
}

#[test]
fn every_flipped_byte_is_refused_in_the_file_and_in_every_tier() {
    let bytes = sample().pack().unwrap();
    assert!(Volume::parse(&bytes).is_ok(), "the control must pass");
    for length in read_voltex_directory(&bytes).unwrap().tiers {
        let mut damaged = bytes[..length as usize].to_vec();
        for at in 0..damaged.len() {
            for flip in [0x01, 0x80, 0xff] {
                damaged[at] ^= flip;
                assert!(Volume::parse(&damaged).is_err(), "byte {at} of {length} flipped by {flip:#x} was not seen");
                damaged[at] ^= flip;
            }
        }
    }
}

#[test]
fn messages_speak_of_volumetric_textures_in_one_sentence() {
    let bytes = sample().pack().unwrap();
    let with = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut damaged = bytes.clone();
        change(&mut damaged);
        Volume::parse(&damaged).unwrap_err().to_string()
    };
    assert_eq!(
        Volume::parse(b"SPMM and more").unwrap_err().to_string(),
        "this is not a volumetric texture (its first four bytes are [53, 50, 4d, 4d], not \"VTEX\"); make one with btf-fit voltex"
    );
    assert_eq!(
        with(&|bytes| set_word(bytes, 1, 2)),
        "the volumetric texture has format version 2, this program reads versions up to 1; build it again with btf-fit voltex or \
         update the program"
    );
    assert_eq!(
        with(&|bytes| bytes.truncate(1000)),
        format!(
            "the volumetric texture is cut off or has bytes appended: 1000 bytes, {} expected; copy it again",
            bytes.len()
        )
    );
    let last = bytes.len() - 20;
    assert_eq!(
        with(&|bytes| bytes[last] ^= 1),
        "section Level 5 of the volumetric texture is damaged (its checksum does not match); copy the file again"
    );
}

/// Returns a file after `change` of the section of a kind and index, with a correct checksum.
fn with_section(kind: VoltexSection, index: u32, change: impl Fn(&mut SectionPart)) -> Vec<u8> {
    let mut parts = parts_of(&sample());
    let wanted = |section: &&mut SectionPart| section.head[0] == kind as u32 && section.head[2] == index;
    change(parts.sections.iter_mut().find(wanted).expect("the sample has it"));
    parts.to_bytes()
}

fn with_word(kind: VoltexSection, index: u32, at: usize, value: u32) -> Vec<u8> {
    with_section(kind, index, |section| set_word(&mut section.bytes, at, value))
}

/// Returns a file with a changed word of header or tables.
fn with_head(index: usize, change: impl Fn(u32) -> u32) -> Vec<u8> {
    let mut bytes = sample().pack().unwrap();
    let old = word(&bytes, index);
    set_word(&mut bytes, index, change(old));
    repair_header_checksum(&mut bytes);
    bytes
}

const NAN: u32 = 0x7fc0_0000;

/// Returns a file whose finest level has a stream that the encoder never writes: the first found that breaks the rule.
fn broken_stream(wanted: Rule) -> Vec<u8> {
    let mut random = Random::new(3);
    for _ in 0..20_000 {
        let level = random.below(6) as u32;
        let forged = with_section(VoltexSection::Level, level, |section| {
            // Alike bytes are alike decisions; any others are soon in range.
            let mut random = random.clone();
            let length = section.bytes.len();
            let from = 44 + random.below(length - 44);
            let byte = [0, 255, random.bits() as u8][random.below(3)];
            section.bytes[from..].fill(byte);
            section.bytes.resize(random.below(2 * length).max(from + 1), byte);
        });
        random.bits();
        let found = Volume::parse(&forged).err().and_then(|error| error.rule());
        if found == Some(wanted) {
            return forged;
        }
    }
    panic!("{} was not brought up", wanted.id())
}

fn planted() -> Vec<(Rule, Vec<u8>)> {
    use VoltexSection::*;
    let volume = sample();
    let good = volume.pack().unwrap();
    let directory = read_voltex_directory(&good).unwrap();
    let table = |section: usize, field: usize| 20 + 8 * section + field;
    let tiers = 20 + 8 * directory.sections.len();
    let changed = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = good.clone();
        change(&mut bytes);
        bytes
    };
    let parted = |change: &dyn Fn(&mut FileParts)| {
        let mut parts = parts_of(&volume);
        change(&mut parts);
        parts.to_bytes()
    };
    let packed = |change: &dyn Fn(&mut Volume)| {
        let mut volume = volume.clone();
        change(&mut volume);
        volume.pack().unwrap()
    };
    let padded = directory.sections.iter().find(|entry| (entry.offset + entry.length) % 16 != 0).unwrap();
    let unknown = |flags| SectionPart { head: [999, 0, 0, flags], bytes: vec![1; 5], ends_tier: false };
    let mut list = vec![
        (rule::TOO_SHORT, good[..50].to_vec()),
        (rule::BAD_MAGIC, changed(&|bytes| bytes[0] = b'X')),
        (rule::VERSION, changed(&|bytes| bytes[4] = 2)),
        (rule::HEADER_CHECKSUM, changed(&|bytes| bytes[90] ^= 1)),
        (rule::LENGTH, good[..good.len() - 7].to_vec()),
        (rule::TIERS, with_head(tiers, |_| 1)),
        (rule::SECTION_START, with_head(table(2, 4), |offset| offset + 16)),
        (rule::SECTION_FLAGS, parted(&|parts| parts.sections[2].head[3] = 2)),
        (rule::SECTION_LAYER, parted(&|parts| parts.sections[2].head[1] = 1)),
        (rule::SECTION_BEYOND, with_head(table(2, 5), |_| u32::MAX)),
        (rule::PADDING_BEFORE, changed(&|bytes| bytes[(padded.offset + padded.length) as usize] = 1)),
        (rule::TIER_INSIDE, {
            let mut bytes = with_head(tiers, |length| length - 16);
            bytes.truncate(directory.tiers[0] as usize - 16);
            bytes
        }),
        (rule::SECTIONS_END, with_head(table(directory.sections.len() - 1, 5), |_| 0)),
        (rule::PADDING_AT_END, {
            // A volume whose last section does not fill its last sixteen bytes.
            let unfilled = (0..).map(|seed| sample_volume(seed, 3, 9).pack().unwrap()).find(|bytes| {
                let last = *read_voltex_directory(bytes).unwrap().sections.last().unwrap();
                !(last.offset + last.length).is_multiple_of(16)
            });
            let mut bytes = unfilled.unwrap();
            *bytes.last_mut().unwrap() = 1;
            bytes
        }),
        (rule::SECTION_CHECKSUM, changed(&|bytes| bytes[padded.offset as usize] ^= 1)),
        (rule::MISSING_SECTION, parted(&|parts| drop(parts.sections.remove(1)))),
        (rule::UNKNOWN_REQUIRED, parted(&|parts| parts.sections.insert(1, unknown(1)))),
        (rule::TWICE, parted(&|parts| parts.sections.insert(1, parts.sections[0].clone()))),
        (rule::ENDS_EARLY, with_section(Materials, 0, |section| section.bytes.truncate(8))),
        (rule::TOO_LONG, with_section(Level, 3, |section| section.bytes.push(0))),
        (rule::NOT_FINITE, with_word(Materials, 0, 1, 0x7c00_7c00)),
        (rule::NOT_UTF8, with_section(Description, 0, |section| section.bytes[0] = 0xff)),
        (own::MATERIAL_RANGE, with_word(Materials, 0, 1, 0x3c00_4000)),
        (own::SHADOW_RANGE, with_word(Level, 2, 0, NAN)),
        (own::NO_CHILD, broken_stream(own::NO_CHILD)),
        (own::VOXEL_RANGE, broken_stream(own::VOXEL_RANGE)),
        (own::NO_MATERIAL, {
            let mut parts = parts_of(&volume);
            // Material 2 is the last of three; of two it is none.
            parts.header[7] = 2;
            parts.sections[1].bytes.truncate(32);
            parts.to_bytes()
        }),
        (rule::TIER_AT_HAND, good[..directory.tiers[2] as usize].to_vec()),
        (rule::UNKNOWN_SKIPPED, parted(&|parts| parts.sections.insert(1, unknown(0)))),
        (
            rule::SECTION_UNUSED,
            parted(&|parts| {
                let mut another = parts.sections[0].clone();
                another.head[2] = 1;
                parts.sections.insert(1, another);
            }),
        ),
        (own::MATERIAL_UNUSED, packed(&|volume| volume.materials.push(volume.materials[0]))),
        (own::MATERIAL_GAINS, packed(&|volume| volume.materials[0].transmittance = [1.0; 3])),
    ];
    // Each word of the header that is the format's own.
    let fields = [(3, 1), (6, 0), (6, 14), (7, 0), (7, 65_537), (8, 4), (9, 0), (10, NAN), (11, 0x3f80_0001)];
    let more = [(14, 1), (15, 0), (15, 0x7f80_0000), (15, 0xbf80_0000), (16, 1), (19, 1)];
    list.extend(fields.into_iter().chain(more).map(|(at, value)| (rule::HEADER_FIELD, with_head(at, |_| value))));
    let shadows = [(0, 0xbf80_0000), (0, 1025f32.to_bits()), (3, NAN), (4, 0xc180_0001), (10, 1.5f32.to_bits())];
    list.extend(shadows.map(|(at, value)| (own::SHADOW_RANGE, with_word(Level, 0, at, value))));
    let clumpings = [(11, 0xc080_0001), (14, NAN), (16, 5f32.to_bits())];
    list.extend(clumpings.map(|(at, value)| (own::CLUMPING_RANGE, with_word(Level, 0, at, value))));
    let facets = [(17, 64.5f32.to_bits()), (24, NAN), (31, 0xc280_0001)];
    list.extend(facets.map(|(at, value)| (own::FACETS_RANGE, with_word(Level, 0, at, value))));
    let corrections = [(32, 64.5f32.to_bits()), (40, NAN), (57, 0xc280_0001)];
    list.extend(corrections.map(|(at, value)| (own::LIGHT_CORRECTION_RANGE, with_word(Level, 0, at, value))));
    let mut bricked = parts_of(&sample_volume(7, 9, 20));
    let level = bricked.sections.iter_mut().rfind(|section| section.head[0] == Level as u32).expect("it has levels");
    *level.bytes.last_mut().expect("it has counts") ^= 1;
    list.push((own::BRICK_COUNT, bricked.to_bytes()));
    let information = [rule::FORM, rule::TIERS_LISTED, own::VOXELS, own::MATERIALS, own::SIZE];
    list.extend(information.map(|rule| (rule, good.clone())));
    list
}

/// Returns the rule in this format's words.
fn in_own_words(rule: Rule) -> Rule {
    own::all().into_iter().find(|own| own.number == rule.number).expect("it is one of the format's")
}

#[test]
fn every_number_is_brought_up_by_a_planted_fault_and_errors_are_what_is_refused() {
    let of_good = validate(&sample().pack().unwrap(), &serial);
    assert!(of_good.is_valid() && of_good.material.is_some(), "{:?}", of_good.findings);
    let planted = planted();
    for (rule, bytes) in &planted {
        let rule = in_own_words(*rule);
        let report = validate(bytes, &serial);
        let Some(finding) = report.findings.iter().find(|finding| finding.rule == rule) else {
            panic!("{} ({}) is not among {:#?}", rule.id(), rule.message, report.findings)
        };
        assert_eq!(finding.to_string().lines().count(), 1, "{finding}");
        assert!(finding.to_string().contains(" VTEX"), "{finding}");
        let refused = Volume::parse(bytes).err();
        assert_eq!(refused.is_some(), rule.severity() == Severity::Error, "{finding}: {refused:?}");
        assert_eq!(report.is_valid(), refused.is_none(), "{finding}");
        if let Some(refused) = refused {
            assert_eq!(report.findings.first().map(|finding| finding.rule), refused.rule(), "{refused}");
            assert_eq!(refused.to_string().lines().count(), 1, "{refused}");
        }
        // Planted difference: a good file has no such error.
        assert!(rule.severity() != Severity::Error || of_good.findings.iter().all(|other| other.rule != rule));
    }
    for rule in own::all() {
        let known = planted.iter().any(|(planted, _)| planted.number == rule.number);
        assert!(known || rule.number == OF_THE_DESCRIPTION.number, "{} has no planted fault", rule.id());
    }
}

#[test]
fn random_words_in_any_section_are_read_safely_or_refused() {
    let parts = parts_of(&sample());
    let mut random = Random::new(1);
    let (mut read, mut refused) = (0, 0);
    for _ in 0..4000 {
        let mut forged = parts.clone();
        for _ in 0..1 + random.below(3) {
            let at = random.below(forged.sections.len());
            let bytes = &mut forged.sections[at].bytes;
            if bytes.is_empty() {
                continue;
            }
            let index = random.below(bytes.len());
            match random.below(4) {
                0 => bytes[index] = random.bits() as u8,
                1 => bytes[index] ^= 1 << random.below(8),
                2 => bytes.truncate(index),
                _ => bytes.extend((0..random.below(40)).map(|i| i as u8)),
            }
        }
        let forged = forged.to_bytes();
        match Volume::parse(&forged) {
            Ok(volume) => {
                read += 1;
                let voxels: usize = volume.levels.iter().map(|level| level.microflakes().count()).sum();
                assert!(voxels < 64 * forged.len(), "more voxels than the file has bytes for");
                let again = volume.pack().expect("what was read can be written");
                assert!(Volume::parse(&again).as_ref() == Ok(&volume), "and read again");
            }
            Err(_) => refused += 1,
        }
    }
    assert!(read > 50 && refused > 1000, "both outcomes must be tried: {read} read, {refused} refused");
}

#[test]
fn the_packer_refuses_every_volume_that_is_none() {
    type Change = fn(&mut Volume);
    let changes: [(&str, Change); 23] = [
        ("no levels", |v| v.levels.clear()),
        ("too many levels", |v| v.levels = vec![v.levels[5].clone(); 14]),
        ("no materials", |v| v.materials.clear()),
        ("too many materials", |v| v.materials = vec![v.materials[0]; 65_537]),
        ("a material that gains", |v| v.materials[1].reflectance[2] = 1.1),
        ("a material that is not finite", |v| v.materials[1].roughness = f32::NAN),
        ("no extent", |v| v.extent[1] = 0.0),
        ("too much extent", |v| v.extent[2] = 1.5),
        ("no side", |v| v.side_m = 0.0),
        ("an infinite side", |v| v.side_m = f32::INFINITY),
        ("two coarsest voxels", |v| v.levels = v.levels[..5].to_vec()),
        ("a voxel without parent", |v| {
            v.levels[2].voxels.remove(1);
        }),
        ("a voxel without child", |v| v.levels[0].voxels.clear()),
        ("voxels out of order", |v| v.levels[0].voxels.swap(0, 1)),
        ("a voxel twice", |v| {
            let first = v.levels[0].voxels[0];
            v.levels[0].voxels.insert(0, first);
        }),
        ("a voxel outside", |v| v.levels[5].voxels[0].0 = [1, 0, 0]),
        ("a voxel that is not finite", |v| v.levels[3].voxels[0].1.extinction.0[4] = f32::NAN),
        ("a voxel of less than nothing", |v| v.levels[3].voxels[0].1.extinction.0[2] = -1.0),
        ("a voxel too dense", |v| v.levels[3].voxels[0].1.extinction.0[0] = 1e20),
        ("an unknown material", |v| v.levels[3].voxels[0].1.material = 3),
        ("an unknown material of a second sort", |v| v.levels[0].others[1].1.material = 3),
        ("a second sort twice", |v| v.levels[0].others[1].0 = v.levels[0].others[0].0),
        ("a second sort of no voxel", |v| {
            let count = v.levels[0].voxels.len() as u32;
            v.levels[0].others.push((count, Voxel::default()));
        }),
    ];
    for (what, change) in changes {
        let mut volume = sample();
        change(&mut volume);
        let refused = volume.pack().unwrap_err();
        assert!(matches!(refused.0, FormatError::Pack { .. }), "{what}: {refused}");
        assert!(refused.to_string().starts_with("the volumetric texture cannot be packed: "), "{refused}");
    }
    let mut volume = sample();
    volume.levels[0].shadow = LevelShadow { offset: -1.0, ..LevelShadow::default() };
    assert!(volume.pack().is_err());
}

#[test]
fn the_document_lists_every_number_and_no_other() {
    let text = include_str!("../../docs/reference/voltex.md");
    let mut listed: Vec<(String, String, String)> = Vec::new();
    for line in text.lines().filter(|line| line.starts_with("| VTEX")) {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        listed.push((cells[0].into(), cells[1].into(), cells[2].into()));
    }
    let known = own::all().into_iter().map(|rule| (rule.id(), rule.message.to_string(), rule.remedy.to_string()));
    assert_eq!(listed, known.collect::<Vec<_>>());
    assert!(own::all().windows(2).all(|pair| pair[0].number < pair[1].number), "numbers rise and are used once");
}
