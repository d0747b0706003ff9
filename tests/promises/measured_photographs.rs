//! The measured photographs (one view, 81 lights), where they are at hand.

use btf_capture::Capture;
use btf_fit::{FitParams, MeasureParams, Monitor, measure};
use btf_tests::{fitted, measured_data, resident, small_fit};

#[test]
fn the_photographs_are_read_in_bonns_order_and_fit_above_local_pca() {
    let Some(folder) = measured_data("ubo2003/originals") else { return };
    let capture = Capture::open(&folder).unwrap();
    let info = capture.info();
    assert_eq!((info.views.len(), info.lights.len(), info.width, info.height), (1, 81, 256, 256));
    let temporary = tempfile::tempdir().unwrap();
    let params = FitParams { clusters: 32, components: None, bytes: Some(405_000), ..small_fit(temporary.path()) };
    let outcome = fitted(&capture, &params);
    let loaded = resident(&outcome.asset);
    let metrics =
        measure(&capture, &outcome.asset, &loaded, &MeasureParams::default(), &Monitor::default()).unwrap().metrics();
    // Published local PCA, 32 clusters x 4 components with 8-bit coefficients: 31.68 dB at 405 KB.
    assert!(metrics.psnr_db > 31.68, "{} dB at {} bytes", metrics.psnr_db, outcome.bytes.len());
}
