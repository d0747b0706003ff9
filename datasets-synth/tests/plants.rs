//! `btf-synth plants`: what it writes, reports and refuses.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use btf_models::shapes::Script;
use btf_models::{LeafDescription, Species, TextureImages, TextureKind};
use serde_json::Value;

fn plants(glb: &Path, more: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_btf-synth");
    Command::new(program).arg("plants").arg(glb).args(["--json", "-"]).args(more).output().unwrap()
}

fn report(glb: &Path, more: &[&str]) -> Value {
    let output = plants(glb, more);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The document and the binary chunk's length.
fn document(glb: &Path) -> (Value, usize) {
    let bytes = fs::read(glb).unwrap();
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&bytes[..4], word(8)), (&b"glTF"[..], bytes.len()));
    let text = word(12);
    (serde_json::from_slice(&bytes[20..20 + text]).unwrap(), word(20 + text))
}

#[test]
fn a_canopy_is_instances_of_variants_that_name_their_leaf() {
    let folder = tempfile::tempdir().unwrap();
    let glb = folder.path().join("a field.glb");
    let told = report(&glb, &["--rows", "4", "--columns", "5", "--variants", "3", "--ground", "--detail", "40"]);
    assert_eq!((&told["plants"], &told["variants"]), (&20.into(), &3.into()));
    assert_eq!(told["bytes"], fs::metadata(&glb).unwrap().len());
    let lai = told["leaf_area_m2"].as_f64().unwrap() / (20.0 * 0.75 * 0.18);
    assert!((told["leaf_area_index"].as_f64().unwrap() - lai).abs() < 1e-9 && (2.0..7.0).contains(&lai), "{lai}");
    // Chords are shorter than outlines.
    let drawn = told["drawn_leaf_area_m2"].as_f64().unwrap() / told["leaf_area_m2"].as_f64().unwrap();
    assert!((0.8..1.0).contains(&drawn), "{drawn}");

    let (document, _) = document(&glb);
    let field_m: Vec<f64> = serde_json::from_value(document["scenes"][0]["extras"]["field_m"].clone()).unwrap();
    assert!((field_m[0] - 5.0 * 0.18).abs() < 1e-9 && (field_m[1] - 4.0 * 0.75).abs() < 1e-9, "{field_m:?}");
    let count_of =
        |accessor: &Value| document["accessors"][accessor.as_u64().unwrap() as usize]["count"].as_u64().unwrap();
    let (mut instances, mut drawn) = (0, 0);
    for node in document["nodes"].as_array().unwrap() {
        let mesh = &document["meshes"][node["mesh"].as_u64().unwrap() as usize];
        let primitives = mesh["primitives"].as_array().unwrap();
        let triangles: u64 = primitives.iter().map(|primitive| count_of(&primitive["indices"]) / 3).sum();
        let attributes = &node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
        let count = if attributes.is_object() { count_of(&attributes["TRANSLATION"]) } else { 1 };
        if attributes.is_object() {
            assert_eq!((count_of(&attributes["ROTATION"]), count_of(&attributes["SCALE"])), (count, count));
            instances += count;
        }
        drawn += count * triangles;
    }
    assert_eq!((instances, &told["triangles_instanced"]), (20, &drawn.into()));
    assert_eq!(document["extensionsUsed"], serde_json::json!(["BTF_materials_leaf", "EXT_mesh_gpu_instancing"]));

    // The address is escaped; the file behind it is a description, and its textures are there.
    let leaf = &document["materials"][0]["extensions"]["BTF_materials_leaf"];
    assert_eq!(leaf["leaf"], "a%20field-leaf.toml");
    let file = folder.path().join("a field-leaf.toml");
    let leaf = LeafDescription::read(&file).unwrap();
    assert_eq!((leaf.species, leaf.size_mm), (Some(Species::Maize), 100.0));
    assert!(leaf.variation.chlorophyll > 0.0);
    let textures = TextureImages::read(leaf.textures_beside(&file).unwrap()).unwrap();
    assert_eq!(textures.size_mm(), Some(100.0));
    // The midrib stands in the middle.
    let midrib = |x: f32| textures.sample(TextureKind::Structure, [x, 50.0], 100.0).unwrap()[0];
    assert!(midrib(50.0) > 0.8 && midrib(30.0) < 0.1 && midrib(70.0) < 0.1);
}

#[test]
fn one_plant_is_a_plain_node_and_the_same_line_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, more: &[&str]| {
        let glb = folder.path().join(name).join("plant.glb");
        fs::create_dir(folder.path().join(name)).unwrap();
        report(&glb, &[&["--detail", "20"], more].concat());
        let leaf = fs::read(glb.with_file_name("plant-leaf.toml")).unwrap();
        let texture = fs::read(glb.with_file_name("plant-textures").join("pigment.png")).unwrap();
        (fs::read(&glb).unwrap(), leaf, texture)
    };
    let (one, three) = (write("one", &["--threads", "1"]), write("three", &["--threads", "3"]));
    assert!(one == three);
    assert!(one.0 != write("seed", &["--seed", "2"]).0);
    let (document, _) = document(&folder.path().join("one/plant.glb"));
    assert_eq!(document["nodes"].as_array().unwrap().len(), 1);
    assert!(document["nodes"][0].get("extensions").is_none());
    assert_eq!(document["extensionsUsed"], serde_json::json!(["BTF_materials_leaf"]));
}

#[test]
fn a_described_leaf_colours_the_plants() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("albino.toml");
    let mut leaf = LeafDescription::of(Some(Species::Maize), None);
    leaf.contents = leaf.contents.without_pigments();
    leaf.write(&file).unwrap();
    let red = |name: &str, more: &[&str]| {
        let glb = folder.path().join(name);
        report(&glb, more);
        document(&glb).0["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"][0].as_f64().unwrap()
    };
    assert!(red("white.glb", &["--leaf", file.to_str().unwrap()]) > 3.0 * red("green.glb", &[]));
    let written = LeafDescription::read(folder.path().join("white-leaf.toml")).unwrap();
    assert_eq!(written.contents, leaf.contents);
}

#[test]
fn what_is_there_stays_unless_it_is_forced_and_nothing_is_half_written() {
    let folder = tempfile::tempdir().unwrap();
    let glb = folder.path().join("plant.glb");
    let refusal = |glb: &Path, more: &[&str], code: i32| {
        let output = plants(glb, more);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!((output.status.code(), message.lines().count()), (Some(code), 1), "{message}");
        message
    };
    assert!(refusal(&folder.path().join("plant.obj"), &[], 1).contains("does not end in .glb"));
    assert!(refusal(&glb, &["--stage", "2"], 2).contains("--stage is 2"));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    let textures = folder.path().join("plant-textures");
    fs::create_dir(&textures).unwrap();
    fs::write(textures.join("precious.txt"), "keep").unwrap();
    assert!(refusal(&glb, &[], 1).contains("plant-textures exists already"));
    assert!(refusal(&glb, &["--force"], 1).contains("precious.txt is no texture"));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    fs::remove_file(textures.join("precious.txt")).unwrap();
    report(&glb, &["--force"]);
    assert!(refusal(&glb, &[], 1).contains("plant.glb exists already"));
    report(&glb, &["--force", "--seed", "3"]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
}

#[test]
fn painted_plants_are_a_script_that_names_its_leaf() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a patch.shapes.toml");
    let told = report(&out, &["--form", "shapes", "--species", "grass"]);
    assert_eq!((&told["leaves"], &told["flowers"], &told["shapes"]), (&16.into(), &1.into(), &31.into()));
    assert_eq!(told["bytes"], fs::metadata(&out).unwrap().len());
    let script = Script::read(&out).unwrap();
    assert_eq!((script.space.cyclic, script.strokes.len()), ([true; 2], 4));
    let leaf = script.materials[script.material_number("leaf").unwrap()].from.clone().unwrap();
    assert_eq!(LeafDescription::read(Script::beside(&out, leaf)).unwrap().species, Some(Species::Grass));
    // The same line gives the same bytes, another seed others.
    let bytes = |seed: &str| {
        report(&out, &["--form", "shapes", "--species", "grass", "--force", "--seed", seed]);
        fs::read(&out).unwrap()
    };
    let first = bytes("1");
    assert!(first == bytes("1") && first != bytes("2"));
    let output = plants(&folder.path().join("patch.glb"), &["--form", "shapes"]);
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(1) && message.contains("does not end in .shapes.toml"), "{message}");
}
