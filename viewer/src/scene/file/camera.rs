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
        let cameras: Vec<Camera> = entries
            .iter()
            .map(|entry| Camera {
                eye: entry.eye.into(),
                target: entry.target.into(),
                up: entry.up.into(),
                fov_deg: entry.fov_deg,
            })
            .collect();
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
