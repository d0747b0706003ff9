//! Leaves that are evaluated live, placed many times, under sun and sky: every backend draws the same, at the extremes
//! too.

use crate::support::{backends, count_differences};
use btf_models::{DiffuseColour, LeafDescription};
use btf_runtime::testing::Random;
use btf_runtime::{LeafMode, LeafTexel, LeafTexture};
use btf_viewer::{
    Ambient, BackendChoice, Body, Camera, Control, Daylight, DaylightParts, Environment, Material, Outdoors,
    RenderMode, RenderParams, Rendered, Scene, SceneLeaf, SceneMesh, SceneObject, ShadeOptions, Shown, SkyLight, Sun,
    plane, render,
};
use glam::{Mat4, Quat, Vec3};
use std::path::Path;
use std::sync::Arc;

/// A blade with textures of 8 x 8 texels that differ much from one to the next.
fn blade() -> SceneLeaf {
    let mut random = Random::new(11);
    let mut texel = |_| LeafTexel {
        factors: std::array::from_fn(|_| random.within(0.3, 1.7)),
        gloss: [random.within(0.2, 1.0), random.within(0.2, 1.0)],
        veins: [random.within(-1.0, 1.0), random.within(-1.0, 1.0)],
        tilt: std::array::from_fn(|_| random.within(-0.2, 0.2)),
        ..LeafTexel::default()
    };
    let texture = LeafTexture { width: 8, texels: (0..64).map(&mut texel).collect() };
    SceneLeaf::new("blade", LeafDescription::default(), &texture).unwrap()
}

/// Sixty leaves of two shapes over a ground, some of them mirrored, in many sizes.
fn grove(leaf: SceneLeaf) -> Scene {
    let mut random = Random::new(3);
    let leaf_material = Material::new(Body::Leaf(0), [1.0; 2]);
    let mut narrow = plane();
    narrow.transform(Mat4::from_scale(Vec3::new(0.3, 1.0, 1.0)));
    let mut place = |_| {
        let turn = Quat::from_axis_angle(Vec3::from(random.direction()), random.within(0.0, 6.0));
        let size = random.within(0.15, 0.4);
        let mirrored = if random.below(3) == 0 { -size } else { size };
        let at = Vec3::new(random.within(-1.0, 1.0), random.within(0.2, 1.4), random.within(-1.0, 1.0));
        Mat4::from_scale_rotation_translation(Vec3::new(mirrored, size, size), turn, at)
    };
    let mut ground = plane();
    ground.transform(Mat4::from_rotation_x(-std::f32::consts::FRAC_PI_2) * Mat4::from_scale(Vec3::splat(2.0)));
    let meshes = vec![
        SceneMesh {
            objects: vec![SceneObject { part: ground, material: Material::plain([0.3, 0.2, 0.1]) }],
            places: vec![Mat4::IDENTITY],
        },
        SceneMesh {
            objects: vec![SceneObject { part: plane(), material: leaf_material }],
            places: (0..30).map(&mut place).collect(),
        },
        SceneMesh {
            objects: vec![SceneObject { part: narrow, material: Material { tint: [0.8, 1.2, 0.6], ..leaf_material } }],
            places: (0..30).map(&mut place).collect(),
        },
    ];
    let mut scene =
        Scene::from_meshes(Path::new("grove"), meshes, Shown { leaves: vec![leaf], ..Shown::default() }).unwrap();
    scene.camera =
        Camera { eye: Vec3::new(0.5, 1.2, 4.0), target: Vec3::new(0.0, 0.7, 0.0), up: Vec3::Y, fov_deg: 35.0 };
    Arc::make_mut(&mut scene.geometry)
        .set_factors(|_, number| [0.6 + 0.02 * number as f32, 1.0, 1.0, 1.2 - 0.01 * number as f32]);
    scene
}

/// A sun in the south east over a sky that is bright in the west.
fn light_up(scene: &mut Scene) {
    let mut rgb = Vec::new();
    for pixel in 0..32 * 16 {
        let (row, column) = (pixel / 32, pixel % 32);
        let west = if column < 10 { 1.5 } else { 0.4 };
        let level = if row < 8 { west } else { 0.1 };
        rgb.extend([0.5 * level, 0.7 * level, level]);
    }
    scene.surround(Environment::new(32, 16, &rgb));
    let direction = Vec3::new(0.5, 0.7, 0.4).normalize();
    scene.sun = Some(Sun { direction, angular_diameter_deg: 0.53, irradiance: [3.0, 2.8, 2.5] });
}

fn draw(scene: &Scene, backend: BackendChoice, shade: ShadeOptions) -> Rendered {
    let params = RenderParams { size: [96, 72], frames: 2, backend, shade, ..RenderParams::default() };
    render(scene, &params, &Control::SILENT).unwrap()
}

fn differences(a: &Rendered, b: &Rendered) -> usize {
    count_differences(&a.picture.radiance, &b.picture.radiance)
}

#[test]
fn every_backend_draws_the_same_leaves() {
    let mut scene = grove(blade());
    light_up(&mut scene);
    for (mode, sky) in [
        (RenderMode::Direct, SkyLight::Rays),
        (RenderMode::Direct, SkyLight::Irradiance),
        (RenderMode::Path, SkyLight::Rays),
    ] {
        let shade = ShadeOptions { mode, sky, depth: 3, ..ShadeOptions::default() };
        let cpu = draw(&scene, BackendChoice::Cpu, shade);
        assert_eq!(cpu.report.instances, 61);
        let allowed = cpu.hits.len() / 100;
        for backend in backends("every_backend_draws_the_same_leaves") {
            let found = differences(&cpu, &draw(&scene, backend, shade));
            println!("{mode:?}, {sky:?}, {backend:?}: {found} of {} pixels differ", cpu.hits.len());
            assert!(found <= allowed, "{mode:?}, {sky:?}, {backend:?}: {found}");
        }
        // Planted differences: other contents, other plants, a sun two degrees further, a leaf that is not mirrored.
        let planted = |change: &dyn Fn(&mut Scene)| {
            let mut other = scene.clone();
            change(&mut other);
            differences(&cpu, &draw(&other, BackendChoice::Cpu, shade))
        };
        let contents = planted(&|scene| {
            let mut description = scene.leaves[0].description.clone();
            description.contents.chlorophyll_ug_per_cm2 *= 1.2;
            scene.leaves[0].describe(description, LeafMode::default()).unwrap();
        });
        let plants = planted(&|scene| Arc::make_mut(&mut scene.geometry).set_factors(|_, _| [1.0; 4]));
        let sun = planted(&|scene| {
            let sun = scene.sun.as_mut().unwrap();
            sun.direction = Quat::from_rotation_y(0.035) * sun.direction;
        });
        assert!(contents > 5 * allowed && plants > 5 * allowed && sun > 5 * allowed, "{contents} {plants} {sun}");
    }
}

#[test]
fn the_three_pictures_of_the_paper_add_up() {
    let mut scene = grove(blade());
    light_up(&mut scene);
    let shade = ShadeOptions::default();
    let both = draw(&scene, BackendChoice::Cpu, shade);
    let sky = draw(&Scene { sun: None, ..scene.clone() }, BackendChoice::Cpu, shade);
    let mut sunny = scene.clone();
    sunny.surround(Environment::new(1, 1, &[0.0; 3]));
    sunny.sun = scene.sun;
    let sun = draw(&sunny, BackendChoice::Cpu, shade);
    for (both, (sky, sun)) in both.picture.radiance.iter().zip(sky.picture.radiance.iter().zip(&sun.picture.radiance)) {
        for c in 0..3 {
            assert!((both[c] - sky[c] - sun[c]).abs() < 1e-4 * (1.0 + both[c].abs()), "{both:?} {sky:?} {sun:?}");
        }
    }
    let mean = |rendered: &Rendered| rendered.picture.radiance.iter().map(|rgb| rgb[1]).sum::<f32>();
    assert!(mean(&sky) > 0.1 * mean(&both) && mean(&sun) > 0.1 * mean(&both));
}

/// Whether every pixel is finite and, but for colours outside the gamut, no darker than black.
fn is_sound(rendered: &Rendered) -> bool {
    rendered.picture.radiance.iter().flatten().all(|x| x.is_finite() && *x > -0.05)
}

#[test]
fn extremes_of_leaves_give_pictures() {
    let mut scene = grove(blade());
    light_up(&mut scene);
    type Change = fn(&mut LeafDescription);
    let nothing: Change = |leaf| {
        leaf.contents = leaf.contents.without_pigments();
        leaf.contents.dry_matter_g_per_cm2 = 0.0;
        leaf.contents.water_cm = 0.0;
    };
    let hundredfold: Change = |leaf| {
        leaf.contents.chlorophyll_ug_per_cm2 *= 100.0;
        leaf.contents.carotenoid_ug_per_cm2 *= 100.0;
        leaf.contents.dry_matter_g_per_cm2 *= 100.0;
    };
    let one_layer: Change = |leaf| leaf.contents.structure = 1.0;
    let three_layers: Change = |leaf| leaf.contents.structure = 3.0;
    let mut means = Vec::new();
    for change in [nothing, hundredfold, one_layer, three_layers] {
        for mode in LeafMode::ALL {
            let mut description = LeafDescription::default();
            change(&mut description);
            scene.leaves[0].describe(description, mode).unwrap();
            let rendered = draw(&scene, BackendChoice::Cpu, ShadeOptions::default());
            assert!(is_sound(&rendered), "{mode:?}");
            if mode == LeafMode::default() {
                means.push(rendered.picture.radiance.iter().map(|rgb| rgb[0]).sum::<f32>());
            }
        }
    }
    assert!(means[0] > 1.5 * means[1], "a white leaf is brighter than a black one: {means:?}");
    // Numbers that are none are refused.
    let mut broken = LeafDescription::default();
    broken.contents.brown = f64::NAN;
    assert!(scene.leaves[0].describe(broken, LeafMode::default()).is_err());
}

#[test]
fn extremes_of_light_and_eye_give_pictures_on_every_backend() {
    let mut scene = grove(blade());
    // Noon, the sun on the horizon and below it, a polar night and a polar day.
    for (date_time, place) in [
        ("2026-06-21T12:00+00:00", "0.0,0.0"),
        ("2026-03-20T06:07+00:00", "0.0,0.0"),
        ("2026-03-20T05:30+00:00", "0.0,0.0"),
        ("2026-12-21T12:00+00:00", "85.0,10.0"),
        ("2026-06-21T00:00+00:00", "90.0,0.0"),
    ] {
        let daylight = Daylight::new(date_time, place).unwrap();
        let light = daylight.sun_and_sky().unwrap();
        scene.stand_outdoors(Outdoors { daylight, parts: DaylightParts::Both }, light);
        let rendered = draw(&scene, BackendChoice::Cpu, ShadeOptions::default());
        assert!(is_sound(&rendered), "{date_time} {place}");
    }
    light_up(&mut scene);
    let at = |eye: Vec3, target: Vec3| Camera { eye, target, up: Vec3::Y, fov_deg: 60.0 };
    let leaf = &scene.geometry.instances()[30];
    let row = |axis: usize| Vec3::from(leaf.world_from_object.map(|row| row[axis]));
    let (middle, along) = (row(3), row(0).normalize());
    for (name, camera) in [
        ("inside", at(Vec3::new(0.0, 0.8, 0.0), Vec3::new(0.3, 0.8, -1.0))),
        // In the leaf's own plane.
        ("edge-on", at(middle + along * 1.5, middle)),
        ("on a leaf", at(middle, middle + row(2))),
    ] {
        let seen = Scene { camera, ..scene.clone() };
        for backend in backends("extremes_of_light_and_eye_give_pictures_on_every_backend") {
            assert!(is_sound(&draw(&seen, backend, ShadeOptions::default())), "{name}, {backend:?}");
        }
    }
}

#[test]
fn white_leaves_in_a_white_world_are_not_to_be_seen() {
    let mut description = LeafDescription::default();
    description.contents = description.contents.without_pigments();
    description.contents.dry_matter_g_per_cm2 = 0.0;
    description.contents.water_cm = 0.0;
    let mut leaf = SceneLeaf::new("white", description, &LeafTexture::uniform(LeafTexel::default())).unwrap();
    let furnace = |leaf: SceneLeaf| {
        let mut scene = grove(leaf);
        scene.lights.clear();
        scene.ambient = Ambient { radiance: [1.0; 3], distance: 1.0 };
        scene.background = [1.0; 3];
        for material in &mut scene.materials {
            material.tint = [1.0; 3];
            if let Body::Plain(colour) = &mut material.body {
                *colour = DiffuseColour::opaque([1.0; 3]);
            }
        }
        let shade = ShadeOptions { mode: RenderMode::Path, depth: 64, ..ShadeOptions::default() };
        let params =
            RenderParams { size: [64, 48], frames: 16, backend: BackendChoice::Cpu, shade, ..RenderParams::default() };
        let rendered = render(&scene, &params, &Control::SILENT).unwrap();
        let seen: Vec<f32> = rendered
            .picture
            .radiance
            .iter()
            .zip(&rendered.hits)
            .filter(|(_, hit)| hit.primitive != btf_viewer::NO_HIT)
            .map(|(rgb, _)| rgb[1])
            .collect();
        assert!(seen.len() > 1000);
        seen.iter().sum::<f32>() / seen.len() as f32
    };
    let white = furnace(leaf.clone());
    assert!((white - 1.0).abs() < 0.01, "{white}");
    // Planted difference: a trace of pigment.
    let mut grey = leaf.description.clone();
    grey.contents.brown = 0.02;
    leaf.describe(grey, LeafMode::default()).unwrap();
    let grey = furnace(leaf);
    assert!(grey < 0.98, "{grey}");
}
