//! Tests of `report.rs`.

use super::*;
use crate::measure::expand::{ExpandParams, expand};
use crate::sample_asset::sample_asset;
use btf_runtime::pack;

#[test]
fn the_nearest_direction_is_found_on_either_side() {
    let set = DirectionSet::bonn81();
    assert_eq!(set.directions()[nearest(&set, [44.0, 181.0])], Direction::new(45.0, 180.0));
    assert_eq!(nearest(&set, [0.0, 0.0]), 0);
    let behind = DirectionSet::new(vec![Direction::new(170.0, 0.0), Direction::new(120.0, 90.0)]).unwrap();
    assert_eq!(behind.directions()[nearest(&behind, [60.0, 90.0])], Direction::new(120.0, 90.0));
}

#[test]
fn a_capture_of_any_side_stands_beside_its_own_picture_and_not_a_mirrored_one() {
    let folder = tempfile::tempdir().unwrap();
    let monitor = Monitor::default();
    for side in btf_capture::Side::ALL {
        let mut source = sample_asset();
        (source.layers[0].light_side, source.layers[0].view_side) = crate::input::layer_frame::sides_of_capture(side);
        let bytes = pack(&source).unwrap();
        let asset = Asset::parse(&bytes).unwrap();
        let resident = Resident::from_asset(&asset);
        let dir = folder.path().join(side.to_string());
        expand(&asset, &resident, &dir, &ExpandParams::default(), &monitor).unwrap();
        let capture = Capture::open(dir).unwrap();
        let comparison = measure(&capture, &asset, &resident, &MeasureParams::default(), &monitor).unwrap();
        let input = ReportInput {
            bytes: &bytes,
            asset: &asset,
            resident: &resident,
            layers: vec![ReportLayer { capture: &capture, layer: 0, comparison: &comparison }],
            stages: &[],
            peak_memory_bytes: None,
            psnr_left_out_db: None,
        };
        let page = report_html(&input, &monitor).unwrap();
        let row = |label: &str| {
            let (_, rest) = page.split_once(&format!("<th>{label}</th>")).unwrap();
            rest.split_once("</tr>").unwrap().0.to_string()
        };
        // The files hold exactly what is decoded, and five columns of different texels are no mirror image.
        assert_eq!(row("original"), row("decoded"), "{side}");
        assert_eq!(page.contains("Straight through"), side.is_transmission());
        let mut clusters = source.layers[0].texel_clusters.clone();
        turn_map(&mut clusters, 5, side);
        assert_eq!(clusters != source.layers[0].texel_clusters, side.is_turned_over());
        let turned = Layer { texel_clusters: clusters, ..source.layers[0].clone() };
        let front = CaptureInfo { side: btf_capture::Side::Front, ..capture.info().clone() };
        assert_eq!(cluster_map(&source.layers[0], capture.info()), cluster_map(&turned, &front));
    }
}

#[test]
fn the_page_stands_alone_and_shows_the_figures() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = pack(&sample_asset()).unwrap();
    let asset = Asset::parse(&bytes).unwrap();
    let resident = Resident::from_asset(&asset);
    let monitor = Monitor::default();
    let fewer = ExpandParams {
        options: DecodeOptions { components: 1, ..DecodeOptions::default() },
        ..ExpandParams::default()
    };
    expand(&asset, &resident, &folder.path().join("capture"), &fewer, &monitor).unwrap();
    let capture = Capture::open(folder.path().join("capture")).unwrap();
    let comparison = measure(&capture, &asset, &resident, &MeasureParams::default(), &monitor).unwrap();
    let stages = [Stage { name: "cluster".into(), seconds: 1.5, processor_s: 1.5 }];
    let input = ReportInput {
        bytes: &bytes,
        asset: &asset,
        resident: &resident,
        layers: vec![ReportLayer { capture: &capture, layer: 0, comparison: &comparison }],
        stages: &stages,
        peak_memory_bytes: Some(123_456_789),
        psnr_left_out_db: Some(12.34),
    };
    let page = report_html(&input, &monitor).unwrap();
    assert!(page.contains(&format!("{:.2}", comparison.metrics().psnr_db)));
    assert!(page.contains("123.46 MB") && page.contains("12.34") && page.contains("cluster"));
    for outside in ["http:", "https:", "src=\"/", "<link", "<script", "url("] {
        assert!(!page.contains(outside), "{outside}");
    }
    assert!(!page.contains("NaN"));
    // Four pairs at most, three pictures each, and four maps.
    let pictures = page.matches("data:image/png;base64,").count();
    assert!((4 + 3..=4 + 12).contains(&pictures), "{pictures}");
    assert!(page.len() < 400_000, "{}", page.len());
}
