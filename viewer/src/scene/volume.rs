//! Volumetric textures of a scene: read from files, tinted, stood upright in the world, and compared with the models
//! that they were made of.

use crate::error::ViewerError;
use crate::scene::leaf_width::leaf_width;
use crate::scene::mesh_file::FileMesh;
use crate::volume::source::{VolumeSource, tinted};
use btf_runtime::voltex::{Voltex, Volume};
use glam::{Mat4, Vec3};
use std::path::Path;
use std::sync::Arc;

/// Reads a volumetric texture and makes it ready to be looked up.
///
/// # Errors
/// [`ViewerError::Read`] and [`ViewerError::Volume`], naming the file.
pub fn load_volume(path: &Path) -> Result<Arc<Voltex>, ViewerError> {
    Ok(Arc::new(Voltex::new(&read_volume(path)?)))
}

/// Reads a volumetric texture as its file has it.
///
/// # Errors
/// The errors of [`load_volume`].
pub(crate) fn read_volume(path: &Path) -> Result<Volume, ViewerError> {
    let bytes = btf_capture::files::read(path).map_err(|source| ViewerError::Read { path: path.into(), source })?;
    Volume::parse(&bytes).map_err(|source| ViewerError::Volume { path: path.into(), source })
}

/// Opens a volumetric texture with its materials' colours times `tint`. One that is stored by brick is loaded as far as
/// it is stored whole, and its source returned beside.
///
/// # Errors
/// The errors of [`load_volume`].
pub(crate) fn open_volume(
    path: &Path,
    tint: [f32; 3],
) -> Result<(Arc<Voltex>, Option<Arc<VolumeSource>>), ViewerError> {
    match VolumeSource::open(path, tint)? {
        Some(source) => Ok((Arc::new(source.load_whole_levels()?), Some(Arc::new(source)))),
        None => Ok((Arc::new(Voltex::new(&tinted(read_volume(path)?, tint))), None)),
    }
}

/// The tint that changes nothing.
pub(crate) const AS_IT_IS: [f32; 3] = [1.0; 3];

/// Returns the map from a volume's unit cube, whose z points up, to the world, whose y does: the middle of its floor
/// stands at `foot`, turned `yaw_rad` about the vertical, `scale` times as large as the model that it was made of.
pub fn standing(voltex: &Voltex, foot: Vec3, yaw_rad: f32, scale: f32) -> Mat4 {
    // Of the cube, what is used.
    let [along_x, along_y, _] = voltex.extent();
    let y_up =
        Mat4::from_cols(Vec3::X.extend(0.0), Vec3::NEG_Z.extend(0.0), Vec3::Y.extend(0.0), Vec3::ZERO.extend(1.0));
    Mat4::from_translation(foot)
        * Mat4::from_rotation_y(yaw_rad)
        * Mat4::from_scale(Vec3::splat(scale * voltex.side_m()))
        * y_up
        * Mat4::from_translation(-0.5 * Vec3::new(along_x, along_y, 0.0))
}

/// By how much a volume's cube is larger than the model that `btf-fit voltex` made it of.
const MARGIN: f32 = 1.001;
/// Share by which a model's size may differ from what its volume tells.
const SIZE_SLACK: f32 = 0.002;

/// Returns the map from a model's space, whose y points up, to the unit cube of the volume that was made of it, where
/// it stands in the middle of the floor.
///
/// # Errors
/// A sentence where the volume is not as large as one that is made of these meshes.
pub(crate) fn volume_from_model(voltex: &Voltex, meshes: &[FileMesh]) -> Result<Mat4, String> {
    let (mut lo, mut hi) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for mesh in meshes {
        for vertex in mesh.parts.iter().flat_map(|part| &part.vertices) {
            for place in &mesh.places {
                let at = place.transform_point3(vertex.position.into());
                (lo, hi) = (lo.min(at), hi.max(at));
            }
        }
    }
    let (extent, side_m) = ((hi - lo).max_element(), voltex.side_m());
    let side = extent * MARGIN;
    if !((1.0 - SIZE_SLACK)..(1.0 + SIZE_SLACK)).contains(&(side / side_m)) {
        return Err(format!(
            "the mesh is {extent} m large and the volume stands for {side_m} m, build the volume of this mesh"
        ));
    }
    let below = 0.5 * (MARGIN - 1.0) * side;
    let foot = Vec3::new(0.5 * (lo.x + hi.x), lo.y - below, 0.5 * (lo.z + hi.z));
    Ok(standing(voltex, foot, 0.0, 1.0).inverse())
}

/// Returns how wide the leaves of a model count where a volume takes its place, metres: as wide as they are, or as
/// a voxel where that is wider, so that no voxel is larger than a pixel where it takes over alone. The volume's file
/// has two to the power of `finest_level` voxels a side.
pub(crate) fn usual_leaf_width_m(voltex: &Voltex, finest_level: u32, meshes: &[FileMesh]) -> f32 {
    let voxel_m = voltex.side_m() / (1u32 << finest_level) as f32;
    leaf_width(meshes).max(voxel_m)
}
