//! Broad-leaved trees: trunk, branches, twigs, and leaves on the twigs, in requested numbers.
//!
//! | what | value | from |
//! |---|---|---|
//! | branches of the orders 1, 2, 3 | 0.8 sqrt(B), a fifth of B, the rest of B - 1 | together exactly B with the trunk |
//! | leaves | on the twigs (order 3), spread evenly, exactly as many as asked for | |
//! | radius | `1.1 mm sqrt(leaves above)` | pipes: cross sections add up at every fork [Leonardo da Vinci; Shinozaki 1964] |
//! | crown | half an ellipsoid and more, height and width as the root of the leaves | one leaf area index for all sizes |
//! | azimuth | 137.5 degrees from branch to branch | golden angle [Prusinkiewicz & Lindenmayer 1990, section 4.1] |
//! | leaves | up to 0.10 m x 0.058 m | usual: beech |
//!
//! Growth: `stage` is the share of the full-grown tree's height; branches and leaves grow with its square.
//!
//! When it is wrong: branches neither compete for light nor avoid each other; no shedding, no roots, no buds; a
//! branch has all its twigs from the start.

use std::f64::consts::PI;
use std::ops::Range;

use rand::Rng;
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::plants::blade::{BladeShape, Course, Outline, TextureAlong};
use crate::plants::lsystem::{Module, commands, derive};
use crate::plants::params::PlantsParams;
use crate::plants::plant::{Part, Plant};
use crate::plants::turtle::{Command, GOLDEN_RAD, interpret};

/// Length of the largest leaf in metres. Its texture covers the same length.
pub(crate) const LEAF_LENGTH_M: f64 = 0.1;

/// Width of a leaf over its length.
const LEAF_WIDTH: f64 = 0.58;

/// Radius of a twig per root of its leaves, in metres.
const PIPE_RADIUS_M: f64 = 1.1e-3;

/// Height of a tree per root of its leaves, in metres: 6000 leaves on 4.5 m.
const HEIGHT_PER_ROOT_M: f64 = 0.058;

/// Last order, which bears leaves.
const TWIG: usize = 3;

/// Branch that is to grow: its number within its order, and its length.
#[derive(Debug, Clone, PartialEq)]
struct Shoot {
    order: usize,
    number: usize,
    length_m: f64,
}

/// Numbers of the parts of a tree.
struct Tree<'a> {
    params: &'a PlantsParams,
    /// Number of branches of each order; the trunk is order 0.
    counts: [usize; TWIG + 1],
    leaves: usize,
    height_m: f64,
}

/// Generates a tree.
pub(crate) fn grow(params: &PlantsParams, random: &mut Xoshiro256PlusPlus) -> Plant {
    let [branches, leaves] = params.branches_and_leaves();
    let tree = Tree {
        params,
        counts: orders(branches),
        leaves,
        height_m: HEIGHT_PER_ROOT_M * (leaves as f64).sqrt() * random.gen_range(0.94..1.06),
    };
    let trunk = Shoot { order: 0, number: 0, length_m: tree.height_m };
    let axiom = vec![Module::Draw(Command::Roll(random.gen_range(0.0..2.0 * PI))), Module::Symbol(trunk)];
    let word = derive(axiom, TWIG + 1, |shoot| Some(tree.produce(shoot, random)));
    interpret(commands(word))
}

/// Returns the number of branches of each order, together `branches`.
fn orders(branches: usize) -> [usize; TWIG + 1] {
    let rest = branches - 1;
    let first = ((0.8 * (branches as f64).sqrt()).round() as usize).min(rest);
    let second = (branches / 5).max(first).min(rest - first);
    [1, first, second, rest - first - second]
}

/// Returns the `number`-th of `parts` nearly equal runs of `count`.
fn run(number: usize, parts: usize, count: usize) -> Range<usize> {
    number * count / parts..(number + 1) * count / parts
}

impl Tree<'_> {
    /// Returns the shoots of the next order that a shoot bears; none without a next order.
    fn children(&self, shoot: &Shoot) -> Range<usize> {
        match shoot.order {
            TWIG => 0..0,
            order => run(shoot.number, self.counts[order], self.counts[order + 1]),
        }
    }

    /// Returns the number of leaves that a shoot bears itself: those of a twig, or of a branch without twigs of its
    /// own.
    fn own_leaves(&self, shoot: &Shoot) -> usize {
        if !self.children(shoot).is_empty() {
            return 0;
        }
        self.leaves_above(shoot)
    }

    /// Returns the number of leaves of a shoot and of everything that it bears.
    fn leaves_above(&self, shoot: &Shoot) -> usize {
        let mut run_of = shoot.number..shoot.number + 1;
        // Leaves go by twigs; a tree of too few branches has its last order's instead.
        for order in shoot.order..TWIG {
            if self.counts[order + 1] == 0 {
                return leaves_of(&run_of, self.counts[order], self.leaves);
            }
            let next = |edge: usize| edge * self.counts[order + 1] / self.counts[order];
            run_of = next(run_of.start)..next(run_of.end);
        }
        leaves_of(&run_of, self.counts[TWIG], self.leaves)
    }

    fn produce(&self, shoot: &Shoot, random: &mut Xoshiro256PlusPlus) -> Vec<Module<Shoot>> {
        let draw = Module::Draw;
        let children: Vec<usize> = self.children(shoot).collect();
        let mut above = self.leaves_above(shoot);
        let radius_m = |leaves: usize| PIPE_RADIUS_M * (leaves.max(1) as f64).sqrt();
        let mut word = vec![draw(Command::Axis { part: Part::Bark, radius_m: radius_m(above) })];
        // What is bare at the foot.
        let bare = [0.2, 0.22, 0.25, 0.1][shoot.order];
        let nodes = children.len().max(3 - usize::from(shoot.order == TWIG));
        let bare_steps = 2;
        for _ in 0..bare_steps {
            let length_m = bare * shoot.length_m / f64::from(bare_steps);
            word.push(draw(Command::Stem { length_m, radius_m: radius_m(above) }));
        }
        let step_m = (1.0 - bare) * shoot.length_m / nodes as f64;
        for node in 0..nodes {
            let t = bare + (1.0 - bare) * (node as f64 + 0.5) / nodes as f64;
            let wander = [0.06, 0.08, 0.10, 0.14][shoot.order];
            // Branches bow under their weight and turn up at their ends.
            let tropism = match shoot.order {
                0 => 0.06,
                1 => 1.1 / nodes as f64 * (t - 0.1),
                _ => 0.5 / nodes as f64,
            };
            if let Some(&number) = children.get(node) {
                let child = Shoot { order: shoot.order + 1, number, length_m: self.length_m(shoot, t, random) };
                above -= self.leaves_above(&child).min(above);
                word.extend([
                    draw(Command::Push),
                    draw(Command::Roll(random.gen_range(-0.3..0.3))),
                    draw(Command::Pitch(angle_rad(shoot.order, t) + random.gen_range(-0.12..0.12))),
                    Module::Symbol(child),
                    draw(Command::Pop),
                ]);
            }
            // The last piece thins to its end.
            let end = if node + 1 == nodes { 0.7 } else { 1.0 };
            let [turn, pitch] = [0, 1].map(|_| random.gen_range(-wander..wander));
            word.extend([
                draw(Command::Turn(turn)),
                draw(Command::Pitch(pitch)),
                draw(Command::Tropism(tropism)),
                draw(Command::Stem { length_m: step_m, radius_m: end * radius_m(above) }),
                draw(Command::Roll(GOLDEN_RAD)),
            ]);
        }
        word.extend(self.foliage(self.own_leaves(shoot), shoot.length_m, random).into_iter().map(Module::Draw));
        word
    }

    /// Returns the length of a shoot at the share `t` of the length of its bearer.
    fn length_m(&self, bearer: &Shoot, t: f64, random: &mut Xoshiro256PlusPlus) -> f64 {
        let share = match bearer.order {
            // The crown's outline, widest at half the height.
            0 => 0.50 * (1.0 - ((t - 0.47) / 0.56).powi(2)).max(0.03).sqrt(),
            1 => 0.62 * (1.0 - 0.75 * t),
            _ => (0.42 * (1.0 - 0.5 * t)).min(0.22 / bearer.length_m).max(0.06 / bearer.length_m),
        };
        bearer.length_m * share * random.gen_range(0.82..1.12)
    }

    /// Returns the leaves around the end of a twig; the turtle stands at it.
    fn foliage(&self, leaves: usize, length_m: f64, random: &mut Xoshiro256PlusPlus) -> Vec<Command> {
        let mut commands = Vec::new();
        for i in 0..leaves {
            // The first at the very end, the others back along the outer half.
            let back = 0.6 * length_m * i as f64 / leaves as f64;
            let away = if i == 0 { 0.1 } else { random.gen_range(0.7..1.1) };
            let angle = self.params.leaf_angle_deg.to_radians() * random.gen_range(0.7..1.3);
            let length_m = LEAF_LENGTH_M * random.gen_range(0.72..1.0);
            let (bend_rad, fold_rad) = (random.gen_range(0.1..0.5), random.gen_range(0.1..0.35));
            let sway_rad = random.gen_range(-0.2..0.2);
            commands.extend([
                Command::Push,
                Command::Move(-back),
                Command::Roll(GOLDEN_RAD * i as f64),
                Command::Pitch(away),
                // The leaf's stalk, too thin to be drawn.
                Command::Move(0.12 * length_m),
                Command::Level(-angle.min(1.5)),
                Command::Blade(BladeShape {
                    outline: Outline::Egg { base: 0.65, tip: 0.8 },
                    length_m,
                    width_m: LEAF_WIDTH * length_m,
                    course: Course::Bent { bend_rad, power: 1.5, sway_rad },
                    fold_rad: [0.35, fold_rad],
                    twist_rad: random.gen_range(-0.2..0.2),
                    wave: 0.0,
                    waves: 0.0,
                    wave_phase: 0.0,
                    texture: TextureAlong::Whole,
                }),
                Command::Pop,
            ]);
        }
        commands
    }
}

/// Returns the leaves of a run of `count` shoots that bear `leaves` together.
fn leaves_of(run: &Range<usize>, count: usize, leaves: usize) -> usize {
    run.end * leaves / count - run.start * leaves / count
}

/// Returns the angle between a branch and the axis of its bearer at the share `t` of that axis: flat below, steep
/// above.
fn angle_rad(bearer_order: usize, t: f64) -> f64 {
    match bearer_order {
        0 => 1.30 - 0.80 * t,
        _ => 0.85 - 0.2 * t,
    }
}

#[cfg(test)]
mod tests {
    use btf_models::Species;
    use rand::SeedableRng;

    use super::*;

    fn tree(branches: usize, leaves: usize) -> Plant {
        let params = PlantsParams { branches, leaves, ..PlantsParams::of(Species::Tree) };
        grow(&params, &mut Xoshiro256PlusPlus::seed_from_u64(5))
    }

    #[test]
    fn a_tree_has_the_branches_and_leaves_that_are_asked_for() {
        for (branches, leaves) in [(2154, 6336), (1200, 4000), (100, 77), (7, 300), (2, 5), (1, 1), (1, 40)] {
            let plant = tree(branches, leaves);
            assert_eq!((plant.axes.len(), plant.blades.len()), (branches, leaves));
        }
    }

    #[test]
    fn cross_sections_add_up_at_forks() {
        let plant = tree(400, 1500);
        let trunk = &plant.axes[0].nodes;
        assert!((trunk[0].radius_m - PIPE_RADIUS_M * 1500f64.sqrt()).abs() < 1e-12);
        // The trunk's foot against all twigs: area for area.
        let tips = plant.blades.len() as f64 * PIPE_RADIUS_M.powi(2);
        assert!((trunk[0].radius_m.powi(2) / tips - 1.0).abs() < 1e-9);
        assert!(plant.axes.iter().all(|axis| axis.nodes.windows(2).all(|n| n[1].radius_m <= n[0].radius_m + 1e-12)));
    }
}
