//! What shoes and boots are built over: the outline of the sole, and curves from it to the opening.

use glam::Vec3;
use std::f32::consts::TAU;

/// Half of a foot's length, metres.
pub(crate) const HALF_LENGTH: f32 = 0.14;
/// Roundness of outlines: 2 is an ellipse.
const ROUNDNESS: f32 = 2.5;

/// Returns the point of the sole's outline at `s`, 0 at the heel, 0.5 at the toe, clockwise seen from above; `y` is its
/// height, `margin` how far it lies outside.
pub(crate) fn outline(s: f32, y: f32, margin: f32) -> Vec3 {
    let (sin, cos) = (TAU * s).sin_cos();
    let round = |x: f32| x.signum() * x.abs().powf(2.0 / ROUNDNESS);
    let x = -(HALF_LENGTH + margin) * round(cos);
    // The ball of the foot is wider than the heel and lies to one side.
    let forward = ((x + 0.06) / 0.11).clamp(0.0, 1.0);
    let wide = forward * forward * (3.0 - 2.0 * forward);
    let half_width = 0.032 + 0.014 * wide + margin;
    let bent = 0.01 * (3.0 * x / HALF_LENGTH).cos() * wide;
    Vec3::new(x, y, half_width * round(sin) + bent)
}

/// Returns the point of an upright ellipse about `centre`, at the same `s` as the outline's.
pub(crate) fn ring(s: f32, centre: Vec3, half_length: f32, half_width: f32) -> Vec3 {
    let (sin, cos) = (TAU * s).sin_cos();
    centre + Vec3::new(-half_length * cos, 0.0, half_width * sin)
}

/// Returns the point at `t` of a cubic Bezier curve.
pub(crate) fn bezier([a, b, c, d]: [Vec3; 4], t: f32) -> Vec3 {
    let r = 1.0 - t;
    a * (r * r * r) + b * (3.0 * r * r * t) + c * (3.0 * r * t * t) + d * (t * t * t)
}

/// Returns a point on the surface of the sole: from the middle of its underside (t = 0) over the edge and up the side
/// to under the upper (t = 1).
pub(crate) fn sole(s: f32, t: f32, height: f32) -> Vec3 {
    const UNDERSIDE: f32 = 0.55;
    const SIDE: f32 = 0.85;
    const MARGIN: f32 = 0.006;
    let edge = outline(s, 0.0, MARGIN);
    if t < UNDERSIDE {
        // From the middle line, not from a point: cells stay broad.
        let inner = Vec3::new(0.8 * edge.x, 0.0, 0.15 * edge.z);
        inner.lerp(edge, t / UNDERSIDE)
    } else if t < SIDE {
        let part = (t - UNDERSIDE) / (SIDE - UNDERSIDE);
        edge + Vec3::Y * height * part
    } else {
        let part = (t - SIDE) / (1.0 - SIDE);
        outline(s, height, MARGIN * (1.0 - 2.0 * part))
    }
}
