//! Plain surfaces that let light through: lit from either side by all kinds of light; every backend draws the same.

use crate::support::{backends, count_differences};
use btf_models::DiffuseColour;
use btf_viewer::{
    Ambient, BackendChoice, Camera, Control, Environment, Material, PointLight, RenderMode, RenderParams, Rendered,
    Scene, SceneMesh, SceneObject, ShadeOptions, SkyLight, Sun, plane, render, sphere,
};
use glam::{Mat4, Quat, Vec3};
use std::f32::consts::{FRAC_PI_2, PI};
use std::path::Path;

const LEAF: DiffuseColour = DiffuseColour { reflectance: [0.3, 0.2, 0.05], transmittance: [0.1, 0.4, 0.0] };
/// All light goes on.
const WHITE: DiffuseColour = DiffuseColour { reflectance: [0.7, 0.25, 0.5], transmittance: [0.3, 0.75, 0.5] };

/// Rays of a path.
const DEPTH: u32 = 3;

fn shade(mode: RenderMode) -> ShadeOptions {
    ShadeOptions { mode, depth: DEPTH, ..ShadeOptions::default() }
}

/// The plane z = 0 in the dark, seen from in front.
fn sheet(colour: DiffuseColour) -> Scene {
    let object = SceneObject { part: plane(), material: Material::diffuse(colour) };
    let mut scene = Scene::from_objects(Path::new("sheet"), vec![object], Vec::new()).unwrap();
    scene.camera = Camera { eye: Vec3::new(0.3, 0.2, 4.0), target: Vec3::ZERO, up: Vec3::Y, fov_deg: 2.0 };
    scene.background = [0.0; 3];
    scene.lights.clear();
    scene
}

fn draw(scene: &Scene, size: [u32; 2], frames: u32, backend: BackendChoice, shade: ShadeOptions) -> Rendered {
    let params = RenderParams { size, frames, backend, shade, ..RenderParams::default() };
    render(scene, &params, &Control::SILENT).unwrap()
}

fn mean_of(radiance: &[[f32; 3]]) -> Vec3 {
    radiance.iter().map(|rgb| Vec3::from(*rgb)).sum::<Vec3>() / radiance.len() as f32
}

/// Mean radiance of a scene that fills the picture.
fn mean(scene: &Scene, mode: RenderMode) -> Vec3 {
    mean_of(&draw(scene, [16, 16], 16, BackendChoice::Cpu, shade(mode)).picture.radiance)
}

#[test]
fn a_sheet_that_is_lit_from_behind_sends_on_what_it_lets_through() {
    let lamp = PointLight { position: Vec3::new(30.0, 0.0, -40.0), intensity: [5000.0; 3] };
    let sun = Sun { direction: Vec3::new(0.6, 0.0, -0.8), angular_diameter_deg: 0.53, irradiance: [2.0; 3] };
    // Bright below the horizon alone, and a sheet that lies on it.
    let sky: Vec<f32> = (0..32 * 16 * 3).map(|i| if i / (32 * 3) < 8 { 0.0 } else { 0.5 }).collect();
    let of_lamp = Scene { lights: vec![lamp], ..sheet(LEAF) };
    let of_sun = Scene { sun: Some(sun), ..sheet(LEAF) };
    let mut of_sky = sheet(LEAF);
    let mut lying = plane();
    lying.transform(Mat4::from_rotation_x(-FRAC_PI_2));
    let lying = vec![SceneObject { part: lying, material: Material::diffuse(LEAF) }];
    let mut lying = Scene::from_objects(Path::new("lying"), lying, Vec::new()).unwrap();
    lying.surround(Environment::new(32, 16, &sky));
    (of_sky.geometry, of_sky.environment, of_sky.ambient) = (lying.geometry, lying.environment, lying.ambient);
    of_sky.camera.eye = Vec3::new(0.3, 4.0, 0.2);
    of_sky.camera.up = Vec3::Z;
    let [through, back] = [LEAF.transmittance, LEAF.reflectance].map(Vec3::from);
    // Irradiance 5000 / 50^2 * 0.8, and 2 * 0.8; half a world of radiance 0.5 is an irradiance of 0.5 pi.
    for (name, scene, irradiance, noise) in
        [("lamp", &of_lamp, 1.6, 2e-3), ("sun", &of_sun, 1.6, 2e-3), ("sky", &of_sky, 0.5 * PI, 2e-2)]
    {
        for mode in [RenderMode::Direct, RenderMode::Path] {
            // From behind, where the light is, what it reflects.
            let mut turned = scene.clone();
            turned.camera.eye = -turned.camera.eye;
            for (scene, share) in [(scene, through), (&turned, back)] {
                let expected = share * irradiance / PI;
                let found = mean(scene, mode);
                println!("{mode:?}, {name}: {found}, expected {expected}");
                assert!((found - expected).abs().max_element() < noise * expected.max_element(), "{name}: {found}");
            }
        }
    }
    // Light from everywhere comes both ways.
    let ambient = Ambient { radiance: [0.5; 3], distance: 1.0 };
    let found = mean(&Scene { ambient, ..sheet(LEAF) }, RenderMode::Direct);
    assert!((found - 0.5 * (through + back)).abs().max_element() < 1e-4, "{found}");
    // Planted: an opaque one is dark.
    let opaque = Scene { lights: vec![lamp], ..sheet(DiffuseColour::opaque(LEAF.reflectance)) };
    assert_eq!(mean(&opaque, RenderMode::Direct), Vec3::ZERO);
}

/// Sheets that cross, over a ball and a ground.
fn garden(colour: DiffuseColour, ground: [f32; 3]) -> Scene {
    let at = |angle: f32, at: Vec3, size: f32| {
        let turn = Quat::from_axis_angle(Vec3::new(0.4, 1.0, 0.3).normalize(), angle);
        Mat4::from_scale_rotation_translation(Vec3::splat(size), turn, at)
    };
    let mesh = |part, material, places: Vec<Mat4>| SceneMesh { objects: vec![SceneObject { part, material }], places };
    let floor =
        Mat4::from_translation(Vec3::NEG_Y) * Mat4::from_rotation_x(-FRAC_PI_2) * Mat4::from_scale(Vec3::splat(3.0));
    let glazed = Material { mirror: [0.1; 3], ..Material::diffuse(colour) };
    let meshes = vec![
        mesh(plane(), Material::plain(ground), vec![floor]),
        mesh(
            plane(),
            Material::diffuse(colour),
            vec![at(0.3, Vec3::ZERO, 0.7), at(1.9, Vec3::new(0.4, 0.1, 0.2), 0.5)],
        ),
        mesh(sphere(), glazed, vec![at(0.0, Vec3::new(-0.5, -0.3, 0.6), 0.3)]),
    ];
    let mut scene = Scene::from_meshes(Path::new("garden"), meshes, Vec::new()).unwrap();
    scene.camera =
        Camera { eye: Vec3::new(0.5, 0.8, 3.5), target: Vec3::new(0.0, -0.1, 0.0), up: Vec3::Y, fov_deg: 30.0 };
    scene.lights.clear();
    scene
}

#[test]
fn every_backend_draws_the_same_sheets() {
    let lit = |colour| {
        let mut scene = garden(colour, [0.3, 0.2, 0.1]);
        let sky: Vec<f32> = (0..32 * 16).flat_map(|i| [0.5, 0.7, 1.0].map(|x| if i < 256 { x } else { 0.1 })).collect();
        scene.surround(Environment::new(32, 16, &sky));
        let direction = Vec3::new(0.3, 0.8, -0.5).normalize();
        scene.sun = Some(Sun { direction, angular_diameter_deg: 0.53, irradiance: [3.0, 2.8, 2.5] });
        scene.lights = vec![PointLight { position: Vec3::new(-1.0, 0.5, -1.0), intensity: [1.0, 0.5, 0.2] }];
        scene
    };
    let scene = lit(LEAF);
    let opaque = lit(DiffuseColour::opaque(LEAF.reflectance));
    let direct = shade(RenderMode::Direct);
    for shade in [direct, ShadeOptions { sky: SkyLight::Irradiance, ..direct }, shade(RenderMode::Path)] {
        let picture = |scene, backend| draw(scene, [96, 72], 2, backend, shade).picture.radiance;
        let cpu = picture(&scene, BackendChoice::Cpu);
        let allowed = cpu.len() / 100;
        for backend in backends("every_backend_draws_the_same_sheets") {
            let found = count_differences(&cpu, &picture(&scene, backend));
            println!("{:?}, {:?}, {backend:?}: {found} of {} pixels differ", shade.mode, shade.sky, cpu.len());
            assert!(found <= allowed, "{:?}, {backend:?}: {found}", shade.mode);
            // Planted: nothing comes through.
            assert!(count_differences(&cpu, &picture(&opaque, backend)) > 5 * allowed);
        }
    }
}

#[test]
fn what_sends_all_light_on_is_not_seen_in_a_furnace() {
    let heated = |colour| {
        let mut scene = garden(colour, [1.0; 3]);
        // The glaze would add to it.
        scene.materials.iter_mut().for_each(|material| material.mirror = [0.0; 3]);
        scene.ambient = Ambient { radiance: [1.0; 3], distance: 1.0 };
        scene.background = [1.0; 3];
        scene
    };
    let deep = ShadeOptions { depth: 64, ..shade(RenderMode::Path) };
    let seen = |colour| mean_of(&draw(&heated(colour), [48, 36], 16, BackendChoice::Cpu, deep).picture.radiance);
    let (white, brighter) = (seen(WHITE), seen(DiffuseColour { transmittance: [0.4, 0.85, 0.6], ..WHITE }));
    println!("{white}, and with a tenth too much {brighter}");
    assert!((white - 1.0).abs().max_element() < 0.01, "{white}");
    assert!(brighter.min_element() > 1.02, "{brighter}");
}
