//! Particle systems: what leaves a surface, is pulled, braked and dies, drawn along its whole path [Reeves & Blau 1985].

use serde::{Deserialize, Serialize};

use crate::shapes::point::Point;
use crate::shapes::shape::Shape;

/// Particles that leave a surface together, whose paths are drawn as round strands or as blades. Thrown upwards, with a V as their
/// section, they are the grass of Reeves and Blau.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParticleSystem {
    /// Emitter: a sheet, a mesh, a sphere, a box, or one of these placed. A point is a small sphere.
    pub from: Shape,
    /// Number of particles, as many from equal areas of the emitter.
    pub particles: u64,
    /// Speed with which a particle leaves, metres a second.
    pub speed_m_per_s: f64,
    /// Direction in which particles leave, of any length; without it the normal of the emitter.
    #[serde(default)]
    pub towards: Option<Point>,
    /// Largest angle between that direction and a particle's own, degrees, 0 to 180; directions are spread evenly over the sphere's
    /// cap.
    #[serde(default)]
    pub spread_deg: f64,
    /// Acceleration, metres a second squared; without it the earth's.
    #[serde(default = "gravity")]
    pub acceleration_m_per_s2: Point,
    /// Share of its speed that a particle loses in a second to the air, which is at rest.
    #[serde(default)]
    pub drag_per_s: f64,
    /// Time for which a particle lives, seconds.
    pub life_s: f64,
    /// Relative variation of speeds and lives, 0 to 1.
    #[serde(default)]
    pub jitter: f64,
    /// What is drawn along the path.
    pub trail: Trail,
    /// Pieces of a path, 1 to 64.
    #[serde(default = "eight")]
    pub segments: u32,
    /// Seed of places, directions and jitter.
    #[serde(default = "first_seed")]
    pub seed: u64,
}

/// What is drawn along the path of a particle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Trail {
    /// Cones from piece to piece.
    Strand {
        /// Radii where the path begins and where it ends, of which one may be 0.
        radii_m: [f64; 2],
    },
    /// A sheet with two equal faces, folded along the path.
    Blade {
        /// Widths where the path begins and where it ends, measured across both halves, of which one may be 0.
        widths_m: [f64; 2],
        /// Angle by which each half rises from the flat, degrees, 0 to 89: its section is a V.
        #[serde(default)]
        fold_deg: f64,
    },
}

fn gravity() -> Point {
    [0.0, 0.0, -9.81]
}

fn eight() -> u32 {
    8
}

fn first_seed() -> u64 {
    1
}
