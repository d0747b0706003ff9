//! Writes the first inputs of the fuzz targets to `corpus`; what a fuzzer finds beyond them is added by its `-merge=1`.

#[path = "../../../capture/tests/support/ubo2014_writer.rs"]
mod ubo2014_writer;

use btf_models::glb::{F32, GlbBuffer, TRIANGLES, U16, glb_from};
use btf_models::shapes::Script;
use btf_models::{Deficiency, LeafDescription, Species};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

fn main() -> std::io::Result<()> {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    let write = |target: &str, number: usize, bytes: &[u8]| {
        let folder = corpus.join(target);
        std::fs::create_dir_all(&folder)?;
        std::fs::write(folder.join(format!("seed-{number:02}")), bytes)
    };
    for (number, document) in documents().into_iter().enumerate() {
        let (mut document, bytes) = document;
        write("glb", number, &glb_from(&document, bytes.clone()).expect("it is small"))?;
        document["buffers"][0]["uri"] = json!(format!("data:application/octet-stream;base64,{}", base64(&bytes)));
        write("gltf", number, format!("{document:#}").as_bytes())?;
    }
    for (number, text) in OBJ.iter().enumerate() {
        write("obj", number, text.as_bytes())?;
    }
    for (number, text) in scripts().iter().enumerate() {
        write("shapes", number, text.as_bytes())?;
    }
    for (number, text) in leaves().iter().enumerate() {
        write("leaf", number, text.as_bytes())?;
    }
    for (number, text) in MANIFESTS.iter().enumerate() {
        write("manifest", number, text.as_bytes())?;
    }
    for (number, text) in LISTS.iter().enumerate() {
        write("list", number, text.as_bytes())?;
    }
    for (number, bytes) in ubo2014_writer::one_of_each_kind().iter().enumerate() {
        write("ubo2014", number, bytes)?;
        write("ubo2014", 10 + number, &bytes[..bytes.len() * 2 / 3])?;
    }
    Ok(())
}

/// Two triangles with everything that is read of a glTF file, and variants of them.
fn documents() -> Vec<(Value, Vec<u8>)> {
    let mut buffer = GlbBuffer::default();
    let floats = |numbers: &[f32]| numbers.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let positions = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]);
    let views = [
        buffer.push(&positions, None),
        buffer.push(&floats(&[0.0, 0.0, 1.0].repeat(4)), None),
        buffer.push(&floats(&[1.0, 0.0, 0.0, 1.0].repeat(4)), None),
        buffer.push(&floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0]), None),
        buffer.push(&[0u16, 1, 2, 2, 1, 3].iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>(), None),
    ];
    let accessor =
        |view: usize, kind: &str| json!({ "bufferView": views[view], "componentType": F32, "count": 4, "type": kind });
    let mut first = accessor(0, "VEC3");
    (first["min"], first["max"]) = (json!([0, 0, 0]), json!([1, 1, 0]));
    let whole = json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0, 2] }],
        "nodes": [
            { "children": [1], "translation": [1, 2, 3], "rotation": [0, 0, 0, 1], "scale": [1, 2, 1] },
            { "mesh": 0, "extensions": { "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 0, "ROTATION": 2 } } } },
            { "mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 4, 0, 0, 1] },
        ],
        "meshes": [{ "primitives": [{
            "attributes": { "POSITION": 0, "NORMAL": 1, "TANGENT": 2, "TEXCOORD_0": 3 },
            "indices": 4, "material": 0, "mode": TRIANGLES,
        }] }],
        "materials": [{
            "name": "leaf", "doubleSided": true,
            "pbrMetallicRoughness": { "baseColorFactor": [0.1, 0.3, 0.05, 1] },
            "extensions": {
                "KHR_materials_diffuse_transmission": {
                    "diffuseTransmissionFactor": 0.4, "diffuseTransmissionColorFactor": [0.2, 0.5, 0.1],
                },
                "BTF_materials_leaf": { "leaf": "my%20leaf.toml" },
            },
        }],
        "accessors": [
            first, accessor(1, "VEC3"), accessor(2, "VEC4"), accessor(3, "VEC2"),
            { "bufferView": views[4], "componentType": U16, "count": 6, "type": "SCALAR" },
        ],
        "buffers": [{ "byteLength": buffer.bytes.len() }],
        "bufferViews": buffer.views,
    });
    let changed = |change: &dyn Fn(&mut Value)| {
        let mut document = whole.clone();
        change(&mut document);
        document
    };
    let documents = vec![
        whole.clone(),
        changed(&|d| d["meshes"][0]["primitives"][0]["indices"] = Value::Null),
        changed(&|d| d["meshes"][0]["primitives"][0]["attributes"] = json!({ "POSITION": 0 })),
        changed(&|d| d["nodes"] = json!([{ "mesh": 0 }, {}, {}])),
        changed(&|d| {
            let sparse = json!({
                "count": 2, "indices": { "bufferView": 4, "componentType": U16 }, "values": { "bufferView": 1 },
            });
            d["accessors"][0]["sparse"] = sparse;
        }),
        changed(&|d| {
            d["accessors"][0]["sparse"] = json!({
                "count": 1, "indices": { "bufferView": 4, "componentType": U16 }, "values": { "bufferView": 0 },
            });
            d["accessors"][0].as_object_mut().expect("an accessor").remove("bufferView");
        }),
        changed(&|d| d["bufferViews"][0]["byteStride"] = json!(12)),
        changed(&|d| d["meshes"][0]["primitives"][0]["mode"] = json!(0)),
        // What was found first: the crate's validation indexed out of bounds.
        changed(&|d| d["accessors"] = json!([])),
        changed(&|d| d["nodes"][1]["children"] = json!([0])),
    ];
    documents.into_iter().map(|document| (document, buffer.bytes.clone())).collect()
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for chunk in bytes.chunks(3) {
        let word = chunk.iter().fold(0u32, |word, byte| word << 8 | u32::from(*byte)) << (8 * (3 - chunk.len()));
        for digit in 0..4 {
            let is_there = digit <= chunk.len();
            text.push(if is_there { char::from(DIGITS[(word >> (18 - 6 * digit) & 63) as usize]) } else { '=' });
        }
    }
    text
}

const OBJ: [&str; 10] = [
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "o a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1\nf -1/-1/-1 -2/-2/-1 -3/-3/-1\n",
    "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nv 1 1 0 1 1 1\nf 1 2 3 4\n",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 2 2 0\nf 1 2 3 4 5\nl 1 2\np 1\n",
    "mtllib a.mtl\nusemtl leaf\ng one\nv 0 0 0 2\nv 1 0 0 2\nv 0 1 0 2\nf 1 2 3\nusemtl stem\nf 3 2 1\n",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\nf 1 2 3\n",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2 3/1\n",
    "# a comment\n\nv 1e30 -1e30 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//6148914691236517206 2//1 3//1\n",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/-5 2/1 3/1\n",
];

/// The documented scripts of the gallery, and one that nests.
fn scripts() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/results/voltex");
    let mut paths: Vec<PathBuf> =
        std::fs::read_dir(folder).expect("the gallery is there").map(|e| e.unwrap().path()).collect();
    paths.sort();
    let scripts = paths.iter().filter(|path| path.to_string_lossy().ends_with(".shapes.toml"));
    let read = |path: &PathBuf| std::fs::read_to_string(path).expect("a script can be read");
    let mut texts: Vec<String> = scripts.map(read).filter(|text| text.len() < 6000).collect();
    texts.push(NESTED.into());
    texts.iter().for_each(|text| assert!(toml_script(text)));
    texts
}

fn toml_script(text: &str) -> bool {
    let path = std::env::temp_dir().join("btf-seed.shapes.toml");
    std::fs::write(&path, text).is_ok() && Script::read(&path).is_ok()
}

const NESTED: &str = r#"[space]
least_m = [0.0, 0.0, 0.0]
most_m = [1.0, 1.0, 1.0]
cyclic = [true, false]

[[materials]]
name = "a"
reflectance = [0.5, 0.4, 0.3]
tint = { kind = "noise", noise = { cells = [2, 3, 4], octaves = 2, gain = 0.5, seed = 7 }, colours = [[1.0, 1.0, 1.0], [0.5, 0.0, 0.0]] }

[[strokes]]
material = "a"
shapes = [
  { kind = "union", of = [{ kind = "difference", of = [{ kind = "box", least_m = [0,0,0], most_m = [1,1,1] }, { kind = "sphere", centre_m = [0,0,0], radius_m = 0.5 }] }] },
  { kind = "fur", on = { kind = "placed", of = { kind = "sphere", centre_m = [0.5,0.5,0.5], radius_m = 0.1 }, scale = 2.0 }, strands_per_m2 = 1e4, length_m = 0.05, radius_m = 1e-4 },
  { kind = "limb", points_m = [[0,0,0],[0,0,1],[0,1,1]], radii_m = [0.1, 0.05, 0.0] },
  { kind = "density", data = { kind = "raw", file = "scan.raw", cells = [8, 8, 8], number = "u16le" }, least_m = [0,0,0], most_m = [1,1,1], range = [0, 65535], area_per_m3 = 10.0 },
]

[[strokes]]
mode = "subtract"
shapes = [{ kind = "cone", ends_m = [[0,0,0],[0,0,1]], radii_m = [0.2, 0.0] }]
"#;

/// Descriptions as the toolkit writes them, and by hand.
fn leaves() -> Vec<String> {
    let path = std::env::temp_dir().join("btf-seed-leaf.toml");
    let mut texts = Vec::new();
    for species in Species::ALL {
        for deficiency in [None, Some(Deficiency::Nitrogen)] {
            LeafDescription::of(Some(species), deficiency).write(&path).expect("a description can be written");
            texts.push(std::fs::read_to_string(&path).expect("and read"));
        }
    }
    texts.push("[look]\nspecies = \"maize\"\ntextures = \"my textures\"\nseed = 9223372036854775807\n".into());
    texts.push("[contents]\nbrown = 0\nwater_cm = 0.04\n[variation]\nchlorophyll = 1\n".into());
    texts.push(String::new());
    texts
}

const MANIFESTS: [&str; 10] = [
    "name = \"cloth\"\ntransfer = \"srgb\"\ncosine = \"included\"\nscale = 1.0\nside = \"front\"\nsize_mm = [10.0, 20.0]\nprovenance = \"a test\"\n",
    "transfer = \"gamma:2.2\"\n",
    "transfer = \"linear\"\ncosine = \"excluded\"\n",
    "scale = 1e-3\n",
    "side = \"back\"\n",
    "side = \"transmission-back\"\n",
    "size_mm = [1, 1]\n",
    "# nothing\n",
    "name = \"\"\nprovenance = \"\"\"\nlines\n\"\"\"\n",
    "scale = -1\n",
];

const LISTS: [&str; 10] = [
    "file,theta_v,phi_v,theta_l,phi_l\na.png,0,0,0,0\n",
    "file,theta_v,phi_v,theta_l,phi_l\na.png,0,0,0,0\nb.png,0,0,30,0\nc.png,30,90,0,0\nd.png,30,90,30,0\n",
    "phi_l;theta_l;file;phi_v;theta_v\n0;0;a.png;0;0\n10;75;b.png;0;0\n",
    "file\ttheta_v\tphi_v\ttheta_l\tphi_l\tnote\n\"a.png\"\t0\t0\t29.9999999\t360\t\"a \"\"quoted\"\" note\"\n",
    "# a comment\n\nFILE,Theta_V,phi_v,theta_l,phi_l\n./a.png,1e1,-180,0,0\n",
    "\u{FEFF}file,theta_v,phi_v,theta_l,phi_l\r\na.png,0,0,0,0\r\n",
    "file,theta_v,phi_v,theta_l,phi_l\n../a.png,0,0,0,0\n",
    "file,theta_v,phi_v,theta_l,phi_l\na.png,0,0,0,0\na.png,0,0,10,0\n",
    "file,theta_v,phi_v,theta_l,phi_l\na.png,120,0,60,0\n",
    "file,theta_v,phi_v,theta_l\na.png,0,0,0\n",
];
