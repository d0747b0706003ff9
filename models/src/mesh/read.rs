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

/// Tells whether a file's name is that of a glTF file.
pub(super) fn is_gltf(path: &Path) -> bool {
    matches!(extension_of(path).as_str(), "gltf" | "glb")
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
