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

/// Returns a ray. The hierarchy's traversal loses what it meets where a component of the direction is -0, which
/// becomes 0.
fn ray(origin: Vec3, direction: Vec3, t_max: f32) -> Ray {
    Ray::new(Vec3A::from(origin), Vec3A::from(direction + Vec3::ZERO), 0.0, t_max)
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
        let ray = ray(origin, direction, t_max);
        let mut hit = RayHit::none();
        self.bvh
            .ray_traverse(ray, &mut hit, |ray, id| {
                self.triangles[self.bvh.primitive_indices[id] as usize].intersect(ray)
            })
            .then(|| Met { t: hit.t, triangle: self.bvh.primitive_indices[hit.primitive_id as usize] as usize })
    }

    /// Tells whether a ray meets any triangle.
    pub fn occluded(&self, origin: Vec3, direction: Vec3, t_max: f32) -> bool {
        let ray = ray(origin, direction, t_max);
        !self
            .bvh
            .ray_traverse_miss(ray, |ray, id| self.triangles[self.bvh.primitive_indices[id] as usize].intersect(ray))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_along_axes_and_in_planes_meet_what_they_are_aimed_at() {
        let mut triangles = Vec::new();
        for i in 0..64 {
            let at = Vec3::new((i % 4) as f32, (i / 4 % 4) as f32, (i / 16) as f32);
            triangles
                .push([Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.7, 0.3, 0.2), Vec3::new(0.3, 0.8, 0.9)].map(|p| p + at));
        }
        let occluder = Occluder::new(&triangles);
        let mut met = 0;
        for triangle in &triangles {
            let middle = triangle.iter().sum::<Vec3>() / 3.0;
            for direction in [
                Vec3::X,
                Vec3::NEG_Y,
                Vec3::Z,
                Vec3::new(0.6, 0.0, -0.8),
                Vec3::new(0.0, 0.8, 0.6),
                Vec3::new(0.6, 0.8, -0.0),
                Vec3::new(-0.8, -0.0, 0.6),
            ] {
                let origin = middle - 0.05 * direction;
                assert!(occluder.occluded(origin, direction, 0.1), "{direction}");
                assert!(occluder.occluded(middle - 9.0 * direction, direction, 10.0), "{direction} from outside");
                let t = occluder.trace(origin, direction, 0.1).map(|met| met.t);
                assert!(t.is_some_and(|t| (t - 0.05).abs() < 1e-4), "{direction}: {t:?}");
                // Planted: away from it is nothing so near.
                met += usize::from(occluder.occluded(origin, -direction, 0.02));
            }
        }
        assert_eq!(met, 0);
    }
}
