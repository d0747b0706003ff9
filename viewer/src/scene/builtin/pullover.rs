//! A pullover: a knitted tube for the body, two for the sleeves, with ribbed borders.

use super::patch::Patch;
use crate::scene::mesh::MeshPart;
use glam::Vec3;
use std::f32::consts::TAU;

const BODY_RIBS: f32 = 70.0;
const SLEEVE_RIBS: f32 = 26.0;
/// Depth of the ribs, metres.
const RIB: f32 = 0.0025;

/// Rises from 0 to 1 between two values, smoothly.
fn rise(from: f32, to: f32, x: f32) -> f32 {
    let part = ((x - from) / (to - from)).clamp(0.0, 1.0);
    part * part * (3.0 - 2.0 * part)
}

fn body(s: f32, t: f32) -> Vec3 {
    let (sin, cos) = (TAU * s).sin_cos();
    // From the hem, over chest and shoulders, into the collar.
    let shoulder = rise(0.72, 0.9, t);
    let width = 0.235 + 0.02 * rise(0.1, 0.5, t) - 0.165 * shoulder;
    let depth = 0.115 + 0.02 * rise(0.1, 0.6, t) - 0.055 * shoulder;
    let height = 0.62 * t.min(0.8) / 0.8 + 0.1 * rise(0.72, 1.0, t);
    let ribbed = (1.0 - rise(0.08, 0.11, t)) + rise(0.93, 0.95, t);
    let slack = (1.0 - shoulder) * 0.008 * (3.0 * TAU * s + 9.0 * t).sin() * (17.0 * t).sin();
    let swell = 1.0 + (RIB * ribbed * (BODY_RIBS * TAU * s).cos() + slack - 0.012 * ribbed * (1.0 - t)) / width;
    Vec3::new(width * swell * cos, height, -depth * swell * sin)
}

fn sleeve(s: f32, t: f32) -> Vec3 {
    // From the cuff to inside the shoulder.
    let path = |t: f32| Vec3::new(0.46 - 0.32 * t - 0.03 * (1.0 - t) * (1.0 - t), 0.05 + 0.44 * t, 0.03 * (1.0 - t));
    let axis = (path(t + 0.01) - path(t - 0.01)).normalize_or(Vec3::Y);
    let side = axis.cross(Vec3::Z).normalize_or(Vec3::X);
    let front = side.cross(axis);
    let ribbed = 1.0 - rise(0.1, 0.14, t);
    let radius = 0.042 + 0.045 * rise(0.0, 1.0, t) + 0.012 * rise(0.1, 0.16, t);
    let folds = (1.0 - ribbed) * 0.0025 * (75.0 * t + 2.5 * (TAU * s).sin()).sin() * rise(0.1, 0.4, t);
    let r = radius + RIB * ribbed * (SLEEVE_RIBS * TAU * s).cos() + folds;
    let (sin, cos) = (TAU * s).sin_cos();
    path(t) + (side * cos - front * sin) * r
}

/// Parts: body, left and right sleeve; all of group 0.
pub(crate) fn pullover() -> Vec<MeshPart> {
    let body = Patch { cells: [400, 130], closed: true, position: body }.whole("body");
    let left = Patch { cells: [160, 110], closed: true, position: sleeve }.whole("sleeve");
    let mut right = left.clone();
    right.transform(glam::Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0)));
    vec![body, left, right]
}
