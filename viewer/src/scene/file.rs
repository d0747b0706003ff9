//! SCENE.toml: meshes, materials, lights and camera in one file. Paths are relative to that file.
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

use crate::error::ViewerError;
use crate::light::daylight::Daylight;
use crate::light::environment::Environment;
use crate::scene::asset::SceneAsset;
use crate::scene::builtin;
use crate::scene::camera::Camera;
use crate::scene::gltf_asset::own_bodies;
use crate::scene::leaf::SceneLeaf;
use crate::scene::material::{Body, Material, OwnBodies, Shown};
use crate::scene::mesh;
use crate::scene::mesh_file::{FileMesh, load_meshes};
use crate::scene::scene::{Ambient, DaylightParts, Outdoors, PointLight, Scene, SceneMesh, SceneObject};
use crate::scene::skin::SkinEntry;
use crate::scene::volume::{VolumeEntry, VolumeFiles, models_of, places_of};
use crate::volume::skin::Wind;
use crate::volume::volumes::{SceneSkin, Volumes};
use btf_models::DiffuseColour;
use glam::{EulerRot, Mat4, Quat, Vec3};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

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

/// None, `[camera]`, or several `[[camera]]`.
#[derive(Deserialize)]
#[serde(untagged)]
enum Cameras {
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
struct CameraEntry {
    eye: [f32; 3],
    target: [f32; 3],
    #[serde(default = "y_axis")]
    up: [f32; 3],
    #[serde(default = "default_fov_deg")]
    fov_deg: f32,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EnvironmentEntry {
    file: String,
    #[serde(default = "one")]
    gain: f32,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DaylightEntry {
    date_time: String,
    place: String,
    turbidity: Option<f64>,
    ground_albedo: Option<f64>,
    #[serde(default)]
    parts: DaylightParts,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AmbientEntry {
    radiance: [f32; 3],
    distance: Option<f32>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MaterialEntry {
    name: String,
    asset: Option<AssetEntry>,
    leaf: Option<String>,
    diffuse: Option<[f32; 3]>,
    transmitted: Option<[f32; 3]>,
    mirror: Option<[f32; 3]>,
    #[serde(default)]
    physical: bool,
    #[serde(default = "ones2")]
    uv_scale: [f32; 2],
    #[serde(default)]
    displacement: f32,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum AssetEntry {
    Number(usize),
    Path(String),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ObjectEntry {
    mesh: String,
    material: Option<String>,
    #[serde(default)]
    parts: BTreeMap<String, String>,
    #[serde(default)]
    translate: [f32; 3],
    #[serde(default)]
    rotate_deg: [f32; 3],
    #[serde(default = "ones3")]
    scale: [f32; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LightEntry {
    position: [f32; 3],
    intensity: [f32; 3],
}

/// Names that a scene can say instead of a mesh file.
const BUILT_IN_MESHES: [&str; 8] = ["sphere", "plane", "cube", "cornell", "cloth", "shoe", "boots", "pullover"];

fn y_axis() -> [f32; 3] {
    [0.0, 1.0, 0.0]
}

fn default_fov_deg() -> f32 {
    30.0
}

pub(crate) fn one() -> f32 {
    1.0
}

pub(crate) fn ones2() -> [f32; 2] {
    [1.0; 2]
}

pub(crate) fn ones3() -> [f32; 3] {
    [1.0; 3]
}

/// The thick skins.
fn skins_of(entries: &[SkinEntry], folder: &Path, files: &mut VolumeFiles) -> Result<Vec<SceneSkin>, ViewerError> {
    let skin = |entry: &SkinEntry| {
        let meshes = entry.mesh.as_ref().map_or(Ok(Vec::new()), |mesh| meshes_of(mesh, folder))?;
        let world_from_skin = world_from_entry(entry.scale, entry.rotate_deg, entry.translate)
            .ok_or_else(|| files.fault("a [[skin]] is flattened by its scale"))?;
        entry.skin(meshes, world_from_skin, files)
    };
    entries.iter().map(skin).collect()
}

/// The meshes that a name stands for: of a file, or built in.
fn meshes_of(name: &str, folder: &Path) -> Result<Vec<FileMesh>, ViewerError> {
    let built_in = |parts| Ok(vec![FileMesh { parts, places: vec![Mat4::IDENTITY] }]);
    match name {
        // All of these are in BUILT_IN_MESHES.
        "sphere" => built_in(vec![mesh::sphere()]),
        "plane" => built_in(vec![mesh::plane()]),
        "cube" => built_in(vec![mesh::cube("cube")]),
        "cornell" => built_in(builtin::cornell()),
        "cloth" => built_in(builtin::cloth()),
        "shoe" => built_in(builtin::shoe()),
        "boots" => built_in(builtin::boots()),
        "pullover" => built_in(builtin::pullover()),
        file => load_meshes(&folder.join(file)),
    }
}

/// The map of an entry that is scaled, turned and moved; none if that cannot be undone.
fn world_from_entry(scale: [f32; 3], rotate_deg: [f32; 3], translate: [f32; 3]) -> Option<Mat4> {
    let [x, y, z] = rotate_deg.map(f32::to_radians);
    // glam applies the last letter's angle first.
    let rotation = Quat::from_euler(EulerRot::ZYX, z, y, x);
    let matrix = Mat4::from_scale_rotation_translation(scale.into(), rotation, translate.into());
    (matrix.is_finite() && matrix.determinant().abs() > 1e-30).then_some(matrix)
}

/// Reads a scene description and everything that it names. `shown` is what the command line names.
///
/// # Errors
/// [`ViewerError::Scene`] naming the key that is wrong, or the error of a mesh or an asset that it names.
pub fn load_scene(path: &Path, shown: impl Into<Shown>) -> Result<Scene, ViewerError> {
    let mut shown = shown.into();
    let fault = |reason: String| ViewerError::scene(path, reason);
    let text = std::fs::read_to_string(path).map_err(|source| ViewerError::Read { path: path.into(), source })?;
    let file: SceneFile = toml::from_str(&text).map_err(|error| {
        let line = error.span().map_or(1, |span| text[..span.start].matches('\n').count() + 1);
        fault(format!("line {line}: {}", error.message().replace('\n', " ")))
    })?;
    if file.objects.is_empty() && file.volumes.iter().all(|entry| entry.mesh.is_none()) {
        return Err(fault("it has no [[object]], add one with mesh = \"sphere\"".into()));
    }
    let folder = path.parent().unwrap_or(Path::new("."));
    let named = shown.assets.len();

    let mut materials = BTreeMap::new();
    for entry in &file.materials {
        let of_asset = match &entry.asset {
            None => None,
            Some(AssetEntry::Number(number)) if *number < named => Some(*number),
            Some(AssetEntry::Number(number)) => {
                return Err(fault(format!(
                    "material '{}' names asset {number}, but the command line has {named}",
                    entry.name
                )));
            }
            Some(AssetEntry::Path(file)) => {
                let file = folder.join(file);
                let known = shown.assets.iter().position(|asset| asset.path.as_ref() == Some(&file));
                Some(match known {
                    Some(known) => known,
                    None => {
                        shown.assets.push(Arc::new(SceneAsset::load(&file)?));
                        shown.assets.len() - 1
                    }
                })
            }
        };
        let kinds = [of_asset.is_some(), entry.leaf.is_some(), entry.diffuse.is_some()];
        match kinds.into_iter().filter(|is_there| *is_there).count() {
            0 if entry.mirror.is_none() => {
                return Err(fault(format!("material '{}' needs asset, leaf, diffuse or mirror", entry.name)));
            }
            0 | 1 => {}
            _ => {
                return Err(fault(format!(
                    "material '{}' has more than one of asset, leaf and diffuse, leave one",
                    entry.name
                )));
            }
        }
        let mirror = entry.mirror.unwrap_or([0.0; 3]);
        if !mirror.iter().all(|x| (0.0..=1.0).contains(x)) {
            return Err(fault(format!("material '{}' has a mirror that is not 0 to 1", entry.name)));
        }
        let body = match (of_asset, &entry.leaf) {
            (Some(asset), _) => Body::Asset(asset),
            (None, Some(file)) => {
                shown.leaves.push(SceneLeaf::load(&folder.join(file))?);
                Body::Leaf(shown.leaves.len() - 1)
            }
            // What is a mirror and nothing else shows nothing below it.
            (None, None) => Body::Plain(DiffuseColour {
                reflectance: entry.diffuse.unwrap_or([0.0; 3]),
                transmittance: entry.transmitted.unwrap_or([0.0; 3]),
            }),
        };
        if let (Some(passed), diffuse) = (entry.transmitted, entry.diffuse) {
            let fits = |(passed, diffuse): (f32, f32)| (0.0..=1.0).contains(&passed) && passed + diffuse <= 1.0;
            if !diffuse.is_some_and(|diffuse| passed.into_iter().zip(diffuse).all(fits)) {
                return Err(fault(format!(
                    "material '{}' has transmitted, which needs diffuse beside it and is 0 to 1 together with that",
                    entry.name
                )));
            }
        }
        let material = Material { mirror, displacement: entry.displacement, ..Material::new(body, entry.uv_scale) };
        if !(material.displacement.is_finite() && material.displacement >= 0.0) {
            return Err(fault(format!("material '{}' needs a displacement of at least 0", entry.name)));
        }
        if material.displacement > 0.0 && !material.uv_scale.iter().all(|scale| *scale > 0.0) {
            return Err(fault(format!(
                "material '{}' has a displacement, so its uv_scale must be above 0",
                entry.name
            )));
        }
        if !entry.diffuse.iter().flatten().chain(&material.uv_scale).all(|x| x.is_finite()) {
            return Err(fault(format!("material '{}' has a number that is not finite", entry.name)));
        }
        if materials.insert(entry.name.as_str(), material).is_some() {
            return Err(fault(format!("material '{}' is there twice", entry.name)));
        }
    }
    let find = |name: &str| {
        materials.get(name).copied().ok_or_else(|| fault(format!("there is no [[material]] with name = \"{name}\"")))
    };

    let physical: Vec<&str> =
        file.materials.iter().filter(|entry| entry.physical).map(|entry| entry.name.as_str()).collect();
    // What meshes of a file are made of; those that stand in several places have the size of the first.
    let mut dressed = |name: &str,
                       own_meshes: Vec<FileMesh>,
                       material: Option<&String>,
                       materials_of_parts: &BTreeMap<String, String>|
     -> Result<Vec<SceneMesh>, ViewerError> {
        let parts = || own_meshes.iter().flat_map(|mesh| &mesh.parts);
        if let Some(missing) = materials_of_parts.keys().find(|name| parts().all(|part| part.name != **name)) {
            return Err(fault(format!("object '{name}' has no part called '{missing}'")));
        }
        let own = match BUILT_IN_MESHES.contains(&name) || material.is_some() {
            true => OwnBodies::default(),
            false => own_bodies(&folder.join(name))?,
        };
        let bodies = shown.append(own);
        let mut meshes = Vec::new();
        for FileMesh { parts, places } in own_meshes {
            let mut objects = Vec::new();
            for mut part in parts {
                let name = materials_of_parts.get(&part.name).or(material);
                let material = match name {
                    Some(name) => find(name)?,
                    None => Material::of_part(&part, bodies.get(&part.group).copied(), [1.0; 2]),
                };
                let is_physical = name.is_some_and(|name| physical.contains(&name.as_str()));
                if is_physical && !matches!(material.body, Body::Plain(_)) {
                    let unit_mm = file.unit_mm.filter(|unit| unit.is_finite() && *unit > 0.0).ok_or_else(|| {
                        fault("a material is physical, but unit_mm does not tell the size of a unit".into())
                    })?;
                    let size = places[0].determinant().abs().cbrt();
                    let tile_mm = part.tile_length().unwrap_or(1.0) * size * unit_mm;
                    part.scale_uv(shown.tiles_per_mm(material.body).map(|tiles| tiles * tile_mm));
                }
                objects.push(SceneObject { part, material });
            }
            meshes.push(SceneMesh { objects, places });
        }
        Ok(meshes)
    };
    // What stands once, in the world, and what stands more often.
    let (mut objects, mut meshes) = (Vec::new(), Vec::new());
    for entry in &file.objects {
        let mut own_meshes = meshes_of(&entry.mesh, folder)?;
        let matrix = world_from_entry(entry.scale, entry.rotate_deg, entry.translate)
            .ok_or_else(|| fault(format!("object '{}' is flattened by its scale", entry.mesh)))?;
        own_meshes.iter_mut().for_each(|mesh| mesh.moved(matrix));
        for mesh in dressed(&entry.mesh, own_meshes, entry.material.as_ref(), &entry.parts)? {
            match mesh.places.len() {
                1 => objects.extend(mesh.objects),
                _ => meshes.push(mesh),
            }
        }
    }

    if !objects.is_empty() {
        meshes.insert(0, SceneMesh { objects, places: vec![Mat4::IDENTITY] });
    }
    // The meshes that volumes stand in for come last.
    let mut files = VolumeFiles::new(path);
    let mut volume_places = places_of(&file.volumes, &mut files)?;
    let kept: usize = meshes.iter().map(|mesh| mesh.places.len()).sum();
    let mut leaf_widths = Vec::new();
    for model in models_of(&file.volumes, &mut volume_places, &files)? {
        leaf_widths.extend(model.leaf_widths);
        meshes.extend(dressed(model.file, model.meshes, model.material, model.parts)?);
    }
    let mut scene = Scene::from_meshes(path, meshes, shown)?;
    if !leaf_widths.is_empty() {
        let width = |number: usize| number.checked_sub(kept).map_or(0.0, |i| leaf_widths[i]);
        Arc::make_mut(&mut scene.geometry).set_leaf_widths(|_, number| width(number));
    }
    let skins = skins_of(&file.skins, folder, &mut files)?;
    if !(volume_places.is_empty() && skins.is_empty()) {
        scene.volumes = Some(Arc::new(Volumes::new(files.volumes, &volume_places, skins).map_err(fault)?));
    }
    if let Some(wind) = file.wind {
        wind.check().map_err(|reason| fault(format!("[wind]: {reason}")))?;
        if file.skins.is_empty() {
            return Err(fault("[wind] blows over skins and there is none, add a [[skin]]".into()));
        }
        scene.wind = Some(wind);
        scene.blow(0.0)?;
    }
    let cameras = match &file.camera {
        Cameras::One(camera) => std::slice::from_ref(camera),
        Cameras::Several(cameras) => cameras,
    };
    let cameras: Vec<Camera> = cameras
        .iter()
        .map(|entry| Camera {
            eye: entry.eye.into(),
            target: entry.target.into(),
            up: entry.up.into(),
            fov_deg: entry.fov_deg,
        })
        .collect();
    if let Some(reason) = cameras.iter().find_map(Camera::fault) {
        return Err(fault(reason.into()));
    }
    if let Some((first, more)) = cameras.split_first() {
        scene.camera = *first;
        scene.more_cameras = more.to_vec();
        scene.place_lights(1);
    }
    if let Some(EnvironmentEntry { file, gain }) = file.environment {
        if !(gain.is_finite() && gain > 0.0) {
            return Err(fault("[environment] needs a gain above 0".into()));
        }
        scene.surround(Environment::load(&folder.join(file), gain)?);
    }
    if let Some(entry) = &file.daylight {
        let mut daylight = Daylight::new(&entry.date_time, &entry.place).map_err(|error| fault(error.to_string()))?;
        daylight.turbidity = entry.turbidity.unwrap_or(daylight.turbidity);
        daylight.ground_albedo = entry.ground_albedo.unwrap_or(daylight.ground_albedo);
        let light = daylight.sun_and_sky().map_err(|error| fault(error.to_string()))?;
        scene.stand_outdoors(Outdoors { daylight, parts: entry.parts }, light);
    }
    if !file.lights.is_empty() {
        scene.lights = file
            .lights
            .iter()
            .map(|light| PointLight { position: Vec3::from(light.position), intensity: light.intensity })
            .collect();
    }
    if let Some(AmbientEntry { radiance, distance }) = file.ambient {
        let distance = distance.unwrap_or(scene.usual_ambient().distance);
        if !(radiance.iter().all(|x| x.is_finite() && *x >= 0.0) && distance.is_finite() && distance > 0.0) {
            return Err(fault("[ambient] needs a radiance of at least 0 and a distance above 0".into()));
        }
        scene.ambient = Ambient { radiance, distance };
    }
    scene.exposure_ev = file.exposure_ev;
    scene.background = file.background.unwrap_or(scene.background);
    let numbers = scene.lights.iter().flat_map(|light| light.position.to_array().into_iter().chain(light.intensity));
    if !numbers.chain(scene.background).chain([scene.exposure_ev]).all(f32::is_finite) {
        return Err(fault("a light, the background or the exposure has a number that is not finite".into()));
    }
    Ok(scene)
}

/// The text of the scene description at `path` with other asset files: `files[i]` in place of `assets[i]`, those that
/// [`load_scene`] made of it. Meant for a file in `folder`: other paths are written so that they are found from there.
///
/// # Errors
/// [`ViewerError::Read`], [`ViewerError::Scene`].
pub fn scene_with_assets(
    path: &Path,
    assets: &[Arc<SceneAsset>],
    files: &[String],
    folder: &Path,
) -> Result<String, ViewerError> {
    let read = |source| ViewerError::Read { path: path.into(), source };
    let fault = |error: &dyn std::fmt::Display| ViewerError::scene(path, error.to_string().replace('\n', " "));
    let text = std::fs::read_to_string(path).map_err(read)?;
    let mut table: toml::Table = text.parse().map_err(|error: toml::de::Error| fault(&error))?;
    let from = path.parent().unwrap_or(Path::new("."));
    let list = |value: Option<&mut toml::Value>| value.and_then(toml::Value::as_array_mut).map(std::mem::take);
    let moved = |value: &mut toml::Value| {
        let name = value.as_str().unwrap_or_default();
        if !BUILT_IN_MESHES.contains(&name) {
            *value = relative(folder, &from.join(name)).into();
        }
    };
    let mut materials = list(table.get_mut("material")).unwrap_or_default();
    materials.iter_mut().filter_map(|material| material.get_mut("leaf")).for_each(moved);
    for asset in materials.iter_mut().filter_map(|material| material.get_mut("asset")) {
        let number = match &*asset {
            toml::Value::Integer(number) => usize::try_from(*number).ok(),
            value => assets.iter().position(|known| {
                known.path.as_deref() == Some(from.join(value.as_str().unwrap_or_default()).as_path())
            }),
        };
        if let Some(file) = number.and_then(|number| files.get(number)) {
            *asset = file.as_str().into();
        }
    }
    let mut objects = list(table.get_mut("object")).unwrap_or_default();
    objects.iter_mut().filter_map(|object| object.get_mut("mesh")).for_each(moved);
    let mut volumes = list(table.get_mut("volume")).unwrap_or_default();
    for key in ["file", "mesh"] {
        volumes.iter_mut().filter_map(|volume| volume.get_mut(key)).for_each(moved);
    }
    let mut skins = list(table.get_mut("skin")).unwrap_or_default();
    skins.iter_mut().filter_map(|skin| skin.get_mut("mesh")).for_each(moved);
    let of_skins = skins.iter_mut().filter_map(|skin| skin.get_mut("volumes")?.as_array_mut()).flatten();
    for alternative in of_skins {
        match alternative {
            toml::Value::Array(merged) => merged.iter_mut().for_each(moved),
            one => moved(one),
        }
    }
    for (name, entries) in [("material", materials), ("object", objects), ("volume", volumes), ("skin", skins)] {
        table.insert(name.into(), entries.into());
    }
    table.get_mut("environment").and_then(|sky| sky.get_mut("file")).into_iter().for_each(moved);
    toml::to_string(&table).map_err(|error| fault(&error))
}

/// `file` as seen from `folder`, where both exist; else as it is.
fn relative(folder: &Path, file: &Path) -> String {
    let (Ok(folder), Ok(file)) = (folder.canonicalize(), file.canonicalize()) else {
        return file.to_string_lossy().into_owned();
    };
    if folder.components().next() != file.components().next() {
        return file.to_string_lossy().into_owned();
    }
    let common = folder.components().zip(file.components()).take_while(|(a, b)| a == b).count();
    let up = folder.components().skip(common).map(|_| "..".to_string());
    let down = file.components().skip(common).map(|part| part.as_os_str().to_string_lossy().into_owned());
    up.chain(down).collect::<Vec<_>>().join("/")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::volume::tests::folder_with_volume;

    fn load(text: &str) -> Result<Scene, ViewerError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("scene.toml");
        std::fs::write(&path, text).unwrap();
        load_scene(&path, Vec::new())
    }

    const GREY: &str = "[[material]]\nname = \"grey\"\ndiffuse = [0.5, 0.5, 0.5]\n";

    #[test]
    fn a_physical_material_has_its_size_on_any_mesh() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("scene.toml");
        let asset = btf_runtime::testing::sample_asset(1, 4, 2, btf_runtime::ResidualKind::Root);
        let mut asset = SceneAsset::new("sample", asset);
        asset.size_mm = Some([20.0, 10.0]);
        let assets = vec![Arc::new(asset)];
        let text = |unit: &str| {
            format!(
                "{unit}[[material]]\nname = \"m\"\nasset = 0\nphysical = true\n\
                 [[object]]\nmesh = \"plane\"\nmaterial = \"m\"\nscale = [3, 3, 3]\n"
            )
        };
        std::fs::write(&path, text("unit_mm = 10\n")).unwrap();
        let scene = load_scene(&path, assets.clone()).unwrap();
        // A plane of 60 x 60 mm.
        let vertices = scene.geometry.vertices();
        let most = |of: fn(&crate::Vertex) -> f32| vertices.iter().map(of).fold(0f32, f32::max);
        assert!((most(|v| v.u) - 3.0).abs() < 1e-5 && (most(|v| v.v) - 6.0).abs() < 1e-5);
        std::fs::write(&path, text("")).unwrap();
        assert!(load_scene(&path, assets).unwrap_err().to_string().contains("unit_mm"));
    }

    #[test]
    fn reads_objects_lights_and_camera() {
        let scene = load(&format!(
            "exposure_ev = 1.0\n[camera]\neye = [0, 0, 9]\ntarget = [0, 0, 0]\n{GREY}\
             [[object]]\nmesh = \"plane\"\nmaterial = \"grey\"\ntranslate = [0, 2, 0]\nrotate_deg = [0, 90, 0]\n\
             [[light]]\nposition = [1, 2, 3]\nintensity = [4, 5, 6]\n"
        ))
        .unwrap();
        assert_eq!((scene.lights.len(), scene.exposure_ev, scene.camera.eye.z), (1, 1.0, 9.0));
        // Turned by 90 degrees about y, +z becomes +x.
        assert!(scene.geometry.vertices()[0].normal[0] > 0.999);
        assert!((scene.geometry.bounding_sphere().0.y - 2.0).abs() < 1e-6);
    }

    #[test]
    fn a_wind_moves_skins_with_time_and_is_checked() {
        let dir = folder_with_volume();
        let path = dir.path().join("s.toml");
        let skin = "[[object]]\nmesh = \"plane\"\n[[skin]]\npatches = [4, 3]\nheight = 0.5\nvolumes = [\"v.voltex\"]\n";
        let loaded = |text: &str| {
            std::fs::write(&path, text).unwrap();
            load_scene(&path, Vec::new())
        };
        let mut scene =
            loaded(&format!("{skin}[wind]\nspeed = 8.0\ndirection = [0, 0, 1]\ngust_wavelength = 3\n")).unwrap();
        let wind = scene.wind.unwrap();
        assert_eq!((wind.speed_m_per_s, wind.direction, wind.gust_wavelength_m), (8.0, Vec3::Z, 3.0));
        assert_eq!(wind.leaning_speed_m_per_s, Wind::default().leaning_speed_m_per_s);
        let south = |scene: &Scene| {
            scene.volumes.as_ref().unwrap().skins()[0].shell.positions().iter().map(|at| at.z).sum::<f32>()
        };
        let at_rest = south(&loaded(skin).unwrap());
        let first = south(&scene);
        scene.blow(0.2).unwrap();
        assert!(first > at_rest + 1.0 && south(&scene) != first);
        scene.blow(0.0).unwrap();
        assert_eq!(south(&scene), first);
        for (bad, reason) in [
            (format!("{skin}[wind]\nspeed = 80\n"), "the wind's speed is 80"),
            (format!("{skin}[wind]\ndirection = [0, 0, 0]\n"), "must blow somewhere"),
            (format!("{skin}[wind]\nlean = 3\n"), "unknown field `lean`"),
            ("[[object]]\nmesh = \"plane\"\n[wind]\n".to_string(), "add a [[skin]]"),
        ] {
            let message = loaded(&bad).unwrap_err().to_string();
            assert!(message.contains(reason) && message.contains("s.toml: ") && !message.contains('\n'), "{message}");
        }
        // Written for another folder, the skin finds its volume.
        let merged = skin.replace("[\"v.voltex\"]", "[[\"v.voltex\", \"v.voltex\"], \"v.voltex\"]");
        loaded(&merged).unwrap();
        let out = dir.path().join("out");
        std::fs::create_dir(&out).unwrap();
        std::fs::write(out.join("s.toml"), scene_with_assets(&path, &[], &[], &out).unwrap()).unwrap();
        assert!(load_scene(&out.join("s.toml"), Vec::new()).is_ok());
    }

    #[test]
    fn tints_of_a_skin_are_alternatives_with_other_colours() {
        let dir = folder_with_volume();
        let path = dir.path().join("s.toml");
        let loaded = |tints: &str| {
            let skin = format!(
                "patches = [4, 3]\nheight = 0.5\nvolumes = [\"v.voltex\", [\"v.voltex\", \"w.voltex\"]]\n{tints}"
            );
            std::fs::copy(dir.path().join("v.voltex"), dir.path().join("w.voltex")).unwrap();
            std::fs::write(&path, format!("[[object]]\nmesh = \"plane\"\n[[skin]]\n{skin}")).unwrap();
            load_scene(&path, Vec::new())
        };
        let volumes = |tints| loaded(tints).unwrap().volumes.unwrap();
        let [plain, tinted] = ["", "tints = [[1, 1, 1], [0.5, 0.25, 0]]\n"].map(volumes);
        assert_eq!([plain.volume_count(), tinted.volume_count()], [2, 4]);
        let numbers = |volumes: &Volumes| {
            volumes.skins()[0].patterns[0].alternatives.iter().map(|merged| [merged[0], merged[1]]).collect::<Vec<_>>()
        };
        let none = crate::volume::skin::NO_VOLUME;
        assert_eq!(numbers(&plain), [[0, none], [0, 1]]);
        assert_eq!(numbers(&tinted), [[0, none], [1, none], [0, 2], [1, 3]]);
        let [own, other] = [0, 1].map(|number| tinted.volume(number).material(0));
        for (channel, factor) in [0.5, 0.25, 0.0].into_iter().enumerate() {
            assert!((other.reflectance[channel] - factor * own.reflectance[channel]).abs() < 1e-3);
            assert!((other.transmittance[channel] - factor * own.transmittance[channel]).abs() < 1e-3);
        }
        assert_eq!(own, plain.volume(0).material(0));
        for bad in ["tints = []\n", "tints = [[1, -1, 1]]\n", "tints = [[1, nan, 1]]\n"] {
            let message = loaded(bad).unwrap_err().to_string();
            assert!(message.contains("tints are factors") && message.contains("s.toml"), "{message}");
        }
    }

    #[test]
    fn wrong_scenes_are_refused_with_a_sentence_that_names_the_file() {
        let object = "[[object]]\nmesh = \"plane\"\n";
        let bad = [
            String::new(),
            "camera = 3".into(),
            format!("{object}colour = 1\n"),
            format!("{object}material = \"leaf\"\n"),
            format!("{GREY}{GREY}{object}"),
            format!("[[material]]\nname = \"a\"\n{object}"),
            format!("[[material]]\nname = \"a\"\nasset = 0\n{object}"),
            format!("{GREY}transmitted = [0.6, 0.2, 0.2]\n{object}"),
            format!("[[material]]\nname = \"a\"\nmirror = [1, 1, 1]\ntransmitted = [0.1, 0.1, 0.1]\n{object}"),
            format!("{object}scale = [1, 0, 1]\n"),
            format!("{object}parts = {{ lace = \"grey\" }}\n"),
            format!("{object}[camera]\neye = [0, 0, 0]\ntarget = [0, 0, 0]\n"),
            format!("{object}[[light]]\nposition = [nan, 0, 0]\nintensity = [1, 1, 1]\n"),
        ];
        for text in bad {
            let message = load(&text).unwrap_err().to_string();
            assert!(message.contains("scene.toml: ") && !message.contains('\n'), "{message}");
        }
    }

    #[test]
    fn a_scene_is_written_again_with_other_assets_from_another_folder() {
        let dir = tempfile::tempdir().unwrap();
        let text = "[[camera]]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\n[[camera]]\neye = [0, 5, 5]\ntarget = [0, 0, 0]\n\
                    [[material]]\nname = \"a\"\nasset = \"a.spmm\"\n[[material]]\nname = \"b\"\nasset = 0\n\
                    [[object]]\nmesh = \"sphere\"\nmaterial = \"a\"\n[[object]]\nmesh = \"m.obj\"\nmaterial = \"b\"\n";
        let path = dir.path().join("s.toml");
        std::fs::write(&path, text).unwrap();
        std::fs::write(dir.path().join("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
            .unwrap();
        std::fs::write(dir.path().join("a.spmm"), include_bytes!("builtin/weave.spmm")).unwrap();
        let scene = load_scene(&path, vec![Arc::new(SceneAsset::built_in())]).unwrap();
        assert_eq!((scene.assets.len(), scene.more_cameras.len()), (2, 1));
        let out = dir.path().join("out");
        std::fs::create_dir(&out).unwrap();
        let files = ["x.spmm", "y.spmm"].map(String::from);
        for file in &files {
            std::fs::copy(dir.path().join("a.spmm"), out.join(file)).unwrap();
        }
        let again = scene_with_assets(&path, &scene.assets, &files, &out).unwrap();
        assert!(again.contains("asset = \"y.spmm\"") && again.contains("asset = \"x.spmm\""), "{again}");
        std::fs::write(out.join("scene.toml"), again).unwrap();
        let loaded = load_scene(&out.join("scene.toml"), Vec::new()).unwrap();
        assert_eq!(loaded.geometry.triangles().len(), scene.geometry.triangles().len());
        assert_eq!((loaded.assets.len(), loaded.camera), (2, scene.camera));
    }
}
