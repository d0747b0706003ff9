//! Triangles as both tracers see them: shared vertices, and triangles in the order of the BVH's leaves, so that a
//! primitive has one number on the CPU, in the compute BVH and in the acceleration structure.

use crate::bvh::Bvh;
use glam::Vec3;

/// A vertex. Twin: `Vertex` in `scene.wgsl`; positions come first, so that the acceleration structure is built from
/// the same buffer.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Vertex {
    /// Position, world space.
    pub position: [f32; 3],
    /// Texture coordinate to the right.
    pub u: f32,
    /// Unit normal.
    pub normal: [f32; 3],
    /// Texture coordinate upwards.
    pub v: f32,
    /// Unit tangent towards growing u; w = +1 or -1 so that `cross(normal, tangent) * w` points to growing v.
    pub tangent: [f32; 4],
}

/// A triangle. Twin: `Triangle` in `scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Triangle {
    /// Vertex numbers.
    pub vertices: [u32; 3],
    /// Material number.
    pub material: u32,
}

/// All triangles of a scene and their BVH; immutable.
#[derive(Debug, Clone)]
pub struct Geometry {
    vertices: Vec<Vertex>,
    triangles: Vec<Triangle>,
    bvh: Bvh,
}

impl Geometry {
    /// Leaves out triangles without an area, sorts the others into the leaves of a BVH.
    ///
    /// # Errors
    /// A sentence if a number is not finite, a vertex number is out of range or no triangle is left.
    pub fn new(vertices: Vec<Vertex>, triangles: Vec<Triangle>) -> Result<Geometry, String> {
        if vertices.len() > u32::MAX as usize / 4 || triangles.len() > (1 << 24) {
            return Err("the scene has more than 2^24 triangles or 2^30 vertices, simplify it".into());
        }
        let finite = |vertex: &Vertex| bytemuck::cast_ref::<Vertex, [f32; 12]>(vertex).iter().all(|x| x.is_finite());
        if !vertices.iter().all(finite) {
            return Err("a vertex has a coordinate that is not a finite number".into());
        }
        if triangles.iter().any(|triangle| triangle.vertices.iter().any(|index| *index as usize >= vertices.len())) {
            return Err("a triangle names a vertex that is not there".into());
        }
        let mut triangles = triangles;
        triangles.retain(|triangle| {
            let [a, b, c] = triangle.vertices.map(|index| Vec3::from(vertices[index as usize].position));
            (b - a).cross(c - a).length_squared() > 0.0
        });
        if triangles.is_empty() {
            return Err("no triangle with an area is left".into());
        }
        let bvh = Bvh::build(&vertices, &mut triangles);
        Ok(Geometry { vertices, triangles, bvh })
    }

    /// The same surface with `triangles` that differ from its own in their materials only.
    pub(crate) fn with_triangles(&self, triangles: Vec<Triangle>) -> Geometry {
        Geometry { vertices: self.vertices.clone(), triangles, bvh: self.bvh.clone() }
    }

    /// All vertices.
    pub fn vertices(&self) -> &[Vertex] {
        &self.vertices
    }

    /// All triangles; a hit's primitive number is an index into these.
    pub fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// The hierarchy over [`Geometry::triangles`].
    pub fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    /// Corners of a triangle.
    pub fn corners(&self, primitive: u32) -> [Vec3; 3] {
        self.triangles[primitive as usize].vertices.map(|index| Vec3::from(self.vertices[index as usize].position))
    }

    /// Centre and radius of a sphere around everything.
    pub fn bounding_sphere(&self) -> (Vec3, f32) {
        let (lo, hi) = self.bvh.bounds();
        let centre = (lo + hi) * 0.5;
        let radius = self.vertices.iter().map(|v| Vec3::from(v.position).distance(centre)).fold(0.0, f32::max);
        (centre, radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vertex(position: [f32; 3]) -> Vertex {
        Vertex { position, u: 0.0, normal: [0.0, 0.0, 1.0], v: 0.0, tangent: [1.0, 0.0, 0.0, 1.0] }
    }

    #[test]
    fn refuses_bad_numbers_and_drops_flat_triangles() {
        let corners = vec![vertex([0.0; 3]), vertex([1.0, 0.0, 0.0]), vertex([0.0, 1.0, 0.0])];
        let triangle = |vertices| Triangle { vertices, material: 0 };
        let good = Geometry::new(corners.clone(), vec![triangle([0, 1, 2]), triangle([0, 0, 1])]).unwrap();
        assert_eq!(good.triangles().len(), 1);
        assert!(Geometry::new(corners.clone(), vec![triangle([0, 1, 3])]).is_err());
        assert!(Geometry::new(corners.clone(), vec![triangle([1, 1, 1])]).is_err());
        let mut bad = corners;
        bad[1].u = f32::NAN;
        assert!(Geometry::new(bad, vec![triangle([0, 1, 2])]).is_err());
    }
}
