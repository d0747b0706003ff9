//! Tests that docs/reference/findings.md lists the number of every finding, and that a planted fault reports each.

use btf_runtime::testing::{
    FileParts, SectionPart, huge_asset, repair_header_checksum, ring_directions, sample_asset, sample_grouped_asset,
    sample_grouped_spectrum, sample_heights, sample_relief_asset, sample_spectral_asset,
};
use btf_runtime::{
    ASSET_LAYERS, Asset, Edit, Edits, FormatError, Levels, PackedGoal, PredictedGroup, Resident, ResidentFile,
    ResidualKind, Rule, SectionKind, Severity, Sphere, SurfaceSide, block, open, pack, read_directory, rule, serial,
    validate, with_levels,
};
use std::sync::Arc;

/// Rules of the description, which `btf-fit` checks: this package reads no JSON.
const OF_THE_DESCRIPTION: [Rule; 2] = [rule::DESCRIPTION, rule::NO_ERROR_FIGURES];

/// Returns an asset with two layers, heights, levels and edits.
fn sample() -> Asset {
    let mut asset = sample_asset(7, 6, 5, ResidualKind::Root);
    asset.layers[0].heights = Some(sample_heights(7, 30));
    asset.layers.push(asset.layers[0].clone());
    asset.layers[1].light_side = SurfaceSide::Back;
    asset.edits = Edits {
        list: vec![Edit { roughness: 2.0, ..Edit::default() }, Edit { specular: 0.5, ..Edit::default() }],
        texels: (0..30).map(|texel| (texel % 3) as u8).collect(),
    };
    with_levels(&asset, &serial)
}

fn parts_of(asset: &Asset) -> FileParts {
    FileParts::from_bytes(&pack(asset).unwrap()).unwrap()
}

fn set_word(bytes: &mut [u8], index: usize, value: u32) {
    bytes[4 * index..4 * index + 4].copy_from_slice(&value.to_le_bytes());
}

fn word(bytes: &[u8], index: usize) -> u32 {
    u32::from_le_bytes([0, 1, 2, 3].map(|i| bytes[4 * index + i]))
}

/// Returns the file of an asset after `change` of the first section of a kind, with a correct checksum.
fn with_section(asset: &Asset, kind: SectionKind, change: impl Fn(&mut SectionPart)) -> Vec<u8> {
    let mut parts = parts_of(asset);
    change(parts.sections.iter_mut().find(|section| section.head[0] == kind as u32).expect("the sample has it"));
    parts.to_bytes()
}

/// Returns the file of an asset with a changed word of a section.
fn with_word(asset: &Asset, kind: SectionKind, index: usize, value: u32) -> Vec<u8> {
    with_section(asset, kind, |section| set_word(&mut section.bytes, index, value))
}

/// Returns the file of an asset with a changed word of header or tables.
fn with_head(asset: &Asset, index: usize, change: impl Fn(u32) -> u32) -> Vec<u8> {
    let mut bytes = pack(asset).unwrap();
    let old = word(&bytes, index);
    set_word(&mut bytes, index, change(old));
    repair_header_checksum(&mut bytes);
    bytes
}

/// Returns a file whose last group has one byte for 1024 texels, each predicted from as many inputs as there can be.
fn too_slow() -> Vec<u8> {
    let mut asset = sample_grouped_asset(7, 32, 32, ResidualKind::Root);
    let residual = asset.layers[0].residual.as_mut().unwrap();
    residual.groups = vec![
        PredictedGroup { components: 3, inputs: [0; 4], own: 0 },
        PredictedGroup { components: 1, inputs: [4; 4], own: 3 },
    ];
    let mut parts = parts_of(&asset);
    let kind = SectionKind::PredictedCoefficients as u32;
    let section = parts.sections.iter_mut().rfind(|section| section.head[0] == kind).expect("there are two");
    section.bytes.truncate(4 * 8 + 1);
    parts.to_bytes()
}

fn resident_parts(asset: &Asset) -> FileParts {
    parts_of_words(Resident::from_asset(asset))
}

fn parts_of_words(resident: Resident) -> FileParts {
    let file = ResidentFile { resident, size_mm: None, seamless: [true; 2], material: "{}".into() };
    FileParts::from_bytes(&file.pack().unwrap()).unwrap()
}

/// Returns the resident form of an asset with words that `change` has changed.
fn with_words(asset: &Asset, change: impl Fn(&mut Vec<u32>)) -> Vec<u8> {
    with_words_of(resident_parts(asset), change)
}

/// Returns the resident form with packed bases of an asset with a changed word of them.
fn with_packed(asset: &Asset, offset: usize, value: impl Fn(u32) -> u32) -> Vec<u8> {
    let packed = Resident::packed_on(asset, PackedGoal::Noise(0.01), &serial);
    with_words_of(parts_of_words(packed), |words| {
        let at = words[words[ASSET_LAYERS] as usize + block::BASIS] as usize + offset;
        words[at] = value(words[at]);
    })
}

fn with_words_of(mut parts: FileParts, change: impl Fn(&mut Vec<u32>)) -> Vec<u8> {
    let mut words: Vec<u32> =
        (0..parts.sections[1].bytes.len() / 4).map(|i| word(&parts.sections[1].bytes, i)).collect();
    change(&mut words);
    parts.sections[1].bytes = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    parts.to_bytes()
}

/// Returns the resident form of an asset with a field of the first layer's block at a level set to `value`.
fn with_field(asset: &Asset, level: usize, field: usize, value: impl Fn(u32) -> u32) -> Vec<u8> {
    with_words(asset, |words| {
        let at = words[ASSET_LAYERS + 2 * level] as usize + field;
        words[at] = value(words[at]);
    })
}

/// Returns the resident form of an asset with a changed word, `offset` behind the one that a field of the first block
/// names.
fn with_part(asset: &Asset, field: usize, offset: usize, value: impl Fn(u32) -> u32) -> Vec<u8> {
    with_words(asset, |words| {
        let at = words[words[ASSET_LAYERS] as usize + field] as usize + offset;
        words[at] = value(words[at]);
    })
}

const FAR: u32 = 0xffff_ffc0;
const NAN: u32 = 0x7fc0_0000;

fn planted() -> Vec<(Rule, Vec<u8>)> {
    use SectionKind as Kind;
    let asset = sample();
    let (asset, good) = (&asset, pack(&asset).unwrap());
    let directory = read_directory(&good).unwrap();
    let (clusters, lobes) = (asset.layers[0].dictionary.len(), asset.layers[0].dictionary[0].len());
    let table = |section: usize, field: usize| 20 + 8 * section + field;
    let tiers = 20 + 8 * directory.sections.len();
    let changed = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = good.clone();
        change(&mut bytes);
        bytes
    };
    let parted = |change: &dyn Fn(&mut FileParts)| {
        let mut parts = parts_of(asset);
        change(&mut parts);
        parts.to_bytes()
    };
    let bare = |change: &dyn Fn(&mut Asset)| {
        let mut asset = sample_asset(3, 4, 3, ResidualKind::Root);
        asset.layers[0].residual = None;
        change(&mut asset);
        asset
    };
    let four = Sphere::new(&ring_directions(&[(40.0, 3)])).unwrap();
    let odd_ids = bare(&|asset| asset.layers[0].lights = four.clone());
    let padded = directory.sections.iter().find(|entry| (entry.offset + entry.length) % 16 != 0).unwrap();
    let section_0 = SectionPart { head: [999, 0, 0, 0], bytes: vec![1; 5], ends_tier: false };
    let small = bare(&|_| {});
    let without_grid = {
        let mut asset = asset.clone();
        asset.layers[0].lights = asset.layers[0].lights.without_grid();
        asset
    };
    let dictionaries = block::DICTIONARIES;
    let grouped = sample_grouped_asset(7, 12, 9, ResidualKind::Root);
    let mut list = vec![
        (rule::TOO_SHORT, good[..50].to_vec()),
        (rule::BAD_MAGIC, changed(&|bytes| bytes[0] = b'X')),
        (rule::VERSION, changed(&|bytes| bytes[4] = 4)),
        (rule::HEADER_CHECKSUM, changed(&|bytes| bytes[90] ^= 1)),
        (rule::HEADER_FIELD, with_head(asset, 7, |_| 0)),
        (rule::LENGTH, good[..good.len() - 7].to_vec()),
        (rule::TIERS, with_head(asset, tiers, |_| 1)),
        (rule::SECTION_START, with_head(asset, table(2, 4), |offset| offset + 16)),
        (rule::SECTION_FLAGS, parted(&|parts| parts.sections[2].head[3] = 2)),
        (rule::SECTION_LAYER, parted(&|parts| parts.sections[2].head[1] = 9)),
        (rule::SECTION_BEYOND, with_head(asset, table(2, 5), |_| u32::MAX)),
        (rule::PADDING_BEFORE, changed(&|bytes| bytes[(padded.offset + padded.length) as usize] = 1)),
        (rule::TIER_INSIDE, {
            let mut bytes = with_head(asset, tiers, |length| length - 16);
            bytes.truncate(directory.tiers[0] as usize - 16);
            bytes
        }),
        (rule::SECTIONS_END, with_head(asset, table(directory.sections.len() - 1, 5), |_| 0)),
        (rule::PADDING_AT_END, {
            let mut bytes = parted(&|parts| parts.sections.last_mut().unwrap().bytes = vec![9; 5]);
            *bytes.last_mut().unwrap() = 1;
            bytes
        }),
        (rule::SECTION_CHECKSUM, changed(&|bytes| bytes[directory.sections[4].offset as usize] ^= 1)),
        (rule::MISSING_SECTION, parted(&|parts| drop(parts.sections.remove(0)))),
        (
            rule::UNKNOWN_REQUIRED,
            parted(&|parts| {
                parts.sections.insert(1, SectionPart { head: [999, 0, 0, 1], ..section_0.clone() });
            }),
        ),
        (rule::TWICE, parted(&|parts| parts.sections.insert(1, parts.sections[0].clone()))),
        (rule::ENDS_EARLY, with_section(asset, Kind::Layer, |section| section.bytes.truncate(28))),
        (rule::TOO_LONG, with_section(asset, Kind::Layer, |section| section.bytes.extend([0; 4]))),
        (rule::PADDING, with_section(&odd_ids, Kind::Directions, |section| *section.bytes.last_mut().unwrap() = 1)),
        (rule::COUNT, with_word(asset, Kind::Layer, 4, 0)),
        (rule::NUMBER, with_word(asset, Kind::Edits, 1, NAN)),
        (rule::NOT_FINITE, with_word(asset, Kind::Factors, 8, 0x7c00)),
        (rule::STEP, with_word(asset, Kind::Basis, 0, NAN)),
        (rule::NOT_UTF8, with_section(asset, Kind::Material, |section| section.bytes = vec![0xff])),
        (rule::SIDE, with_word(asset, Kind::Layer, 0, 2)),
        (rule::RESIDUAL_KIND, with_word(asset, Kind::Layer, 2, 3)),
        (rule::EPSILON, with_word(asset, Kind::Layer, 3, 0)),
        (rule::SAME_SIDES, with_word(asset, Kind::Layer, 0, 1)),
        (rule::SET_SHORT, with_section(asset, Kind::Directions, |section| section.bytes.truncate(8))),
        (rule::SET_LENGTH, with_section(asset, Kind::Directions, |section| section.bytes.extend([0; 4]))),
        (rule::DIRECTION, with_word(asset, Kind::Directions, 3, 5f32.to_bits())),
        (
            rule::DIRECTION_NAMED,
            with_section(asset, Kind::Directions, |section| {
                let first = 4 * (3 + 3 * word(&section.bytes, 0) as usize);
                section.bytes[first..first + 4].fill(0xff);
            }),
        ),
        (
            rule::NO_AREA,
            with_section(asset, Kind::Directions, |section| {
                let first = 4 * (3 + 3 * word(&section.bytes, 0) as usize);
                section.bytes[first..first + 8].fill(0);
            }),
        ),
        (rule::NO_CLUSTER, with_word(asset, Kind::Layer, 4, 1)),
        (
            rule::NO_LOBE,
            with_section(asset, Kind::Dictionary, |section| {
                set_word(&mut section.bytes, 0, 1);
                section.bytes.drain(4 * clusters + 20..4 * clusters + lobes * 20);
            }),
        ),
        (rule::DICTIONARY_SIZE, with_word(asset, Kind::Dictionary, 0, 257)),
        (rule::LOBE_RANGE, with_word(asset, Kind::Dictionary, clusters, 99)),
        (rule::BASES_TOO_LARGE, with_word(&huge_asset(), Kind::Layer, 5, 63)),
        (rule::RANK, with_word(asset, Kind::Factors, 6, 1)),
        (rule::SHARED_COUNT, with_word(asset, Kind::SharedBases, 0, 1025)),
        (rule::GROUP, with_word(&grouped, Kind::PredictedCoefficients, 6, 1)),
        (rule::GROUP_EFFORT, too_slow()),
        (rule::EXPONENT, with_section(&grouped, Kind::FactorCodes, |section| section.bytes[32] = 25)),
        (rule::HEIGHT_STEP, with_word(asset, Kind::Height, 0, 0)),
        // A layer of guiding lobes with relief.
        (rule::RELIEF_ALONE, with_word(&sample_relief_asset(3, 9, 7), Kind::Layer, 7, 1)),
        (
            rule::LEVEL_LAYERS,
            parted(&|parts| {
                parts.sections.pop();
                parts.sections.last_mut().unwrap().ends_tier = true;
            }),
        ),
        (rule::LEVEL_COMPONENTS, with_word(asset, Kind::Level, 0, 100)),
        (rule::EDIT_COUNT, with_word(asset, Kind::Edits, 0, 0)),
        (rule::SPECTRUM, with_word(&sample_spectral_asset(3, 4, 3), Kind::Spectrum, 11, NAN)),
        (rule::LIGHT_GROUPS, with_word(&sample_grouped_spectrum(3, 4, 3), Kind::Directions, 3, 0.01f32.to_bits())),
        (
            rule::NO_EDIT,
            with_section(asset, Kind::Edits, |section| {
                set_word(&mut section.bytes, 0, 1);
                section.bytes.drain(4..40);
            }),
        ),
        (rule::EDITS_TOO_LARGE, {
            let many = bare(&|asset| {
                asset.layers[0].dictionary = vec![vec![asset.layers[0].dictionary[0][0]; 256]; 17];
                asset.edits = Edits { list: vec![Edit::default()], texels: vec![1; 12] };
            });
            with_section(&many, Kind::Edits, |section| {
                set_word(&mut section.bytes, 0, 255);
                let (edit, texels) = (section.bytes[4..40].to_vec(), section.bytes[40..].to_vec());
                section.bytes.truncate(4);
                section.bytes.extend(edit.repeat(255).into_iter().chain(texels));
            })
        }),
    ];
    let resident = |change: &dyn Fn(&mut FileParts)| {
        let mut parts = resident_parts(asset);
        change(&mut parts);
        parts.to_bytes()
    };
    list.extend([
        (rule::GRID_SIDE, with_part(asset, block::LIGHTS, 3, |_| 0)),
        (rule::TRIANGLE, with_part(asset, block::LIGHTS, 8 + 3 * 20, |_| NAN)),
        (
            rule::EDGE,
            with_words(asset, |words| {
                let at = words[words[ASSET_LAYERS] as usize + block::LIGHTS] as usize;
                let first = at + 8 + 3 * words[at] as usize + 12 * words[at + 1] as usize;
                words[first] = NAN;
            }),
        ),
        (
            rule::GRID_CELL,
            with_words(asset, |words| {
                let at = words[words[ASSET_LAYERS] as usize + block::LIGHTS] as usize;
                let first = at + 8 + 3 * words[at] as usize + 12 * words[at + 1] as usize + 8 * words[at + 2] as usize;
                words[first] = 1;
            }),
        ),
        (
            rule::GRID_ITEM,
            with_words(asset, |words| {
                let at = words[words[ASSET_LAYERS] as usize + block::LIGHTS] as usize;
                let cells = at + 8 + 3 * words[at] as usize + 12 * words[at + 1] as usize + 8 * words[at + 2] as usize;
                let side = words[at + 3] as usize;
                words[cells + side * side + 1] = 0x7fff_ffff;
            }),
        ),
        (rule::PIECES, resident(&|parts| parts.sections[1].head[2] = 1)),
        (rule::PIECE_LENGTH, resident(&|parts| parts.sections[1].bytes.truncate(1022))),
        (rule::WORDS_LENGTH, with_words(asset, |words| words[3] += 1)),
        (rule::WORDS_HEAD, with_words(asset, |words| words[0] += 1)),
        (rule::LEVEL_COUNT, with_words(asset, |words| words[4] = 99)),
        (rule::SPECTRUM_WORDS, with_words(&sample_spectral_asset(3, 4, 3), |words| words[6] = 64)),
        // A spectrum that the header does not tell.
        (rule::SPECTRUM_WORDS, {
            let mut bytes = with_words(&sample_spectral_asset(3, 4, 3), |_| {});
            set_word(&mut bytes, 10, 0);
            repair_header_checksum(&mut bytes);
            bytes
        }),
        (rule::ONE_TIER, resident(&|parts| parts.sections[0].ends_tier = true)),
        (rule::BLOCK_PLACE, with_words(asset, |words| words[ASSET_LAYERS] = 1)),
        (rule::BLOCK_SIDES, with_field(asset, 0, block::LIGHT_SIDE, |_| 2)),
        (rule::BLOCK_ORDER, with_words(asset, |words| words.swap(ASSET_LAYERS + 2, ASSET_LAYERS + 3))),
        (rule::BLOCK_SIZE, with_field(asset, 1, block::WIDTH, |width| width + 1)),
        (rule::BLOCK_PARAMETER, with_field(asset, 0, block::LOBE_ROLE, |_| 3)),
        (rule::BLOCK_PAIRS, with_field(asset, 0, block::PAIRS, |pairs| pairs + 1)),
        (rule::PART_START, with_field(asset, 0, block::RECORDS, |at| at + 1)),
        (rule::PART_BEYOND, with_field(asset, 0, block::RECORDS, |_| FAR)),
        // What decoders begin to look for is checked where nothing lies, too: a fuzzer's first find.
        (rule::PART_BEYOND, with_field(&small, 0, block::BASIS, |_| FAR)),
        (rule::SET_BEYOND, with_field(asset, 0, block::LIGHTS, |_| FAR)),
        (rule::GRID_CELLS, with_words(&without_grid, |_| {})),
        (rule::TABLE_BEYOND, with_field(asset, 0, dictionaries, |_| FAR)),
        (rule::DICTIONARY_PLACE, with_part(asset, dictionaries, 0, |_| FAR)),
        (rule::DICTIONARY_CONTENT, with_part(asset, dictionaries, clusters + 1, |_| 99)),
        (rule::RECORD, with_part(asset, block::RECORDS, 0, |record| record | 0xff)),
        (rule::NO_LOBE, with_part(asset, block::REFS, 0, |reference| reference | 0xff)),
        (rule::CHANNEL_WORDS, with_field(asset, 0, block::CHANNEL_WORDS, |_| 99)),
        (rule::PACKED_BASIS, with_packed(asset, 4 + 3 * clusters, |word| word | 0x7c00)),
        (rule::PACKED_BASIS, with_packed(asset, 4 + 3 * clusters, |word| word | 1 << 28)),
        (rule::PACKED_BASIS, with_packed(asset, 0, |_| NAN)),
        (rule::PACKED_ROWS, with_packed(asset, 5, |words| words + 1)),
        (rule::PACKED_ROWS, with_packed(asset, 4, |_| FAR)),
        (rule::PACKED_ROWS, with_packed(asset, 6, |words| words + 1)),
        (rule::PACKED_ROWS, with_packed(asset, 1, |bases| bases + 1)),
        (rule::CODE_WORDS, with_field(asset, 0, block::CODE_WORDS, |words| words + 1)),
        (rule::BASIS_NOT_FINITE, with_part(asset, block::BASIS, 5, |_| 0x7c00)),
        (rule::OTHER_BASES, with_field(asset, 1, block::BASIS, |at| at - 64)),
        (rule::EDITS_BEYOND, with_field(asset, 0, block::EDITS, |_| FAR)),
        (rule::EDITS_COUNTED, with_field(asset, 0, block::EDIT_COUNT, |_| 0)),
        (rule::EDIT_RANGE, with_part(asset, block::EDITS, 0, |_| NAN)),
        (
            rule::EDITED_DICTIONARY,
            with_words(asset, |words| {
                let list = words[words[ASSET_LAYERS] as usize + block::EDITS] as usize;
                let table = words[list + 4] as usize;
                words[table + 1] += 16;
            }),
        ),
        (rule::HEIGHT_RANGE, with_field(asset, 0, block::HEIGHT_STEP, |_| 0)),
        (rule::RELIEF_RANGE, with_field(&sample_relief_asset(3, 9, 7), 0, block::RELIEF_GLOSS, |_| 2.0f32.to_bits())),
    ]);
    // What is legal.
    list.extend([
        (rule::NO_SIZE, resident(&|_| {})),
        (rule::TIER_AT_HAND, good[..directory.tiers[2] as usize].to_vec()),
        (rule::UNKNOWN_SKIPPED, parted(&|parts| parts.sections.insert(2, section_0.clone()))),
        (
            rule::SECTION_UNUSED,
            parted(&|parts| {
                let head = [Kind::Basis as u32, 0, 77, 1];
                parts.sections.insert(1, SectionPart { head, ..section_0.clone() });
            }),
        ),
        (rule::CLUSTER_UNUSED, pack(&bare(&|asset| asset.layers[0].dictionary.push(Vec::new()))).unwrap()),
        (
            rule::LOBE_UNUSED,
            pack(&bare(&|asset| {
                let lobe = asset.layers[0].dictionary[0][0];
                asset.layers[0].dictionary[0].push(lobe);
            }))
            .unwrap(),
        ),
        (
            rule::TEXEL_BLACK,
            pack(&bare(&|asset| {
                let first = asset.layers[0].texel_lobe_counts[0];
                asset.layers[0].texel_lobe_counts[0] = 0;
                asset.layers[0].lobe_refs.drain(..usize::from(first));
            }))
            .unwrap(),
        ),
        (
            rule::EDIT_UNUSED,
            pack(&bare(&|asset| {
                asset.edits = Edits { list: vec![Edit::default(); 2], texels: vec![1; 12] };
            }))
            .unwrap(),
        ),
    ]);
    let information = [rule::FORM, rule::TEXELS, rule::LAYERS, rule::LEVELS, rule::TIERS_LISTED, rule::SEAMS];
    list.extend(information.map(|rule| (rule, good.clone())));
    list
}

fn opened(bytes: &[u8]) -> Option<FormatError> {
    open(Arc::new(bytes.to_vec()), Levels::AtHand, &serial).err()
}

#[test]
fn every_number_is_brought_up_by_a_planted_fault_and_errors_are_what_is_refused() {
    let good = pack(&sample()).unwrap();
    let of_good = validate(Arc::new(good), &serial);
    assert!(of_good.is_valid() && of_good.sides.len() == 2, "{:?}", of_good.findings);
    let planted = planted();
    for (rule, bytes) in &planted {
        let report = validate(Arc::new(bytes.clone()), &serial);
        let finding = report.findings.iter().find(|finding| finding.rule == *rule);
        let Some(finding) = finding else {
            panic!("{} ({}) is not among {:#?}", rule.id(), rule.message, report.findings)
        };
        assert_eq!(finding.to_string().lines().count(), 1, "{finding}");
        let refused = opened(bytes);
        assert_eq!(refused.is_some(), rule.severity() == Severity::Error, "{finding}: {refused:?}");
        assert_eq!(report.is_valid(), refused.is_none(), "{finding}");
        // Planted difference: a good file has no such error.
        assert!(rule.severity() != Severity::Error || of_good.findings.iter().all(|other| other.rule != *rule));
    }
    for rule in rule::ALL {
        let known = planted.iter().any(|(planted, _)| planted == rule) || OF_THE_DESCRIPTION.contains(rule);
        assert!(known, "{} has no planted fault", rule.id());
    }
}

#[test]
fn several_damaged_sections_are_all_named_and_the_intact_ones_are_read_on() {
    let asset = sample();
    let mut parts = parts_of(&asset);
    // Two broken rules far from each other, and a third section whose checksum is wrong.
    let at = |parts: &FileParts, kind: SectionKind, layer: u32| {
        parts.sections.iter().position(|section| section.head[..2] == [kind as u32, layer]).unwrap()
    };
    let (basis, heights, refs) =
        (at(&parts, SectionKind::Basis, 1), at(&parts, SectionKind::Height, 0), at(&parts, SectionKind::LobeRefs, 0));
    set_word(&mut parts.sections[basis].bytes, 0, NAN);
    set_word(&mut parts.sections[heights].bytes, 0, 0);
    let mut bytes = parts.to_bytes();
    let entries = read_directory(&bytes).unwrap().sections;
    bytes[entries[refs].offset as usize] ^= 1;
    let report = validate(Arc::new(bytes.clone()), &serial);
    let found: Vec<_> =
        report.findings.iter().map(|finding| (finding.rule, finding.section.clone().unwrap())).collect();
    let expected = [(rule::SECTION_CHECKSUM, refs), (rule::HEIGHT_STEP, heights), (rule::STEP, basis)];
    assert_eq!(found, expected.map(|(rule, at)| (rule, entries[at].name())));
    for (finding, (_, at)) in report.findings.iter().zip(expected) {
        assert_eq!((finding.layer, finding.offset), (Some(entries[at].layer), Some(entries[at].offset.into())));
    }
    assert_eq!(opened(&bytes).and_then(|error| error.rule()), Some(rule::SECTION_CHECKSUM));
}

#[test]
fn the_document_lists_every_number_and_no_other() {
    let text = include_str!("../../docs/reference/findings.md");
    let mut listed: Vec<(String, String, String)> = Vec::new();
    for line in text.lines().filter(|line| line.starts_with("| SPMM")) {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        listed.push((cells[0].into(), cells[1].into(), cells[2].into()));
    }
    let known = rule::ALL.iter().map(|rule| (rule.id(), rule.message.to_string(), rule.remedy.to_string()));
    assert_eq!(listed, known.collect::<Vec<_>>());
    assert!(rule::ALL.windows(2).all(|pair| pair[0].number < pair[1].number), "numbers rise and are used once");
}
