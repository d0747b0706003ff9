//! Bonn's directions end at 75 degrees. Beyond, lobes and the carried residual are compared with
//! synthetic data that was held back, and so are views.

use btf_capture::{Capture, Direction, DirectionSet, ImageFormat};
use btf_fit::{FitParams, MeasureParams, Monitor, measure};
use btf_runtime::{DecodeOptions, HeightUse, Interpolation, decode};
use btf_synth::{CaptureParams, ClothParams, write_cloth_capture};
use btf_tests::{capture_of, fitted, resident, small_fit};
use std::ops::ControlFlow;
use std::path::Path;

fn rings(rings: &[(f64, usize)]) -> DirectionSet {
    let all = rings.iter().flat_map(|&(theta_deg, count)| {
        (0..count).map(move |i| Direction { theta_deg, phi_deg: 360.0 * i as f64 / count as f64 })
    });
    DirectionSet::new(all.collect()).unwrap()
}

/// A diffuse body darkened towards grazing views and lights, not one of the fitter's lobes.
fn material(wi: [f32; 3], wo: [f32; 3]) -> [f32; 3] {
    let soft = |z: f32| z / (z + 0.15);
    let back = 1.0 + 0.4 * (wi[0] * wo[0] + wi[1] * wo[1]);
    [0.5, 0.3, 0.2].map(|albedo| albedo * wi[2] * soft(wi[2]) * soft(wo[2]) * back)
}

#[test]
fn grazing_light_that_was_held_back_is_predicted_better_than_by_the_edge_value() {
    let folder = tempfile::tempdir().unwrap();
    let set = rings(&[(0.0, 1), (20.0, 6), (40.0, 10), (60.0, 12), (75.0, 16)]);
    let capture = capture_of(&folder.path().join("m"), 4, &set, &set, ImageFormat::Exr, |_, wi, wo| material(wi, wo));
    let outcome = fitted(&capture, &FitParams { clusters: 1, ..small_fit(folder.path()) });
    let loaded = resident(&outcome.asset);
    let held = rings(&[(78.0, 7), (81.0, 7), (84.0, 7)]);
    for interpolation in [Interpolation::Fast, Interpolation::Exact] {
        let options = DecodeOptions { interpolation, ..DecodeOptions::default() };
        let (mut decoded_error, mut edge_error, mut energy) = (0.0f64, 0.0f64, 0.0f64);
        for wi in held.units() {
            for wo in set.units() {
                let truth = material(wi, wo);
                let found = decode(&loaded, 0, 5, wi, wo, &options);
                // What repeating the value at 75 degrees would give.
                let scale = 75f32.to_radians().sin() / (1.0 - wi[2] * wi[2]).sqrt();
                let at_edge = material([wi[0] * scale, wi[1] * scale, 75f32.to_radians().cos()], wo);
                for c in 0..3 {
                    decoded_error += f64::from(found[c] - truth[c]).powi(2);
                    edge_error += f64::from(at_edge[c] - truth[c]).powi(2);
                    energy += f64::from(truth[c]).powi(2);
                }
            }
        }
        let (decoded, edge) = ((decoded_error / energy).sqrt(), (edge_error / energy).sqrt());
        assert!(decoded < 0.5 * edge, "{interpolation:?}: relative error {decoded}, of the edge value {edge}");
    }
}

/// Woven cloth of 64 x 64 texels under `views`.
fn cloth(folder: &Path, views: &DirectionSet) -> Capture {
    let params = ClothParams::default();
    let capture = CaptureParams {
        size: 64,
        size_mm: 2.5,
        views: views.clone(),
        lights: rings(&[(30.0, 4), (55.0, 5)]),
        ..params.capture
    };
    let params = ClothParams { capture, ..params };
    write_cloth_capture(folder, &params, &|_, _| ControlFlow::Continue(())).expect("the cloth is written");
    Capture::open(folder).expect("the cloth is read")
}

#[test]
fn heights_found_in_a_capture_carry_eyes_beyond_its_views() {
    let folder = tempfile::tempdir().unwrap();
    let capture = cloth(&folder.path().join("grid"), &rings(&[(0.0, 1), (30.0, 8), (60.0, 16), (75.0, 20)]));
    let beyond = cloth(&folder.path().join("beyond"), &rings(&[(80.0, 7), (83.0, 5)]));
    let params = FitParams {
        bytes: Some(120_000),
        heights: true,
        cache_directory: folder.path().to_path_buf(),
        ..FitParams::default()
    };
    let asset = fitted(&capture, &params).asset;
    let heights = asset.layers[0].heights.as_ref().expect("cloth has a relief");
    assert!(heights.range()[1] - heights.range()[0] > 3.0, "{:?} texels", heights.range());
    let loaded = resident(&asset);
    let psnr_db = |capture: &Capture, heights: HeightUse| {
        let options = DecodeOptions { heights, ..DecodeOptions::default() };
        let params = MeasureParams { options, ..MeasureParams::default() };
        measure(capture, &asset, &loaded, &params, &Monitor::default()).unwrap().metrics().psnr_db
    };
    let (with, without) = (psnr_db(&beyond, HeightUse::Parallax), psnr_db(&beyond, HeightUse::None));
    assert!(with > without + 0.7, "beyond the views {with:.2} dB with heights, {without:.2} dB without");
    let between = cloth(&folder.path().join("between"), &rings(&[(47.0, 3)]));
    assert_eq!(
        psnr_db(&between, HeightUse::Parallax),
        psnr_db(&between, HeightUse::None),
        "parallax changes nothing between the views"
    );
    let relief = asset.layers[0].relief.expect("cloth has relief");
    let (with, without) = (psnr_db(&between, HeightUse::Relief), psnr_db(&between, HeightUse::Parallax));
    assert!(with > without + 0.2, "between the views {with:.2} dB with {relief:?}, {without:.2} dB without");
}
