//! A pair of lofted boots: shaft and foot in one chart, soles.

use super::last::{bezier, outline, ring, sole};
use super::patch::Patch;
use crate::scene::mesh::MeshPart;
use glam::{Mat4, Vec3};

const SOLE_HEIGHT: f32 = 0.03;
/// Share of the chart below the ankle.
const FOOT: f32 = 0.4;
/// Height of the ankle and of the shaft's edge, metres.
const ANKLE: f32 = 0.12;
const EDGE: f32 = 0.36;

fn ankle(s: f32, height: f32) -> Vec3 {
    let up = ((height - ANKLE) / (EDGE - ANKLE)).clamp(0.0, 1.0);
    // The calf is the widest at two thirds.
    let calf = (std::f32::consts::PI * (0.1 + 0.8 * up)).sin();
    ring(s, Vec3::new(-0.075 - 0.01 * calf, height, 0.0), 0.05 + 0.018 * calf, 0.038 + 0.016 * calf)
}

fn leather(s: f32, t: f32) -> Vec3 {
    if t >= FOOT {
        let height = ANKLE + (EDGE - ANKLE) * (t - FOOT) / (1.0 - FOOT);
        // Creases above the ankle.
        let crease = 0.0012
            * (-((height - 0.15) / 0.025).powi(2)).exp()
            * (height * 330.0 + 0.8 * (std::f32::consts::TAU * s).cos()).sin();
        let at = ankle(s, height);
        let outwards = (at - Vec3::new(-0.08, height, 0.0)).normalize_or_zero();
        return at + outwards * crease;
    }
    let foot = outline(s, SOLE_HEIGHT - 0.004, 0.0);
    let top = ankle(s, ANKLE);
    let front = 0.5 - 0.5 * (std::f32::consts::TAU * s).cos();
    let outwards = Vec3::new(foot.x * 0.05, 0.0, foot.z * 0.2);
    let low = foot + Vec3::Y * 0.045 + outwards;
    let high = (foot.lerp(top, 0.8)).with_y(ANKLE - 0.035 + 0.005 * front);
    bezier([foot, low, high, top], t / FOOT)
}

/// Parts: left and right leather, group 0; left and right sole, group 1.
pub(crate) fn boots() -> Vec<MeshPart> {
    let leather = Patch { cells: [160, 120], closed: true, position: leather }.whole("leather");
    let sole = Patch { cells: [160, 40], closed: true, position: |s, t| sole(s, t, SOLE_HEIGHT) }.whole("sole");
    let mut parts = Vec::new();
    for (group, part) in [leather, sole].into_iter().enumerate() {
        let turned = Mat4::from_rotation_y(0.35) * Mat4::from_translation(Vec3::new(0.03, 0.0, -0.1));
        for matrix in [Mat4::from_translation(Vec3::Z * 0.08), turned * Mat4::from_scale(Vec3::new(1.0, 1.0, -1.0))] {
            let mut part = MeshPart { group, ..part.clone() };
            part.transform(matrix);
            parts.push(part);
        }
    }
    parts
}
