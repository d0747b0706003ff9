//! OpenUSD's own validators have no complaint about an exported layer and package, and some about broken ones.
//!
//! `cargo xtask test` installs usd-core beside Mitsuba under the target folder; without it these tests are skipped, and counted
//! as such.

use crate::exports::gltf_export::two_layers;
use crate::mitsuba_peers::interpreter;
use btf_fit::{Maps, Monitor, UsdExport, export_usd};
use btf_runtime::pack;
use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// Returns the report of tests/peers/usd/validate.py on a file.
fn report(python: &Path, file: &Path) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers/usd/validate.py");
    let output = Command::new(python).arg(script).arg(file).output().expect("Python starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("the report is JSON")
}

fn complaints(report: &Value) -> Vec<String> {
    let list = report["complaints"].as_array().expect("a list of complaints");
    list.iter().map(|text| text.as_str().unwrap_or_default().to_string()).collect()
}

fn write_textures(folder: &Path, export: &UsdExport) {
    for (name, bytes) in &export.textures {
        std::fs::write(folder.join(name), bytes).unwrap();
    }
}

#[test]
fn usd_has_no_complaint_about_an_export_and_some_about_broken_ones() {
    let Some(python) = interpreter() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut asset = two_layers();
    asset.size_mm = Some([30.0, 18.0]);
    let bytes = pack(&asset).unwrap();
    let export = export_usd(bytes, "2 felts", "grey%20felt.spmm", Maps::All, &Monitor::default()).unwrap();
    write_textures(folder.path(), &export);
    let layer = folder.path().join("2 felts.usda");
    std::fs::write(&layer, &export.layer).unwrap();
    let told = report(&python, &layer);
    assert_eq!(complaints(&told), Vec::<String>::new());
    assert_eq!((&told["preview"], &told["material"]), (&"UsdPreviewSurface".into(), &"/_2_felts/material".into()));
    assert_eq!(told["materialx"], "ND_open_pbr_surface_surfaceshader");
    assert_eq!((&told["btf"]["asset"], &told["btf"]["size_m"]), (&"grey%20felt.spmm".into(), &"(0.03, 0.018)".into()));
    let corner = [0, 1].map(|i| told["extent"][1][i].as_f64().unwrap());
    assert!((corner[0] - 0.015).abs() < 1e-6 && (corner[1] - 0.009).abs() < 1e-6, "{corner:?}");

    let package = folder.path().join("packed.usdz");
    std::fs::write(&package, export.package("2 felts.usda").unwrap()).unwrap();
    let packed = report(&python, &package);
    assert_eq!(complaints(&packed), Vec::<String>::new());
    assert_eq!((&packed["shaders"], &packed["btf"]), (&told["shaders"], &told["btf"]));

    // Planted: a node that MaterialX has not, an input that a node has not, a connection to nothing, and no unit.
    for (from, to) in [
        ("ND_magnitude_vector2", "ND_magnitude_vector9"),
        ("inputs:index = 2", "inputs:channel = 2"),
        ("specular_weight.outputs:out", "specular_wait.outputs:out"),
        ("    metersPerUnit = 1\n", ""),
    ] {
        assert!(export.layer.contains(from), "{from}");
        std::fs::write(&layer, export.layer.replacen(from, to, 1)).unwrap();
        assert!(!complaints(&report(&python, &layer)).is_empty(), "{from}");
    }
    // Planted: a texture that is not there.
    std::fs::write(&layer, &export.layer).unwrap();
    std::fs::remove_file(folder.path().join("2 felts_preview_normal.png")).unwrap();
    assert!(complaints(&report(&python, &layer)).iter().any(|text| text.contains("preview_normal.png")));
}
