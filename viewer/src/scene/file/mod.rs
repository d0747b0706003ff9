//! Reads and writes SCENE.toml: meshes, materials, lights and cameras in one file. Paths are relative to that file.
//!
//! ```toml
//! exposure_ev = 0.0                 # optional, as is background = [0.18, 0.18, 0.18]
//! unit_mm = 1000.0                  # optional: millimetres of a unit, for materials of physical size
//!
//! [camera]                          # optional: else everything is framed; several as [[camera]], --camera N takes one
//! eye = [0.0, 1.0, 5.0]
//! target = [0.0, 0.0, 0.0]
//! fov_deg = 30.0
//!
//! [[material]]
//! name = "leaf"
//! asset = "leaf.spmm"               # or a number: the n-th asset of the command line, from 0
//! uv_scale = [2.0, 2.0]
//! displacement = 1.0                # optional: heights of the asset, times this, displace the surface
//! physical = true                   # optional: repeated so often that it has the size that the asset tells
//!
//! [[material]]
//! name = "live"
//! leaf = "leaf.toml"                # a leaf whose optics are evaluated live, see docs/results/leaf-live.md
//!
//! [[material]]
//! name = "grey"
//! diffuse = [0.5, 0.5, 0.5]
//! transmitted = [0.1, 0.2, 0.1]     # optional: what it lets through, diffuse as well
//!
//! [[material]]
//! name = "chrome"
//! mirror = [0.9, 0.9, 0.9]          # a perfect mirror, alone or on top of asset or diffuse
//!
//! [[object]]
//! mesh = "sphere"                   # sphere, plane, cube; cornell; in metres cloth, shoe, boots, pullover; or an .obj,
//!                                   # .gltf or .glb file
//! material = "leaf"                 # optional: else the parts' own colours, and what a glTF file points at
//! parts = { laces = "grey" }        # parts of the file by material name, where they differ
//! translate = [0.0, 1.0, 0.0]       # after rotate_deg (about x, then y, then z) and scale
//!
//! [[volume]]                        # optional: a volumetric texture that stands on its own, see docs/reference/voltex.md
//! file = "tree.voltex"
//! translate = [0.0, 0.0, 0.0]       # where the middle of its floor stands
//! yaw_deg = 0.0                     # optional: about the vertical
//! scale = 1.0                       # optional: 1 is as large as the model that it was made of, units being metres
//! mesh = "tree.glb"                 # optional: the model that it was made of, which is seen where leaves are wider than pixels
//! material = "leaf"                 # optional, as is parts, as with [[object]]: what the volume was made with
//! leaf_size = 0.05                  # optional: how wide leaves are, metres of the model; else as its triangles tell
//!
//! [[skin]]                          # optional: a thick skin of volumetric textures, see docs/results/gallery.md
//! patches = [8, 6]                  # bilinear patches of one unit, on the floor about the origin; or mesh = as of an object
//! height = 0.5                      # length of its height vectors, along the normals
//! lean = [0.2, 0.0, 0.0]            # optional: combs them, by this in heights
//! uv_scale = [1.0, 1.0]             # optional: texels of a patch, or of a unit of a mesh's u and v
//! volumes = ["grass.voltex", ["grass.voltex", "flower.voltex"]]    # by chance one is in each texel, or several, merged
//! tints = [[1.0, 1.0, 1.0], [1.4, 1.1, 0.7]]    # optional: factors on their colours, of which each texel has one by chance
//! jitter = { wavelength = 3.0, coordinates = 0.3, length = 0.3, angle_deg = 20.0, seed = 1 }      # optional, continuous
//! texels = { empty = 0.1, scale = [0.5, 1.0], displacement = 0.5, margin = 0.1, turns = true, mirrors = true, seed = 1 }
//!                                   # optional: how isolated objects differ; without it texels go on into each other
//! translate = [0.0, 0.0, 0.0]       # as rotate_deg and scale, like an object's
//!
//! [wind]                            # optional: blows over all skins, a unit being a metre; what is left out is as here
//! speed = 5.0                       # mean, m/s, 0 to 60
//! direction = [1.0, 0.0, 0.0]       # where it blows to
//! gust_wavelength = 20.0            # from gust to gust, m
//! gustiness = 0.5                   # share by which gusts differ from the mean, 0 to 1
//! leaning_speed = 12.0              # wind in which height vectors lean by 45 degrees, m/s
//! flutter = 0.0                     # largest swing of the texture's top, texels, 0 to 0.5
//! flutter_period = 0.7              # of such a swing, s
//! seed = 0                          # which gusts
//!
//! [ambient]                         # optional: ambient light with occlusion
//! radiance = [0.4, 0.4, 0.4]
//! distance = 2.0                    # optional: what lies farther away does not occlude
//!
//! [environment]                     # optional: light from all around; then no light is placed unasked
//! file = "sky.hdr"                  # equirectangular .exr or .hdr, top row up, middle towards -z
//! gain = 1.0                        # optional
//!
//! [daylight]                        # optional: sun and clear sky; then no light is placed unasked
//! date_time = "2026-06-21T12:00+02:00"
//! place = "52.5,13.4"               # latitude and longitude, degrees, north and east positive
//! turbidity = 3.0                   # optional: of the air, 1 to 10
//! ground_albedo = 0.15              # optional
//! parts = "both"                    # optional: both, sun or sky
//!
//! [[light]]                         # optional: else one light from the upper left
//! position = [-3.0, 4.0, 5.0]
//! intensity = [100.0, 100.0, 100.0]
//! ```

mod camera;
mod defaults;
mod light;
mod material;
mod mesh_name;
mod object;
mod skin;
mod source;
mod transform;
mod volume;
mod volumetric;
mod write;

use crate::error::ViewerError;
use crate::scene::material::Shown;
use crate::scene::scene::{Scene, SceneMesh};
use crate::volume::skin::Wind;
use camera::Cameras;
use light::{AmbientEntry, DaylightEntry, EnvironmentEntry, LightEntry, put_lights_into};
use material::{MaterialEntry, Materials};
use object::{Dresser, ObjectEntry};
use serde::Deserialize;
use skin::SkinEntry;
use source::Source;
use std::path::Path;
use std::sync::Arc;
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
    let file: SceneFile = source.parse()?;
    if file.objects.is_empty() && file.volumes.iter().all(|entry| entry.mesh.is_none()) {
        return Err(source.fault("it has no [[object]], add one with mesh = \"sphere\""));
    }
    // Load what stands in the scene; the meshes that volumes stand in for come last.
    let mut shown = shown.into();
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
            daylight.put_into(scene, source)?;
        }
        put_lights_into(scene, &self.lights);
        if let Some(ambient) = &self.ambient {
            ambient.put_into(scene, source)?;
        }
        scene.exposure_ev = self.exposure_ev;
        scene.background = self.background.unwrap_or(scene.background);
        let numbers =
            scene.lights.iter().flat_map(|light| light.position.to_array().into_iter().chain(light.intensity));
        if !numbers.chain(scene.background).chain([scene.exposure_ev]).all(f32::is_finite) {
            return Err(source.fault("a light, the background or the exposure has a number that is not finite"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
