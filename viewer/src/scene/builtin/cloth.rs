//! A square cloth draped over a round table.

use super::patch::Patch;
use crate::scene::mesh::MeshPart;
use glam::{Vec2, Vec3};

/// Edge of the cloth, metres.
const EDGE: f32 = 1.5;
/// Radius of the table, metres.
const TABLE: f32 = 0.5;
/// Height of the table, metres.
const HEIGHT: f32 = 0.75;
const FOLDS: f32 = 11.0;
/// Metres over which the cloth turns down at the table's edge.
const BEND: f32 = 0.04;
/// Slope of the hanging cloth against the vertical, radians.
const FLARE: f32 = 0.2;

/// Radius and depth below the table of a point that hangs `down` metres from its edge.
fn hanging(down: f32) -> (f32, f32) {
    const STEPS: u32 = 48;
    let step = down / STEPS as f32;
    let turn = std::f32::consts::FRAC_PI_2 - FLARE;
    (0..STEPS).fold((TABLE, 0.0), |(radius, depth), i| {
        let angle = turn * (1.0 - (-(i as f32 + 0.5) * step / BEND).exp());
        (radius + step * angle.cos(), depth + step * angle.sin())
    })
}

/// Makes the cloth. Where it hangs, a ring of it is longer than the circle on which it hangs: the rest goes into folds,
/// so that lengths along the rings are kept to second order in the folds' slope.
pub(crate) fn cloth() -> Vec<MeshPart> {
    let position = |s: f32, t: f32| {
        let flat = Vec2::new(s - 0.5, 0.5 - t) * EDGE;
        let rho = flat.length();
        if rho <= TABLE {
            return Vec3::new(flat.x, HEIGHT, flat.y);
        }
        let angle = flat.y.atan2(flat.x);
        let (radius, depth) = hanging(rho - TABLE);
        let fold = 2.0 * radius / FOLDS * (rho / radius - 1.0).max(0.0).sqrt();
        let folded = radius + fold * (FOLDS * angle).cos();
        Vec3::new(folded * angle.cos(), HEIGHT - depth, folded * angle.sin())
    };
    vec![Patch { cells: [180, 180], closed: false, position }.whole("cloth")]
}
