//! Values of keys that a scene file leaves out.

/// Returns the y axis, which is up.
pub(super) fn y_axis() -> [f32; 3] {
    [0.0, 1.0, 0.0]
}

/// Returns the vertical field of view of a camera, degrees.
pub(super) fn default_fov_deg() -> f32 {
    30.0
}

/// Returns the factor that changes nothing.
pub(super) fn one() -> f32 {
    1.0
}

/// Returns factors along two axes that change nothing.
pub(super) fn ones2() -> [f32; 2] {
    [1.0; 2]
}

/// Returns factors along three axes that change nothing.
pub(super) fn ones3() -> [f32; 3] {
    [1.0; 3]
}

/// Returns the mean angular diameter of the sun, degrees.
pub(super) fn sun_diameter_deg() -> f32 {
    crate::light::sun::SUN_DIAMETER_DEG
}
