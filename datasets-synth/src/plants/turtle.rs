//! Turtle that interprets the commands of a word as organs [Prusinkiewicz & Lindenmayer 1990, sections 1.3 and 1.5].
//!
//! The turtle has a position and a frame of heading H, left L and up U, with H x L = U. It starts at the origin,
//! heading up (y), with L along -x and U along z.

use crate::plants::blade::{Blade, BladeShape};
use crate::plants::plant::{Axis, Node, Part, Plant};
use crate::plants::vec3::{UP, Vec3, along, direction_or, scale, sub, turned};
use crate::vector::{cross, dot};

/// Golden angle in radians: from branch to branch around an axis [Prusinkiewicz & Lindenmayer 1990, section 4.1].
pub(crate) const GOLDEN_RAD: f64 = 2.399_963_229_728_653;

/// Command to the turtle. Angles are in radians, lengths in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Command {
    /// Remember the state: `[`.
    Push,
    /// Return to the last remembered state: `]`.
    Pop,
    /// Turn left about U: `+`.
    Turn(f64),
    /// Pitch down about L: `&`.
    Pitch(f64),
    /// Roll about H: `\`.
    Roll(f64),
    /// Keep the azimuth of the heading, at an elevation over the horizon, with L level: for leaves that face the sky.
    Level(f64),
    /// Turn towards straight up by at most this angle; towards straight down where negative.
    Tropism(f64),
    /// Move ahead without drawing: `f`.
    Move(f64),
    /// Start an axis at the position.
    Axis { part: Part, radius_m: f64 },
    /// Move ahead and lengthen the axis, to a radius at its new end: `F`.
    Stem { length_m: f64, radius_m: f64 },
    /// Place a blade at the position: it grows along H, its upper face along U.
    Blade(BladeShape),
}

#[derive(Debug, Clone, Copy)]
struct State {
    position_m: Vec3,
    heading: Vec3,
    left: Vec3,
    up: Vec3,
    /// Index of the axis that grows.
    axis: Option<usize>,
}

impl State {
    fn turn_all(&mut self, axis: Vec3, angle_rad: f64) {
        let heading = direction_or(turned(self.heading, axis, angle_rad), self.heading);
        let left = turned(self.left, axis, angle_rad);
        // Orthonormal again, so that thousands of turns do not wear the frame out.
        let left = direction_or(sub(left, scale(heading, dot(left, heading))), self.left);
        (self.heading, self.left, self.up) = (heading, left, cross(heading, left));
    }

    /// Turns the heading towards straight up by at most `angle_rad`.
    fn bend_up(&mut self, angle_rad: f64) {
        let axis = cross(self.heading, UP);
        if dot(axis, axis) > 1e-12 {
            let between = dot(self.heading, UP).clamp(-1.0, 1.0).acos();
            let angle = angle_rad.clamp(between - std::f64::consts::PI, between);
            self.turn_all(direction_or(axis, self.left), angle);
        }
    }

    fn level(&mut self, elevation_rad: f64) {
        // Straight up there is no azimuth: the frame's own down side serves.
        let flat = |v: Vec3| [v[0], 0.0, v[2]];
        let backwards = direction_or(flat(scale(self.up, -1.0)), [1.0, 0.0, 0.0]);
        let level = match dot(flat(self.heading), flat(self.heading)) > 1e-6 {
            true => direction_or(flat(self.heading), backwards),
            false => backwards,
        };
        self.heading = along(scale(level, elevation_rad.cos()), UP, elevation_rad.sin());
        self.left = cross(UP, level);
        self.up = cross(self.heading, self.left);
    }
}

/// Returns the organs that commands draw. A closing bracket without an opening one is ignored.
pub(crate) fn interpret(commands: impl IntoIterator<Item = Command>) -> Plant {
    let mut plant = Plant::default();
    let start = State { position_m: [0.0; 3], heading: UP, left: [-1.0, 0.0, 0.0], up: [0.0, 0.0, 1.0], axis: None };
    let (mut state, mut stack) = (start, Vec::new());
    for command in commands {
        match command {
            Command::Push => stack.push(state),
            Command::Pop => state = stack.pop().unwrap_or(state),
            Command::Turn(angle) => state.turn_all(state.up, angle),
            Command::Pitch(angle) => state.turn_all(state.left, angle),
            Command::Roll(angle) => state.turn_all(state.heading, angle),
            Command::Level(elevation) => state.level(elevation),
            Command::Tropism(angle) => state.bend_up(angle),
            Command::Move(length_m) => state.position_m = along(state.position_m, state.heading, length_m),
            Command::Axis { part, radius_m } => {
                state.axis = Some(plant.axes.len());
                plant.axes.push(Axis { part, nodes: vec![Node { position_m: state.position_m, radius_m }] });
            }
            Command::Stem { length_m, radius_m } => {
                state.position_m = along(state.position_m, state.heading, length_m);
                if let Some(axis) = state.axis {
                    plant.axes[axis].nodes.push(Node { position_m: state.position_m, radius_m });
                }
            }
            Command::Blade(shape) => {
                plant.blades.push(Blade { origin_m: state.position_m, along: state.heading, normal: state.up, shape })
            }
        }
    }
    plant.axes.retain(|axis| axis.nodes.len() > 1);
    plant
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    fn end(commands: &[Command]) -> Vec3 {
        let axis = Command::Axis { part: Part::Stem, radius_m: 0.01 };
        let step = Command::Stem { length_m: 1.0, radius_m: 0.01 };
        let plant = interpret([axis].into_iter().chain(commands.iter().copied()).chain([step]));
        plant.axes[0].nodes.last().unwrap().position_m
    }

    fn is(found: Vec3, expected: Vec3) {
        assert!((0..3).all(|k| (found[k] - expected[k]).abs() < 1e-12), "{found:?} {expected:?}");
    }

    #[test]
    fn turns_are_the_books() {
        is(end(&[]), [0.0, 1.0, 0.0]);
        is(end(&[Command::Turn(FRAC_PI_2)]), [-1.0, 0.0, 0.0]);
        is(end(&[Command::Pitch(FRAC_PI_2)]), [0.0, 0.0, -1.0]);
        is(end(&[Command::Roll(FRAC_PI_2), Command::Turn(FRAC_PI_2)]), [0.0, 0.0, 1.0]);
        is(end(&[Command::Push, Command::Pitch(0.7), Command::Move(3.0), Command::Pop]), [0.0, 1.0, 0.0]);
        is(end(&[Command::Pop]), [0.0, 1.0, 0.0]);
    }

    #[test]
    fn tropism_stops_at_the_vertical_and_level_keeps_the_azimuth() {
        let down = [Command::Turn(0.3), Command::Pitch(1.1)];
        is(end(&[&down[..], &[Command::Tropism(9.0)]].concat()), [0.0, 1.0, 0.0]);
        let before = end(&down);
        let after = end(&[&down[..], &[Command::Tropism(0.2)]].concat());
        assert!((before[1].acos() - after[1].acos() - 0.2).abs() < 1e-9);
        let level = end(&[&down[..], &[Command::Level(-0.4)]].concat());
        assert!((level[1] + 0.4f64.sin()).abs() < 1e-12);
        assert!((level[0] * before[2] - level[2] * before[0]).abs() < 1e-12 && level[0] * before[0] > 0.0);
    }
}
