//! Rays past a model, by which its volume is fitted: what the model hides and shows.

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::{Ray, RayHit};
use obvhs::triangle::Triangle;

/// Triangles of a model in a bounding volume hierarchy.
pub struct Occluder {
    bvh: CwBvh,
    triangles: Vec<Triangle>,
}

/// First triangle that a ray meets.
#[derive(Debug, Clone, Copy)]
pub struct Met {
    /// Distance along the ray.
    pub t: f32,
    /// Number of the triangle.
    pub triangle: usize,
}

impl Occluder {
    /// Builds the hierarchy over triangles.
    pub fn new(triangles: &[[Vec3; 3]]) -> Occluder {
        let triangles: Vec<Triangle> =
            triangles.iter().map(|t| Triangle { v0: t[0].into(), v1: t[1].into(), v2: t[2].into() }).collect();
        let mut time = std::time::Duration::default();
        let bvh = build_cwbvh_from_tris(&triangles, BvhBuildParams::medium_build(), &mut time);
        Occluder { bvh, triangles }
    }

    /// Returns the nearest triangle along a ray.
    pub fn trace(&self, origin: Vec3, direction: Vec3, t_max: f32) -> Option<Met> {
        let ray = Ray::new(Vec3A::from(origin), Vec3A::from(direction), 0.0, t_max);
        let mut hit = RayHit::none();
        self.bvh
            .ray_traverse(ray, &mut hit, |ray, id| {
                self.triangles[self.bvh.primitive_indices[id] as usize].intersect(ray)
            })
            .then(|| Met { t: hit.t, triangle: self.bvh.primitive_indices[hit.primitive_id as usize] as usize })
    }

    /// Tells whether a ray meets any triangle.
    pub fn occluded(&self, origin: Vec3, direction: Vec3, t_max: f32) -> bool {
        let ray = Ray::new(Vec3A::from(origin), Vec3A::from(direction), 0.0, t_max);
        !self
            .bvh
            .ray_traverse_miss(ray, |ray, id| self.triangles[self.bvh.primitive_indices[id] as usize].intersect(ray))
    }
}
