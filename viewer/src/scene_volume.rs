//! Volumetric textures of a scene: read from files, and stood upright in the world.

use crate::error::ViewerError;
use btf_runtime::voltex::{Voltex, Volume};
use glam::{Mat4, Vec3};
use std::path::{Path, PathBuf};
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

/// The volumes that a scene's file names, each read once.
pub(crate) struct VolumeFiles {
    scene: PathBuf,
    names: Vec<String>,
    /// In the order in which they were first named.
    pub volumes: Vec<Arc<Voltex>>,
}

impl VolumeFiles {
    /// None yet, of a scene's file.
    pub(crate) fn new(scene: &Path) -> VolumeFiles {
        VolumeFiles { scene: scene.into(), names: Vec::new(), volumes: Vec::new() }
    }

    /// Number of the volume with this name, relative to the scene's file.
    ///
    /// # Errors
    /// As [`load_volume`].
    pub(crate) fn number(&mut self, name: &str) -> Result<usize, ViewerError> {
        if let Some(known) = self.names.iter().position(|known| known == name) {
            return Ok(known);
        }
        self.volumes.push(load_volume(&self.scene.parent().unwrap_or(Path::new(".")).join(name))?);
        self.names.push(name.into());
        Ok(self.volumes.len() - 1)
    }

    /// An error of the scene's file.
    pub(crate) fn fault(&self, reason: impl Into<String>) -> ViewerError {
        ViewerError::scene(&self.scene, reason)
    }
}

/// The map from a volume's unit cube, whose z points up, to the world, whose y does: the middle of its floor stands at `foot`,
/// turned `yaw_rad` about the vertical, `scale` times as large as the model that it was made of.
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
