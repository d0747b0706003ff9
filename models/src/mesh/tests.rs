//! Tests of reading models: what is damaged or hostile is refused with the file's name and a remedy.

use super::*;
use crate::ModelError;
use crate::glb::{F32, GlbBuffer, TRIANGLES, U16, glb_from};
use serde_json::{Value, json};
use std::path::Path;

/// Returns a triangle as a document and its buffer.
fn triangle() -> (Value, Vec<u8>) {
    let mut buffer = GlbBuffer::default();
    let positions: Vec<u8> =
        [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let indices: Vec<u8> = [0u16, 1, 2].iter().flat_map(|x| x.to_le_bytes()).collect();
    let (positions, indices) = (buffer.push(&positions, None), buffer.push(&indices, None));
    let document = json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1, "mode": TRIANGLES }] }],
        "accessors": [
            { "bufferView": positions, "componentType": F32, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] },
            { "bufferView": indices, "componentType": U16, "count": 3, "type": "SCALAR" },
        ],
        "buffers": [{ "byteLength": buffer.bytes.len() }],
        "bufferViews": buffer.views,
    });
    (document, buffer.bytes)
}

fn read_as(name: &str, bytes: &[u8]) -> Result<Vec<ModelMesh>, ModelError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read_model(&path)
}

fn read_changed(change: impl FnOnce(&mut Value)) -> Result<Vec<ModelMesh>, ModelError> {
    let (mut document, bytes) = triangle();
    change(&mut document);
    read_as("changed.glb", &glb_from(&document, bytes).unwrap())
}

#[test]
fn a_triangle_is_read_from_a_binary_file_and_from_one_with_its_buffer_beside_it() {
    let meshes = read_changed(|_| {}).unwrap();
    assert_eq!(meshes[0].parts[0].triangles, [[0, 1, 2]]);
    let (mut document, bytes) = triangle();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("triangle.gltf");
    document["buffers"][0]["uri"] = json!("my%20buffer.bin");
    std::fs::write(&path, document.to_string()).unwrap();
    std::fs::write(folder.path().join("my buffer.bin"), bytes).unwrap();
    assert_eq!(read_model(&path).unwrap()[0].parts[0].positions, meshes[0].parts[0].positions);
}

#[test]
fn a_field_says_its_lengths_and_whatever_else_says_none() {
    let field_of = |extras: Value| {
        let (mut document, bytes) = triangle();
        document["scenes"][0]["extras"] = extras;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("field.glb");
        std::fs::write(&path, glb_from(&document, bytes).unwrap()).unwrap();
        field_m(&path).unwrap()
    };
    assert_eq!(field_of(json!({ "field_m": [2.5, 3] })), Some([2.5, 3.0]));
    for extras in
        [json!({ "field_m": [2.5] }), json!({ "field_m": [0, 1] }), json!({ "field_m": "big" }), json!([1, 2])]
    {
        assert_eq!(field_of(extras), None);
    }
    assert_eq!(field_m(Path::new("a.obj")).unwrap(), None);
    assert!(field_m(Path::new("nowhere.glb")).unwrap_err().to_string().contains("nowhere.glb"));
}

#[test]
fn a_gltf_file_that_would_end_its_reader_is_refused_with_its_name_and_a_remedy() {
    type Change = fn(&mut Value);
    let cases: [(Change, &str); 14] = [
        // Found by fuzzing: the validation of the crate indexed out of bounds.
        (|d| d["accessors"] = json!([]), "mesh 0 has its positions in accessor 0, and the file has 0 accessors"),
        (|d| d["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(7), "in accessor 7, and the file has 2"),
        (|d| d["meshes"][0]["primitives"][0]["attributes"] = json!({}), "cannot be read"),
        (|d| d["meshes"][0]["primitives"][0]["indices"] = json!(2), "cannot be read"),
        (|d| d["nodes"][0]["children"] = json!([0]), "node 0 stands below two nodes"),
        (|d| d["scenes"][0]["nodes"] = json!([0, 0]), "node 0 stands below two nodes"),
        (|d| d["accessors"][1]["componentType"] = json!(5120), "accessor 1 has indices in a type"),
        (|d| d["accessors"][0]["type"] = json!("VEC2"), "accessor 0 has positions in a type"),
        (|d| d["accessors"][1]["count"] = json!(0), "accessor 1 has no indices"),
        (|d| d["accessors"][0]["count"] = json!(4), "accessor 0 reaches beyond its buffer"),
        (|d| d["bufferViews"][0]["byteStride"] = json!(4), "accessor 0 has elements that lie in each other"),
        (|d| d["buffers"][0]["byteLength"] = json!(1 << 20), "buffer 0 has 44 bytes, not 1048576"),
        (|d| d["buffers"][0]["uri"] = json!("%ff.bin"), "buffers cannot be read"),
        (|d| d["buffers"][0]["uri"] = json!("/dev/zero"), "it is no file"),
    ];
    for (change, part) in cases {
        let message = read_changed(change).expect_err(part).to_string();
        assert!(message.contains("changed.glb: ") && message.contains(part), "{message}");
        assert!(message.contains("export it again") && !message.contains('\n'), "{message}");
    }
}

#[test]
fn zeros_without_a_buffer_and_vertices_that_many_parts_share_have_a_limit() {
    let sparse = json!({
        "count": 1, "indices": { "bufferView": 1, "componentType": U16 }, "values": { "bufferView": 0 },
    });
    let with = |count: u64| {
        read_changed(|d| {
            d["accessors"][0] = json!({
                "componentType": F32, "count": count, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0], "sparse": sparse,
            });
        })
    };
    assert_eq!(with(5).unwrap()[0].parts[0].positions.len(), 5);
    assert!(with(1 << 31).unwrap_err().to_string().contains("more positions than its file has data for"));
    assert!(with(1 << 40).unwrap_err().to_string().contains("more elements than 32 bits count"));
    let shared = read_changed(|d| {
        let primitives = d["meshes"][0]["primitives"].as_array_mut().unwrap();
        *primitives = vec![primitives[0].clone(); 1000];
    });
    assert!(shared.unwrap_err().to_string().contains("than its file has data for"));
}

#[test]
fn a_binary_file_with_a_header_shorter_than_itself_is_refused() {
    let (document, bytes) = triangle();
    let mut file = glb_from(&document, bytes).unwrap();
    file[8..12].copy_from_slice(&3u32.to_le_bytes());
    assert!(read_as("short.glb", &file).unwrap_err().to_string().contains("shorter than its header"));
}

#[test]
fn an_obj_file_with_indices_that_overflow_is_refused() {
    const HEAD: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n";
    let read = |face: &str| read_as("a.obj", format!("{HEAD}f {face}\n").as_bytes());
    assert_eq!(read("1/1/1 2/1/1 -1/-1/-1").unwrap()[0].parts[0].triangles, [[0, 1, 2]]);
    for face in ["1//6148914691236517206 2//1 3//1", "1/-5/1 2/1/1 3/1/1", "1/9223372036854775807 2/1 3/1", "1 2 9"] {
        let message = read(face).expect_err(face).to_string();
        assert!(message.contains("a.obj: the OBJ file cannot be read: face") && message.contains("again"), "{message}");
    }
}

#[test]
fn a_material_library_with_one_number_for_a_colour_is_grey_and_with_two_costs_the_colours() {
    let with = |libraries: &str, colour: &str| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        std::fs::write(&path, format!("{libraries}usemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")).unwrap();
        std::fs::write(folder.path().join("a.mtl"), format!("newmtl m\nKd {colour}\n")).unwrap();
        read_model(&path).unwrap()[0].parts[0].colour.reflectance
    };
    assert_eq!(with("mtllib a.mtl\nmtllib a.mtl\n", "0.25 0.5 0.75"), [0.25, 0.5, 0.75]);
    // A library that is no file is not read for ever.
    with("mtllib /dev/zero\n", "1");
    let alone = |colour: &str| with("mtllib a.mtl\n", colour);
    assert_eq!(alone("0.25 0.5 0.75"), [0.25, 0.5, 0.75]);
    assert_eq!(alone("0.25"), [0.25; 3]);
    assert_eq!((alone("0.25 0.5"), alone("")), ([0.5; 3], [0.5; 3]));
}

#[test]
fn a_folder_and_another_kind_of_file_are_no_models() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.glb", "a.obj"] {
        let path = folder.path().join(name);
        std::fs::create_dir(&path).unwrap();
        assert!(read_model(&path).unwrap_err().to_string().contains("it is no file"));
    }
    assert!(read_model(Path::new("a.stl")).unwrap_err().to_string().contains("no model"));
}
