//! Volumetric textures of a scene: read from files, and stood upright in the world.

use crate::error::ViewerError;
use btf_runtime::voltex::{Voltex, Volume};
use glam::{Mat4, Vec3};
use std::path::Path;
use std::sync::Arc;

/// Reads a volumetric texture.
///
/// # Errors
/// [`ViewerError::Read`] and [`ViewerError::Volume`], naming the file.
pub fn load_volume(path: &Path) -> Result<Arc<Voltex>, ViewerError> {
    let bytes = std::fs::read(path).map_err(|source| ViewerError::Read { path: path.into(), source })?;
    let volume = Volume::parse(&bytes).map_err(|source| ViewerError::Volume { path: path.into(), source })?;
    Ok(Arc::new(Voltex::new(&volume)))
}

/// The map from a volume's unit cube, whose z points up, to the world, whose y does: the middle of its floor stands at `foot`,
/// turned `yaw_rad` about the vertical, `scale` times as large as the model that it was made of.
pub fn standing(voltex: &Voltex, foot: Vec3, yaw_rad: f32, scale: f32) -> Mat4 {
    let y_up =
        Mat4::from_cols(Vec3::X.extend(0.0), Vec3::NEG_Z.extend(0.0), Vec3::Y.extend(0.0), Vec3::ZERO.extend(1.0));
    Mat4::from_translation(foot)
        * Mat4::from_rotation_y(yaw_rad)
        * Mat4::from_scale(Vec3::splat(scale * voltex.side_m()))
        * y_up
        * Mat4::from_translation(Vec3::new(-0.5, -0.5, 0.0))
}
