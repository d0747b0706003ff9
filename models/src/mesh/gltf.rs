//! Reads meshes from glTF files.

use super::accessors::Accessors;
use super::address::beside;
use super::diffuse::DiffuseColour;
use super::gltf_file::{gltf_buffers, open_gltf};
use super::model::{ModelMesh, ModelPart, checked, fault};
use crate::error::ModelError;
use glam::{Mat4, Quat, Vec3};
use serde_json::Value;
use std::path::Path;

/// Name of the extension with which a node places its mesh many times.
const INSTANCING: &str = "EXT_mesh_gpu_instancing";
/// Name of the extension with which a material transmits light diffusely.
const TRANSMISSION: &str = "KHR_materials_diffuse_transmission";

/// Returns the lengths of a field in metres, `field_m` in the extras of the scene; `None` where the file does not say so.
pub(super) fn field_m(path: &Path) -> Result<Option<[f64; 2]>, ModelError> {
    let gltf = open_gltf(path)?;
    let scene = gltf.default_scene().or_else(|| gltf.scenes().next());
    let extras = scene.and_then(|scene| scene.extras().as_ref().map(|extras| extras.get().to_owned()));
    let told: Option<Value> = extras.and_then(|extras| serde_json::from_str(&extras).ok());
    let side = |k: usize| {
        let side = told.as_ref()?.get("field_m")?.get(k)?.as_f64()?;
        (side.is_finite() && side > 0.0).then_some(side)
    };
    Ok(side(0).zip(side(1)).map(|(x, z)| [x, z]))
}

/// Reads the meshes of a glTF file that are placed, in the order of the file. Images inside the file are not decoded.
pub(super) fn read(path: &Path) -> Result<Vec<ModelMesh>, ModelError> {
    let fault = |reason: String| fault(path, reason);
    let gltf = open_gltf(path)?;
    let buffers = gltf_buffers(path, &gltf)?;
    let mut accessors = Accessors::new(path, &gltf, &buffers)?;
    let scene = gltf
        .default_scene()
        .or_else(|| gltf.scenes().next())
        .ok_or_else(|| fault("the glTF file has no scene, export one".into()))?;
    // Where each mesh stands.
    let mut places: Vec<Vec<Mat4>> = vec![Vec::new(); gltf.meshes().count()];
    let mut open: Vec<(gltf::Node, Mat4)> = scene.nodes().map(|node| (node, Mat4::IDENTITY)).collect();
    open.reverse();
    let mut visited = vec![false; gltf.nodes().count()];
    while let Some((node, parent)) = open.pop() {
        // Nodes are trees; a cycle would have no end, and shared children could double with every level.
        if std::mem::replace(&mut visited[node.index()], true) {
            return Err(fault(format!("node {} stands below two nodes, export it again", node.index())));
        }
        let matrix = parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        if let Some(mesh) = node.mesh() {
            let own = instances_of(&node, &gltf, &mut accessors).ok_or_else(|| {
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
    let mut meshes = Vec::new();
    for (mesh, places) in gltf.meshes().zip(places) {
        if places.is_empty() {
            continue;
        }
        let mut parts = Vec::new();
        for primitive in mesh.primitives() {
            parts.extend(part_of(path, &primitive, &mut accessors)?);
        }
        meshes.push(ModelMesh { parts, places });
    }
    Ok(meshes)
}

/// Returns the transforms with which a node places its mesh, in the node's own space: one, or those of [`INSTANCING`].
/// Returns `None` if the extension is invalid.
fn instances_of(node: &gltf::Node, gltf: &gltf::Gltf, accessors: &mut Accessors) -> Option<Vec<Mat4>> {
    use gltf::accessor::{DataType, Dimensions, Iter};
    let Some(extension) = node.extension_value(INSTANCING) else { return Some(vec![Mat4::IDENTITY]) };
    let mut accessor = |name: &str, dimensions: Dimensions| match &extension["attributes"][name] {
        Value::Null => Some(None),
        number => {
            let accessor = gltf.accessors().nth(usize::try_from(number.as_u64()?).ok()?)?;
            accessors.take(&accessor, &[DataType::F32], dimensions, "instances").ok()?;
            Some(Some(accessor))
        }
    };
    let [translations, turns, scales] =
        [("TRANSLATION", Dimensions::Vec3), ("ROTATION", Dimensions::Vec4), ("SCALE", Dimensions::Vec3)]
            .map(|(name, dimensions)| accessor(name, dimensions));
    let (translations, turns, scales) = (translations?, turns?, scales?);
    let buffer = |buffer: gltf::Buffer| accessors.bytes(&buffer);
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

fn part_of(
    path: &Path,
    primitive: &gltf::Primitive,
    accessors: &mut Accessors,
) -> Result<Option<ModelPart>, ModelError> {
    use gltf::accessor::DataType::{F32, U8, U16, U32};
    use gltf::accessor::Dimensions::{Scalar, Vec2, Vec3, Vec4};
    use gltf::mesh::{Mode, Semantic};
    let fault = |reason: &str| fault(path, reason);
    if primitive.mode() != Mode::Triangles {
        return match primitive.mode() {
            Mode::TriangleStrip | Mode::TriangleFan => {
                Err(fault("it has triangle strips or fans, export plain triangles"))
            }
            // Points and lines have no surface.
            _ => Ok(None),
        };
    }
    let mut take = |accessor: Option<gltf::Accessor>, types: &[gltf::accessor::DataType], dimensions, what| {
        accessor.map_or(Ok(()), |accessor| accessors.take(&accessor, types, dimensions, what))
    };
    take(primitive.get(&Semantic::Positions), &[F32], Vec3, "positions")?;
    take(primitive.get(&Semantic::Normals), &[F32], Vec3, "normals")?;
    take(primitive.get(&Semantic::Tangents), &[F32], Vec4, "tangents")?;
    take(primitive.get(&Semantic::TexCoords(0)), &[U8, U16, F32], Vec2, "texture coordinates")?;
    take(primitive.indices(), &[U8, U16, U32], Scalar, "indices")?;
    let reader = primitive.reader(|buffer| accessors.bytes(&buffer));
    let positions: Vec<[f32; 3]> =
        reader.read_positions().ok_or_else(|| fault("a primitive has no positions, export it again"))?.collect();
    let normals: Option<Vec<[f32; 3]>> = reader.read_normals().map(Iterator::collect);
    let tangents: Option<Vec<[f32; 4]>> = reader.read_tangents().map(Iterator::collect);
    // glTF's v grows downwards; its tangents are already for the upward one.
    let uvs: Option<Vec<[f32; 2]>> =
        reader.read_tex_coords(0).map(|uvs| uvs.into_f32().map(|[u, v]| [u, 1.0 - v]).collect());
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
    let material = primitive.material();
    let part = ModelPart {
        name: material.name().unwrap_or("unnamed").into(),
        group: material.index().unwrap_or(0),
        colour: colour(&material),
        shows: shown(&material).map(|uri| beside(path, uri)),
        double_sided: material.double_sided(),
        positions,
        normals,
        tangents,
        uvs,
        triangles: indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
    };
    checked(path, part).map(Some)
}

/// Returns the address of the leaf or asset beside the file that a material points at.
fn shown<'a>(material: &'a gltf::Material) -> Option<&'a str> {
    let leaf = material.extension_value("BTF_materials_leaf").map(|told| &told["leaf"]);
    leaf.or_else(|| material.extension_value("BTF_materials_spmm").map(|told| &told["asset"]["uri"]))?.as_str()
}

/// Returns what a material reflects and, by [`TRANSMISSION`], transmits. A share that is given as a texture counts as
/// none.
fn colour(material: &gltf::Material) -> DiffuseColour {
    let [r, g, b, _] = material.pbr_metallic_roughness().base_color_factor();
    let extension = material.extension_value(TRANSMISSION).filter(|told| told["diffuseTransmissionTexture"].is_null());
    let Some(told) = extension else { return DiffuseColour::of_gltf([r, g, b], 0.0, [0.0; 3]) };
    let number = |value: &Value, usual: f64| value.as_f64().unwrap_or(usual) as f32;
    let share = number(&told["diffuseTransmissionFactor"], 0.0);
    let passed = [0, 1, 2].map(|i| number(&told["diffuseTransmissionColorFactor"][i], 1.0));
    DiffuseColour::of_gltf([r, g, b], share, passed)
}
