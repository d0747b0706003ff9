//! A leaf in a scene: each tracer takes the layer of the sides that light and eye are on, lets light through where the
//! asset has a transmission layer, and mirrors nothing. The expected pictures are made from the plane's equation.
//! The CPU is always tested; a missing GPU is a failure, unless `BTF_SKIP_GPU=1` is set.

use crate::support::backends;
use btf_runtime::testing::sample_asset;
use btf_runtime::{Asset, DecodeOptions, Layer, Resident, ResidualKind, SurfaceSide, decode, pack};
use btf_viewer::testing::jitter;
use btf_viewer::{
    BackendChoice, Camera, Control, Material, PointLight, RenderParams, Scene, SceneAsset, SceneObject, plane, quad,
    render,
};
use glam::Vec3;
use std::f32::consts::PI;
use std::path::Path;
use std::sync::Arc;

const SIZE: [u32; 2] = [48, 40];
const TEXELS: [usize; 2] = [12, 8];
/// Where the eye is, in front and behind: off the axes, so that no mirroring goes unseen.
const EYES: [Vec3; 2] = [Vec3::new(0.7, 0.5, 3.0), Vec3::new(0.9, -0.4, -3.0)];
/// Where the light is, in front and behind.
const LIGHTS: [Vec3; 2] = [Vec3::new(-1.2, 1.6, 1.5), Vec3::new(1.4, 0.8, -1.7)];
const INTENSITY: [f32; 3] = [9.0, 10.0, 11.0];
/// Pixels that may differ: nearest texels flip where rounding does.
const ALLOWED: usize = (SIZE[0] * SIZE[1]) as usize / 200;

/// An asset with these layers (light behind, eye behind), each with numbers of its own.
fn asset(sides: &[(bool, bool)]) -> Asset {
    let side = |back: bool| if back { SurfaceSide::Back } else { SurfaceSide::Front };
    let layer = |(light_back, eye_back): (bool, bool)| {
        let seed = 60 + 2 * u64::from(light_back) + u64::from(eye_back);
        let source = sample_asset(seed, TEXELS[0], TEXELS[1], ResidualKind::Root).layers.remove(0);
        Layer { light_side: side(light_back), view_side: side(eye_back), ..source }
    };
    let whole = sample_asset(1, TEXELS[0], TEXELS[1], ResidualKind::Root);
    let asset = Asset { layers: sides.iter().copied().map(layer).collect(), ..whole };
    Asset::parse(&pack(&asset).unwrap()).unwrap()
}

/// Factors on what the asset reflects and transmits.
const TINT: [f32; 3] = [0.7, 1.3, 0.9];

/// In an order that is not the sides' own.
const ALL_SIDES: [(bool, bool); 4] = [(true, false), (true, true), (false, false), (false, true)];

/// The plane z = 0 with an asset, and other objects; light and eye behind or in front.
fn scene(asset: &Asset, others: Vec<SceneObject>, light_back: bool, eye_back: bool) -> Scene {
    let material = Material { tint: TINT, ..Material::from_asset(0, [1.0; 2]) };
    let leaf = SceneObject { part: plane(), material };
    let objects = std::iter::once(leaf).chain(others).collect();
    let assets = vec![Arc::new(SceneAsset::new("leaf", asset.clone()))];
    let mut scene = Scene::from_objects(Path::new("leaf"), objects, assets).unwrap();
    scene.lights = vec![PointLight { position: LIGHTS[usize::from(light_back)], intensity: INTENSITY }];
    let eye = EYES[usize::from(eye_back)];
    scene.camera = Camera { eye, target: Vec3::ZERO, up: Vec3::Y, fov_deg: 45.0 };
    scene.background = [0.0; 3];
    scene
}

fn draw(scene: &Scene, backend: BackendChoice) -> Vec<[f32; 3]> {
    let params = RenderParams { size: SIZE, backend, ..RenderParams::default() };
    render(scene, &params, &Control::SILENT).unwrap().picture.radiance
}

/// What is left out of the expected picture, as a planted mistake.
#[derive(Clone, Copy, PartialEq)]
enum Slip {
    None,
    /// Columns the other way round on a face seen from behind.
    Columns,
    /// x the other way round on a face seen from behind.
    X,
    /// The layer of the other light side.
    Light,
}

/// The picture by the equation of the plane: x and y of the world are those of the tangent frame on both faces.
fn expected(asset: &Asset, scene: &Scene, slip: Slip) -> Vec<[f32; 3]> {
    let resident = Resident::from_asset(asset);
    let camera = scene.camera.frame(SIZE[0], SIZE[1]);
    let light = scene.lights[0].position;
    let pixel = |index: u32| {
        let ray = camera.direction(index % SIZE[0], index / SIZE[0], jitter(0));
        let p = camera.eye - ray * (camera.eye.z / ray.z);
        let (u, v) = ((p.x + 1.0) / 2.0, (p.y + 1.0) / 2.0);
        if !(0.0..1.0).contains(&u) || !(0.0..1.0).contains(&v) {
            return [0.0; 3];
        }
        let (mut wi, mut wo) = ((light - p).normalize(), -ray);
        let eye_back = wo.z < 0.0;
        let mut column = (u * TEXELS[0] as f32) as usize;
        if slip == Slip::Columns && eye_back {
            column = TEXELS[0] - 1 - column;
        }
        if slip == Slip::X && eye_back {
            (wi.x, wo.x) = (-wi.x, -wo.x);
        }
        if slip == Slip::Light {
            wi.z = -wi.z;
        }
        let row = ((1.0 - v) * TEXELS[1] as f32) as usize;
        let texel = (row * TEXELS[0] + column) as u32;
        let Some(layer) = resident.layer_for_sides(0, (wi.z < 0.0).into(), eye_back.into()) else { return [0.0; 3] };
        let value = decode(&resident, layer, texel, wi.to_array(), wo.to_array(), &DecodeOptions::default());
        let distance2 = (light - p).length_squared();
        [0, 1, 2].map(|c| INTENSITY[c] * TINT[c] * value[c] / (PI * distance2))
    };
    (0..SIZE[0] * SIZE[1]).map(pixel).collect()
}

fn differences(a: &[[f32; 3]], b: &[[f32; 3]]) -> usize {
    // As in gpu.rs: half-precision bases are steps of 2^-11, the drivers' powers and exponentials round.
    let close = |a: f32, b: f32| (a - b).abs() <= 2e-3 + 2e-3 * a.abs();
    a.iter().zip(b).filter(|(a, b)| !(0..3).all(|c| close(a[c], b[c]))).count()
}

fn lit(picture: &[[f32; 3]]) -> usize {
    picture.iter().filter(|pixel| pixel.iter().any(|x| *x > 1e-3)).count()
}

#[test]
fn every_combination_of_light_side_and_eye_side_shows_its_layer_unmirrored() {
    let asset = asset(&ALL_SIDES);
    for backend in backends("every_combination_of_light_side_and_eye_side_shows_its_layer_unmirrored") {
        for (light_back, eye_back) in ALL_SIDES {
            let scene = scene(&asset, Vec::new(), light_back, eye_back);
            let found = draw(&scene, backend);
            let name = format!("{backend:?}, light behind: {light_back}, eye behind: {eye_back}");
            let truth = expected(&asset, &scene, Slip::None);
            assert!(lit(&truth) > truth.len() / 6, "{name}: the light shows");
            let off = differences(&truth, &found);
            assert!(off <= ALLOWED, "{name}: {off} pixels differ");
            for slip in [Slip::Columns, Slip::X, Slip::Light] {
                let planted = differences(&expected(&asset, &scene, slip), &found);
                let shows = slip == Slip::Light || eye_back;
                assert_eq!(planted > 10 * ALLOWED, shows, "{name}: {planted} pixels differ from a planted mistake");
            }
        }
    }
}

#[test]
fn a_missing_layer_is_black_and_the_leaf_opaque() {
    for backend in backends("a_missing_layer_is_black_and_the_leaf_opaque") {
        let front_only = asset(&[(false, false)]);
        for (light_back, eye_back) in ALL_SIDES {
            let found = draw(&scene(&front_only, Vec::new(), light_back, eye_back), backend);
            assert_eq!(lit(&found) > 0, (light_back, eye_back) == (false, false), "{backend:?}");
        }
    }
}

#[test]
fn what_stands_between_leaf_and_light_shadows_it_whatever_it_is_made_of() {
    let asset = asset(&ALL_SIDES);
    // A wall at z = -0.4 that hides the whole leaf from the light behind.
    let wall = |material| SceneObject {
        part: quad("wall", Vec3::new(-4.0, -4.0, -0.4), Vec3::X * 8.0, Vec3::Y * 8.0),
        material,
    };
    let plain = Material::plain([0.5; 3]);
    let leafy = Material::from_asset(0, [1.0; 2]);
    for backend in backends("what_stands_between_leaf_and_light_shadows_it_whatever_it_is_made_of") {
        let open = lit(&draw(&scene(&asset, Vec::new(), true, false), backend));
        assert!(open > 0);
        for material in [plain, leafy] {
            // Seen from the front, the leaf hides what the leafy wall itself lets through; look at the leaf's pixels.
            let scene = scene(&asset, vec![wall(material)], true, false);
            let found = draw(&scene, backend);
            let on_leaf = expected(&asset, &scene, Slip::None);
            let through = found.iter().zip(&on_leaf).filter(|(_, leaf)| leaf.iter().any(|x| *x > 1e-3));
            assert_eq!(through.filter(|(found, _)| found.iter().any(|x| *x > 0.0)).count(), 0, "{backend:?}");
        }
        // And a plain surface in front of the leaf stays dark: only what is hit by the eye's ray lets light through.
        let screen = SceneObject {
            part: quad("screen", Vec3::new(-0.3, -0.3, 0.2), Vec3::X * 0.6, Vec3::Y * 0.6),
            material: plain,
        };
        let mut behind_leaf = scene(&asset, vec![screen], true, true);
        behind_leaf.camera.eye = Vec3::new(0.1, 0.1, 0.15);
        behind_leaf.camera.target = Vec3::new(0.1, 0.1, 0.2);
        assert_eq!(lit(&draw(&behind_leaf, backend)), 0, "{backend:?}");
        // Planted difference: without the leaf in between the screen is lit.
        behind_leaf.lights[0].position = Vec3::new(0.1, 0.1, 0.1);
        assert!(lit(&draw(&behind_leaf, backend)) > 0, "{backend:?}");
    }
}
