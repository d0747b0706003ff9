//! Tests of reading and writing whole captures: what is good comes back, and everything that can
//! be wrong is named.

use std::collections::BTreeMap;
use std::fs;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

use tempfile::TempDir;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use crate::images::exr;
use crate::images::file_format::encode_8_bit;
use crate::images::file_format::tests::picture;
use crate::{
    Capture, CaptureError, CaptureInfo, CaptureWriter, Cosine, Direction, DirectionSet, ImageFormat, Pixels, Side,
};

const WIDTH: usize = 6;
const HEIGHT: usize = 5;

fn directions() -> DirectionSet {
    DirectionSet::new(vec![Direction::new(0.0, 0.0), Direction::new(37.5, 120.0), Direction::new(75.0, 345.0)]).unwrap()
}

fn info(format: ImageFormat) -> CaptureInfo {
    CaptureInfo::new("tiny", WIDTH, HEIGHT, directions(), directions(), format)
}

/// Returns a value that differs between texels, channels, views and lights.
fn linear(view: usize, light: usize) -> Vec<f32> {
    (0..WIDTH * HEIGHT * 3).map(|i| 0.05 + 0.008 * i as f32 + 0.04 * view as f32 + 0.013 * light as f32).collect()
}

fn write(dir: &Path, info: CaptureInfo) {
    let writer = CaptureWriter::create(dir, info).unwrap();
    for view in 0..3 {
        for light in 0..3 {
            writer.write(view, light, &linear(view, light)).unwrap();
        }
    }
    writer.finish().unwrap();
}

/// Returns a written 3 x 3 capture in a folder of its own.
fn capture(format: ImageFormat) -> (TempDir, PathBuf) {
    let parent = tempfile::tempdir().unwrap();
    let dir = parent.path().join("tiny");
    write(&dir, info(format));
    (parent, dir)
}

fn files(dir: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() { found.extend(files(&path)) } else { found.push(path) }
    }
    found.sort();
    found
}

fn zip_of(entries: &[(&str, &[u8])], method: CompressionMethod) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in entries {
        writer.start_file(*name, SimpleFileOptions::default().compression_method(method)).unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

/// Returns the capture of `dir` as zip entries below `prefix`.
fn entries_of(dir: &Path, prefix: &str) -> BTreeMap<String, Vec<u8>> {
    files(dir)
        .iter()
        .map(|path| {
            let relative = path.strip_prefix(dir).unwrap().to_str().unwrap().replace('\\', "/");
            (format!("{prefix}{relative}"), fs::read(path).unwrap())
        })
        .collect()
}

fn zip_file(parent: &Path, entries: &BTreeMap<String, Vec<u8>>) -> PathBuf {
    let path = parent.join("tiny.zip");
    let entries: Vec<(&str, &[u8])> = entries.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())).collect();
    fs::write(&path, zip_of(&entries, CompressionMethod::Deflated)).unwrap();
    path
}

fn message(error: &CaptureError) -> String {
    let text = error.to_string();
    assert!(!text.contains('\n') && !text.ends_with('.'), "one sentence: {text}");
    text
}

fn open_error(path: &Path) -> CaptureError {
    let error = Capture::open(path).unwrap_err();
    message(&error);
    error
}

/// Returns the message of whatever refuses a capture: opening it or reading one of its images.
fn refusal(path: &Path) -> String {
    match Capture::open(path) {
        Err(error) => message(&error),
        Ok(capture) => {
            let pairs = (0..3).flat_map(|view| (0..3).map(move |light| (view, light)));
            let error = pairs.filter_map(|(view, light)| capture.read(view, light).err()).next();
            message(&error.expect("something refuses the capture"))
        }
    }
}

#[track_caller]
fn assert_says(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "`{part}` is not in: {text}");
    }
}

#[test]
fn a_written_capture_is_read_back_in_every_format() {
    for (format, tolerance) in [(ImageFormat::Png, 0.004), (ImageFormat::Jpg, 0.05), (ImageFormat::Exr, 0.0006)] {
        for cosine in [Cosine::Included, Cosine::Excluded] {
            let parent = tempfile::tempdir().unwrap();
            let dir = parent.path().join("tiny");
            // The cosine at 75 degrees is 0.26, so scale keeps the 8-bit range wide enough.
            let written = CaptureInfo {
                cosine,
                scale: 4.0,
                side: Side::Back,
                size_mm: Some([20.0, 16.5]),
                provenance: "a test".into(),
                ..info(format)
            };
            write(&dir, written.clone());
            let capture = Capture::open(&dir).unwrap();
            assert_eq!(capture.info(), &written);
            let mut worst = 0f32;
            for view in 0..3 {
                for light in 0..3 {
                    let table = capture.info().linear_from_encoded8(light);
                    let read = match capture.read(view, light).unwrap() {
                        Pixels::Encoded8(values) => values.iter().map(|&v| table[v as usize]).collect(),
                        Pixels::Linear(values) => values,
                    };
                    let difference =
                        |other: &[f32]| read.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                    worst = worst.max(difference(&linear(view, light)));
                    // A planted difference: the neighbouring light's image.
                    let other = linear(view, (light + 1) % 3);
                    assert!(format == ImageFormat::Jpg || difference(&other) > 0.01, "{format}");
                }
            }
            assert!(worst < tolerance * 4.0, "{format} {cosine}: {worst}");
        }
    }
}

#[test]
fn an_8_bit_capture_is_stored_as_its_info_encodes() {
    let (_parent, dir) = capture(ImageFormat::Png);
    let capture = Capture::open(&dir).unwrap();
    let expected: Vec<u8> = linear(2, 1).iter().map(|&value| capture.info().encoded8_from_linear(1, value)).collect();
    assert_eq!(capture.read(2, 1).unwrap(), Pixels::Encoded8(expected));
}

#[test]
fn a_capture_without_manifest_has_the_defaults() {
    let (_parent, dir) = capture(ImageFormat::Png);
    fs::remove_file(dir.join("capture.toml")).unwrap();
    assert_eq!(Capture::open(&dir).unwrap().info(), &info(ImageFormat::Png));
}

#[test]
fn a_zip_a_nested_folder_and_a_flat_folder_hold_the_same_capture() {
    let (parent, dir) = capture(ImageFormat::Png);
    let whole = Capture::open(&dir).unwrap();
    let mut entries = entries_of(&dir, "UBO2003/MANYFILES/");
    entries.insert("UBO2003/readme.txt".into(), b"hello".to_vec());
    entries.insert("__MACOSX/UBO2003/._00000 tl000 pl000 tv000 pv000.png".into(), b"junk".to_vec());
    let zip = zip_file(parent.path(), &entries);
    let flat = parent.path().join("flat");
    fs::create_dir(&flat).unwrap();
    for path in files(&dir) {
        fs::copy(&path, flat.join(path.file_name().unwrap())).unwrap();
    }
    for other in [&zip, &flat, &dir.parent().unwrap().join("tiny")] {
        let other = Capture::open(other).unwrap();
        assert_eq!(other.info(), whole.info());
        for view in 0..3 {
            for light in 0..3 {
                assert_eq!(other.read(view, light).unwrap(), whole.read(view, light).unwrap());
            }
        }
    }
    assert_says(&Capture::open(&zip).unwrap().path_of(0, 1), &["tiny.zip: UBO2003/MANYFILES/tv000_pv000/00003"]);
}

#[test]
fn one_view_of_many_lights_is_a_capture_and_numbers_in_names_do_not_count() {
    let (_parent, dir) = capture(ImageFormat::Png);
    fs::remove_dir_all(dir.join("tv037.5_pv120")).unwrap();
    fs::remove_dir_all(dir.join("tv075_pv345")).unwrap();
    let view = dir.join("tv000_pv000");
    fs::rename(view.join("00006 tl075 pl345 tv000 pv000.png"), view.join("00000 tl075 pl345 tv000 pv000.png")).unwrap();
    let capture = Capture::open(&dir).unwrap();
    assert_eq!((capture.info().views.len(), capture.info().lights.len()), (1, 3));
    assert_says(&capture.path_of(0, 2), &["00000 tl075"]);
}

#[test]
fn reading_from_many_threads_gives_the_same_as_from_one() {
    use rayon::prelude::*;
    let (parent, dir) = capture(ImageFormat::Exr);
    let zip = Capture::open(zip_file(parent.path(), &entries_of(&dir, ""))).unwrap();
    let alone: Vec<Pixels> = (0..9).map(|pair| zip.read(pair / 3, pair % 3).unwrap()).collect();
    let together: Vec<Pixels> = (0..900usize).into_par_iter().map(|i| zip.read(i % 9 / 3, i % 3).unwrap()).collect();
    assert!(together.iter().enumerate().all(|(i, pixels)| *pixels == alone[i % 9]));
}

#[test]
fn a_missing_path_is_named() {
    let parent = tempfile::tempdir().unwrap();
    let error = open_error(&parent.path().join("nowhere"));
    assert!(matches!(error, CaptureError::NotFound { .. }));
    assert_says(&message(&error), &["nowhere", "check the path"]);
}

#[test]
fn an_empty_folder_and_a_folder_of_other_files_are_told_apart() {
    let parent = tempfile::tempdir().unwrap();
    assert!(matches!(open_error(parent.path()), CaptureError::Empty { .. }));
    fs::write(parent.path().join("holiday.jpg"), b"x").unwrap();
    let error = open_error(parent.path());
    assert!(matches!(error, CaptureError::NoImages { files: 1, .. }));
    assert_says(&message(&error), &["1 files", "00000 tl000"]);
}

#[test]
fn missing_pairs_are_counted_and_the_first_is_named() {
    let (_parent, dir) = capture(ImageFormat::Png);
    fs::remove_file(dir.join("tv037.5_pv120/00004 tl037.5 pl120 tv037.5 pv120.png")).unwrap();
    fs::remove_file(dir.join("tv075_pv345/00002 tl000 pl000 tv075 pv345.png")).unwrap();
    let text = message(&open_error(&dir));
    assert_says(
        &text,
        &[
            "lacks 2 of its 9 images",
            "tv037.5_pv120/00004 tl037.5 pl120 tv037.5 pv120.png",
            "3 views x 3 lights",
            "incomplete = true",
        ],
    );
}

#[test]
fn an_incomplete_capture_opens_where_it_says_so_and_its_missing_pairs_are_known() {
    let (_parent, dir) = capture(ImageFormat::Png);
    fs::remove_file(dir.join("tv000_pv000/00000 tl000 pl000 tv000 pv000.png")).unwrap();
    fs::remove_file(dir.join("tv037.5_pv120/00004 tl037.5 pl120 tv037.5 pv120.png")).unwrap();
    let manifest = dir.join("capture.toml");
    let text = fs::read_to_string(&manifest).unwrap();
    fs::write(&manifest, format!("{text}\nincomplete = false\n")).unwrap();
    assert!(matches!(open_error(&dir), CaptureError::MissingPair { missing: 2, .. }));
    fs::write(&manifest, format!("{text}\nincomplete = true\n")).unwrap();
    let opened = Capture::open(&dir).unwrap();
    let info = opened.info();
    assert_eq!((info.pair_count(), info.missing.clone(), info.width), (9, vec![0, 4], WIDTH));
    assert_eq!(info.present_pairs().collect::<Vec<_>>(), [1, 2, 3, 5, 6, 7, 8]);
    let stand_ins = info.stand_ins();
    assert!(info.present_pairs().all(|pair| stand_ins[pair] == pair));
    assert!(info.missing.iter().all(|pair| info.has_image(stand_ins[*pair])), "{stand_ins:?}");
    for (view, light) in [(0, 0), (1, 1)] {
        let error = opened.read(view, light).unwrap_err();
        assert!(matches!(error, CaptureError::NoImage { .. }));
        assert_says(&message(&error), &["has no image", "view", "light"]);
    }
    assert!(opened.read(0, 1).is_ok() && opened.path_of(1, 1).contains("view"));
    fs::write(&manifest, format!("{text}\nincomplete = 3\n")).unwrap();
    assert!(matches!(open_error(&dir), CaptureError::BadManifest { .. }));
}

#[test]
fn a_doubled_pair_is_named_with_both_files() {
    let (_parent, dir) = capture(ImageFormat::Png);
    let view = dir.join("tv000_pv000");
    for copy in ["99999 tl075 pl345 tv000 pv000.png", "00006 tl075 pl345 tv000 pv000.jpg"] {
        fs::copy(view.join("00006 tl075 pl345 tv000 pv000.png"), view.join(copy)).unwrap();
        let error = open_error(&dir);
        assert!(matches!(error, CaptureError::DoubledPair { .. }));
        assert_says(&message(&error), &["00006 tl075 pl345 tv000 pv000.png", copy, "remove one"]);
        fs::remove_file(view.join(copy)).unwrap();
    }
    // The same direction under two names.
    fs::copy(view.join("00000 tl000 pl000 tv000 pv000.png"), view.join("00009 tl000 pl090 tv000 pv000.png")).unwrap();
    assert!(matches!(open_error(&dir), CaptureError::DoubledPair { .. }));
}

#[test]
fn a_mixture_of_formats_is_refused() {
    let (_parent, dir) = capture(ImageFormat::Png);
    let view = dir.join("tv000_pv000");
    fs::rename(view.join("00006 tl075 pl345 tv000 pv000.png"), view.join("00006 tl075 pl345 tv000 pv000.jpg")).unwrap();
    assert!(matches!(open_error(&dir), CaptureError::MixedFormats { .. }));
}

#[test]
fn an_image_of_another_size_is_named_with_both_sizes() {
    let (_parent, dir) = capture(ImageFormat::Png);
    let other = encode_8_bit(&picture(7, 5), 7, 5, ImageFormat::Png).unwrap();
    fs::write(dir.join("tv075_pv345/00002 tl000 pl000 tv075 pv345.png"), other).unwrap();
    let error = Capture::open(&dir).unwrap().read(2, 0).unwrap_err();
    assert_says(&message(&error), &["00002 tl000 pl000 tv075 pv345.png", "7 x 5", "6 x 5"]);
}

#[test]
fn empty_cut_and_foreign_images_are_named_in_folders_and_zips() {
    for format in [ImageFormat::Png, ImageFormat::Jpg, ImageFormat::Exr] {
        let (parent, dir) = capture(format);
        let name = format!("00007 tl075 pl345 tv037.5 pv120.{format}");
        let path = dir.join("tv037.5_pv120").join(&name);
        let good = fs::read(&path).unwrap();
        for bad in [&good[..0], &good[..good.len() / 2], &good[..good.len() - 1], b"GIF89a is another kind"] {
            fs::write(&path, bad).unwrap();
            let zip = zip_file(parent.path(), &entries_of(&dir, "a/"));
            for capture in [&dir, &zip] {
                let capture = Capture::open(capture).unwrap();
                assert!(capture.read(0, 0).is_ok());
                let error = capture.read(1, 2).unwrap_err();
                assert!(matches!(error, CaptureError::BadImage { .. }), "{error}");
                assert_says(&message(&error), &[&name, "damaged"]);
            }
        }
    }
}

#[test]
fn nan_infinity_and_deep_negatives_in_exr_are_named_with_their_texel() {
    let (_parent, dir) = capture(ImageFormat::Exr);
    let path = dir.join("tv037.5_pv120/00007 tl075 pl345 tv037.5 pv120.exr");
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.11] {
        // The encoder clamps to half's range, so infinity needs a scale that overflows it.
        let huge = bad == f32::INFINITY;
        fs::write(dir.join("capture.toml"), if huge { "scale = 1e38" } else { "" }).unwrap();
        let mut values = linear(1, 2);
        values[(3 * WIDTH + 4) * 3 + 1] = bad;
        fs::write(&path, exr::encode(&values, WIDTH, HEIGHT).unwrap()).unwrap();
        let error = Capture::open(&dir).unwrap().read(1, 2).unwrap_err();
        assert_says(&message(&error), &["00007 tl075", "column 4, row 3", "channel 1"]);
    }
}

#[test]
fn small_negatives_in_exr_are_kept() {
    let parent = tempfile::tempdir().unwrap();
    let dir = parent.path().join("tiny");
    let writer = CaptureWriter::create(&dir, info(ImageFormat::Exr)).unwrap();
    for pair in 0..9 {
        // The second value is below what readers take, so the writer clamps it.
        let values: Vec<f32> = (0..WIDTH * HEIGHT * 3).map(|i| if i % 2 == 0 { -0.03 } else { -7.0 }).collect();
        writer.write(pair / 3, pair % 3, &values).unwrap();
    }
    writer.finish().unwrap();
    let Pixels::Linear(values) = Capture::open(&dir).unwrap().read(1, 1).unwrap() else { panic!("exr is linear") };
    assert!((values[0] + 0.03).abs() < 1e-4 && (values[1] + 0.1).abs() < 1e-4 && values[1] >= -0.1, "{values:?}");
}

#[test]
fn entries_that_climb_out_of_a_zip_are_refused_by_name() {
    let (parent, dir) = capture(ImageFormat::Png);
    // The zip writer mends such names, so they are planted in the finished bytes: one stand-in of
    // equal length in the local header and one in the directory.
    for evil in ["../../../../e.png", "/absolute/path.png", "..\\..\\..\\..\\e.png", "C:\\Windows\\e.png1"] {
        let stand_in = "X".repeat(evil.len());
        let mut entries = entries_of(&dir, "");
        entries.insert(stand_in.clone(), b"x".to_vec());
        let path = zip_file(parent.path(), &entries);
        let mut bytes = fs::read(&path).unwrap();
        let mut planted = 0;
        for at in 0..bytes.len() - evil.len() {
            if bytes[at..].starts_with(stand_in.as_bytes()) {
                bytes[at..at + evil.len()].copy_from_slice(evil.as_bytes());
                planted += 1;
            }
        }
        assert_eq!(planted, 2);
        fs::write(&path, bytes).unwrap();
        let error = open_error(&path);
        assert!(matches!(error, CaptureError::UnsafeEntry { .. }), "{error}");
        assert_says(&message(&error), &["tiny.zip", &evil.escape_debug().to_string()]);
    }
}

#[test]
fn a_zip_bomb_is_refused_by_its_claim_and_by_its_deed() {
    let (parent, dir) = capture(ImageFormat::Png);
    let name = "tv037.5_pv120/00007 tl075 pl345 tv037.5 pv120.png";
    let mut entries = entries_of(&dir, "");
    let zeros = vec![0u8; 40 << 20];
    entries.insert(name.into(), zeros.clone());
    let path = zip_file(parent.path(), &entries);
    // Beyond what 30 texels can need.
    assert_says(&refusal(&path), &["00007 tl075", "claims", "bomb"]);
    // The first image, whose size in texels is not known before: the inflation gives it away.
    let first = "tv000_pv000/00000 tl000 pl000 tv000 pv000.png";
    entries.insert(name.into(), entries[first].clone());
    entries.insert(first.into(), zeros.clone());
    let path = zip_file(parent.path(), &entries);
    assert_says(&refusal(&path), &["00000 tl000", "inflate", "bomb"]);
    // A claim of a few bytes over data that inflates to 40 MB.
    let mut bytes = fs::read(&path).unwrap();
    let claim = (zeros.len() as u32).to_le_bytes();
    let mut planted = 0;
    for at in 0..bytes.len() - 4 {
        if bytes[at..at + 4] == claim {
            bytes[at..at + 4].copy_from_slice(&1000u32.to_le_bytes());
            planted += 1;
        }
    }
    assert!(planted >= 1);
    fs::write(&path, bytes).unwrap();
    assert_says(&refusal(&path), &["00000 tl000"]);
}

#[test]
fn what_is_no_zip_and_what_was_cut_are_refused() {
    let (parent, dir) = capture(ImageFormat::Png);
    let path = zip_file(parent.path(), &entries_of(&dir, ""));
    let good = fs::read(&path).unwrap();
    let other = parent.path().join("other.zip");
    for bad in [&good[..0], b"not a zip at all", &good[..good.len() / 2], &good[..good.len() - 1]] {
        fs::write(&other, bad).unwrap();
        let error = open_error(&other);
        assert!(matches!(error, CaptureError::NotAnArchive { .. }), "{error}");
        assert_says(&message(&error), &["other.zip"]);
    }
    // An empty archive is one, but holds nothing.
    fs::write(&other, zip_of(&[], CompressionMethod::Stored)).unwrap();
    assert!(matches!(open_error(&other), CaptureError::Empty { .. }));
}

#[test]
fn a_flipped_byte_in_a_zipped_image_is_caught_by_its_checksum() {
    let (parent, dir) = capture(ImageFormat::Exr);
    let entries = entries_of(&dir, "");
    let list: Vec<(&str, &[u8])> = entries.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())).collect();
    let mut bytes = zip_of(&list, CompressionMethod::Stored);
    let image = &entries["tv037.5_pv120/00007 tl075 pl345 tv037.5 pv120.exr"];
    let at = bytes.windows(image.len()).position(|window| window == image.as_slice()).unwrap();
    // In the pixels, where EXR without compression has no checksum of its own.
    bytes[at + image.len() - 5] ^= 1;
    let path = parent.path().join("flipped.zip");
    fs::write(&path, bytes).unwrap();
    assert_says(&refusal(&path), &["00007 tl075"]);
}

#[test]
fn a_malformed_manifest_is_named_with_its_line_and_text_that_is_no_text_too() {
    let (parent, dir) = capture(ImageFormat::Png);
    fs::write(dir.join("capture.toml"), "name = \"x\"\ncosine = 7\n").unwrap();
    assert_says(&message(&open_error(&dir)), &["capture.toml line 2"]);
    let zip = zip_file(parent.path(), &entries_of(&dir, "deep/er/"));
    assert_says(&message(&open_error(&zip)), &["tiny.zip: deep/er/capture.toml line 2"]);
    fs::write(dir.join("capture.toml"), b"name = \"x\"\n\n\xFF\xFE").unwrap();
    assert_says(&message(&open_error(&dir)), &["capture.toml line 3", "UTF-8"]);
}

#[test]
fn a_folder_that_holds_something_is_not_written_to() {
    let parent = tempfile::tempdir().unwrap();
    let dir = parent.path().join("out");
    fs::create_dir(&dir).unwrap();
    fs::write(dir.join("precious.txt"), b"keep").unwrap();
    let error = CaptureWriter::create(&dir, info(ImageFormat::Png)).unwrap_err();
    assert_says(&message(&error), &["out is not an empty folder"]);
    let file = dir.join("precious.txt");
    assert!(matches!(CaptureWriter::create(&file, info(ImageFormat::Png)), Err(CaptureError::OutputNotEmpty { .. })));
    assert_eq!(fs::read(file).unwrap(), b"keep");
    assert_eq!(fs::read_dir(parent.path()).unwrap().count(), 1);
}

#[test]
fn an_empty_folder_becomes_the_capture() {
    let parent = tempfile::tempdir().unwrap();
    let dir = parent.path().join("out");
    fs::create_dir(&dir).unwrap();
    write(&dir, info(ImageFormat::Png));
    assert!(Capture::open(&dir).is_ok());
}

#[test]
fn an_unfinished_incomplete_or_failed_writer_leaves_nothing_behind() {
    let parent = tempfile::tempdir().unwrap();
    let left = || fs::read_dir(parent.path()).unwrap().count();
    let dir = parent.path().join("out");
    // Dropped in the middle, as Ctrl-C does.
    let writer = CaptureWriter::create(&dir, info(ImageFormat::Png)).unwrap();
    writer.write(0, 0, &linear(0, 0)).unwrap();
    assert_eq!(left(), 1, "the staging folder");
    drop(writer);
    assert_eq!(left(), 0);
    // Finished with images missing.
    let writer = CaptureWriter::create(&dir, info(ImageFormat::Png)).unwrap();
    writer.write(0, 0, &linear(0, 0)).unwrap();
    assert_says(&message(&writer.finish().unwrap_err()), &["8 of its 9 images"]);
    assert_eq!(left(), 0);
    // The disk fails: a view's folder is gone.
    let writer = CaptureWriter::create(&dir, info(ImageFormat::Png)).unwrap();
    let staging = fs::read_dir(parent.path()).unwrap().next().unwrap().unwrap().path();
    fs::remove_dir(staging.join("tv000_pv000")).unwrap();
    let error = writer.write(0, 0, &linear(0, 0)).unwrap_err();
    assert_says(&message(&error), &["out/tv000_pv000/00000 tl000 pl000 tv000 pv000.png"]);
    drop(writer);
    assert_eq!(left(), 0);
}

#[test]
fn a_writer_refuses_what_no_reader_would_take() {
    let parent = tempfile::tempdir().unwrap();
    let dir = parent.path().join("out");
    for bad in [
        CaptureInfo { width: 0, ..info(ImageFormat::Png) },
        CaptureInfo { scale: 0.0, ..info(ImageFormat::Png) },
        CaptureInfo { transfer: crate::Transfer::Srgb, ..info(ImageFormat::Exr) },
    ] {
        message(&CaptureWriter::create(&dir, bad).unwrap_err());
    }
    let writer = CaptureWriter::create(&dir, info(ImageFormat::Png)).unwrap();
    assert_says(&message(&writer.write(0, 0, &[0.0; 7]).unwrap_err()), &["7 values"]);
    let mut values = linear(0, 0);
    values[31] = f32::NAN;
    assert_says(&message(&writer.write(0, 0, &values).unwrap_err()), &["texel 10", "NaN"]);
}

#[test]
fn a_transmission_capture_is_written_and_read_with_its_lights_behind() {
    for side in [Side::TransmissionBack, Side::TransmissionFront] {
        for cosine in [Cosine::Included, Cosine::Excluded] {
            let parent = tempfile::tempdir().unwrap();
            let dir = parent.path().join("tiny");
            let lights = directions().behind().unwrap();
            write(&dir, CaptureInfo { lights, side, cosine, scale: 4.0, ..info(ImageFormat::Png) });
            assert!(dir.join("tv075_pv345/00005 tl142.5 pl120 tv075 pv345.png").exists());
            let capture = Capture::open(&dir).unwrap();
            assert_eq!(capture.info().side, side);
            assert_eq!(capture.info().lights.directions()[0], Direction::new(105.0, 345.0));
            for light in 0..3 {
                let table = capture.info().linear_from_encoded8(light);
                let Pixels::Encoded8(values) = capture.read(2, light).unwrap() else { panic!("png has 8 bits") };
                for (value, written) in values.iter().zip(linear(2, light)) {
                    assert!((table[usize::from(*value)] - written).abs() < 0.02, "{side} {cosine} light {light}");
                }
            }
        }
    }
}

#[test]
fn directions_that_disagree_with_the_side_are_refused_by_reader_and_writer() {
    let parent = tempfile::tempdir().unwrap();
    let behind = directions().behind().unwrap();
    let mixed = DirectionSet::new([directions().directions(), &behind.directions()[..1]].concat()).unwrap();
    let level = DirectionSet::new(vec![Direction::new(90.0, 0.0)]).unwrap();
    let good = info(ImageFormat::Png);
    for (side, views, lights, parts) in [
        (Side::Front, &behind, &good.lights, ["view theta 105 phi 345", "turned over"]),
        (Side::TransmissionFront, &behind, &behind, ["view theta 105 phi 345", "turned over"]),
        (Side::Back, &level, &good.lights, ["view theta 90 phi 0", "below 90"]),
        (Side::Front, &good.views, &behind, ["light theta 105 phi 345 stands behind", "`front`"]),
        (Side::Back, &good.views, &behind, ["light theta 105 phi 345 stands behind", "`back`"]),
        (Side::Front, &good.views, &mixed, ["light theta 105 phi 345 stands behind", "of its own"]),
        (Side::TransmissionBack, &good.views, &good.lights, ["light theta 0 phi 0 stands in front", "above 90"]),
        (Side::TransmissionFront, &good.views, &mixed, ["light theta 0 phi 0 stands in front", "above 90"]),
        (Side::TransmissionBack, &good.views, &level, ["light theta 90 phi 0", "above 90"]),
    ] {
        let bad = CaptureInfo { side, views: views.clone(), lights: lights.clone(), ..good.clone() };
        let error = CaptureWriter::create(parent.path().join("refused"), bad.clone()).unwrap_err();
        assert!(matches!(error, CaptureError::BadOutput { .. }), "{error}");
        assert_says(&message(&error), &parts);

        // The same as a folder that another program wrote.
        let dir = parent.path().join(format!("{side}-{}-{}", views.len(), lights.directions()[0]));
        let picture = encode_8_bit(&picture(WIDTH, HEIGHT), WIDTH, HEIGHT, ImageFormat::Png).unwrap();
        fs::create_dir(&dir).unwrap();
        for view in 0..views.len() {
            for light in 0..lights.len() {
                fs::write(dir.join(crate::layout::bonn::file_name(views, lights, view, light, "png")), &picture)
                    .unwrap();
            }
        }
        fs::write(dir.join("capture.toml"), format!("side = \"{side}\"")).unwrap();
        let error = open_error(&dir);
        assert!(matches!(error, CaptureError::BadSides { .. }), "{error}");
        assert_says(&message(&error), &[&parts[..], &[&dir.file_name().unwrap().to_string_lossy()]].concat());
        fs::remove_dir_all(&dir).unwrap();
    }
    assert_eq!(fs::read_dir(parent.path()).unwrap().count(), 0);
    // A light that grazes belongs to the face that is seen, where it gives black.
    let grazing = CaptureInfo { views: directions(), lights: level, ..good };
    assert!(CaptureWriter::create(parent.path().join("grazing"), grazing).is_ok());
}
