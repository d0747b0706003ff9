//! Patches of lawn: blades on the paths of particles that are thrown up, and on some patches a flower [Neyret 1996,
//! section 5].
//!
//! | what | value | from |
//! |---|---|---|
//! | blades of a patch | 16 | 22,000 on 1,400 patches [Neyret 1996] |
//! | flowers | one on every second patch | 700 on 1,400 patches [Neyret 1996] |
//! | blade | up to 45 mm, 3 to 5 mm wide, its section a V | usual: a lawn of *Lolium perenne* before it is cut |
//! | path | a parabola: thrown at the leaf angle off the vertical, fallen by a tenth to half of the throw | particle systems [Reeves & Blau 1985] |
//! | roots | one in each cell of a grid over the patch, anywhere in it | even across the borders of patches |
//! | flower | 13 petals of 9 mm on a stalk of 30 mm | usual: *Bellis perennis* in a lawn |
//!
//! A patch fills the square of its plant's spacing around the origin. Only roots keep within its borders: blades lean
//! across, so that patches side by side, or one repeated, are one lawn. At the usual spacing of 40 mm a patch is no
//! higher than wide.
//!
//! Growth: `stage` lengthens blades; the flower appears at a stage of 0.6.
//!
//! When it is wrong: no tillers, no sheaths, no mown tips; blades pass through each other.

use std::f64::consts::TAU;

use rand::Rng;
use rand::seq::SliceRandom;
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::plants::blade::{Blade, BladeShape, Course, Outline, TextureAlong};
use crate::plants::params::{PlantsParams, smooth};
use crate::plants::plant::{Axis, Node, Part, Plant};
use crate::plants::vec3::{UP, Vec3, along, direction_or, scale};
use crate::vector::cross;

/// Width of the widest blade in metres, which is the width of its texture and its period along the blade.
pub(crate) const BLADE_WIDTH_M: f64 = 0.005;

/// Length of the throw of the longest blade in metres.
const BLADE_LENGTH_M: f64 = 0.045;

/// Length of a flower's stalk in metres.
const STALK_M: f64 = 0.03;

/// Number of petals of a flower.
const PETALS: usize = 13;

/// Length of a petal in metres.
const PETAL_LENGTH_M: f64 = 0.009;

/// Generates the `number`-th patch.
pub(crate) fn grow(params: &PlantsParams, number: usize, random: &mut Xoshiro256PlusPlus) -> Plant {
    let sides_m = [params.spacing_mm / 1000.0, params.row_spacing_mm / 1000.0];
    let mut plant = Plant::default();
    for root in roots(params.blades, sides_m, random) {
        plant.blades.push(blade(params, root, random));
    }
    // Of n patches n times the share have one, whatever n is, and the first does.
    let flowers = |patches: usize| (patches as f64 * params.flowers).ceil();
    let open = smooth(0.6, 1.0, params.stage);
    if flowers(number + 1) > flowers(number) && open > 0.0 {
        let place = sides_m.map(|side| side * random.gen_range(-0.3..0.3));
        flower(&mut plant, [place[0], 0.0, place[1]], open, random);
    }
    plant
}

/// Returns the positions of `count` roots: cells of a grid, drawn without replacement, and a random position in each.
fn roots(count: usize, sides_m: [f64; 2], random: &mut Xoshiro256PlusPlus) -> Vec<Vec3> {
    let across = (count as f64).sqrt().ceil() as usize;
    let along = count.div_ceil(across);
    let mut cells: Vec<[usize; 2]> = (0..across * along).map(|i| [i % across, i / across]).collect();
    cells.shuffle(random);
    let place =
        |cell: usize, cells: usize, side_m: f64, jitter: f64| side_m * ((cell as f64 + jitter) / cells as f64 - 0.5);
    cells[..count]
        .iter()
        .map(|&[i, j]| {
            let [a, b] = [0, 1].map(|_| random.gen_range(0.0..1.0));
            [place(i, across, sides_m[0], a), 0.0, place(j, along, sides_m[1], b)]
        })
        .collect()
}

fn blade(params: &PlantsParams, origin_m: Vec3, random: &mut Xoshiro256PlusPlus) -> Blade {
    let azimuth = random.gen_range(0.0..TAU);
    let lean = (params.leaf_angle_deg.to_radians() * random.gen_range(0.5..1.5)).min(1.5);
    let (out, (sin, cos)) = ([azimuth.cos(), 0.0, azimuth.sin()], lean.sin_cos());
    let size = (0.15 + 0.85 * params.stage) * random.gen_range(0.7..1.0);
    let shape = BladeShape {
        outline: Outline::Grass,
        length_m: BLADE_LENGTH_M * size,
        width_m: BLADE_WIDTH_M * random.gen_range(0.6..1.0) * (0.4 + 0.6 * size),
        course: Course::Thrown { fall: random.gen_range(0.1..0.5) * cos },
        fold_rad: [0.7, random.gen_range(0.35..0.6)],
        twist_rad: random.gen_range(-0.4..0.4),
        wave: 0.0,
        waves: 0.0,
        wave_phase: 0.0,
        texture: TextureAlong::Every(BLADE_WIDTH_M),
    };
    // The upper face looks back over the root.
    Blade { origin_m, along: along(scale(UP, cos), out, sin), normal: along(scale(UP, sin), out, -cos), shape }
}

/// Adds a daisy to `plant`; `open` is its stage, 0 to 1.
fn flower(plant: &mut Plant, foot_m: Vec3, open: f64, random: &mut Xoshiro256PlusPlus) {
    /// Number of pieces of the stalk.
    const PIECES: usize = 5;
    let azimuth = random.gen_range(0.0..TAU);
    let lean = random.gen_range(0.05..0.3);
    let out = [azimuth.cos(), 0.0, azimuth.sin()];
    let heading = |s: f64| along(scale(UP, (lean * s).cos()), out, (lean * s).sin());
    let (step_m, mut position_m) = (STALK_M * open / PIECES as f64, foot_m);
    let mut nodes = vec![Node { position_m, radius_m: 0.0011 }];
    for i in 0..PIECES {
        position_m = along(position_m, heading((i as f64 + 0.5) / PIECES as f64), step_m);
        nodes.push(Node { position_m, radius_m: 0.0009 });
    }
    plant.axes.push(Axis { part: Part::Stem, nodes });
    let axis = heading(1.0);
    let disc = [(0.0, 0.0022), (0.0012, 0.0034), (0.0024, 0.0030), (0.0034, 0.0012)];
    let node = |(height_m, radius_m): (f64, f64)| Node {
        position_m: along(position_m, axis, open * height_m),
        radius_m: open * radius_m,
    };
    plant.axes.push(Axis { part: Part::Disc, nodes: disc.map(node).to_vec() });
    let side = direction_or(cross(axis, out), [0.0, 0.0, 1.0]);
    for i in 0..PETALS {
        let (sin, cos) = (TAU * (i as f64 + random.gen_range(-0.15..0.15)) / PETALS as f64).sin_cos();
        let away = along(scale(cross(side, axis), cos), side, sin);
        // Petals close upwards around a young flower.
        let rise = 1.3 - 1.15 * open + random.gen_range(-0.1..0.1);
        let along_petal = along(scale(away, rise.cos()), axis, rise.sin());
        let shape = BladeShape {
            outline: Outline::Egg { base: 0.55, tip: 0.35 },
            length_m: PETAL_LENGTH_M * open * random.gen_range(0.85..1.0),
            width_m: 0.0026 * open,
            course: Course::Bent { bend_rad: random.gen_range(0.0..0.5), power: 1.5, sway_rad: 0.0 },
            fold_rad: [0.3, 0.15],
            twist_rad: 0.0,
            wave: 0.0,
            waves: 0.0,
            wave_phase: 0.0,
            texture: TextureAlong::Whole,
        };
        plant.petals.push(Blade {
            origin_m: along(along(position_m, axis, open * 0.0012), away, open * 0.0028),
            along: along_petal,
            normal: along(scale(axis, rise.cos()), away, -rise.sin()),
            shape,
        });
    }
}

#[cfg(test)]
mod tests {
    use btf_models::Species;
    use rand::SeedableRng;

    use super::*;

    fn patch(number: usize, change: impl FnOnce(&mut PlantsParams)) -> Plant {
        let mut params = PlantsParams::of(Species::Grass);
        change(&mut params);
        grow(&params, number, &mut Xoshiro256PlusPlus::seed_from_u64(number as u64))
    }

    #[test]
    fn neyrets_lawn_has_22400_blades_and_700_flowers() {
        let patches: Vec<Plant> = (0..1400).map(|number| patch(number, |_| {})).collect();
        let count = |of: fn(&Plant) -> usize| patches.iter().map(of).sum::<usize>();
        assert_eq!((count(|patch| patch.blades.len()), count(Plant::flowers)), (22_400, 700));
        let flowers =
            |share| (0..10).map(|number| patch(number, |params| params.flowers = share).flowers()).sum::<usize>();
        assert_eq!([0.0, 0.3, 1.0].map(flowers), [0, 3, 10]);
    }

    #[test]
    fn blades_are_parabolas_with_a_v_section() {
        for blade in patch(0, |params| params.blades = 50).blades {
            let at = |u: f64, v: f64| blade.point(u, v).position_m;
            // Equal times: second differences are straight down and all the same, first ones level out as they may.
            let places: Vec<Vec3> = (0..=8).map(|i| at(0.5, f64::from(i) / 8.0)).collect();
            let second = |i: usize, k: usize| places[i + 1][k] - 2.0 * places[i][k] + places[i - 1][k];
            for i in 1..8 {
                assert!(second(i, 0).abs() < 1e-12 && second(i, 2).abs() < 1e-12);
                assert!(second(i, 1) < 0.0 && (second(i, 1) - second(1, 1)).abs() < 1e-12);
            }
            // Both margins stand on the upper face's side of the midrib.
            for v in [0.1, 0.4, 0.7] {
                let (left, rib, right) = (at(0.0, v), blade.point(0.5, v), at(1.0, v));
                let over = |place: Vec3| (0..3).map(|k| (place[k] - rib.position_m[k]) * rib.normal[k]).sum::<f64>();
                assert!(over(left) > 1e-4 && over(right) > 1e-4, "{} {}", over(left), over(right));
            }
        }
    }

    #[test]
    fn roots_are_even_over_the_patch_and_lean_across_its_border() {
        let patch = patch(0, |params| params.blades = 64);
        let mut counts = [[0; 4]; 4];
        for blade in &patch.blades {
            let [i, j] = [0, 2].map(|k| ((blade.origin_m[k] / 0.04 + 0.5) * 4.0).floor() as usize);
            counts[i][j] += 1;
        }
        assert!(counts.iter().flatten().all(|&count| count == 4), "{counts:?}");
        assert!(patch.blades.iter().any(|blade| blade.point(0.5, 1.0).position_m[0].abs() > 0.02));
        assert!(patch.blades.iter().all(|blade| blade.point(0.5, 0.6).position_m[1] < 0.04));
        // Planted difference: all roots in one half.
        assert!(counts.iter().take(2).flatten().sum::<i32>() != 64);
    }
}
