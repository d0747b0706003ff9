//! Maize: phytomers one above the other, each an internode, a sheath and a blade, and a tassel on top.
//!
//! | what | value | from |
//! |---|---|---|
//! | leaves | 18, one more or less | temperate hybrids have 16 to 20 |
//! | area of leaf i, relative | `exp(-(i - i0)^2 / (2 k^2))`, i0 = 0.67 N, k = 4.2 N / 18 | bell shape [Dwyer & Stewart 1986], this form and k [Yang & Alley 2005] |
//! | largest blade | 0.88 m x 0.10 m | usual |
//! | area of a blade | 0.75 length x width | [Montgomery 1911] |
//! | azimuth | 180 degrees from leaf to leaf, 9 degrees of scatter | distichous |
//! | how far blades stand out and bend | 35 degrees at the collar, 115 degrees along the largest | mean inclination 37 degrees; [`crate::Habit`] has steeper ones |
//! | internodes | from rank 4, up to 0.15 m; the whole 2.4 m with the tassel | usual |
//!
//! Growth: `stage` counts leaves that have appeared, from 0 to N + 7 (flowering). A blade takes 4 leaves' time to grow,
//! upright in the whorl at first; an internode stretches when its blade has grown; the lowest leaves have died when 20
//! more have come. Blades bend more the older and longer they are.
//!
//! When it is wrong: no brace roots, no tillers, no silk; leaves do not turn towards gaps in the row.

use std::f64::consts::PI;

use rand::Rng;
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::plants::blade::{BladeShape, Course, Outline, TextureAlong};
use crate::plants::lsystem::{Module, commands, derive};
use crate::plants::params::{PlantsParams, smooth};
use crate::plants::plant::{Part, Plant};
use crate::plants::turtle::{Command, interpret};

/// Width of the largest blade in metres, which is the width of its texture and its period along the blade.
pub(crate) const BLADE_WIDTH_M: f64 = 0.1;

/// Length of the largest blade in metres.
const BLADE_LENGTH_M: f64 = 0.88;

/// Radius of the stalk at its foot in metres.
const STALK_RADIUS_M: f64 = 0.014;

/// Number of leaves of a plant, one more or less.
const LEAVES: usize = 18;

/// Time from the appearance of the last leaf to flowering, in times between leaves.
const AFTER_LAST_LEAF: f64 = 7.0;

/// Number of leaves that appear after a leaf before it dies.
const LIFE_IN_LEAVES: f64 = 20.5;

#[derive(Debug, Clone, PartialEq)]
enum Symbol {
    /// Apex that makes the phytomer of a rank, from 1.
    Apex(usize),
    Internode(usize),
    Leaf(usize),
    Ear,
    Tassel,
}

/// Plant that grows.
struct Maize<'a> {
    params: &'a PlantsParams,
    leaves: usize,
    /// Number of leaves that have appeared, continued beyond the last.
    appeared: f64,
    /// Factor on the size of all organs, about 1.
    vigour: f64,
}

/// Generates a plant.
pub(crate) fn grow(params: &PlantsParams, random: &mut Xoshiro256PlusPlus) -> Plant {
    let leaves = LEAVES - 1 + random.gen_range(0..3);
    // At least the first leaf's tip.
    let appeared = (params.stage * (leaves as f64 + AFTER_LAST_LEAF)).max(1.5);
    let maize = Maize { params, leaves, appeared, vigour: random.gen_range(0.94..1.06) };
    let axiom = vec![
        Module::Draw(Command::Roll(random.gen_range(0.0..2.0 * PI))),
        Module::Draw(Command::Axis { part: Part::Stem, radius_m: maize.stalk_radius_m(0) }),
        Module::Symbol(Symbol::Apex(1)),
    ];
    // A rank a step, and one more for the organs of the last.
    let word = derive(axiom, leaves + 2, |symbol| maize.produce(symbol, random));
    interpret(commands(word))
}

impl Maize<'_> {
    fn produce(&self, symbol: &Symbol, random: &mut Xoshiro256PlusPlus) -> Option<Vec<Module<Symbol>>> {
        let draw = |commands: Vec<Command>| Some(commands.into_iter().map(Module::Draw).collect());
        match *symbol {
            Symbol::Apex(rank) if rank <= self.leaves => {
                // The youngest leaf's tip has just come out.
                if self.age(rank) < 0.3 {
                    return None;
                }
                let mut phytomer = vec![
                    Module::Symbol(Symbol::Internode(rank)),
                    Module::Draw(Command::Push),
                    Module::Symbol(Symbol::Leaf(rank)),
                    Module::Draw(Command::Pop),
                ];
                if rank == self.ear_rank() && self.flowering() > 0.0 {
                    phytomer.extend([
                        Module::Draw(Command::Push),
                        Module::Symbol(Symbol::Ear),
                        Module::Draw(Command::Pop),
                    ]);
                }
                phytomer.push(Module::Draw(Command::Roll(PI + random.gen_range(-0.16..0.16))));
                phytomer.push(Module::Symbol(Symbol::Apex(rank + 1)));
                Some(phytomer)
            }
            Symbol::Apex(_) if self.flowering() > 0.0 => Some(vec![Module::Symbol(Symbol::Tassel)]),
            Symbol::Apex(_) => None,
            Symbol::Internode(rank) => draw(self.internode(rank, random)),
            Symbol::Leaf(rank) if self.age(rank) < LIFE_IN_LEAVES => draw(self.leaf(rank, random)),
            Symbol::Leaf(_) => Some(Vec::new()),
            Symbol::Ear => draw(self.ear()),
            Symbol::Tassel => draw(self.tassel(random)),
        }
    }

    /// Returns the number of leaves that have appeared since the leaf of a rank did.
    fn age(&self, rank: usize) -> f64 {
        self.appeared - rank as f64 + 1.0
    }

    /// Returns the stage of flowering: from 0 when the tassel appears to 1 when it is open.
    fn flowering(&self) -> f64 {
        smooth(2.0, AFTER_LAST_LEAF, self.appeared - self.leaves as f64)
    }

    fn largest_rank(&self) -> f64 {
        0.67 * self.leaves as f64
    }

    fn ear_rank(&self) -> usize {
        self.largest_rank().round() as usize
    }

    /// Returns the area of a leaf over that of the largest.
    fn relative_area(&self, rank: usize) -> f64 {
        let k = 4.2 * self.leaves as f64 / LEAVES as f64;
        (-(rank as f64 - self.largest_rank()).powi(2) / (2.0 * k * k)).exp()
    }

    fn stalk_radius_m(&self, rank: usize) -> f64 {
        let thickness = smooth(0.0, 9.0, self.appeared) * 0.75 + 0.25;
        let taper = 1.0 - 0.72 * (rank as f64 / self.leaves as f64).powf(1.3);
        STALK_RADIUS_M * self.vigour * thickness * taper
    }

    fn internode_m(&self, rank: usize) -> f64 {
        let r = rank as f64;
        let grown = 0.006 + 0.148 * smooth(3.5, 10.0, r) * (1.0 - 0.22 * smooth(12.0, 18.0, r));
        self.vigour * grown * (0.04 + 0.96 * smooth(2.5, 6.5, self.age(rank)))
    }

    fn internode(&self, rank: usize, random: &mut Xoshiro256PlusPlus) -> Vec<Command> {
        let [below, above] = [self.stalk_radius_m(rank - 1), self.stalk_radius_m(rank)];
        let lean = random.gen_range(-0.012..0.012);
        let length_m = self.internode_m(rank);
        vec![
            Command::Pitch(lean),
            Command::Stem { length_m: 0.9 * length_m, radius_m: 0.5 * (below + above) },
            // A node is a little thicker.
            Command::Stem { length_m: 0.1 * length_m, radius_m: 1.06 * above },
        ]
    }

    /// Returns sheath and blade; the turtle stands on the node, with its U away from the direction of the blade.
    fn leaf(&self, rank: usize, random: &mut Xoshiro256PlusPlus) -> Vec<Command> {
        let (age, area) = (self.age(rank), self.relative_area(rank));
        let grown = smooth(-0.8, 4.0, age);
        let vigour = self.vigour * random.gen_range(0.95..1.05);
        // Long before it is wide: what comes out of the whorl first is the tip.
        let length_m = BLADE_LENGTH_M * area.powf(0.52) * grown * vigour;
        let width_m = BLADE_WIDTH_M * area.powf(0.48) * (0.35 + 0.65 * grown) * vigour;
        let sheath_m = 0.17 * area.powf(0.3) * (0.25 + 0.75 * grown) * vigour;
        let radius_m = self.stalk_radius_m(rank);
        // Out of the whorl, and upper leaves more upright than lower ones.
        let opening = smooth(0.0, 4.5, age);
        let by_rank = 1.26 - 0.42 * rank as f64 / self.leaves as f64;
        let angle = self.params.leaf_angle_deg.to_radians() * by_rank * (0.12 + 0.88 * opening);
        let angle = (angle + random.gen_range(-0.09..0.09) * opening).clamp(0.02, 1.5);
        // Long blades hang; what stands out flat at once need not bend as far.
        let drooping = smooth(1.0, 6.0, age) * area.powf(0.4);
        let bend = (self.params.bend * (0.25 + 1.75 * drooping * random.gen_range(0.8..1.15))).min(2.75 - angle);
        vec![
            Command::Axis { part: Part::Stem, radius_m: 1.04 * radius_m },
            Command::Stem { length_m: 0.04 * sheath_m, radius_m: 1.22 * radius_m },
            Command::Stem { length_m: 0.76 * sheath_m, radius_m: 1.16 * radius_m },
            Command::Stem { length_m: 0.2 * sheath_m, radius_m: 1.3 * radius_m },
            // The blade starts on the sheath's outside.
            Command::Pitch(PI / 2.0),
            Command::Move(0.85 * radius_m),
            Command::Pitch(angle - PI / 2.0),
            Command::Blade(BladeShape {
                outline: Outline::Grass,
                length_m,
                width_m,
                course: Course::Bent {
                    bend_rad: bend,
                    power: random.gen_range(1.35..1.8),
                    sway_rad: random.gen_range(-0.3..0.3) * drooping,
                },
                fold_rad: [0.95, 0.22 + 0.5 * (1.0 - opening)],
                twist_rad: random.gen_range(-0.55..0.55) * drooping,
                wave: random.gen_range(0.10..0.22) * smooth(0.3, 0.7, area),
                waves: random.gen_range(5.0..8.0),
                wave_phase: random.gen_range(0.0..1.0),
                texture: TextureAlong::Every(BLADE_WIDTH_M),
            }),
        ]
    }

    /// Returns the ear in its husk, in the axil of its leaf.
    fn ear(&self) -> Vec<Command> {
        /// Radius along the ear over its greatest radius.
        const OUTLINE: [f64; 8] = [0.35, 0.75, 0.95, 1.0, 0.93, 0.75, 0.48, 0.14];
        let (length_m, radius_m) = (0.23 * self.vigour, 0.024 * self.vigour);
        let size = 0.35 + 0.65 * self.flowering();
        let start = [Command::Pitch(0.3), Command::Axis { part: Part::Stem, radius_m: 0.2 * radius_m }];
        let step_m = size * length_m / OUTLINE.len() as f64;
        let husk = OUTLINE.map(|share| Command::Stem { length_m: step_m, radius_m: size * radius_m * share });
        start.into_iter().chain(husk).collect()
    }

    /// Returns a spike and its branches.
    fn tassel(&self, random: &mut Xoshiro256PlusPlus) -> Vec<Command> {
        let open = self.flowering();
        let top_m = self.stalk_radius_m(self.leaves);
        let mut commands = vec![
            Command::Stem { length_m: 0.2 * open * self.vigour, radius_m: 0.75 * top_m },
            Command::Axis { part: Part::Tassel, radius_m: 0.6 * top_m },
        ];
        let branches = random.gen_range(7..13);
        for i in 0..branches {
            commands.push(Command::Stem { length_m: 0.011 * open, radius_m: 0.55 * top_m });
            commands.push(Command::Push);
            commands.push(Command::Roll(2.4 * f64::from(i) + random.gen_range(-0.4..0.4)));
            commands.push(Command::Pitch(open * random.gen_range(0.55..0.95) * (1.0 - 0.03 * f64::from(i))));
            commands.push(Command::Axis { part: Part::Tassel, radius_m: 0.0012 });
            let length_m = random.gen_range(0.15..0.23) * (0.3 + 0.7 * open) * self.vigour;
            commands.extend(spike(5, length_m, -0.1));
            commands.push(Command::Pop);
        }
        commands.extend(spike(9, 0.24 * (0.3 + 0.7 * open) * self.vigour, 0.0));
        commands
    }
}

/// Returns a spike of spikelets: alternately thick and thin, bent by `tropism` at each.
fn spike(spikelets: usize, length_m: f64, tropism_rad: f64) -> Vec<Command> {
    let step_m = length_m / (2 * spikelets) as f64;
    let taper = |i: usize| 1.0 - 0.6 * i as f64 / (2 * spikelets) as f64;
    (0..2 * spikelets)
        .flat_map(|i| {
            let radius_m = if i % 2 == 0 { 0.0044 } else { 0.0018 } * taper(i);
            [Command::Stem { length_m: step_m, radius_m }, Command::Tropism(tropism_rad)]
        })
        .collect()
}
