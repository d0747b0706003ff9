//! Spruces: a straight trunk to the top, whorls of branches, twigs like combs on the branches, in requested numbers.
//!
//! | what | value | from |
//! |---|---|---|
//! | branches of the orders 1, 2 | 2.9 sqrt(B), the rest of B - 1 | together exactly B with the trunk |
//! | a year's branches | some 8: a whorl of 4 to 6, the others between whorls and half as long | usual: *Picea abies* |
//! | length of a branch | grows from the top downwards, nearly in proportion | cone, 0.3 times as wide as it is high: usual of trees that stand free |
//! | angle between trunk and branch | 43 degrees at the top to 103 at the foot; ends turn up | usual: *Picea abies* |
//! | angle between branch and twig | 46 to 63 degrees, left and right in the branch's plane, hanging | 40 to 70 [Fabrika et al. 2019] |
//! | shoots | on twigs, as many as their length has room for, exactly as many as asked for in all | |
//! | radius | `0.7 mm sqrt(shoots above)` | pipes: cross sections add up at every fork [Shinozaki 1964] |
//! | shoots | up to 100 mm x 25 mm | usual: needles of 15 mm on both sides |
//!
//! A needle is some 15 mm long and a tree has millions of them, so a leaf here is a shoot: the blade has the outline of the needles of one
//! shoot, and leaf area is the area of these outlines. What a shoot reflects and transmits is [`btf_models::Species::preset`]'s.
//!
//! Growth: `stage` is the share of the full-grown tree's height; branches and shoots grow with its square.
//!
//! When it is wrong: light passes between needles and not through an outline, which is closed here; branches neither compete for light nor die
//! from below; no cones, no roots; whorls of young trees lie nearer together.

use std::f64::consts::TAU;

use rand::Rng;
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::plants::blade::{BladeShape, Course, Outline, TextureAlong};
use crate::plants::lsystem::{Module, commands, derive};
use crate::plants::params::{PlantsParams, smooth};
use crate::plants::plant::{Part, Plant};
use crate::plants::turtle::{Command, GOLDEN_RAD, interpret};

/// Length of the largest shoot in metres. Its texture covers the same length.
pub(crate) const SHOOT_LENGTH_M: f64 = 0.1;

/// Width of a shoot over its length.
const SHOOT_WIDTH: f64 = 0.25;

/// Radius of a twig per root of its shoots, in metres.
const PIPE_RADIUS_M: f64 = 0.7e-3;

/// Height of a tree per root of its shoots, in metres: 6000 shoots on 3.3 m.
const HEIGHT_PER_ROOT_M: f64 = 0.043;

/// Branches of a year.
const BRANCHES_OF_YEAR: usize = 8;

/// Height of the lowest whorl over that of the tree.
const FOOT: f64 = 0.09;

/// Share of a branch without twigs, next to the trunk.
const BARE: f64 = 0.14;

/// Shoots at the end of the trunk and of each branch that has twigs.
const LEADING: [usize; 2] = [4, 2];

/// Axis that is to grow, with what it bears.
#[derive(Debug, Clone, PartialEq)]
struct Limb {
    /// 0 is the trunk, 2 a twig.
    order: usize,
    length_m: f64,
    /// Place of its branch below the top, over the height of the tree.
    depth: f64,
    /// Branches that it bears, and those that they bear.
    branches: usize,
    /// Shoots on it and on all that it bears.
    shoots: usize,
}

/// Branch of the trunk: how far up it starts, in heights of the tree, its length, and its azimuth.
struct Start {
    t: f64,
    length_m: f64,
    azimuth_rad: f64,
}

/// Generates a spruce.
pub(crate) fn grow(params: &PlantsParams, random: &mut Xoshiro256PlusPlus) -> Plant {
    let [branches, shoots] = params.branches_and_leaves();
    let length_m = HEIGHT_PER_ROOT_M * (shoots as f64).sqrt() * random.gen_range(0.94..1.06);
    let trunk = Limb { order: 0, length_m, depth: 0.0, branches: branches - 1, shoots };
    let axiom = vec![Module::Draw(Command::Roll(random.gen_range(0.0..TAU))), Module::Symbol(trunk)];
    let foliage = Foliage { angle_rad: params.leaf_angle_deg.to_radians() };
    let word = derive(axiom, 3, |limb| {
        Some(match limb.order {
            0 => trunk_of(limb, &foliage, random),
            1 => branch_of(limb, &foliage, random),
            _ => twig_of(limb, &foliage, random),
        })
    });
    interpret(commands(word))
}

/// Returns `count` in whole shares in proportion to weights, together exactly `count`; nothing where there are no weights.
fn shares(count: usize, weights: &[f64]) -> Vec<usize> {
    let whole: f64 = weights.iter().sum();
    let (mut sum, mut given) = (0.0, 0);
    let mut next = |(i, weight): (usize, &f64)| {
        sum += weight;
        let up_to = if i + 1 == weights.len() { count } else { (count as f64 * sum / whole) as usize };
        let own = up_to.min(count).saturating_sub(given);
        given += own;
        own
    };
    weights.iter().enumerate().map(&mut next).collect()
}

fn radius_m(shoots: usize) -> f64 {
    PIPE_RADIUS_M * (shoots.max(1) as f64).sqrt()
}

/// Returns how many of an axis' shoots are at its own end: all where it bears nothing.
fn leading(limb: &Limb) -> usize {
    if limb.branches == 0 { limb.shoots } else { limb.shoots.min(LEADING[limb.order]) }
}

/// Returns where the branches of a trunk start, from the foot upwards.
fn starts(count: usize, height_m: f64, random: &mut Xoshiro256PlusPlus) -> Vec<Start> {
    let years = (count / BRANCHES_OF_YEAR).max(3).min(count);
    // Good years and bad ones.
    let mut steps: Vec<f64> = (0..years).map(|_| random.gen_range(0.7..1.3)).collect();
    let whole = steps.iter().sum::<f64>() / (1.0 - FOOT);
    steps.iter_mut().for_each(|step| *step /= whole);
    let mut starts = Vec::with_capacity(count);
    let mut t = FOOT;
    for (year, own) in shares(count, &vec![1.0; years]).into_iter().enumerate() {
        let whorl = random.gen_range(4..=6).min(own);
        let turned: f64 = random.gen_range(0.0..TAU);
        for i in 0..own {
            let (start, vigour, azimuth_rad) = match i < whorl {
                true => {
                    let azimuth_rad = turned + TAU * i as f64 / whorl as f64 + random.gen_range(-0.2..0.2);
                    (t, random.gen_range(0.84..1.1), azimuth_rad)
                }
                false => {
                    let between = (i - whorl) as f64 + random.gen_range(0.6..1.4);
                    let start = t + steps[year] * between / (own - whorl + 1) as f64;
                    (start, random.gen_range(0.45..0.8), turned + GOLDEN_RAD * i as f64)
                }
            };
            let depth = 1.0 - start;
            // The lowest ones are in the shade of all others.
            let shaded = 1.0 - 0.15 * smooth(0.85, 0.95, depth);
            let length_m = height_m * (0.01 + 0.22 * depth.powf(0.95)) * shaded * vigour;
            starts.push(Start { t: start, length_m, azimuth_rad });
        }
        t += steps[year];
    }
    starts
}

fn trunk_of(trunk: &Limb, foliage: &Foliage, random: &mut Xoshiro256PlusPlus) -> Vec<Module<Limb>> {
    let draw = Module::Draw;
    let first = ((2.9 * (trunk.branches as f64 + 1.0).sqrt()).round() as usize).min(trunk.branches);
    let starts = starts(first, trunk.length_m, random);
    let by = |power: f64| starts.iter().map(|start| start.length_m.powf(power)).collect::<Vec<f64>>();
    let own = leading(trunk);
    let twigs = shares(trunk.branches - first, &by(1.0));
    let shoots = shares(trunk.shoots - own, &by(1.4));
    let (mut at, mut above) = (0.0, trunk.shoots);
    let mut word = vec![draw(Command::Axis { part: Part::Bark, radius_m: radius_m(above) })];
    for (i, Start { t, length_m, azimuth_rad }) in starts.into_iter().enumerate() {
        if t > at {
            // Straight but for a little.
            word.push(draw(Command::Pitch(random.gen_range(-0.01..0.01))));
            word.push(draw(Command::Tropism(0.01)));
            word.push(draw(Command::Stem { length_m: (t - at) * trunk.length_m, radius_m: radius_m(above) }));
            at = t;
        }
        let depth = 1.0 - t;
        above -= shoots[i];
        word.extend([
            draw(Command::Push),
            draw(Command::Roll(azimuth_rad)),
            draw(Command::Pitch(0.75 + 1.05 * depth.powf(0.8) + random.gen_range(-0.1..0.1))),
            Module::Symbol(Limb { order: 1, length_m, depth, branches: twigs[i], shoots: shoots[i] }),
            draw(Command::Pop),
        ]);
    }
    let radius_m = 0.6 * radius_m(above);
    word.push(draw(Command::Stem { length_m: (1.0 - at) * trunk.length_m, radius_m }));
    word.extend(foliage.leader(own, (1.0 - at) * trunk.length_m, random).into_iter().map(draw));
    word
}

fn branch_of(branch: &Limb, foliage: &Foliage, random: &mut Xoshiro256PlusPlus) -> Vec<Module<Limb>> {
    let draw = Module::Draw;
    let Limb { length_m, depth, branches, .. } = *branch;
    let nodes = branches.div_ceil(2).max(4);
    let place = |i: usize| BARE + (1.0 - BARE) * ((i / 2) as f64 + 0.5) / nodes as f64;
    // Longest at two fifths: those next to the trunk are in the shade.
    let outline = |t: f64| (1.0 - t).powf(0.8) * (0.4 + 0.6 * (t / 0.4).min(1.0));
    let lengths: Vec<f64> =
        (0..branches).map(|i| (0.62 * length_m * outline(place(i))).max(0.03) * random.gen_range(0.8..1.15)).collect();
    let own = leading(branch);
    let shoots = shares(branch.shoots - own, &lengths);
    let mut above = branch.shoots;
    let mut word = vec![
        draw(Command::Axis { part: Part::Bark, radius_m: radius_m(above) }),
        draw(Command::Stem { length_m: BARE * length_m, radius_m: radius_m(above) }),
    ];
    let step_m = (1.0 - BARE) * length_m / nodes as f64;
    for node in 0..nodes {
        let t = BARE + (1.0 - BARE) * (node as f64 + 0.5) / nodes as f64;
        for i in (2 * node)..(2 * node + 2).min(branches) {
            let side = if i % 2 == 0 { 1.0 } else { -1.0 };
            above -= shoots[i];
            word.extend([
                draw(Command::Push),
                draw(Command::Turn(side * random.gen_range(0.8..1.1))),
                draw(Command::Tropism(-(0.15 + 0.9 * depth) * random.gen_range(0.4..1.4))),
                Module::Symbol(Limb { order: 2, length_m: lengths[i], depth, branches: 0, shoots: shoots[i] }),
                draw(Command::Pop),
            ]);
        }
        // Its weight bends it down, and its end turns up.
        let bend = if t < 0.55 { -0.25 } else { 1.5 } * depth / nodes as f64;
        let end = if node + 1 == nodes { 0.7 } else { 1.0 };
        word.extend([
            draw(Command::Turn(random.gen_range(-0.06..0.06))),
            draw(Command::Tropism(bend + random.gen_range(-0.04..0.04))),
            draw(Command::Stem { length_m: step_m, radius_m: end * radius_m(above) }),
        ]);
    }
    word.extend(foliage.along(own, depth, 0.3 * length_m, random).into_iter().map(draw));
    word
}

fn twig_of(twig: &Limb, foliage: &Foliage, random: &mut Xoshiro256PlusPlus) -> Vec<Module<Limb>> {
    const PIECES: usize = 2;
    let mut commands = vec![Command::Axis { part: Part::Bark, radius_m: radius_m(twig.shoots) }];
    for piece in 1..=PIECES {
        let thinned = 1.0 - 0.4 * piece as f64 / PIECES as f64;
        commands.extend([
            Command::Stem { length_m: twig.length_m / PIECES as f64, radius_m: thinned * radius_m(twig.shoots) },
            Command::Tropism(-0.25 * twig.depth * random.gen_range(0.0..1.0)),
        ]);
    }
    commands.extend(foliage.along(twig.shoots, twig.depth, 0.85 * twig.length_m, random));
    commands.into_iter().map(Module::Draw).collect()
}

/// The needles, shoot by shoot.
struct Foliage {
    /// Mean inclination of shoots.
    angle_rad: f64,
}

impl Foliage {
    /// Returns the shoots of a twig or of a branch's end, the first at its very end and the others back along `reach_m`, left and
    /// right; the turtle stands at the end.
    fn along(&self, shoots: usize, depth: f64, reach_m: f64, random: &mut Xoshiro256PlusPlus) -> Vec<Command> {
        let mut commands = Vec::new();
        for i in 0..shoots {
            let side = if i % 2 == 0 { 1.0 } else { -1.0 };
            let away = if i == 0 { random.gen_range(-0.15..0.15) } else { side * random.gen_range(0.7..1.1) };
            // Ends rise in the upper crown and hang in the lower one.
            let rises = random.gen_bool(0.15 + 0.7 * (1.0 - depth));
            let elevation = self.angle_rad * random.gen_range(0.7..1.3);
            commands.extend([
                Command::Push,
                Command::Move(-reach_m * i as f64 / shoots as f64),
                Command::Turn(away),
                Command::Level(if rises { 1.0 } else { -1.0 } * elevation.min(1.5)),
                Command::Blade(shoot(random)),
                Command::Pop,
            ]);
        }
        commands
    }

    /// Returns the shoots of the top: the first straight up, the others around it.
    fn leader(&self, shoots: usize, reach_m: f64, random: &mut Xoshiro256PlusPlus) -> Vec<Command> {
        let mut commands = Vec::new();
        for i in 0..shoots {
            commands.extend([
                Command::Push,
                Command::Move(-0.8 * reach_m * i as f64 / shoots as f64),
                Command::Roll(GOLDEN_RAD * i as f64),
                Command::Pitch(if i == 0 { 0.0 } else { random.gen_range(0.3..0.6) }),
                Command::Blade(shoot(random)),
                Command::Pop,
            ]);
        }
        commands
    }
}

/// Returns the shape of a shoot: nearly as wide at its end as in its middle.
fn shoot(random: &mut Xoshiro256PlusPlus) -> BladeShape {
    let length_m = SHOOT_LENGTH_M * random.gen_range(0.85..1.0);
    BladeShape {
        outline: Outline::Egg { base: 0.25, tip: 0.35 },
        length_m,
        width_m: SHOOT_WIDTH * length_m,
        course: Course::Bent {
            bend_rad: random.gen_range(-0.1..0.3),
            power: 1.2,
            sway_rad: random.gen_range(-0.15..0.15),
        },
        // Needles stand up on both sides of the twig.
        fold_rad: [0.75, random.gen_range(0.6..0.9)],
        twist_rad: random.gen_range(-0.2..0.2),
        wave: 0.0,
        waves: 0.0,
        wave_phase: 0.0,
        texture: TextureAlong::Whole,
    }
}

#[cfg(test)]
mod tests {
    use btf_models::Species;
    use rand::SeedableRng;

    use super::*;
    use crate::plants::tree;

    fn params(branches: usize, leaves: usize) -> PlantsParams {
        PlantsParams { branches, leaves, ..PlantsParams::of(Species::Spruce) }
    }

    fn random() -> Xoshiro256PlusPlus {
        Xoshiro256PlusPlus::seed_from_u64(5)
    }

    fn spruce(branches: usize, leaves: usize) -> Plant {
        grow(&params(branches, leaves), &mut random())
    }

    #[test]
    fn a_spruce_has_the_branches_and_shoots_that_are_asked_for() {
        for (branches, shoots) in
            [(2154, 6336), (1200, 4000), (100, 77), (100, 5), (7, 300), (2, 5), (2, 1), (1, 1), (1, 40)]
        {
            let plant = spruce(branches, shoots);
            assert_eq!((plant.axes.len(), plant.blades.len()), (branches, shoots));
        }
    }

    #[test]
    fn shares_are_whole_and_add_up() {
        assert_eq!(shares(7, &[1.0, 1.0, 1.0]), [2, 2, 3]);
        assert_eq!(shares(100, &[0.1, 0.3, 0.6]), [10, 30, 60]);
        assert_eq!(shares(2, &[1.0; 5]).iter().sum::<usize>(), 2);
        assert!(shares(3, &[]).is_empty());
    }

    #[test]
    fn cross_sections_do_not_grow_from_the_foot_upwards() {
        let plant = spruce(400, 1500);
        let trunk = &plant.axes[0].nodes;
        assert!((trunk[0].radius_m - PIPE_RADIUS_M * 1500f64.sqrt()).abs() < 1e-12);
        assert!(plant.axes.iter().all(|axis| axis.nodes.windows(2).all(|n| n[1].radius_m <= n[0].radius_m + 1e-12)));
    }

    /// Returns the height, and the mean distance of shoots from the trunk's line in fifths of the height.
    fn outline(plant: &Plant) -> (f64, Vec<f64>) {
        let tips: Vec<[f64; 3]> = plant.blades.iter().map(|blade| blade.point(0.5, 1.0).position_m).collect();
        let height_m = tips.iter().map(|tip| tip[1]).fold(0.0, f64::max);
        let mut fifths = vec![(0.0, 0.0); 5];
        for tip in &tips {
            let fifth = ((5.0 * tip[1] / height_m) as usize).min(4);
            fifths[fifth].0 += tip[0].hypot(tip[2]);
            fifths[fifth].1 += 1.0;
        }
        (height_m, fifths.into_iter().map(|(sum, count): (f64, f64)| sum / count.max(1.0)).collect())
    }

    /// Tells whether a crown is a cone down to near the ground that is 0.25 to 0.36 times as wide as it is high.
    fn is_cone(plant: &Plant) -> bool {
        let (height_m, radii_m) = outline(plant);
        let reach = |blade: &crate::plants::blade::Blade| {
            let tip = blade.point(0.5, 1.0).position_m;
            tip[0].hypot(tip[2])
        };
        let mut reaches: Vec<f64> = plant.blades.iter().map(reach).collect();
        reaches.sort_by(f64::total_cmp);
        // But for the outermost twentieth.
        let width = 2.0 * reaches[reaches.len() * 95 / 100] / height_m;
        let falls = radii_m.windows(2).all(|pair| pair[1] < 0.97 * pair[0]);
        falls && radii_m[4] < 0.45 * radii_m[0] && (0.25..0.36).contains(&width)
    }

    #[test]
    fn the_crown_is_a_narrow_cone_with_a_pointed_top() {
        let plant = spruce(2154, 6336);
        assert!(is_cone(&plant), "{:?}", outline(&plant));
        // Planted: a broad-leaved tree is none.
        let broad = PlantsParams { branches: 2154, leaves: 6336, ..PlantsParams::of(Species::Tree) };
        assert!(!is_cone(&tree::grow(&broad, &mut random())));
    }

    #[test]
    fn the_trunk_is_straight_and_bears_whorls() {
        let plant = spruce(2154, 6336);
        let trunk = &plant.axes[0].nodes;
        let top = trunk.last().unwrap().position_m;
        assert!(top[0].hypot(top[2]) < 0.02 * top[1], "{top:?}");
        // Branches of the first order start on the trunk: four and more at one height are a whorl.
        let on_trunk = |node: &crate::plants::plant::Node| {
            trunk.iter().position(|own| own.position_m == node.position_m && own.position_m[1] > 0.0)
        };
        let mut counts = vec![0; trunk.len()];
        plant.axes[1..].iter().filter_map(|axis| on_trunk(&axis.nodes[0])).for_each(|node| counts[node] += 1);
        let whorls = counts.iter().filter(|count| (4..=6).contains(*count)).count();
        assert_eq!((counts.iter().sum::<usize>(), whorls), (135, 16), "{counts:?}");
        assert!(counts.iter().all(|count| *count <= 6), "{counts:?}");
    }

    #[test]
    fn branches_rise_above_and_hang_below() {
        let plant = spruce(2154, 6336);
        let height_m = plant.axes[0].nodes.last().unwrap().position_m[1];
        let trunk = &plant.axes[0].nodes;
        // The mean elevation of the first pieces of branches between two heights.
        let elevation = |from: f64, to: f64| {
            let own = plant.axes[1..].iter().filter(|axis| {
                let start = axis.nodes[0].position_m;
                let height = start[1] / height_m;
                (from..to).contains(&height) && trunk.iter().any(|node| node.position_m == start)
            });
            let angles: Vec<f64> = own
                .map(|axis| {
                    let [a, b] = [0, 1].map(|k| axis.nodes[k].position_m);
                    let across = (b[0] - a[0]).hypot(b[2] - a[2]);
                    ((b[1] - a[1]) / across).atan().to_degrees()
                })
                .collect();
            angles.iter().sum::<f64>() / angles.len() as f64
        };
        let [above, middle, below] = [elevation(0.85, 1.0), elevation(0.4, 0.6), elevation(0.0, 0.2)];
        assert!(above > 30.0 && middle.abs() < 20.0 && below < -3.0, "{above} {middle} {below}");
    }
}
