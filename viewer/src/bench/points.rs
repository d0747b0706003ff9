//! The points of each bench: scenes, and how they are drawn.

use crate::bench::instanced_scene::instanced_scene;
use crate::bench::params::{BenchKind, BenchParams};
use crate::error::ViewerError;
use crate::gpu::frame::FrameRequest;
use crate::light::daylight::Daylight;
use crate::options::{DecoderForm, RenderMode, ShadeOptions, SkyLight};
use crate::scene::asset::SceneAsset;
use crate::scene::landscape::{Landscape, LandscapeParams};
use crate::scene::scene::{Ambient, DaylightParts, MeshChoice, Outdoors, Scene};
use btf_runtime::{Asset, Interpolation, LobeRef};
use glam::Vec3;
use std::sync::Arc;

/// Triangles of the canopy that [Miao] draws at 31 frames a second.
pub(super) const PAPER_TRIANGLES: u64 = 8_605_600;

/// The cameras of landscapes.
pub(super) const CAMERAS: [&str; 3] = ["from afar", "nearer", "from close by"];

/// The built-in meshes that benches show.
const MESHES: [(&str, MeshChoice); 4] = [
    ("cornell", MeshChoice::Cornell),
    ("shoe", MeshChoice::Shoe),
    ("boots", MeshChoice::Boots),
    ("pullover", MeshChoice::Pullover),
];

/// A scene and how it is drawn: what one row of a bench measures.
pub(super) struct Point {
    /// The mesh, as [`BenchRow::mesh`](crate::BenchRow::mesh).
    pub mesh: &'static str,
    /// What was changed, as [`BenchRow::variant`](crate::BenchRow::variant).
    pub variant: &'static str,
    /// The scene.
    pub scene: Scene,
    /// Width and height of the picture, pixels.
    pub size: [u32; 2],
    /// Shading options of the picture.
    pub shade: ShadeOptions,
    /// The decoder in the GPU's tracer.
    pub decoder: DecoderForm,
    /// Whether each frame is the first of its picture, as while the camera moves: volumes are coarser in it than in
    /// later ones.
    pub moves: bool,
}

impl Point {
    /// Returns the request of the first frame.
    pub(super) fn frame(&self) -> FrameRequest<'_> {
        FrameRequest { scene: &self.scene, size: self.size, options: self.shade, sample: 0 }
    }

    /// Returns the number of the sample that a frame adds.
    pub(super) fn sample(&self, frame: usize) -> u32 {
        if self.moves { 0 } else { frame as u32 }
    }
}

/// Makes the points of a bench in a fixed order; their scenes show `assets` in turn.
///
/// # Errors
/// [`ViewerError::Usage`] for a bench of triangles without a model; those of scenes and their files.
pub(super) fn points(assets: &[Arc<SceneAsset>], params: &BenchParams) -> Result<Vec<Point>, ViewerError> {
    let bench = Bench { assets, params };
    match params.kind {
        BenchKind::Lights => bench.lights(),
        BenchKind::Materials => bench.materials(),
        BenchKind::Coverage => bench.coverage(),
        BenchKind::Resolution => bench.resolution(),
        BenchKind::Components => bench.components(),
        BenchKind::Ablations => bench.ablations(),
        BenchKind::Triangles => bench.triangles(),
        BenchKind::Trade => bench.trade(),
        BenchKind::Landscapes => bench.landscapes(),
    }
}

/// Assets and parameters that the points of a bench are made from.
struct Bench<'a> {
    assets: &'a [Arc<SceneAsset>],
    params: &'a BenchParams,
}

impl Bench<'_> {
    /// Makes a point that is drawn as the user asks for.
    fn point(&self, mesh: &'static str, scene: Scene) -> Point {
        Point {
            mesh,
            variant: "",
            scene,
            size: self.params.size,
            shade: self.params.shade,
            decoder: DecoderForm::Halves,
            moves: false,
        }
    }

    /// Returns the residual components of the asset that has most.
    fn most_components(&self) -> u32 {
        self.assets.iter().map(|asset| asset.most_components()).max().unwrap_or(0)
    }

    /// Makes points of 1 to 64 point lights on four meshes.
    fn lights(&self) -> Result<Vec<Point>, ViewerError> {
        let mut points = Vec::new();
        for (name, mesh) in &MESHES {
            let scene = built_in(mesh, self.assets)?;
            for lights in [1, 2, 4, 8, 16, 32, 64] {
                let mut scene = scene.clone();
                scene.place_lights(lights);
                points.push(self.point(name, scene));
            }
        }
        Ok(points)
    }

    /// Makes points of 1 to 32 assets that share the same pixels, on two meshes.
    fn materials(&self) -> Result<Vec<Point>, ViewerError> {
        let mut points = Vec::new();
        for (name, mesh) in &MESHES[..2] {
            for count in [1usize, 2, 4, 8, 16, 32] {
                // Each material has an asset of its own, be it a copy, so that memory is not shared.
                let copies: Vec<_> = (0..count).map(|i| self.assets[i % self.assets.len()].clone()).collect();
                points.push(self.point(name, dealt_out(built_in(mesh, &copies)?, count)));
            }
        }
        Ok(points)
    }

    /// Makes points that show the shoe from farther and farther away, nearest last.
    fn coverage(&self) -> Result<Vec<Point>, ViewerError> {
        let mut points = Vec::new();
        let near = built_in(&MeshChoice::Shoe, self.assets)?;
        for distance in [6.0f32, 4.0, 2.8, 2.0, 1.5, 1.1, 0.8, 0.6, 0.45, 0.3, 0.15] {
            let mut scene = near.clone();
            let camera = &mut scene.camera;
            // Towards a point of the upper, which in the end fills the picture.
            camera.target = camera.target.lerp(Vec3::new(0.03, 0.06, 0.04), (2.0 - distance).clamp(0.0, 1.0));
            camera.eye = camera.target + (near.camera.eye - near.camera.target) * distance;
            points.push(self.point("shoe", scene));
        }
        Ok(points)
    }

    /// Makes points of pictures of 128 x 128 to 3840 x 2160 pixels, of the model where one is given.
    fn resolution(&self) -> Result<Vec<Point>, ViewerError> {
        let mut points = Vec::new();
        let (name, scene, shade) = match &self.params.mesh {
            Some(path) => {
                ("instances", outdoors(instanced_scene(path, PAPER_TRIANGLES)?)?, by_normal(self.params.shade))
            }
            None => ("cornell", built_in(&MeshChoice::Cornell, self.assets)?, self.params.shade),
        };
        for size in [[128, 128], [256, 256], [512, 512], [1024, 1024], [1920, 1080], [3840, 2160]] {
            points.push(Point { size, shade, ..self.point(name, scene.clone()) });
        }
        Ok(points)
    }

    /// Makes points of 100,000 to 100 million triangles: the model placed ever more often, under sun and sky.
    ///
    /// # Errors
    /// [`ViewerError::Usage`] where no model is given; the errors of its file.
    fn triangles(&self) -> Result<Vec<Point>, ViewerError> {
        let mut points = Vec::new();
        let path = self.params.mesh.as_ref().ok_or_else(|| {
            ViewerError::Usage(
                "bench triangles needs a model: make one with `btf-synth plants maize.glb`, then add --mesh maize.glb"
                    .into(),
            )
        })?;
        for triangles in [100_000, 1_000_000, PAPER_TRIANGLES, 30_000_000, 100_000_000] {
            let shade = by_normal(self.params.shade);
            points.push(Point { shade, ..self.point("instances", outdoors(instanced_scene(path, triangles)?)?) });
        }
        Ok(points)
    }

    /// Makes points of 0 residual components to all of them.
    fn components(&self) -> Result<Vec<Point>, ViewerError> {
        let mut points = Vec::new();
        let scene = built_in(&MeshChoice::Cornell, self.assets)?;
        let all = self.most_components();
        for components in [0, 1, 2, 4, 8, 16, 32, 64, 128].into_iter().filter(|n| *n < all).chain([all]) {
            let mut shade = self.params.shade;
            shade.decode.components = components;
            points.push(Point { shade, ..self.point("cornell", scene.clone()) });
        }
        Ok(points)
    }

    /// Makes points of every setting of light, interpolation and components, the most exact light first.
    fn trade(&self) -> Result<Vec<Point>, ViewerError> {
        let mut points = Vec::new();
        let mut scene = built_in(&MeshChoice::Shoe, self.assets)?;
        scene.place_lights(2);
        let open = Ambient { distance: 1e6, ..scene.usual_ambient() };
        let all = self.most_components();
        for (variant, ambient, mode) in [
            ("path tracing", open, RenderMode::Path),
            ("direct and ambient light", open, RenderMode::Direct),
            ("direct light", Ambient::NONE, RenderMode::Direct),
        ] {
            for interpolation in [Interpolation::Fast, Interpolation::Exact] {
                for components in [0, 4, 16, 64].into_iter().filter(|n| *n < all).chain([all]) {
                    let mut shade = ShadeOptions { mode, ..self.params.shade };
                    (shade.decode.components, shade.decode.interpolation) = (components, interpolation);
                    let scene = Scene { ambient, ..scene.clone() };
                    points.push(Point { variant, shade, ..self.point("shoe", scene) });
                }
            }
        }
        Ok(points)
    }

    /// Makes points of lawn, grove and forest, each from afar, nearer and from close by.
    fn landscapes(&self) -> Result<Vec<Point>, ViewerError> {
        let mut points = Vec::new();
        for (variant, name, scene) in landscape_points()? {
            points.push(Point { variant, moves: true, ..self.point(name, scene) });
        }
        Ok(points)
    }

    /// Makes points of the decoder as it is and without its short cuts, one by one, under 1 and 16 lights.
    fn ablations(&self) -> Result<Vec<Point>, ViewerError> {
        let mut points = Vec::new();
        for lights in [1, 16] {
            let with = |assets: &[Arc<SceneAsset>], variant, decoder| -> Result<Point, ViewerError> {
                let mut scene = built_in(&MeshChoice::Cornell, assets)?;
                scene.place_lights(lights);
                Ok(Point { variant, decoder, ..self.point("cornell", scene) })
            };
            let changed = |change: fn(&mut Asset)| -> Result<Vec<Arc<SceneAsset>>, ViewerError> {
                let one = |asset: &Arc<SceneAsset>| {
                    let mut file = asset.file_form()?.asset.clone();
                    change(&mut file);
                    Ok(Arc::new(SceneAsset::new(asset.name.clone(), file)))
                };
                self.assets.iter().map(one).collect()
            };
            points.push(with(self.assets, "as it is", DecoderForm::Halves)?);
            points.push(with(self.assets, "everything for every light", DecoderForm::Whole)?);
            points.push(with(&changed(without_grids)?, "all triangles searched", DecoderForm::Halves)?);
            points.push(with(&changed(with_most_lobes)?, "most lobes in every texel", DecoderForm::Halves)?);
        }
        Ok(points)
    }
}

/// Makes a built-in scene that shows `assets` in turn.
fn built_in(mesh: &MeshChoice, assets: &[Arc<SceneAsset>]) -> Result<Scene, ViewerError> {
    Scene::built_in(mesh, assets.to_vec(), [1.0; 2])
}

/// Returns lawn, grove and forest, each from afar, nearer and from close by: from where, name and scene.
///
/// # Errors
/// The errors of [`Landscape::scene`].
pub(super) fn landscape_points() -> Result<Vec<(&'static str, &'static str, Scene)>, ViewerError> {
    let mut points = Vec::new();
    for landscape in [Landscape::Lawn, Landscape::Grove, Landscape::Forest] {
        let (scene, _) = landscape.scene(&LandscapeParams::default())?;
        for (variant, camera) in CAMERAS.into_iter().zip(scene.cameras()) {
            points.push((variant, landscape.name(), Scene { camera, ..scene.clone() }));
        }
    }
    Ok(points)
}

/// Puts a scene under sun and sky.
pub(super) fn outdoors(mut scene: Scene) -> Result<Scene, ViewerError> {
    let daylight = Daylight::new("2026-06-21T10:00+00:00", "40.0,0.0")?;
    let light = daylight.sun_and_sky()?;
    scene.stand_outdoors(Outdoors { daylight, parts: DaylightParts::Both }, light);
    Ok(scene)
}

/// Lights surfaces by the sky's irradiance of their normal and one ray for what occludes it.
pub(super) fn by_normal(shade: ShadeOptions) -> ShadeOptions {
    ShadeOptions { sky: SkyLight::Irradiance, ..shade }
}

/// Gives the scene's triangles to `count` materials in turn, one asset each: every material is everywhere in the
/// picture.
fn dealt_out(mut scene: Scene, count: usize) -> Scene {
    let old = scene.materials.clone();
    scene.materials = (0..count * old.len())
        .map(|i| crate::Material { body: crate::Body::Asset(i % count), ..old[i / count] })
        .collect();
    let mut turn = 0;
    let triangles = scene.geometry.triangles().to_vec();
    let triangles = triangles
        .into_iter()
        .map(|triangle| {
            turn += 1;
            let material = triangle.material as usize * count + turn % count;
            crate::Triangle { material: material as u32, ..triangle }
        })
        .collect();
    scene.geometry = Arc::new(scene.geometry.with_triangles(triangles));
    scene
}

/// Takes the grids from the directions of an asset, so that decoders search all triangles.
fn without_grids(asset: &mut Asset) {
    for layer in &mut asset.layers {
        (layer.lights, layer.views) = (layer.lights.without_grid(), layer.views.without_grid());
    }
}

/// Fills every texel up to the layer's largest count, with lobes of weight 0.
fn with_most_lobes(asset: &mut Asset) {
    for layer in &mut asset.layers {
        let most = layer.texel_lobe_counts.iter().copied().max().unwrap_or(0);
        let mut refs = Vec::with_capacity(layer.texel_lobe_counts.len() * usize::from(most));
        let mut rest = layer.lobe_refs.as_slice();
        for count in &mut layer.texel_lobe_counts {
            let (own, later) = rest.split_at(usize::from(*count));
            refs.extend_from_slice(own);
            refs.extend((*count..most).map(|_| LobeRef { lobe: 0, weight: [0; 3] }));
            (*count, rest) = (most, later);
        }
        layer.lobe_refs = refs;
    }
}
