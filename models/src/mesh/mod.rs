//! Models: triangles with texture coordinates and the places where they stand, read from OBJ and glTF files.

mod diffuse;
mod gltf;
mod obj;

use crate::error::ModelError;
pub use diffuse::DiffuseColour;
use glam::Mat4;
use std::path::{Path, PathBuf};

/// Some triangles of a model that share a material.
#[derive(Debug, Clone, Default)]
pub struct ModelPart {
    /// Name of the material in the file.
    pub name: String,
    /// Number of the material in the file; parts with equal numbers have the same material.
    pub group: usize,
    /// What the material reflects and lets through, as if it were diffuse.
    pub colour: DiffuseColour,
    /// The leaf's description or the asset that the material points at by `BTF_materials_leaf` or `BTF_materials_spmm`.
    pub shows: Option<PathBuf>,
    /// Whether the material says that it is seen from both sides.
    pub double_sided: bool,
    /// Finite.
    pub positions: Vec<[f32; 3]>,
    /// One for each position, where the file has them.
    pub normals: Option<Vec<[f32; 3]>>,
    /// One for each position, where the file has them: towards growing u, w the sign of the other.
    pub tangents: Option<Vec<[f32; 4]>>,
    /// One for each position, where the file has them; v grows upwards.
    pub uvs: Option<Vec<[f32; 2]>>,
    /// Numbers of positions, all within range.
    pub triangles: Vec<[u32; 3]>,
}

/// A mesh of a model, and where it stands in the model's world.
#[derive(Debug, Clone, Default)]
pub struct ModelMesh {
    /// Its parts, in the mesh's own space.
    pub parts: Vec<ModelPart>,
    /// At least one, each invertible.
    pub places: Vec<Mat4>,
}

/// Whether a file is a model by its name.
pub fn is_model(path: &Path) -> bool {
    ["obj", "gltf", "glb"].contains(&extension_of(path).as_str())
}

fn extension_of(path: &Path) -> String {
    path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase()
}

/// Reads `.obj`, `.gltf` or `.glb`: every mesh that is placed, with its places, those of `EXT_mesh_gpu_instancing` among them.
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

/// The file that an address in the glTF file `path` means.
pub fn beside(path: &Path, uri: &str) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).join(unescaped(uri))
}

/// An address with its escaped bytes as they are; what is no escape stays.
fn unescaped(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let mut out = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let digits = uri.get(at + 1..at + 3).filter(|_| bytes[at] == b'%');
        match digits.and_then(|digits| u8::from_str_radix(digits, 16).ok()) {
            Some(byte) => {
                out.push(byte);
                at += 3;
            }
            None => {
                out.push(bytes[at]);
                at += 1;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}

fn fault(path: &Path, reason: impl Into<String>) -> ModelError {
    ModelError::Mesh { path: path.into(), reason: reason.into() }
}

/// Checks the numbers that everything after relies on.
fn checked(path: &Path, part: ModelPart) -> Result<ModelPart, ModelError> {
    let wrong = |what: &str| fault(path, format!("the part '{}' {what}, export it again", part.name));
    let count = part.positions.len();
    if part.triangles.iter().flatten().any(|index| *index as usize >= count) {
        return Err(wrong("names a vertex that is not there"));
    }
    let finite = |numbers: &[f32]| numbers.iter().all(|x| x.is_finite());
    let all_finite = finite(part.positions.as_flattened())
        && part.normals.as_ref().is_none_or(|normals| finite(normals.as_flattened()))
        && part.tangents.as_ref().is_none_or(|tangents| finite(tangents.as_flattened()))
        && part.uvs.as_ref().is_none_or(|uvs| finite(uvs.as_flattened()));
    if !all_finite {
        return Err(wrong("has a coordinate that is not a finite number"));
    }
    Ok(part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_unescaped_and_lie_beside_the_file() {
        assert_eq!(unescaped("a%20b%zz%2"), "a b%zz%2");
        assert_eq!(beside(Path::new("plants/maize.glb"), "maize%20leaf.toml"), Path::new("plants/maize leaf.toml"));
    }
}
