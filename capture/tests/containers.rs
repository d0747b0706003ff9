//! UBO2014 files, written here from the published layout by a writer that shares nothing with the reader.

#[path = "support/ubo2014_writer.rs"]
mod ubo2014_writer;

use btf_capture::{Capture, CaptureError, ContainerKind, Cosine, Direction, Pixels};
use std::path::{Path, PathBuf};
use ubo2014_writer::{BdiStyle, FmfHead, PvfHead, Scene, Style, bdi, dfmf, fmf, pvf};

/// The offset that logarithms are taken with.
const EPS: f64 = 1e-5;

const YUV_TO_RGB: [[f64; 3]; 3] = [[1.0, 0.0, 1.13983], [1.0, -0.39465, -0.5806], [1.0, 2.03211, 0.0]];

/// Reflectances from 0.02 to far above 1, all different.
fn reflectance(view: usize, light: usize, texel: usize, channel: usize) -> f64 {
    let highlight = if (view + light + texel).is_multiple_of(7) { 25.0 } else { 0.0 };
    0.05 + 0.031 * ((texel * 5 + view * 3 + light * 2 + channel * 11) % 23) as f64 + highlight
}

/// 5 x 3 texels, 3 views x 4 lights in an order that is not the sorted one, `channel` of each colour.
fn scene(channels: &[&str], channel: impl Fn(&[f64]) -> Vec<f64>) -> Scene {
    let views = vec![[30.0, 90.0], [0.0, 0.0], [60.0, 352.5]];
    let lights = vec![[75.0, 10.0], [0.0, 0.0], [23.5, 180.0], [23.5, 7.5]];
    let mut values = Vec::new();
    for view in 0..views.len() {
        for light in 0..lights.len() {
            for texel in 0..15 {
                let colour: Vec<f64> = (0..channels.len()).map(|c| reflectance(view, light, texel, c)).collect();
                values.extend(channel(&colour));
            }
        }
    }
    let channels = channels.iter().map(|name| name.to_string()).collect();
    Scene { width: 5, height: 3, views, lights, channels, values }
}

fn rgb_scene() -> Scene {
    scene(&["R", "G", "B"], <[f64]>::to_vec)
}

struct File {
    _folder: tempfile::TempDir,
    path: PathBuf,
}

fn file(bytes: &[u8]) -> File {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloth.btf");
    std::fs::write(&path, bytes).unwrap();
    File { _folder: folder, path }
}

fn linear(capture: &Capture, view: usize, light: usize) -> Vec<f32> {
    match capture.read(view, light).unwrap() {
        Pixels::Linear(values) => values,
        other => panic!("not linear: {other:?}"),
    }
}

/// The largest difference relative to 0.05 + the value between the file and `expected(view, light, texel, channel)`,
/// where views and lights are numbered as in `scene`.
fn worst(path: &Path, scene: &Scene, expected: impl Fn(usize, usize, usize, usize) -> f64) -> f64 {
    let capture = Capture::open(path).unwrap();
    let place = |set: &btf_capture::DirectionSet, [theta, phi]: [f64; 2]| {
        set.directions().iter().position(|d| *d == Direction::new(theta, phi)).expect("a direction is as written")
    };
    let mut worst = 0f64;
    for (v, &view) in scene.views.iter().enumerate() {
        for (l, &light) in scene.lights.iter().enumerate() {
            let image = linear(&capture, place(&capture.info().views, view), place(&capture.info().lights, light));
            for (at, value) in image.iter().enumerate() {
                let expected = expected(v, l, at / 3, at % 3);
                worst = worst.max((f64::from(*value) - expected).abs() / (0.05 + expected.abs()));
            }
        }
    }
    worst
}

fn dfmf_rgb(scene: &Scene, style: &Style) -> Vec<u8> {
    dfmf(scene, style, 0, [0.0; 3], [0.0; 9])
}

#[test]
fn every_kind_gives_its_values_in_every_precision_either_way_round() {
    let scene = rgb_scene();
    let mut seen = Vec::new();
    for (scalar, tolerance) in [(2, 0.08), (4, 2e-5), (8, 2e-5)] {
        for transposed in [false, true] {
            let style = Style { scalar, transposed, ..Style::default() };
            let extended = |version, height_map| FmfHead::Extended { version, reduction: 0, height_map };
            let map = (2, 3, vec![0.5, -1.0, 2.0, 0.25, 8.0, 0.0]);
            let files = [
                (ContainerKind::Dfmf, dfmf_rgb(&scene, &style)),
                (ContainerKind::Fmf, fmf(&scene, &style, &FmfHead::Old)),
                (ContainerKind::Fmf, fmf(&scene, &style, &FmfHead::OldWithRotations)),
                (ContainerKind::Fmf, fmf(&scene, &style, &extended(0, None))),
                (ContainerKind::Fmf, fmf(&scene, &style, &extended(2, Some(map)))),
                (ContainerKind::Pvf, pvf(&scene, &style, &PvfHead::Plain)),
                (ContainerKind::Pvf, pvf(&scene, &style, &PvfHead::WithRotations)),
            ];
            for (kind, bytes) in files {
                let file = file(&bytes);
                let capture = Capture::open(&file.path).unwrap();
                assert_eq!(capture.container().unwrap().kind, kind);
                let error = worst(&file.path, &scene, reflectance);
                assert!(error < tolerance, "{} scalar {scalar} transposed {transposed}: {error}", kind.name());
                // A planted difference: the neighbouring texel.
                assert!(worst(&file.path, &scene, |v, l, t, c| reflectance(v, l, t + 1, c)) > 0.5);
                seen.push(error);
            }
        }
    }
    assert!(seen.iter().any(|error| *error > 1e-4), "half precision shows");
}

#[test]
fn what_the_header_says_is_taken() {
    let scene = rgb_scene();
    let rotation = [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let style = Style { rotations: vec![rotation; 2], ..Style::default() };
    let file = file(&dfmf_rgb(&scene, &style));
    let capture = Capture::open(&file.path).unwrap();
    let info = capture.info();
    assert_eq!((info.width, info.height, info.views.len(), info.lights.len()), (5, 3, 3, 4));
    assert_eq!(info.size_mm, Some([1.25, 0.75]));
    assert_eq!((info.name.as_str(), info.cosine), ("cloth", Cosine::Included));
    for part in ["UBO2014 DFMF", "12 components", "2 local frames", "test rig", "lamp"] {
        assert!(info.provenance.contains(part), "{}", info.provenance);
    }
    let container = capture.container().unwrap();
    assert_eq!((container.rotations.len(), container.rotations[1]), (2, rotation));
    assert_eq!(container.rgb_scale, [1.0, 1.5, 2.0]);
    assert!(capture.path_of(0, 1).contains("cloth.btf: view theta 0 phi 0, light theta 23.5 phi 7.5"));

    // Older descriptions: without channels, without text, without the word on the cosine.
    for version in 1..=3 {
        let file = self::file(&dfmf_rgb(&scene, &Style { version, cosine: 1, ..Style::default() }));
        let cosine = Capture::open(&file.path).unwrap().info().cosine;
        assert_eq!(cosine, if version == 1 { Cosine::Excluded } else { Cosine::Included }, "version {version}");
    }
}

#[test]
fn a_file_without_the_cosine_is_multiplied_by_it() {
    let scene = rgb_scene();
    let file = file(&dfmf_rgb(&scene, &Style { cosine: 0, ..Style::default() }));
    let cosine = |light: usize| scene.lights[light][0].to_radians().cos();
    assert!(worst(&file.path, &scene, |v, l, t, c| cosine(l) * reflectance(v, l, t, c)) < 2e-5);
    assert!(worst(&file.path, &scene, reflectance) > 0.5);
    // What stands beside the file goes before what stands in it.
    std::fs::write(file.path.with_extension("toml"), "cosine = \"included\"\nscale = 0.5\nname = \"wool\"").unwrap();
    assert!(worst(&file.path, &scene, |v, l, t, c| 0.5 * reflectance(v, l, t, c)) < 2e-5);
    assert_eq!(Capture::open(&file.path).unwrap().info().name, "wool");
    std::fs::write(file.path.with_extension("toml"), "name = \"wool\"\nscale = -1").unwrap();
    let message = Capture::open(&file.path).unwrap_err().to_string();
    assert!(message.contains("cloth.toml line 2"), "{message}");
}

#[test]
fn the_height_map_and_the_reduced_range_of_an_fmf_are_taken() {
    let logarithmic = scene(&["R", "G", "B"], |colour| colour.iter().map(|x| (x + EPS).ln()).collect());
    let map = (2, 3, vec![0.5, -1.0, 2.0, 0.25, 8.0, 0.0]);
    for transposed in [false, true] {
        let style = Style { transposed, ..Style::default() };
        let head = FmfHead::Extended { version: 2, reduction: 1, height_map: Some(map.clone()) };
        let file = file(&fmf(&logarithmic, &style, &head));
        assert!(worst(&file.path, &logarithmic, reflectance) < 1e-4);
        let capture = Capture::open(&file.path).unwrap();
        let found = capture.container().unwrap().height_map.clone().unwrap();
        assert_eq!((found.width, found.height), (2, 3));
        assert_eq!(found.values, [0.5, -1.0, 2.0, 0.25, 8.0, 0.0]);
    }
}

#[test]
fn a_factorisation_cut_to_fewer_components_is_read_to_its_first_ones() {
    let scene = rgb_scene();
    let bytes = fmf(&scene, &Style::default(), &FmfHead::Old);
    // The first count of components stands before the size of a number and the second count.
    let data = 4 * (15 + 36 * 15 + 15 * 15);
    let at = bytes.len() - data - 4 - 4 - 4 - 1 - 4;
    assert_eq!(bytes[at..at + 5], [15, 0, 0, 0, 4]);
    let mut cut = bytes.clone();
    cut[at] = 5;
    let (whole, cut) = (file(&bytes), file(&cut));
    assert_eq!(Capture::open(&cut.path).unwrap().container().unwrap().components, 5);
    let error = worst(&cut.path, &scene, reflectance);
    assert!(error > 0.01 && worst(&whole.path, &scene, reflectance) < 2e-5, "{error}");
}

#[test]
fn the_oldest_pvf_is_read_without_a_description() {
    let scene = rgb_scene();
    for transposed in [false, true] {
        let file = file(&pvf(&scene, &Style { transposed, ..Style::default() }, &PvfHead::Legacy));
        assert_eq!(Capture::open(&file.path).unwrap().info().cosine, Cosine::Excluded);
        let cosine = |light: usize| scene.lights[light][0].to_radians().cos();
        assert!(worst(&file.path, &scene, |v, l, t, c| cosine(l) * reflectance(v, l, t, c)) < 2e-5);
    }
}

#[test]
fn a_bdi_is_read_whole_sparse_and_by_chunks() {
    let scene = rgb_scene();
    let mut mask = vec![1u8; 15];
    (mask[0], mask[7], mask[8]) = (0, 0, 0);
    for compression in [0, 2] {
        for scanlines_per_chunk in [1, 2, 7] {
            for (rotations, full_last_chunk) in [(true, false), (true, true), (false, false), (false, true)] {
                let style =
                    BdiStyle { compression, scanlines_per_chunk, mask: mask.clone(), rotations, full_last_chunk };
                let file = file(&bdi(&scene, &Style::default(), &style));
                let expected = |v, l, t: usize, c| {
                    if compression == 2 && mask[t] == 0 { 0.0 } else { reflectance(v, l, t, c) }
                };
                let error = worst(&file.path, &scene, expected);
                assert!(error < 1e-3, "{compression} {scanlines_per_chunk} {rotations}: {error}");
            }
        }
    }
    let style = BdiStyle { compression: 1, scanlines_per_chunk: 1, mask, rotations: true, full_last_chunk: false };
    let message = Capture::open(&file(&bdi(&scene, &Style::default(), &style)).path).unwrap_err().to_string();
    assert!(message.contains("bzip2"), "{message}");
}

/// The inverse of a 3 x 3 matrix by cofactors.
fn inverse(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let cofactor = |r: usize, c: usize| {
        let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
    };
    let determinant: f64 = (0..3).map(|c| m[0][c] * cofactor(0, c)).sum();
    std::array::from_fn(|r| std::array::from_fn(|c| cofactor(c, r) / determinant))
}

fn times(m: &[[f64; 3]; 3], x: &[f64]) -> [f64; 3] {
    m.map(|row| row[0] * x[0] + row[1] * x[1] + row[2] * x[2])
}

#[test]
fn every_colour_model_gives_the_colour_that_went_in() {
    let yuv_of = |rgb: &[f64]| times(&inverse(YUV_TO_RGB), rgb);
    let (mean, axes) = ([0.2, 0.3, 0.1], [0.6, 0.0, 0.8, 0.0, 1.0, 0.0, -0.8, 0.0, 0.6]);
    // Linear sRGB to XYZ relative to D50, Bradford (published by the same standard as the reader's inverse).
    let xyz_of = [
        [0.436_074_7, 0.385_064_9, 0.143_080_4],
        [0.222_504_5, 0.716_878_6, 0.060_616_9],
        [0.013_932_2, 0.097_104_5, 0.714_173_3],
    ];
    let lab_of = |rgb: &[f64]| {
        let xyz = times(&xyz_of, rgb);
        let f = |t: f64| if t > 0.008_856_45 { t.cbrt() } else { 7.787_037 * t + 4.0 / 29.0 };
        let [x, y, z] = [f(xyz[0] / 0.96422), f(xyz[1]), f(xyz[2] / 0.82521)];
        vec![116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    };
    let forward = |model: i32, rgb: &[f64]| -> Vec<f64> {
        let [y, u, v] = yuv_of(rgb);
        match model {
            0 => rgb.to_vec(),
            1 => vec![y, u, v],
            2 => lab_of(rgb),
            3 => {
                // The rows of the matrix are orthonormal, so its transpose undoes it.
                let d: Vec<f64> = (0..3).map(|c| rgb[c] - mean[c]).collect();
                (0..3).map(|r| (0..3).map(|c| d[c] * axes[r * 3 + c]).sum()).collect()
            }
            4 => {
                let [r, g, b] = [rgb[0], rgb[1], rgb[2]];
                vec![(r + 2.0 * g + b) / 4.0, (r - b) / 2.0, (2.0 * g - r - b) / 4.0]
            }
            5 => {
                let sum: f64 = rgb.iter().sum();
                std::iter::once(sum).chain(rgb[1..].iter().map(|x| x / sum)).collect()
            }
            6 => {
                // With s = 3 c0 the file's reader has x1 = s - (c1 + c2)/3 and xi = s (1 + ci), so s solves a square.
                let half = (2.0 / 3.0 - rgb[0]) / 2.0;
                let s = -half + (half * half + (rgb[1] + rgb[2]) / 3.0).sqrt();
                vec![s / 3.0, rgb[1] / s - 1.0, rgb[2] / s - 1.0]
            }
            9 => vec![(y + EPS).ln(), u, v],
            10 => {
                let log = |x: f64| x.signum() * (x.abs() / EPS).ln();
                vec![(y + EPS).ln(), log(u), log(v)]
            }
            11 => vec![(y + EPS).ln(), u / (y + EPS), v / (y + EPS)],
            _ => rgb.iter().map(|x| (x + EPS).ln()).collect(),
        }
    };
    let names = ["R", "G", "B"];
    for model in [0, 1, 2, 3, 4, 5, 6, 9, 10, 11, 12] {
        let scene = scene(&names, |rgb| forward(model, rgb));
        let file = file(&dfmf(&scene, &Style { scalar: 8, ..Style::default() }, model, mean, axes));
        let error = worst(&file.path, &scene, reflectance);
        // Lab ends in a rounded matrix; logarithms of large numbers in single precision.
        let tolerance = if model == 2 { 2e-3 } else { 2e-4 };
        assert!(error < tolerance, "model {model}: {error}");
        assert_eq!(Capture::open(&file.path).unwrap().container().unwrap().colour_model, model);
        // A planted difference: the next model's values.
        if model != 12 {
            let other = if matches!(model, 6) { 9 } else { model + 1 };
            let file = self::file(&dfmf(&scene, &Style::default(), other, mean, axes));
            let opened = Capture::open(&file.path);
            let differs = opened.is_err() || worst_or_refused(&file.path, &scene, reflectance) > 0.01;
            assert!(differs, "model {model} read as {other}");
        }
    }
    for unknown in [7, 8, 13, -1] {
        let bytes = dfmf(&rgb_scene(), &Style::default(), unknown, mean, axes);
        let message = Capture::open(&file(&bytes).path).unwrap_err().to_string();
        assert!(message.contains(&format!("colour model {unknown}")), "{message}");
    }
}

/// As [`worst`], infinite where an image is refused.
fn worst_or_refused(path: &Path, scene: &Scene, expected: impl Fn(usize, usize, usize, usize) -> f64) -> f64 {
    let capture = Capture::open(path).unwrap();
    let (views, lights) = (scene.views.len(), scene.lights.len());
    if (0..views * lights).any(|pair| capture.read(pair / lights, pair % lights).is_err()) {
        return f64::INFINITY;
    }
    worst(path, scene, expected)
}

#[test]
fn spectra_become_rgb_with_white_at_one_and_channel_names_decide_the_order() {
    // A grey spectrum, so that the colour is known without a table.
    let names: Vec<String> = (0..8).map(|i| (700 - 40 * i).to_string()).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let grey = |spectrum: &[f64]| vec![spectrum[0]; spectrum.len()];
    let spectral = scene(&names, grey);
    let expected = |v, l, t, _| reflectance(v, l, t, 0);
    let mean = ([0.0; 3], [0.0; 9]);
    for bytes in [
        dfmf(&spectral, &Style::default(), 0, mean.0, mean.1),
        fmf(&spectral, &Style::default(), &FmfHead::Old),
        pvf(&spectral, &Style { transposed: true, ..Style::default() }, &PvfHead::Plain),
    ] {
        let file = file(&bytes);
        assert!(worst(&file.path, &spectral, expected) < 1e-4);
        assert_eq!(Capture::open(&file.path).unwrap().container().unwrap().channels.len(), 8);
    }
    // The spectral colour models, with as many channels.
    let shares = scene(&names, |s| {
        let sum = s[0] * s.len() as f64;
        std::iter::once(sum).chain(s[1..].iter().map(|_| s[0] / sum)).collect()
    });
    let file_of_shares = file(&dfmf(&shares, &Style::default(), 5, mean.0, mean.1));
    assert!(worst(&file_of_shares.path, &shares, expected) < 1e-4);

    let reversed = scene(&["B", "G", "R"], <[f64]>::to_vec);
    let file_of_bgr = file(&fmf(&reversed, &Style::default(), &FmfHead::Old));
    assert!(worst(&file_of_bgr.path, &reversed, |v, l, t, c| reflectance(v, l, t, 2 - c)) < 2e-5);
    let single = scene(&["Y"], <[f64]>::to_vec);
    let file_of_grey = file(&fmf(&single, &Style::default(), &FmfHead::Old));
    assert!(worst(&file_of_grey.path, &single, |v, l, t, _| reflectance(v, l, t, 0)) < 2e-5);

    for (names, part) in [(vec!["a", "b", "c", "d"], "wavelengths"), (vec!["500", "500nm"], "one wavelength")] {
        let bytes = fmf(&scene(&names, <[f64]>::to_vec), &Style::default(), &FmfHead::Old);
        let message = Capture::open(&file(&bytes).path).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    }
    let bytes = dfmf(&scene(&["450", "550"], <[f64]>::to_vec), &Style::default(), 11, mean.0, mean.1);
    let message = Capture::open(&file(&bytes).path).unwrap_err().to_string();
    assert!(message.contains("needs 3 channels"), "{message}");
}

#[test]
fn colours_outside_the_gamut_are_held_at_the_limit_and_infinity_is_refused() {
    let mut scene = rgb_scene();
    scene.values[0] = -7.0;
    scene.values[1] = -0.05;
    let capture = Capture::open(&file(&fmf(&scene, &Style::default(), &FmfHead::Old)).path).unwrap();
    // View 0 and light 0 of the file stand at other places of the sorted sets.
    let image = linear(&capture, 1, 3);
    assert!((image[0] + 0.1).abs() < 1e-6 && (image[1] + 0.05).abs() < 1e-4, "{:?}", &image[..3]);

    scene.values[2] = 1e3;
    let file = file(&dfmf(&scene, &Style::default(), 12, [0.0; 3], [0.0; 9]));
    let capture = Capture::open(&file.path).unwrap();
    match capture.read(1, 3) {
        Err(error @ CaptureError::BadValue { .. }) => assert!(error.to_string().contains("cloth.btf: view theta 30")),
        other => panic!("{other:?}"),
    }
}

#[test]
fn threads_and_order_do_not_change_an_image() {
    use rayon::prelude::*;
    let scene = rgb_scene();
    let file = file(&dfmf_rgb(&scene, &Style { scalar: 2, ..Style::default() }));
    let capture = Capture::open(&file.path).unwrap();
    let alone: Vec<Vec<f32>> = (0..12).map(|pair| linear(&capture, pair / 4, pair % 4)).collect();
    let together: Vec<Vec<f32>> =
        (0..1200usize).into_par_iter().map(|i| linear(&capture, i * 7 % 12 / 4, i * 7 % 12 % 4)).collect();
    assert!(together.iter().enumerate().all(|(i, image)| *image == alone[i * 7 % 12]));
}

fn assert_one_sentence(error: &CaptureError) {
    let text = error.to_string();
    assert!(text.contains("cloth.btf") && !text.contains('\n') && !text.ends_with('.'), "{text}");
}

#[test]
fn a_cut_file_is_refused_with_one_sentence() {
    for bytes in ubo2014_writer::one_of_each_kind() {
        let file = file(&bytes);
        assert!(Capture::open(&file.path).is_ok());
        for length in [0, 5, 10, 11, 200, 300, 400, bytes.len() / 2, bytes.len() - 1] {
            std::fs::write(&file.path, &bytes[..length]).unwrap();
            match Capture::open(&file.path) {
                Err(error @ CaptureError::BadContainer { .. }) => assert_one_sentence(&error),
                other => panic!("prefix of {length}: {other:?}"),
            }
        }
        // And a byte too many.
        std::fs::write(&file.path, [&bytes[..], &[0]].concat()).unwrap();
        assert_one_sentence(&Capture::open(&file.path).unwrap_err());
    }
}

#[test]
fn headers_that_contradict_themselves_are_refused_by_name() {
    let scene = rgb_scene();
    let good = dfmf_rgb(&scene, &Style::default());
    let replaced = |from: &[u8], to: &[u8]| {
        let at = good.windows(from.len()).position(|window| window == from).expect("the field is there");
        let mut bytes = good.clone();
        bytes[at..at + to.len()].copy_from_slice(to);
        bytes
    };
    let message = |bytes: &[u8]| Capture::open(&file(bytes).path).unwrap_err().to_string();
    // The size of the description one too small.
    let size = u32::from_le_bytes(good[10..14].try_into().unwrap());
    let mut bytes = good.clone();
    bytes[10..14].copy_from_slice(&(size - 1).to_le_bytes());
    assert!(message(&bytes).contains(&format!("claims {} bytes and has {size}", size - 1)));
    // An unknown kind.
    let text = message(&replaced(b"!DFMF08FCR", b"!DFMF09FCR"));
    assert!(text.contains("!DFMF09FCR") && text.contains("!BDIF06R2!"), "{text}");
    // Numbers of three bytes.
    let counts: Vec<u8> = [12u32, 12, 15].iter().flat_map(|n| n.to_le_bytes()).collect();
    let with_scalar = |scalar: u8| [&[scalar][..], &counts[..]].concat();
    assert!(message(&replaced(&with_scalar(4), &with_scalar(3))).contains("3 bytes"));
    // Rows that are neither texels nor pairs, and no components at all.
    let rows = |numbers: [u32; 3]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    assert!(message(&replaced(&rows([12, 12, 15]), &rows([12, 13, 15]))).contains("13 and 15 rows"));
    assert!(message(&replaced(&rows([12, 12, 15]), &rows([0, 12, 15]))).contains("without components"));
    // A view with another number of lights, and a direction twice.
    let angles = |[theta, phi]: [f64; 2]| {
        [theta, phi].iter().flat_map(|a| (a.to_radians() as f32).to_le_bytes()).collect::<Vec<u8>>()
    };
    let with_count = |count: u32| [angles(scene.views[1]), count.to_le_bytes().to_vec()].concat();
    assert!(message(&replaced(&with_count(4), &with_count(3))).contains("3 lights and its first has 4"));
    let first_view = [3u32.to_le_bytes().to_vec(), angles(scene.views[0])].concat();
    let same_view = [3u32.to_le_bytes().to_vec(), angles(scene.views[1])].concat();
    let text = message(&replaced(&first_view, &same_view));
    assert!(text.contains("views") && text.contains("comes twice"), "{text}");
    let below = [3u32.to_le_bytes().to_vec(), angles([300.0, 0.0])].concat();
    assert!(message(&replaced(&first_view, &below)).contains("no direction"));
    // A light behind a front side.
    let behind = Scene { lights: vec![[120.0, 0.0]], values: scene.values[..3 * 15 * 3].to_vec(), ..scene };
    let file = file(&dfmf_rgb(&behind, &Style::default()));
    assert!(matches!(Capture::open(&file.path).unwrap_err(), CaptureError::BadSides { .. }));
    std::fs::write(file.path.with_extension("toml"), "side = \"transmission-back\"").unwrap();
    assert!(Capture::open(&file.path).is_ok());
}
