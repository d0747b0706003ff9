//! How a scene is seen and lit for one picture: what [`SceneView::put_into`] changes without a new upload.

use super::camera::CameraEntry;
use super::check_finite;
use super::light::{AmbientEntry, LightEntry, SunEntry};
use super::source::Source;
use crate::error::ViewerError;
use crate::scene::scene::{Ambient, Scene};
use serde::Deserialize;
use std::path::Path;

/// Camera and lights of one picture, with the keys of a scene file's tables. Unlike there, a scene without lights stays
/// dark.
#[derive(Deserialize, Clone)]
#[serde(deny_unknown_fields)]
pub struct SceneView {
    camera: CameraEntry,
    #[serde(default)]
    lights: Vec<LightEntry>,
    sun: Option<SunEntry>,
    ambient: Option<AmbientEntry>,
    background: Option<[f32; 3]>,
}

impl SceneView {
    /// Gives `scene` this camera and these lights, in place of its own; an environment stays. `path` is for messages.
    ///
    /// # Errors
    /// [`ViewerError::Scene`] for what a scene file may not say, either.
    pub fn put_into(&self, scene: &mut Scene, path: &Path) -> Result<(), ViewerError> {
        let source = Source { path };
        scene.camera = self.camera.camera();
        if let Some(reason) = scene.camera.fault() {
            return Err(source.fault(reason));
        }
        scene.lights = self.lights.iter().map(LightEntry::light).collect();
        (scene.sun, scene.outdoors) = (None, None);
        if let Some(sun) = &self.sun {
            sun.put_into(scene, source)?;
        }
        if let Some(ambient) = &self.ambient {
            ambient.put_into(scene, source)?;
        } else if scene.environment.is_none() {
            scene.ambient = Ambient::NONE;
        }
        scene.background = self.background.unwrap_or(scene.background);
        check_finite(scene, source)
    }
}
