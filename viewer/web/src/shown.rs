//! What the page is asked to show, as its link tells.

use btf_models::{LeafDescription, Species};
use btf_runtime::{LeafTexel, LeafTexture};
use btf_viewer::{
    Daylight, DaylightParts, Landscape, LandscapeParams, MeshChoice, Outdoors, Scene, SceneAsset, SceneLeaf, Shown,
    ViewerError, load_scene,
};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Noon in Berlin on the longest day, for who asks for sun and sky alone.
const NOON: &str = "2026-06-21T13:00+02:00";
const BERLIN: &str = "52.5,13.4";

/// Paths of files that were handed over, and names of what comes with the program. Nothing at all is the built-in material on a
/// sphere.
#[derive(Debug, Default, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct PageScene {
    /// An asset.
    asset: Option<String>,
    /// A leaf under sliders: `maize`, `soybean`, `tree`, `grass`, `spruce`, or the file of one.
    leaf: Option<String>,
    /// The shape that carries it, as `btf-view --mesh` takes it.
    mesh: Option<String>,
    /// How often the material is repeated.
    repeat: Option<f32>,
    /// `lawn`, `grove` or `forest`.
    landscape: Option<String>,
    /// A scene's description.
    scene: Option<String>,
    /// Date and time for sun and sky, or `sun` for a noon in summer.
    daylight: Option<String>,
    /// Latitude and longitude of the day.
    place: Option<String>,
}

impl PageScene {
    /// Reads what a link tells.
    ///
    /// # Errors
    /// [`ViewerError::Usage`] where that is not understood.
    pub(crate) fn read(text: &str) -> Result<PageScene, ViewerError> {
        serde_json::from_str(text).map_err(|error| ViewerError::Usage(format!("the link is not understood: {error}")))
    }

    /// Makes the scene.
    ///
    /// # Errors
    /// The errors of what it is made of.
    pub(crate) fn make(&self) -> Result<Scene, ViewerError> {
        let shown = self.shown()?;
        let mut scene = match (&self.landscape, &self.scene) {
            (Some(name), _) => landscape(name)?,
            (None, Some(path)) => load_scene(Path::new(path), shown)?,
            (None, None) => {
                let usual = if shown.leaves.is_empty() { "sphere" } else { "leaf" };
                let mesh = MeshChoice::from_argument(self.mesh.as_deref().unwrap_or(usual));
                let repeat = self.repeat.filter(|repeat| (0.01..=1000.0).contains(repeat)).unwrap_or(1.0);
                Scene::built_in(&mesh, shown, [repeat; 2])?
            }
        };
        if let Some(date_time) = &self.daylight {
            let date_time = if date_time == "sun" { NOON } else { date_time };
            let daylight = Daylight::new(date_time, self.place.as_deref().unwrap_or(BERLIN))?;
            let light = daylight.sun_and_sky()?;
            scene.stand_outdoors(Outdoors { daylight, parts: DaylightParts::Both }, light);
        }
        Ok(scene)
    }

    fn shown(&self) -> Result<Shown, ViewerError> {
        let mut shown = Shown::default();
        if let Some(path) = &self.asset {
            shown.assets.push(Arc::new(SceneAsset::load(Path::new(path))?));
        }
        if let Some(name) = &self.leaf {
            shown.leaves.push(leaf(name)?);
        }
        // A model's file says by itself what its objects are made of.
        let is_model =
            self.mesh.as_deref().map(MeshChoice::from_argument).is_some_and(|mesh| matches!(mesh, MeshChoice::File(_)));
        if shown.assets.is_empty() && shown.leaves.is_empty() && self.scene.is_none() && !is_model {
            shown.assets.push(Arc::new(SceneAsset::built_in()));
        }
        Ok(shown)
    }
}

fn leaf(name: &str) -> Result<SceneLeaf, ViewerError> {
    match Species::ALL.into_iter().find(|species| species.name() == name) {
        Some(species) => {
            let texture = LeafTexture::uniform(LeafTexel::default());
            SceneLeaf::new(name, LeafDescription::of(Some(species), None), &texture)
        }
        None => SceneLeaf::load(&PathBuf::from(name)),
    }
}

fn landscape(name: &str) -> Result<Scene, ViewerError> {
    let all = [("lawn", Landscape::Lawn), ("grove", Landscape::Grove), ("forest", Landscape::Forest)];
    let Some((_, landscape)) = all.into_iter().find(|(known, _)| *known == name) else {
        return Err(ViewerError::Usage(format!("'{name}' is no landscape: write lawn, grove or forest")));
    };
    // As the page hands them over.
    let volumes: &[&str] = match landscape {
        Landscape::Lawn => &["lawn", "lawn_flower"],
        Landscape::Grove => &["tree"],
        Landscape::Forest => &["forest", "forest_spruce"],
    };
    let volumes = volumes.iter().map(|name| format!("volumes/{name}.voltex").into()).collect();
    let params = LandscapeParams { times: 1, volumes, meshes: Vec::new(), wind_m_per_s: None };
    Ok(landscape.scene(&params)?.0)
}
