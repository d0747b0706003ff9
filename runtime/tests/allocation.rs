//! Tests that the memory that reading allocates is bounded by the length of the input, and the memory of a reader's
//! results by their size. The allocator of this test counts, so it runs alone: one test, one thread.

#![allow(unsafe_code, reason = "an allocator that counts is an implementation of an unsafe trait")]

#[path = "../fuzz/src/mutate.rs"]
#[allow(dead_code, reason = "what libFuzzer calls is not called here")]
mod mutate;

use btf_runtime::testing::Random;
use btf_runtime::voltex::Volume;
use btf_runtime::{Asset, Resident, ResidentFile, serial, validate, with_levels};
use std::alloc::{GlobalAlloc, Layout, System};
use std::path::Path;
use std::sync::Arc;
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

/// Returns the result of `work`, and the largest number of bytes that were allocated at a time meanwhile.
fn peak_of<T>(work: impl FnOnce() -> T) -> (T, usize) {
    let before = HELD.load(Relaxed);
    PEAK.store(before, Relaxed);
    let made = work();
    (made, PEAK.load(Relaxed) - before)
}

/// Number of bytes that a byte of the file form may cost: 1024 coded numbers, of up to four bytes, held once and copied
/// once.
const FILE_FACTOR: usize = 8192;
/// Number of bytes that a byte of the resident form may cost: its words if they are not aligned, and a direction set.
const RESIDENT_FACTOR: usize = 2;
/// Number of bytes that do not depend on the input: the models of the entropy coder, the grid of a direction set, the
/// messages of 256 findings.
const ALWAYS: usize = 1 << 20;
/// Number of bytes that making the resident form may cost for each of its bytes.
const EXPANSION_FACTOR: usize = 4;

fn corpus(target: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(target);
    let mut paths: Vec<_> =
        std::fs::read_dir(folder).expect("the corpus is there").map(|e| e.unwrap().path()).collect();
    paths.sort();
    paths.iter().map(|path| std::fs::read(path).unwrap()).collect()
}

#[test]
fn reading_allocates_no_more_than_the_input_justifies() {
    let inputs: Vec<Vec<u8>> = ["parse", "resident"].into_iter().flat_map(corpus).collect();
    let mut random = Random::new(5);
    let (mut read, mut refused, mut resident_read) = (0, 0, 0);
    for number in 0..6000 {
        let input = &inputs[number % inputs.len()];
        let input = match number < inputs.len() {
            true => input.clone(),
            false => mutate::mutate(input, random.bits(), 32 << 10, &mut |bytes, _| {
                let at = random.below(bytes.len() + 1);
                if let Some(byte) = bytes.get_mut(at) {
                    *byte = random.bits() as u8;
                }
            }),
        };
        let is_resident = ResidentFile::is_one(&input);
        let most = input.len() * if is_resident { RESIDENT_FACTOR } else { FILE_FACTOR } + ALWAYS;
        let bytes = Arc::new(input.clone());
        let (_, peak) = peak_of(|| validate(bytes.clone(), &serial));
        assert!(peak <= most, "validate: {peak} bytes for {}", input.len());
        if is_resident {
            let (opened, peak) = peak_of(|| ResidentFile::open(bytes, &serial));
            assert!(peak <= most, "open: {peak} bytes for {}", input.len());
            resident_read += usize::from(opened.is_ok());
            continue;
        }
        let (parsed, peak) = peak_of(|| Asset::parse(&input));
        assert!(peak <= most, "parse: {peak} bytes for {}", input.len());
        let Ok(asset) = parsed else {
            refused += 1;
            continue;
        };
        read += 1;
        let bases = |layer: &btf_runtime::Layer| layer.residual.as_ref().map_or(0, |residual| residual.bases.len());
        let pairs = |layer: &btf_runtime::Layer| layer.views.len() * layer.lights.len() * layer.dictionary.len();
        if asset.layers.iter().map(|layer| bases(layer) * pairs(layer)).sum::<usize>() > 1 << 16 {
            continue;
        }
        let (resident, peak) = peak_of(|| Resident::from_asset(&asset));
        let held = 4 * resident.words().len();
        assert!(peak <= EXPANSION_FACTOR * held + ALWAYS, "from_asset: {peak} bytes for {held}");
        if number % 10 == 0 {
            let (levels, peak) = peak_of(|| with_levels(&asset, &serial));
            let held = 4 * Resident::from_asset(&levels).words().len();
            assert!(peak <= EXPANSION_FACTOR * held + most, "with_levels: {peak} bytes for {held}");
        }
    }
    assert!(read > 50 && refused > 500 && resident_read > 50, "{read} {refused} {resident_read}");
    let inputs = corpus("voltex");
    let (mut read, mut refused) = (0, 0);
    for number in 0..2000 {
        let input = &inputs[number % inputs.len()];
        let input = mutate::mutate(input, random.bits(), 32 << 10, &mut |bytes, _| {
            let at = random.below(bytes.len() + 1);
            bytes.resize(at + random.below(64), 0);
        });
        let (parsed, peak) = peak_of(|| Volume::parse(&input));
        let most = input.len() * FILE_FACTOR + ALWAYS;
        assert!(peak <= most, "parse: {peak} bytes for {} of a volume", input.len());
        *if parsed.is_ok() { &mut read } else { &mut refused } += 1;
    }
    assert!(read > 50 && refused > 500, "{read} {refused}");
    // Planted difference: what is not bounded is seen.
    let (_, peak) = peak_of(|| vec![0u8; 3 * ALWAYS]);
    assert!(peak > 2 * ALWAYS);
}
