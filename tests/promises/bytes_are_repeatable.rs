//! A capture, parameters and a seed always give the same bytes: on any number of threads, with the
//! decoded capture in memory or in a file, from a folder or from a zip of it.

use btf_capture::{Capture, DirectionSet, ImageFormat};
use btf_fit::{FitParams, Monitor, TileCache};
use btf_tests::{fitted, leaf_capture, small_fit};

fn on_threads(threads: usize, capture: &Capture, params: &FitParams) -> Vec<u8> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| fitted(capture, params).bytes)
}

#[test]
fn the_same_fit_gives_the_same_bytes_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let set = DirectionSet::random(12, 5).unwrap();
    // More texels than one block, so that blocks and batches are cut differently by threads.
    let capture = leaf_capture(&folder.path().join("leaf"), 40, &set, &set, ImageFormat::Png);
    let plain = small_fit(folder.path());
    // Without a goal lobes are the texels' own; with one they guide clusters, and a search ends at the budget.
    let budget = FitParams { components: None, bytes: Some(30_000), ..plain.clone() };
    for params in [plain, budget] {
        let once = on_threads(1, &capture, &params);
        for threads in [2, 7] {
            let again = on_threads(threads, &capture, &params);
            assert!(once == again, "{:?}: the bytes differ between 1 and {threads} threads", params.bytes);
        }
        let other = FitParams { seed: 2, ..params };
        assert!(once != on_threads(2, &capture, &other), "another seed must show");
    }
}

#[test]
fn a_cache_in_a_file_holds_what_a_cache_in_memory_holds_and_is_gone_afterwards() {
    let folder = tempfile::tempdir().unwrap();
    let set = DirectionSet::random(6, 5).unwrap();
    for format in [ImageFormat::Png, ImageFormat::Exr] {
        let capture = leaf_capture(&folder.path().join(format!("{format:?}")), 40, &set, &set, format);
        let monitor = Monitor::default();
        let in_memory = TileCache::build(&capture, 1 << 30, folder.path(), &monitor).unwrap();
        let in_file = TileCache::build(&capture, 100_000, folder.path(), &monitor).unwrap();
        let files =
            || std::fs::read_dir(folder.path()).unwrap().filter(|e| e.as_ref().unwrap().path().is_file()).count();
        assert_eq!(files(), 1, "the small limit must lead to a file");
        let (mut a, mut b) = (vec![0.0; set.len() * set.len() * 3], vec![0.0; set.len() * set.len() * 3]);
        let mut seen = 0;
        for tile in 0..in_memory.tile_count() {
            let (one, two) = (in_memory.read(tile).unwrap(), in_file.read(tile).unwrap());
            for index in 0..one.texels.len() {
                one.texel_linear(index, &mut a);
                two.texel_linear(index, &mut b);
                assert_eq!(a, b);
                seen += 1;
            }
        }
        assert_eq!(seen, 1600);
        drop(in_file);
        assert_eq!(files(), 0);
    }
}
