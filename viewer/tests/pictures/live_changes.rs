//! What changes while a picture is drawn is uploaded in place: the picture is then that of a scene that was so from the
//! beginning.

use crate::support::{count_differences, gpu};
use btf_models::{LeafDescription, LeafPreset, PlantVariation};
use btf_runtime::{LeafMode, LeafTexel, LeafTexture};
use btf_viewer::{
    Body, Daylight, DaylightParts, Gpu, GpuTracer, Material, Outdoors, Scene, SceneLeaf, SceneMesh, SceneObject,
    ShadeOptions, Shown, Tracer, plane, plant_factors,
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

fn picture(gpu: &Gpu, tracer: &mut Tracer, scene: &Scene) -> Vec<[f32; 3]> {
    for sample in 0..4 {
        tracer.sample(gpu, scene, SIZE, &ShadeOptions::default(), sample, None).unwrap();
    }
    tracer.read_radiance(gpu).unwrap()
}

#[test]
fn leaf_plants_and_sky_change_in_place() {
    let Some(gpu) = gpu("leaf_plants_and_sky_change_in_place") else { return };
    type Change = fn(&Gpu, &mut Scene, Option<&Tracer>);
    let changes: [(&str, Change); 3] = [
        ("leaf", |gpu, scene, tracer| {
            let mut description = scene.leaves[0].description.clone();
            description.contents = LeafPreset::Senescent.contents();
            description.gloss.gamma_along = 0.1;
            let words = scene.leaves[0].describe(description, LeafMode::Rational).unwrap();
            if let Some(tracer) = tracer {
                tracer.update_leaf(gpu, scene, 0, words);
            }
        }),
        ("plants", |gpu, scene, tracer| {
            let variation = PlantVariation { chlorophyll: 0.8, ..PlantVariation::default() };
            Arc::make_mut(&mut scene.geometry).set_factors(|_, placement| plant_factors(&variation, placement));
            if let Some(tracer) = tracer {
                tracer.update_instances(gpu, scene);
            }
        }),
        ("sky", |gpu, scene, tracer| {
            // The sun alone left as much room as a sky takes.
            stand(scene, "19:00", DaylightParts::Both);
            if let Some(tracer) = tracer {
                assert!(tracer.update_environment(gpu, scene));
            }
        }),
    ];
    for (name, change) in changes {
        let mut changed = scene();
        change(&gpu, &mut changed, None);
        let expected = picture(&gpu, &mut Tracer::new(&gpu, &changed, GpuTracer::Bvh).unwrap(), &changed);
        let mut live = scene();
        let mut tracer = Tracer::new(&gpu, &live, GpuTracer::Bvh).unwrap();
        let before = picture(&gpu, &mut tracer, &live);
        change(&gpu, &mut live, Some(&tracer));
        assert_eq!(count_differences(&expected, &picture(&gpu, &mut tracer, &live)), 0, "{name}");
        // Planted: what was not uploaded is not seen.
        assert!(count_differences(&expected, &before) > expected.len() / 20, "{name}");
        let mut stale = Tracer::new(&gpu, &scene(), GpuTracer::Bvh).unwrap();
        assert!(count_differences(&expected, &picture(&gpu, &mut stale, &live)) > expected.len() / 50, "{name}");
    }
}

#[test]
fn a_larger_sky_than_there_is_room_for_is_told() {
    let Some(gpu) = gpu("a_larger_sky_than_there_is_room_for_is_told") else { return };
    let mut lit = scene();
    lit.surround(btf_viewer::Environment::new(2, 1, &[1.0; 6]));
    let tracer = Tracer::new(&gpu, &lit, GpuTracer::Bvh).unwrap();
    assert!(tracer.update_environment(&gpu, &lit));
    stand(&mut lit, "13:00", DaylightParts::Sky);
    assert!(!tracer.update_environment(&gpu, &lit));
}
