//! The fuzz targets' corpora on any toolchain: each input does what a fuzzer would have it do, and so do some thousand mutations
//! of them; what reading allocates is bounded by the input's length. What libFuzzer, which sees what is covered, does beyond
//! that: `cargo xtask fuzz`. The allocator of this test counts, so it runs alone: one test, one thread.

#![allow(unsafe_code, reason = "an allocator that counts is an implementation of an unsafe trait")]

#[path = "../fuzz/src/lib.rs"]
#[allow(dead_code, unused_imports, reason = "what libFuzzer calls is not called here")]
mod fuzz;

use fuzz::Random;
use std::alloc::{GlobalAlloc, Layout, System};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

struct Counting;

static HELD: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is handed on to the system's allocator as it came.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        PEAK.fetch_max(HELD.fetch_add(layout.size(), Relaxed) + layout.size(), Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Relaxed);
        unsafe { System.dealloc(place, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Most bytes of a mutated input.
const MAX_BYTES: usize = 16 << 10;
/// Bytes that a byte of an input may cost: parsed JSON and TOML, and the 64 elements of a mesh that a byte may stand for.
const FACTOR: usize = 8192;
/// Bytes that do not depend on the input: the images beside a list or manifest, tables of colour.
const ALWAYS: usize = 4 << 20;
/// Mutations of the inputs of a target.
const MUTATIONS: usize = 1000;

/// The most bytes that `work` held at a time.
fn peak_of(work: impl FnOnce()) -> usize {
    let before = HELD.load(Relaxed);
    PEAK.store(before, Relaxed);
    work();
    PEAK.load(Relaxed) - before
}

fn corpus(target: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(target);
    let mut paths: Vec<_> =
        std::fs::read_dir(folder).expect("the corpus is there").map(|e| e.unwrap().path()).collect();
    paths.sort();
    assert!(paths.len() >= 10, "{target}: {} inputs", paths.len());
    paths.iter().map(|path| std::fs::read(path).unwrap()).collect()
}

/// A byte mutator as simple as can be.
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

#[test]
fn anything_is_refused_in_one_line_or_read_and_costs_no_more_than_it_justifies() {
    type Target = fn(&[u8]);
    let targets: [(&str, Target); 8] = [
        ("glb", fuzz::glb),
        ("gltf", fuzz::gltf),
        ("obj", fuzz::obj),
        ("shapes", fuzz::shapes),
        ("leaf", fuzz::leaf),
        ("manifest", fuzz::manifest),
        ("list", fuzz::list),
        ("ubo2014", fuzz::ubo2014),
    ];
    for (name, target) in targets {
        let inputs = corpus(name);
        // Makes the files that inputs are written to.
        target(&[]);
        let check = |input: &[u8], what: &str| {
            let peak = peak_of(|| target(input));
            let most = input.len() * FACTOR + ALWAYS;
            assert!(peak <= most, "{name}: {what} of {} bytes took {peak}", input.len());
        };
        inputs.iter().for_each(|input| check(input, "an input"));
        let mut random = Random::new(1);
        for number in 0..MUTATIONS {
            let (input, seed) = (random.below(inputs.len()), random.bits());
            let changed = fuzz::mutate(&inputs[input], seed, MAX_BYTES, &mut |bytes, most| {
                change_bytes(&mut random, bytes, most);
            });
            check(&changed, &format!("mutation {number}"));
        }
    }
    // Planted difference: what is not bounded is seen.
    assert!(peak_of(|| drop(std::hint::black_box(vec![0u8; 3 * ALWAYS]))) > 2 * ALWAYS);
}
