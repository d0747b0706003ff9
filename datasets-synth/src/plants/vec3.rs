//! Operations on vectors of three numbers that plants need.

use crate::vector::{cross, dot};

/// Position or direction; metres, y up.
pub(crate) type Vec3 = [f64; 3];

/// Direction straight up.
pub(crate) const UP: Vec3 = [0.0, 1.0, 0.0];

pub(crate) fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(crate) fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn scale(a: Vec3, factor: f64) -> Vec3 {
    a.map(|x| x * factor)
}

/// Returns `a + factor b`.
pub(crate) fn along(a: Vec3, b: Vec3, factor: f64) -> Vec3 {
    add(a, scale(b, factor))
}

pub(crate) fn length(a: Vec3) -> f64 {
    dot(a, a).sqrt()
}

/// Returns the direction of `a`, or `otherwise` where `a` has none.
pub(crate) fn direction_or(a: Vec3, otherwise: Vec3) -> Vec3 {
    let length = length(a);
    if length > 1e-12 { scale(a, 1.0 / length) } else { otherwise }
}

/// Returns `a` rotated about the unit vector `axis` [Rodrigues].
pub(crate) fn turned(a: Vec3, axis: Vec3, angle_rad: f64) -> Vec3 {
    let (sin, cos) = angle_rad.sin_cos();
    let parallel = scale(axis, dot(axis, a) * (1.0 - cos));
    add(add(scale(a, cos), scale(cross(axis, a), sin)), parallel)
}
