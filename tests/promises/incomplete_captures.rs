//! Captures that lack a third of their pairs are fitted, and what is decoded there is near what a photograph would have shown.

use btf_capture::{Capture, DirectionSet, Pixels};
use btf_fit::{FitParams, MeasureParams, Monitor, measure};
use btf_runtime::testing::Random;
use btf_tests::{cloth_capture, fitted, resident, small_fit};
use std::path::Path;

const SIZE: usize = 16;

/// Deletes a third of the images of the capture in `folder`, and says so in its manifest.
fn thin(capture: &Capture, folder: &Path) -> Capture {
    let lights = capture.info().lights.len();
    let mut random = Random::new(7);
    for pair in 0..capture.info().pair_count() {
        if random.below(3) == 0 {
            std::fs::remove_file(capture.path_of(pair / lights, pair % lights)).unwrap();
        }
    }
    let manifest = folder.join("capture.toml");
    let text = std::fs::read_to_string(&manifest).unwrap();
    std::fs::write(&manifest, format!("{text}\nincomplete = true\n")).unwrap();
    Capture::open(folder).unwrap()
}

/// Returns the PSNR of a fit to `capture` over the pairs that are missing and over the others, against `whole`.
fn errors(capture: &Capture, whole: &Capture, missing: &[usize], folder: &Path) -> [f64; 2] {
    let params = FitParams { bytes: Some(60_000), components: None, ..small_fit(folder) };
    let asset = fitted(capture, &params).asset;
    let found = measure(whole, &asset, &resident(&asset), &MeasureParams::default(), &Monitor::default()).unwrap();
    let others = (0..whole.info().pair_count()).filter(|pair| missing.binary_search(pair).is_err());
    [found.psnr_of_pairs(missing.iter().copied()).unwrap(), found.psnr_of_pairs(others).unwrap()]
}

#[test]
fn missing_pairs_are_predicted_from_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let [whole_folder, thin_folder, dark_folder] = ["WHOLE", "THIN", "DARK"].map(|name| folder.path().join(name));
    let set = DirectionSet::bonn81();
    let whole = cloth_capture(&whole_folder, SIZE, &set, &set);
    let thinned = thin(&cloth_capture(&thin_folder, SIZE, &set, &set), &thin_folder);
    let missing = thinned.info().missing.clone();
    assert!((1900..2500).contains(&missing.len()), "{}", missing.len());

    let [at_missing, at_others] = errors(&thinned, &whole, &missing, folder.path());
    let [of_whole, _] = errors(&whole, &whole, &missing, folder.path());
    println!("missing pairs {at_missing:.2} dB, the others {at_others:.2}, fitted to all {of_whole:.2}");
    assert!(at_missing > 33.0 && at_others > 40.0 && of_whole > at_missing, "{at_missing} {at_others} {of_whole}");

    // What can be measured without the missing images is what is there.
    let asset = fitted(&thinned, &small_fit(folder.path())).asset;
    let measured =
        measure(&thinned, &asset, &resident(&asset), &MeasureParams::default(), &Monitor::default()).unwrap();
    assert_eq!(measured.pairs.len(), thinned.info().pair_count() - missing.len());

    // Planted: black images in place of those that are missing.
    let dark = cloth_capture(&dark_folder, SIZE, &set, &set);
    let lights = set.len();
    for pair in &missing {
        let path = dark.path_of(pair / lights, pair % lights);
        image::RgbImage::new(SIZE as u32, SIZE as u32).save(&path).unwrap();
    }
    let dark = Capture::open(&dark_folder).unwrap();
    assert_eq!(
        dark.read(missing[0] / lights, missing[0] % lights).unwrap(),
        Pixels::Encoded8(vec![0; 3 * SIZE * SIZE])
    );
    let [at_dark, _] = errors(&dark, &whole, &missing, folder.path());
    assert!(at_dark < at_missing - 10.0, "{at_dark} {at_missing}");
}
