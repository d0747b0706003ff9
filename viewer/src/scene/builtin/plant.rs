//! A row crop in outline: long blades that rise from a stem and arch over. It stands in for a model of maize where none is at
//! hand, in what is measured: about as many triangles a plant and leaves over as much ground.

use super::patch::Patch;
use crate::scene::mesh::MeshPart;
use glam::{Quat, Vec3};

/// Blades of a plant.
const BLADES: u32 = 14;
/// Cells of a blade across and along: with the stem some 2,700 triangles a plant.
const BLADE_CELLS: [u32; 2] = [4, 22];
/// Height of the stem, metres.
const STEM_M: f32 = 1.6;
/// Radius of the stem, metres.
const STEM_RADIUS_M: f32 = 0.012;
/// Length of the middle blade, metres; the lowest and the highest have half of it.
const BLADE_M: f32 = 0.75;
/// Greatest half width of a blade, metres.
const HALF_WIDTH_M: f32 = 0.04;
/// Angle between a blade and the next, radians: opposite, and turned on a little.
const TURN_RAD: f32 = 3.4;

/// Builds the plant, standing on the origin, y up.
pub(crate) fn plant() -> Vec<MeshPart> {
    let stem = Patch {
        cells: [6, 4],
        closed: true,
        position: |s: f32, t: f32| {
            let (sin, cos) = (std::f32::consts::TAU * s).sin_cos();
            let radius = STEM_RADIUS_M * (1.0 - 0.7 * t);
            Vec3::new(radius * sin, STEM_M * t, radius * cos)
        },
    };
    let mut parts = vec![stem.whole("plant")];
    parts.extend((0..BLADES).map(|number| {
        let up = (number as f32 + 0.5) / BLADES as f32;
        let length = BLADE_M * (0.5 + 2.0 * up * (1.0 - up));
        let turn = Quat::from_rotation_y(TURN_RAD * number as f32);
        let root = Vec3::Y * STEM_M * (0.1 + 0.88 * up);
        let position = move |s: f32, t: f32| {
            // The blade leaves the stem steeply and falls over by its own weight.
            let along = Vec3::new(0.0, 0.9 * t - 1.1 * t * t, 0.3 * t + 0.6 * t * t);
            let width = HALF_WIDTH_M * (4.0 * (0.1 + 0.9 * t) * (1.03 - t)).min(1.0);
            let across = 2.0 * s - 1.0;
            root + turn * (length * along + width * (across * Vec3::X + 0.25 * across * across * Vec3::Y))
        };
        Patch { cells: BLADE_CELLS, closed: false, position }.whole("plant")
    }));
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plant_stands_on_the_ground_and_has_as_many_triangles_as_it_says() {
        let parts = plant();
        let triangles: usize = parts.iter().map(|part| part.triangles.len()).sum();
        assert!((2_400..2_900).contains(&triangles), "{triangles}");
        let positions = parts.iter().flat_map(|part| &part.vertices).map(|vertex| Vec3::from(vertex.position));
        let (lo, hi) = positions.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), at| (lo.min(at), hi.max(at)));
        assert!(lo.y > -0.01 && (1.5..2.2).contains(&hi.y), "{lo} {hi}");
        assert!(hi.x.max(hi.z) > 0.3 && lo.x.min(lo.z) < -0.3, "{lo} {hi}");
    }
}
