//! What a volume hides on a bent skin, and what its triangles hide when they are bent with it: sheared, twisted,
//! combed.
//!
//! Prints the error of the share of light that passes a bent skin, docs/results/voltex.md, "Bent skins":
//! `cargo run --release -p btf-tests -- bent_skins [PIXELS]`.

use btf_runtime::testing::Random;
use btf_runtime::voltex::Voltex;
use btf_viewer::{LodTransition, Pattern, SceneSkin, ShellParams, Skin, SkinVertex, Volumes};
use btf_voxelize::{Frame, MicroflakeColour, Occluder, TriangleModel, VoltexParams, build_voltex};
use glam::Vec3;
use std::error::Error;
use std::sync::Arc;

/// Texels along each side of the skin.
const SIDE: u32 = 4;
/// Rays along each side of a pixel, for the triangles and for the volume.
const RAYS: [usize; 2] = [8, 4];

/// Position and height vector of a corner of the grid.
pub type Bend = fn(Vec3) -> [Vec3; 2];

/// The ways in which skins are bent, by their names.
pub const BENDS: [(&str, Bend); 4] = [
    ("flat", |p| [p, Vec3::Z]),
    ("sheared", |p| [p, Vec3::new(0.4, -0.3, 1.0)]),
    ("twisted", |p| {
        let lift = 0.5 * (p.x * 1.1).sin() * (p.y * 0.9).cos();
        [p + Vec3::Z * lift, Vec3::new(0.1 * p.y.sin(), 0.0, 1.0)]
    }),
    ("combed", |p| [p, Vec3::new(0.7 * (0.9 * p.x).sin(), 0.4 * (1.3 * p.y + p.x).cos(), 1.0)]),
];

/// Leaves and the volume made of them, both in the unit cube.
pub struct LeavesInCube {
    leaves: Vec<[Vec3; 3]>,
    volume: Arc<Voltex>,
}

impl LeavesInCube {
    /// The leaves, and their volume with 32 voxels a side.
    ///
    /// # Panics
    /// If they cannot be built: what asked for them has failed.
    pub fn built() -> LeavesInCube {
        let leaves = leaves();
        let mut model = TriangleModel {
            // Two specks at opposite corners, so that the model's cube is the texel.
            triangles: [Vec3::ZERO, Vec3::ONE].map(|at| [at; 3]).into(),
            materials: vec![0; leaves.len() + 2],
            colours: vec![MicroflakeColour::default()],
            weights: vec![1.0],
            ..TriangleModel::default()
        };
        model.triangles.extend(&leaves);
        let frame = Frame::around(model.bounds()).expect("a frame");
        let params = VoltexParams { resolution: 32, ..VoltexParams::default() };
        let volume = build_voltex(&model, &params).expect("a volume");
        // What the cube's margin moves.
        let leaves = leaves.iter().map(|corners| corners.map(|at| frame.cube_from_m(at))).collect();
        LeavesInCube { leaves, volume: Arc::new(Voltex::new(&volume)) }
    }

    /// Root mean square error of the share of light that passes, over pixels that are not clear in both: of leaves that
    /// are bent as
    /// `bend` says, and of a skin bent as `mapped` says, three views of `pixels` x `pixels`.
    ///
    /// # Panics
    /// As [`LeavesInCube::built`].
    pub fn transmittance_error(&self, bend: Bend, mapped: Bend, pixels: usize) -> f64 {
        let vertex = |x: u32, y: u32| {
            let [base, height] = mapped(Vec3::new(x as f32, y as f32, 0.0));
            SkinVertex::new(base, height, [x as f32, y as f32])
        };
        let skin = Skin::from_grid(SIDE, SIDE, vertex, |_, _| 0).expect("a skin");
        let skin = SceneSkin::new(skin, &ShellParams::default(), vec![Pattern::cyclic(0)], 0.0).expect("a skin");
        let volumes = Volumes::new(vec![self.volume.clone()], &[], vec![skin]).expect("a skin");
        let cells = (0..SIDE).flat_map(|i| (0..SIDE).map(move |j| [i, j]));
        let copies: Vec<[Vec3; 3]> = cells
            .flat_map(|cell| self.leaves.iter().map(move |corners| corners.map(|at| bent(bend, cell, at))))
            .collect();
        let occluder = Occluder::new(&copies);
        let (mut sum, mut count) = (0.0, 0usize);
        for direction in [Vec3::new(0.3, 0.2, -1.0), Vec3::new(-0.8, 0.5, -1.0), Vec3::new(0.9, 0.1, -0.5)] {
            let direction = direction.normalize();
            let (right, up) = direction.any_orthonormal_pair();
            let middle = Vec3::new(0.5 * SIDE as f32, 0.5 * SIDE as f32, 0.5);
            let width = SIDE as f32 / pixels as f32;
            let origin = |x: f32, y: f32| {
                let [x, y] = [x, y].map(|x| (x - 0.5 * pixels as f32) * width);
                middle + right * x + up * y - direction * 20.0
            };
            for pixel in 0..pixels * pixels {
                let [x, y] = [pixel % pixels, pixel / pixels].map(|x| x as f32);
                let passed =
                    |[s, t]: [f32; 2]| f64::from(u8::from(!occluder.occluded(origin(x + s, y + t), direction, 40.0)));
                let truth = mean(RAYS[0], &passed);
                let seen = |[s, t]: [f32; 2]| {
                    f64::from(volumes.march(
                        origin(x + s, y + t),
                        direction,
                        40.0,
                        &LodTransition::MESHES,
                        |_| 0.5 * width,
                        |_| (),
                    ))
                };
                let found = mean(RAYS[1], &seen);
                if truth < 1.0 || found < 0.999 {
                    sum += (found - truth).powi(2);
                    count += 1;
                }
            }
        }
        (sum / count as f64).sqrt()
    }
}

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

/// Mean over a pixel of so many rays along each side, at places from 0 to 1.
fn mean(side: usize, of_ray: &dyn Fn([f32; 2]) -> f64) -> f64 {
    let at = |i: usize| (i as f32 + 0.5) / side as f32;
    (0..side * side).map(|i| of_ray([at(i % side), at(i / side)])).sum::<f64>() / (side * side) as f64
}

/// Runs the study.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let pixels = arguments.first().map_or(Ok(48), |argument| argument.parse())?;
    let leaves = LeavesInCube::built();
    let rows = BENDS.map(|(name, bend)| format!("{name} {:.4}", leaves.transmittance_error(bend, bend, pixels)));
    println!("{}", rows.join(", "));
    Ok(())
}
