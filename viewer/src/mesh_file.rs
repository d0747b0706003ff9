//! OBJ and glTF files as meshes and the places where they stand.

use crate::error::ViewerError;
use crate::geometry::Vertex;
use crate::mesh::{MeshPart, fill_normals, fill_tangents, tangent_of};
use glam::{Mat4, Quat, Vec3};
use serde_json::Value;
use std::path::Path;

/// The glTF extension with which a node places its mesh many times.
const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// A mesh of a file, and where it stands in the file's world.
#[derive(Debug, Clone)]
pub struct FileMesh {
    /// Its parts, in the mesh's own space.
    pub parts: Vec<MeshPart>,
    /// At least one.
    pub places: Vec<Mat4>,
}

/// Reads `.obj`, `.gltf` or `.glb`; texture coordinates are turned so that v grows upwards, missing normals and tangents
/// filled in. Parts without texture coordinates come with `has_uv = false`. What the file places once comes together as one
/// mesh in the world; what it places more often, by several nodes or by `EXT_mesh_gpu_instancing`, as a mesh each.
///
/// # Errors
/// [`ViewerError::Mesh`] for files that cannot be read, have no triangles or name vertices that are not there.
pub fn load_meshes(path: &Path) -> Result<Vec<FileMesh>, ViewerError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    let meshes = match extension.as_str() {
        "obj" => vec![FileMesh { parts: load_obj(path)?, places: vec![Mat4::IDENTITY] }],
        "gltf" | "glb" => load_gltf(path)?,
        _ => {
            return Err(ViewerError::mesh(
                path,
                "this is neither a built-in mesh (sphere, plane, cornell, cloth, shoe, boots, pullover) nor an .obj, .gltf or .glb file",
            ));
        }
    };
    if meshes.iter().flat_map(|mesh| &mesh.parts).all(|part| part.triangles.is_empty()) {
        return Err(ViewerError::mesh(path, "it has no triangles, export the mesh's faces"));
    }
    Ok(meshes)
}

/// Fills what the file lacks, and checks the numbers that everything after relies on.
fn finish(path: &Path, mut part: MeshPart, has_normals: bool, has_tangents: bool) -> Result<MeshPart, ViewerError> {
    let fault = |what: &str| ViewerError::mesh(path, format!("the part '{}' {what}, export it again", part.name));
    let count = part.vertices.len();
    if part.triangles.iter().flatten().any(|index| *index as usize >= count) {
        return Err(fault("names a vertex that is not there"));
    }
    if part.vertices.iter().any(|vertex| bytemuck::cast_ref::<Vertex, [f32; 12]>(vertex).iter().any(|x| !x.is_finite()))
    {
        return Err(fault("has a coordinate that is not a finite number"));
    }
    for vertex in &mut part.vertices {
        vertex.normal = Vec3::from(vertex.normal).normalize_or_zero().to_array();
    }
    if !has_normals || part.vertices.iter().any(|vertex| vertex.normal == [0.0; 3]) {
        fill_normals(&mut part.vertices, &part.triangles);
    }
    if has_tangents {
        for vertex in &mut part.vertices {
            let tangent = Vec3::from_slice(&vertex.tangent);
            vertex.tangent = tangent_of(vertex.normal.into(), tangent, vertex.tangent[3]);
        }
    } else {
        fill_tangents(&mut part.vertices, &part.triangles);
    }
    Ok(part)
}

fn load_obj(path: &Path) -> Result<Vec<MeshPart>, ViewerError> {
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };
    let (models, materials) = tobj::load_obj(path, &options)
        .map_err(|error| ViewerError::mesh(path, format!("the OBJ file cannot be read: {error}")))?;
    // A missing .mtl only costs the colours.
    let materials = materials.unwrap_or_default();
    let mut parts = Vec::new();
    for model in models {
        let mesh = model.mesh;
        if mesh.positions.is_empty() || mesh.indices.is_empty() {
            continue;
        }
        let count = mesh.positions.len() / 3;
        let has_uv = mesh.texcoords.len() == 2 * count;
        let has_normals = mesh.normals.len() == 3 * count;
        let vertices = (0..count)
            .map(|i| Vertex {
                position: [mesh.positions[3 * i], mesh.positions[3 * i + 1], mesh.positions[3 * i + 2]],
                u: if has_uv { mesh.texcoords[2 * i] } else { 0.0 },
                normal: if has_normals {
                    [mesh.normals[3 * i], mesh.normals[3 * i + 1], mesh.normals[3 * i + 2]]
                } else {
                    [0.0; 3]
                },
                v: if has_uv { mesh.texcoords[2 * i + 1] } else { 0.0 },
                tangent: [1.0, 0.0, 0.0, 1.0],
            })
            .collect();
        let material = mesh.material_id.and_then(|id| materials.get(id));
        let part = MeshPart {
            name: material.map_or(model.name, |material| material.name.clone()),
            group: mesh.material_id.unwrap_or(0),
            diffuse: material.and_then(|material| material.diffuse).unwrap_or([0.5; 3]),
            has_uv,
            vertices,
            triangles: mesh.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        };
        parts.push(finish(path, part, has_normals, false)?);
    }
    Ok(parts)
}

fn load_gltf(path: &Path) -> Result<Vec<FileMesh>, ViewerError> {
    let fault = |reason: String| ViewerError::mesh(path, reason);
    // Geometry only: pictures inside the file are not decoded.
    let gltf = gltf::Gltf::open(path).map_err(|error| fault(format!("the glTF file cannot be read: {error}")))?;
    let buffers = gltf::import_buffers(&gltf.document, path.parent(), gltf.blob.clone())
        .map_err(|error| fault(format!("the glTF file's buffers cannot be read: {error}")))?;
    for accessor in gltf.accessors() {
        if !accessor_fits(&accessor, &buffers) {
            return Err(fault(format!("accessor {} reaches beyond its buffer, export it again", accessor.index())));
        }
    }
    let scene = gltf
        .default_scene()
        .or_else(|| gltf.scenes().next())
        .ok_or_else(|| fault("the glTF file has no scene, export one".into()))?;
    // Where each mesh stands.
    let mut places: Vec<Vec<Mat4>> = vec![Vec::new(); gltf.meshes().count()];
    let mut open: Vec<(gltf::Node, Mat4)> = scene.nodes().map(|node| (node, Mat4::IDENTITY)).collect();
    open.reverse();
    while let Some((node, parent)) = open.pop() {
        let matrix = parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        if let Some(mesh) = node.mesh() {
            let own = instances_of(&node, &gltf, &buffers).ok_or_else(|| {
                fault(format!("{INSTANCING} of node {} cannot be followed, export it again", node.index()))
            })?;
            for place in own.into_iter().map(|own| matrix * own) {
                if !(place.is_finite() && place.determinant().abs() > 1e-30) {
                    return Err(fault(format!(
                        "node {} has a transform that flattens it, correct its scale",
                        node.index()
                    )));
                }
                places[mesh.index()].push(place);
            }
        }
        let children: Vec<_> = node.children().map(|child| (child, matrix)).collect();
        open.extend(children.into_iter().rev());
    }
    let mut once = FileMesh { parts: Vec::new(), places: vec![Mat4::IDENTITY] };
    let mut often = Vec::new();
    for (mesh, places) in gltf.meshes().zip(places) {
        if places.is_empty() {
            continue;
        }
        let mut parts = Vec::new();
        for primitive in mesh.primitives() {
            parts.extend(gltf_part(path, &primitive, &buffers)?);
        }
        match places.as_slice() {
            [place] => {
                parts.iter_mut().for_each(|part| part.transform(*place));
                once.parts.extend(parts);
            }
            _ => often.push(FileMesh { parts, places }),
        }
    }
    let once = (!once.parts.is_empty()).then_some(once);
    Ok(once.into_iter().chain(often).collect())
}

/// Where a node places its mesh, in the node's own space: once, or as [`INSTANCING`] says; `None` if that makes no sense.
fn instances_of(node: &gltf::Node, gltf: &gltf::Gltf, buffers: &[gltf::buffer::Data]) -> Option<Vec<Mat4>> {
    use gltf::accessor::{DataType, Dimensions, Iter};
    let Some(extension) = node.extension_value(INSTANCING) else { return Some(vec![Mat4::IDENTITY]) };
    let buffer = |buffer: gltf::Buffer| buffers.get(buffer.index()).map(|data| data.0.as_slice());
    let accessor = |name: &str, dimensions: Dimensions| match &extension["attributes"][name] {
        Value::Null => Some(None),
        number => {
            let accessor = gltf.accessors().nth(usize::try_from(number.as_u64()?).ok()?)?;
            (accessor.data_type() == DataType::F32 && accessor.dimensions() == dimensions).then_some(Some(accessor))
        }
    };
    let [translations, turns, scales] =
        [("TRANSLATION", Dimensions::Vec3), ("ROTATION", Dimensions::Vec4), ("SCALE", Dimensions::Vec3)]
            .map(|(name, dimensions)| accessor(name, dimensions));
    let (translations, turns, scales) = (translations?, turns?, scales?);
    let counts: Vec<usize> =
        [&translations, &turns, &scales].into_iter().flatten().map(gltf::Accessor::count).collect();
    let count = *counts.first()?;
    if counts.iter().any(|other| *other != count) {
        return None;
    }
    let vectors = |accessor: Option<gltf::Accessor>, other: Vec3| -> Option<Vec<Vec3>> {
        let Some(accessor) = accessor else { return Some(vec![other; count]) };
        Some(Iter::<[f32; 3]>::new(accessor, buffer)?.map(Vec3::from).collect())
    };
    let turns: Vec<Quat> = match turns {
        Some(accessor) => Iter::<[f32; 4]>::new(accessor, buffer)?.map(|q| Quat::from_array(q).normalize()).collect(),
        None => vec![Quat::IDENTITY; count],
    };
    let placed = vectors(translations, Vec3::ZERO)?.into_iter().zip(turns).zip(vectors(scales, Vec3::ONE)?);
    Some(placed.map(|((at, turn), scale)| Mat4::from_scale_rotation_translation(scale, turn, at)).collect())
}

/// Whether all elements lie within the buffer view and that within its buffer; the crate's readers take it on trust.
fn accessor_fits(accessor: &gltf::Accessor, buffers: &[gltf::buffer::Data]) -> bool {
    let Some(view) = accessor.view() else { return true };
    let stride = view.stride().unwrap_or(accessor.size());
    let span = accessor
        .count()
        .checked_sub(1)
        .map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(accessor.size())?.checked_add(accessor.offset()));
    let end = view.offset().checked_add(view.length());
    span.is_some_and(|span| span <= view.length())
        && end.is_some_and(|end| buffers.get(view.buffer().index()).is_some_and(|buffer| end <= buffer.len()))
}

fn gltf_part(
    path: &Path,
    primitive: &gltf::Primitive,
    buffers: &[gltf::buffer::Data],
) -> Result<Option<MeshPart>, ViewerError> {
    use gltf::mesh::Mode;
    let fault = |reason: &str| ViewerError::mesh(path, reason);
    if primitive.mode() != Mode::Triangles {
        return match primitive.mode() {
            Mode::TriangleStrip | Mode::TriangleFan => {
                Err(fault("it has triangle strips or fans, export plain triangles"))
            }
            // Points and lines have no surface.
            _ => Ok(None),
        };
    }
    let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(|data| data.0.as_slice()));
    let positions: Vec<[f32; 3]> =
        reader.read_positions().ok_or_else(|| fault("a primitive has no positions, export it again"))?.collect();
    let normals: Option<Vec<[f32; 3]>> = reader.read_normals().map(Iterator::collect);
    let tangents: Option<Vec<[f32; 4]>> = reader.read_tangents().map(Iterator::collect);
    let uvs: Option<Vec<[f32; 2]>> = reader.read_tex_coords(0).map(|uvs| uvs.into_f32().collect());
    let indices: Vec<u32> = match reader.read_indices() {
        Some(indices) => indices.into_u32().collect(),
        None => (0..positions.len() as u32).collect(),
    };
    let same = |length: Option<usize>| length.is_none_or(|length| length == positions.len());
    if !same(normals.as_ref().map(Vec::len))
        || !same(tangents.as_ref().map(Vec::len))
        || !same(uvs.as_ref().map(Vec::len))
    {
        return Err(fault("a primitive's attributes differ in length, export it again"));
    }
    let vertices = (0..positions.len())
        .map(|i| Vertex {
            position: positions[i],
            u: uvs.as_ref().map_or(0.0, |uvs| uvs[i][0]),
            normal: normals.as_ref().map_or([0.0; 3], |normals| normals[i]),
            // glTF's v grows downwards; its tangents are already for the upward one.
            v: uvs.as_ref().map_or(0.0, |uvs| 1.0 - uvs[i][1]),
            tangent: tangents.as_ref().map_or([1.0, 0.0, 0.0, 1.0], |tangents| tangents[i]),
        })
        .collect();
    let material = primitive.material();
    let colour = material.pbr_metallic_roughness().base_color_factor();
    let part = MeshPart {
        name: material.name().unwrap_or("unnamed").into(),
        group: material.index().unwrap_or(0),
        diffuse: [colour[0], colour[1], colour[2]],
        has_uv: uvs.is_some(),
        vertices,
        triangles: indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
    };
    finish(path, part, normals.is_some(), tangents.is_some()).map(Some)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

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

    /// The same with a material, which its triangle has.
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

    /// The same triangle, placed by the extension with the attributes given.
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
