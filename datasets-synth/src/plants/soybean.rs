//! Soybean: a stem of nodes with trifoliate leaves on petioles, branches from the lower axils, pods when it is old.
//!
//! | what | value | from |
//! |---|---|---|
//! | nodes of the main stem | 16, one more or less | indeterminate varieties have 14 to 20 at maturity |
//! | internodes | 0.055 m, the first ones shorter | plants of 0.8 to 1 m |
//! | petioles | up to 0.22 m, longest in the middle | usual |
//! | leaflets | up to 0.10 m x 0.06 m, an egg's outline, the middle one on a stalk | usual |
//! | azimuth | 180 degrees from leaf to leaf, 25 degrees of scatter | distichous |
//! | branches | from the axils of nodes 2 to 6, most of them | usual at wide rows |
//!
//! Growth: `stage` counts nodes, from 0 to N + 4 (pods are full). Above the first node, which has a pair of single
//! leaves, each has one of three leaflets; a leaf takes 3 nodes' time to grow; branches start when their node has been
//! passed by 4; pods start at stage 0.65 on nodes that are old enough.
//!
//! When it is wrong: leaflets do not follow the sun, no cotyledons and flowers, none of the leaves has fallen.

use std::f64::consts::PI;

use rand::Rng;
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::plants::blade::{BladeShape, Course, Outline, TextureAlong};
use crate::plants::lsystem::{Module, commands, derive};
use crate::plants::params::{PlantsParams, smooth};
use crate::plants::plant::{Part, Plant};
use crate::plants::turtle::{Command, interpret};

/// Length of the largest leaflet in metres, which is the length of its texture.
pub(crate) const LEAFLET_LENGTH_M: f64 = 0.1;

/// Width of a leaflet over its length.
const LEAFLET_WIDTH: f64 = 0.6;

/// Number of nodes of the main stem, one more or less.
const NODES: usize = 16;

#[derive(Debug, Clone, PartialEq)]
enum Symbol {
    /// Apex that makes a node: its number on its stem, the order of the stem (0: main), and the node of the main stem
    /// at which the first node of this stem appeared.
    Apex {
        node: usize,
        order: usize,
        since: f64,
    },
    Leaf {
        node: usize,
        age: f64,
    },
    Pods {
        age: f64,
    },
}

struct Soybean<'a> {
    params: &'a PlantsParams,
    nodes: usize,
    /// Number of nodes that have appeared on the main stem, continued beyond the last.
    appeared: f64,
    vigour: f64,
}

/// Generates a plant.
pub(crate) fn grow(params: &PlantsParams, random: &mut Xoshiro256PlusPlus) -> Plant {
    let nodes = NODES - 1 + random.gen_range(0..3);
    let appeared = (params.stage * (nodes as f64 + 4.0)).max(1.5);
    let soybean = Soybean { params, nodes, appeared, vigour: random.gen_range(0.92..1.08) };
    let axiom = vec![
        Module::Draw(Command::Roll(random.gen_range(0.0..2.0 * PI))),
        Module::Draw(Command::Axis { part: Part::Stem, radius_m: soybean.radius_m(0, 0) }),
        Module::Symbol(Symbol::Apex { node: 1, order: 0, since: 0.0 }),
    ];
    let word = derive(axiom, nodes + 2, |symbol| soybean.produce(symbol, random));
    interpret(commands(word))
}

impl Soybean<'_> {
    fn produce(&self, symbol: &Symbol, random: &mut Xoshiro256PlusPlus) -> Option<Vec<Module<Symbol>>> {
        match *symbol {
            Symbol::Apex { node, order, since } => {
                let age = self.appeared - since - node as f64 + 1.0;
                let last = if order == 0 { self.nodes } else { 6 };
                if age < 0.3 || node > last {
                    return None;
                }
                let grown = 0.2 + 0.8 * smooth(0.0, 4.0, age);
                let length_m = 0.056 * self.vigour * (0.6 + 0.4 * smooth(1.0, 5.0, node as f64)) * grown;
                let mut word = vec![
                    Module::Draw(Command::Pitch(random.gen_range(-0.06..0.06))),
                    Module::Draw(Command::Stem { length_m, radius_m: self.radius_m(node, order) }),
                    Module::Draw(Command::Tropism(0.05)),
                ];
                let mut bracket = |symbols: Vec<Module<Symbol>>| {
                    word.push(Module::Draw(Command::Push));
                    word.extend(symbols);
                    word.push(Module::Draw(Command::Pop));
                };
                bracket(vec![Module::Symbol(Symbol::Leaf { node, age })]);
                if node == 1 && order == 0 {
                    let opposite = Module::Draw(Command::Roll(PI));
                    bracket(vec![opposite, Module::Symbol(Symbol::Leaf { node, age })]);
                }
                if order == 0 && (2..=6).contains(&node) && age > 4.0 && random.gen_bool(0.6) {
                    bracket(vec![
                        Module::Draw(Command::Roll(random.gen_range(-0.5..0.5))),
                        Module::Draw(Command::Pitch(random.gen_range(0.6..0.85))),
                        Module::Draw(Command::Axis { part: Part::Stem, radius_m: self.radius_m(6, 1) }),
                        Module::Symbol(Symbol::Apex { node: 1, order: 1, since: node as f64 + 4.0 }),
                    ]);
                }
                if self.params.stage > 0.65 && age > 5.0 && node > 2 - order {
                    bracket(vec![Module::Symbol(Symbol::Pods { age })]);
                }
                word.push(Module::Draw(Command::Roll(PI + random.gen_range(-0.44..0.44))));
                word.push(Module::Symbol(Symbol::Apex { node: node + 1, order, since }));
                Some(word)
            }
            Symbol::Leaf { node, age } => Some(self.leaf(node, age, random).into_iter().map(Module::Draw).collect()),
            Symbol::Pods { age } => Some(self.pods(age, random).into_iter().map(Module::Draw).collect()),
        }
    }

    fn radius_m(&self, node: usize, order: usize) -> f64 {
        let thickness = 0.3 + 0.7 * smooth(0.0, 12.0, self.appeared);
        let taper = 1.0 - 0.75 * node as f64 / (self.nodes + 1) as f64;
        0.0045 * self.vigour * thickness * taper * if order == 0 { 1.0 } else { 0.7 }
    }

    /// Returns a petiole with one leaflet (at the first node) or three.
    fn leaf(&self, node: usize, age: f64, random: &mut Xoshiro256PlusPlus) -> Vec<Command> {
        let grown = 0.15 + 0.85 * smooth(0.0, 3.0, age);
        let single = node == 1;
        let bell = (-((node as f64 - 0.55 * self.nodes as f64) / 7.0).powi(2)).exp();
        let size = self.vigour * grown * random.gen_range(0.88..1.0);
        let petiole_m = if single { 0.05 } else { 0.06 + 0.16 * bell } * size;
        let leaflet_m = LEAFLET_LENGTH_M * (0.62 + 0.38 * bell) * size * if single { 0.7 } else { 1.0 };
        let radius_m = 0.0013 * (0.5 + 0.5 * grown);
        let mut commands = vec![
            Command::Pitch(random.gen_range(0.75..1.05)),
            Command::Axis { part: Part::Stem, radius_m: 1.3 * radius_m },
        ];
        for _ in 0..3 {
            commands.push(Command::Stem { length_m: petiole_m / 3.0, radius_m });
            commands.push(Command::Tropism(0.1));
        }
        // The middle leaflet stands on a stalk ahead of the others, which leave the petiole to both sides.
        let leaflets: &[(f64, f64, f64)] =
            if single { &[(0.0, 0.05, 1.0)] } else { &[(0.0, 0.28, 1.0), (1.3, 0.05, 0.92), (-1.3, 0.05, 0.92)] };
        for &(turn, stalk, share) in leaflets {
            let angle = self.params.leaf_angle_deg.to_radians() * random.gen_range(0.75..1.25);
            commands.extend([
                Command::Push,
                Command::Level(0.1),
                Command::Turn(turn + random.gen_range(-0.15..0.15)),
                Command::Axis { part: Part::Stem, radius_m },
                Command::Stem { length_m: stalk * leaflet_m, radius_m: 0.8 * radius_m },
                Command::Level(-angle.min(1.5)),
                Command::Blade(self.leaflet(leaflet_m * share, random)),
                Command::Pop,
            ]);
        }
        commands
    }

    fn leaflet(&self, length_m: f64, random: &mut Xoshiro256PlusPlus) -> BladeShape {
        let (bend_rad, fold_rad) = (random.gen_range(0.1..0.45), random.gen_range(0.08..0.22));
        let sway_rad = random.gen_range(-0.15..0.15);
        BladeShape {
            outline: Outline::Egg { base: 0.6, tip: 0.95 },
            length_m,
            width_m: LEAFLET_WIDTH * length_m,
            course: Course::Bent { bend_rad, power: 1.5, sway_rad },
            fold_rad: [0.25, fold_rad],
            twist_rad: random.gen_range(-0.2..0.2),
            wave: random.gen_range(0.02..0.07),
            waves: random.gen_range(2.0..3.0),
            wave_phase: random.gen_range(0.0..1.0),
            texture: TextureAlong::Whole,
        }
    }

    /// Returns two or three pods that hang from a node.
    fn pods(&self, age: f64, random: &mut Xoshiro256PlusPlus) -> Vec<Command> {
        /// Radius along a pod of three seeds over its greatest radius.
        const OUTLINE: [f64; 9] = [0.55, 0.95, 0.75, 1.0, 0.78, 1.0, 0.75, 0.6, 0.12];
        let size = self.vigour * smooth(4.0, 9.0, age) * smooth(0.6, 0.95, self.params.stage);
        let count = random.gen_range(2..4);
        let mut commands = Vec::new();
        for i in 0..count {
            commands.extend([
                Command::Push,
                Command::Roll(f64::from(i) * 2.2 + random.gen_range(0.0..0.8)),
                Command::Pitch(random.gen_range(1.1..1.9)),
                Command::Axis { part: Part::Pod, radius_m: 0.0009 },
                Command::Stem { length_m: 0.006, radius_m: 0.0008 },
            ]);
            let step_m = (0.046 * size).max(0.004) / OUTLINE.len() as f64;
            for share in OUTLINE {
                commands.push(Command::Tropism(-0.09));
                commands.push(Command::Stem { length_m: step_m, radius_m: (0.0048 * size * share).max(0.0005) });
            }
            commands.push(Command::Pop);
        }
        commands
    }
}
