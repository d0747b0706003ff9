//! Blades: curved, folded, wavy surfaces over an outline, by two numbers: across and along.
//!
//! | parameter | unit | valid |
//! |---|---|---|
//! | length, width | m | > 0 |
//! | bent: turn of the midrib from base to tip, towards the lower face | rad | -pi to pi |
//! | its power: 1 a circle, more a straight base and a drooping tip | - | 0.5 to 4 |
//! | sway: turn to one side from base to tip | rad | -2 to 2 |
//! | thrown: how far a particle falls on its way, as a share of how far it is thrown | - | 0 to 2 |
//! | fold: elevation of both halves over the midrib, at the base and from the middle on | rad | 0 to 1.5 |
//! | twist: turn about the midrib from base to tip | rad | -2 to 2 |
//! | wave: height of the margin's waves as a share of half the width, and their number | - | 0 to 0.5, 0 to 20 |
//!
//! A bent midrib resembles an elastica, `phi(s) = bend s^power` over the share s of its length, which [Stewart & Dwyer
//! 1993] fit with quadratics. A thrown one is the parabola of a particle under gravity, by the share of its time
//! [Reeves & Blau 1985]. When it is wrong: the surface is not developable, so a strongly curved blade is stretched a
//! little at its margins, and blades may intersect.

use std::f64::consts::TAU;

use crate::plants::vec3::{UP, Vec3, along, direction_or, length, scale, sub, turned};
use crate::vector::cross;

/// Nodes and weights of Gauss and Legendre's rule of five points on 0 to 1.
const GAUSS: [[f64; 2]; 5] = [
    [0.046_910_077_030_668, 0.118_463_442_528_095],
    [0.230_765_344_947_158, 0.239_314_335_249_683],
    [0.5, 0.284_444_444_444_444],
    [0.769_234_655_052_842, 0.239_314_335_249_683],
    [0.953_089_922_969_332, 0.118_463_442_528_095],
];

/// Greatest width of the outline of a grass before it is scaled to 1.
const GRASS_WIDEST: f64 = 0.9299;

/// Width of the rounding at the midrib, as a share of half the width.
const MIDRIB_ROUNDING: f64 = 0.12;

/// Step of the differences that normals are made of.
const STEP: f64 = 1e-4;

/// Outline of a blade: its width from base to tip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Outline {
    /// Outline of a grass: wide at the base, widest at a third, drawn out to the tip.
    Grass,
    /// Outline `v^base (1 - v)^tip`, scaled to 1: an egg, pointed at both ends.
    Egg { base: f64, tip: f64 },
}

impl Outline {
    /// Returns the share of the greatest width at the share `v` of the length.
    pub fn width(self, v: f64) -> f64 {
        let v = v.clamp(0.0, 1.0);
        match self {
            Outline::Grass => {
                let t = (v / 0.35).min(1.0);
                (0.58 + 0.42 * t * t * (3.0 - 2.0 * t)) * (1.0 - v.powf(2.3)).powf(0.85) / GRASS_WIDEST
            }
            Outline::Egg { base, tip } => {
                let widest = base / (base + tip);
                (v / widest).powf(base) * ((1.0 - v) / (1.0 - widest)).powf(tip)
            }
        }
    }
}

/// Texture coordinates along a blade.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum TextureAlong {
    /// Texture that covers the blade once from base to tip.
    Whole,
    /// Texture that repeats at this distance in metres.
    Every(f64),
}

/// Course of a midrib.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Course {
    /// Course that resembles an elastica.
    Bent { bend_rad: f64, power: f64, sway_rad: f64 },
    /// Course of a particle that is thrown: a parabola that falls straight down by this share of the length.
    Thrown { fall: f64 },
}

/// Shape of a blade; see the table of the module.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BladeShape {
    pub outline: Outline,
    /// Length of a bent midrib in metres, or of the throw without gravity.
    pub length_m: f64,
    pub width_m: f64,
    pub course: Course,
    pub fold_rad: [f64; 2],
    pub twist_rad: f64,
    pub wave: f64,
    pub waves: f64,
    /// Phase at which the waves start, 0 to 1.
    pub wave_phase: f64,
    pub texture: TextureAlong,
}

/// Blade in its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Blade {
    pub origin_m: Vec3,
    /// Direction of the midrib at the base.
    pub along: Vec3,
    /// Normal of the upper face at the base.
    pub normal: Vec3,
    pub shape: BladeShape,
}

/// Point of a blade with its frame: unit normal of the upper face, unit tangent across it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BladePoint {
    pub position_m: Vec3,
    pub normal: Vec3,
    pub tangent: Vec3,
}

impl Blade {
    /// Returns the area of one face over its outline, in square metres.
    pub fn area_m2(&self) -> f64 {
        /// Number of strips of the midpoint rule.
        const STRIPS: usize = 64;
        let middles = (0..STRIPS).map(|i| (i as f64 + 0.5) / STRIPS as f64);
        let strips = middles.map(|v| self.shape.outline.width(v) * length(self.advance(v)));
        strips.sum::<f64>() / STRIPS as f64 * self.shape.length_m * self.shape.width_m
    }

    /// Returns the texture coordinate at the share `v` of the length, which grows towards the tip.
    pub fn texture_v(&self, v: f64) -> f64 {
        match self.shape.texture {
            TextureAlong::Whole => v,
            TextureAlong::Every(metres) => v * self.shape.length_m / metres,
        }
    }

    /// Returns the point at `u` across (0 left margin, 0.5 midrib, 1 right margin, seen from above with the tip up) and
    /// `v` along (0 base, 1 tip).
    pub fn point(&self, u: f64, v: f64) -> BladePoint {
        let across = 2.0 * u - 1.0;
        let half_width = |v: f64| 0.5 * self.shape.width_m * self.shape.outline.width(v);
        let at = |across: f64, v: f64| along(self.midrib(v), self.section(across, v), half_width(v));
        // Over the section alone, which does not vanish where the blade has no width.
        let tangent = sub(self.section(across + STEP, v), self.section(across - STEP, v));
        // Towards the inside at the ends, where outlines may be vertical.
        let (low, high) = ((v - STEP).max(0.0), (v + STEP).min(1.0));
        let [tangent_midrib, _, normal_midrib] = self.frame(v);
        let tangent = direction_or(tangent, cross(tangent_midrib, normal_midrib));
        // Along a line of constant distance from the midrib, so that a changing width does not tilt the frame.
        let width = half_width(v);
        let fixed = |v: f64| along(self.midrib(v), self.section(across, v), width);
        let forwards = direction_or(sub(fixed(high), fixed(low)), tangent_midrib);
        let normal = direction_or(cross(tangent, forwards), normal_midrib);
        BladePoint { position_m: at(across, v), normal, tangent }
    }

    /// Returns the derivative of the midrib at its share `v` over the length, before the twist; a unit vector for a
    /// bent midrib.
    fn advance(&self, v: f64) -> Vec3 {
        match self.shape.course {
            Course::Bent { bend_rad, power, sway_rad } => {
                let (sin_bend, cos_bend) = (bend_rad * v.powf(power)).sin_cos();
                let (sin_sway, cos_sway) = (sway_rad * v * v).sin_cos();
                let side = cross(self.along, self.normal);
                let bent = along(scale(self.along, cos_bend), self.normal, -sin_bend);
                along(scale(bent, cos_sway), side, sin_sway)
            }
            Course::Thrown { fall } => along(self.along, UP, -2.0 * fall * v),
        }
    }

    fn midrib(&self, v: f64) -> Vec3 {
        let step = |sum: Vec3, [node, weight]: [f64; 2]| along(sum, self.advance(v * node), weight);
        along(self.origin_m, GAUSS.into_iter().fold([0.0; 3], step), v * self.shape.length_m)
    }

    /// Returns the frame at the share `v`: along the midrib, across to the right, and out of the upper face.
    fn frame(&self, v: f64) -> [Vec3; 3] {
        let advance = self.advance(v);
        let (forwards, upright) = match self.shape.course {
            Course::Bent { bend_rad, power, .. } => {
                let (sin, cos) = (bend_rad * v.powf(power)).sin_cos();
                (advance, along(scale(self.normal, cos), self.along, sin))
            }
            // Turned from the base's normal as the midrib is from the base's direction, within the path's plane.
            Course::Thrown { .. } => {
                let forwards = direction_or(advance, self.along);
                (forwards, cross(cross(self.along, self.normal), forwards))
            }
        };
        let side = direction_or(cross(forwards, upright), cross(self.along, self.normal));
        let side = turned(side, forwards, self.shape.twist_rad * v);
        [forwards, side, cross(side, forwards)]
    }

    /// Returns the vector from the midrib to the place `across`, -1 to 1, in units of half the width.
    fn section(&self, across: f64, v: f64) -> Vec3 {
        let shape = &self.shape;
        let [_, side, normal] = self.frame(v);
        // The base's fold opens over the first half.
        let t = (2.0 * v).clamp(0.0, 1.0);
        let fold = shape.fold_rad[0] + (shape.fold_rad[1] - shape.fold_rad[0]) * t * t * (3.0 - 2.0 * t);
        let rounded = (across * across + MIDRIB_ROUNDING * MIDRIB_ROUNDING).sqrt() - MIDRIB_ROUNDING;
        // The two margins wave out of step; neither the base nor the midrib does.
        let phase = shape.wave_phase + 0.37 * across.signum();
        let wave = shape.wave * t * across.abs().powi(3) * (TAU * (shape.waves * v + phase)).sin();
        along(scale(side, across * fold.cos()), normal, rounded * fold.sin() + wave)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::dot;

    fn blade() -> Blade {
        let shape = BladeShape {
            outline: Outline::Grass,
            length_m: 0.8,
            width_m: 0.1,
            course: Course::Bent { bend_rad: 1.9, power: 1.6, sway_rad: 0.3 },
            fold_rad: [0.9, 0.2],
            twist_rad: 0.4,
            wave: 0.15,
            waves: 6.0,
            wave_phase: 0.2,
            texture: TextureAlong::Every(0.1),
        };
        Blade { origin_m: [1.0, 2.0, 3.0], along: [0.0, 1.0, 0.0], normal: [0.0, 0.0, 1.0], shape }
    }

    #[test]
    fn frames_are_unit_and_normals_face_the_upper_side() {
        let blade = blade();
        for i in 0..=20 {
            for j in 0..=20 {
                let point = blade.point(f64::from(i) / 20.0, f64::from(j) / 20.0);
                assert!((length(point.normal) - 1.0).abs() < 1e-9 && (length(point.tangent) - 1.0).abs() < 1e-9);
                assert!(dot(point.normal, point.tangent).abs() < 1e-9);
                let [_, side, upper] = blade.frame(f64::from(j) / 20.0);
                assert!(dot(point.normal, upper) > 0.2 && dot(point.tangent, side) > 0.2, "{i} {j}");
            }
        }
    }

    #[test]
    fn the_midrib_has_its_length_and_bends_as_it_should() {
        let blade = blade();
        let points: Vec<Vec3> = (0..=400).map(|i| blade.point(0.5, f64::from(i) / 400.0).position_m).collect();
        let sum: f64 = points.windows(2).map(|pair| length(sub(pair[1], pair[0]))).sum();
        assert!((sum - 0.8).abs() < 1e-3, "{sum}");
        let course = Course::Bent { bend_rad: 1.9, power: 1.6, sway_rad: 0.0 };
        let flat = Blade { shape: BladeShape { course, ..blade.shape }, ..blade };
        let end = sub(flat.midrib(1.0), flat.midrib(0.999));
        assert!((dot(direction_or(end, [0.0; 3]), flat.along).acos() - 1.9).abs() < 5e-3);
        assert!(end[2] < 0.0, "away from the upper face");
    }

    #[test]
    fn outlines_are_widest_at_one_and_end_in_a_point() {
        for outline in [Outline::Grass, Outline::Egg { base: 0.7, tip: 0.95 }] {
            let most = (0..=1000).map(|i| outline.width(f64::from(i) / 1000.0)).fold(0.0, f64::max);
            assert!((most - 1.0).abs() < 1e-4, "{outline:?} {most}");
            assert!(outline.width(1.0) < 1e-9);
        }
        // A maize blade's area is three quarters of length times width [Montgomery 1911].
        let share = blade().area_m2() / (0.8 * 0.1);
        assert!((0.7..0.8).contains(&share), "{share}");
    }
}
