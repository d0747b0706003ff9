//! `[camera]` and `[[camera]]` of a scene file.

use super::defaults::{default_fov_deg, y_axis};
use super::source::Source;
use crate::error::ViewerError;
use crate::scene::camera::Camera;
use crate::scene::scene::Scene;
use serde::Deserialize;

/// The cameras of a scene file: none, one as `[camera]`, or several as `[[camera]]`.
#[derive(Deserialize)]
#[serde(untagged)]
pub(super) enum Cameras {
    One(CameraEntry),
    Several(Vec<CameraEntry>),
}

impl Default for Cameras {
    fn default() -> Cameras {
        Cameras::Several(Vec::new())
    }
}

#[derive(Deserialize, Clone, Copy)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraEntry {
    eye: [f32; 3],
    target: [f32; 3],
    #[serde(default = "y_axis")]
    up: [f32; 3],
    #[serde(default = "default_fov_deg")]
    fov_deg: f32,
}

impl Cameras {
    /// Gives the scene these cameras, the first one in use, and a light that suits it; without cameras the scene stays
    /// framed as it is.
    ///
    /// # Errors
    /// [`ViewerError::Scene`] for a camera that sees nothing, see [`Camera::fault`].
    pub(super) fn put_into(&self, scene: &mut Scene, source: Source) -> Result<(), ViewerError> {
        let entries = match self {
            Cameras::One(camera) => std::slice::from_ref(camera),
            Cameras::Several(cameras) => cameras,
        };
        let cameras: Vec<Camera> = entries.iter().map(CameraEntry::camera).collect();
        if let Some(reason) = cameras.iter().find_map(Camera::fault) {
            return Err(source.fault(reason));
        }
        if let Some((first, more)) = cameras.split_first() {
            scene.camera = *first;
            scene.more_cameras = more.to_vec();
            scene.place_lights(1);
        }
        Ok(())
    }
}

impl CameraEntry {
    /// Returns the camera, which may have a fault.
    pub(super) fn camera(&self) -> Camera {
        let CameraEntry { eye, target, up, fov_deg } = *self;
        Camera { eye: eye.into(), target: target.into(), up: up.into(), fov_deg }
    }
}
