//! Executes the worked example of docs/reference/voltex.md: the example packs to the document's bytes, is read from them, and has
//! the document's words. A second reader, written in Python from the document alone, finds the same numbers in the
//! example and in random volumes, and refuses what this crate refuses.

mod document;

use btf_runtime::testing::{Random, sample_volume};
use btf_runtime::voltex::{
    Facets, LevelShadow, LightCorrection, MicroflakeMaterial, Sym3, Voltex, VoltexSection, Volume, VolumeLevel, Voxel,
    read_voltex_directory,
};
use document::{block, bytes_from_dump, output_of, python};
use half::f16;
use std::collections::BTreeMap;
use std::path::Path;

const DOCUMENT: &str = include_str!("../../docs/reference/voltex.md");

/// Builds the example: two levels, the finest with two voxels of two materials, the other with one around them.
fn example() -> Volume {
    let shadow = |offset| LevelShadow { offset, shared: [0.75, 0.5, 0.5, 0.25, 0.25, 0.0, 0.0, 0.0, 0.0, 0.0] };
    let voxel = |s, material| Voxel::new(Sym3(s), material);
    let leaf =
        MicroflakeMaterial { reflectance: [0.0625, 0.125, 0.03125], transmittance: [0.0625, 0.25, 0.03125], ..DULL };
    Volume {
        description: "{\"name\":\"example\"}".into(),
        side_m: 2.0,
        extent: [1.0, 1.0, 0.5],
        cyclic: [true, false],
        materials: vec![MicroflakeMaterial { reflectance: [0.125, 0.0625, 0.03125], ..DULL }, leaf],
        levels: vec![
            VolumeLevel {
                shadow: shadow(0.5),
                clumping: Sym3([-0.25, 0.0, 0.125, 0.0, 0.0, 0.0]),
                facets: Facets::default(),
                light_correction: LightCorrection::default(),
                voxels: vec![
                    ([1, 0, 0], voxel([4.0, 1.0, 1.0, 0.0, 0.0, 0.5], 1)),
                    ([1, 1, 0], voxel([0.0, 0.0, 16.0, 0.0, 0.0, 0.0], 0)),
                ],
                others: vec![(1, voxel([1.0, 4.0, 0.25, 0.0, 0.0, 0.0], 1))],
            },
            VolumeLevel {
                shadow: shadow(1.0),
                clumping: Sym3([-0.5, 0.0, 0.25, 0.0, 0.125, 0.0]),
                facets: Facets(std::array::from_fn(|i| if i < 6 { 0.5 } else { 0.0 })),
                light_correction: LightCorrection(std::array::from_fn(|i| if i < 3 { 0.125 } else { 0.0 })),
                voxels: vec![([0; 3], voxel([0.25, 0.0625, 0.5, 0.0, -0.125, 0.0], 1))],
                others: Vec::new(),
            },
        ],
    }
}

const DULL: MicroflakeMaterial =
    MicroflakeMaterial { reflectance: [0.0; 3], transmittance: [0.0; 3], specular: 0.03125, roughness: 0.5 };

#[test]
fn the_worked_example_is_what_it_says() {
    let bytes = bytes_from_dump(&block(DOCUMENT, "hexdump"));
    let packed = example().pack().unwrap();
    let rows = packed.chunks(16).enumerate().map(|(row, bytes)| {
        let hex: Vec<String> = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        format!("{:04x}  {}", 16 * row, hex.join(" "))
    });
    assert!(bytes == packed, "the example's bytes are\n{}", rows.collect::<Vec<_>>().join("\n"));
    let volume = Volume::parse(&bytes).unwrap();
    let voltex = Voltex::new(&volume);
    let words: Vec<u32> = block(DOCUMENT, "words")
        .iter()
        .flat_map(|line| line.split('|').next().unwrap_or("").split_whitespace().skip(1))
        .map(|word| u32::from_str_radix(word, 16).expect("a word in hex"))
        .collect();
    let rows = voltex.words().chunks(4).enumerate().map(|(row, words)| {
        let hex: Vec<String> = words.iter().map(|word| format!("{word:08x}")).collect();
        format!("{:<3} {}", 4 * row, hex.join(" "))
    });
    let alike = words.len() == voltex.words().len() && words.iter().zip(voltex.words()).all(|(a, b)| is_close(*a, *b));
    assert!(alike, "the example's words are\n{}", rows.collect::<Vec<_>>().join("\n"));
}

/// Returns whether two words are equal, or are halves that differ in their last bits: moments are computed in floating
/// point.
fn is_close(a: u32, b: u32) -> bool {
    let halves = |word: u32| [word as u16, (word >> 16) as u16].map(|half| f16::from_bits(half).to_f32());
    a == b || halves(a).iter().zip(halves(b)).all(|(x, y)| (x - y).abs() <= 2e-3 * x.abs())
}

/// Returns the numbers that the reader in Python prints, by name.
fn read_by_the_document(name: &str, bytes: &[u8]) -> BTreeMap<String, String> {
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.voltex"));
    std::fs::write(&file, bytes).expect("the file is written");
    let output = output_of(python("voltex_reader.py").arg(&file));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let pair = |line: &str| {
        let (name, numbers) = line.split_once(" =").expect("name = numbers");
        (name.to_string(), numbers.trim().to_string())
    };
    String::from_utf8(output.stdout).expect("UTF-8").lines().map(pair).collect()
}

/// Returns the numbers as this crate reads them, by name.
fn numbers_of(bytes: &[u8]) -> BTreeMap<String, Vec<f64>> {
    let volume = Volume::parse(bytes).unwrap();
    let directory = read_voltex_directory(bytes).unwrap();
    let head = directory.head;
    let wide = |numbers: &[f32]| numbers.iter().map(|x| f64::from(*x)).collect::<Vec<_>>();
    let flags = f64::from(u8::from(volume.cyclic[0]) + 2 * u8::from(volume.cyclic[1]));
    let mut all = BTreeMap::from([
        ("levels, materials, flags".to_string(), vec![head.levels.into(), head.materials.into(), flags]),
        ("extent, side".into(), wide(&[&volume.extent[..], &[volume.side_m]].concat())),
        ("tiers".into(), directory.tiers.iter().map(|tier| f64::from(*tier)).collect()),
    ]);
    let of_material =
        |m: &MicroflakeMaterial| [&m.reflectance[..], &m.transmittance, &[m.specular, m.roughness]].concat();
    all.insert("materials".into(), wide(&volume.materials.iter().flat_map(of_material).collect::<Vec<_>>()));
    for (index, level) in volume.levels.iter().rev().enumerate() {
        let shadow = [&[level.shadow.offset], &level.shadow.shared[..]].concat();
        all.insert(format!("level {index}: shadow"), wide(&shadow));
        all.insert(format!("level {index}: clumping"), wide(&level.clumping.0));
        all.insert(format!("level {index}: facets"), wide(&level.facets.0));
        all.insert(format!("level {index}: correction of light"), wide(&level.light_correction.0));
        for (i, (at, voxel)) in level.voxels.iter().enumerate() {
            let place = at.iter().chain([&voxel.material]).map(|x| f64::from(*x));
            let numbers = place.chain(wide(&voxel.extinction.0)).collect();
            all.insert(format!("level {index}: voxel {i}"), numbers);
        }
        for (number, voxel) in &level.others {
            let numbers = [f64::from(voxel.material)].into_iter().chain(wide(&voxel.extinction.0)).collect();
            all.insert(format!("level {index}: other {number}"), numbers);
        }
    }
    all
}

/// Returns whether the reader's lines have these numbers, within single precision's rounding of the largest of a line.
fn agree(lines: &BTreeMap<String, String>, numbers: &BTreeMap<String, Vec<f64>>) -> bool {
    let lines = lines.iter().filter(|(name, _)| *name != "description" && !name.starts_with("streams"));
    let read: BTreeMap<&String, Vec<f64>> = lines
        .map(|(name, line)| (name, line.split_whitespace().map(|x| x.parse().expect("a number")).collect()))
        .collect();
    read.len() == numbers.len()
        && read.iter().zip(numbers).all(|((name, a), (other, b))| {
            let most = b.iter().fold(0.0f64, |most, x| most.max(x.abs()));
            *name == other && a.len() == b.len() && a.iter().zip(b).all(|(x, y)| (x - y).abs() <= 1e-6 * most)
        })
}

#[test]
fn the_second_reader_finds_the_same_numbers() {
    let volumes = [
        example(),
        sample_volume(1, 1, 1),
        sample_volume(2, 4, 30),
        sample_volume(3, 6, 150),
        sample_volume(4, 10, 60),
    ];
    let files: Vec<Vec<u8>> = volumes.iter().map(|volume| volume.pack().unwrap()).collect();
    let tier = read_voltex_directory(&files[3]).unwrap().tiers[3] as usize;
    let bricked = read_voltex_directory(&files[4]).unwrap();
    // Of the last tier but one, which has bricks.
    let tiers = [files[3][..tier].to_vec(), files[4][..bricked.tiers[8] as usize].to_vec()];
    let all = [&files[..], &tiers].concat();
    let numbers: Vec<_> = all.iter().map(|bytes| numbers_of(bytes)).collect();
    for (i, bytes) in all.iter().enumerate() {
        let lines = read_by_the_document(&format!("same-{i}"), bytes);
        assert!(agree(&lines, &numbers[i]), "file {i}: {lines:?}");
        let is_stream = |kind: u32, index: u32| {
            kind == VoltexSection::Brick as u32 || (kind == VoltexSection::Level as u32 && index < 8)
        };
        let sections = read_voltex_directory(bytes).unwrap().sections;
        let at_hand = sections.iter().filter(|entry| (entry.offset as usize) < bytes.len());
        let streams = at_hand.filter(|entry| is_stream(entry.kind, entry.index)).count();
        assert_eq!(lines["streams, those that the encoder of the text makes again"], format!("{streams} {streams}"));
        assert!(lines["description"].starts_with('{'));
        // Planted differences: another file, and a number that is a little off.
        assert!(!agree(&lines, &numbers[(i + 1) % numbers.len()]));
        let mut planted = numbers[i].clone();
        planted.get_mut("level 0: voxel 0").unwrap()[4] *= 1.0 + 1e-4;
        assert!(!agree(&lines, &planted));
    }
}

#[test]
fn the_second_reader_refuses_what_this_one_does() {
    let good = sample_volume(5, 4, 40).pack().unwrap();
    let mut random = Random::new(6);
    let mut files = vec![good.clone(), good[..good.len() - 16].to_vec()];
    files.extend((0..60).map(|_| {
        let mut bytes = good.clone();
        let at = random.below(bytes.len());
        bytes[at] ^= 1 << random.below(8);
        bytes
    }));
    // Bricks, and a tier that ends among them is none.
    let bricked = sample_volume(5, 9, 20).pack().unwrap();
    let last = read_voltex_directory(&bricked).unwrap().sections.last().copied().unwrap();
    files.push(bricked.clone());
    files.push(bricked[..last.offset as usize].to_vec());
    // Behind the checksums.
    let parts = btf_runtime::testing::FileParts::from_voltex_bytes(&bricked).unwrap();
    files.extend((0..60).map(|_| {
        let mut forged = parts.clone();
        let sections = forged.sections.len();
        // What the bricks are behind.
        let bytes = &mut forged.sections[sections - 1 - random.below(20)].bytes;
        let at = random.below(bytes.len());
        bytes[at] = random.bits() as u8;
        forged.to_bytes()
    }));
    let parts = btf_runtime::testing::FileParts::from_voltex_bytes(&good).unwrap();
    files.extend((0..120).map(|_| {
        let mut forged = parts.clone();
        let bytes = &mut forged.sections[random.below(6)].bytes;
        let at = random.below(bytes.len());
        bytes[at] = random.bits() as u8;
        forged.to_bytes()
    }));
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let paths: Vec<_> = (0..files.len()).map(|i| folder.join(format!("refused-{i}.voltex"))).collect();
    for (path, bytes) in paths.iter().zip(&files) {
        std::fs::write(path, bytes).expect("the file is written");
    }
    let output = output_of(python("voltex_reader.py").args(&paths));
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(!text.contains("Traceback"), "{text}");
    let mut refused = 0;
    for (path, bytes) in paths.iter().zip(&files) {
        let by_the_document = text.contains(&format!("{} cannot be read", path.display()));
        let parsed = Volume::parse(bytes);
        assert_eq!(by_the_document, parsed.is_err(), "{}: {:?} {text}", path.display(), parsed.err());
        refused += usize::from(by_the_document);
    }
    assert!(refused > 60 && refused < files.len(), "{refused} of {}", files.len());
}
