//! What changes while a picture is drawn is uploaded in place: the picture is then that of a scene that was so from the
//! beginning.

use crate::support::{backends, count_differences, gpu};
use btf_models::{LeafDescription, LeafPreset, PlantVariation};
use btf_runtime::testing::sample_grouped_spectrum;
use btf_runtime::{LeafMode, LeafTexel, LeafTexture};
use btf_viewer::testing::plant_factors;
use btf_viewer::{
    Body, Control, Daylight, DaylightParts, FrameRequest, Gpu, GpuTracer, Material, MeshChoice, Outdoors,
    PictureRequest, PictureServer, RenderParams, Scene, SceneAsset, SceneChange, SceneLeaf, SceneMesh, SceneObject,
    ShadeOptions, Shown, Tracer, Updated, plane,
};
use glam::{Mat4, Vec3};
use std::path::Path;
use std::sync::Arc;

const SIZE: [u32; 2] = [48, 32];

fn stand(scene: &mut Scene, time: &str, parts: DaylightParts) {
    let daylight = Daylight::new(&format!("2026-06-21T{time}+02:00"), "52.5,13.4").unwrap();
    let light = daylight.sun_and_sky().unwrap();
    scene.stand_outdoors(Outdoors { daylight, parts }, light);
}

/// Leaves in a row, in the sun of noon.
fn scene() -> Scene {
    let leaf = SceneLeaf::new("leaf", LeafDescription::default(), &LeafTexture::uniform(LeafTexel::default())).unwrap();
    let objects = vec![SceneObject { part: plane(), material: Material::new(Body::Leaf(0), [1.0; 2]) }];
    let places = (0..4).map(|i| Mat4::from_translation(Vec3::X * 2.5 * i as f32)).collect();
    let shown = Shown { assets: Vec::new(), leaves: vec![leaf] };
    let mut scene = Scene::from_meshes(Path::new("row"), vec![SceneMesh { objects, places }], shown).unwrap();
    stand(&mut scene, "13:00", DaylightParts::Sun);
    scene
}

fn picture(tracer: &mut Tracer, scene: &Scene) -> Vec<[f32; 3]> {
    for sample in 0..4 {
        let request = FrameRequest { scene, size: SIZE, options: ShadeOptions::default(), sample };
        tracer.sample(&request, None).unwrap();
    }
    tracer.read_radiance().unwrap()
}

/// A scene that has changed while it is drawn.
struct Live {
    /// The picture of a scene that was so from the beginning.
    expected: Vec<[f32; 3]>,
    /// The picture before the change.
    before: Vec<[f32; 3]>,
    scene: Scene,
    /// The tracer that drew it, and has not heard of the change.
    tracer: Tracer,
    change: SceneChange,
}

/// Changes a scene that is being drawn.
fn live(gpu: &Gpu, scene: impl Fn() -> Scene, change: impl Fn(&mut Scene) -> SceneChange) -> Live {
    let mut changed = scene();
    change(&mut changed);
    let expected = picture(&mut Tracer::new(gpu, &changed, GpuTracer::Bvh).unwrap(), &changed);
    let mut scene = scene();
    let mut tracer = Tracer::new(gpu, &scene, GpuTracer::Bvh).unwrap();
    let before = picture(&mut tracer, &scene);
    let change = change(&mut scene);
    Live { expected, before, scene, tracer, change }
}

#[test]
fn leaf_plants_and_sky_change_in_place() {
    let Some(gpu) = gpu("leaf_plants_and_sky_change_in_place") else { return };
    type Change = fn(&mut Scene) -> SceneChange;
    let changes: [(&str, Change); 3] = [
        ("leaf", |scene| {
            let mut description = scene.leaves[0].description.clone();
            description.contents = LeafPreset::Senescent.contents();
            description.gloss.gamma_along = 0.1;
            let words = scene.leaves[0].describe(description, LeafMode::Rational).unwrap();
            SceneChange::Leaf { leaf: 0, words }
        }),
        ("plants", |scene| {
            let variation = PlantVariation { chlorophyll: 0.8, ..PlantVariation::default() };
            Arc::make_mut(&mut scene.geometry).set_factors(|_, placement| plant_factors(&variation, placement));
            SceneChange::Instances
        }),
        ("sky", |scene| {
            // The sun alone left as much room as a sky takes.
            stand(scene, "19:00", DaylightParts::Both);
            SceneChange::Environment
        }),
    ];
    for (name, change) in changes {
        let Live { expected, before, scene: live, mut tracer, change } = live(&gpu, scene, change);
        assert_eq!(tracer.update(&live, &change).unwrap(), Updated::InPlace);
        assert_eq!(count_differences(&expected, &picture(&mut tracer, &live)), 0, "{name}");
        // Planted: what was not uploaded is not seen.
        assert!(count_differences(&expected, &before) > expected.len() / 20, "{name}");
        let mut stale = Tracer::new(&gpu, &scene(), GpuTracer::Bvh).unwrap();
        assert!(count_differences(&expected, &picture(&mut stale, &live)) > expected.len() / 50, "{name}");
    }
}

#[test]
fn assets_in_bands_are_shown_under_another_light_in_place() {
    let Some(gpu) = gpu("assets_in_bands_are_shown_under_another_light_in_place") else { return };
    let asset = || Arc::new(SceneAsset::new("bands", sample_grouped_spectrum(6, 16, 16)));
    let scene = || Scene::built_in(&MeshChoice::Sphere, vec![asset()], [1.0; 2]).unwrap();
    let change = |scene: &mut Scene| {
        let of_bands = |nm: &[f64]| (0..nm.len()).map(|band| [0.1, 0.02 * band as f32, 0.3]).collect();
        Arc::make_mut(&mut scene.assets[0]).show_bands(of_bands);
        SceneChange::Shown(0)
    };
    let Live { expected, before, scene: live, mut tracer, change } = live(&gpu, scene, change);
    // Planted: what was not uploaded is not seen.
    assert!(count_differences(&before, &picture(&mut tracer, &live)) == 0);
    assert_eq!(tracer.update(&live, &change).unwrap(), Updated::InPlace);
    assert_eq!(count_differences(&expected, &picture(&mut tracer, &live)), 0);
    assert!(count_differences(&expected, &before) > expected.len() / 20);
}

#[test]
fn a_larger_sky_than_there_is_room_for_is_told() {
    let Some(gpu) = gpu("a_larger_sky_than_there_is_room_for_is_told") else { return };
    let mut lit = scene();
    lit.surround(btf_viewer::Environment::new(2, 1, &[1.0; 6]));
    let mut tracer = Tracer::new(&gpu, &lit, GpuTracer::Bvh).unwrap();
    assert_eq!(tracer.update(&lit, &SceneChange::Environment).unwrap(), Updated::InPlace);
    stand(&mut lit, "13:00", DaylightParts::Sky);
    assert_eq!(tracer.update(&lit, &SceneChange::Environment).unwrap(), Updated::NeedsUpload);
}

#[test]
fn pictures_on_demand_are_those_of_a_server_that_drew_nothing_before() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("scene.toml");
    let text = "[[material]]\nname = \"grey\"\ndiffuse = [0.5, 0.4, 0.3]\n[[object]]\nmesh = \"sphere\"\nmaterial = \"grey\"\n";
    std::fs::write(&path, text).unwrap();
    let request = |view: &str| -> PictureRequest {
        let head = format!("\"scene\": {:?}, \"size\": [24, 16], \"frames\": 2", path.display());
        serde_json::from_str(&format!("{{{head}, \"view\": {view}}}")).unwrap()
    };
    let views = [
        r#"{"camera": {"eye": [0, 0, 6], "target": [0, 0, 0]}, "lights": [{"position": [1, 2, 6], "intensity": [30, 30, 30]}]}"#,
        r#"{"camera": {"eye": [3, 1, 4], "target": [0, 0, 0]}, "sun": {"direction": [0, 1, 1], "irradiance": [1, 2, 3]}}"#,
        r#"{"camera": {"eye": [3, 1, 4], "target": [0, 0, 0]}, "background": [0, 0, 0],
            "ambient": {"radiance": [0.2, 0.3, 0.4], "distance": 1e30}}"#,
    ];
    for backend in backends("pictures_on_demand_are_those_of_a_server_that_drew_nothing_before") {
        let shade = ShadeOptions::default();
        let usual = RenderParams { size: [1, 1], backend, shade, ..RenderParams::default() };
        let draw = |server: &mut PictureServer, view: &str| {
            server.draw(&request(view), &Control::SILENT).unwrap().picture.radiance
        };
        let mut server = PictureServer::new(usual.clone(), None);
        let after_others: Vec<_> = views.iter().chain(&views[..1]).map(|view| draw(&mut server, view)).collect();
        let alone: Vec<_> =
            views[1..].iter().map(|view| draw(&mut PictureServer::new(usual.clone(), None), view)).collect();
        assert_eq!(after_others[1..3], alone[..], "{backend:?}");
        assert_eq!(after_others[3], after_others[0], "{backend:?}");
        assert!(after_others[0] != alone[0] && alone[0] != alone[1]);
    }
}
