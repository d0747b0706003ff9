//! Plants that btf-synth grows are what the viewer draws: their triangles, their leaves, and no more light than falls
//! in.

use btf_models::{DiffuseColour, LeafDescription, Species, TextureImages};
use btf_synth::{CanopySize, Existing, Ground, PlantsParams, write_plants};
use btf_viewer::{
    Ambient, BackendChoice, Body, Camera, Control, MeshChoice, NO_HIT, RenderMode, RenderParams, Scene, ShadeOptions,
    render,
};
use glam::Vec3;
use std::ops::ControlFlow;

/// A maize field of 36 plants whose leaves hold nothing that absorbs.
fn white_field() -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("field.glb");
    let mut leaf = LeafDescription::of(Some(Species::Maize), None);
    leaf.contents = leaf.contents.without_pigments();
    leaf.contents.dry_matter_g_per_cm2 = 0.0;
    leaf.contents.water_cm = 0.0;
    let params = PlantsParams {
        size: CanopySize::Plants(36),
        variants: 3,
        detail: 60,
        ground: Ground::Soil,
        ..PlantsParams::of(Species::Maize)
    };
    let images = TextureImages::default();
    let report =
        write_plants(&path, &params, &leaf, images, Existing::Refuse, &|_, _| ControlFlow::Continue(())).unwrap();
    let scene = Scene::built_in(&MeshChoice::File(path), Vec::new(), [1.0; 2]).unwrap();
    assert_eq!(scene.geometry.placed_triangles(), report.triangles_instanced);
    assert!(scene.geometry.triangles().len() as u64 <= report.triangles_unique);
    assert_eq!(scene.leaves.len(), 1);
    assert_eq!(scene.leaves[0].description.contents, leaf.contents);
    scene
}

/// Mean radiance where the eye, within the field, meets something, and its share of the picture.
fn furnace(mut scene: Scene) -> (f32, f32) {
    scene.lights.clear();
    scene.ambient = Ambient { radiance: [1.0; 3], distance: 1.0 };
    scene.background = [1.0; 3];
    for material in &mut scene.materials {
        if let Body::Plain(colour) = &mut material.body {
            *colour = DiffuseColour::opaque([1.0; 3]);
        }
    }
    scene.camera =
        Camera { eye: Vec3::new(0.1, 0.9, 0.2), target: Vec3::new(1.0, 0.8, -1.0), up: Vec3::Y, fov_deg: 60.0 };
    let shade = ShadeOptions { mode: RenderMode::Path, depth: 128, ..ShadeOptions::default() };
    let params =
        RenderParams { size: [80, 60], frames: 16, backend: BackendChoice::Cpu, shade, ..RenderParams::default() };
    let rendered = render(&scene, &params, &Control::SILENT).unwrap();
    let pixels = rendered.picture.radiance.iter().zip(&rendered.hits);
    let seen: Vec<f32> = pixels.filter(|(_, hit)| hit.primitive != NO_HIT).map(|(rgb, _)| rgb[1]).collect();
    (seen.iter().sum::<f32>() / seen.len() as f32, seen.len() as f32 / rendered.hits.len() as f32)
}

#[test]
fn a_white_canopy_in_a_white_world_is_white() {
    let scene = white_field();
    let (white, share) = furnace(scene.clone());
    println!("white canopy: {white} over {share} of the picture");
    assert!(share > 0.7 && (white - 1.0).abs() < 0.01, "{white} over {share}");
    // Planted difference: leaves of other contents than 0.
    let mut stained = scene;
    let mut leaf = stained.leaves[0].description.clone();
    leaf.contents.brown = 0.02;
    stained.leaves[0].describe(leaf, btf_runtime::LeafMode::default()).unwrap();
    let (grey, _) = furnace(stained);
    assert!(grey < 0.98, "{grey}");
}
