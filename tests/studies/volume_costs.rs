//! Prints what volumetric textures of trees cost beside the trees' triangles, as Markdown:
//! `cargo run --release -p btf-tests -- volume_costs [WIDTH]`.
//!
//! - growth: as much land under 529 trees and under 24,964;
//! - equal error: rays a pixel that triangles need for the error of the volumes' picture;
//! - noise: how much a pixel's value changes while the picture moves on by sub-pixel steps, beside what it should change.
//!
//! Everything is grey, diffuse and lit by one lamp, so that nothing is drawn by chance but places within pixels. Times
//! are of this machine and run: compare them with each other.

use crate::beside::{Explicit, Radiance, drawn};
use btf_models::{LeafDescription, Species, TextureImages};
use btf_runtime::voltex::Voltex;
use btf_synth::{Existing, PlantsParams, write_plants};
use btf_viewer::{
    Camera, DiscreteJitter, Material, MeshPart, Pattern, PointLight, Scene, SceneMesh, SceneObject, SceneSkin,
    ShellParams, Skin, SkinVertex, Variant, VolumePlace, Volumes, load_meshes, standing,
};
use btf_voxelize::{MicroflakeColour, TriangleModel, VoltexParams, build_voltex};
use glam::{Mat4, Vec3};
use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Reflectance of all surfaces.
const GREY: f32 = 0.5;
/// Samples of the picture that errors are against.
const TRUTH: u32 = 256;
/// Trees along each side of the land.
const SIDES: [u32; 2] = [23, 158];
/// Frames of a pan, and how far each moves on, pixels.
const PAN: (u32, f32) = (64, 1.0 / 16.0);
/// Size of the pan's picture.
const PAN_SIZE: [u32; 2] = [64, 64];
/// Variation among the trees.
const JITTER: DiscreteJitter =
    DiscreteJitter { empty: 0.0, scale: [0.6, 1.0], displacement: 0.0, margin: 0.0, turns: true, mirrors: true };

/// A tree as triangles and as a volume.
struct Tree {
    parts: Vec<MeshPart>,
    voltex: Arc<Voltex>,
}

fn grown() -> Tree {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("tree.glb");
    let leaf = LeafDescription::of(Some(Species::Tree), None);
    let params = PlantsParams { branches: 2154, leaves: 6336, ..PlantsParams::of(Species::Tree) };
    write_plants(&path, &params, &leaf, TextureImages::default(), Existing::Refuse, &|_, _| ControlFlow::Continue(()))
        .expect("a tree");
    let mut model = TriangleModel::read(&path).expect("the tree");
    model.colours.fill(MicroflakeColour {
        reflectance: [GREY; 3],
        transmittance: [0.0; 3],
        ..MicroflakeColour::default()
    });
    let volume = build_voltex(&model, &VoltexParams::default()).expect("a volume");
    let parts = load_meshes(&path).expect("the tree").into_iter().flat_map(|mesh| mesh.parts).collect();
    Tree { parts, voltex: Arc::new(Voltex::new(&volume)) }
}

fn objects(parts: &[MeshPart]) -> Vec<SceneObject> {
    parts.iter().map(|part| SceneObject { part: part.clone(), material: Material::plain([GREY; 3]) }).collect()
}

/// Meshes under a lamp.
fn scene(meshes: Vec<SceneMesh>, camera: Camera) -> Scene {
    let mut scene = Scene::from_meshes(Path::new("trees"), meshes, Vec::new()).expect("a scene");
    let far = Vec3::new(3000.0, 5000.0, 4000.0);
    scene.lights = vec![PointLight { position: far, intensity: [3.0 * far.length_squared(); 3] }];
    scene.background = [0.0; 3];
    scene.camera = camera;
    scene
}

fn once(parts: &[MeshPart]) -> Vec<SceneMesh> {
    vec![SceneMesh { objects: objects(parts), places: vec![Mat4::IDENTITY] }]
}

/// A floor under everything.
fn floor() -> Vec<MeshPart> {
    let mut floor = btf_viewer::plane();
    floor.transform(Mat4::from_rotation_x(-std::f32::consts::FRAC_PI_2) * Mat4::from_scale(Vec3::splat(100.0)));
    vec![floor]
}

/// Scene of volumes alone, over a floor.
fn with_volumes(volumes: Volumes, camera: Camera) -> Scene {
    let mut scene = scene(once(&floor()), camera);
    scene.volumes = Some(Arc::new(volumes));
    scene
}

/// Seconds of a picture with so many rays a pixel, the least of three.
fn seconds(scene: &Scene, size: [u32; 2], rays: u32) -> f64 {
    let time = |_| {
        let start = Instant::now();
        drawn(scene, size, 0..rays);
        start.elapsed().as_secs_f64()
    };
    (0..3).map(time).fold(f64::MAX, f64::min)
}

/// Land of 2 x 2 with `side` trees along each side, seen from beside.
fn land_camera() -> Camera {
    Camera { eye: Vec3::new(0.0, 0.7, 1.9), target: Vec3::new(0.0, -0.1, 0.1), up: Vec3::Y, fov_deg: 45.0 }
}

fn pattern() -> Pattern {
    Pattern::isolated(0, JITTER, 3)
}

fn land_skin(tree: &Tree, side: u32) -> Volumes {
    let texel = 2.0 / side as f32;
    let vertex = |x: u32, y: u32| {
        let [u, v] = [x, y].map(|x| x as f32);
        SkinVertex::new(Vec3::new(u * texel - 1.0, 0.0, 1.0 - v * texel), Vec3::Y * texel, [u, v])
    };
    let skin = Skin::from_grid(side, side, vertex, |_, _| 0).expect("a skin");
    let skin = SceneSkin::new(skin, &ShellParams::default(), vec![pattern()], 0.0).expect("a shell");
    Volumes::new(vec![tree.voltex.clone()], &[], vec![skin]).expect("volumes")
}

/// Returns the matrices that place the trees of the land one by one, from the volume's cube to the world.
fn land_places(side: u32) -> Vec<Mat4> {
    let texel = 2.0 / side as f32;
    // Texture: u to the east, v to the north, w up.
    let world_from_texture = Mat4::from_cols(
        Vec3::new(texel, 0.0, 0.0).extend(0.0),
        Vec3::new(0.0, 0.0, -texel).extend(0.0),
        Vec3::new(0.0, texel, 0.0).extend(0.0),
        Vec3::new(-1.0, 0.0, 1.0).extend(1.0),
    );
    let place = |variant: Variant| {
        let [x, y, z] = variant.volume_from_texture().map(glam::Vec4::from);
        world_from_texture * Mat4::from_cols(x, y, z, glam::Vec4::W).transpose().inverse()
    };
    let cells = (0..side as i32).flat_map(|i| (0..side as i32).map(move |j| [i, j]));
    cells.filter_map(|cell| pattern().variant(cell)).map(place).collect()
}

fn growth_and_equal_error(tree: &Tree, size: [u32; 2]) {
    println!(
        "| trees | rays a pixel of volumes | s | relative error | triangles' errors by rays | rays of triangles for the same | s | these take |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let mut times = Vec::new();
    for side in SIDES {
        let skin = with_volumes(land_skin(tree, side), land_camera());
        let triangles = with_triangles(tree, side);
        let explicit = Explicit::new(&triangles, size, TRUTH, 0);
        let ray_s = seconds(&triangles, size, 4) / 4.0;
        let curve: Vec<String> = explicit.curve().iter().map(|(rays, error)| format!("{rays}: {error:.3}")).collect();
        for rays in [1, 4, 16] {
            let volume_s = seconds(&skin, size, rays);
            let error = explicit.error(&drawn(&skin, size, 0..rays));
            let needed = explicit.rays_for(error);
            println!(
                "| {} | {rays} | {volume_s:.3} | {error:.3} | {} | {needed:.0} | {:.3} | {:.1} x |",
                side * side,
                curve.join(", "),
                needed * ray_s,
                needed * ray_s / volume_s
            );
            times.extend((rays == 1).then_some(volume_s));
        }
    }
    println!(
        "\n{} trees take {:.2} x the time of {}, one ray a pixel",
        SIDES[1].pow(2),
        times[1] / times[0],
        SIDES[0].pow(2)
    );
}

/// Returns the scene of the land with the trees' triangles.
fn with_triangles(tree: &Tree, side: u32) -> Scene {
    let model_from_cube = standing(&tree.voltex, Vec3::ZERO, 0.0, 1.0);
    let places = land_places(side).iter().map(|place| *place * model_from_cube.inverse()).collect();
    let trees = SceneMesh { objects: objects(&tree.parts), places };
    let floor = SceneMesh { objects: objects(&floor()), places: vec![Mat4::IDENTITY] };
    scene(vec![trees, floor], land_camera())
}

/// Root mean square over pixels of the standard deviation over the frames of a pan.
fn noise(scene: &Scene, samples: u32) -> f64 {
    let frame = scene.camera.frame(PAN_SIZE[0], PAN_SIZE[1]);
    let distance = (scene.camera.target - scene.camera.eye).length();
    let step = frame.right.normalize() * frame.pixel_width() * distance * PAN.1;
    let pictures: Vec<Radiance> = (0..PAN.0)
        .map(|number| {
            let mut moved = scene.clone();
            moved.camera.eye += step * number as f32;
            moved.camera.target += step * number as f32;
            drawn(&moved, PAN_SIZE, 0..samples)
        })
        .collect();
    let variance = |pixel: usize| {
        let values = || pictures.iter().map(|picture| f64::from(picture[pixel][1]));
        let mean = values().sum::<f64>() / pictures.len() as f64;
        values().map(|value| (value - mean).powi(2)).sum::<f64>() / pictures.len() as f64
    };
    let pixels = pictures[0].len();
    ((0..pixels).map(variance).sum::<f64>() / pixels as f64).sqrt()
}

fn noise_of_pans(tree: &Tree) {
    println!("\n| tree high, pixels | what should change | volume at 1, 4, 16 rays | triangles at 1, 4, 16 rays |");
    println!("|---|---|---|---|");
    let side = tree.voltex.side_m();
    for pixels in [64.0, 16.0] {
        let fov_deg = 12.0f32;
        let distance = side * 0.5 / (0.5 * fov_deg).to_radians().tan() * PAN_SIZE[1] as f32 / pixels;
        let target = Vec3::Y * 0.5 * side;
        let eye = target + Vec3::new(0.3, 0.25, 1.0).normalize() * distance;
        let camera = Camera { eye, target, up: Vec3::Y, fov_deg };
        let explicit = scene(once(&tree.parts), camera);
        let place =
            VolumePlace { volume: 0, world_from_volume: standing(&tree.voltex, Vec3::ZERO, 0.0, 1.0), leaf_width: 0.0 };
        // Nothing else: the floor lies out of the picture.
        let speck = btf_viewer::quad("speck", Vec3::NEG_Y * 1e4, Vec3::X, Vec3::Z);
        let mut volume = scene(once(&[speck]), camera);
        volume.volumes =
            Some(Arc::new(Volumes::new(vec![tree.voltex.clone()], &[place], Vec::new()).expect("volumes")));
        let truth = noise(&explicit, TRUTH);
        let of = |scene: &Scene| [1, 4, 16].map(|rays| format!("{:.2}", noise(scene, rays) / truth)).join(", ");
        println!("| {pixels} | {truth:.4} | x {} | x {} |", of(&volume), of(&explicit));
    }
}

/// Runs the study.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let numbers: Vec<u32> = arguments.iter().filter_map(|argument| argument.parse().ok()).collect();
    let side = numbers.first().copied().unwrap_or(256);
    let tree = grown();
    growth_and_equal_error(&tree, [side, side * 3 / 4]);
    noise_of_pans(&tree);
    Ok(())
}
