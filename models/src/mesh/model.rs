//! A model in memory: meshes of parts, with the transforms that place them.

use super::diffuse::DiffuseColour;
use crate::error::ModelError;
use glam::Mat4;
use std::path::{Path, PathBuf};

/// Triangles of a model that share a material.
#[derive(Debug, Clone, Default)]
pub struct ModelPart {
    /// Name of the material in the file.
    pub name: String,
    /// Number of the material in the file; parts with equal numbers have the same material.
    pub group: usize,
    /// Reflectance and transmittance of the material, as if it were diffuse.
    pub colour: DiffuseColour,
    /// Description of a leaf, or asset, that the material points at by `BTF_materials_leaf` or `BTF_materials_spmm`.
    pub shows: Option<PathBuf>,
    /// Whether the material is marked as visible from both sides.
    pub double_sided: bool,
    /// Positions of the vertices; finite.
    pub positions: Vec<[f32; 3]>,
    /// Normals, one for each position, where the file has them.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Tangents towards growing u, one for each position, where the file has them; w is the sign of the bitangent.
    pub tangents: Option<Vec<[f32; 4]>>,
    /// Texture coordinates, one for each position, where the file has them; v grows upwards.
    pub uvs: Option<Vec<[f32; 2]>>,
    /// Indices of positions, all within range.
    pub triangles: Vec<[u32; 3]>,
}

/// Mesh of a model, with the transforms that place it in the world of the model.
#[derive(Debug, Clone, Default)]
pub struct ModelMesh {
    /// Parts of the mesh, in its own space.
    pub parts: Vec<ModelPart>,
    /// Transforms of the mesh, at least one, each invertible.
    pub places: Vec<Mat4>,
}

pub(super) fn fault(path: &Path, reason: impl Into<String>) -> ModelError {
    ModelError::Mesh { path: path.into(), reason: reason.into() }
}

/// Checks the numbers of a part that all later code relies on: indices in range, finite coordinates.
pub(super) fn checked(path: &Path, part: ModelPart) -> Result<ModelPart, ModelError> {
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
