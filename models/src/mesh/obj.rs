//! OBJ files.

use super::diffuse::DiffuseColour;
use super::model::{ModelPart, checked, fault};
use crate::error::ModelError;
use std::path::Path;

/// The parts of an OBJ file; a missing .mtl only costs the colours.
pub(super) fn read(path: &Path) -> Result<Vec<ModelPart>, ModelError> {
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };
    let (models, materials) = tobj::load_obj(path, &options)
        .map_err(|error| fault(path, format!("the OBJ file cannot be read: {error}; copy or export it again")))?;
    let materials = materials.unwrap_or_default();
    let mut parts = Vec::new();
    for model in models {
        let mesh = model.mesh;
        if mesh.positions.is_empty() || mesh.indices.is_empty() {
            continue;
        }
        let count = mesh.positions.len() / 3;
        let triples = |numbers: &[f32]| numbers.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect::<Vec<_>>();
        let material = mesh.material_id.and_then(|id| materials.get(id));
        let part = ModelPart {
            name: material.map_or(model.name, |material| material.name.clone()),
            group: mesh.material_id.unwrap_or(0),
            colour: DiffuseColour::opaque(material.and_then(|material| material.diffuse).unwrap_or([0.5; 3])),
            positions: triples(&mesh.positions),
            normals: (mesh.normals.len() == 3 * count).then(|| triples(&mesh.normals)),
            uvs: (mesh.texcoords.len() == 2 * count)
                .then(|| mesh.texcoords.chunks_exact(2).map(|uv| [uv[0], uv[1]]).collect()),
            triangles: mesh.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
            ..ModelPart::default()
        };
        parts.push(checked(path, part)?);
    }
    Ok(parts)
}
