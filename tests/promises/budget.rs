//! `--bytes` and `--psnr` are kept.

use btf_capture::{DirectionSet, ImageFormat};
use btf_fit::{FitError, FitParams, MeasureParams, Monitor, description_bytes, fit, measure};
use btf_tests::{cloth_capture, fitted, leaf_capture, resident, small_fit};

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
    hold_figures("leaf", LEAF_PSNR_DB, [small, large]);

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

/// PSNR of the small leaf above in 13,000 and 26,000 bytes, dB.
const LEAF_PSNR_DB: [f64; 2] = [42.25, 47.84];
/// PSNR of the small cloth in 10,000 and 20,000 bytes, dB.
const CLOTH_PSNR_DB: [f64; 2] = [48.09, 56.97];
/// Most that a figure may move, either way, before this file has to say so, dB.
const FIGURE_SLACK_DB: f64 = 0.3;

/// Checks that figures are those that are stored, so that no change of the fit makes assets worse, or better, unseen.
fn hold_figures(what: &str, stored_db: [f64; 2], found_db: [f64; 2]) {
    println!("{what}: {found_db:.2?} dB");
    let near = stored_db.iter().zip(found_db).all(|(stored, found)| (stored - found).abs() <= FIGURE_SLACK_DB);
    assert!(near, "{what}: {found_db:.2?} dB, stored are {stored_db:.2?}");
}

#[test]
fn a_small_cloth_is_as_good_as_the_stored_figures_say() {
    let folder = tempfile::tempdir().unwrap();
    let set = DirectionSet::random(16, 9).unwrap();
    let capture = cloth_capture(&folder.path().join("cloth"), 32, &set, &set);
    let base = FitParams { components: None, ..small_fit(folder.path()) };
    let quality = |params: FitParams| {
        let outcome = fitted(&capture, &params);
        let loaded = resident(&outcome.asset);
        let measured = measure(&capture, &outcome.asset, &loaded, &MeasureParams::default(), &Monitor::default());
        measured.unwrap().metrics().psnr_db
    };
    let sizes = [10_000, 20_000];
    let found = sizes.map(|bytes| quality(FitParams { bytes: Some(bytes), ..base.clone() }));
    hold_figures("cloth", CLOTH_PSNR_DB, found);
    // Planted difference: a fit that gives one component to all texels, whatever else its bytes could buy.
    let worse = quality(FitParams { bytes: Some(sizes[1]), components: Some(1), ..base });
    assert!(worse < CLOTH_PSNR_DB[1] - 2.0 * FIGURE_SLACK_DB, "{worse}");
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
