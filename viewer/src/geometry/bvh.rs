//! Traversal of the hierarchies: one over the instances, whose leaves hold one instance each, and one over the
//! triangles of each mesh, in the mesh's own space. All lie in one array of nodes. Twin: `bvh.wgsl`, over the same
//! arrays, which keeps nodes and leaves that wait in groups, since a GPU has little memory for each ray; here each waits by itself,
//! with the distance at which the ray enters it, nearest first.

use crate::geometry::bvh_node::{BvhNode, CHILDREN, Child};
use crate::geometry::geometry::{Geometry, Instance};
use crate::geometry::lanes::{BoxRay, Lanes, Portable, TriangleRay};
use crate::geometry::lod_transition::{LodTransition, SpheresAlong};
use glam::Vec3;
use std::cell::Cell;

/// Entries of the traversal's stack in `bvh.wgsl` as it stands. The module of a scene has as many as that needs, which no number
/// bounds ([`Geometry::stack_entries`]).
pub(crate) const STACK: usize = 64;
/// Primitive number of a ray that hits nothing. Twin: `NO_HIT` in `surface.wgsl`.
pub const NO_HIT: u32 = u32::MAX;
/// Instance number of a ray that is in none.
#[cfg(test)]
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
        let spheres = lod_transition.along(origin, direction);
        Traced { geometry: self, origin, direction, t_max, any, spheres, fronts: &AllFronts }.hit_in_lanes()
    }

    /// Traces a ray: returns the nearest hit with 0 < t < `t_max` of those whose front the ray meets and that are there.
    pub(crate) fn trace_fronts(&self, origin: Vec3, direction: Vec3, t_max: f32, fronts: &dyn Fronts) -> Hit {
        let spheres = LodTransition::MESHES.along(origin, direction);
        Traced { geometry: self, origin, direction, t_max, any: AnyHit::Front, spheres, fronts }.hit_in_lanes()
    }
}

/// The fronts that are there for a ray.
pub(crate) trait Fronts {
    /// Returns from where to where along the ray those of an instance may be there; nowhere where the end is not behind the begin.
    fn range(&self, instance: u32) -> [f32; 2];

    /// Tells whether one of an instance is there at t.
    fn is_there(&self, instance: u32, t: f32) -> bool;
}

/// All fronts.
struct AllFronts;

impl Fronts for AllFronts {
    fn range(&self, _: u32) -> [f32; 2] {
        [0.0, f32::INFINITY]
    }

    fn is_there(&self, _: u32, _: f32) -> bool {
        true
    }
}

/// A ray to be traced.
#[derive(Clone, Copy)]
struct Traced<'a> {
    geometry: &'a Geometry,
    origin: Vec3,
    direction: Vec3,
    t_max: f32,
    any: AnyHit,
    spheres: SpheresAlong,
    fronts: &'a dyn Fronts,
}

/// A ray to be traced in wide registers.
#[cfg(target_arch = "x86_64")]
struct TracedIn<'a> {
    lanes: pulp::x86::V3,
    traced: Traced<'a>,
}

#[cfg(target_arch = "x86_64")]
impl pulp::NullaryFnOnce for TracedIn<'_> {
    type Output = Hit;

    #[inline(always)]
    fn call(self) -> Hit {
        self.traced.hit(self.lanes)
    }
}

impl Traced<'_> {
    /// Traces the ray in the widest registers that there are.
    fn hit_in_lanes(self) -> Hit {
        #[cfg(target_arch = "x86_64")]
        if let Some(lanes) = pulp::x86::V3::try_new() {
            return lanes.vectorize(TracedIn { lanes, traced: self });
        }
        self.hit(Portable)
    }

    /// Traces the ray.
    #[inline(always)]
    fn hit(self, lanes: impl Lanes) -> Hit {
        let mut reach = self.t_max;
        let world = BoxRay::new(self.origin, self.direction);
        let mut instances = Instances { lanes, traced: self, best: Hit::none(self.t_max) };
        let mut stack = Stack { waiting: STACK_OF_THREAD.take(), size: 0 };
        walk(lanes, &mut stack, self.geometry.nodes(), self.geometry.root(), &world, &mut reach, &mut instances);
        STACK_OF_THREAD.set(stack.waiting);
        instances.best
    }
}

/// What a ray does in the leaves of a hierarchy.
trait Leaves {
    /// Tells whether leaves are visited from near to far.
    fn is_sorted(&self) -> bool;

    /// Visits a leaf, by its first primitive and their count. May draw `reach` nearer; ends the walk by returning true.
    fn visit(&mut self, stack: &mut Stack, first: u32, count: u32, reach: &mut f32) -> bool;
}

/// Into the hierarchies of instances.
struct Instances<'a, L> {
    lanes: L,
    traced: Traced<'a>,
    best: Hit,
}

impl<L: Lanes> Leaves for Instances<'_, L> {
    #[inline(always)]
    fn is_sorted(&self) -> bool {
        true
    }

    #[inline(always)]
    fn visit(&mut self, stack: &mut Stack, instance: u32, _: u32, reach: &mut f32) -> bool {
        // Into the mesh's own space, where t is the same because the direction is not made unit again.
        let Traced { geometry, origin, direction, any, spheres, fronts, .. } = self.traced;
        let placed = &geometry.instances()[instance as usize];
        // Where the mesh begins to be there, and beyond what nothing counts; of fronts the ray begins only there.
        let [from, last] = match any {
            AnyHit::Front => fronts.range(instance),
            AnyHit::Yes | AnyHit::No => spheres.mesh(placed.leaf_width),
        };
        let begin = if any == AnyHit::Front { from.max(0.0) } else { 0.0 };
        if from >= last.min(*reach) {
            return false;
        }
        let own = placed.object_from_world(direction, 0.0);
        let origin = placed.object_from_world(origin + direction * begin, 1.0);
        let ray = BoxRay::new(origin, own);
        let ray_of_triangles = TriangleRay::new(origin, own, any == AnyHit::Front);
        let mut triangles = Triangles {
            lanes: self.lanes,
            geometry,
            ray: ray_of_triangles,
            begin,
            from,
            any,
            instance,
            fronts,
            best: None,
        };
        let mut own_reach = reach.min(last) - begin;
        let ends = walk(self.lanes, stack, geometry.nodes(), placed.root, &ray, &mut own_reach, &mut triangles);
        if let Some(hit) = triangles.best {
            (self.best, *reach) = (hit, hit.t);
        }
        ends
    }
}

/// The triangles of an instance.
struct Triangles<'a, L> {
    lanes: L,
    geometry: &'a Geometry,
    ray: TriangleRay,
    /// Where the ray begins; t counts from there in the walk.
    begin: f32,
    from: f32,
    any: AnyHit,
    instance: u32,
    fronts: &'a dyn Fronts,
    best: Option<Hit>,
}

impl<L: Lanes> Leaves for Triangles<'_, L> {
    #[inline(always)]
    fn is_sorted(&self) -> bool {
        // What is in the way anywhere will do, and sorting takes longer than it saves.
        self.any != AnyHit::Yes
    }

    #[inline(always)]
    fn visit(&mut self, _: &mut Stack, first: u32, count: u32, reach: &mut f32) -> bool {
        for primitive in first..first + count {
            let corners = self.geometry.corner_lanes(primitive);
            if let Some((t, u, v)) = self.lanes.intersect(&self.ray, corners)
                && t < *reach
                && self.begin + t >= self.from
                && (self.any != AnyHit::Front || self.fronts.is_there(self.instance, self.begin + t))
            {
                self.best = Some(Hit { t: self.begin + t, primitive, u, v, instance: self.instance });
                *reach = t;
                if self.any == AnyHit::Yes {
                    return true;
                }
            }
        }
        false
    }
}

/// A child that waits: its node, or its leaf's first primitive with their count above it, and where the ray enters its box.
#[derive(Clone, Copy)]
struct Waiting {
    child: u32,
    t: f32,
}

/// Bits of [`Waiting::child`] above the primitive's number.
const LEAF: u32 = 1 << 31;
const COUNT_SHIFT: u32 = 29;

impl Waiting {
    #[inline(always)]
    fn new(node: &BvhNode, slot: usize, t: f32) -> Waiting {
        let child = match node.child(slot) {
            Some(Child::Node(number)) => number,
            Some(Child::Leaf(first, count)) => LEAF | count << COUNT_SHIFT | first,
            None => LEAF,
        };
        Waiting { child, t }
    }
}

thread_local! {
    /// The stack of the traversal, kept from ray to ray.
    static STACK_OF_THREAD: Cell<Vec<Waiting>> = const { Cell::new(Vec::new()) };
}

/// The children that wait, in a vector of which the first `size` count.
struct Stack {
    waiting: Vec<Waiting>,
    size: usize,
}

impl Stack {
    /// Makes room for another node's children.
    #[inline(always)]
    fn reserve(&mut self) {
        if self.waiting.len() < self.size + CHILDREN {
            self.grow();
        }
    }

    #[cold]
    fn grow(&mut self) {
        self.waiting.resize(2 * self.waiting.len() + 8 * CHILDREN, Waiting { child: 0, t: 0.0 });
    }
}

/// Visits the leaves that a ray meets before `reach` in a hierarchy, about from near to far. Returns whether a visit ended the walk.
#[inline(always)]
fn walk(
    lanes: impl Lanes,
    stack: &mut Stack,
    nodes: &[BvhNode],
    root: u32,
    ray: &BoxRay,
    reach: &mut f32,
    leaves: &mut impl Leaves,
) -> bool {
    let below = stack.size;
    let is_sorted = leaves.is_sorted();
    let mut current = root;
    loop {
        if current & LEAF == 0 {
            let node = &nodes[current as usize];
            let (mut met, near) = lanes.enter(node, ray, *reach);
            if met != 0 {
                stack.reserve();
                let first = stack.size;
                let slot = met.trailing_zeros() as usize % CHILDREN;
                let mut nearest = Waiting::new(node, slot, near[slot]);
                met &= met - 1;
                while met != 0 {
                    let slot = met.trailing_zeros() as usize % CHILDREN;
                    met &= met - 1;
                    let mut other = Waiting::new(node, slot, near[slot]);
                    if is_sorted && other.t < nearest.t {
                        std::mem::swap(&mut nearest, &mut other);
                    }
                    // Sorted, the nearest last.
                    let mut at = stack.size;
                    while is_sorted && at > first && stack.waiting[at - 1].t < other.t {
                        stack.waiting[at] = stack.waiting[at - 1];
                        at -= 1;
                    }
                    stack.waiting[at] = other;
                    stack.size += 1;
                }
                current = nearest.child;
                continue;
            }
        } else if leaves.visit(stack, current & ((1 << COUNT_SHIFT) - 1), current >> COUNT_SHIFT & 3, reach) {
            stack.size = below;
            return true;
        }
        loop {
            if stack.size == below {
                return false;
            }
            stack.size -= 1;
            let Waiting { child, t } = stack.waiting[stack.size];
            if t < *reach {
                current = child;
                break;
            }
        }
    }
}

impl Geometry {
    /// Returns the entries of the stack in `bvh.wgsl` that rays take at most, in multiples of 16, so that scenes seldom differ in them.
    /// `tops` are the nodes where the hierarchies over instances begin. Cost: a pass over the nodes.
    pub(crate) fn stack_entries(&self, tops: &[u32]) -> usize {
        let nodes = self.nodes();
        let mut heights = vec![0usize; nodes.len()];
        // Children stand behind their parents.
        for (number, node) in nodes.iter().enumerate().rev() {
            let children = node.first_child as usize..(node.first_child + node.exponents[3].count_ones()) as usize;
            heights[number] = 1 + heights[children].iter().max().unwrap_or(&0);
        }
        // Every node but the last on the way lets a group wait; where an instance is entered, two.
        let of_instances = tops.iter().map(|top| heights[*top as usize]).max();
        let of_meshes = self.instances().iter().map(|instance| heights[instance.root as usize]).max();
        (of_instances.unwrap_or(0) + of_meshes.unwrap_or(0)).next_multiple_of(16)
    }
}

impl Instance {
    /// Transforms a point (`w` 1) or a direction (`w` 0) of the world into the mesh's space. Twin: `object_from_world`.
    #[inline(always)]
    pub(crate) fn object_from_world(&self, v: Vec3, w: f32) -> Vec3 {
        let (v, [x, y, z]) = (v.extend(w), self.object_from_world);
        Vec3::new(v.dot(x.into()), v.dot(y.into()), v.dot(z.into()))
    }
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
            let ray = TriangleRay::new(instance.object_from_world(origin, 1.0), own, false);
            let [first, last] = lod_transition.along(world_origin, direction).mesh(instance.leaf_width);
            for primitive in mesh.first_triangle..mesh.first_triangle + mesh.triangles {
                if let Some((t, u, v)) = Portable.intersect(&ray, geometry.corner_lanes(primitive))
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
                if number % 16 == 1 || number == root {
                    node.planes[1] = node.planes[0];
                }
            }
            assert!(differences(&broken, &LodTransition::MESHES) > 0);
        }
    }

    #[test]
    fn the_stack_of_shaders_is_deep_enough() {
        // By the rule of the shader: what waits beside the deepest path, where all children are met.
        fn most(geometry: &Geometry, node: u32, is_top: bool) -> usize {
            let node = geometry.nodes()[node as usize];
            let children: Vec<Child> = (0..CHILDREN).filter_map(|slot| node.child(slot)).collect();
            let nodes = children.iter().filter(|child| matches!(child, Child::Node(_))).count();
            let leaves = children.len() - nodes;
            let below = |child: &Child| match *child {
                Child::Node(child) => usize::from(nodes > 1) + most(geometry, child, is_top),
                Child::Leaf(first, _) if is_top => {
                    let root = geometry.instances()[first as usize].root;
                    usize::from(nodes > 0) + usize::from(leaves > 1) + most(geometry, root, false)
                }
                Child::Leaf(..) => 0,
            };
            // While a node's nodes are visited, its leaves wait no more.
            children.iter().map(below).max().unwrap_or(0)
        }
        let alike = vec![Placement { mesh: 0, world_from_object: Mat4::IDENTITY }; 3000];
        let pile = Geometry::placed(vec![soup_mesh(100, 1.0)], &alike).unwrap();
        for geometry in [soup(1, 1.0), soup(3000, 0.05), soup(3000, 1.0), instanced(), pile] {
            let (entries, needed) =
                (geometry.stack_entries(&[geometry.root()]), most(&geometry, geometry.root(), true));
            assert!((needed..needed + 24).contains(&entries) && entries <= STACK, "{entries} {needed}");
        }
    }
}
