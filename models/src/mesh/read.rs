//! Reads a model file of any kind.

use super::model::{ModelMesh, fault};
use super::{gltf, obj};
use crate::error::ModelError;
use glam::Mat4;
use std::path::Path;

/// Returns whether the name of a file is that of a model.
pub fn is_model(path: &Path) -> bool {
    ["obj", "gltf", "glb"].contains(&extension_of(path).as_str())
}

fn extension_of(path: &Path) -> String {
    path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase()
}

/// Returns the lengths of a field of plants along x and z in metres, with which it repeats without end, as `btf-synth plants`
/// writes them into a glTF file; `None` where the file, or a file of another kind, does not say so.
///
/// # Errors
/// [`ModelError::Mesh`] for a glTF file that cannot be read.
pub fn field_m(path: &Path) -> Result<Option<[f64; 2]>, ModelError> {
    match extension_of(path).as_str() {
        "gltf" | "glb" => gltf::field_m(path),
        _ => Ok(None),
    }
}

/// Reads an `.obj`, `.gltf` or `.glb` file: every mesh that is placed, with its transforms, those of
/// `EXT_mesh_gpu_instancing` included.
///
/// # Errors
/// [`ModelError::Mesh`] for files of other kinds, files that cannot be read, have no triangles or name vertices that are
/// not there.
pub fn read_model(path: &Path) -> Result<Vec<ModelMesh>, ModelError> {
    let meshes = match extension_of(path).as_str() {
        "obj" => vec![ModelMesh { parts: obj::read(path)?, places: vec![Mat4::IDENTITY] }],
        "gltf" | "glb" => gltf::read(path)?,
        _ => return Err(fault(path, "this is no model: an .obj, .gltf or .glb file is needed")),
    };
    if meshes.iter().flat_map(|mesh| &mesh.parts).all(|part| part.triangles.is_empty()) {
        return Err(fault(path, "it has no triangles, export the mesh's faces"));
    }
    Ok(meshes)
}
