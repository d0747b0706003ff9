//! `--bytes` and `--psnr` are kept.

use btf_capture::{DirectionSet, ImageFormat};
use btf_fit::{FitError, FitParams, MeasureParams, Monitor, description_bytes, fit, measure};
use btf_tests::{fitted, leaf_capture, resident, small_fit};

#[test]
fn more_bytes_give_less_error_and_no_budget_is_passed() {
    let folder = tempfile::tempdir().unwrap();
    let set = DirectionSet::random(16, 9).unwrap();
    let capture = leaf_capture(&folder.path().join("leaf"), 32, &set, &set, ImageFormat::Png);
    let base = FitParams { components: None, ..small_fit(folder.path()) };
    let quality = |bytes: u64| {
        let params = FitParams { bytes: Some(bytes), ..base.clone() };
        let outcome = fitted(&capture, &params);
        let description = description_bytes(std::slice::from_ref(&capture), &params);
        assert!(outcome.bytes.len() + description <= bytes as usize, "{} of {bytes}", outcome.bytes.len());
        let loaded = resident(&outcome.asset);
        measure(&capture, &outcome.asset, &loaded, &MeasureParams::default(), &Monitor::default())
            .unwrap()
            .metrics()
            .psnr_db
    };
    // Below the sizes at which 8-bit captures come back nearly exactly, where error jumps.
    let (small, large) = (quality(13_000), quality(26_000));
    assert!(large > small + 1.0, "{small} dB, {large} dB");

    let wanted = (small + large) / 2.0;
    let outcome = fitted(&capture, &FitParams { psnr_db: Some(wanted), ..base.clone() });
    let loaded = resident(&outcome.asset);
    let reached = measure(&capture, &outcome.asset, &loaded, &MeasureParams::default(), &Monitor::default())
        .unwrap()
        .metrics()
        .psnr_db;
    assert!(reached >= wanted && reached < wanted + 1.0, "{reached} for {wanted}");
    assert!(outcome.bytes.len() < 26_000);

    let refused =
        |params: FitParams| match fit(std::slice::from_ref(&capture), &params.check().unwrap(), &Monitor::default()) {
            Err(FitError::Budget(text)) => text,
            other => panic!("expected a refusal, got {:?}", other.map(|outcome| outcome.bytes.len())),
        };
    assert!(refused(FitParams { bytes: Some(900), ..base.clone() }).contains("--bytes"));
    assert!(refused(FitParams { psnr_db: Some(75.0), ..base }).contains("--psnr"));
}

#[test]
fn a_cancelled_fit_leaves_no_file_behind() {
    let folder = tempfile::tempdir().unwrap();
    let set = DirectionSet::random(6, 9).unwrap();
    let capture = leaf_capture(&folder.path().join("leaf"), 40, &set, &set, ImageFormat::Png);
    let monitor = Monitor::default();
    monitor.cancel();
    assert!(matches!(
        fit(std::slice::from_ref(&capture), &small_fit(folder.path()).check().unwrap(), &monitor),
        Err(FitError::Interrupted)
    ));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_memory_limit_that_is_too_small_is_refused_with_what_is_needed() {
    let folder = tempfile::tempdir().unwrap();
    let set = DirectionSet::random(6, 9).unwrap();
    let capture = leaf_capture(&folder.path().join("leaf"), 16, &set, &set, ImageFormat::Png);
    let params = FitParams { memory_bytes: 10_000_000, ..small_fit(folder.path()) };
    match fit(std::slice::from_ref(&capture), &params.check().unwrap(), &Monitor::default()) {
        Err(FitError::Memory { needed, .. }) => assert!(needed.ends_with("MB")),
        other => panic!("expected a refusal, got {:?}", other.map(|outcome| outcome.bytes.len())),
    }
}
