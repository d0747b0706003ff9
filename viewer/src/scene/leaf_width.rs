//! How wide the leaves of a model are, as its triangles tell.

use crate::scene::mesh_file::FileMesh;
use glam::Vec3;
use std::collections::HashMap;

/// The width of the part in the middle, where the model's connected parts are sorted by their widths and each counts for its area;
/// 0 without an area. A part's width is its area over its length, which is the distance of two vertices far from each other: for a
/// blade the mean over its length, for a stem the way around it. In the files' units; cost: a pass over the triangles.
pub fn leaf_width(meshes: &[FileMesh]) -> f32 {
    let mut widths: Vec<(f32, f64)> = Vec::new();
    for mesh in meshes {
        let scale = mesh.places.first().map_or(1.0, |place| place.determinant().abs().cbrt());
        for part in &mesh.parts {
            let position = |vertex: u32| Vec3::from(part.vertices[vertex as usize].position);
            let copies = mesh.places.len() as f64 * f64::from(scale * scale);
            for triangles in connected(&part.triangles, position) {
                let area: f64 = triangles.iter().map(|[a, b, c]| 0.5 * f64::from((b - a).cross(c - a).length())).sum();
                let vertices = || triangles.iter().flatten();
                let furthest = |from: Vec3| {
                    vertices().fold(
                        from,
                        |far, p| if p.distance_squared(from) > far.distance_squared(from) { *p } else { far },
                    )
                };
                let end = furthest(triangles[0][0]);
                let length = end.distance(furthest(end));
                if length > 0.0 {
                    widths.push((scale * area as f32 / length, area * copies));
                }
            }
        }
    }
    widths.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * widths.iter().map(|(_, area)| area).sum::<f64>();
    let mut below = 0.0;
    let middle = widths.iter().find(|(_, area)| {
        below += area;
        below >= half
    });
    middle.map_or(0.0, |(width, _)| *width)
}

/// Triangles that hang together by vertices in the same places.
fn connected(triangles: &[[u32; 3]], position: impl Fn(u32) -> Vec3) -> Vec<Vec<[Vec3; 3]>> {
    let mut number_at: HashMap<[u32; 3], usize> = HashMap::new();
    // Each place's neighbour on the way to the one that stands for all of its part.
    let mut towards: Vec<usize> = Vec::new();
    fn root(towards: &mut [usize], mut at: usize) -> usize {
        while towards[at] != at {
            towards[at] = towards[towards[at]];
            at = towards[at];
        }
        at
    }
    let mut firsts = Vec::with_capacity(triangles.len());
    for triangle in triangles {
        let places = triangle.map(|vertex| {
            // Both zeros are one place.
            let key = position(vertex).to_array().map(|x| (x + 0.0).to_bits());
            *number_at.entry(key).or_insert_with(|| {
                towards.push(towards.len());
                towards.len() - 1
            })
        });
        let first = root(&mut towards, places[0]);
        for place in &places[1..] {
            let other = root(&mut towards, *place);
            towards[other] = first;
        }
        firsts.push(first);
    }
    let mut parts: Vec<Vec<[Vec3; 3]>> = Vec::new();
    let mut part_of: HashMap<usize, usize> = HashMap::new();
    for (triangle, first) in triangles.iter().zip(firsts) {
        let part = *part_of.entry(root(&mut towards, first)).or_insert_with(|| {
            parts.push(Vec::new());
            parts.len() - 1
        });
        parts[part].push(triangle.map(&position));
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::mesh::{MeshPart, quad};
    use glam::Mat4;

    /// Rectangles beside each other.
    fn rectangles(sides: impl IntoIterator<Item = [f32; 2]>) -> MeshPart {
        let mut all = quad("leaf", Vec3::ZERO, Vec3::X, Vec3::Y);
        all.vertices.clear();
        all.triangles.clear();
        for (i, [width, length]) in sides.into_iter().enumerate() {
            let one = quad("leaf", Vec3::Z * i as f32, Vec3::X * width, Vec3::Y * length);
            let first = all.vertices.len() as u32;
            all.vertices.extend(one.vertices);
            all.triangles.extend(one.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + first)));
        }
        all
    }

    fn width_of(part: MeshPart, places: Vec<Mat4>) -> f32 {
        leaf_width(&[FileMesh { parts: vec![part], places }])
    }

    #[test]
    fn the_width_is_that_of_the_parts_that_have_most_of_the_area() {
        let here = || vec![Mat4::IDENTITY];
        // Long blades: their length is nearly the diagonal.
        let blades = rectangles(vec![[0.01, 0.4]; 30]);
        assert!((width_of(blades.clone(), here()) - 0.01).abs() < 1e-4);
        // Some that are wider and many small ones do not change it.
        let among = || {
            (0..100).map(|i| {
                if i < 5 {
                    [0.05, 0.4]
                } else if i < 60 {
                    [0.01, 0.4]
                } else {
                    [0.001, 0.1]
                }
            })
        };
        assert!((width_of(rectangles(among()), here()) - 0.01).abs() < 1e-4);
        // Wherever it is placed, as large as it is there.
        let often = vec![Mat4::from_scale(Vec3::splat(2.0)), Mat4::IDENTITY];
        assert!((width_of(blades, often) - 0.02).abs() < 2e-4);
        assert_eq!(width_of(rectangles([]), here()), 0.0);
    }
}
