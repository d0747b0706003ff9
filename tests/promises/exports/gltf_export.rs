//! An exported `.glb` passes the Khronos glTF validator, with the asset beside it and within it, and so do plants.
//! Exported KTX2 files are read by a strict reader of others, and decoded from them alone, values are the asset's.
//!
//! `cargo xtask setup` installs the validator under the target folder; without it these tests are skipped, and counted
//! as such.

use btf_fit::{AssetPlace, Maps, Monitor, export_gltf, export_ktx2};
use btf_runtime::testing::{Random, sample_asset, sample_heights};
use btf_runtime::{
    Asset, DecodeOptions, Edit, Edits, Interpolation, Levels, ResidualKind, SurfaceSide, decode, open, pack, serial,
};
use btf_synth::{CanopySize, Existing, Ground, LeafDescription, PlantsParams, Species, TextureImages, write_plants};
use serde_json::Value;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

/// The folder in which npm has installed the judges of exported files, or `None` with a line for the skip count.
pub fn packages() -> Option<PathBuf> {
    if std::env::var_os("BTF_SKIP_PEERS").is_some_and(|value| value == "1") {
        btf_tests::skip("the judges of exported files (BTF_SKIP_PEERS=1)");
        return None;
    }
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("the target folder holds its tmp");
    let folder = target.join("peers/gltf");
    let wanted = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("peers/gltf/package.json"));
    let present = std::fs::read_to_string(folder.join("package-installed.json"));
    let node = Command::new("node").arg("--version").output().is_ok();
    if node && matches!((wanted, present), (Ok(wanted), Ok(present)) if wanted == present) {
        return Some(folder);
    }
    btf_tests::absent("the glTF validator is not in target/peers (`cargo xtask setup` installs it, and needs Node.js)");
    None
}

/// Runs a script of tests/peers/gltf; its output, or what it complained of.
pub fn judge(packages: &Path, script: &str, file: &Path) -> Result<Value, String> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers/gltf").join(script);
    let output = Command::new("node").arg(script).arg(packages).arg(file).output().expect("node starts");
    match output.status.success() {
        true => Ok(serde_json::from_slice(&output.stdout).expect("the report is JSON")),
        false => Err(String::from_utf8_lossy(&output.stderr).into_owned()),
    }
}

/// Errors and warnings of the validator.
fn complaints(packages: &Path, file: &Path) -> Vec<Value> {
    let report = judge(packages, "validate.mjs", file).unwrap_or_else(|text| panic!("the validator stopped: {text}"));
    let messages = report["issues"]["messages"].as_array().expect("a list of messages");
    messages.iter().filter(|message| message["severity"].as_u64() < Some(2)).cloned().collect()
}

/// Front and transmission towards the front, with a residual.
pub fn two_layers() -> Asset {
    let mut asset = sample_asset(5, 8, 6, ResidualKind::Root);
    let mut through = asset.layers[0].clone();
    (through.light_side, through.view_side) = (SurfaceSide::Back, SurfaceSide::Front);
    asset.layers.push(through);
    asset
}

#[test]
fn the_validator_has_no_complaint_about_an_export_and_some_about_a_broken_one() {
    let Some(packages) = packages() else { return };
    let folder = tempfile::tempdir().unwrap();
    let bytes = pack(&two_layers()).unwrap();
    std::fs::write(folder.path().join("felt.spmm"), &bytes).unwrap();
    let file = folder.path().join("felt.glb");
    for (place, maps) in [
        (AssetPlace::Uri("felt.spmm".into()), Maps::All),
        (AssetPlace::Uri("felt.spmm".into()), Maps::Auto),
        (AssetPlace::Embedded, Maps::All),
    ] {
        let export = export_gltf(bytes.clone(), "felt", place, maps, &Monitor::default()).unwrap();
        std::fs::write(&file, &export.glb).unwrap();
        assert_eq!(complaints(&packages, &file), Vec::<Value>::new());
        let report = judge(&packages, "validate.mjs", &file).unwrap();
        assert_eq!((&report["info"]["drawCallCount"], &report["info"]["totalTriangleCount"]), (&1.into(), &2.into()));

        // Planted: a texture that is not there, tangents of length 1.41, and a file cut short.
        let plant = |from: &str, to: &str| {
            let mut broken = export.glb.clone();
            let at = broken.windows(from.len()).position(|part| part == from.as_bytes()).expect("the word is there");
            broken[at..at + to.len()].copy_from_slice(to.as_bytes());
            broken
        };
        let mut tangents = export.glb.clone();
        let one = [1.0f32, 0.0, 0.0, 1.0].map(f32::to_le_bytes);
        let at = tangents.windows(16).position(|part| part == one.as_flattened()).expect("there are tangents");
        tangents[at + 4..at + 8].copy_from_slice(&1f32.to_le_bytes());
        let cut = export.glb[..export.glb.len() - 4].to_vec();
        for broken in [plant("\"source\":0", "\"source\":9"), tangents, cut] {
            std::fs::write(&file, broken).unwrap();
            assert!(!complaints(&packages, &file).is_empty());
        }
    }
}

#[test]
fn the_validator_has_no_complaint_about_plants_and_some_about_a_broken_canopy() {
    let Some(packages) = packages() else { return };
    let folder = tempfile::tempdir().unwrap();
    for species in Species::ALL {
        for (name, size) in [("plant.glb", CanopySize::Plants(1)), ("canopy.glb", CanopySize::Rows(2, 5))] {
            let file = folder.path().join(format!("{} {name}", species.name()));
            let ground = if size == CanopySize::Plants(1) { Ground::None } else { Ground::Soil };
            let params =
                PlantsParams { size, ground, variants: 3, branches: 60, leaves: 200, ..PlantsParams::of(species) };
            let leaf = LeafDescription::of(Some(species), None);
            let go_on = |_, _| ControlFlow::Continue(());
            let told = write_plants(&file, &params, &leaf, TextureImages::default(), Existing::Refuse, &go_on).unwrap();
            assert_eq!(complaints(&packages, &file), Vec::<Value>::new());
            let report = judge(&packages, "validate.mjs", &file).unwrap();
            assert_eq!(report["info"]["totalTriangleCount"], told.triangles_unique);
        }
    }
    // Planted: a normal of length 2.
    let file = folder.path().join("maize canopy.glb");
    let mut broken = std::fs::read(&file).unwrap();
    let up = [0.0f32, 1.0, 0.0].map(f32::to_le_bytes);
    let at = broken.windows(12).rposition(|part| part == up.as_flattened()).expect("the soil faces up");
    broken[at + 4..at + 8].copy_from_slice(&2f32.to_le_bytes());
    std::fs::write(&file, broken).unwrap();
    assert!(!complaints(&packages, &file).is_empty());
}

/// Values that the reader in Python decodes from a file, with how far they move where a cosine's last bit does.
fn values_of(file: &Path, queries: &str) -> Vec<[[f64; 3]; 2]> {
    let list = file.with_extension("queries");
    std::fs::write(&list, queries).unwrap();
    let mut command = Command::new(if cfg!(windows) { "python" } else { "python3" });
    command.env("PYTHONPYCACHEPREFIX", Path::new(env!("CARGO_TARGET_TMPDIR")).join("pycache"));
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("peers/spmm_reader.py"));
    let output = command.arg(file).arg("--decode").arg(&list).output().expect("Python 3.9 or newer starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let numbers = |name: &str, i: usize| {
        let start = format!("{name} {i} = ");
        let line = text.lines().find_map(|line| line.strip_prefix(&start)).expect("there is an answer");
        let numbers: Vec<f64> = line.split(' ').map(|number| number.parse().unwrap()).collect();
        [numbers[0], numbers[1], numbers[2]]
    };
    (0..queries.lines().count()).map(|i| [numbers("value", i), numbers("spread", i)]).collect()
}

#[test]
fn values_decoded_from_the_ktx2_files_alone_are_those_of_the_asset() {
    let folder = tempfile::tempdir().unwrap();
    let mut asset = two_layers();
    let texels = asset.texel_count();
    asset.layers[0].heights = Some(sample_heights(3, texels));
    let edit = Edit { tint: [0.5, 1.0, 2.0], roughness: 1.5, ..Edit::default() };
    asset.edits = Edits { list: vec![edit], texels: (0..texels).map(|texel| (texel % 3 == 0) as u8).collect() };
    let bytes = pack(&asset).unwrap();
    let resident = open(Arc::new(bytes.clone()), Levels::All, &serial).unwrap().resident;
    let export = export_ktx2(bytes, "felt").unwrap();
    for (name, bytes) in &export.files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    let (mut random, mut queries, mut expected) = (Random::new(8), String::new(), Vec::new());
    for i in 0..120 {
        let (layer, level) = (random.below(2) as u32, random.below(export.levels) as u32);
        let number = level * resident.layers() + layer;
        let [width, height] = resident.size(number);
        let texel = random.below((width * height) as usize) as u32;
        let ([x, y, z], wo) = (random.direction(), random.direction());
        let wi = [x, y, if layer == 1 { -z } else { z }];
        let interpolation = [Interpolation::Fast, Interpolation::Exact][i % 2];
        let options = DecodeOptions { interpolation, ..DecodeOptions::default() };
        expected.push(decode(&resident, number, texel, wi, wo, &options));
        let directions: Vec<String> = [wi, wo].concat().iter().map(|x| f64::from(*x).to_string()).collect();
        queries += &format!("{} {layer} {level} {texel} {}\n", interpolation.name(), directions.join(" "));
    }
    let far = |expected: &[f32; 3], [value, spread]: &[[f64; 3]; 2]| {
        (0..3).any(|c| (value[c] - f64::from(expected[c])).abs() > 1e-6 * value[c].max(1.0) + spread[c])
    };
    let main = folder.path().join("felt.ktx2");
    let found = values_of(&main, &queries);
    let first = expected.iter().zip(&found).position(|(expected, found)| far(expected, found));
    let at = |i| (queries.lines().nth(i), expected[i], found[i]);
    assert_eq!(first, None, "{:?}", first.map(at));
    assert!(expected.iter().any(|value| value[1] > 0.05));

    // Planted: one byte of the planes changed, the clusters of the finest level.
    let mut broken = export.files[0].1.clone();
    let at = u64::from_le_bytes(broken[80..88].try_into().unwrap()) as usize;
    broken[at..at + texels].iter_mut().for_each(|cluster| *cluster = (*cluster + 1) % 3);
    std::fs::write(&main, broken).unwrap();
    let found = values_of(&main, &queries);
    assert!(expected.iter().zip(&found).filter(|(expected, found)| far(expected, found)).count() > 10);
}

#[test]
fn a_strict_reader_of_others_reads_the_ktx2_files_and_refuses_a_broken_one() {
    let Some(packages) = packages() else { return };
    let folder = tempfile::tempdir().unwrap();
    let export = export_ktx2(pack(&two_layers()).unwrap(), "felt").unwrap();
    let path = folder.path().join("felt.ktx2");
    for (name, bytes) in &export.files {
        std::fs::write(&path, bytes).unwrap();
        let report = judge(&packages, "read_ktx2.mjs", &path).unwrap_or_else(|text| panic!("{name}: {text}"));
        assert_eq!(report["again"], true, "{name}: written again by its own writer it is the same");
        let planes = name == "felt.ktx2";
        assert_eq!((&report["format"], report["notes"].is_null()), (&if planes { 13 } else { 97 }.into(), !planes));
        if planes {
            assert_eq!((&report["layers"], &report["levels"]), (&export.planes.into(), &export.levels.into()));
        }
        for (at, change) in [(1, 1), (12, 1), (80, 4)] {
            let mut broken = bytes.clone();
            broken[at] ^= change;
            std::fs::write(&path, broken).unwrap();
            let told = judge(&packages, "read_ktx2.mjs", &path);
            assert!(told.is_err() || told.is_ok_and(|told| told != report), "{name}: byte {at}");
        }
    }
}
