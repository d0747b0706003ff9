//! Folders and zips of images that other programs wrote: ATRIUM's pictures, spectral sets, lists of images.

use btf_capture::{Capture, CaptureError, Cosine, Direction, ImageFormat, Pixels, Transfer};
use exr::image::{FlatSamples, Image, Layer};
use exr::prelude::{AnyChannel, AnyChannels, Encoding, LayerAttributes, WritableImage};
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

const WIDTH: usize = 9;
const HEIGHT: usize = 4;

/// A value that a shared exponent holds exactly where it is the largest of its texel.
fn value(pair: usize, row: usize, column: usize) -> [f32; 3] {
    let largest = (128 + pair * 31 + row * 9 + column) as f32;
    [largest * 8.0, largest, (column * 4) as f32 * 16.0]
}

/// A picture as ATRIUM has them: `+X W -Y H`, rows from the bottom, the newer run-length code.
fn atrium_picture(pair: usize) -> Vec<u8> {
    let mut bytes = b"#?RADIANCE\nEXPOSURE=1.000000\nFORMAT=32-bit_rle_rgbe\n\n".to_vec();
    assert_eq!(bytes.len(), 53, "the resolution stands where ATRIUM has it");
    bytes.extend(format!("+X {WIDTH} -Y {HEIGHT}\n").as_bytes());
    for row in (0..HEIGHT).rev() {
        bytes.extend([2, 2, 0, WIDTH as u8]);
        let texels: Vec<[u8; 4]> = (0..WIDTH)
            .map(|column| {
                // Between 1024 and 4096 the exponent is 11 or 12, so a mantissa's step is 8 or 16.
                let [r, g, b] = value(pair, row, column);
                let exponent = if r < 2048.0 { 11 } else { 12 };
                let step = 2f32.powi(exponent - 8);
                [(r / step) as u8, (g / step) as u8, (b / step) as u8, (exponent + 128) as u8]
            })
            .collect();
        for component in 0..4 {
            // A run of one, then literals.
            bytes.extend([129, texels[0][component], WIDTH as u8 - 1]);
            bytes.extend(texels[1..].iter().map(|texel| texel[component]));
        }
    }
    bytes
}

fn linear(capture: &Capture, view: usize, light: usize) -> Vec<f32> {
    match capture.read(view, light).unwrap() {
        Pixels::Linear(values) => values,
        other => panic!("not linear: {other:?}"),
    }
}

fn write(folder: &Path, name: &str, bytes: &[u8]) {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, bytes).unwrap();
}

fn zip_of(folder: &Path, entries: &[(String, Vec<u8>)]) -> PathBuf {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in entries {
        zip.start_file(name.as_str(), zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    }
    let path = folder.join("set.zip");
    std::fs::write(&path, zip.finish().unwrap().into_inner()).unwrap();
    path
}

#[test]
fn a_zip_as_bonn_packs_it_is_read_and_a_doubled_image_refused() {
    let folder = tempfile::tempdir().unwrap();
    let name = |pair: usize| {
        let (tv, tl) = ([0, 75][pair / 2], [0, 15][pair % 2]);
        format!("UBO2003/MANYFILES/tv{tv:03}_pv000/{pair:05} tl{tl:03} pl000 tv{tv:03} pv000.jpg")
    };
    let jpg = |grey: u8| {
        let mut bytes = Vec::new();
        let picture = vec![grey; WIDTH * HEIGHT * 3];
        let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 95);
        encoder.encode(&picture, WIDTH as u32, HEIGHT as u32, image::ExtendedColorType::Rgb8).unwrap();
        bytes
    };
    let mut entries: Vec<(String, Vec<u8>)> = (0..4).map(|pair| (name(pair), jpg(50 * (pair as u8 + 1)))).collect();
    std::fs::rename(zip_of(folder.path(), &entries), folder.path().join("UBO_WOOL256.zip")).unwrap();
    let capture = Capture::open(folder.path().join("UBO_WOOL256.zip")).unwrap();
    assert_eq!((capture.info().name.as_str(), capture.info().transfer), ("UBO_WOOL256", Transfer::Srgb));
    assert_eq!(capture.info().views.directions()[1], Direction::new(75.0, 0.0));
    for pair in 0..4 {
        let Pixels::Encoded8(values) = capture.read(pair / 2, pair % 2).unwrap() else { panic!("jpg has 8 bits") };
        assert!(values.iter().all(|value| value.abs_diff(50 * (pair as u8 + 1)) <= 1));
    }
    entries.push((name(3).replace("MANYFILES", "COPY"), jpg(1)));
    let error = Capture::open(zip_of(folder.path(), &entries)).unwrap_err();
    assert!(matches!(error, CaptureError::DoubledPair { .. }), "{error}");
}

#[test]
fn atriums_pictures_stand_upright_and_keep_their_range_in_folders_and_zips() {
    let folder = tempfile::tempdir().unwrap();
    let angles = ["tl000 pl000", "tl015 pl060"];
    let entries: Vec<(String, Vec<u8>)> = (0..4)
        .map(|pair| {
            let (view, light) = (pair / 2, pair % 2);
            let view_name = angles[view].replace('l', "v");
            let name = format!("CEILING/{}/{:05} {} {view_name}.hdr", view_name.replace(' ', "_"), pair, angles[light]);
            (name, atrium_picture(pair))
        })
        .collect();
    for (name, bytes) in &entries {
        write(&folder.path().join("folder"), name, bytes);
    }
    for path in [folder.path().join("folder"), zip_of(folder.path(), &entries)] {
        let capture = Capture::open(&path).unwrap();
        let info = capture.info();
        assert_eq!((info.width, info.height, info.views.len(), info.lights.len()), (WIDTH, HEIGHT, 2, 2));
        assert_eq!((info.transfer, info.format), (Transfer::Linear, ImageFormat::Exr));
        for pair in 0..4 {
            let image = linear(&capture, pair / 2, pair % 2);
            for (texel, read) in image.chunks_exact(3).enumerate() {
                let written = value(pair, texel / WIDTH, texel % WIDTH);
                // Eight bits of the largest value of the texel.
                let step = if written[0] < 2048.0 { 8.0 } else { 16.0 };
                for channel in 0..3 {
                    assert!((read[channel] - written[channel]).abs() < step, "{pair} {texel}: {read:?} {written:?}");
                }
            }
            // A planted difference: the picture upside down.
            let flipped = value(pair, HEIGHT - 1, 0);
            assert!((image[0] - flipped[0]).abs() > 16.0);
        }
    }
    // What 8-bit captures may have, these may not.
    write(&folder.path().join("folder"), "CEILING/capture.toml", b"transfer = \"srgb\"\n");
    assert!(Capture::open(folder.path().join("folder")).unwrap_err().to_string().contains("linear"));
}

#[test]
fn a_cut_picture_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let name = "00000 tl000 pl000 tv000 pv000.hdr";
    let good = atrium_picture(0);
    for bad in [&good[..0], &good[..40], &good[..good.len() - 1]] {
        write(folder.path(), name, bad);
        match Capture::open(folder.path()).unwrap_err() {
            error @ CaptureError::BadImage { .. } => assert!(error.to_string().contains(name)),
            other => panic!("{other}"),
        }
    }
}

/// An EXR of one channel for each wavelength; `reflectance(nm)` everywhere.
fn spectral_picture(wavelengths_nm: &[f64], reflectance: impl Fn(f64) -> f64) -> Vec<u8> {
    let channel = |&nm: &f64| {
        AnyChannel::new(format!("{nm}").as_str(), FlatSamples::F32(vec![reflectance(nm) as f32; WIDTH * HEIGHT]))
    };
    let channels = AnyChannels::sort(wavelengths_nm.iter().map(channel).collect());
    let layer = Layer::new((WIDTH, HEIGHT), LayerAttributes::default(), Encoding::FAST_LOSSLESS, channels);
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

#[test]
fn a_spectral_set_is_found_by_its_names_and_becomes_rgb() {
    let folder = tempfile::tempdir().unwrap();
    let wavelengths: Vec<f64> = (0..33).map(|i| 400.0 + 10.0 * f64::from(i)).collect();
    for (number, name) in ["tv000_pv000_tl000_pl000", "tv000_pv000_tl037.5_pl120"].iter().enumerate() {
        let grey = spectral_picture(&wavelengths, |_| 0.25 + 2.0 * number as f64);
        write(folder.path(), &format!("{name}.exr"), &grey);
    }
    let capture = Capture::open(folder.path()).unwrap();
    assert_eq!(capture.info().lights.directions()[1], Direction::new(37.5, 120.0));
    for (light, grey) in [(0, 0.25), (1, 2.25)] {
        assert!(linear(&capture, 0, light).iter().all(|value| (value - grey).abs() < 1e-4), "light {light}");
    }
    // A band of green, measured without the cosine.
    let green = spectral_picture(&wavelengths, |nm| 0.05 + 0.5 * (-((nm - 540.0) / 30.0).powi(2)).exp());
    write(folder.path(), "tv000_pv000_tl037.5_pl120.exr", &green);
    write(folder.path(), "capture.toml", b"cosine = \"excluded\"");
    let capture = Capture::open(folder.path()).unwrap();
    assert_eq!(capture.info().cosine, Cosine::Excluded);
    let rgb = &linear(&capture, 0, 1)[..3];
    let cosine = 37.5f32.to_radians().cos();
    assert!(rgb[1] > 0.3 * cosine && rgb[0] < 0.6 * rgb[1] && rgb[2] < 0.4 * rgb[1], "{rgb:?}");
}

/// A PNG of one colour.
fn png(grey: u8) -> Vec<u8> {
    use image::ImageEncoder;
    let mut bytes = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    encoder
        .write_image(&[grey; WIDTH * HEIGHT * 3], WIDTH as u32, HEIGHT as u32, image::ExtendedColorType::Rgb8)
        .unwrap();
    bytes
}

const LIST: &str = "# my rig
File;theta_l;phi_l;theta_v;phi_v;iso
shots/b.png;30;-90;0;0;2

shots/a.png; 0 ;77;0;0;1
\"shots/c; last.png\";0;0;29.9999999;450;1
shots/d.png;30;270;30;90;1
";

fn listed(folder: &Path, list: &str) {
    for (name, grey) in [("b", 20), ("a", 10), ("c; last", 30), ("d", 40)] {
        write(folder, &format!("set/shots/{name}.png"), &png(grey));
    }
    write(folder, "set/directions.csv", list.as_bytes());
    write(folder, "set/notes.csv", b"day,weather\n1,rain\n");
    write(folder, "set/capture.toml", b"transfer = \"linear\"");
}

#[test]
fn a_list_names_the_images_of_ones_own_rig() {
    let folder = tempfile::tempdir().unwrap();
    listed(folder.path(), LIST);
    let files = ["shots/a.png", "shots/b.png", "shots/c; last.png", "shots/d.png", "directions.csv", "capture.toml"];
    let read = |name: &str| (format!("deep/{name}"), std::fs::read(folder.path().join("set").join(name)).unwrap());
    let zip = zip_of(folder.path(), &files.map(read));
    for path in [folder.path().join("set"), folder.path().join("set/directions.csv"), zip] {
        let capture = Capture::open(&path).unwrap();
        let info = capture.info();
        assert_eq!(info.views.directions(), [Direction::new(0.0, 0.0), Direction::new(30.0, 90.0)]);
        assert_eq!(info.lights.directions(), [Direction::new(0.0, 0.0), Direction::new(30.0, 270.0)]);
        assert_eq!(info.transfer, Transfer::Linear);
        for (pair, grey) in [10, 20, 30, 40].into_iter().enumerate() {
            let Pixels::Encoded8(values) = capture.read(pair / 2, pair % 2).unwrap() else { panic!("png has 8 bits") };
            assert!(values.iter().all(|value| *value == grey), "{}", capture.path_of(pair / 2, pair % 2));
        }
    }
}

#[test]
fn what_is_wrong_with_a_list_is_named_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    for (from, to, parts) in [
        ("shots/d.png;30;270;30;90;1\n", "", &["lacks 1 of its 4", "theta_v 30, phi_v 90, theta_l 30, phi_l 270"][..]),
        ("shots/d.png;30;270;30", "shots/d.png;30;270;0", &["b.png", "d.png", "same light and view"]),
        ("shots/b.png;30", "shots/b.png;steep", &["line 3", "theta_l", "steep"]),
        ("shots/b.png;30", "shots/b.png;190", &["line 3", "theta_l", "180"]),
        ("shots/b.png;30", "shots/b.png;nan", &["line 3", "nan"]),
        ("shots/b.png;30", "shots/e.png;30", &["line 3", "no file", "shots/e.png"]),
        ("shots/b.png;30", "../secret.png;30", &["line 3", "no file"]),
        ("shots/b.png;30", "shots/a.png;30", &["line 5", "twice"]),
        ("shots/b.png;30", "notes.csv;30", &["line 3", "png, jpg, exr or hdr"]),
        ("shots/b.png;30;-90;0;0;2", "shots/b.png;30;-90", &["line 3", "no `theta_v`"]),
        ("\"shots/c; last.png\"", "\"shots/c; last.png", &["line 6", "quote"]),
        (&LIST[LIST.find("shots/b").unwrap()..], "", &["line 2", "no image"]),
    ] {
        assert!(LIST.contains(from), "{from}");
        listed(folder.path(), &LIST.replacen(from, to, 1));
        let message = Capture::open(folder.path().join("set")).unwrap_err().to_string();
        for part in parts {
            assert!(message.contains(part), "`{part}` is not in: {message}");
        }
        assert!(!message.contains('\n') && !message.ends_with('.'), "{message}");
    }
    // Two lists, unless one is named; and a list that is none.
    listed(folder.path(), LIST);
    write(folder.path(), "set/again.csv", LIST.as_bytes());
    let message = Capture::open(folder.path().join("set")).unwrap_err().to_string();
    assert!(message.contains("again.csv") && message.contains("directions.csv"), "{message}");
    assert!(Capture::open(folder.path().join("set/again.csv")).is_ok());
    let message = Capture::open(folder.path().join("set/notes.csv")).unwrap_err().to_string();
    assert!(message.contains("notes.csv") && message.contains("no column `file`"), "{message}");
}

#[test]
fn what_is_no_capture_is_told_what_is() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "set/holiday.png", &png(1));
    let message = Capture::open(folder.path().join("set")).unwrap_err().to_string();
    for part in ["tl000 pl000 tv000 pv000", "tv000_pv000_tl000_pl000", "hdr", ".csv", "theta_v"] {
        assert!(message.contains(part), "{message}");
    }
    let message = Capture::open(folder.path().join("set/holiday.png")).unwrap_err().to_string();
    for part in ["holiday.png", "Bonn", ".csv", ".btf"] {
        assert!(message.contains(part), "{message}");
    }
}
