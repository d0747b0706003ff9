//! Captures that lack a third of their pairs are fitted, and what is decoded there is near what a photograph would have shown.

use btf_capture::{Capture, DirectionSet, Pixels};
use btf_fit::{FitParams, MeasureParams, Monitor, Priors, ProposeParams, measure, propose_directions};
use btf_runtime::testing::Random;
use btf_tests::{cloth_capture, fitted, resident, small_fit};
use std::path::Path;

const SIZE: usize = 16;

/// Deletes images of the capture in `folder`, those of pairs that are not `kept`, and says so in its manifest.
fn thin(capture: &Capture, folder: &Path, mut kept: impl FnMut(usize) -> bool) -> Capture {
    let lights = capture.info().lights.len();
    for pair in 0..capture.info().pair_count() {
        if !kept(pair) {
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
    errors_with(Priors::BuiltIn, capture, whole, missing, folder)
}

fn errors_with(priors: Priors, capture: &Capture, whole: &Capture, missing: &[usize], folder: &Path) -> [f64; 2] {
    let params = FitParams { bytes: Some(60_000), components: None, priors, ..small_fit(folder) };
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
    let mut random = Random::new(7);
    let thinned = thin(&cloth_capture(&thin_folder, SIZE, &set, &set), &thin_folder, |_| random.below(3) > 0);
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

#[test]
fn a_twentieth_of_the_pairs_is_enough_for_priors_and_the_proposed_ones_tell_more_than_others() {
    let folder = tempfile::tempdir().unwrap();
    let [whole_folder, proposed_folder, other_folder] =
        ["WHOLE", "PROPOSED", "OTHER"].map(|name| folder.path().join(name));
    let set = DirectionSet::bonn81();
    let whole = cloth_capture(&whole_folder, SIZE, &set, &set);
    let count = whole.info().pair_count() / 20;
    let proposed = propose_directions(&set, &set, &ProposeParams { count, priors: Priors::BuiltIn }).unwrap();
    let few = cloth_capture(&proposed_folder, SIZE, &set, &set);
    let few = thin(&few, &proposed_folder, |pair| proposed.contains(&pair));
    let others = cloth_capture(&other_folder, SIZE, &set, &set);
    let others = thin(&others, &other_folder, |pair| pair % 20 == 7);

    let missing = few.info().missing.clone();
    let [by_priors, seen] = errors(&few, &whole, &missing, folder.path());
    let [by_nearness, _] = errors_with(Priors::Assets(Vec::new()), &few, &whole, &missing, folder.path());
    let [by_others, _] = errors(&others, &whole, &others.info().missing, folder.path());
    println!("missing {by_priors:.2} dB, seen {seen:.2}, without priors {by_nearness:.2}, other pairs {by_others:.2}");
    assert!(by_priors > 25.0 && seen > by_priors, "{by_priors} {seen}");
    // Planted differences: no priors, and pairs of a regular stride.
    assert!(by_nearness < by_priors - 1.0, "{by_nearness} {by_priors}");
    assert!(by_others < by_priors, "{by_others} {by_priors}");
}
