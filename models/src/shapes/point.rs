//! Positions and vectors in metres.

/// Position in metres, z up.
pub type Point = [f64; 3];

/// Returns the Euclidean length of a vector.
pub(super) fn length(v: Point) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Returns the cross product `a x b`.
pub(super) fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
