//! Scene files that are damaged or hostile: a corpus and mutations of it are refused in one line that names the file, or loaded.
//!
//! The mutations are those of the other readers' fuzz targets (`models/fuzz`). There is no libFuzzer target for scenes, because
//! this package with its window and GPU would have to be built with a fuzzer's instrumentation. For a longer run than the
//! suite's set `BTF_SCENE_MUTATIONS` to a number.

#[path = "../../models/fuzz/src/mutate.rs"]
#[allow(dead_code, reason = "what libFuzzer calls is not called here")]
mod mutate;

use btf_viewer::load_scene;
use mutate::{Random, mutate};
use std::path::{Path, PathBuf};

/// Mutations of the ordinary suite: some seconds.
const MUTATIONS: usize = 500;
/// Most bytes of a mutated scene.
const MAX_BYTES: usize = 4096;

/// Writes a scene and loads it.
fn check(path: &Path, bytes: &[u8]) -> bool {
    std::fs::write(path, bytes).unwrap();
    match load_scene(path, Vec::new()) {
        Ok(_) => true,
        Err(error) => {
            let sentence = error.to_string();
            assert_eq!(sentence.lines().count(), 1, "{sentence:?}");
            false
        }
    }
}

#[test]
fn any_scene_file_is_refused_in_one_line_or_loaded() {
    let mutations = std::env::var("BTF_SCENE_MUTATIONS").map_or(MUTATIONS, |number| number.parse().unwrap());
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/fuzz/corpus/scene");
    let mut paths: Vec<PathBuf> = std::fs::read_dir(corpus).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let inputs: Vec<Vec<u8>> = paths.iter().map(|path| std::fs::read(path).unwrap()).collect();
    assert!(inputs.len() >= 10);
    // Beside the scene lie the files that it can name.
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("leaf.toml"), "[contents]\nbrown = 0.1\n").unwrap();
    std::fs::write(folder.path().join("weave.spmm"), include_bytes!("../src/scene/builtin/weave.spmm")).unwrap();
    std::fs::write(folder.path().join("mesh.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n").unwrap();
    let path = folder.path().join("SCENE.toml");
    let loaded = inputs.iter().filter(|input| check(&path, input)).count();
    let mut random = Random::new(1);
    let mut loaded_changed = 0;
    for number in 0..mutations {
        let (input, seed) = (random.below(inputs.len()), random.bits());
        let changed = mutate(&inputs[input], seed, MAX_BYTES, &mut |bytes, most| {
            let at = random.below(bytes.len() + 1);
            match random.below(3) {
                0 if at < bytes.len() => bytes[at] = random.bits() as u8,
                1 => bytes.truncate(at),
                _ if bytes.len() < most => bytes.insert(at, random.bits() as u8),
                _ => {}
            }
        });
        // What brings the loader down is left for the corpus.
        std::fs::write(std::env::temp_dir().join("btf-scene-under-test.toml"), &changed).unwrap();
        loaded_changed += usize::from(check(&path, &changed));
        if number % 10_000 == 9_999 {
            println!("{} mutations, {loaded_changed} loaded", number + 1);
        }
    }
    // The corpus is not all refused, and its mutations are neither all refused nor all loaded.
    assert!(loaded >= 6 && (mutations / 50..mutations).contains(&loaded_changed), "{loaded} {loaded_changed}");
}
