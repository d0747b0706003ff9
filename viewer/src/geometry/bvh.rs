//! Traversal of the hierarchies: one over the instances, whose leaves hold one instance each, and one over the
//! triangles of each mesh, in the mesh's own space. All lie in one array of nodes. Twin: `bvh.wgsl`, over the same
//! arrays.

use crate::geometry::bvh_node::BvhNode;
use crate::geometry::geometry::{Geometry, Instance};
use crate::geometry::lod_transition::LodTransition;
use crate::geometry::shear::Shear;
use glam::Vec3;

/// Entries of the traversal's stack; more than the deepest two hierarchies need. Twin: `BVH_STACK` in `bvh.wgsl`, of which a
/// module has what its scene needs ([`Geometry::stack_entries`]).
pub const STACK: usize = 80;
/// Shares of t by which a box is entered too late because of rounding [Ize 2013].
const BOX_SLACK: f32 = 1.000_001;
/// Smallest direction component that a slab test divides by.
const MIN_DIRECTION: f32 = 1e-15;
/// Smallest determinant of a triangle that is hit; below, the ray lies in its plane.
const MIN_DETERMINANT: f32 = 1e-30;
/// Share of an edge function's terms that is rounding: two ulp, because some GPUs fuse one of its products into the sum
/// and not the other, and a ray on an edge could then miss the triangles on both sides.
const EDGE_SLACK: f32 = 2.4e-7;
/// The constants that the shader has too, by name.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, f32)] = &[
    ("BOX_SLACK", BOX_SLACK),
    ("MIN_DIRECTION", MIN_DIRECTION),
    ("MIN_DETERMINANT", MIN_DETERMINANT),
    ("EDGE_SLACK", EDGE_SLACK),
];
/// Primitive number of a ray that hits nothing. Twin: `NO_HIT` in `surface.wgsl`.
pub const NO_HIT: u32 = u32::MAX;
/// Instance number of a ray that is in none.
pub(crate) const NO_INSTANCE: u32 = u32::MAX;

/// The point at which a ray meets a triangle. Twin: `Hit` in `surface.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance along the ray.
    pub t: f32,
    /// Triangle number, or [`NO_HIT`].
    pub primitive: u32,
    /// Barycentric weight of the second corner.
    pub u: f32,
    /// Barycentric weight of the third corner.
    pub v: f32,
    /// Number of the instance that the triangle is part of.
    pub instance: u32,
}

impl Hit {
    /// Returns a miss up to the distance `t`.
    pub(crate) fn none(t: f32) -> Hit {
        Hit { t, primitive: NO_HIT, u: 0.0, v: 0.0, instance: 0 }
    }
}

/// The hit that a traversal is for. Twins: `HIT_ANY`, `HIT_NEAREST`, `HIT_FRONT` in `surface.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AnyHit {
    /// Any hit will do (shadow rays).
    Yes,
    /// The nearest hit.
    No,
    /// The nearest hit of those whose front the ray meets.
    Front,
}

impl Geometry {
    /// Traces a ray: returns the nearest hit with 0 < t < `t_max`, or the hit that `any` asks for. `direction` is unit.
    pub fn trace(&self, origin: Vec3, direction: Vec3, t_max: f32, any: AnyHit) -> Hit {
        self.trace_with_lod(origin, direction, t_max, any, &LodTransition::MESHES)
    }

    /// Traces a ray where meshes that volumes stand in for exist only within the spheres of `lod_transition`, see
    /// [`Geometry::trace`]. Twin: `bvh_trace` in `bvh.wgsl`.
    pub fn trace_with_lod(
        &self,
        origin: Vec3,
        direction: Vec3,
        t_max: f32,
        any: AnyHit,
        lod_transition: &LodTransition,
    ) -> Hit {
        let nodes = self.nodes();
        let spheres = lod_transition.along(origin, direction);
        let mut best = Hit::none(t_max);
        // Where the mesh that the ray is in begins to be there, and beyond what nothing counts.
        let (mut from, mut reach) = (0.0, t_max);
        let world = BoxRay::new(origin, direction);
        let (mut ray, mut shear) = (world, Shear::new(direction));
        // Nodes that wait.
        let mut stack = [0u32; STACK];
        let mut size = 0;
        // The instance that the ray is in, and where the stack stood before.
        let (mut instance, mut below) = (NO_INSTANCE, 0);
        let mut node = nodes[self.root() as usize];
        if enter(&node, &ray, reach) >= reach {
            return best;
        }
        loop {
            if node.count == 0 {
                let [left, right] = [0, 1].map(|side| nodes[node.first as usize + side]);
                let [t_left, t_right] = [enter(&left, &ray, reach), enter(&right, &ray, reach)];
                // Go to the nearer child, keep the farther one.
                let left_first = t_left <= t_right;
                if t_left.min(t_right) < reach {
                    if t_left.max(t_right) < reach {
                        stack[size] = node.first + u32::from(left_first);
                        size += 1;
                    }
                    node = if left_first { left } else { right };
                    continue;
                }
            } else if instance == NO_INSTANCE {
                // Into the mesh's own space, where t is the same because the direction is not made unit again.
                (instance, below) = (node.first, size);
                let placed = &self.instances()[instance as usize];
                let own = placed.object_from_world(direction, 0.0);
                ray = BoxRay::new(placed.object_from_world(origin, 1.0), own);
                shear = Shear::new(own);
                node = nodes[placed.root as usize];
                let [first, last] = spheres.mesh(placed.leaf_width);
                (from, reach) = (first, best.t.min(last));
                if enter(&node, &ray, reach) < reach {
                    continue;
                }
            } else {
                for primitive in node.first..node.first + node.count {
                    let [a, b, c] = self.corners(primitive);
                    if let Some((t, u, v)) = intersect(ray.origin, &shear, [a, b, c], any == AnyHit::Front)
                        && t < reach
                        && t >= from
                    {
                        best = Hit { t, primitive, u, v, instance };
                        reach = t;
                        if any == AnyHit::Yes {
                            return best;
                        }
                    }
                }
            }
            if size == below {
                (instance, below, ray, reach) = (NO_INSTANCE, 0, world, best.t);
            }
            if size == 0 {
                return best;
            }
            size -= 1;
            node = nodes[stack[size] as usize];
        }
    }
}

impl Geometry {
    /// Returns the entries of the stack that rays take at most, in multiples of 32, so that scenes seldom differ in them. `tops`
    /// are the nodes where the hierarchies over instances begin. Cost: a pass over the nodes.
    pub(crate) fn stack_entries(&self, tops: &[u32]) -> usize {
        let nodes = self.nodes();
        let mut heights = vec![0usize; nodes.len()];
        // Children stand behind their parents.
        for number in (0..nodes.len()).rev() {
            let BvhNode { first, count: 0, .. } = nodes[number] else { continue };
            heights[number] = 1 + heights[first as usize].max(heights[first as usize + 1]);
        }
        let of_instances = tops.iter().map(|top| heights[*top as usize]).max();
        let of_meshes = self.instances().iter().map(|instance| heights[instance.root as usize]).max();
        (of_instances.unwrap_or(0) + of_meshes.unwrap_or(0)).max(1).next_multiple_of(32)
    }
}

impl Instance {
    /// Transforms a point (`w` 1) or a direction (`w` 0) of the world into the mesh's space. Twin: `object_from_world`.
    pub(crate) fn object_from_world(&self, v: Vec3, w: f32) -> Vec3 {
        let v = v.extend(w);
        Vec3::from(self.object_from_world.map(|row| v.dot(row.into())))
    }
}

/// A ray made ready for boxes. Twin: `BoxRay`.
#[derive(Clone, Copy)]
struct BoxRay {
    origin: Vec3,
    inverse: Vec3,
}

impl BoxRay {
    fn new(origin: Vec3, direction: Vec3) -> BoxRay {
        let inverse = direction.map(|d| 1.0 / if d.abs() < MIN_DIRECTION { MIN_DIRECTION.copysign(d) } else { d });
        BoxRay { origin, inverse }
    }
}

/// Returns the distance at which a ray enters a box, or `t_max` if it does not before that. Twin: `bvh_enter`.
fn enter(node: &BvhNode, ray: &BoxRay, t_max: f32) -> f32 {
    let a = (Vec3::from(node.lo) - ray.origin) * ray.inverse;
    let b = (Vec3::from(node.hi) - ray.origin) * ray.inverse;
    let near = a.min(b).max_element().max(0.0);
    let far = a.max(b).min_element() * BOX_SLACK;
    if near <= far && near < t_max { near } else { t_max }
}

/// Returns twice the signed area of the origin, p and q, and how much of it is rounding. Twin: `bvh_edge`.
fn edge(p: Vec3, q: Vec3) -> (f32, f32) {
    let (a, b) = (p.x * q.y, p.y * q.x);
    (a - b, EDGE_SLACK * (a.abs() + b.abs()))
}

/// Intersects a ray and a triangle: returns (t, u, v), seen from either side, without gaps between triangles that share
/// an edge [Woop 2013]. Differs from the paper in the slack, which stands for its double-precision fallback. With
/// `front`, only triangles that are seen counter-clockwise count. Twin: `bvh_intersect`.
fn intersect(origin: Vec3, shear: &Shear, corners: [Vec3; 3], front: bool) -> Option<(f32, f32, f32)> {
    let [a, b, c] = corners.map(|corner| shear.apply(corner - origin));
    let ((wa, sa), (wb, sb), (wc, sc)) = (edge(c, b), edge(a, c), edge(b, a));
    let positive = wa >= -sa && wb >= -sb && wc >= -sc;
    let negative = wa <= sa && wb <= sb && wc <= sc;
    let determinant = wa + wb + wc;
    if !(positive || negative) || determinant.abs() < MIN_DETERMINANT {
        return None;
    }
    if front && !shear.is_towards(-determinant) {
        return None;
    }
    let inverse = 1.0 / determinant;
    let t = (wa * a.z + wb * b.z + wc * c.z) * inverse;
    let u = (wb * inverse).clamp(0.0, 1.0);
    let v = (wc * inverse).clamp(0.0, 1.0 - u);
    (t > 0.0).then_some((t, u, v))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::geometry::{Mesh, Placement, Triangle, Vertex};
    use glam::{Mat4, Quat};

    /// xorshift; tests need no better.
    struct Random(u64);

    impl Random {
        fn unit(&mut self) -> f32 {
            self.0 ^= self.0 << 13;
            self.0 ^= self.0 >> 7;
            self.0 ^= self.0 << 17;
            (self.0 >> 40) as f32 / (1u64 << 24) as f32
        }

        fn vector(&mut self) -> Vec3 {
            Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
        }
    }

    fn soup(count: u32, size: f32) -> Geometry {
        let Mesh { vertices, triangles } = soup_mesh(count, size);
        Geometry::new(vertices, triangles).unwrap()
    }

    fn soup_mesh(count: u32, size: f32) -> Mesh {
        let mut random = Random(0x9e37_79b9_7f4a_7c15);
        let mut vertices = Vec::new();
        for _ in 0..count {
            let centre = random.vector();
            for _ in 0..3 {
                let position = (centre + random.vector() * size).to_array();
                vertices.push(Vertex { position, u: 0.0, normal: [0.0, 0.0, 1.0], v: 0.0, tangent: [1.0; 4] });
            }
        }
        let triangles = (0..count).map(|i| Triangle { vertices: [3 * i, 3 * i + 1, 3 * i + 2], material: 0 }).collect();
        Mesh { vertices, triangles }
    }

    /// Two meshes, placed 200 times turned, scaled and mirrored.
    fn instanced() -> Geometry {
        let mut random = Random(0x1234_5678_9abc_def1);
        let placement = |i: usize| {
            let size = 0.05 + 0.1 * random.unit();
            let scale = Vec3::new(if i.is_multiple_of(3) { -size } else { size }, size * (0.5 + random.unit()), size);
            let turn = Quat::from_axis_angle(random.vector().normalize(), 6.0 * random.unit());
            Placement {
                mesh: i % 2,
                world_from_object: Mat4::from_scale_rotation_translation(scale, turn, random.vector()),
            }
        };
        let placements: Vec<Placement> = (0..200).map(placement).collect();
        Geometry::placed(vec![soup_mesh(40, 0.3), soup_mesh(7, 0.8)], &placements).unwrap()
    }

    fn brute_force(
        geometry: &Geometry,
        origin: Vec3,
        direction: Vec3,
        t_max: f32,
        lod_transition: &LodTransition,
    ) -> Hit {
        let mut best = Hit::none(t_max);
        for (number, instance) in geometry.instances().iter().enumerate() {
            let mesh = geometry.meshes()[geometry.mesh_of(number)];
            let own = instance.object_from_world(direction, 0.0);
            let world_origin = origin;
            let (origin, shear) = (instance.object_from_world(origin, 1.0), Shear::new(own));
            let [first, last] = lod_transition.along(world_origin, direction).mesh(instance.leaf_width);
            for primitive in mesh.first_triangle..mesh.first_triangle + mesh.triangles {
                if let Some((t, u, v)) = intersect(origin, &shear, geometry.corners(primitive), false)
                    && t < best.t
                    && (first..last).contains(&t)
                {
                    best = Hit { t, primitive, u, v, instance: number as u32 };
                }
            }
        }
        best
    }

    fn trace(geometry: &Geometry, origin: Vec3, direction: Vec3, any: AnyHit) -> Hit {
        geometry.trace(origin, direction, 10.0, any)
    }

    /// About an eye within the scenes; leaves 1 wide change from mesh to volume at a radius of 1.4.
    fn lod_transition() -> LodTransition {
        LodTransition::new(Vec3::new(0.3, -0.2, 0.1), 0.5, 0.5)
    }

    /// Rays on which the hierarchy and the slow obvious search differ, of 2000.
    fn differences(geometry: &Geometry, lod_transition: &LodTransition) -> usize {
        let mut random = Random(77);
        (0..2000)
            .filter(|i| {
                let origin = random.vector() * 1.5;
                // Every seventh ray runs along an axis, where slab tests divide by zero if they are careless.
                let direction = if i % 7 == 0 { Vec3::AXES[i % 3] } else { random.vector().normalize() };
                let expected = brute_force(geometry, origin, direction, 10.0, lod_transition);
                let [found, any] = [AnyHit::No, AnyHit::Yes]
                    .map(|any| geometry.trace_with_lod(origin, direction, 10.0, any, lod_transition));
                found != expected || (any.primitive == NO_HIT) != (expected.primitive == NO_HIT)
            })
            .count()
    }

    #[test]
    fn finds_the_same_hits_as_brute_force() {
        for (count, size) in [(1, 1.0), (7, 0.5), (3000, 0.05)] {
            let geometry = soup(count, size);
            assert_eq!(differences(&geometry, &LodTransition::MESHES), 0, "{count} triangles");
        }
        assert_eq!(differences(&instanced(), &LodTransition::MESHES), 0, "instances");
    }

    #[test]
    fn meshes_with_stand_ins_are_met_within_their_spheres_alone() {
        let mut mixed = instanced();
        // Of four instances one is kept, the others differ.
        mixed.set_leaf_widths(|_, number| 0.25 * (number % 4) as f32);
        assert_eq!(differences(&mixed, &lod_transition()), 0);
        assert_eq!(differences(&mixed, &LodTransition::MESHES), 0);
        let mut random = Random(3);
        let changed = (0..500).filter(|_| {
            let (origin, direction) = (random.vector() * 1.5, random.vector().normalize());
            let all = trace(&mixed, origin, direction, AnyHit::No);
            mixed.trace_with_lod(origin, direction, 10.0, AnyHit::No, &lod_transition()) != all
        });
        let changed = changed.count();
        assert!(changed > 20, "{changed}");
    }

    #[test]
    fn a_hit_point_is_on_the_ray_and_in_the_triangle() {
        let geometry = soup(300, 0.5);
        let mut random = Random(5);
        let mut hits = 0;
        for _ in 0..500 {
            let (origin, direction) = (random.vector() * 1.5, random.vector().normalize());
            let hit = trace(&geometry, origin, direction, AnyHit::No);
            if hit.primitive == NO_HIT {
                continue;
            }
            hits += 1;
            let [a, b, c] = geometry.corners(hit.primitive);
            let by_weights = a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v;
            // Grazing triangles magnify rounding.
            assert!((by_weights - (origin + direction * hit.t)).length() < 1e-4, "{hit:?}");
        }
        assert!(hits > 100);
    }

    #[test]
    fn no_ray_slips_between_triangles_that_share_an_edge() {
        let mut random = Random(99);
        for _ in 0..100 {
            // A fan about a point, with corners that are no round numbers.
            let corners: Vec<Vec3> = (0..5)
                .map(|i| {
                    let (sin, cos) = (1.2566 * i as f32 + 0.3 * random.unit()).sin_cos();
                    Vec3::new(cos + 0.1 * random.unit(), sin, random.unit() * 0.5)
                })
                .collect();
            let all: Vec<Vec3> = std::iter::once(Vec3::new(0.01, 0.02, 0.1)).chain(corners).collect();
            let vertices: Vec<Vertex> = all
                .iter()
                .map(|p| Vertex { position: p.to_array(), u: 0.0, normal: [0.0, 0.0, 1.0], v: 0.0, tangent: [1.0; 4] })
                .collect();
            let triangles = (0..5).map(|i| Triangle { vertices: [0, 1 + i, 1 + (i + 1) % 5], material: 0 }).collect();
            let geometry = Geometry::new(vertices, triangles).unwrap();
            for _ in 0..50 {
                // Aim at a point of an inner edge, as exactly as f32 can.
                let on_edge = all[0].lerp(all[1 + (random.unit() * 5.0) as usize % 5], 0.9 * random.unit());
                let origin = on_edge + Vec3::new(random.unit(), random.unit(), 3.0 + random.unit());
                let direction = (on_edge - origin).normalize();
                assert_ne!(trace(&geometry, origin, direction, AnyHit::No).primitive, NO_HIT);
            }
        }
    }

    #[test]
    fn a_box_that_is_too_small_is_noticed() {
        for mut broken in [soup(3000, 0.05), instanced()] {
            let root = broken.root() as usize;
            for (number, node) in broken.nodes_mut().iter_mut().enumerate() {
                if number % 16 == 1 || number == root + 1 {
                    node.hi = node.lo;
                }
            }
            assert!(differences(&broken, &LodTransition::MESHES) > 0);
        }
    }

    #[test]
    fn every_triangle_is_in_exactly_one_leaf_and_the_stack_is_deep_enough() {
        // Equal centres cannot be separated by planes; the halving rule has to.
        let position =
            |i: u32, corner: u32| [corner as f32 * (1.0 + i as f32), if corner == 1 { 1.0 } else { 0.0 }, 0.0];
        let vertices: Vec<Vertex> = (0..3000)
            .map(|i| Vertex {
                position: position(0, i % 3),
                u: 0.0,
                normal: [0.0, 0.0, 1.0],
                v: 0.0,
                tangent: [1.0, 0.0, 0.0, 1.0],
            })
            .collect();
        let triangles = (0..1000).map(|i| Triangle { vertices: [3 * i, 3 * i + 1, 3 * i + 2], material: 0 }).collect();
        // Instances in one place cannot be separated either.
        let pile = vec![Placement { mesh: 0, world_from_object: Mat4::IDENTITY }; 3000];
        let pile = Geometry::placed(vec![soup_mesh(1, 1.0)], &pile).unwrap();
        let mut open = vec![(pile.root(), 0usize)];
        let (mut seen, mut deepest_top) = (vec![0; 3000], 0);
        while let Some((node, depth)) = open.pop() {
            deepest_top = deepest_top.max(depth);
            let node = pile.nodes()[node as usize];
            match node.count {
                0 => open.extend([(node.first, depth + 1), (node.first + 1, depth + 1)]),
                count => {
                    assert_eq!(count, 1);
                    seen[node.first as usize] += 1;
                }
            }
        }
        assert!(seen.iter().all(|count| *count == 1));
        for geometry in [Geometry::new(vertices, triangles).unwrap(), soup(3000, 0.05)] {
            let nodes = geometry.nodes();
            let root = geometry.instances()[0].root;
            let mut seen = vec![0; geometry.triangles().len()];
            let mut open = vec![(root, 0usize)];
            let mut deepest = 0;
            while let Some((node, depth)) = open.pop() {
                deepest = deepest.max(depth);
                let node = nodes[node as usize];
                if node.count == 0 {
                    open.extend([(node.first, depth + 1), (node.first + 1, depth + 1)]);
                }
                (node.first..node.first + node.count).for_each(|i| seen[i as usize] += 1);
            }
            assert!(seen.iter().all(|count| *count == 1));
            assert!(deepest + deepest_top < STACK, "depth {deepest} below {deepest_top}");
            assert_eq!(geometry.stack_entries(&[geometry.root()]), deepest.next_multiple_of(32));
        }
    }
}
