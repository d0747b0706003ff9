//! Motion leads to where things were.

use super::motion_picture::{BACKGROUND_DEPTH, MotionPicture, MotionPixel};
use super::pose::Pose;
use super::vectors::{Seen, motion_of, of_most};
use crate::error::ViewerError;
use crate::gpu::backend::BackendChoice;
use crate::options::ShadeOptions;
use crate::picture::Picture;
use crate::render::control::Control;
use crate::render::headless::{RenderParams, Rendered, Sequence, render, render_sequence};
use crate::scene::camera::Camera;
use crate::scene::landscape::{Landscape, LandscapeParams};
use crate::scene::material::{Material, Shown};
use crate::scene::mesh;
use crate::scene::scene::{PointLight, Scene, SceneObject};
use crate::scene::volume::load_volume;
use crate::volume::skin::{Pattern, ShellParams, Skin, SkinVertex, Wind};
use crate::volume::volumes::{SceneSkin, SkinTet, Volumes};
use glam::{DMat3, DVec2, DVec3, Mat4, Vec2, Vec3, Vec4};
use std::path::Path;
use std::sync::Arc;

/// Draws a sequence on the CPU, with motion.
fn drawn(scene: &Scene, size: [u32; 2], frames: u32, sequence: &Sequence) -> Vec<Rendered> {
    let params = RenderParams { size, frames, backend: BackendChoice::Cpu, motion: true, ..RenderParams::default() };
    let mut all = Vec::new();
    render_sequence(scene, &params, sequence, &Control::SILENT, &mut |_, rendered| {
        all.push(rendered);
        Ok(())
    })
    .unwrap();
    all
}

/// A plane with patches of noise some pixels wide, under a lamp that stays.
fn noisy_plane() -> Scene {
    let material = Material { noise: Some([0.0; 3]), uv_scale: [8e-4; 2], ..Material::plain([0.8; 3]) };
    let object = SceneObject { part: mesh::plane(), material };
    let mut scene = Scene::from_objects(Path::new("plane"), vec![object], Shown::default()).unwrap();
    scene.camera = Camera { eye: Vec3::new(0.4, -0.9, 2.0), target: Vec3::ZERO, up: Vec3::Y, fov_deg: 40.0 };
    scene
}

/// Grass on a hill of patches a metre wide, over black ground and under a lamp, in a wind whose flutter is given.
fn meadow(flutter: f32) -> Scene {
    const SIDE: u32 = 8;
    let mut ground = mesh::plane();
    let up = Mat4::from_rotation_x(-std::f32::consts::FRAC_PI_2);
    ground.transform(Mat4::from_translation(Vec3::new(4.0, -2.0, 4.0)) * up * Mat4::from_scale(Vec3::splat(40.0)));
    let object = SceneObject { part: ground, material: Material::plain([0.0; 3]) };
    let mut scene = Scene::from_objects(Path::new("meadow"), vec![object], Shown::default()).unwrap();
    let vertex = |x: u32, z: u32| {
        let [x, z] = [x as f32, z as f32];
        SkinVertex::new(Vec3::new(x, 0.7 * (0.5 * x).sin() * (0.4 * z).sin(), z), Vec3::Y, [x, -z])
    };
    let rest = Skin::from_grid(SIDE, SIDE, vertex, |_, _| 0).unwrap();
    let params = ShellParams { tolerance: 0.02, ..ShellParams::default() };
    let skin = SceneSkin::new(rest, &params, vec![Pattern::cyclic(0)], 0.0).unwrap();
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/src/scene/builtin/lawn_flower.voltex");
    let volume = load_volume(Path::new(file)).unwrap();
    scene.volumes = Some(Arc::new(Volumes::new(vec![volume], &[], vec![skin]).unwrap()));
    let wind =
        Wind { speed_m_per_s: 6.0, gust_wavelength_m: 6.0, leaning_speed_m_per_s: 8.0, flutter, ..Wind::default() };
    scene.wind = Some(wind);
    scene.camera =
        Camera { eye: Vec3::new(4.0, 7.0, 13.0), target: Vec3::new(4.0, 0.7, 4.5), up: Vec3::Y, fov_deg: 30.0 };
    // Behind the eye, so that shadows are where they are seen least.
    scene.lights = vec![PointLight { position: Vec3::new(4.0, 40.0, 50.0), intensity: [12_000.0; 3] }];
    scene
}

/// Returns the root mean square differences of a picture from the picture before: from that moved to where the motion
/// times `factor` leads, and from that as it is. Pixels that come from outside or move less than `least` pixels do not
/// count.
fn differences(before: &Picture, now: &Picture, motion: &MotionPicture, factor: f32, least: f32) -> [f64; 2] {
    let [width, height] = [now.width as i32, now.height as i32];
    let at = |x: i32, y: i32| Vec3::from(before.radiance[(y * width + x) as usize]);
    let (mut count, mut sums) = (0, [0.0; 2]);
    for (pixel, MotionPixel { motion: [dx, dy], .. }) in (0..).zip(&motion.pixels) {
        let (x, y) = (pixel % width, pixel / width);
        let (from_x, from_y) = (x as f32 + factor * dx, y as f32 + factor * dy);
        let (i, j) = (from_x.floor() as i32, from_y.floor() as i32);
        if !(0..width - 1).contains(&i) || !(0..height - 1).contains(&j) || dx.hypot(*dy) < least {
            continue;
        }
        let (u, v) = (from_x - i as f32, from_y - j as f32);
        let warped = at(i, j).lerp(at(i + 1, j), u).lerp(at(i, j + 1).lerp(at(i + 1, j + 1), u), v);
        let here = Vec3::from(now.radiance[pixel as usize]);
        sums[0] += f64::from(here.distance_squared(warped));
        sums[1] += f64::from(here.distance_squared(at(x, y)));
        count += 1;
    }
    assert!(count > now.radiance.len() / 8, "{count}");
    sums.map(|sum| (sum / count as f64).sqrt())
}

/// A camera in double precision: where it is, to the right, down and forwards.
struct DoubleCamera {
    eye: DVec3,
    axes: DMat3,
    /// Pixels at distance 1.
    focal: f64,
    middle: DVec2,
}

impl DoubleCamera {
    fn new(eye: DVec3, target: DVec3, fov_deg: f64, [width, height]: [u32; 2]) -> DoubleCamera {
        let forward = (target - eye).normalize();
        let right = forward.cross(DVec3::Y).normalize();
        let middle = 0.5 * DVec2::new(f64::from(width), f64::from(height));
        let focal = middle.min_element() / (0.5 * fov_deg).to_radians().tan();
        DoubleCamera { eye, axes: DMat3::from_cols(right, forward.cross(right), forward), focal, middle }
    }

    /// Returns the direction through a place of the picture, as long as 1 along the axis.
    fn direction(&self, place: DVec2) -> DVec3 {
        self.axes * ((place - self.middle) / self.focal).extend(1.0)
    }

    fn place(&self, towards: DVec3) -> DVec2 {
        let seen = self.axes.transpose() * towards;
        self.middle + self.focal * seen.truncate() / seen.z
    }
}

#[test]
fn motion_of_a_plane_and_of_the_sky_is_that_of_the_formula() {
    let (scene, size, turn) = (noisy_plane(), [40, 30], 0.07);
    let sequence = Sequence { pictures: 2, turn_rad: turn as f32, interval_s: 0.0 };
    let pictures = drawn(&scene, size, 1, &sequence);
    let (eye, target) = (scene.camera.eye.as_dvec3(), scene.camera.target.as_dvec3());
    let camera =
        |angle: f64| DoubleCamera::new(target + DMat3::from_rotation_y(angle) * (eye - target), target, 40.0, size);
    // How far the pixels of picture `number` are from the formula, pixels, at most; and its depths, as a share.
    let off = |number: usize, turn: f64, sign: f64| {
        let angle = number as f64 * 0.07;
        let (now, before) = (camera(angle), camera(angle - turn));
        let (mut on_plane, mut worst) = (0, [0f64; 2]);
        for (pixel, found) in (0..).zip(&pictures[number].motion.as_ref().unwrap().pixels) {
            let place = DVec2::new(f64::from(pixel % size[0]) + 0.5, f64::from(pixel / size[0]) + 0.5);
            let direction = now.direction(place);
            let depth = -now.eye.z / direction.z;
            let point = now.eye + depth * direction;
            let edge = 1.0 - point.truncate().abs().max_element();
            if edge.abs() < 1e-4 {
                continue;
            }
            let there = if edge > 0.0 { before.place(point - before.eye) } else { before.place(direction) };
            let [x, y] = found.motion.map(f64::from);
            worst[0] = worst[0].max((sign * (there - place) - DVec2::new(x, y)).length());
            let wanted = if edge > 0.0 { depth } else { f64::from(BACKGROUND_DEPTH) };
            worst[1] = worst[1].max((f64::from(found.depth) / wanted - 1.0).abs());
            on_plane += u32::from(edge > 0.0);
        }
        assert!(on_plane > 400 && on_plane < 1100, "{on_plane}");
        worst
    };
    for number in [0, 1] {
        let [motion, depth] = off(number, turn, 1.0);
        assert!(motion < 1e-3 && depth < 1e-5, "{number}: {motion} {depth}");
        // Planted: the other way, a turn that is a hundredth larger, and none.
        for (turn, sign) in [(turn, -1.0), (1.01 * turn, 1.0), (0.0, 1.0)] {
            assert!(off(number, turn, sign)[0] > 0.01);
        }
    }
}

#[test]
fn the_picture_before_moved_by_its_motion_is_the_picture() {
    let sequence = Sequence { pictures: 2, turn_rad: 0.08, interval_s: 0.0 };
    let pictures = drawn(&noisy_plane(), [64, 64], 4, &sequence);
    let motion = pictures[1].motion.as_ref().unwrap();
    let [before, now] = [0, 1].map(|number| &pictures[number].picture);
    let [warped, still] = differences(before, now, motion, 1.0, 0.5);
    assert!(warped < 0.4 * still, "{warped} {still}");
    // Planted: the other way, and half of the way.
    for factor in [-1.0, 0.5] {
        let [wrong, still] = differences(before, now, motion, factor, 0.5);
        assert!(wrong > 0.4 * still, "{factor}: {wrong} {still}");
    }
}

#[test]
fn grass_in_the_wind_is_found_where_it_was() {
    let mut scene = meadow(0.05);
    scene.blow(7.0).unwrap();
    let sequence = Sequence { pictures: 2, turn_rad: 0.0, interval_s: 0.2 };
    let pictures = drawn(&scene, [120, 80], 1, &sequence);
    let motion = pictures[1].motion.as_ref().unwrap();
    let [before, now] = [0, 1].map(|number| &pictures[number].picture);
    let [warped, still] = differences(before, now, motion, 1.0, 0.3);
    assert!(warped < 0.6 * still, "{warped} {still}");
    // Planted: the other way, nowhere, and half of the way.
    for factor in [-1.0, 0.0, 0.5] {
        let [wrong, still] = differences(before, now, motion, factor, 0.3);
        assert!(wrong > 0.6 * still, "{factor}: {wrong} {still}");
    }
    // A sequence that begins there has the same motion: the wind is known before it, too.
    scene.blow(7.2).unwrap();
    let first = drawn(&scene, [120, 80], 1, &Sequence { pictures: 1, ..sequence }).remove(0).motion.unwrap();
    let apart = |(a, b): (&MotionPixel, &MotionPixel)| Vec2::from(a.motion).distance(b.motion.into());
    let worst = first.pixels.iter().zip(&motion.pixels).map(apart).fold(0.0, f32::max);
    assert!(worst < 1e-2, "{worst}");
}

#[test]
fn points_of_a_skin_are_followed_to_where_the_wind_had_them() {
    let mut scene = meadow(0.0);
    for flutter in [0.0, 0.1] {
        let wind = Wind { flutter, ..scene.wind.unwrap() };
        scene.wind = Some(wind);
        scene.blow(3.0).unwrap();
        let earlier = scene.volumes.clone().unwrap();
        let before = Pose::of(&scene);
        scene.blow(3.2).unwrap();
        let volumes = scene.volumes.as_ref().unwrap();
        let skin = &volumes.skins()[0];
        let [then, now] = [3.0, 3.2].map(|time| wind.displace(&skin.rest, time).unwrap());
        let (mut count, mut worst, mut moved) = (0, 0f64, 0f64);
        // By all of its shells in turn.
        for (number, (then, now)) in then.vertices().iter().zip(now.vertices()).enumerate() {
            let level = number % skin.levels.len();
            let point = now.position + 0.7 * now.height;
            let Some(tet) = skin.levels[level].shell.locate(point) else { continue };
            let found = before.of_skin(volumes, SkinTet { skin: 0, level, tet }, point.as_dvec3());
            let thickness = f64::from(now.height.length());
            if flutter == 0.0 {
                let there = (then.position + 0.7 * then.height).as_dvec3();
                worst = worst.max(found.distance(there) / thickness);
            } else {
                // The texture swings within the skin: the point that has the same texel now.
                let texel = earlier.skins()[0].levels[level].shell.map(tet).point(found.as_vec3());
                worst = worst.max(f64::from(texel.distance(now.texture + 0.7 * now.rise)));
            }
            moved = moved.max(found.distance(point.as_dvec3()) / thickness);
            count += 1;
        }
        // Planted: where they are now is elsewhere.
        assert!(count > 20 && worst < 2e-3 && moved > 0.02, "{flutter}: {count} {worst} {moved}");
    }
}

#[test]
fn models_in_the_wind_are_followed_by_their_instances() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("flag.obj");
    std::fs::write(&file, "v 0 0 0\nv 0.5 0 0\nv 0 5 0\nf 1 2 3\n").unwrap();
    let params = LandscapeParams { times: 1, volumes: vec![], meshes: vec![file], wind_m_per_s: Some(30.0) };
    let (mut scene, _) = Landscape::Grove.scene(&params).unwrap();
    let (before, geometry_before) = (Pose::of(&scene), scene.geometry.clone());
    scene.blow(3.0).unwrap();
    let (mut worst, mut moved) = (0f64, 0f64);
    for instance in 0..scene.geometry.instances().len() {
        let at = Vec4::new(0.1, 4.0, 0.0, 1.0);
        let [then, now] = [&geometry_before, &scene.geometry].map(|geometry| {
            let rows = geometry.instances()[instance].world_from_object;
            Vec3::from(rows.map(|row| Vec4::from(row).dot(at))).as_dvec3()
        });
        let found = before.of_instance(&scene.geometry, instance, now);
        worst = worst.max(found.distance(then));
        moved = moved.max(found.distance(now));
    }
    assert!(worst < 1e-3 && moved > 0.1, "{worst} {moved}");
}

#[test]
fn a_pixel_on_an_edge_has_the_motion_of_the_thing_that_fills_more_of_it() {
    let seen = |nearness: f64, x: f64| Seen { nearness, motion: DVec2::new(x, 0.0) };
    let mut edge = vec![seen(0.0, 9.0), seen(0.5, 1.0), seen(0.0, 9.0), seen(0.51, 2.0), seen(0.5, 3.0)];
    let pixel = of_most(&mut edge);
    assert_eq!(pixel.motion, [2.0, 0.0]);
    assert!((pixel.depth - 1.99).abs() < 0.01);
    let mut sky = vec![seen(0.0, 4.0), seen(0.5, 1.0), seen(0.0, 6.0)];
    assert_eq!(of_most(&mut sky), MotionPixel { motion: [5.0, 0.0], depth: BACKGROUND_DEPTH });
}

#[test]
fn motion_is_told_only_on_request_and_can_be_interrupted() {
    let (scene, shade) = (noisy_plane(), ShadeOptions::default());
    let asked = |cancelled| motion_of(&scene, &Pose::of(&scene), [8, 6], &shade, 2, &|| cancelled);
    // Nothing moves.
    assert!(asked(false).unwrap().pixels.iter().all(|pixel| pixel.motion == [0.0; 2]));
    assert!(matches!(asked(true), Err(ViewerError::Interrupted)));
    let params = RenderParams { size: [8, 6], backend: BackendChoice::Cpu, ..RenderParams::default() };
    assert_eq!(render(&scene, &params, &Control::SILENT).unwrap().motion, None);
}

#[test]
fn what_was_behind_the_eye_has_left_the_picture() {
    let mut scene = noisy_plane();
    let mut before = Pose::of(&scene);
    // The camera has flown backwards through all that it now sees.
    before.camera.fly([0.0, 0.0, 5.0]);
    scene.camera.eye += Vec3::Z;
    let motion = motion_of(&scene, &before, [8, 6], &ShadeOptions::default(), 1, &|| false).unwrap();
    let on_plane: Vec<_> = motion.pixels.iter().filter(|pixel| pixel.depth < BACKGROUND_DEPTH).collect();
    assert!(on_plane.len() > 8);
    for MotionPixel { motion: [x, y], .. } in on_plane {
        assert!(x.abs().max(y.abs()) > 8.0 && x.abs() <= 65504.0 && y.abs() <= 65504.0, "{x} {y}");
    }
}
