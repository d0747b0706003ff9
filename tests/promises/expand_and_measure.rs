//! What `compare` reports is what anybody measures on the expanded folder with a script of their own.

use btf_capture::{Capture, DirectionSet, ImageFormat};
use btf_fit::{ExpandParams, FitRecord, Material, MeasureParams, Monitor, expand, measure};
use btf_runtime::{Asset, pack};
use btf_tests::{fitted, leaf_capture, resident, small_fit};
use std::path::Path;

/// PSNR of two folders' 8-bit images, by the `image` crate alone.
fn psnr_by_hand(a: &Path, b: &Path) -> f64 {
    let (mut sum, mut count) = (0.0f64, 0usize);
    for view in std::fs::read_dir(a).unwrap().map(|entry| entry.unwrap().path()).filter(|path| path.is_dir()) {
        for file in std::fs::read_dir(&view).unwrap().map(|entry| entry.unwrap().path()) {
            let other = b.join(view.file_name().unwrap()).join(file.file_name().unwrap());
            let (x, y) = (image::open(&file).unwrap().to_rgb8(), image::open(&other).unwrap().to_rgb8());
            assert_eq!(x.dimensions(), y.dimensions());
            sum += x.as_raw().iter().zip(y.as_raw()).map(|(x, y)| (f64::from(*x) - f64::from(*y)).powi(2)).sum::<f64>();
            count += x.as_raw().len();
        }
    }
    10.0 * (255.0f64.powi(2) * count as f64 / sum).log10()
}

#[test]
fn a_leaf_goes_round_and_every_figure_is_what_a_script_measures() {
    let folder = tempfile::tempdir().unwrap();
    let set = DirectionSet::random(14, 3).unwrap();
    let capture = leaf_capture(&folder.path().join("leaf"), 24, &set, &set, ImageFormat::Png);
    let params = small_fit(folder.path());
    let mut outcome = fitted(&capture, &params);
    let material = Material::new(&[capture.info()], FitRecord::new(&params, outcome.components));
    outcome.asset.material = material.to_json();
    let bytes = pack(&outcome.asset).unwrap();
    let asset = Asset::parse(&bytes).unwrap();
    assert_eq!(asset, outcome.asset);

    let loaded = resident(&asset);
    let measured =
        measure(&capture, &asset, &loaded, &MeasureParams::default(), &Monitor::default()).unwrap().metrics();
    let out = folder.path().join("expanded");
    expand(&asset, &loaded, &out, &ExpandParams::default(), &Monitor::default()).unwrap();
    let by_hand = psnr_by_hand(&folder.path().join("leaf"), &out);
    assert!((measured.psnr_db - by_hand).abs() < 1e-6, "{} against {by_hand}", measured.psnr_db);
    assert!(by_hand > 28.0, "{by_hand}");
    // Lobes and residual both count: fewer components are worse.
    let mut fewer = MeasureParams::default();
    fewer.options.components = 0;
    let coarse = measure(&capture, &asset, &loaded, &fewer, &Monitor::default()).unwrap().metrics();
    assert!(coarse.psnr_db < measured.psnr_db - 0.5, "{} {}", coarse.psnr_db, measured.psnr_db);

    // Planted difference: one image of the expanded folder inverted must show.
    let file = std::fs::read_dir(&out).unwrap().map(|e| e.unwrap().path()).find(|p| p.is_dir()).unwrap();
    let file = std::fs::read_dir(file).unwrap().next().unwrap().unwrap().path();
    let mut picture = image::open(&file).unwrap().to_rgb8();
    picture.iter_mut().for_each(|x| *x = 255 - *x);
    picture.save(&file).unwrap();
    assert!(psnr_by_hand(&folder.path().join("leaf"), &out) < by_hand - 0.5);
    assert!(Capture::open(&out).is_ok());
}
