//! Captures brighter than white, and very dark ones: the error that is chosen, and what a PSNR means.

use btf_capture::{Capture, CaptureInfo, CaptureWriter, DirectionSet, ImageFormat};
use btf_fit::{ErrorMeasure, FitParams, Metrics, Monitor, fit_and_measure};
use btf_tests::small_fit;
use glam::Vec3;
use std::path::Path;

const SIDE: usize = 16;

/// Brushed metal: an anisotropic Beckmann distribution with a rotation and two roughnesses a texel, F0 0.8, no
/// shadowing, and 0.005 of diffuse light.
fn metal(texel: usize, wi: Vec3, wo: Vec3) -> f32 {
    let (x, y) = ((texel % SIDE) as f32, (texel / SIDE) as f32);
    let (along, across) = (0.08 + 0.02 * (0.9 * x).sin(), 0.25 + 0.05 * (0.5 * y).cos());
    let turn = 0.3 * (0.7 * y + 0.2 * x).sin();
    let half = (wi + wo).normalize();
    let tangent = Vec3::new(turn.cos(), turn.sin(), 0.0);
    let slopes = (half.dot(tangent) / along).powi(2) + (half.dot(Vec3::Z.cross(tangent)) / across).powi(2);
    let distribution = (-slopes / half.z.powi(2)).exp() / (along * across * half.z.powi(4));
    0.8 * distribution / (4.0 * wo.z.max(0.1)) + 0.005 * wi.z
}

/// A matt tile with joints, 40 times as bright as a capture should be.
fn tile(texel: usize, wi: Vec3, wo: Vec3) -> f32 {
    let (x, y) = (texel % SIDE, texel / SIDE);
    let albedo = if x.is_multiple_of(8) || y.is_multiple_of(8) { 0.3 } else { 0.5 + 0.01 * (x as f32) };
    40.0 * albedo * wi.z * (1.0 + 0.3 * wi.dot(wo).max(0.0).powi(8)) + 2.0
}

fn photographed(dir: &Path, scale: f32, value: fn(usize, Vec3, Vec3) -> f32) -> Capture {
    let set = DirectionSet::random(20, 9).unwrap();
    let info = CaptureInfo::new("bright", SIDE, SIDE, set.clone(), set.clone(), ImageFormat::Exr);
    let writer = CaptureWriter::create(dir, info).unwrap();
    for (v, wo) in set.units().into_iter().map(Vec3::from).enumerate() {
        for (l, wi) in set.units().into_iter().map(Vec3::from).enumerate() {
            let pixels = (0..SIDE * SIDE).flat_map(|texel| {
                let x = scale * value(texel, wi, wo);
                [x, 0.8 * x, 0.5 * x]
            });
            writer.write(v, l, &pixels.collect::<Vec<_>>()).unwrap();
        }
    }
    writer.finish().unwrap();
    Capture::open(dir).unwrap()
}

fn figures(capture: &Capture, params: FitParams) -> (ErrorMeasure, Metrics, usize) {
    let fitted = fit_and_measure(std::slice::from_ref(capture), &params.check().unwrap(), &Monitor::default()).unwrap();
    (fitted.error, fitted.metrics, fitted.bytes.len())
}

#[test]
fn the_error_that_is_chosen_is_about_the_best_of_all() {
    let folder = tempfile::tempdir().unwrap();
    for (name, value, expected) in [
        ("metal", metal as fn(usize, Vec3, Vec3) -> f32, ErrorMeasure::Log),
        ("tile", tile as fn(usize, Vec3, Vec3) -> f32, ErrorMeasure::Gamma),
    ] {
        let capture = photographed(&folder.path().join(name), 10.0, value);
        let with = |error| {
            let sized = FitParams { bytes: Some(12_000), components: None, error, ..small_fit(folder.path()) };
            let (chosen, metrics, _) = figures(&capture, sized);
            println!("{name} {chosen:?}: {:.2} dB, relative RMSE {:.4}", metrics.psnr_db, metrics.rel_rmse);
            (chosen, metrics)
        };
        let (chosen, metrics) = with(None);
        assert_eq!(chosen, expected, "{name}");
        assert!(metrics.psnr_db.is_finite() && metrics.tone_curve.is_some() && metrics.delta_e00_mean.is_some());
        for other in [ErrorMeasure::Gamma, ErrorMeasure::Log, ErrorMeasure::Linear] {
            let (_, other) = with(Some(other));
            assert!(metrics.psnr_db > 0.95 * other.psnr_db, "{name}: {metrics:?} {other:?}");
        }
    }
}

#[test]
fn a_psnr_goal_is_kept_at_every_brightness() {
    let folder = tempfile::tempdir().unwrap();
    let mut sizes = Vec::new();
    // The last is far below what 8-bit values show.
    for scale in [1.0, 30.0, 1e-4] {
        let capture = photographed(&folder.path().join(scale.to_string()), scale, tile);
        let goal = FitParams { psnr_db: Some(40.0), components: None, ..small_fit(folder.path()) };
        let (_, metrics, bytes) = figures(&capture, goal);
        println!("x {scale}: {:.2} dB, relative RMSE {:.4}, {bytes} bytes", metrics.psnr_db, metrics.rel_rmse);
        assert!((40.0..43.0).contains(&metrics.psnr_db) && metrics.rel_rmse < 0.1, "{scale}: {metrics:?}");
        sizes.push(bytes);
    }
    assert!(sizes.iter().all(|bytes| *bytes < 2 * sizes[0]), "{sizes:?}");
}
