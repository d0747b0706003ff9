//! Tests the bricks of volumetric textures' files: levels of more than 128 voxels a side are stored by brick, and bricks
//! are loaded one by one.

use btf_runtime::testing::{FileParts, Random, repair_header_checksum, sample_volume};
use btf_runtime::voltex::{
    BrickError, BrickedFile, NO_VOXEL, Voltex, VoltexSection, Volume, read_voltex_directory, rule as own, validate,
};
use btf_runtime::{Rule, Severity, rule, serial};
use std::ops::Range;

/// Returns what a file of these bytes has in a range.
fn part_of(bytes: &[u8], range: Range<u64>) -> std::io::Result<Vec<u8>> {
    let [start, end] = [range.start, range.end].map(|at| (at as usize).min(bytes.len()));
    Ok(bytes[start..end].to_vec())
}

/// Opens a file of these bytes.
fn opened(bytes: &[u8]) -> Result<BrickedFile, BrickError> {
    BrickedFile::open(&|range| part_of(bytes, range), bytes.len() as u64, &serial)
}

/// Loads bricks of a file of these bytes.
fn loaded(file: &BrickedFile, bytes: &[u8], finest: u32, levels: &[u32]) -> Result<Volume, BrickError> {
    file.load(&|range| part_of(bytes, range), finest, levels, &serial)
}

fn rule_of(error: &BrickError) -> Option<Rule> {
    match error {
        BrickError::Read(_) => None,
        BrickError::File(error) => error.rule(),
    }
}

#[test]
fn all_bricks_are_the_volume_and_no_bricks_are_a_tier() {
    for (levels, count) in [(1, 1), (4, 20), (8, 300), (9, 500), (10, 2000), (11, 300), (13, 60)] {
        let bytes = sample_volume(3, levels, count).pack().unwrap();
        let file = opened(&bytes).unwrap();
        let whole = Volume::parse(&bytes).unwrap();
        let finest = levels as u32 - 1;
        assert_eq!((file.finest_level(), whole.levels.len()), (finest, levels));
        assert_eq!(BrickedFile::is_one(&bytes[..80]), levels > 8);
        assert!(!BrickedFile::is_one(&bytes[..79]) && !BrickedFile::is_one(&[b"SPMM", &bytes[4..]].concat()));
        let everything = vec![finest; file.bricks().len()];
        assert!(loaded(&file, &bytes, finest, &everything).unwrap() == whole, "{levels} levels");
        let directory = read_voltex_directory(&bytes).unwrap();
        let bricks = directory.sections.iter().filter(|entry| entry.kind == VoltexSection::Brick as u32).count();
        assert_eq!(bricks, file.bricks().len() * levels.saturating_sub(8), "{levels} levels");
        for level in 0..finest {
            let tier = Volume::parse(&bytes[..directory.tiers[level as usize] as usize]).unwrap();
            assert!(loaded(&file, &bytes, level, &everything).unwrap() == tier, "level {level} of {levels}");
        }
        assert!(validate(&bytes, &serial).is_valid());
    }
}

#[test]
fn a_volume_in_part_has_what_is_loaded_and_coarser_voxels_elsewhere() {
    let mut random = Random::new(4);
    let bytes = sample_volume(5, 10, 3000).pack().unwrap();
    let file = opened(&bytes).unwrap();
    let bricks: Vec<[u32; 3]> = file.bricks().collect();
    let (mut finer, mut coarser) = (0, 0);
    for finest in [9, 8, 7, 6] {
        let whole = Voltex::new(&loaded(&file, &bytes, finest, &vec![finest; bricks.len()]).unwrap());
        let levels: Vec<u32> = bricks.iter().map(|_| 3 + random.below(7) as u32).collect();
        let volume = loaded(&file, &bytes, finest, &levels).unwrap();
        let part = Voltex::new(&volume);
        for voltex in [(&whole, vec![finest; bricks.len()]), (&part, levels.clone())] {
            assert_eq!(4 * voltex.0.words().len() as u64, file.resident_bytes(finest, &voltex.1), "{finest}");
        }
        assert!(part.words().len() < whole.words().len());
        for (at, _) in volume.levels[0].voxels.iter().take(500) {
            let brick = at.map(|x| x >> (finest - 3));
            let asked = levels[bricks.iter().position(|other| *other == brick).unwrap()];
            let level = BrickedFile::loaded_level(finest, asked);
            assert!(level >= asked.min(finest) && level == finest, "all voxels of the finest level are asked for");
        }
        for (brick, asked) in bricks.iter().zip(&levels) {
            let level = BrickedFile::loaded_level(finest, *asked);
            let q = brick.map(|x| (x << (finest - 3)) + random.below(1 << (finest - 3)) as u32);
            let [own, found] = [whole.cell(q, finest - level), part.cell(q, 0)];
            let words = |voltex: &Voltex, number: u32| (number != NO_VOXEL).then(|| voltex.voxel(number).words());
            if level < finest && own.voxel != NO_VOXEL {
                assert_eq!((found.size, words(&part, found.voxel)), (own.size, words(&whole, own.voxel)));
                coarser += 1;
            }
            finer += u32::from(level == finest);
        }
    }
    assert!(finer > 100 && coarser > 50, "{finer} {coarser}");
}

#[test]
fn damage_is_found_where_it_is_read() {
    let bytes = sample_volume(6, 10, 300).pack().unwrap();
    let file = opened(&bytes).unwrap();
    let directory = read_voltex_directory(&bytes).unwrap();
    let (mut first, last) = (None, directory.sections.last().unwrap());
    // The last brick, at the finest level.
    let mut damaged = bytes.clone();
    damaged[last.offset as usize + 3] ^= 1;
    let again = opened(&damaged).unwrap();
    let mut levels = vec![9; file.bricks().len()];
    let error = loaded(&again, &damaged, 9, &levels).unwrap_err();
    assert_eq!(rule_of(&error).map(|rule| rule.number), Some(rule::SECTION_CHECKSUM.number));
    assert!(error.to_string().contains("section Brick") && !error.to_string().contains('\n'), "{error}");
    *levels.last_mut().unwrap() = 7;
    assert!(loaded(&again, &damaged, 9, &levels).is_ok());
    // Any cut, and any byte of what has to be at hand.
    for length in (0..directory.tiers[7] as usize).step_by(97) {
        assert!(opened(&bytes[..length]).is_err(), "{length} bytes");
    }
    for length in (directory.tiers[7] as usize + 1..bytes.len()).step_by(997) {
        let error = opened(&bytes[..length]).err().filter(|_| !directory.tiers.contains(&(length as u32)));
        let number = error.as_ref().and_then(rule_of).map(|rule| rule.number);
        assert_eq!(number, Some(rule::LENGTH.number), "{length} bytes");
    }
    assert_eq!(
        opened(&[&bytes[..], &[0]].concat()).as_ref().err().and_then(rule_of).map(|rule| rule.number),
        Some(rule::LENGTH.number)
    );
    // A tier is the volume down to a coarser level.
    for (level, length) in directory.tiers.iter().enumerate() {
        let tier = &bytes[..*length as usize];
        let own = opened(tier).unwrap();
        assert_eq!(own.finest_level() as usize, level);
        let all = vec![9; own.bricks().len()];
        assert!(loaded(&own, tier, 9, &all).unwrap() == Volume::parse(tier).unwrap(), "tier {level}");
    }
    for at in (0..directory.tiers[7] as usize).step_by(31) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x80;
        first = first.or(opened(&damaged).err());
        assert!(opened(&damaged).is_err(), "byte {at}");
    }
    assert!(first.is_some());
}

#[test]
fn bricks_that_break_a_rule_are_refused_by_their_number() {
    let volume = sample_volume(6, 10, 300);
    let refused = |change: &dyn Fn(&mut FileParts)| {
        let mut parts = FileParts::from_voltex_bytes(&volume.pack().unwrap()).unwrap();
        change(&mut parts);
        let mut bytes = parts.to_bytes();
        repair_header_checksum(&mut bytes);
        let error = Volume::parse(&bytes).unwrap_err().rule().map(|rule| rule.number);
        let report = validate(&bytes, &serial);
        let first = report.findings.iter().find(|finding| finding.severity() == Severity::Error);
        assert_eq!(first.map(|finding| finding.rule.number), error);
        error
    };
    let at = |parts: &FileParts, kind: VoltexSection, nth: usize| {
        (0..parts.sections.len()).filter(|i| parts.sections[*i].head[0] == kind as u32).nth(nth).unwrap()
    };
    // One voxel more than there are, one word too few, and a brick that is not there.
    let counts = |parts: &mut FileParts| {
        let level = at(parts, VoltexSection::Level, 9);
        let own = &mut parts.sections[level].bytes;
        let word = own.len() - 8;
        own[word] ^= 1;
    };
    assert_eq!(refused(&counts), Some(own::BRICK_COUNT.number));
    let short = |parts: &mut FileParts| {
        let level = at(parts, VoltexSection::Level, 8);
        parts.sections[level].bytes.truncate(200);
    };
    assert_eq!(refused(&short), Some(rule::ENDS_EARLY.number));
    let long = |parts: &mut FileParts| {
        let level = at(parts, VoltexSection::Level, 8);
        parts.sections[level].bytes.extend([0; 4]);
    };
    assert_eq!(refused(&long), Some(rule::TOO_LONG.number));
    let missing = |parts: &mut FileParts| {
        let brick = at(parts, VoltexSection::Brick, 2);
        parts.sections[brick].head[2] += 1 << 20;
    };
    assert_eq!(refused(&missing), Some(rule::MISSING_SECTION.number));
}
