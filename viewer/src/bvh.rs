//! A bounding volume hierarchy of two children per node, split by the surface-area heuristic over bins [Wald 2007],
//! and its traversal. Twin of the traversal: `shaders/bvh.wgsl`, over the same arrays.

use crate::geometry::{Triangle, Vertex};
use glam::Vec3;

/// Triangles per leaf up to which a node is not split.
const LEAF_TRIANGLES: usize = 4;
/// Bins per axis of the split search.
const BINS: usize = 16;
/// Depth from which nodes are halved by count, which bounds the depth: 2^24 triangles add 24 levels at most.
const HALVING_DEPTH: usize = 32;
/// Entries of the traversal's stack; more than the deepest tree needs. Twin: `BVH_STACK` in `bvh.wgsl`.
pub const STACK: usize = 64;
/// Shares of t by which a box is entered too late because of rounding [Ize 2013].
const BOX_SLACK: f32 = 1.000_001;
/// Smallest direction component that a slab test divides by.
const LEAST_DIRECTION: f32 = 1e-15;
/// Smallest determinant of a triangle that is hit; below, the ray lies in its plane.
const LEAST_DETERMINANT: f32 = 1e-30;
/// Share of an edge function's terms that is rounding: two ulp, because some GPUs fuse one of its products into the sum
/// and not the other, and a ray on an edge could then miss the triangles on both sides.
const EDGE_SLACK: f32 = 2.4e-7;
/// The constants that the shader has too, by name.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, f32)] = &[
    ("BOX_SLACK", BOX_SLACK),
    ("LEAST_DIRECTION", LEAST_DIRECTION),
    ("LEAST_DETERMINANT", LEAST_DETERMINANT),
    ("EDGE_SLACK", EDGE_SLACK),
];
/// Primitive number of a ray that hits nothing. Twin: `NO_HIT` in `shade.wgsl`.
pub const NO_HIT: u32 = u32::MAX;

/// A node. Twin: `BvhNode` in `bvh.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct BvhNode {
    /// Least corner.
    pub lo: [f32; 3],
    /// Leaf: its first triangle. Inner node: its left child; the right one follows.
    pub first: u32,
    /// Greatest corner.
    pub hi: [f32; 3],
    /// Leaf: number of triangles. Inner node: 0.
    pub count: u32,
}

/// The hierarchy; node 0 is the root.
#[derive(Debug, Clone)]
pub struct Bvh {
    nodes: Vec<BvhNode>,
}

/// Where a ray meets a triangle. Twin: `Hit` in `shade.wgsl`.
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
}

#[derive(Clone, Copy)]
struct Bounds {
    lo: Vec3,
    hi: Vec3,
}

impl Bounds {
    const EMPTY: Bounds = Bounds { lo: Vec3::INFINITY, hi: Vec3::NEG_INFINITY };

    fn add(self, other: Bounds) -> Bounds {
        Bounds { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }

    fn half_area(self) -> f32 {
        let d = (self.hi - self.lo).max(Vec3::ZERO);
        d.x * d.y + d.y * d.z + d.z * d.x
    }
}

struct Item {
    bounds: Bounds,
    centre: Vec3,
    triangle: u32,
}

impl Bvh {
    /// Sorts `triangles` into leaf order and builds the hierarchy over them. `triangles` is not empty.
    ///
    /// Deterministic. Cost: O(n log n), about 1 us per triangle.
    pub(crate) fn build(vertices: &[Vertex], triangles: &mut [Triangle]) -> Bvh {
        let mut items: Vec<Item> = triangles
            .iter()
            .enumerate()
            .map(|(index, triangle)| {
                let corners = triangle.vertices.map(|v| Vec3::from(vertices[v as usize].position));
                let lo = corners[0].min(corners[1]).min(corners[2]);
                let hi = corners[0].max(corners[1]).max(corners[2]);
                Item { bounds: Bounds { lo, hi }, centre: (lo + hi) * 0.5, triangle: index as u32 }
            })
            .collect();
        let mut nodes = vec![bytemuck::Zeroable::zeroed()];
        // Split every open node until all are leaves: (node, its items, depth).
        let mut open = vec![(0usize, 0..items.len(), 0usize)];
        while let Some((node, range, depth)) = open.pop() {
            let bounds = items[range.clone()].iter().fold(Bounds::EMPTY, |all, item| all.add(item.bounds));
            let count = range.len();
            let middle = split(&mut items[range.clone()], bounds, depth).map(|left| range.start + left);
            let mut made = BvhNode {
                lo: bounds.lo.to_array(),
                first: range.start as u32,
                hi: bounds.hi.to_array(),
                count: count as u32,
            };
            if let Some(middle) = middle {
                made.first = nodes.len() as u32;
                made.count = 0;
                nodes.extend([BvhNode::zeroed_node(); 2]);
                open.push((made.first as usize + 1, middle..range.end, depth + 1));
                open.push((made.first as usize, range.start..middle, depth + 1));
            }
            nodes[node] = made;
        }
        let sorted: Vec<Triangle> = items.iter().map(|item| triangles[item.triangle as usize]).collect();
        triangles.copy_from_slice(&sorted);
        Bvh { nodes }
    }

    /// The nodes, as the GPU binds them.
    pub fn nodes(&self) -> &[BvhNode] {
        &self.nodes
    }

    /// Least and greatest corner of everything.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        (Vec3::from(self.nodes[0].lo), Vec3::from(self.nodes[0].hi))
    }

    /// The nearest hit with 0 < t < `t_max`, or any hit if `any`. `direction` is unit.
    /// Twin: `bvh_trace` in `bvh.wgsl`.
    pub fn trace(
        &self,
        vertices: &[Vertex],
        triangles: &[Triangle],
        origin: Vec3,
        direction: Vec3,
        t_max: f32,
        any: AnyHit,
    ) -> Hit {
        let mut best = Hit { t: t_max, primitive: NO_HIT, u: 0.0, v: 0.0 };
        let inverse = direction.map(|d| 1.0 / if d.abs() < LEAST_DIRECTION { LEAST_DIRECTION.copysign(d) } else { d });
        let shear = Shear::new(direction);
        let mut stack = [0u32; STACK];
        let mut size = 0;
        let mut at = 0u32;
        if enter(&self.nodes[0], origin, inverse, best.t) >= best.t {
            return best;
        }
        loop {
            let node = self.nodes[at as usize];
            if node.count > 0 {
                for primitive in node.first..node.first + node.count {
                    let corners =
                        triangles[primitive as usize].vertices.map(|i| Vec3::from(vertices[i as usize].position));
                    if let Some((t, u, v)) = intersect(origin, &shear, corners)
                        && t < best.t
                    {
                        best = Hit { t, primitive, u, v };
                        if any == AnyHit::Yes {
                            return best;
                        }
                    }
                }
            } else {
                let left = enter(&self.nodes[node.first as usize], origin, inverse, best.t);
                let right = enter(&self.nodes[node.first as usize + 1], origin, inverse, best.t);
                // Go to the nearer child, keep the farther one.
                let (near, far) =
                    if left <= right { (node.first, node.first + 1) } else { (node.first + 1, node.first) };
                if left.min(right) < best.t {
                    if left.max(right) < best.t {
                        stack[size] = far;
                        size += 1;
                    }
                    at = near;
                    continue;
                }
            }
            if size == 0 {
                return best;
            }
            size -= 1;
            at = stack[size];
        }
    }
}

/// Whether the first hit found ends a traversal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AnyHit {
    /// Any hit will do (shadow rays).
    Yes,
    /// Only the nearest hit.
    No,
}

impl BvhNode {
    fn zeroed_node() -> BvhNode {
        bytemuck::Zeroable::zeroed()
    }
}

/// Number of items that go to the left, after sorting the slice so; `None` for a leaf.
fn split(items: &mut [Item], bounds: Bounds, depth: usize) -> Option<usize> {
    if items.len() <= LEAF_TRIANGLES {
        return None;
    }
    let centres = items.iter().fold(Bounds::EMPTY, |all, item| all.add(Bounds { lo: item.centre, hi: item.centre }));
    let extent = centres.hi - centres.lo;
    let mut best: Option<(f32, usize, usize)> = None;
    if depth < HALVING_DEPTH {
        for axis in 0..3 {
            if extent[axis] <= 0.0 {
                continue;
            }
            let mut bins = [(Bounds::EMPTY, 0usize); BINS];
            for item in items.iter() {
                let bin = &mut bins[bin_of(item.centre[axis], centres.lo[axis], extent[axis])];
                *bin = (bin.0.add(item.bounds), bin.1 + 1);
            }
            let mut right = [(0.0f32, 0usize); BINS];
            let mut all = (Bounds::EMPTY, 0);
            for bin in (1..BINS).rev() {
                all = (all.0.add(bins[bin].0), all.1 + bins[bin].1);
                right[bin] = (all.0.half_area(), all.1);
            }
            let mut left = (Bounds::EMPTY, 0);
            for bin in 1..BINS {
                left = (left.0.add(bins[bin - 1].0), left.1 + bins[bin - 1].1);
                if left.1 == 0 || right[bin].1 == 0 {
                    continue;
                }
                let cost = left.0.half_area() * left.1 as f32 + right[bin].0 * right[bin].1 as f32;
                if best.is_none_or(|(least, ..)| cost < least) {
                    best = Some((cost, axis, bin));
                }
            }
        }
    }
    if let Some((cost, axis, bin)) = best
        && (cost < bounds.half_area() * items.len() as f32 || items.len() > 4 * LEAF_TRIANGLES)
    {
        // Partition in place; the order within a side is that of the input, which keeps the build deterministic.
        let key = |item: &Item| bin_of(item.centre[axis], centres.lo[axis], extent[axis]) >= bin;
        items.sort_by_key(key);
        return Some(items.partition_point(|item| !key(item)));
    }
    if items.len() <= 4 * LEAF_TRIANGLES && depth < HALVING_DEPTH {
        return None;
    }
    // No useful plane (all centres in one place, or too deep): halve along the longest axis.
    let axis = extent.max_position();
    items.sort_by(|a, b| a.centre[axis].total_cmp(&b.centre[axis]));
    Some(items.len() / 2)
}

fn bin_of(centre: f32, lo: f32, extent: f32) -> usize {
    (((centre - lo) / extent * BINS as f32) as usize).min(BINS - 1)
}

/// Distance at which a ray enters a box, or `t_max` if it does not before that. Twin: `bvh_enter`.
fn enter(node: &BvhNode, origin: Vec3, inverse: Vec3, t_max: f32) -> f32 {
    let a = (Vec3::from(node.lo) - origin) * inverse;
    let b = (Vec3::from(node.hi) - origin) * inverse;
    let near = a.min(b).max_element().max(0.0);
    let far = a.max(b).min_element() * BOX_SLACK;
    if near <= far && near < t_max { near } else { t_max }
}

/// A ray's direction made ready for triangles: its largest axis, and what shears it onto that axis. Twin: `BvhShear`.
struct Shear {
    axis: usize,
    factors: Vec3,
}

impl Shear {
    fn new(direction: Vec3) -> Shear {
        let size = direction.abs();
        let axis = if size.x > size.y && size.x > size.z {
            0
        } else if size.y > size.z {
            1
        } else {
            2
        };
        let d = turn(direction, axis);
        let inverse = 1.0 / d.z;
        Shear { axis, factors: Vec3::new(d.x * inverse, d.y * inverse, inverse) }
    }

    fn apply(&self, v: Vec3) -> Vec3 {
        let v = turn(v, self.axis);
        Vec3::new(v.x - self.factors.x * v.z, v.y - self.factors.y * v.z, v.z * self.factors.z)
    }
}

/// The components in cyclic order so that `axis` becomes z. Twin: `bvh_turn`.
fn turn(v: Vec3, axis: usize) -> Vec3 {
    match axis {
        0 => Vec3::new(v.y, v.z, v.x),
        1 => Vec3::new(v.z, v.x, v.y),
        _ => v,
    }
}

/// Twice the signed area of the origin, p and q, and how much of it is rounding. Twin: `bvh_edge`.
fn edge(p: Vec3, q: Vec3) -> (f32, f32) {
    let (a, b) = (p.x * q.y, p.y * q.x);
    (a - b, EDGE_SLACK * (a.abs() + b.abs()))
}

/// (t, u, v) of a ray and a triangle, seen from either side, without gaps between triangles that share an edge
/// [Woop 2013]. Differs from the paper in the slack, which stands for its double-precision fallback.
/// Twin: `bvh_intersect`.
fn intersect(origin: Vec3, shear: &Shear, corners: [Vec3; 3]) -> Option<(f32, f32, f32)> {
    let [a, b, c] = corners.map(|corner| shear.apply(corner - origin));
    let ((wa, sa), (wb, sb), (wc, sc)) = (edge(c, b), edge(a, c), edge(b, a));
    let positive = wa >= -sa && wb >= -sb && wc >= -sc;
    let negative = wa <= sa && wb <= sb && wc <= sc;
    let determinant = wa + wb + wc;
    if !(positive || negative) || determinant.abs() < LEAST_DETERMINANT {
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
    use crate::geometry::Geometry;

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
        Geometry::new(vertices, triangles).unwrap()
    }

    fn brute_force(geometry: &Geometry, origin: Vec3, direction: Vec3, t_max: f32) -> Hit {
        let shear = Shear::new(direction);
        let mut best = Hit { t: t_max, primitive: NO_HIT, u: 0.0, v: 0.0 };
        for primitive in 0..geometry.triangles().len() as u32 {
            if let Some((t, u, v)) = intersect(origin, &shear, geometry.corners(primitive))
                && t < best.t
            {
                best = Hit { t, primitive, u, v };
            }
        }
        best
    }

    fn trace(geometry: &Geometry, bvh: &Bvh, origin: Vec3, direction: Vec3, any: AnyHit) -> Hit {
        bvh.trace(geometry.vertices(), geometry.triangles(), origin, direction, 10.0, any)
    }

    /// Rays on which the hierarchy and the slow obvious search differ, of 2000.
    fn differences(geometry: &Geometry, bvh: &Bvh) -> usize {
        let mut random = Random(77);
        (0..2000)
            .filter(|i| {
                let origin = random.vector() * 1.5;
                // Every seventh ray runs along an axis, where slab tests divide by zero if they are careless.
                let direction = if i % 7 == 0 { Vec3::AXES[i % 3] } else { random.vector().normalize() };
                let expected = brute_force(geometry, origin, direction, 10.0);
                let found = trace(geometry, bvh, origin, direction, AnyHit::No);
                let any = trace(geometry, bvh, origin, direction, AnyHit::Yes);
                found != expected || (any.primitive == NO_HIT) != (expected.primitive == NO_HIT)
            })
            .count()
    }

    #[test]
    fn finds_the_same_hits_as_brute_force() {
        for (count, size) in [(1, 1.0), (7, 0.5), (3000, 0.05)] {
            let geometry = soup(count, size);
            assert_eq!(differences(&geometry, geometry.bvh()), 0, "{count} triangles");
        }
    }

    #[test]
    fn a_hit_point_is_on_the_ray_and_in_the_triangle() {
        let geometry = soup(300, 0.5);
        let mut random = Random(5);
        let mut hits = 0;
        for _ in 0..500 {
            let (origin, direction) = (random.vector() * 1.5, random.vector().normalize());
            let hit = trace(&geometry, geometry.bvh(), origin, direction, AnyHit::No);
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
                assert_ne!(trace(&geometry, geometry.bvh(), origin, direction, AnyHit::No).primitive, NO_HIT);
            }
        }
    }

    #[test]
    fn a_box_that_is_too_small_is_noticed() {
        let geometry = soup(3000, 0.05);
        let mut broken = geometry.bvh().clone();
        let leaf = broken.nodes.iter().rposition(|node| node.count == 0).unwrap();
        let shrunk = (0..broken.nodes.len()).filter(|i| i % 16 == 0 && *i > 0).chain([leaf]);
        for node in shrunk {
            broken.nodes[node].hi = broken.nodes[node].lo;
        }
        assert!(differences(&geometry, &broken) > 0);
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
        for geometry in [Geometry::new(vertices, triangles).unwrap(), soup(3000, 0.05)] {
            let nodes = geometry.bvh().nodes();
            let mut seen = vec![0; geometry.triangles().len()];
            let mut open = vec![(0u32, 0usize)];
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
            assert!(deepest < STACK, "depth {deepest}");
        }
    }
}
