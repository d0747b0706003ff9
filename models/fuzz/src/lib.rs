//! Fuzz targets as plain functions of one input: `fuzz_targets` passes them what libFuzzer makes up,
//! `models/tests/model_corpus.rs` the corpus and its own mutations, on any toolchain. A function that returns has found
//! nothing.
//!
//! An input is written to a file, because the functions that users call take paths. A file that cannot be read must be
//! refused in one line that names it.

mod mutate;

pub use mutate::{Random, mutate, mutate_in_place};

use btf_capture::{Capture, CaptureInfo, CaptureWriter, DirectionSet, ImageFormat, MIN_LINEAR, Pixels};
use btf_models::shapes::Script;
use btf_models::{LeafDescription, read_model};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Largest number of images of a capture that are read.
const MAX_IMAGES: usize = 32;
/// Largest number of texels of an image that is read.
const MAX_TEXELS: usize = 1 << 12;

/// Files that the inputs of one thread are written to.
struct Files {
    folder: TempDir,
    /// Folder of a capture of 2 x 2 images of 2 x 2 texels, for manifests.
    capture: PathBuf,
    /// Folder of four images that a list can name.
    listed: PathBuf,
}

impl Files {
    fn new() -> Files {
        let folder = tempfile::tempdir().expect("a folder can be made");
        let (capture, listed) = (folder.path().join("capture"), folder.path().join("listed"));
        let set = DirectionSet::random(2, 1).expect("two directions are a set");
        let info = CaptureInfo::new("grey", 2, 2, set.clone(), set, ImageFormat::Png);
        let writer = CaptureWriter::create(&capture, info).expect("a capture can be written");
        (0..4).for_each(|pair| writer.write(pair / 2, pair % 2, &[0.25; 12]).expect("an image can be written"));
        writer.finish().expect("a capture can be finished");
        std::fs::create_dir(&listed).expect("a folder can be made");
        let made = Capture::open(&capture).expect("what was written can be opened");
        for (pair, name) in ["a.png", "b.png", "c.png", "d.png"].iter().enumerate() {
            std::fs::copy(made.path_of(pair / 2, pair % 2), listed.join(name)).expect("an image can be copied");
        }
        Files { folder, capture, listed }
    }
}

thread_local! {
    static FILES: Files = Files::new();
}

/// Writes `bytes` to the file that `place` chooses and has `read` read it.
fn with_file(bytes: &[u8], place: impl FnOnce(&Files) -> PathBuf, read: impl FnOnce(&Path)) {
    FILES.with(|files| {
        let path = place(files);
        std::fs::write(&path, bytes).expect("an input can be written");
        read(&path);
    });
}

/// Checks that an error is one line that names the file.
fn check_sentence(error: &dyn std::fmt::Display, name: &str) {
    let sentence = error.to_string();
    assert!(sentence.contains(name) && sentence.lines().count() == 1, "{sentence:?}");
}

/// Reads a model: it is refused, or its numbers are finite and its indices in range.
fn model(bytes: &[u8], name: &str) {
    with_file(
        bytes,
        |files| files.folder.path().join(name),
        |path| match read_model(path) {
            Err(error) => check_sentence(&error, name),
            Ok(meshes) => {
                for mesh in &meshes {
                    assert!(!mesh.places.is_empty() && mesh.places.iter().all(|place| place.is_finite()));
                    for part in &mesh.parts {
                        let count = part.positions.len();
                        assert!(part.triangles.iter().flatten().all(|index| (*index as usize) < count));
                        assert!(part.positions.iter().flatten().all(|x| x.is_finite()));
                        assert!(part.uvs.as_ref().is_none_or(|uvs| uvs.len() == count));
                        assert!(part.normals.as_ref().is_none_or(|normals| normals.len() == count));
                    }
                }
            }
        },
    );
}

/// Reads anything as a binary glTF file.
pub fn glb(bytes: &[u8]) {
    model(bytes, "input.glb");
}

/// Reads anything as a glTF file.
pub fn gltf(bytes: &[u8]) {
    model(bytes, "input.gltf");
}

/// Reads anything as an OBJ file.
pub fn obj(bytes: &[u8]) {
    model(bytes, "input.obj");
}

/// Reads anything as a script of shapes: it is refused, or it is written and read again as it was.
pub fn shapes(bytes: &[u8]) {
    const NAME: &str = "input.shapes.toml";
    with_file(
        bytes,
        |files| files.folder.path().join(NAME),
        |path| match Script::read(path) {
            Err(error) => check_sentence(&error, NAME),
            Ok(script) => {
                let text = script.to_text(path).expect("what was read can be written");
                std::fs::write(path, text).expect("an input can be written");
                assert!(Script::read(path).expect("and read again") == script, "it is read as it was written");
            }
        },
    );
}

/// Reads anything as the description of a leaf: it is refused, or it is written and read again as it was.
pub fn leaf(bytes: &[u8]) {
    const NAME: &str = "input-leaf.toml";
    with_file(
        bytes,
        |files| files.folder.path().join(NAME),
        |path| match LeafDescription::read(path) {
            Err(error) => check_sentence(&error, NAME),
            Ok(leaf) => {
                leaf.write(path).expect("what was read can be written");
                assert!(LeafDescription::read(path).expect("and read again") == leaf, "it is read as it was written");
            }
        },
    );
}

/// Reads every image of a capture: finite values that are not far below 0, or an error in one line.
fn read_capture(capture: &Capture) {
    let info = capture.info();
    if info.width * info.height > MAX_TEXELS {
        return;
    }
    let pairs = info.views.len() * info.lights.len();
    for pair in 0..pairs.min(MAX_IMAGES) {
        let (view, light) = (pair / info.lights.len(), pair % info.lights.len());
        match capture.read(view, light) {
            Ok(Pixels::Linear(values)) => {
                assert_eq!(values.len(), info.width * info.height * 3);
                assert!(values.iter().all(|value| value.is_finite() && *value >= MIN_LINEAR), "{values:?}");
            }
            Ok(Pixels::Encoded8(values)) => assert_eq!(values.len(), info.width * info.height * 3),
            Err(error) => check_sentence(&error, ""),
        }
    }
}

/// Opens a capture with anything as its `capture.toml`.
pub fn manifest(bytes: &[u8]) {
    with_file(
        bytes,
        |files| files.capture.join("capture.toml"),
        |path| match Capture::open(path.parent().expect("it lies in a folder")) {
            Err(error) => check_sentence(&error, "capture"),
            Ok(capture) => read_capture(&capture),
        },
    );
}

/// Opens a folder of four images with anything as the list of their directions.
pub fn list(bytes: &[u8]) {
    with_file(
        bytes,
        |files| files.listed.join("list.csv"),
        |path| match Capture::open(path) {
            Err(error) => check_sentence(&error, "listed"),
            Ok(capture) => read_capture(&capture),
        },
    );
}

/// Fuzz target: reads arbitrary bytes as a UBO2014 file.
pub fn ubo2014(bytes: &[u8]) {
    const NAME: &str = "input.btf";
    with_file(
        bytes,
        |files| files.folder.path().join(NAME),
        |path| match Capture::open(path) {
            Err(error) => check_sentence(&error, NAME),
            Ok(capture) => read_capture(&capture),
        },
    );
}
