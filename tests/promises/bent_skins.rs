//! What a volume hides on a bent skin is what its triangles hide when they are bent with it: sheared, twisted, combed.

use btf_fit::voltex::build::{Frame, VoltexParams, build_voltex};
use btf_fit::voltex::flakes::FlakeColour;
use btf_fit::voltex::model::TriangleModel;
use btf_fit::voltex::occluder::Occluder;
use btf_runtime::testing::Random;
use btf_runtime::voltex::Voltex;
use btf_viewer::{HandOver, Pattern, SceneSkin, Shell, ShellParams, Skin, SkinVertex, Volumes};
use glam::Vec3;
use std::sync::Arc;

/// Texels along each side of the skin.
const SIDE: u32 = 4;
/// Pixels along each side of a picture, and rays along each side of a pixel for the triangles.
const PIXELS: usize = 32;
const RAYS: usize = 8;
/// What bending may add to the error of what is hidden.
const MORE: f64 = 0.01;

type Bend = fn(Vec3) -> [Vec3; 2];

/// Position and height vector of a corner of the grid.
const BENDS: [(&str, Bend); 4] = [
    ("flat", |p| [p, Vec3::Z]),
    ("sheared", |p| [p, Vec3::new(0.4, -0.3, 1.0)]),
    ("twisted", |p| {
        let lift = 0.5 * (p.x * 1.1).sin() * (p.y * 0.9).cos();
        [p + Vec3::Z * lift, Vec3::new(0.1 * p.y.sin(), 0.0, 1.0)]
    }),
    ("combed", |p| [p, Vec3::new(0.7 * (0.9 * p.x).sin(), 0.4 * (1.3 * p.y + p.x).cos(), 1.0)]),
];

/// Square leaves that leave no side of the unit cube.
fn leaves() -> Vec<[Vec3; 3]> {
    let mut random = Random::new(11);
    let mut vector = |reach: f32| Vec3::from([0; 3].map(|_| random.within(-reach, reach)));
    let mut all = Vec::new();
    for _ in 0..90 {
        let (at, x) = (Vec3::splat(0.5) + vector(0.42), vector(1.0).normalize());
        let y = x.cross(vector(1.0)).normalize();
        let [a, b, c, d] =
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(u, v): (f32, f32)| at + (x * u + y * v) * 0.055);
        all.extend([[a, b, c], [a, c, d]]);
    }
    all
}

/// The trilinear map of texel (i, j) at (u, v, w), all within it.
fn bent(bend: Bend, cell: [u32; 2], at: Vec3) -> Vec3 {
    let corner = |x: u32, y: u32| {
        let [base, height] = bend(Vec3::new((cell[0] + x) as f32, (cell[1] + y) as f32, 0.0));
        base + height * at.z
    };
    let along = |y: u32| corner(0, y).lerp(corner(1, y), at.x);
    along(0).lerp(along(1), at.y)
}

/// Root mean square error of the share of light that passes, over pixels that are not clear in both.
fn transmittance_error(bend: Bend, volume: &Arc<Voltex>, leaves: &[[Vec3; 3]], swap: bool) -> f64 {
    let vertex = |x: u32, y: u32| {
        let [base, height] = bend(Vec3::new(x as f32, y as f32, 0.0));
        SkinVertex::new(
            base,
            if swap { Vec3::new(-height.x, height.y, height.z) } else { height },
            [x as f32, y as f32],
        )
    };
    let skin = Skin::from_grid(SIDE, SIDE, vertex, |_, _| 0).unwrap();
    let shell = Shell::new(&skin, &ShellParams::default()).unwrap();
    let skin = SceneSkin { rest: skin, shell, patterns: vec![Pattern::cyclic(0)], leaf_width: 0.0 };
    let volumes = Volumes::new(vec![volume.clone()], &[], vec![skin]).unwrap();
    let cells = (0..SIDE).flat_map(|i| (0..SIDE).map(move |j| [i, j]));
    let copies: Vec<[Vec3; 3]> =
        cells.flat_map(|cell| leaves.iter().map(move |corners| corners.map(|at| bent(bend, cell, at)))).collect();
    let occluder = Occluder::new(&copies);
    let (mut sum, mut count) = (0.0, 0usize);
    for direction in [Vec3::new(0.3, 0.2, -1.0), Vec3::new(-0.8, 0.5, -1.0), Vec3::new(0.9, 0.1, -0.5)] {
        let direction = direction.normalize();
        let (right, up) = direction.any_orthonormal_pair();
        let middle = Vec3::new(0.5 * SIDE as f32, 0.5 * SIDE as f32, 0.5);
        let width = SIDE as f32 / PIXELS as f32;
        let origin = |x: f32, y: f32| {
            let [x, y] = [x, y].map(|x| (x - 0.5 * PIXELS as f32) * width);
            middle + right * x + up * y - direction * 20.0
        };
        for pixel in 0..PIXELS * PIXELS {
            let [x, y] = [pixel % PIXELS, pixel / PIXELS].map(|x| x as f32);
            let places = |n: usize| {
                let at = move |i: usize| (i as f32 + 0.5) / n as f32;
                (0..n * n).map(move |i| [at(i % n), at(i / n)])
            };
            let passed =
                |[s, t]: [f32; 2]| f64::from(u8::from(!occluder.occluded(origin(x + s, y + t), direction, 40.0)));
            let truth = places(RAYS).map(passed).sum::<f64>() / (RAYS * RAYS) as f64;
            let seen = |[s, t]: [f32; 2]| {
                f64::from(volumes.see(
                    origin(x + s, y + t),
                    direction,
                    40.0,
                    &HandOver::MESHES,
                    |_| 0.5 * width,
                    |_| (),
                ))
            };
            let found = places(4).map(seen).sum::<f64>() / 16.0;
            if truth < 1.0 || found < 0.999 {
                sum += (found - truth).powi(2);
                count += 1;
            }
        }
    }
    (sum / count as f64).sqrt()
}

#[test]
fn bent_volumes_hide_what_bent_triangles_hide() {
    let leaves = leaves();
    let mut model = TriangleModel {
        // Two specks at opposite corners, so that the model's cube is the texel.
        triangles: [Vec3::ZERO, Vec3::ONE].map(|at| [at; 3]).into(),
        materials: vec![0; leaves.len() + 2],
        colours: vec![FlakeColour::default()],
        weights: vec![1.0],
    };
    model.triangles.extend(&leaves);
    let frame = Frame::around(model.bounds()).unwrap();
    let volume = build_voltex(&model, &VoltexParams { resolution: 32, ..VoltexParams::default() }).unwrap();
    let volume = Arc::new(Voltex::new(&volume));
    // What the cube's margin moves.
    let leaves: Vec<_> = leaves.iter().map(|corners| corners.map(|at| frame.cube_from_m(at))).collect();
    let errors = BENDS.map(|(name, bend)| (name, transmittance_error(bend, &volume, &leaves, false)));
    let flat = errors[0].1;
    assert!(flat < 0.08, "{flat}");
    for (name, error) in errors {
        assert!(error <= flat + MORE, "{name}: {error}, flat {flat}");
    }
    // Planted: combed the other way.
    let combed_back = transmittance_error(BENDS[3].1, &volume, &leaves, true);
    assert!(combed_back > flat + 2.0 * MORE, "{combed_back}");
}
