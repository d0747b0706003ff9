//! Writes a canopy as a binary glTF file: a mesh for every variant, instances by `EXT_mesh_gpu_instancing`, and the
//! description of the leaf in the extension `BTF_materials_leaf`. docs/guide/plants.md specifies it.

use btf_models::LeafDescription;
use btf_models::glb::{F32, GlbBuffer, INDICES, TRIANGLES, U32, VERTICES, glb_from};
use serde_json::{Map, Value, json};

use crate::error::SynthError;
use crate::optics::colour::RgbBands;
use crate::optics::plates::body::PlateBody;
use crate::optics::plates::model::PlateModel;
use crate::plants::canopy::Canopy;
use crate::plants::mesh::Mesh;
use crate::plants::plant::Part;

/// Name of the extension of the leaf's material: `{ "leaf": URI of its description }`.
pub const LEAF_EXTENSION: &str = "BTF_materials_leaf";

/// Name of the Khronos extension for instances.
const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// Returns the bytes of the file. `leaf_uri` is the address of the description, relative to the file.
///
/// # Errors
/// [`SynthError::BadParameter`] for a canopy of 4 GiB and more.
pub(crate) fn canopy_glb(canopy: &Canopy, leaf: &LeafDescription, leaf_uri: &str) -> Result<Vec<u8>, SynthError> {
    let mut parts: Vec<Part> =
        canopy.variants.iter().flat_map(|variant| &variant.meshes).map(|(part, _)| *part).collect();
    parts.extend(canopy.ground.is_some().then_some(Part::Ground));
    parts.sort();
    parts.dedup();
    let colour = leaf_colour(leaf)?;
    let materials = parts.iter().map(|part| material(*part, colour, leaf_uri)).collect::<Vec<_>>();

    let mut writer = Writer::default();
    let (mut meshes, mut nodes, mut instancing) = (Vec::new(), Vec::new(), false);
    for (number, variant) in canopy.variants.iter().enumerate() {
        let primitives = variant.meshes.iter().map(|(part, mesh)| writer.primitive(mesh, *part, &parts));
        let primitives: Vec<Value> = primitives.collect();
        let name = format!("{} {}", leaf.species.map_or("plant", |species| species.name()), number + 1);
        let mut node = json!({ "name": name, "mesh": meshes.len() });
        meshes.push(json!({ "name": name, "primitives": primitives }));
        if canopy.instances.len() > 1 {
            instancing = true;
            node["extensions"] = json!({ INSTANCING: { "attributes": writer.instances(canopy, number) } });
        }
        nodes.push(node);
    }
    if let Some(ground) = &canopy.ground {
        nodes.push(json!({ "name": Part::Ground.name(), "mesh": meshes.len() }));
        meshes.push(
            json!({ "name": Part::Ground.name(), "primitives": [writer.primitive(ground, Part::Ground, &parts)] }),
        );
    }
    let mut used = Vec::new();
    used.extend(parts.contains(&Part::Leaf).then_some(LEAF_EXTENSION));
    used.extend(instancing.then_some(INSTANCING));
    let mut document = json!({
        "asset": { "version": "2.0", "generator": concat!("btf-synth ", env!("CARGO_PKG_VERSION")) },
        "scene": 0,
        "scenes": [{
            "nodes": (0..nodes.len()).collect::<Vec<_>>(),
            "extras": { "field_m": canopy.field_m },
        }],
        "nodes": nodes,
        "meshes": meshes,
        "materials": materials,
        "accessors": writer.accessors,
        "bufferViews": writer.buffer.views,
        "buffers": [{ "byteLength": writer.buffer.bytes.len() }],
    });
    if !used.is_empty() {
        document["extensionsUsed"] = json!(used);
    }
    glb_from(&document, writer.buffer.bytes).ok_or_else(|| SynthError::BadParameter {
        name: "--plants",
        value: canopy.instances.len().to_string(),
        allowed: "fewer, or fewer --variants of less --detail: a .glb holds less than 4 GiB".into(),
    })
}

/// Returns the linear colour of the lit face of a leaf.
fn leaf_colour(leaf: &LeafDescription) -> Result<[f32; 3], SynthError> {
    let model = PlateModel::N;
    let body = PlateBody::new(model, model.default_table(), RgbBands::Spectral31)?;
    Ok(body.rgb(&leaf.contents, 1.0).reflectance.map(|x| x.clamp(0.0, 1.0)))
}

/// Returns the look of a part: linear base colour chosen by eye, and roughness. The colour of a leaf is that of its
/// contents.
pub(crate) fn look(part: Part) -> ([f32; 3], f64) {
    match part {
        Part::Leaf => ([0.05, 0.12, 0.03], 0.5),
        Part::Stem => ([0.10, 0.19, 0.035], 0.55),
        Part::Tassel => ([0.42, 0.32, 0.12], 0.8),
        Part::Pod => ([0.19, 0.24, 0.06], 0.8),
        Part::Petal => ([0.70, 0.70, 0.68], 0.8),
        Part::Disc => ([0.75, 0.45, 0.02], 0.9),
        Part::Bark => ([0.11, 0.08, 0.06], 0.9),
        Part::Ground => ([0.10, 0.065, 0.04], 1.0),
    }
}

/// Returns the material of a part for readers that do not know the leaf extension.
fn material(part: Part, leaf_colour: [f32; 3], leaf_uri: &str) -> Value {
    let (colour, roughness) = look(part);
    let colour = if part == Part::Leaf { leaf_colour } else { colour };
    // Through the decimal form, so that the file has no digits of single precision's noise.
    let decimal = |x: f32| format!("{x:.4}").parse::<f64>().unwrap_or_default();
    let [r, g, b] = colour.map(decimal);
    let mut extensions = Map::new();
    if part == Part::Leaf {
        extensions.insert(LEAF_EXTENSION.into(), json!({ "leaf": leaf_uri }));
    }
    let mut material = json!({
        "name": part.name(),
        "pbrMetallicRoughness": { "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0, "roughnessFactor": roughness },
        "doubleSided": matches!(part, Part::Leaf | Part::Petal),
    });
    if !extensions.is_empty() {
        material["extensions"] = Value::Object(extensions);
    }
    material
}

/// Writer of accessors and their data.
#[derive(Default)]
struct Writer {
    buffer: GlbBuffer,
    accessors: Vec<Value>,
}

impl Writer {
    /// Appends numbers and returns the index of their accessor.
    fn floats<const N: usize>(&mut self, values: &[[f32; N]], target: Option<u32>) -> usize {
        let bytes: Vec<u8> = values.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        let view = self.buffer.push(&bytes, target);
        self.accessors.push(json!({ "bufferView": view, "componentType": F32, "count": values.len(), "type": kind }));
        self.accessors.len() - 1
    }

    fn primitive(&mut self, mesh: &Mesh, part: Part, parts: &[Part]) -> Value {
        let position = self.floats(&mesh.positions, Some(VERTICES));
        let edge = |pick: fn(f32, f32) -> f32, start: f32| -> [f32; 3] {
            std::array::from_fn(|k| mesh.positions.iter().map(|p| p[k]).fold(start, pick))
        };
        self.accessors[position]["min"] = json!(edge(f32::min, f32::MAX));
        self.accessors[position]["max"] = json!(edge(f32::max, f32::MIN));
        let attributes = json!({
            "POSITION": position,
            "NORMAL": self.floats(&mesh.normals, Some(VERTICES)),
            "TANGENT": self.floats(&mesh.tangents, Some(VERTICES)),
            "TEXCOORD_0": self.floats(&mesh.uvs, Some(VERTICES)),
        });
        let bytes: Vec<u8> = mesh.indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        let view = self.buffer.push(&bytes, Some(INDICES));
        let indices = self.accessors.len();
        self.accessors
            .push(json!({ "bufferView": view, "componentType": U32, "count": mesh.indices.len(), "type": "SCALAR" }));
        let material = parts.iter().position(|found| *found == part);
        json!({ "attributes": attributes, "indices": indices, "material": material, "mode": TRIANGLES })
    }

    /// Returns the attributes of all instances of a variant.
    fn instances(&mut self, canopy: &Canopy, variant: usize) -> Value {
        let instances: Vec<_> = canopy.instances.iter().filter(|one| one.variant == variant).collect();
        let translations: Vec<[f32; 3]> = instances.iter().map(|one| [one.x_m as f32, 0.0, one.z_m as f32]).collect();
        let rotation = |yaw_rad: f64| [0.0, (0.5 * yaw_rad).sin() as f32, 0.0, (0.5 * yaw_rad).cos() as f32];
        let rotations: Vec<[f32; 4]> = instances.iter().map(|one| rotation(one.yaw_rad)).collect();
        let scales: Vec<[f32; 3]> = instances.iter().map(|one| [one.scale as f32; 3]).collect();
        json!({
            "TRANSLATION": self.floats(&translations, None),
            "ROTATION": self.floats(&rotations, None),
            "SCALE": self.floats(&scales, None),
        })
    }
}
