//! How an object or a skin of a scene file stands in the world.

use glam::{EulerRot, Mat4, Quat};

/// Returns the map that scales, then turns about x, y and z, then moves; `None` where it has no inverse.
pub(super) fn world_from_entry(scale: [f32; 3], rotate_deg: [f32; 3], translate: [f32; 3]) -> Option<Mat4> {
    let [x, y, z] = rotate_deg.map(f32::to_radians);
    // glam applies the last letter's angle first.
    let rotation = Quat::from_euler(EulerRot::ZYX, z, y, x);
    let matrix = Mat4::from_scale_rotation_translation(scale.into(), rotation, translate.into());
    (matrix.is_finite() && matrix.determinant().abs() > 1e-30).then_some(matrix)
}
