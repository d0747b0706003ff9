//! OBJ and glTF files as meshes with the frames that shading needs, and the places where they stand.

use crate::error::ViewerError;
use crate::geometry::geometry::Vertex;
use crate::scene::mesh::{MeshPart, fill_normals, fill_tangents, tangent_of};
use btf_models::{ModelPart, is_model, read_model};
use glam::{Mat4, Vec3};
use std::path::Path;

/// A mesh of a file, and where it stands in the file's world.
#[derive(Debug, Clone)]
pub struct FileMesh {
    /// Parts of the mesh, in its own space.
    pub parts: Vec<MeshPart>,
    /// At least one.
    pub places: Vec<Mat4>,
}

impl FileMesh {
    /// Moves it; what stands once is moved itself, so that it stands where it is.
    pub(crate) fn moved(&mut self, matrix: Mat4) {
        self.places.iter_mut().for_each(|place| *place = matrix * *place);
        if let [place] = self.places.as_mut_slice() {
            self.parts.iter_mut().for_each(|part| part.transform(*place));
            *place = Mat4::IDENTITY;
        }
    }
}

/// Reads `.obj`, `.gltf` or `.glb`; texture coordinates grow upwards in v, missing normals and tangents are filled in.
/// Parts without texture coordinates come with `has_uv = false`. What the file places once comes together as one mesh
/// in the world; what it places more often, by several nodes or by `EXT_mesh_gpu_instancing`, as a mesh each.
///
/// # Errors
/// [`ViewerError::Mesh`] for names of other kinds, and the errors of [`read_model`].
pub fn load_meshes(path: &Path) -> Result<Vec<FileMesh>, ViewerError> {
    if !is_model(path) {
        return Err(ViewerError::mesh(
            path,
            "this is neither a built-in mesh (sphere, plane, leaf, cornell, cloth, shoe, boots, pullover) nor an .obj, .gltf or .glb file",
        ));
    }
    let mut once = FileMesh { parts: Vec::new(), places: vec![Mat4::IDENTITY] };
    let mut often = Vec::new();
    for mesh in read_model(path)? {
        let mut parts: Vec<MeshPart> = mesh.parts.into_iter().map(with_frames).collect();
        match mesh.places.as_slice() {
            [place] => {
                if *place != Mat4::IDENTITY {
                    parts.iter_mut().for_each(|part| part.transform(*place));
                }
                once.parts.extend(parts);
            }
            _ => often.push(FileMesh { parts, places: mesh.places }),
        }
    }
    let once = (!once.parts.is_empty()).then_some(once);
    Ok(once.into_iter().chain(often).collect())
}

/// Fills in what the file lacks.
fn with_frames(part: ModelPart) -> MeshPart {
    let (normals, tangents, uvs) = (part.normals.as_ref(), part.tangents.as_ref(), part.uvs.as_ref());
    let mut vertices: Vec<Vertex> = (0..part.positions.len())
        .map(|i| {
            let [u, v] = uvs.map_or([0.0; 2], |uvs| uvs[i]);
            let normal = normals.map_or(Vec3::ZERO, |normals| Vec3::from(normals[i]).normalize_or_zero()).to_array();
            let tangent = tangents.map_or([1.0, 0.0, 0.0, 1.0], |tangents| tangents[i]);
            Vertex { position: part.positions[i], u, normal, v, tangent }
        })
        .collect();
    if vertices.iter().any(|vertex| vertex.normal == [0.0; 3]) {
        fill_normals(&mut vertices, &part.triangles);
    }
    if tangents.is_some() {
        for vertex in &mut vertices {
            let tangent = Vec3::from_slice(&vertex.tangent);
            vertex.tangent = tangent_of(vertex.normal.into(), tangent, vertex.tangent[3]);
        }
    } else {
        fill_tangents(&mut vertices, &part.triangles);
    }
    MeshPart {
        name: part.name,
        group: part.group,
        colour: part.colour,
        has_uv: part.uvs.is_some(),
        vertices,
        triangles: part.triangles,
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use btf_models::DiffuseColour;
    use serde_json::Value;

    const INSTANCING: &str = "EXT_mesh_gpu_instancing";

    const TRIANGLE_OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";

    /// One triangle in the xy plane, its node moved by (5, 0, 0); the buffer is a file beside.
    fn write_gltf(dir: &Path, max_index: u16) -> std::path::PathBuf {
        let mut bytes = Vec::new();
        for x in [0f32, 0., 0., 1., 0., 0., 0., 1., 0., /* uv */ 0., 1., 1., 1., 0., 0.] {
            bytes.extend(x.to_le_bytes());
        }
        [0, 1, max_index].iter().for_each(|i| bytes.extend(i.to_le_bytes()));
        std::fs::write(dir.join("t.bin"), &bytes).unwrap();
        let json = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
            "nodes":[{"mesh":0,"translation":[5,0,0]}],
            "meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},"indices":2}]}],
            "buffers":[{"uri":"t.bin","byteLength":66}],
            "bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":24},
                           {"buffer":0,"byteOffset":60,"byteLength":6}],
            "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
                         {"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"},
                         {"bufferView":2,"componentType":5123,"count":3,"type":"SCALAR"}]}"#;
        std::fs::write(dir.join("t.gltf"), json).unwrap();
        dir.join("t.gltf")
    }

    /// Writes a glTF file of a triangle that has a material.
    pub(crate) fn write_gltf_with_material(dir: &Path, material: &Value) -> std::path::PathBuf {
        let path = write_gltf(dir, 2);
        let text = std::fs::read_to_string(&path).unwrap();
        let mut document: Value = serde_json::from_str(&text).unwrap();
        document["materials"] = serde_json::json!([material]);
        document["meshes"][0]["primitives"][0]["material"] = 0.into();
        std::fs::write(&path, document.to_string()).unwrap();
        path
    }

    #[test]
    fn reads_an_obj_and_derives_its_frame() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.obj");
        std::fs::write(&path, TRIANGLE_OBJ).unwrap();
        let parts = &load_meshes(&path).unwrap()[0].parts;
        assert_eq!((parts.len(), parts[0].triangles.len(), parts[0].has_uv), (1, 1, true));
        let vertex = parts[0].vertices[0];
        assert_eq!((vertex.normal, vertex.tangent), ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]));
    }

    #[test]
    fn reads_a_gltf_with_its_node_transform_and_turns_v_upwards() {
        let dir = tempfile::tempdir().unwrap();
        let parts = &load_meshes(&write_gltf(dir.path(), 2)).unwrap()[0].parts;
        let vertex = parts[0].vertices[2];
        assert_eq!((vertex.position, vertex.u, vertex.v), ([5.0, 1.0, 0.0], 0.0, 1.0));
        assert_eq!((vertex.normal, vertex.tangent), ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]));
    }

    #[test]
    fn a_gltf_material_reflects_what_it_does_not_let_through() {
        let dir = tempfile::tempdir().unwrap();
        let read = |transmission: Value| {
            let material = serde_json::json!({
                "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.25, 1.0, 1.0] },
                "extensions": { "KHR_materials_diffuse_transmission": transmission },
            });
            load_meshes(&write_gltf_with_material(dir.path(), &material)).unwrap()[0].parts[0].colour
        };
        let told = |more: Value| {
            let mut told = serde_json::json!({ "diffuseTransmissionFactor": 0.25 });
            told.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
            read(told)
        };
        let opaque = DiffuseColour::opaque([0.5, 0.25, 1.0]);
        let reflectance = [0.375, 0.1875, 0.75];
        assert_eq!(read(serde_json::json!({})), opaque);
        assert_eq!(told(serde_json::json!({})), DiffuseColour { reflectance, transmittance: [0.25; 3] });
        let green = told(serde_json::json!({ "diffuseTransmissionColorFactor": [0.0, 1.0, 0.5] }));
        assert_eq!(green, DiffuseColour { reflectance, transmittance: [0.0, 0.25, 0.125] });
        // Pictures are not read, so nobody knows where it lets light through.
        assert_eq!(told(serde_json::json!({ "diffuseTransmissionTexture": { "index": 0 } })), opaque);
    }

    /// Writes a glTF file of a triangle, placed by the extension with the attributes given.
    fn write_instanced(dir: &Path, attributes: &Value) -> std::path::PathBuf {
        let path = write_gltf(dir, 2);
        let text = std::fs::read_to_string(&path).unwrap();
        let mut document: Value = serde_json::from_str(&text).unwrap();
        document["nodes"][0]["extensions"][INSTANCING]["attributes"] = attributes.clone();
        document["extensionsUsed"] = serde_json::json!([INSTANCING]);
        std::fs::write(&path, document.to_string()).unwrap();
        path
    }

    #[test]
    fn instances_stand_where_nodes_and_the_extension_say() {
        let dir = tempfile::tempdir().unwrap();
        // The triangle's own corners serve as translations.
        let meshes = load_meshes(&write_instanced(dir.path(), &serde_json::json!({ "TRANSLATION": 0 }))).unwrap();
        assert_eq!(meshes.len(), 1);
        let at: Vec<Vec3> = meshes[0].places.iter().map(|place| place.w_axis.truncate()).collect();
        assert_eq!(at, [Vec3::new(5.0, 0.0, 0.0), Vec3::new(6.0, 0.0, 0.0), Vec3::new(5.0, 1.0, 0.0)]);
        assert_eq!(meshes[0].parts[0].vertices[1].position, [1.0, 0.0, 0.0]);
        // Accessors of other kinds, or that are not there, or none at all.
        for bad in [r#"{"TRANSLATION": 1}"#, r#"{"TRANSLATION": 7}"#, r#"{"ROTATION": 0}"#, r#"{"SCALE": "x"}"#, "{}"] {
            let path = write_instanced(dir.path(), &serde_json::from_str(bad).unwrap());
            let message = load_meshes(&path).unwrap_err().to_string();
            assert!(message.contains(INSTANCING) || message.contains("flattens"), "{message}");
        }
        // Two nodes that share a mesh.
        let path = write_gltf(dir.path(), 2);
        let text = std::fs::read_to_string(&path).unwrap();
        let mut document: Value = serde_json::from_str(&text).unwrap();
        document["nodes"] = serde_json::json!([{ "mesh": 0 }, { "mesh": 0, "translation": [0, 0, 3] }]);
        document["scenes"][0]["nodes"] = serde_json::json!([0, 1]);
        std::fs::write(&path, document.to_string()).unwrap();
        let meshes = load_meshes(&path).unwrap();
        assert_eq!((meshes.len(), meshes[0].places.len()), (1, 2));
    }

    #[test]
    fn bad_meshes_are_refused_with_a_sentence_that_names_the_file() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            std::fs::write(dir.path().join(name), text).unwrap();
            dir.path().join(name)
        };
        let bad = [
            write("empty.obj", ""),
            write("points.obj", "v 0 0 0\nv 1 0 0\n"),
            write("range.obj", "v 0 0 0\nf 1 2 3\n"),
            write("nan.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
            write("cut.gltf", "{\"asset\":"),
            write("noise.glb", "glTFnothing of the kind"),
            write("mesh.stl", "solid"),
            write_gltf(dir.path(), 9),
            dir.path().join("missing.obj"),
        ];
        for path in bad {
            let message = load_meshes(&path).unwrap_err().to_string();
            assert!(message.starts_with(&path.display().to_string()), "{message}");
            assert!(!message.contains('\n'), "{message}");
        }
    }
}
