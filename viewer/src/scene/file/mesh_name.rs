//! The meshes that a name of a scene file stands for.

use super::source::Source;
use crate::error::ViewerError;
use crate::scene::builtin;
use crate::scene::mesh;
use crate::scene::mesh_file::{FileMesh, load_meshes};
use glam::Mat4;

/// Names that a scene can say instead of a mesh file.
pub(super) const BUILT_IN_MESHES: [&str; 9] =
    ["sphere", "plane", "cube", "leaf", "cornell", "cloth", "shoe", "boots", "pullover"];

/// Returns the meshes that a name stands for: built in, or of a file beside the scene file.
///
/// # Errors
/// The errors of [`load_meshes`].
pub(super) fn meshes_of(name: &str, source: Source) -> Result<Vec<FileMesh>, ViewerError> {
    let built_in = |parts| Ok(vec![FileMesh { parts, places: vec![Mat4::IDENTITY] }]);
    match name {
        // All of these are in BUILT_IN_MESHES.
        "sphere" => built_in(vec![mesh::sphere()]),
        "plane" => built_in(vec![mesh::plane()]),
        "cube" => built_in(vec![mesh::cube("cube")]),
        "leaf" => built_in(builtin::leaf_blade()),
        "cornell" => built_in(builtin::cornell()),
        "cloth" => built_in(builtin::cloth()),
        "shoe" => built_in(builtin::shoe()),
        "boots" => built_in(builtin::boots()),
        "pullover" => built_in(builtin::pullover()),
        file => load_meshes(&source.beside(file)),
    }
}
