//! Numerical extremes: each row of the table in docs/TRADE.md is a test here. Every one gives a finite asset with its
//! error figure, or a clear error. `cargo test -p btf-fit --test extremes -- --nocapture` prints the table's lines.

use btf_capture::{Capture, CaptureInfo, CaptureWriter, Direction, DirectionSet, ImageFormat};
use btf_fit::{ErrorMeasure, FitError, FitParams, Fitted, Monitor, fit_and_measure};
use btf_runtime::{Asset, DecodeOptions, Interpolation, Resident, decode};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::path::Path;
use tempfile::TempDir;

type Sample<'a> = &'a (dyn Fn(usize, [f32; 3], [f32; 3]) -> [f32; 3] + Sync);

/// A capture of `width` x `height` texels, `value(texel, wi, wo)`.
fn capture_with(
    folder: &Path,
    [width, height]: [usize; 2],
    views: &DirectionSet,
    lights: &DirectionSet,
    format: ImageFormat,
    value: Sample,
) -> Capture {
    let path = folder.join("capture");
    let info = CaptureInfo::new("extreme", width, height, views.clone(), lights.clone(), format);
    let writer = CaptureWriter::create(&path, info).unwrap();
    for (v, wo) in views.units().iter().enumerate() {
        for (l, wi) in lights.units().iter().enumerate() {
            let image: Vec<f32> = (0..width * height).flat_map(|texel| value(texel, *wi, *wo)).collect();
            writer.write(v, l, &image).unwrap();
        }
    }
    writer.finish().unwrap();
    Capture::open(&path).unwrap()
}

fn exr(folder: &Path, grid: [usize; 2], views: &DirectionSet, lights: &DirectionSet, value: Sample) -> Capture {
    capture_with(folder, grid, views, lights, ImageFormat::Exr, value)
}

fn set(count: usize) -> DirectionSet {
    DirectionSet::random(count, 7).unwrap()
}

fn params(folder: &TempDir) -> FitParams {
    FitParams { cache_directory: folder.path().to_path_buf(), ..FitParams::default() }
}

fn small(folder: &TempDir) -> FitParams {
    FitParams { bytes: Some(20_000), ..params(folder) }
}

fn fit(capture: Capture, params: &FitParams) -> Result<Fitted, FitError> {
    fit_and_measure(&[capture], params, &Monitor::default())
}

/// Fits, checks that the packed asset decodes to finite numbers from everywhere, and prints the table's line.
fn finite(row: &str, capture: Capture, params: &FitParams) -> Fitted {
    let fitted = fit(capture, params).unwrap();
    let asset = Asset::parse(&fitted.bytes).unwrap();
    let resident = Resident::from_asset(&asset);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(11);
    let mut unit = || loop {
        let d: [f32; 3] = [random.gen_range(-1.0..1.0), random.gen_range(-1.0..1.0), random.gen_range(1e-4..1.0)];
        let length = d.iter().map(|x| x * x).sum::<f32>().sqrt();
        if length < 1.0 {
            break d.map(|x| x / length);
        }
    };
    let texels = asset.texel_count() as u32;
    for i in 0..3000u32 {
        let (wi, wo) = (unit(), unit());
        let interpolation = if i % 2 == 0 { Interpolation::Fast } else { Interpolation::Exact };
        let components = if i % 5 == 0 { i % 3 } else { u32::MAX };
        let options = DecodeOptions { interpolation, components, ..DecodeOptions::default() };
        let rgb = decode(&resident, 0, i.wrapping_mul(2_654_435_761) % texels, wi, wo, &options);
        assert!(rgb.iter().all(|x| x.is_finite() && *x >= 0.0), "{row}: {rgb:?} at {wi:?} {wo:?}");
    }
    let layer = &asset.layers[0];
    assert!(layer.dictionary.iter().flatten().all(|entry| entry.weight_scale.is_finite()), "{row}");
    let m = &fitted.metrics;
    let figures = [m.rel_rmse, m.worst_texel_rmse, m.delta_e00_mean.unwrap_or(0.0)];
    assert!(figures.iter().all(|x| x.is_finite()) && !m.psnr_db.is_nan() && !m.psnr_linear_db.is_nan(), "{row}: {m:?}");
    told(row, &format!("{:.2} dB, {:.2e}", m.psnr_db, m.rel_rmse));
    fitted
}

/// Prints a row, and sees that docs/TRADE.md has it.
fn told(row: &str, figures: &str) {
    println!("| {row} | {figures} |");
    let table = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/TRADE.md")).unwrap();
    assert!(table.contains(&format!("\n| {row} |")), "docs/TRADE.md has no row `{row}`");
}

fn lambertian(albedo: f32, wi: [f32; 3]) -> [f32; 3] {
    [albedo * wi[2], 0.7 * albedo * wi[2], 0.4 * albedo * wi[2]]
}

#[test]
fn a_constant_capture() {
    let folder = tempfile::tempdir().unwrap();
    let capture = exr(folder.path(), [8, 8], &set(6), &set(7), &|_, _, _| [0.25; 3]);
    let fitted = finite("constant capture", capture, &params(&folder));
    assert!(fitted.metrics.psnr_db > 38.0 && fitted.metrics.rel_rmse < 0.06, "{:?}", fitted.metrics);
    let capture = Capture::open(folder.path().join("capture")).unwrap();
    let fitted = finite("constant capture, `--bytes 20kB`", capture, &small(&folder));
    assert!(fitted.metrics.psnr_db > 55.0 && fitted.metrics.rel_rmse < 0.003, "{:?}", fitted.metrics);
}

#[test]
fn a_black_capture() {
    for (format, row) in [(ImageFormat::Exr, "black capture"), (ImageFormat::Png, "black capture, 8 bits")] {
        let folder = tempfile::tempdir().unwrap();
        let capture = capture_with(folder.path(), [8, 8], &set(6), &set(7), format, &|_, _, _| [0.0; 3]);
        let fitted = finite(row, capture, &params(&folder));
        assert!(
            fitted.metrics.psnr_db == f64::INFINITY && fitted.metrics.worst_texel_rmse < 1e-4,
            "{:?}",
            fitted.metrics
        );
    }
}

#[test]
fn one_texel() {
    let folder = tempfile::tempdir().unwrap();
    let capture = exr(folder.path(), [1, 1], &set(6), &set(7), &|_, wi, _| lambertian(0.5, wi));
    let fitted = finite("one texel", capture, &params(&folder));
    assert!(fitted.metrics.psnr_db > 45.0, "{:?}", fitted.metrics);
}

#[test]
fn one_direction() {
    let one = DirectionSet::new(vec![Direction::new(30.0, 40.0)]).unwrap();
    let value = |texel: usize, _: [f32; 3], _: [f32; 3]| [0.2 + 0.01 * (texel % 9) as f32, 0.3, 0.1];
    for (views, lights, row) in
        [(&one, &one, "one direction"), (&one, &set(5), "one view"), (&set(5), &one, "one light")]
    {
        let folder = tempfile::tempdir().unwrap();
        let capture = exr(folder.path(), [9, 7], views, lights, &value);
        let fitted = finite(row, capture, &params(&folder));
        assert!(fitted.metrics.psnr_db > 38.0, "{:?}", fitted.metrics);
    }
}

#[test]
fn two_identical_clusters() {
    let folder = tempfile::tempdir().unwrap();
    // Two kinds of texels; seven clusters are asked for, so that several hold the same.
    let value = |texel: usize, wi: [f32; 3], _: [f32; 3]| lambertian(if texel % 2 == 0 { 0.2 } else { 0.6 }, wi);
    let capture = exr(folder.path(), [8, 8], &set(6), &set(7), &value);
    let fitted = finite("two identical clusters", capture, &FitParams { clusters: 7, ..params(&folder) });
    assert!(fitted.metrics.psnr_db > 40.0 && fitted.clusters <= 7, "{:?}", fitted.metrics);
}

#[test]
fn all_texels_equal() {
    let folder = tempfile::tempdir().unwrap();
    let gloss = |_: usize, wi: [f32; 3], wo: [f32; 3]| {
        let base = lambertian(0.4, wi);
        base.map(|x| x + 0.3 * (wi[2] * wo[2] - wi[0] * wo[0] - wi[1] * wo[1]).max(0.0).powi(8))
    };
    let capture = exr(folder.path(), [8, 8], &set(8), &set(9), &gloss);
    let fitted = finite("all texels equal", capture, &params(&folder));
    assert!(fitted.metrics.psnr_db > 35.0, "{:?}", fitted.metrics);
    let capture = Capture::open(folder.path().join("capture")).unwrap();
    let fitted = finite("all texels equal, `--bytes 20kB`", capture, &small(&folder));
    assert!(fitted.metrics.psnr_db > 55.0, "{:?}", fitted.metrics);
}

#[test]
fn more_clusters_than_texels() {
    let folder = tempfile::tempdir().unwrap();
    let value = |texel: usize, wi: [f32; 3], _: [f32; 3]| lambertian(0.1 + 0.1 * texel as f32, wi);
    let capture = exr(folder.path(), [3, 2], &set(6), &set(7), &value);
    let fitted = finite("more clusters than texels", capture, &FitParams { clusters: 256, ..params(&folder) });
    assert!(fitted.metrics.psnr_db > 40.0 && fitted.clusters <= 6, "{:?}", fitted.metrics);
}

#[test]
fn a_mirror_sharp_highlight() {
    let folder = tempfile::tempdir().unwrap();
    // Full width at half height under half a degree; the grid's steps are 15 degrees. Light and view sets are the
    // same turned by half a circle, so that a few pairs are in the mirror's direction.
    let views = DirectionSet::bonn81();
    let kept: Vec<Direction> = views.directions().iter().copied().filter(|d| d.theta_deg < 50.0).step_by(2).collect();
    let views = DirectionSet::new(kept.clone()).unwrap();
    let across = kept.iter().map(|d| Direction::new(d.theta_deg, (d.phi_deg + 180.0) % 360.0)).collect();
    let lights = DirectionSet::new(across).unwrap();
    let value = |texel: usize, wi: [f32; 3], wo: [f32; 3]| {
        let sum = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
        let half_z = sum[2] / sum.iter().map(|x| x * x).sum::<f32>().sqrt();
        let peak = if half_z > 0.0 { 200.0 * (f64::from(half_z).min(1.0).powf(2e5) as f32) } else { 0.0 };
        lambertian(0.2 + 0.002 * (texel % 30) as f32, wi).map(|x| x + peak * wi[2])
    };
    let capture = exr(folder.path(), [8, 8], &views, &lights, &value);
    let fitted = finite("mirror-sharp highlight", capture, &params(&folder));
    assert!(fitted.metrics.psnr_db > 30.0 && fitted.metrics.rel_rmse < 0.5, "{:?}", fitted.metrics);
}

#[test]
fn a_million_beside_a_millionth() {
    let folder = tempfile::tempdir().unwrap();
    let (views, lights) = (set(5), set(6));
    // Texel by texel, single precision: half ends at 65504.
    let value = |texel: usize, wi: [f32; 3]| if texel.is_multiple_of(3) { 1e6 * wi[2] } else { 1e-6 };
    exr(folder.path(), [6, 6], &views, &lights, &|_, _, _| [0.0; 3]);
    rewrite(folder.path(), &lights, [6, 6], &|texel, wi| [value(texel, wi); 3]);
    let open = || Capture::open(folder.path().join("capture")).unwrap();
    let fitted = finite("1e6 beside 1e-6", open(), &params(&folder));
    assert!(fitted.metrics.rel_rmse < 0.01, "{:?}", fitted.metrics);
    // Where the asset must be a million it is, and where it must be nothing it is nearly that.
    let asset = Asset::parse(&fitted.bytes).unwrap();
    let resident = Resident::from_asset(&asset);
    let zenith = (0..6).max_by(|a, b| lights.units()[*a][2].total_cmp(&lights.units()[*b][2])).unwrap();
    let (wi, wo) = (lights.units()[zenith], views.units()[2]);
    let options = DecodeOptions::default();
    let bright = decode(&resident, 0, 0, wi, wo, &options)[0];
    let dark = decode(&resident, 0, 1, wi, wo, &options)[0];
    assert!((bright / value(0, wi) - 1.0).abs() < 0.01 && dark < 0.01, "{bright} and {dark}");
    println!("  {bright:.4e} for {:.4e}, {dark:.2e} for 1e-6", value(0, wi));

    // The other curves end below that: better no asset than one that is wrong by a factor of eight.
    for (error, most) in [(ErrorMeasure::Linear, "65504"), (ErrorMeasure::Log, "162754")] {
        let refused = fit(open(), &FitParams { error, ..params(&folder) }).err().unwrap().to_string();
        assert!(refused.contains(".exr") && refused.contains(most) && refused.contains("--error gamma"), "{refused}");
    }
    told(
        "1e6 beside 1e-6, `--error linear` or `log`",
        "refused: the file is named, with 65,504 and 162,754 as what fits",
    );
}

/// Writes every image of the capture again, in single precision and unchecked.
fn rewrite(
    folder: &Path,
    lights: &DirectionSet,
    [width, height]: [usize; 2],
    value: &(dyn Fn(usize, [f32; 3]) -> [f32; 3] + Sync),
) {
    let views = std::fs::read_dir(folder.join("capture")).unwrap().map(|entry| entry.unwrap().path());
    for view in views.filter(|path| path.is_dir()) {
        for image in std::fs::read_dir(view).unwrap().map(|entry| entry.unwrap().path()) {
            let name = image.file_name().unwrap().to_str().unwrap();
            let number = |after: &str| -> f64 {
                name.split(after).nth(1).unwrap().split([' ', '.']).next().unwrap().parse().unwrap()
            };
            let light = lights
                .directions()
                .iter()
                .position(|d| (d.theta_deg - number("tl")).abs() < 1.0 && (d.phi_deg - number("pl")).abs() < 1.0)
                .unwrap();
            let wi = lights.units()[light];
            exr::prelude::write_rgb_file(&image, width, height, |x, y| {
                let [r, g, b] = value(y * width + x, wi);
                (r, g, b)
            })
            .unwrap();
        }
    }
}

#[test]
fn grazing_light() {
    let folder = tempfile::tempdir().unwrap();
    let low = [0.0, 60.0, 89.0, 89.9].iter().flat_map(|theta| {
        let around = if *theta == 0.0 { 1 } else { 5 };
        (0..around).map(move |i| Direction::new(*theta, 72.0 * f64::from(i)))
    });
    let low = DirectionSet::new(low.collect()).unwrap();
    let value = |texel: usize, wi: [f32; 3], wo: [f32; 3]| {
        let sheen = 0.5 * (1.0 - wi[2]).powi(5) * (1.0 - wo[2]).powi(5);
        lambertian(0.3 + 0.02 * (texel % 8) as f32, wi).map(|x| x + sheen)
    };
    let capture = exr(folder.path(), [8, 8], &low, &low, &value);
    let fitted = finite("light and view at 89.9 degrees", capture, &params(&folder));
    assert!(fitted.metrics.psnr_db > 32.0, "{:?}", fitted.metrics);
}

#[test]
fn not_a_number() {
    let folder = tempfile::tempdir().unwrap();
    let (views, lights) = (set(3), set(3));
    exr(folder.path(), [4, 4], &views, &lights, &|_, _, _| [0.5; 3]);
    let last = lights.units()[2];
    for (bad, word) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf")] {
        rewrite(folder.path(), &lights, [4, 4], &|texel, wi| {
            if wi == last && texel == 9 { [0.5, bad, 0.5] } else { [0.5; 3] }
        });
        // The first image may be fine; the fit reads them all.
        let refused = Capture::open(folder.path().join("capture")).map_err(FitError::from);
        let refused = refused.and_then(|capture| fit(capture, &params(&folder)).map(|_| ())).unwrap_err().to_string();
        let named = refused.contains(".exr") && refused.contains(word) && refused.contains("column 1, row 2");
        assert!(named && refused.lines().count() == 1, "{refused}");
    }
    told("NaN or infinity", "refused: file, texel and channel are named");
}

#[test]
fn small_negative_values() {
    let folder = tempfile::tempdir().unwrap();
    let value = |texel: usize, wi: [f32; 3], _: [f32; 3]| [0.4 * wi[2], if texel % 4 == 0 { -0.02 } else { 0.1 }, 0.2];
    let capture = exr(folder.path(), [8, 8], &set(5), &set(6), &value);
    let btf_capture::Pixels::Linear(kept) = capture.read(0, 0).unwrap() else { panic!("EXR is linear") };
    assert!((kept[1] + 0.02).abs() < 1e-4, "the capture keeps the sign: {}", kept[1]);
    let fitted = finite("small negative input", capture, &params(&folder));
    // The asset gives 0 there (docs/MODEL.md, section 4); the error that is told is that against -0.02.
    let quarter = 0.02 / (3.0f64).sqrt();
    assert!(
        fitted.metrics.worst_texel_rmse > 0.8 * quarter && fitted.metrics.worst_texel_rmse < 1.5 * quarter,
        "{:?}",
        fitted.metrics
    );
    let below = exr_below(folder.path());
    assert!(below.contains("-0.2") && below.contains("at least -0.1"), "{below}");
}

fn exr_below(folder: &Path) -> String {
    rewrite(folder, &set(6), [8, 8], &|_, _| [-0.2; 3]);
    Capture::open(folder.join("capture")).unwrap_err().to_string()
}

#[test]
fn a_weight_above_half_precision() {
    let folder = tempfile::tempdir().unwrap();
    let (views, lights) = (set(5), set(6));
    exr(folder.path(), [6, 6], &views, &lights, &|_, _, _| [0.0; 3]);
    rewrite(folder.path(), &lights, [6, 6], &|texel, wi| [3e5 * wi[2] * (1.0 + 0.05 * (texel % 5) as f32); 3]);
    let capture = Capture::open(folder.path().join("capture")).unwrap();
    let fitted = finite("weight above half precision", capture, &params(&folder));
    let scales = fitted.asset.layers[0].dictionary.iter().flatten().map(|entry| entry.weight_scale);
    let most = scales.fold(0.0f32, f32::max);
    assert!(most.is_finite() && fitted.metrics.rel_rmse < 0.2, "{most} {:?}", fitted.metrics);
}

#[test]
fn more_texels_and_references_than_16_bits() {
    let folder = tempfile::tempdir().unwrap();
    const SIDE: usize = 272;
    // A stripe beyond texel 65,536 that no earlier texel looks like: an index cut to 16 bits would fetch another.
    let value = |texel: usize, wi: [f32; 3], _: [f32; 3]| {
        if texel >= 70_000 { [0.05 * wi[2], 0.9 * wi[2], 0.1] } else { lambertian(0.3 + 0.1 * (texel % 7) as f32, wi) }
    };
    let capture = capture_with(folder.path(), [SIDE, SIDE], &set(3), &set(4), ImageFormat::Png, &value);
    let fitted = finite("more than 65,536 texels", capture, &FitParams { clusters: 4, ..params(&folder) });
    let references = fitted.asset.layers[0].lobe_refs.len();
    assert!(SIDE * SIDE > 1 << 16 && references > 1 << 16, "{references} references");
    assert!(fitted.metrics.psnr_db > 35.0 && fitted.metrics.worst_texel_rmse < 0.1, "{:?}", fitted.metrics);
}
