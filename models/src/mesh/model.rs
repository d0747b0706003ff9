//! A model in memory: meshes of parts, and where they stand.

use super::diffuse::DiffuseColour;
use crate::error::ModelError;
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

pub(super) fn fault(path: &Path, reason: impl Into<String>) -> ModelError {
    ModelError::Mesh { path: path.into(), reason: reason.into() }
}

/// Checks the numbers that everything after relies on.
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
