//! The three landscapes of [Neyret 1996, section 5], in metres, under the low sun of a September afternoon: a lawn, a grove and a
//! forest, which are thick skins with volumetric textures over bilinear patches.
//!
//! | landscape | patches | texels | stands for |
//! |---|---|---|---|
//! | lawn | 1,400 | one a patch | 22,400 blades, 700 flowers; height vectors jittered |
//! | grove | 1,024 | half of them empty | 512 trees of 2,154 branches and 6,336 leaves; size, turn, place and material jittered |
//! | forest | 1,404 | 12,500, and 4,348 empty ones | 25,000 trees of so many branches and leaves, two to a texel, broad-leaved ones and spruces by height and slope; turn, coordinates and height jittered |
//!
//! `times` grows the land: so many times more patches, each with what a patch has. The volumes that come with the
//! viewer are made by `cargo xtask volumes`.

/// A volume that comes with the viewer. A page has them in files of their own, to begin sooner.
#[cfg(not(target_arch = "wasm32"))]
macro_rules! built_in {
    ($name:literal) => {
        include_bytes!(concat!("../builtin/", $name, ".voltex"))
    };
}
#[cfg(target_arch = "wasm32")]
macro_rules! built_in {
    ($name:literal) => {
        &[]
    };
}

mod counts;
mod forest;
mod grove;
mod lawn;
mod models;
mod planted;
mod stand_ins;
mod terrain;
mod volumes;

use crate::error::ViewerError;
use crate::light::daylight::Daylight;
use crate::scene::material::Material;
use crate::scene::scene::{DaylightParts, Outdoors, Scene, SceneMesh, SceneObject};
use crate::volume::skin::{ShellLevel, ShellParams, Wind};
use crate::volume::volumes::{SceneSkin, Volumes};
pub use counts::LandscapeCounts;
use glam::Mat4;
use models::{Land, Models, place_models};
use planted::{Flora, Planted, Soil};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use volumes::{LandscapeVolumes, Wanted};

/// How far the texture may lie from where it belongs, voxels: invisible in foliage.
const TOLERANCE_VOXELS: f32 = 3.0;
/// When and where the sun stands unless another day is asked for: a late afternoon of September in Berlin.
const DAY: [&str; 2] = ["2026-09-12T17:20+02:00", "52.52,13.40"];
/// Brightness of the pictures, stops.
const EXPOSURE_EV: f32 = 2.0;

/// Which landscape.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Landscape {
    /// Grass and flowers on a hill.
    Lawn,
    /// Trees that stand apart on flat land.
    Grove,
    /// Mountains under forest.
    Forest,
}

/// Parameters of a landscape.
#[derive(Debug, Clone)]
pub struct LandscapeParams {
    /// Factor on the published counts, 1 to 100, on so much more land.
    pub times: u32,
    /// Files in place of the volumes that come with the viewer; none, or as many as these: two for the lawn (without
    /// and with a flower), one for the grove, two for the forest (broad-leaved trees, spruces) or one for all its trees.
    pub volumes: Vec<PathBuf>,
    /// The models of the plants, which are seen where leaves are wider than pixels; none, or two for the lawn (without
    /// and with a flower), one for the grove, four for the forest (two broad-leaved trees, two spruces). Two for the forest
    /// stand for all its trees and go with one volume: without files that is the one of broad-leaved trees. Their origins
    /// are in the middle of the volumes' floors, as `btf-synth plants` has them.
    pub meshes: Vec<PathBuf>,
    /// Mean speed of the wind that blows over it from the west, m/s, 0 to 60; none for a calm.
    pub wind_m_per_s: Option<f32>,
}

impl Default for LandscapeParams {
    /// Returns the published counts, with the volumes that come with the viewer, in a calm.
    fn default() -> LandscapeParams {
        LandscapeParams { times: 1, volumes: Vec::new(), meshes: Vec::new(), wind_m_per_s: None }
    }
}

impl Landscape {
    /// Returns the name of the landscape as a user writes it.
    pub fn name(self) -> &'static str {
        match self {
            Landscape::Lawn => "lawn",
            Landscape::Grove => "grove",
            Landscape::Forest => "forest",
        }
    }

    /// Returns what the landscape grows of with so many files of volumes and of models, each of which may be none.
    ///
    /// # Errors
    /// [`ViewerError::Usage`] for numbers that it has nothing for.
    fn flora(self, volumes: usize, models: usize) -> Result<&'static Flora, ViewerError> {
        let floras: &[Flora] = match self {
            Landscape::Lawn => &lawn::FLORAS,
            Landscape::Grove => &grove::FLORAS,
            Landscape::Forest => &forest::FLORAS,
        };
        let is_asked_for =
            |flora: &&Flora| [0, flora.built_in.len()].contains(&volumes) && [0, flora.plants.len()].contains(&models);
        floras.iter().find(is_asked_for).ok_or_else(|| {
            let counted = |volumes, models| {
                let ending = |count| if count == 1 { "" } else { "s" };
                format!("{volumes} volume{} and {models} model{}", ending(volumes), ending(models))
            };
            let told = floras.iter().map(|Flora { told, built_in, plants, .. }| {
                format!("{} ({told})", counted(built_in.len(), plants.len()))
            });
            ViewerError::Usage(format!(
                "the {} has {}, and {} are given; write --volume FILE.voltex and --mesh FILE as often, or not at all",
                self.name(),
                told.collect::<Vec<_>>().join(" or "),
                counted(volumes, models)
            ))
        })
    }

    /// Makes the scene with three cameras, far, middle and close, under the sun and the sky; and what is in it.
    ///
    /// # Errors
    /// [`ViewerError::Usage`] for another number of times, of volumes or of models, and for volumes that the landscape cannot use;
    /// [`ViewerError::Read`] and [`ViewerError::Volume`] for their files.
    pub fn scene(self, params: &LandscapeParams) -> Result<(Scene, LandscapeCounts), ViewerError> {
        if !(1..=100).contains(&params.times) {
            return Err(ViewerError::Usage(format!("--times is 1 to 100, not {}", params.times)));
        }
        let flora = self.flora(params.volumes.len(), params.meshes.len())?;
        let wanted = Wanted { name: self.name(), flora, cyclic: self != Landscape::Grove };
        let LandscapeVolumes { volumes, sources, file_bytes, finest_levels } = wanted.load(&params.volumes)?;
        let side_m = volumes[0].side_m();
        let resolution = 1u32 << finest_levels.iter().max().unwrap_or(&0);
        let made = |reason: String| ViewerError::scene(self.name(), reason);
        let planted = match self {
            Landscape::Lawn => lawn::planted(params.times, side_m),
            Landscape::Grove => grove::planted(params.times, side_m),
            Landscape::Forest => forest::planted(params.times, side_m),
        };
        let Planted { terrain, skin, patterns, soil, cameras, wind, counts } = planted.map_err(made)?;
        let shell_params = ShellParams { tolerance: TOLERANCE_VOXELS / resolution as f32, ..ShellParams::default() };
        let levels = ShellLevel::all(&skin, &shell_params).map_err(made)?;
        let shell = &levels[0].shell;
        let counts = LandscapeCounts {
            name: self.name().into(),
            tets: shell.tets().len() as u64,
            volumes: volumes.len() as u64,
            resolution,
            volume_file_bytes: file_bytes,
            volume_bytes: volumes.iter().map(|volume| 4 * volume.words().len() as u64).sum(),
            ..counts
        };
        let Soil { reflectance, noise, unit_m } = soil;
        let material = Material { uv_scale: [1.0 / unit_m; 2], noise: Some(noise), ..Material::plain(reflectance) };
        let ground = SceneObject { part: terrain.ground(reflectance), material };
        let land = Land { volumes: &volumes, finest_levels: &finest_levels, shell, patterns: &patterns };
        let Models { meshes: models, shown, leaf_width, stand_ins } =
            place_models(&params.meshes, flora.plants, &land)?;
        let mut meshes = vec![SceneMesh { objects: vec![ground], places: vec![Mat4::IDENTITY] }];
        meshes.extend(models);
        let mut scene = Scene::from_meshes(Path::new(self.name()), meshes, shown)?;
        if leaf_width > 0.0 {
            let of_mesh = |mesh, _| if mesh == 0 { 0.0 } else { leaf_width };
            Arc::make_mut(&mut scene.geometry).set_leaf_widths(of_mesh);
        }
        let skin = SceneSkin { rest: skin, levels, patterns, leaf_width };
        let mut volumes = Volumes::new(volumes, &[], vec![skin]).map_err(made)?;
        volumes.set_sources(sources);
        // Behind the ground.
        volumes.set_stand_ins(1, stand_ins);
        scene.volumes = Some(Arc::new(volumes));
        if let Some(speed_m_per_s) = params.wind_m_per_s {
            let wind = Wind { speed_m_per_s, ..wind };
            wind.check().map_err(ViewerError::Usage)?;
            scene.wind = Some(wind);
            scene.blow(0.0)?;
        }
        let daylight = Daylight::new(DAY[0], DAY[1])?;
        let light = daylight.sun_and_sky()?;
        scene.air_unit_m = Some(1.0);
        scene.stand_outdoors(Outdoors { daylight, parts: DaylightParts::Both }, light);
        let [far, middle, close] = cameras;
        (scene.camera, scene.more_cameras) = (far, vec![middle, close]);
        scene.exposure_ev = EXPOSURE_EV;
        Ok((scene, counts))
    }
}

#[cfg(test)]
mod tests;
