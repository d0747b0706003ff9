//! Runs the fuzz targets' corpora on any toolchain: each input, and some thousand mutations of them, as a fuzzer would.
//! `cargo xtask fuzz` runs libFuzzer, which is guided by coverage.

#[path = "../fuzz/src/lib.rs"]
#[allow(dead_code, unused_imports, reason = "what libFuzzer calls is not called here")]
mod fuzz;

use btf_runtime::testing::Random;
use btf_runtime::voltex::Volume;
use btf_runtime::{Asset, Severity, serial, validate};
use std::path::Path;
use std::sync::Arc;

/// Largest number of bytes of a mutated input.
const MAX_BYTES: usize = 32 << 10;

fn corpus(target: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(target);
    let mut paths: Vec<_> =
        std::fs::read_dir(folder).expect("the corpus is there").map(|e| e.unwrap().path()).collect();
    paths.sort();
    assert!(paths.len() >= 10, "{target}: {} inputs", paths.len());
    paths.iter().map(|path| std::fs::read(path).unwrap()).collect()
}

/// Changes, inserts or removes some bytes: a simple byte mutator.
fn change_bytes(random: &mut Random, bytes: &mut Vec<u8>, most: usize) {
    let at = random.below(bytes.len() + 1);
    match random.below(4) {
        0 if at < bytes.len() => bytes[at] = random.bits() as u8,
        1 if at < bytes.len() => bytes[at] ^= 1 << random.below(8),
        2 => bytes.truncate(at),
        _ if bytes.len() < most => bytes.insert(at, random.bits() as u8),
        _ => {}
    }
}

fn mutated(inputs: &[Vec<u8>], count: usize, seed: u64) -> impl Iterator<Item = Vec<u8>> {
    let mut random = Random::new(seed);
    (0..count).map(move |_| {
        let (input, seed) = (random.below(inputs.len()), random.bits());
        fuzz::mutate(&inputs[input], seed, MAX_BYTES, &mut |bytes, most| change_bytes(&mut random, bytes, most))
    })
}

fn replay(target: fn(&[u8]), inputs: &[Vec<u8>], mutations: usize) {
    inputs.iter().for_each(|input| target(input));
    mutated(inputs, mutations, 1).for_each(|input| target(&input));
}

#[test]
fn anything_is_refused_or_decodes_to_finite_values() {
    replay(fuzz::parse, &corpus("parse"), 4000);
}

#[test]
fn anything_is_refused_as_a_resident_form_or_evaluates_to_finite_values() {
    replay(fuzz::resident, &corpus("resident"), 4000);
}

#[test]
fn what_is_packed_is_parsed_as_it_was() {
    let inputs = corpus("round_trip");
    inputs.iter().for_each(|input| fuzz::round_trip(input));
    let mut random = Random::new(2);
    for _ in 0..300 {
        let mut bytes = inputs[random.below(inputs.len())].clone();
        (0..8).for_each(|_| change_bytes(&mut random, &mut bytes, MAX_BYTES));
        fuzz::round_trip(&bytes);
    }
}

#[test]
fn validate_never_disagrees_with_what_opens() {
    replay(fuzz::validate, &corpus("validate"), 4000);
}

#[test]
fn anything_is_refused_or_is_a_volume_that_is_written_and_walked() {
    let inputs = corpus("voltex");
    replay(fuzz::voltex, &inputs, 4000);
    // The mutator's files are not all stopped at the door.
    let read = mutated(&inputs, 1000, 5).filter(|input| Volume::parse(input).is_ok()).count();
    assert!((20..980).contains(&read), "{read}");
}

#[test]
fn mutations_reach_behind_the_checksums() {
    let inputs = corpus("parse");
    let (mut read, mut by_content, mut at_the_door) = (0, 0, 0);
    for input in mutated(&inputs, 2000, 3) {
        let report = validate(Arc::new(input.clone()), &serial);
        let door = |number: u16| number < 2000;
        match report.findings.first().filter(|finding| finding.severity() == Severity::Error) {
            None => read += 1,
            Some(finding) if door(finding.rule.number) => at_the_door += 1,
            Some(_) => by_content += 1,
        }
    }
    assert!(read > 20 && by_content > 200 && at_the_door > 200, "{read} {by_content} {at_the_door}");
    // Planted difference: the same changes without the mutator's repairs stay at the door.
    let mut random = Random::new(4);
    let behind = (0..2000).filter(|_| {
        let mut bytes = inputs[random.below(inputs.len())].clone();
        let before = bytes.clone();
        change_bytes(&mut random, &mut bytes, MAX_BYTES);
        bytes != before && Asset::parse(&bytes).is_ok()
    });
    assert!(behind.count() < 20);
}
