//! Reads and writes SCENE.toml: meshes, materials, lights and cameras in one file. Paths are relative to that file.
//!
//! `docs/guide/scenes.md` is the reference of all tables and keys. Each file here reads one of these tables.

mod camera;
mod defaults;
mod light;
mod material;
mod mesh_name;
mod object;
mod skin;
mod source;
mod transform;
mod view;
mod volume;
mod volumetric;
mod write;

use crate::error::ViewerError;
use crate::scene::material::Shown;
use crate::scene::scene::{Scene, SceneMesh};
use crate::scene::volume::read_volume;
use crate::volume::skin::Wind;
use camera::Cameras;
use light::{AmbientEntry, DaylightEntry, EnvironmentEntry, LightEntry, SunEntry};
use material::{MaterialEntry, Materials};
use object::{Dresser, ObjectEntry};
use serde::Deserialize;
use skin::SkinEntry;
use source::Source;
use std::path::Path;
use std::sync::Arc;
pub use view::SceneView;
use volume::{VolumeEntry, VolumeFiles, models_of, places_of};
use volumetric::{put_volumes_into, put_wind_into};
pub use write::scene_with_assets;

/// A scene file as TOML has it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneFile {
    #[serde(default)]
    exposure_ev: f32,
    background: Option<[f32; 3]>,
    unit_mm: Option<f32>,
    #[serde(default)]
    camera: Cameras,
    ambient: Option<AmbientEntry>,
    environment: Option<EnvironmentEntry>,
    daylight: Option<DaylightEntry>,
    sun: Option<SunEntry>,
    #[serde(default, rename = "material")]
    materials: Vec<MaterialEntry>,
    #[serde(default, rename = "object")]
    objects: Vec<ObjectEntry>,
    #[serde(default, rename = "volume")]
    volumes: Vec<VolumeEntry>,
    #[serde(default, rename = "skin")]
    skins: Vec<SkinEntry>,
    wind: Option<Wind>,
    #[serde(default, rename = "light")]
    lights: Vec<LightEntry>,
}

/// Reads a scene description and everything that it names. `shown` is what the command line names.
///
/// # Errors
/// [`ViewerError::Scene`] naming the key that is wrong, or the error of a mesh or an asset that it names.
pub fn load_scene(path: &Path, shown: impl Into<Shown>) -> Result<Scene, ViewerError> {
    let source = Source { path };
    scene_of_file(&source.parse()?, source, shown.into())
}

/// Returns the ground that a volume is shown on, `side_m` wide, as a scene file has it.
fn volume_on_ground(name: &str, side_m: f32) -> String {
    let name = toml::Value::from(name);
    let [half, radius] = [1.5 * side_m, 1.7 * side_m];
    let target = 0.4 * side_m;
    format!(
        r#"
        [[material]]
        name = "ground"
        diffuse = [0.16, 0.14, 0.11]
        [[object]]
        mesh = "plane"
        material = "ground"
        rotate_deg = [-90, 0, 0]
        scale = [{half}, {half}, {half}]
        [[volume]]
        file = {name}
        [camera]
        eye = [{radius}, {side_m}, {radius}]
        target = [0, {target}, 0]
        [daylight]
        date_time = "2026-06-21T15:00+02:00"
        place = "52.5,13.4"
        "#
    )
}

/// Makes a scene of a volumetric texture that stands on the ground in a summer's afternoon.
///
/// # Errors
/// Those of [`load_scene`].
pub(crate) fn volume_scene(path: &Path) -> Result<Scene, ViewerError> {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let source = Source { path };
    let text = volume_on_ground(&name, read_volume(path)?.side_m);
    let file = toml::from_str(&text).map_err(|error| source.fault(error.to_string()))?;
    scene_of_file(&file, source, Shown::default())
}

fn scene_of_file(file: &SceneFile, source: Source, mut shown: Shown) -> Result<Scene, ViewerError> {
    let path = source.path;
    if file.objects.is_empty() && file.volumes.iter().all(|entry| entry.mesh.is_none()) {
        return Err(source.fault("it has no [[object]], add one with mesh = \"sphere\""));
    }
    // Load what stands in the scene; the meshes that volumes stand in for come last.
    let materials = Materials::read(&file.materials, source, &mut shown)?;
    let mut dresser = Dresser { source, materials: &materials, unit_mm: file.unit_mm, shown: &mut shown };
    let mut meshes = dresser.objects(&file.objects)?;
    let first_model = meshes.iter().map(|mesh| mesh.places.len()).sum();
    let mut files = VolumeFiles::new(path);
    let mut places = places_of(&file.volumes, &mut files)?;
    let mut leaf_widths = Vec::new();
    for mut model in models_of(&file.volumes, &mut places, &files)? {
        leaf_widths.append(&mut model.leaf_widths);
        meshes.extend(dresser.model(model)?);
    }
    // Put it together.
    let mut scene = scene_of(path, meshes, shown, first_model, &leaf_widths)?;
    put_volumes_into(&mut scene, &places, &file.skins, files, source)?;
    if let Some(wind) = file.wind {
        put_wind_into(&mut scene, wind, &file.skins, source)?;
    }
    file.camera.put_into(&mut scene, source)?;
    file.light(&mut scene, source)?;
    Ok(scene)
}

/// Makes a scene of meshes, of whose instances those from `first_model` on stand in for volumes and have leaves of
/// `leaf_widths`.
fn scene_of(
    path: &Path,
    meshes: Vec<SceneMesh>,
    shown: Shown,
    first_model: usize,
    leaf_widths: &[f32],
) -> Result<Scene, ViewerError> {
    let mut scene = Scene::from_meshes(path, meshes, shown)?;
    if !leaf_widths.is_empty() {
        let width = |number: usize| number.checked_sub(first_model).map_or(0.0, |i| leaf_widths[i]);
        Arc::make_mut(&mut scene.geometry).set_leaf_widths(|_, number| width(number));
    }
    Ok(scene)
}

impl SceneFile {
    /// Gives the scene its lights, background and exposure.
    fn light(&self, scene: &mut Scene, source: Source) -> Result<(), ViewerError> {
        if let Some(environment) = &self.environment {
            environment.put_into(scene, source)?;
        }
        if let Some(daylight) = &self.daylight {
            daylight.put_into(scene, self.unit_mm.map_or(1.0, |unit_mm| unit_mm / 1000.0), source)?;
        }
        if self.sun.is_some() && self.daylight.is_some() {
            return Err(source.fault("it has a [sun] and a [daylight], which has a sun of its own: leave one"));
        }
        if let Some(sun) = &self.sun {
            sun.put_into(scene, source)?;
            scene.lights.clear();
        }
        if !self.lights.is_empty() {
            scene.lights = self.lights.iter().map(LightEntry::light).collect();
        }
        if let Some(ambient) = &self.ambient {
            ambient.put_into(scene, source)?;
        }
        scene.exposure_ev = self.exposure_ev;
        scene.background = self.background.unwrap_or(scene.background);
        check_finite(scene, source)
    }
}

/// Checks that lights, background and exposure are finite.
fn check_finite(scene: &Scene, source: Source) -> Result<(), ViewerError> {
    let numbers = scene.lights.iter().flat_map(|light| light.position.to_array().into_iter().chain(light.intensity));
    if !numbers.chain(scene.background).chain([scene.exposure_ev]).all(f32::is_finite) {
        return Err(source.fault("a light, the background or the exposure has a number that is not finite"));
    }
    Ok(())
}

#[cfg(test)]
mod tests;
