//! Volumetric textures among meshes, on their own and as a skin: every tracer draws the same.

use crate::support::{count_differences, gpu, ray_query_is_left_out};
use btf_runtime::testing::{Random, random_volume, take_children};
use btf_runtime::voltex::Voltex;
use btf_viewer::{
    Ambient, Camera, CellMap, CpuPicture, DiscreteJitter, Environment, FrameRequest, GpuTracer, Jitter, Landscape,
    LandscapeParams, Material, NO_VOLUME, Noise, Pattern, PointLight, RenderMode, Scene, SceneChange, SceneMesh,
    SceneObject, SceneSkin, ShadeOptions, ShellParams, Shown, Skin, SkinVertex, Sun, Tracer, Updated, VolumePlace,
    Volumes, Wind, plane, sphere,
};
use glam::{Mat4, Quat, Vec3};
use std::path::Path;
use std::sync::Arc;

const SIZE: [u32; 2] = [64, 48];
const SAMPLES: u32 = 2;
/// A gust over it.
const WIND: Wind = Wind {
    speed_m_per_s: 8.0,
    direction: Vec3::X,
    gust_wavelength_m: 1.5,
    gustiness: 0.6,
    leaning_speed_m_per_s: 10.0,
    flutter: 0.1,
    flutter_period_s: 0.7,
    seed: 0,
};
/// Thickness of the skin.
const THICKNESS: f32 = 0.3;

/// A hill of 5 x 5 texels with two patterns in turn.
fn skin(seed: u32) -> SceneSkin {
    let vertex = |x: u32, y: u32| {
        let [x, y] = [x, y].map(|x| x as f32);
        let lift = 0.1 * (0.9 * x).sin() * (1.1 * y).cos();
        let position = Vec3::new(0.6 * x - 1.5, lift, 1.5 - 0.6 * y);
        SkinVertex::new(position, Vec3::Y * THICKNESS, [x, y])
    };
    let straight = Skin::from_grid(5, 5, vertex, |x, y| (x + y) % 2).unwrap();
    let noise = Noise { wavelength: 0.7, period: [0; 3], seed: 5 };
    let leaning = Jitter { noise, coordinates: 0.0, length: 0.2, angle_deg: 20.0 }.apply(&straight).unwrap();
    let jitter =
        DiscreteJitter { empty: 0.2, scale: [0.5, 0.9], displacement: 0.3, margin: 0.1, turns: true, mirrors: true };
    // A map of three alternatives in more words than one, beyond which there is nothing.
    let content = (0..20u8).map(|i| [1, 2, 0, 3, 1, 2, 1][usize::from(i % 7)]).collect();
    let isolated = Pattern {
        alternatives: [[2, 3], [3, NO_VOLUME], [2, NO_VOLUME]].map(|[a, b]| [a, b, NO_VOLUME, NO_VOLUME]).to_vec(),
        cells: Some(Arc::new(CellMap { size: [5, 4], content })),
        ..Pattern::isolated(2, jitter, seed)
    };
    let params = ShellParams { tolerance: 0.03, ..ShellParams::default() };
    let skin = SceneSkin::new(leaning, &params, vec![Pattern::cyclic(3), isolated], 0.0).unwrap();
    assert!(skin.levels.len() > 1, "one shell alone shows no transition between shells");
    skin
}

/// Volumes, some of whose bricks are not loaded, `places` of the first two of them, and a skin.
fn volumes(places: &[VolumePlace], skin: SceneSkin) -> Arc<Volumes> {
    let mut random = Random::new(7);
    let all = [4, 3, 3, 2].map(|levels| {
        let mut volume = random_volume(&mut random, levels, 0.4);
        take_children(&mut Random::new(8), &mut volume, 0.3);
        Arc::new(Voltex::new(&volume))
    });
    Arc::new(Volumes::new(all.to_vec(), places, vec![skin]).unwrap())
}

/// Two boxes that overlap each other and a ball, one of them mirrored.
fn places() -> [VolumePlace; 2] {
    let place = |volume, scale: Vec3, turn: f32, at: Vec3| {
        let turn = Quat::from_axis_angle(Vec3::new(0.3, 1.0, 0.2).normalize(), turn);
        let middle = Mat4::from_translation(Vec3::splat(-0.5));
        let world_from_volume = Mat4::from_scale_rotation_translation(scale, turn, at) * middle;
        VolumePlace { volume, world_from_volume, leaf_width: 0.0 }
    };
    [
        place(0, Vec3::new(1.0, 1.3, 0.9), 0.4, Vec3::new(-0.2, 0.9, 0.2)),
        place(1, Vec3::new(-0.9, 0.9, 1.1), 1.9, Vec3::new(0.4, 0.8, -0.1)),
    ]
}

/// A ground with a skin, balls and two volumes under sun and lamp.
fn garden(balls: &[Vec3]) -> Scene {
    let mut ground = plane();
    ground.transform(Mat4::from_rotation_x(-std::f32::consts::FRAC_PI_2) * Mat4::from_scale(Vec3::splat(2.0)));
    let object = |part, reflectance| SceneObject { part, material: Material::plain(reflectance) };
    let mesh = |object, places| SceneMesh { objects: vec![object], places };
    let mut shiny = object(sphere(), [0.3, 0.1, 0.1]);
    shiny.material.mirror = [0.4; 3];
    let balls = balls.iter().map(|at| Mat4::from_translation(*at) * Mat4::from_scale(Vec3::splat(0.4))).collect();
    let meshes = vec![mesh(object(ground, [0.3, 0.2, 0.1]), vec![Mat4::IDENTITY]), mesh(shiny, balls)];
    let mut scene = Scene::from_meshes(Path::new("garden"), meshes, Shown::default()).unwrap();
    scene.volumes = Some(volumes(&places(), skin(77)));
    scene.camera =
        Camera { eye: Vec3::new(0.5, 1.4, 3.6), target: Vec3::new(0.0, 0.6, 0.0), up: Vec3::Y, fov_deg: 40.0 };
    scene.lights = vec![PointLight { position: Vec3::new(-0.6, 2.2, 1.0), intensity: [2.0, 1.5, 1.0] }];
    scene.sun =
        Some(Sun { direction: Vec3::new(0.5, 0.7, 0.4).normalize(), angular_diameter_deg: 0.53, irradiance: [3.0; 3] });
    scene
}

/// The garden's own ball.
const BALL: Vec3 = Vec3::new(0.2, 0.7, 0.0);

/// Returns the scene under a sky that is bright in the west.
fn outdoors(balls: &[Vec3]) -> Scene {
    let mut scene = garden(balls);
    let level = |pixel: usize| match (pixel / 32 < 8, pixel % 32 < 10) {
        (true, true) => 1.5,
        (true, false) => 0.4,
        _ => 0.1,
    };
    let rgb: Vec<f32> = (0..32 * 16).flat_map(|pixel| [0.5, 0.7, 1.0].map(|share| share * level(pixel))).collect();
    scene.surround(Environment::new(32, 16, &rgb));
    scene.ambient.distance = 2.0;
    scene
}

/// Balls, and how wide their leaves are: some are meshes, some volumes and some between; the last has no stand-in.
const TREES: [(Vec3, f32); 7] = [
    (Vec3::new(-1.1, 0.6, 0.6), 0.2),
    (Vec3::new(-0.5, 0.7, 0.9), 0.09),
    (Vec3::new(0.3, 0.6, 0.4), 0.008),
    (Vec3::new(1.0, 0.7, 0.2), 0.09),
    (Vec3::new(-0.3, 0.9, -0.9), 0.2),
    (Vec3::new(0.6, 1.1, -1.3), 0.13),
    (Vec3::new(-1.4, 1.0, -0.8), 0.0),
];

/// Trees that are balls where they are near and volumes where they are far, on a ground whose skin is handed over too;
/// leaves are `size` times as wide.
fn orchard(size: f32) -> Scene {
    let mut scene = outdoors(&TREES.map(|(at, _)| at));
    let widths = |mesh, number: usize| if mesh == 0 { 0.0 } else { size * TREES[number - 1].1 };
    Arc::make_mut(&mut scene.geometry).set_leaf_widths(widths);
    let mixed = TREES.iter().enumerate().filter(|(_, (_, width))| *width > 0.0);
    let place = |(number, (at, width)): (usize, &(Vec3, f32))| {
        let turn = Quat::from_axis_angle(Vec3::Y, number as f32);
        let middle = Mat4::from_translation(Vec3::splat(-0.5));
        let world_from_volume = Mat4::from_scale_rotation_translation(Vec3::splat(0.9), turn, *at) * middle;
        VolumePlace { volume: number % 2, world_from_volume, leaf_width: size * width }
    };
    let places: Vec<VolumePlace> = mixed.map(place).collect();
    scene.volumes = Some(volumes(&places, SceneSkin { leaf_width: size * 0.09, ..skin(77) }));
    scene
}

fn cpu_picture(scene: &Scene, options: &ShadeOptions) -> Vec<[f32; 3]> {
    let mut picture = CpuPicture::new(SIZE);
    for _ in 0..SAMPLES {
        picture.add_sample(scene, options, &|| true);
    }
    picture.radiance()
}

/// What is drawn of a scene, and how.
struct Case {
    name: &'static str,
    scene: Scene,
    options: ShadeOptions,
    expected: Vec<[f32; 3]>,
}

impl Case {
    fn new(name: &'static str, scene: Scene, mode: RenderMode) -> Case {
        let options = ShadeOptions { mode, depth: 3, ..ShadeOptions::default() };
        let expected = cpu_picture(&scene, &options);
        Case { name, scene, options, expected }
    }
}

fn cases() -> Vec<Case> {
    let mut windy = outdoors(&[BALL]);
    windy.wind = Some(WIND);
    windy.blow(1.5).unwrap();
    let mut lit_evenly = garden(&[BALL]);
    lit_evenly.ambient = Ambient { radiance: [0.3, 0.4, 0.5], distance: 1.0 };
    let mut hazy = outdoors(&[BALL]);
    hazy.air = [0.1, 0.15, 0.25];
    hazy.materials[0].noise = Some([2.0, 0.3, 0.0]);
    vec![
        Case::new("haze over uneven ground", hazy.clone(), RenderMode::Direct),
        Case::new("haze over uneven ground, paths", hazy, RenderMode::Path),
        Case::new("a sky", outdoors(&[BALL]), RenderMode::Direct),
        Case::new("a sky, paths", outdoors(&[BALL]), RenderMode::Path),
        Case::new("ambient light", lit_evenly, RenderMode::Direct),
        Case::new("wind", windy, RenderMode::Direct),
    ]
}

fn cases_of_lod_transition() -> Vec<Case> {
    let mut within = orchard(1.0);
    // Within the box of a volume, beside the ball that it stands in for; the sphere cuts both.
    let eye = TREES[2].0 + Vec3::new(0.25, 0.35, 0.25);
    within.camera = Camera { eye, target: eye + Vec3::new(-1.0, 0.1, -1.0), fov_deg: 70.0, ..within.camera };
    vec![
        Case::new("trees", orchard(1.0), RenderMode::Direct),
        Case::new("trees, paths", orchard(1.0), RenderMode::Path),
        Case::new("from within a tree", within, RenderMode::Direct),
    ]
}

/// A grove whose trees are a few large leaves, near by and at two moments: what is drawn second has been moved.
fn cases_of_wind_over_models() -> Vec<Case> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("leaves.obj");
    let leaf = |[x, y, z]: [f32; 3]| format!("v {x} {y} {z}\nv {} {y} {}\nv {x} {} {z}\n", x + 2.0, z + 1.5, y + 3.0);
    let leaves = [[-1.0, 0.0, 0.0], [0.0, 1.0, -1.0], [-0.5, 2.0, 0.5], [-1.0, 3.0, -0.5]].map(leaf).concat();
    std::fs::write(&file, leaves + "f 1 2 3\nf 4 5 6\nf 7 8 9\nf 10 11 12\n").unwrap();
    let params = LandscapeParams { times: 1, volumes: vec![], meshes: vec![file], wind_m_per_s: Some(30.0) };
    let (mut scene, _) = Landscape::Grove.scene(&params).unwrap();
    scene.camera = scene.more_cameras[1];
    let mut later = scene.clone();
    later.blow(2.0).unwrap();
    vec![
        Case::new("a grove with models", scene, RenderMode::Direct),
        Case::new("a moment later", later, RenderMode::Direct),
    ]
}

/// Pixels of a picture that may differ: rays that graze a voxel's edge.
const ALLOWED: usize = (SIZE[0] * SIZE[1]) as usize / 100;

/// Cases of one geometry.
fn compare(kind: GpuTracer, cases: &[Case], test: &str) {
    let Some(gpu) = gpu(test) else { return };
    if kind == GpuTracer::RayQuery && ray_query_is_left_out(test) {
        return;
    }
    // One for all, whose pipelines then are compiled once: it is uploaded with the sky that others may do without.
    let mut tracer = Tracer::new(&gpu, &cases[0].scene, kind).unwrap();
    for Case { name, scene, options, expected } in cases {
        assert_eq!(tracer.update(scene, &SceneChange::Skins).unwrap(), Updated::InPlace);
        for sample in 0..SAMPLES {
            let request = FrameRequest { scene, size: SIZE, options: *options, sample };
            tracer.sample(&request, None).unwrap();
        }
        let found = count_differences(expected, &tracer.read_radiance().unwrap());
        println!("{name}, {kind:?}: {found} of {} pixels differ", expected.len());
        assert!(found <= ALLOWED, "{name}, {kind:?}: {found}");
    }
}

/// A scene with light after one bounce from a grid, and the same with lamps alone.
fn cases_of_bounces() -> Vec<Case> {
    let case = |name, scene: Scene| {
        let options = ShadeOptions { irradiance_cells: 6, ..ShadeOptions::default() };
        let expected = cpu_picture(&scene, &options);
        Case { name, scene, options, expected }
    };
    let mut dark = garden(&[BALL]);
    dark.sun = None;
    dark.lights =
        (0..9).map(|i| PointLight { position: Vec3::new(0.4 * i as f32 - 1.6, 2.0, 1.0), ..dark.lights[0] }).collect();
    let mut few = case("bounced light of lamps that are drawn", dark);
    few.options.light_samples = 1;
    few.expected = cpu_picture(&few.scene, &few.options);
    vec![case("bounced light of a sky", outdoors(&[BALL])), few]
}

#[test]
fn every_tracer_draws_the_same_bounced_light_as_the_cpu() {
    let test = "every_tracer_draws_the_same_bounced_light_as_the_cpu";
    let cases = cases_of_bounces();
    for kind in [GpuTracer::Bvh, GpuTracer::RayQuery] {
        compare(kind, &cases, test);
    }
    // Planted: a grid of other cells, and none.
    for cells in [5, 0] {
        let Case { scene, options, expected, .. } = &cases[0];
        let other = cpu_picture(scene, &ShadeOptions { irradiance_cells: cells, ..*options });
        assert!(count_differences(expected, &other) > 10 * ALLOWED, "{cells}");
    }
}

#[test]
fn ray_queries_draw_the_same_volumes_as_the_cpu() {
    compare(GpuTracer::RayQuery, &cases(), "ray_queries_draw_the_same_volumes_as_the_cpu");
}

#[test]
fn the_compute_hierarchy_draws_the_same_volumes_as_the_cpu() {
    compare(GpuTracer::Bvh, &cases(), "the_compute_hierarchy_draws_the_same_volumes_as_the_cpu");
}

#[test]
fn ray_queries_lod_transition_where_the_cpu_does() {
    compare(GpuTracer::RayQuery, &cases_of_lod_transition(), "ray_queries_lod_transition_where_the_cpu_does");
}

#[test]
fn the_compute_hierarchy_hands_over_where_the_cpu_does() {
    compare(GpuTracer::Bvh, &cases_of_lod_transition(), "the_compute_hierarchy_hands_over_where_the_cpu_does");
}

#[test]
fn every_tracer_has_models_where_the_wind_has_them() {
    let cases = cases_of_wind_over_models();
    let [before, after] = [0, 1].map(|i: usize| &cases[i]);
    assert!(count_differences(&before.expected, &after.expected) > 5 * ALLOWED);
    // Planted: volumes that have moved without their models.
    let left_behind = Scene { geometry: before.scene.geometry.clone(), ..after.scene.clone() };
    let planted = count_differences(&after.expected, &cpu_picture(&left_behind, &after.options));
    assert!(planted > 5 * ALLOWED, "{planted}");
    for kind in [GpuTracer::RayQuery, GpuTracer::Bvh] {
        compare(kind, &cases, "every_tracer_has_models_where_the_wind_has_them");
    }
}

#[test]
fn a_volume_less_or_another_is_noticed() {
    for Case { name, scene, options, expected } in cases() {
        let mut later = scene.clone();
        later.blow(scene.time_s + 0.1).unwrap();
        let moved = count_differences(&expected, &cpu_picture(&later, &options));
        assert_eq!(moved > 2 * ALLOWED, scene.wind.is_some(), "{name}: {moved}");
        // One volume less, another seed of the skin, no volumes.
        for volumes in [Some(volumes(&places()[..1], skin(77))), Some(volumes(&places(), skin(78))), None] {
            let planted = count_differences(&expected, &cpu_picture(&Scene { volumes, ..scene.clone() }, &options));
            assert!(planted > 2 * ALLOWED, "{name}: {planted}");
        }
    }
}

#[test]
fn other_spheres_are_noticed() {
    for Case { name, scene, options, expected } in cases_of_lod_transition() {
        // Wider spheres, hardly any volume, hardly any mesh.
        for size in [1.05, 100.0, 0.01] {
            let other = Scene { camera: scene.camera, ..orchard(size) };
            let planted = count_differences(&expected, &cpu_picture(&other, &options));
            println!("{name}, leaves {size} times as wide: {planted} of {} pixels differ", expected.len());
            assert!(planted > 2 * ALLOWED, "{name}: {planted}");
        }
    }
}
