//! A lofted shoe in three material zones: upper, toe cap with collar, sole.

use super::last::{bezier, outline, ring, sole};
use super::patch::Patch;
use crate::scene::mesh::MeshPart;
use glam::Vec3;

const SOLE_HEIGHT: f32 = 0.022;

/// Returns a point on the surface of the upper, from the sole (t = 0) to the opening (t = 1).
fn upper(s: f32, t: f32) -> Vec3 {
    let foot = outline(s, SOLE_HEIGHT - 0.003, 0.0);
    let front = 0.5 - 0.5 * (std::f32::consts::TAU * s).cos();
    let collar = ring(s, Vec3::new(-0.068, 0.083 + 0.022 * front, 0.0), 0.052, 0.03);
    let outwards = Vec3::new(foot.x * 0.06, 0.0, foot.z * 0.25);
    let low = foot + Vec3::Y * 0.042 + outwards;
    // Towards the toe the upper lies flat over the foot; beside the heel it stands.
    let high = foot.lerp(collar, 0.45 + 0.25 * front) + Vec3::Y * (0.012 + 0.012 * front);
    bezier([foot, low, high, collar], t)
}

/// Parts in the order of their groups: upper 0, toe cap and collar 1, sole 2.
pub(crate) fn shoe() -> Vec<MeshPart> {
    const COLUMNS: u32 = 240;
    const ROWS: u32 = 112;
    let loft = Patch { cells: [COLUMNS, ROWS], closed: true, position: upper };
    let (cap, cap_rows, collar) = (COLUMNS / 2 - 34..COLUMNS / 2 + 34, 0..ROWS * 3 / 8, ROWS - 10..ROWS);
    let trim = loft.part("toe cap and collar", &[(cap.clone(), cap_rows.clone()), (0..COLUMNS, collar.clone())]);
    let rest = loft.part(
        "upper",
        &[
            (0..cap.start, cap_rows.clone()),
            (cap.end..COLUMNS, cap_rows.clone()),
            (0..COLUMNS, cap_rows.end..collar.start),
        ],
    );
    let sole = Patch { cells: [200, 40], closed: true, position: |s, t| sole(s, t, SOLE_HEIGHT) }.whole("sole");
    [rest, trim, sole].into_iter().enumerate().map(|(group, part)| MeshPart { group, ..part }).collect()
}
