//! Four captures of a leaf - each face, and the light through it seen from each face - become one asset whose layers
//! agree with the leaf in every texel. The leaf here is a formula with nothing symmetric about it, and the sample is
//! turned over by hand, so that a column or an x that is mirrored once too often or too seldom shows.

use btf_capture::{Capture, CaptureInfo, DirectionSet, ImageFormat, Pixels, Side};
use btf_fit::{
    ExpandParams, FitOutcome, FitParams, FitRecord, Material, MeasureParams, Monitor, description_bytes, expand, fit,
    layer_for_capture, measure,
};
use btf_runtime::{Asset, DecodeOptions, Interpolation, Resident, decode, pack};
use btf_tests::{capture_from, resident, small_fit};
use std::path::Path;

const WIDTH: usize = 9;
const HEIGHT: usize = 7;

/// The leaf, all in the front's frame: z of a direction is negative behind, columns are the front's. A red mark
/// stands in the front's upper left corner and shines through; the texture rises to the right and falls downwards;
/// light from the right (front) or from the left (back) is brighter.
fn leaf(column: usize, row: usize, wi: [f32; 3], wo: [f32; 3]) -> [f32; 3] {
    let (light_back, eye_back) = (wi[2] < 0.0, wo[2] < 0.0);
    let tint = match (light_back, eye_back) {
        (false, false) => [0.10, 0.30, 0.06],
        (true, true) => [0.22, 0.36, 0.18],
        (true, false) => [0.12, 0.26, 0.02],
        (false, true) => [0.09, 0.21, 0.03],
    };
    let texture = 0.6 + 0.08 * column as f32 - 0.03 * row as f32;
    let lean = if light_back { -0.4 } else { 0.35 };
    let shape = 1.0 + lean * wi[0] + 0.2 * wo[0] + 0.15 * wi[1];
    let mark = if column < 3 && row < 2 { [4.0, 0.5, 1.5] } else { [1.0; 3] };
    [0, 1, 2].map(|c| tint[c] * mark[c] * texture * shape * wi[2].abs())
}

/// The rule of docs/MODEL.md, section 7, written out once more.
fn front_frame(side: Side, direction: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = direction;
    match side {
        Side::Front | Side::TransmissionBack => [x, y, z],
        Side::Back | Side::TransmissionFront => [-x, y, -z],
    }
}

fn front_column(side: Side, column: usize) -> usize {
    match side {
        Side::Front | Side::TransmissionBack => column,
        Side::Back | Side::TransmissionFront => WIDTH - 1 - column,
    }
}

/// Which mirroring is left out of a capture of the back, as a planted mistake.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Slip {
    None,
    Columns,
    X,
}

fn info(side: Side) -> CaptureInfo {
    let seed = Side::ALL.iter().position(|s| *s == side).unwrap() as u64;
    let (views, lights) = (DirectionSet::random(13, 20 + seed).unwrap(), DirectionSet::random(15, 30 + seed).unwrap());
    let lights = if side.is_transmission() { lights.behind().unwrap() } else { lights };
    let new = CaptureInfo::new(side.to_string(), WIDTH, HEIGHT, views, lights, ImageFormat::Png);
    CaptureInfo { side, ..new }
}

/// What a camera sees of `side`, with the sample turned over where it must be.
fn photographed(folder: &Path, side: Side, slip: Slip) -> Capture {
    capture_from(folder, info(side), |texel, wi, wo| {
        let (column, row) = (texel % WIDTH, texel / WIDTH);
        let column = if slip == Slip::Columns { column } else { front_column(side, column) };
        let frame = |d| match (front_frame(side, d), slip) {
            ([x, y, z], Slip::X) if side.is_turned_over() => [-x, y, z],
            (turned, _) => turned,
        };
        leaf(column, row, frame(wi), frame(wo))
    })
}

fn photographs(folder: &Path, slip: Slip) -> Vec<Capture> {
    Side::ALL.iter().map(|side| photographed(&folder.join(format!("{side} {slip:?}")), *side, slip)).collect()
}

/// Relative RMSE of a decoded layer against the leaf over all texels and the given directions in the front's frame.
fn error(loaded: &Resident, wis: &[[f32; 3]], wos: &[[f32; 3]], rule: Interpolation) -> f64 {
    let options = DecodeOptions { interpolation: rule, ..DecodeOptions::default() };
    let (mut error, mut energy) = (0.0, 0.0);
    for (&wi, &wo) in wis.iter().flat_map(|wi| wos.iter().map(move |wo| (wi, wo))) {
        let layer = loaded.layer_for_sides(0, wi[2] < 0.0, wo[2] < 0.0).expect("the asset has all four layers");
        for texel in 0..WIDTH * HEIGHT {
            let truth = leaf(texel % WIDTH, texel / WIDTH, wi, wo);
            let found = decode(loaded, layer, texel as u32, wi, wo, &options);
            for c in 0..3 {
                error += f64::from(found[c] - truth[c]).powi(2);
                energy += f64::from(truth[c]).powi(2);
            }
        }
    }
    (error / energy).sqrt()
}

fn fit_all(captures: &[Capture], params: &FitParams) -> FitOutcome {
    fit(captures, &params.check().unwrap(), &Monitor::default()).expect("the captures are fitted")
}

/// Light and view directions of a capture in the front's frame.
fn directions(side: Side) -> [Vec<[f32; 3]>; 2] {
    let info = info(side);
    [info.lights, info.views].map(|set| set.units().into_iter().map(|d| front_frame(side, d)).collect())
}

#[test]
fn four_captures_become_one_leaf_that_is_right_from_every_side() {
    let folder = tempfile::tempdir().unwrap();
    let params = small_fit(folder.path());
    let outcome = fit_all(&photographs(folder.path(), Slip::None), &params);
    assert_eq!(outcome.asset.layers.len(), 4);
    let loaded = resident(&Asset::parse(&outcome.bytes).unwrap());
    // Directions that nobody measured, within the hull of those that were.
    let between: Vec<[f32; 3]> =
        DirectionSet::random(40, 5).unwrap().units().into_iter().filter(|d| d[2] > 0.6).collect();
    for side in Side::ALL {
        let [wis, wos] = directions(side);
        let measured = error(&loaded, &wis, &wos, Interpolation::Fast);
        let sign = |behind: bool| if behind { -1.0 } else { 1.0 };
        let on = |s: f32| between.iter().map(|[x, y, z]| [*x, *y, s * z]).collect::<Vec<_>>();
        let (light, eye) = (sign(wis[0][2] < 0.0), sign(wos[0][2] < 0.0));
        let elsewhere = error(&loaded, &on(light), &on(eye), Interpolation::Exact);
        assert!(measured < 0.02 && elsewhere < 0.08, "{side}: {measured} at measured directions, {elsewhere} between");
    }

    // Planted differences: captures of the back whose columns, or whose x, nobody turned over.
    for slip in [Slip::Columns, Slip::X] {
        let wrong = resident(&fit_all(&photographs(folder.path(), slip), &params).asset);
        for side in Side::ALL {
            let [wis, wos] = directions(side);
            let found = error(&wrong, &wis, &wos, Interpolation::Fast);
            assert_eq!(found > 0.1, side.is_turned_over(), "{side}, {slip:?} not mirrored: {found}");
        }
    }
}

fn codes(capture: &Capture) -> Vec<Vec<u8>> {
    let lights = capture.info().lights.len();
    let read = |pair: usize| match capture.read(pair / lights, pair % lights).unwrap() {
        Pixels::Encoded8(codes) => codes,
        Pixels::Linear(_) => panic!("a png has 8 bits"),
    };
    (0..capture.info().pair_count()).map(read).collect()
}

/// Root mean square difference in steps of 8-bit values.
fn code_rmse(a: &[Vec<u8>], b: &[Vec<u8>]) -> f64 {
    let squares: Vec<f64> =
        a.iter().flatten().zip(b.iter().flatten()).map(|(x, y)| f64::from(x.abs_diff(*y)).powi(2)).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[test]
fn every_layer_expands_to_the_capture_it_came_from_and_compare_finds_its_layer() {
    let folder = tempfile::tempdir().unwrap();
    let params = small_fit(folder.path());
    let mut captures = photographs(folder.path(), Slip::None);
    // Another order than the sides' own: layers are found by side, not by number.
    captures.rotate_left(1);
    let mut outcome = fit_all(&captures, &params);
    let infos: Vec<&CaptureInfo> = captures.iter().map(Capture::info).collect();
    outcome.asset.material = Material::new(&infos, FitRecord::new(&params, outcome.components)).to_json();
    let asset = Asset::parse(&pack(&outcome.asset).unwrap()).unwrap();
    let loaded = resident(&asset);
    for (number, capture) in captures.iter().enumerate() {
        let side = capture.info().side;
        assert_eq!(layer_for_capture(capture.info(), &asset).unwrap(), number);
        let measuring = MeasureParams { layer: number, ..MeasureParams::default() };
        let found = measure(capture, &asset, &loaded, &measuring, &Monitor::default()).unwrap();
        assert!(!found.interpolated, "{side}: the asset has the capture's directions");
        let psnr = found.metrics().psnr_db;
        assert!(psnr > 38.0, "{side}: {psnr} dB");

        let dir = folder.path().join(format!("decoded {side}"));
        let params = ExpandParams { layer: number, ..ExpandParams::default() };
        let written = expand(&asset, &loaded, &dir, &params, &Monitor::default()).unwrap();
        let expanded = Capture::open(&dir).unwrap();
        assert_eq!((&written.views, &written.lights), (&capture.info().views, &capture.info().lights), "{side}");
        assert_eq!((expanded.info().side, &expanded.info().name), (side, &capture.info().name));
        let (original, decoded) = (codes(capture), codes(&expanded));
        let rmse = code_rmse(&original, &decoded);
        // The same figure as `compare`'s, so the files hold what was measured.
        assert!((psnr - 20.0 * (255.0 / rmse).log10()).abs() < 1e-6, "{side}: {psnr} dB, {rmse} steps");
        // Planted difference: the columns of the decoded files the other way round.
        let mut mirrored = decoded.clone();
        for image in &mut mirrored {
            for row in image.chunks_exact_mut(3 * WIDTH) {
                let old = row.to_vec();
                row.chunks_exact_mut(3).zip(old.chunks_exact(3).rev()).for_each(|(to, from)| to.copy_from_slice(from));
            }
        }
        assert!(code_rmse(&original, &mirrored) > 5.0 * rmse, "{side}");
    }
    let mut without = asset.clone();
    without.layers.truncate(3);
    let message = layer_for_capture(captures[3].info(), &without).unwrap_err().to_string();
    assert!(message.contains("no layer for the side `front`"), "{message}");
}

#[test]
fn a_budget_over_four_layers_is_kept_goes_by_need_and_gives_the_same_bytes_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let mut captures = photographs(folder.path(), Slip::None);
    // The front gets much that lobes and a few components cannot hold.
    let noisy = |texel: usize, wi: [f32; 3], wo: [f32; 3]| {
        let angle = 40.0 * (wi[0] * (texel as f32 * 0.9).sin() + wo[1] * (texel as f32 * 1.7).cos());
        leaf(texel % WIDTH, texel / WIDTH, wi, wo).map(|x| x * (1.0 + 0.6 * angle.sin()))
    };
    captures[0] = capture_from(&folder.path().join("noisy"), info(Side::Front), noisy);
    let bytes = 75_000;
    let params = FitParams { bytes: Some(bytes), components: None, ..small_fit(folder.path()) };
    let on_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fit_all(&captures, &params))
    };
    let outcome = on_threads(1);
    let description = description_bytes(&captures, &params);
    assert!(outcome.bytes.len() + description <= bytes as usize, "{} bytes", outcome.bytes.len());
    assert!(outcome.bytes == on_threads(3).bytes, "the bytes differ between 1 and 3 threads");
    let components: Vec<usize> =
        outcome.asset.layers.iter().map(|layer| layer.residual.as_ref().unwrap().coefficients.len()).collect();
    assert!(components[1..].iter().all(|count| *count < components[0]), "{components:?}");

    let few = FitParams { bytes: Some(5_000), ..params };
    let refused = fit(&captures, &few.check().unwrap(), &Monitor::default()).unwrap_err().to_string();
    assert!(refused.contains("--bytes is too small"), "{refused}");
}

#[test]
fn captures_that_are_no_layers_of_one_asset_are_refused_before_anything_is_fitted() {
    let folder = tempfile::tempdir().unwrap();
    let captures = photographs(folder.path(), Slip::None);
    let params = small_fit(folder.path());
    let refusal = |captures: Vec<Capture>| {
        let monitor = Monitor::default();
        let message = fit(&captures, &params.check().unwrap(), &monitor).unwrap_err().to_string();
        assert!(monitor.stages().is_empty(), "nothing was fitted");
        message
    };
    let again = Capture::open(folder.path().join("back None")).unwrap();
    let other = CaptureInfo { width: 5, ..info(Side::Back) };
    let other = capture_from(&folder.path().join("other"), other, |_, _, _| [0.5; 3]);
    let mut captures = captures.into_iter();
    let (front, back) = (captures.next().unwrap(), captures.next().unwrap());
    let doubled = refusal(vec![front, back, again]);
    assert!(doubled.contains("the same side as another, `back`") && doubled.contains("back None"), "{doubled}");
    let front = Capture::open(folder.path().join("front None")).unwrap();
    let sized = refusal(vec![front, other]);
    assert!(sized.contains("5 x 7 texels, the first is 9 x 7"), "{sized}");
}
