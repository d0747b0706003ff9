//! The surface where a ray hits it. Twin: `surface.wgsl`.

use crate::geometry::bvh::Hit;
use crate::geometry::geometry::{Geometry, Instance, Vertex};
use glam::{Vec2, Vec3, Vec4};

/// Cosine to which an eye below the shading horizon is lifted; interpolated normals turn away at silhouettes.
pub(crate) const MIN_EYE_COS: f32 = 1e-3;

/// The constants that the shader has too, by name.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, f32)] = &[("MIN_EYE_COS", MIN_EYE_COS)];

/// A point of a surface, seen along a ray.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Surface {
    pub position: Vec3,
    /// Material number.
    pub material: usize,
    /// Normal of the triangle, on the side of the shading normal.
    pub flat: Vec3,
    /// Whether the ray came from behind.
    pub view_back: bool,
    /// Frame of the texel: x, y, z.
    pub tangent: Vec3,
    pub bitangent: Vec3,
    pub normal: Vec3,
    /// Unit direction to the eye, texel frame.
    pub wo: Vec3,
    pub uv: Vec2,
    /// Numbers by which one of the texels around `uv` is taken; 0.5 twice for the nearest.
    pub texel_at: [f32; 2],
    /// Length of the texture on a unit of length, in the mean over the triangle.
    pub texture_per_unit: f32,
    /// Origins of rays that leave on the front, and on the back.
    pub above: Vec3,
    pub below: Vec3,
}

fn normalize_or(v: Vec3, other: Vec3) -> Vec3 {
    let length2 = v.length_squared();
    if length2 > 1e-20 { v * (1.0 / length2.sqrt()) } else { other }
}

/// Returns a vector perpendicular to the unit `n`.
pub(crate) fn perpendicular(n: Vec3) -> Vec3 {
    if n.x.abs() < 0.9 { Vec3::new(0.0, -n.z, n.y).normalize() } else { Vec3::new(n.z, 0.0, -n.x).normalize() }
}

/// Moves a point off a surface by some units in the last place [Waechter and Binder 2019].
fn offset_along(p: Vec3, n: Vec3) -> Vec3 {
    let component = |p: f32, n: f32| {
        if p.abs() < 1.0 / 32.0 {
            return p + n / 65536.0;
        }
        let steps = (n * 256.0) as i32;
        let bits = p.to_bits() as i32;
        f32::from_bits((if p < 0.0 { bits - steps } else { bits + steps }) as u32)
    };
    Vec3::new(component(p.x, n.x), component(p.y, n.y), component(p.z, n.z))
}

/// Lifts a point of a flat triangle onto the curved surface that its normals mean, which keeps the shadow's edge on a
/// curved object smooth [Hanika 2021]. `side` is 1 or -1, the side of the light.
fn lift(p: Vec3, weights: Vec3, corners: &[Vertex; 3], side: f32) -> Vec3 {
    let mut at = Vec3::ZERO;
    for i in 0..3 {
        let normal = Vec3::from(corners[i].normal) * side;
        at += weights[i] * (p - normal * (p - Vec3::from(corners[i].position)).dot(normal).min(0.0));
    }
    at
}

/// Transforms a vertex of a mesh to where an instance has it.
fn vertex_in_world(vertex: Vertex, instance: &Instance) -> Vertex {
    let to_world = |v: Vec4| Vec3::from(instance.world_from_object.map(|row| v.dot(row.into())));
    let position = to_world(Vec3::from(vertex.position).extend(1.0));
    // Normals follow the transposed inverse.
    let [x, y, z] = instance.object_from_world.map(|row| Vec4::from(row).truncate());
    let n = vertex.normal;
    let normal = normalize_or(x * n[0] + y * n[1] + z * n[2], Vec3::Z);
    let tangent = to_world(Vec3::from_slice(&vertex.tangent).extend(0.0));
    Vertex {
        position: position.to_array(),
        normal: normal.to_array(),
        tangent: tangent.extend(vertex.tangent[3] * instance.handedness).to_array(),
        ..vertex
    }
}

/// Returns the corners of the triangle that a ray hit, in the world.
pub(crate) fn corners_of(geometry: &Geometry, hit: &Hit) -> [Vertex; 3] {
    let corners =
        geometry.triangles()[hit.primitive as usize].vertices.map(|index| geometry.vertices()[index as usize]);
    let instance = &geometry.instances()[hit.instance as usize];
    if instance.handedness == 0.0 { corners } else { corners.map(|corner| vertex_in_world(corner, instance)) }
}

/// Returns the length of the texture on a unit of length; `area` is twice that of the triangle.
fn texture_per_unit(corners: &[Vertex; 3], area: f32) -> f32 {
    let [a, b, c] = corners.each_ref().map(|vertex| Vec2::new(vertex.u, vertex.v));
    ((b - a).perp_dot(c - a).abs() / area.max(1e-20)).sqrt()
}

impl Surface {
    /// Returns the surface that a ray along `direction` hit.
    pub(crate) fn surface_at(geometry: &Geometry, hit: &Hit, direction: Vec3) -> Surface {
        let corners = corners_of(geometry, hit);
        let weights = Vec3::new(1.0 - hit.u - hit.v, hit.u, hit.v);
        let mix = |value: fn(&Vertex) -> Vec3| {
            value(&corners[0]) * weights.x + value(&corners[1]) * weights.y + value(&corners[2]) * weights.z
        };
        let position = mix(|vertex| vertex.position.into());

        // The flat normal, on the side of the shading normal; the frame of the texel.
        let [a, b, c] = corners.each_ref().map(|vertex| Vec3::from(vertex.position));
        let mut flat = normalize_or((b - a).cross(c - a), Vec3::Z);
        let normal = normalize_or(mix(|vertex| vertex.normal.into()), flat);
        if flat.dot(normal) < 0.0 {
            flat = -flat;
        }
        let slanted = mix(|vertex| Vec3::from_slice(&vertex.tangent));
        let tangent = normalize_or(slanted - normal * normal.dot(slanted), perpendicular(normal));
        let bitangent = normal.cross(tangent) * corners[0].tangent[3];

        let wo_world = -direction;
        let view_back = flat.dot(wo_world) < 0.0;
        let mut wo = Vec3::new(tangent.dot(wo_world), bitangent.dot(wo_world), normal.dot(wo_world));
        wo.z = if view_back { wo.z.min(-MIN_EYE_COS) } else { wo.z.max(MIN_EYE_COS) };
        Surface {
            position,
            material: geometry.triangles()[hit.primitive as usize].material as usize,
            flat,
            view_back,
            tangent,
            bitangent,
            normal,
            wo: wo.normalize(),
            uv: mix(|vertex| Vec3::new(vertex.u, vertex.v, 0.0)).truncate(),
            texel_at: [0.5; 2],
            texture_per_unit: texture_per_unit(&corners, (b - a).cross(c - a).length()),
            above: offset_along(lift(position, weights, &corners, 1.0), flat),
            below: offset_along(lift(position, weights, &corners, -1.0), -flat),
        }
    }

    /// Transforms a direction of the world into the frame of the texel.
    pub(crate) fn local_from_world(&self, d: Vec3) -> Vec3 {
        Vec3::new(self.tangent.dot(d), self.bitangent.dot(d), self.normal.dot(d))
    }

    /// Transforms a direction from the frame of the texel into the world.
    pub(crate) fn world_from_local(&self, d: Vec3) -> Vec3 {
        self.tangent * d.x + self.bitangent * d.y + self.normal * d.z
    }
}
