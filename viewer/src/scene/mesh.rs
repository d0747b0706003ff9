//! Meshes in parts: the built-in plane, sphere and box, and the frame (normal, tangent) of every vertex.

use crate::geometry::geometry::Vertex;
use btf_models::DiffuseColour;
use glam::{Mat4, Vec2, Vec3};

/// Longitudes of the built-in sphere; its edges are then a third of a degree off the true silhouette.
const SPHERE_SEGMENTS: u32 = 192;
/// Latitudes of the built-in sphere.
const SPHERE_RINGS: u32 = 96;

/// Some triangles that share a material.
#[derive(Debug, Clone)]
pub struct MeshPart {
    /// Name of the material in the file, or of the built-in part.
    pub name: String,
    /// Number of the material in the file; parts with equal numbers get the same material.
    pub group: usize,
    /// Colour of the part where it carries no asset and no leaf.
    pub colour: DiffuseColour,
    /// Whether the texture coordinates mean something; without them a part cannot carry an asset.
    pub has_uv: bool,
    /// Vertices.
    pub vertices: Vec<Vertex>,
    /// Vertex numbers, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl MeshPart {
    /// Makes a part that no file describes: grey, with texture coordinates.
    pub(crate) fn built_in(name: &str, vertices: Vec<Vertex>, triangles: Vec<[u32; 3]>) -> MeshPart {
        MeshPart {
            name: name.into(),
            group: 0,
            colour: DiffuseColour::opaque([0.5; 3]),
            has_uv: true,
            vertices,
            triangles,
        }
    }

    /// Moves all vertices; tangent frames stay right under mirroring and uneven scale. `matrix` is invertible.
    pub fn transform(&mut self, matrix: Mat4) {
        let normal_matrix = matrix.inverse().transpose();
        let mirrored = matrix.determinant() < 0.0;
        for vertex in &mut self.vertices {
            vertex.position = matrix.transform_point3(vertex.position.into()).to_array();
            let normal = normal_matrix.transform_vector3(vertex.normal.into()).normalize_or(Vec3::Z);
            let [x, y, z, w] = vertex.tangent;
            let tangent = matrix.transform_vector3(Vec3::new(x, y, z));
            vertex.normal = normal.to_array();
            vertex.tangent = tangent_of(normal, tangent, if mirrored { -w } else { w });
        }
        if mirrored {
            self.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
    }

    /// Returns the length that a unit of the texture coordinates covers in the mean over the part's area, world units;
    /// `None` where the texture has no area.
    pub fn tile_length(&self) -> Option<f32> {
        let (mut area, mut texture) = (0.0f64, 0.0f64);
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|i| &self.vertices[i as usize]);
            let [pa, pb, pc] = [a, b, c].map(|vertex| Vec3::from(vertex.position));
            let [ta, tb, tc] = [a, b, c].map(|vertex| Vec2::new(vertex.u, vertex.v));
            area += f64::from((pb - pa).cross(pc - pa).length());
            texture += f64::from((tb - ta).perp_dot(tc - ta).abs());
        }
        (area > 0.0 && texture > 0.0).then(|| (area / texture).sqrt() as f32)
    }

    /// Multiplies the texture coordinates.
    pub fn scale_uv(&mut self, scale: [f32; 2]) {
        for vertex in &mut self.vertices {
            vertex.u *= scale[0];
            vertex.v *= scale[1];
        }
    }
}

/// Returns `tangent` made perpendicular to the unit `normal`, or any perpendicular where it is parallel or zero.
pub(crate) fn tangent_of(normal: Vec3, tangent: Vec3, sign: f32) -> [f32; 4] {
    let flat = tangent - normal * normal.dot(tangent);
    let unit = if flat.length() > 1e-6 * tangent.length() && flat.length() > 1e-30 {
        flat.normalize()
    } else {
        normal.any_orthonormal_vector()
    };
    [unit.x, unit.y, unit.z, if sign < 0.0 { -1.0 } else { 1.0 }]
}

/// Makes a rectangle of 2 x 2 about the origin in the plane z = 0, facing +z; the texture lies on it once.
pub fn plane() -> MeshPart {
    quad("plane", Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0)
}

/// Makes a rectangle with `corner`, edges `u` and `v`, facing `u` x `v`.
pub fn quad(name: &str, corner: Vec3, u: Vec3, v: Vec3) -> MeshPart {
    let normal = u.cross(v).normalize();
    let vertices = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
        .map(|(s, t)| Vertex {
            position: (corner + u * s + v * t).to_array(),
            u: s,
            normal: normal.to_array(),
            v: t,
            tangent: tangent_of(normal, u, 1.0),
        })
        .to_vec();
    MeshPart::built_in(name, vertices, vec![[0, 1, 2], [0, 2, 3]])
}

/// Makes the unit sphere about the origin, poles at +y and -y; the texture goes round it twice and from pole to pole
/// once, so that its texels are square at the equator. u = 0.5 of a tile faces +z.
pub fn sphere() -> MeshPart {
    use std::f32::consts::{PI, TAU};
    let mut vertices = Vec::new();
    for ring in 0..=SPHERE_RINGS {
        let polar = PI * ring as f32 / SPHERE_RINGS as f32;
        for segment in 0..=SPHERE_SEGMENTS {
            let part = segment as f32 / SPHERE_SEGMENTS as f32;
            // The middle of a tile, u = 0.5, faces +z.
            let (sin, cos) = (TAU * (part - 0.25)).sin_cos();
            let normal = Vec3::new(polar.sin() * sin, polar.cos(), polar.sin() * cos);
            vertices.push(Vertex {
                position: normal.to_array(),
                u: 2.0 * part,
                normal: normal.to_array(),
                v: 1.0 - ring as f32 / SPHERE_RINGS as f32,
                tangent: [cos, 0.0, -sin, 1.0],
            });
        }
    }
    let row = SPHERE_SEGMENTS + 1;
    let mut triangles = Vec::new();
    for ring in 0..SPHERE_RINGS {
        for segment in 0..SPHERE_SEGMENTS {
            let a = ring * row + segment;
            let [b, c, d] = [a + row, a + row + 1, a + 1];
            // At the poles one of the two has no area.
            if ring > 0 {
                triangles.push([a, c, d]);
            }
            if ring + 1 < SPHERE_RINGS {
                triangles.push([a, b, c]);
            }
        }
    }
    MeshPart::built_in("sphere", vertices, triangles)
}

/// Makes a box of 2 x 2 x 2 about the origin; the texture lies on every side once.
pub fn cube(name: &str) -> MeshPart {
    let mut cube = MeshPart::built_in(name, Vec::new(), Vec::new());
    let sides = [
        (Vec3::X, Vec3::Y),
        (Vec3::NEG_Z, Vec3::Y),
        (Vec3::NEG_X, Vec3::Y),
        (Vec3::Z, Vec3::Y),
        (Vec3::X, Vec3::NEG_Z),
        (Vec3::X, Vec3::Z),
    ];
    for (u, v) in sides {
        let side = quad(name, u.cross(v) - u - v, u * 2.0, v * 2.0);
        let first = cube.vertices.len() as u32;
        cube.vertices.extend(side.vertices);
        cube.triangles.extend(side.triangles.iter().map(|triangle| triangle.map(|index| index + first)));
    }
    cube
}

/// Normals as the area-weighted mean of the triangles around each vertex, for files without them.
pub(crate) fn fill_normals(vertices: &mut [Vertex], triangles: &[[u32; 3]]) {
    let mut sums = vec![Vec3::ZERO; vertices.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|i| Vec3::from(vertices[i as usize].position));
        let area_normal = (b - a).cross(c - a);
        triangle.iter().for_each(|i| sums[*i as usize] += area_normal);
    }
    for (vertex, sum) in vertices.iter_mut().zip(sums) {
        vertex.normal = sum.normalize_or(Vec3::Z).to_array();
    }
}

/// Tangents from the gradient of u over the triangles around each vertex, for files without them.
pub(crate) fn fill_tangents(vertices: &mut [Vertex], triangles: &[[u32; 3]]) {
    let mut sums = vec![(Vec3::ZERO, Vec3::ZERO); vertices.len()];
    for triangle in triangles {
        let corner = |i: u32| &vertices[i as usize];
        let [a, b, c] = triangle.map(|i| Vec3::from(corner(i).position));
        let [ta, tb, tc] = triangle.map(|i| Vec2::new(corner(i).u, corner(i).v));
        let (e, f) = (tb - ta, tc - ta);
        let determinant = e.perp_dot(f);
        if determinant.abs() < 1e-20 {
            continue;
        }
        // Weighted by the triangle's area, whatever the size of its texture.
        let area = (b - a).cross(c - a).length();
        let tangent = ((b - a) * f.y - (c - a) * e.y) / determinant;
        let bitangent = ((c - a) * e.x - (b - a) * f.x) / determinant;
        for index in triangle {
            sums[*index as usize].0 += tangent.normalize_or_zero() * area;
            sums[*index as usize].1 += bitangent.normalize_or_zero() * area;
        }
    }
    for (vertex, (tangent, bitangent)) in vertices.iter_mut().zip(sums) {
        let normal = Vec3::from(vertex.normal);
        vertex.tangent = tangent_of(normal, tangent, normal.cross(tangent).dot(bitangent));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the largest error of a part's tangent frames, which must be orthonormal, with the normal outward and the
    /// tangents along u and v.
    fn frame_fault(part: &MeshPart) -> f32 {
        let mut derived = part.clone();
        fill_tangents(&mut derived.vertices, &derived.triangles);
        let mut worst = 0f32;
        for triangle in &part.triangles {
            let [a, b, c] = triangle.map(|i| Vec3::from(part.vertices[i as usize].position));
            let outward = (b - a).cross(c - a).normalize();
            for index in triangle {
                let vertex = &part.vertices[*index as usize];
                let normal = Vec3::from(vertex.normal);
                let tangent = Vec3::from_slice(&vertex.tangent);
                worst = worst.max((1.0 - normal.dot(outward)).max(0.0) - 0.01).max(normal.dot(tangent).abs());
                let other = derived.vertices[*index as usize].tangent;
                worst = worst.max(1.0 - tangent.dot(Vec3::from_slice(&other)));
                worst = worst.max((vertex.tangent[3] - other[3]).abs());
            }
        }
        worst
    }

    #[test]
    fn built_in_frames_follow_the_texture_and_face_outwards() {
        for part in [plane(), cube("cube")] {
            assert!(frame_fault(&part) < 1e-4, "{}", part.name);
        }
        // Next to the poles the gradient of u is a coarse one.
        assert!(frame_fault(&sphere()) < 0.02, "{}", frame_fault(&sphere()));
    }

    #[test]
    fn a_tile_is_as_long_as_the_part_is_scaled() {
        let mut part = plane();
        assert!((part.tile_length().unwrap() - 2.0).abs() < 1e-6);
        part.transform(Mat4::from_scale(Vec3::splat(3.0)));
        part.scale_uv([4.0, 4.0]);
        assert!((part.tile_length().unwrap() - 1.5).abs() < 1e-6);
        part.scale_uv([0.0, 1.0]);
        assert_eq!(part.tile_length(), None);
    }

    #[test]
    fn a_turned_tangent_is_noticed() {
        let mut part = plane();
        part.vertices[2].tangent = [0.0, 1.0, 0.0, 1.0];
        assert!(frame_fault(&part) > 0.5);
    }

    #[test]
    fn frames_survive_mirroring_and_uneven_scale() {
        for scale in [Vec3::new(-1.0, 1.0, 1.0), Vec3::new(2.0, 1.0, 0.5), Vec3::new(1.0, -3.0, 1.0)] {
            let mut part = cube("cube");
            part.transform(Mat4::from_scale(scale));
            assert!(frame_fault(&part) < 1e-4, "{scale}");
        }
    }

    #[test]
    fn missing_normals_are_filled_in_outwards() {
        let mut part = sphere();
        let expected = part.clone();
        fill_normals(&mut part.vertices, &part.triangles);
        let row = SPHERE_SEGMENTS as usize + 1;
        let inner = &part.vertices[2 * row..part.vertices.len() - 2 * row];
        for (vertex, before) in inner.iter().zip(&expected.vertices[2 * row..]) {
            assert!(Vec3::from(vertex.normal).dot(before.normal.into()) > 0.999);
        }
    }
}
