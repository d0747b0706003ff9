//! The blade of a leaf: an ovate outline cut once out of a captured patch, folded along its main vein and arched.

use super::patch::unit_normal;
use crate::geometry::geometry::Vertex;
use crate::scene::mesh::{MeshPart, fill_tangents};
use glam::Vec3;
use std::f32::consts::PI;

/// Length of the blade in metres; one unit of texture coordinate covers it, so a patch is shown once, whatever its size.
const LENGTH: f32 = 0.06;
/// Texture coordinate u of the main vein: patches that btf-synth grows have it about there.
const MAIN_VEIN_U: f32 = 0.375;
/// Greatest half width over length. With the main vein where it is, the outline stays within the patch.
const HALF_WIDTH: f32 = 0.29;
/// Place of the greatest width along the blade, from the base (0) to the tip (1).
const WIDEST: f32 = 0.4;
/// Angle in radians by which either half is folded up.
const FOLD: f32 = 0.3;
/// Angle in radians by which the tip is turned down from the base.
const ARCH: f32 = 0.9;
/// Height of the waves of the margin over the blade's length.
const WAVE: f32 = 0.012;
/// Cells across and along.
const CELLS: [u32; 2] = [64, 96];

/// Half width over length at `t` along the blade: pointed at the tip, rounded at the base.
fn half_width(t: f32) -> f32 {
    // Stretches the half circle of the sine so that its top lies where the blade is widest.
    let power = 0.5f32.ln() / WIDEST.ln();
    let warped = t.clamp(0.0, 1.0).powf(power);
    // A greater power draws the outline in: little at the base, more at the tip.
    HALF_WIDTH * (PI * warped).sin().max(0.0).powf(0.7 + 0.7 * t)
}

/// Position in metres of a point `across` (-1 to 1, margin to margin) and `t` along.
fn position(across: f32, t: f32) -> Vec3 {
    let x = across * half_width(t);
    // The main vein is an arc of constant curvature; the halves rise from it.
    let angle = ARCH * (t - 0.5);
    let (sin, cos) = angle.sin_cos();
    let along = Vec3::new(0.0, sin / ARCH, (cos - 1.0) / ARCH);
    let up = Vec3::new(0.0, -sin, cos);
    // A fold that is round at the vein itself, so that it has a normal there.
    let round = 0.02;
    let lift = FOLD.tan() * ((x * x + round * round).sqrt() - round);
    // The waves shrink with the width, so that the narrow ends stay smooth.
    let wave = WAVE * (across * across) * half_width(t) / HALF_WIDTH * (7.0 * PI * t + 0.8 * across.signum()).sin();
    LENGTH * (along + Vec3::X * x + up * (lift + wave))
}

/// Builds the blade, its upper face towards +z and its tip towards +y.
pub(crate) fn leaf_blade() -> Vec<MeshPart> {
    let [columns, rows] = CELLS;
    let place = |i: u32, j: u32| {
        // Neither base nor tip is a point: rows there would have no width to take a tangent from.
        let t = 0.004 + 0.992 * j as f32 / rows as f32;
        (2.0 * i as f32 / columns as f32 - 1.0, t)
    };
    let mut vertices = Vec::with_capacity((columns as usize + 1) * (rows as usize + 1));
    for (j, i) in (0..=rows).flat_map(|j| (0..=columns).map(move |i| (j, i))) {
        let (across, t) = place(i, j);
        let [da, dt] = [1.0 / columns as f32, 0.5 / rows as f32];
        let along_x = position((across + da).min(1.0), t) - position((across - da).max(-1.0), t);
        let along_t = position(across, (t + dt).min(1.0)) - position(across, (t - dt).max(0.0));
        vertices.push(Vertex {
            position: position(across, t).to_array(),
            u: MAIN_VEIN_U + across * half_width(t),
            normal: unit_normal(along_x, along_t).to_array(),
            v: t,
            tangent: [1.0, 0.0, 0.0, 1.0],
        });
    }
    let mut triangles = Vec::new();
    for (j, i) in (0..rows).flat_map(|j| (0..columns).map(move |i| (j, i))) {
        let a = j * (columns + 1) + i;
        let (b, c, d) = (a + 1, a + columns + 2, a + columns + 1);
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    fill_tangents(&mut vertices, &triangles);
    vec![MeshPart::built_in("leaf", vertices, triangles)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_blade_lies_once_within_the_patch_and_faces_the_eye() {
        let part = &leaf_blade()[0];
        assert!(part.vertices.iter().all(|vertex| (0.0..=1.0).contains(&vertex.u) && (0.0..=1.0).contains(&vertex.v)));
        assert!(part.vertices.iter().all(|vertex| vertex.normal[2] > 0.2), "no part is turned away");
        let width = part.vertices.iter().map(|vertex| vertex.u).fold(0.0f32, f32::max) - MAIN_VEIN_U;
        assert!((0.28..HALF_WIDTH + 1e-4).contains(&width), "{width}");
        assert!(half_width(0.996) < 0.03 && half_width(0.004) < 0.15);
    }
}
