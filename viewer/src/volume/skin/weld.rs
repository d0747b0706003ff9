//! Which vertices are one: meshes repeat a vertex at texture seams and hard edges, and rounding moves the copies.

use glam::Vec3;
use std::collections::HashMap;

/// Distance up to which positions are one, as a share of the largest coordinate: four roundings.
const SAME_POSITION: f32 = 4e-7;
/// Tolerance of height vectors, as a share of the longest component: normals are rounded more than once.
const SAME_HEIGHT: f32 = 1e-5;

/// Returns for each point the number of the first one with its position and height vector. Cost: a hash table of the
/// points.
pub(super) fn weld(points: impl Iterator<Item = (Vec3, Vec3)>) -> Vec<u32> {
    let points: Vec<(Vec3, Vec3)> = points.collect();
    let largest = points.iter().fold((0f32, 0f32), |(position, height), (p, h)| {
        (position.max(p.abs().max_element()), height.max(h.abs().max_element()))
    });
    let (near, alike) = (SAME_POSITION * largest.0, SAME_HEIGHT * largest.1);
    // A point within `near` lies in the cell of one of the corners of a box of twice that size around this one.
    let cell = |p: Vec3| (p / (4.0 * near).max(f32::MIN_POSITIVE)).floor().to_array().map(|x| x as i32);
    let mut first_in: HashMap<[i32; 3], Vec<u32>> = HashMap::with_capacity(points.len());
    let mut welded = Vec::with_capacity(points.len());
    for (number, (position, height)) in (0u32..).zip(&points) {
        let is_same = |other: &&u32| {
            let (p, h) = points[**other as usize];
            (p - position).abs().max_element() <= near && (h - height).abs().max_element() <= alike
        };
        let corner = |i: u32| Vec3::from([0, 1, 2].map(|axis| if i >> axis & 1 == 0 { -near } else { near }));
        let found =
            (0..8).filter_map(|i| first_in.get(&cell(position + corner(i)))?.iter().find(is_same)).min().copied();
        if found.is_none() {
            first_in.entry(cell(*position)).or_default().push(number);
        }
        welded.push(found.unwrap_or(number));
    }
    welded
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_are_one_up_to_rounding_and_others_are_not() {
        let place = Vec3::new(0.3, -0.7, 0.1);
        let points = [
            (place, Vec3::Z),
            (Vec3::ONE, Vec3::Z),
            (place + 1e-7, Vec3::Z + 1e-6),
            (place + 1e-5, Vec3::Z),
            (place, Vec3::Z * 1.1),
            (Vec3::ONE, Vec3::Z),
        ];
        for scale in [1e-3, 1.0, 1e5] {
            assert_eq!(weld(points.iter().map(|(p, h)| (*p * scale, *h))), [0, 1, 0, 3, 4, 1], "{scale}");
        }
        assert_eq!(weld([(Vec3::ZERO, Vec3::Z); 3].into_iter()), [0, 0, 0]);
    }
}
