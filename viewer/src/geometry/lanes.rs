//! A ray against the eight boxes of a node at once, and against a triangle's corners at once, in registers as wide as the processor
//! has. Twins: `box_ray`, `bvh_enter`, `bvh_edge` and `bvh_intersect` in `bvh.wgsl`.

use crate::geometry::bvh_node::{Bounds, BvhNode, CHILDREN};
use crate::geometry::shear::{Shear, turn};
use glam::Vec3;
#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::{__m128, __m256};

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

/// A ray made ready for boxes.
#[derive(Clone, Copy)]
pub(crate) struct BoxRay {
    pub origin: Vec3,
    inverse: Vec3,
    /// Whether it enters boxes by their greater plane, on each axis.
    backward: [bool; 3],
}

impl BoxRay {
    /// Prepares a ray. Twin: `box_ray`.
    #[inline(always)]
    pub(crate) fn new(origin: Vec3, direction: Vec3) -> BoxRay {
        let inverse = Vec3::new(inverse_of(direction.x), inverse_of(direction.y), inverse_of(direction.z));
        BoxRay { origin, inverse, backward: [inverse.x < 0.0, inverse.y < 0.0, inverse.z < 0.0] }
    }

    /// Returns the planes of a node by which the ray enters and leaves on an axis, the step of t from plane to plane, and t where
    /// they begin.
    #[inline(always)]
    fn planes<const AXIS: usize>(&self, node: &BvhNode) -> ([u64; 2], f32, f32) {
        let [lo, hi] = [u64::from_le_bytes(node.planes[2 * AXIS]), u64::from_le_bytes(node.planes[2 * AXIS + 1])];
        let sides = if self.backward[AXIS] { [hi, lo] } else { [lo, hi] };
        let step = f32::from_bits(u32::from(node.exponents[AXIS]) << 23);
        (sides, step * self.inverse[AXIS], (node.lo[AXIS] - self.origin[AXIS]) * self.inverse[AXIS])
    }
}

#[inline(always)]
fn inverse_of(direction: f32) -> f32 {
    1.0 / if direction.abs() < MIN_DIRECTION { MIN_DIRECTION.copysign(direction) } else { direction }
}

/// A ray made ready for triangles.
#[derive(Clone, Copy)]
pub(crate) struct TriangleRay {
    shear: Shear,
    /// In the order of the shear's axes.
    origin: Vec3,
    /// Whether only triangles that are seen counter-clockwise count.
    front: bool,
}

impl TriangleRay {
    /// Prepares a ray, whose direction need not be unit.
    #[inline(always)]
    pub(crate) fn new(origin: Vec3, direction: Vec3, front: bool) -> TriangleRay {
        let shear = Shear::new(direction);
        TriangleRay { shear, origin: turn(origin, shear.axes), front }
    }
}

/// The corners of a triangle by axis: x, y and z of the first, second and third corner, and a lane without use.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(16))]
pub(crate) struct Corners([[f32; 4]; 3]);

impl Corners {
    /// Takes corners apart.
    pub(crate) fn new([a, b, c]: [Vec3; 3]) -> Corners {
        Corners([[a.x, b.x, c.x, 0.0], [a.y, b.y, c.y, 0.0], [a.z, b.z, c.z, 0.0]])
    }

    /// Returns the corners one by one.
    #[inline(always)]
    pub(crate) fn points(&self) -> [Vec3; 3] {
        let [x, y, z] = &self.0;
        [Vec3::new(x[0], y[0], z[0]), Vec3::new(x[1], y[1], z[1]), Vec3::new(x[2], y[2], z[2])]
    }

    /// Returns the box around the triangle.
    pub(crate) fn bounds(&self) -> Bounds {
        self.points().into_iter().fold(Bounds::EMPTY, Bounds::add_point)
    }
}

/// Arithmetic on several numbers at once. Triangles are met in the same bits whatever the registers; distances to boxes, which only
/// say where to look, may differ in their last ones.
pub(crate) trait Lanes: Copy {
    /// Returns which boxes of a node a ray enters before `reach`, a bit for each slot, and at which distance. Twin: `bvh_enter`.
    fn enter(self, node: &BvhNode, ray: &BoxRay, reach: f32) -> (u32, [f32; CHILDREN]);

    /// Intersects a ray and a triangle: returns (t, u, v), seen from either side, without gaps between triangles that share
    /// an edge [Woop 2013]. Differs from the paper in the slack, which stands for its double-precision fallback. Twin:
    /// `bvh_intersect`.
    fn intersect(self, ray: &TriangleRay, corners: &Corners) -> Option<(f32, f32, f32)>;
}

/// What every processor has.
#[derive(Clone, Copy)]
pub(crate) struct Portable;

impl Lanes for Portable {
    #[inline(always)]
    fn enter(self, node: &BvhNode, ray: &BoxRay, reach: f32) -> (u32, [f32; CHILDREN]) {
        let (mut near, mut far) = ([0.0f32; CHILDREN], [f32::INFINITY; CHILDREN]);
        for (sides, step, first) in [ray.planes::<0>(node), ray.planes::<1>(node), ray.planes::<2>(node)] {
            let [enter, leave] = sides.map(u64::to_le_bytes);
            for slot in 0..CHILDREN {
                let enter = f32::from(enter[slot]) * step + first;
                let leave = f32::from(leave[slot]) * step + first;
                near[slot] = if enter > near[slot] { enter } else { near[slot] };
                far[slot] = if leave < far[slot] { leave } else { far[slot] };
            }
        }
        let mut met = 0;
        for slot in 0..CHILDREN {
            met |= u32::from(near[slot] <= far[slot] * BOX_SLACK && near[slot] < reach) << slot;
        }
        (met, near)
    }

    #[inline(always)]
    fn intersect(self, ray: &TriangleRay, corners: &Corners) -> Option<(f32, f32, f32)> {
        let [x, y, z] = ray.shear.axes;
        let rows = [&corners.0[x % 3], &corners.0[y % 3], &corners.0[z % 3]];
        let corner = |number: usize| {
            ray.shear.apply_turned(Vec3::new(rows[0][number], rows[1][number], rows[2][number]) - ray.origin)
        };
        let (a, b, c) = (corner(0), corner(1), corner(2));
        let ((wa, sa), (wb, sb), (wc, sc)) = (edge(c, b), edge(a, c), edge(b, a));
        let positive = wa >= -sa && wb >= -sb && wc >= -sc;
        let negative = wa <= sa && wb <= sb && wc <= sc;
        if !(positive || negative) {
            return None;
        }
        hit(ray, [wa, wb, wc], [a.z, b.z, c.z])
    }
}

/// Returns twice the signed area of the origin, p and q, and how much of it is rounding. Twin: `bvh_edge`.
#[inline(always)]
fn edge(p: Vec3, q: Vec3) -> (f32, f32) {
    let (a, b) = (p.x * q.y, p.y * q.x);
    (a - b, EDGE_SLACK * (a.abs() + b.abs()))
}

/// Returns (t, u, v) by twice the areas opposite the corners and t at the corners.
#[inline(always)]
fn hit(ray: &TriangleRay, [wa, wb, wc]: [f32; 3], [ta, tb, tc]: [f32; 3]) -> Option<(f32, f32, f32)> {
    let determinant = wa + wb + wc;
    if determinant.abs() < MIN_DETERMINANT || ray.front && !ray.shear.is_towards(-determinant) {
        return None;
    }
    let inverse = 1.0 / determinant;
    let t = (wa * ta + wb * tb + wc * tc) * inverse;
    let u = (wb * inverse).clamp(0.0, 1.0);
    let v = (wc * inverse).clamp(0.0, 1.0 - u);
    (t > 0.0).then_some((t, u, v))
}

/// AVX2. Without closures, which need not be inlined, and would not run in wide registers then.
#[cfg(target_arch = "x86_64")]
impl Lanes for pulp::x86::V3 {
    #[inline(always)]
    fn enter(self, node: &BvhNode, ray: &BoxRay, reach: f32) -> (u32, [f32; CHILDREN]) {
        use std::arch::x86_64::{_CMP_LE_OQ, _CMP_LT_OQ};
        let avx = self.avx;
        let (enter_x, leave_x) = times(self, ray.planes::<0>(node));
        let (enter_y, leave_y) = times(self, ray.planes::<1>(node));
        let (enter_z, leave_z) = times(self, ray.planes::<2>(node));
        let near = avx._mm256_max_ps(enter_z, avx._mm256_setzero_ps());
        let near = avx._mm256_max_ps(avx._mm256_max_ps(enter_x, enter_y), near);
        let far = avx._mm256_min_ps(avx._mm256_min_ps(leave_x, leave_y), leave_z);
        let far = avx._mm256_mul_ps(far, avx._mm256_set1_ps(BOX_SLACK));
        let met = avx._mm256_and_ps(
            avx._mm256_cmp_ps::<_CMP_LE_OQ>(near, far),
            avx._mm256_cmp_ps::<_CMP_LT_OQ>(near, avx._mm256_set1_ps(reach)),
        );
        (avx._mm256_movemask_ps(met) as u32, bytemuck::cast(near))
    }

    #[inline(always)]
    fn intersect(self, ray: &TriangleRay, corners: &Corners) -> Option<(f32, f32, f32)> {
        use std::arch::x86_64::{_CMP_GE_OQ, _CMP_LE_OQ};
        let (sse, avx) = (self.sse, self.avx);
        let TriangleRay { shear, origin, .. } = ray;
        let [x, y, z] = shear.axes;
        let rows = &corners.0;
        // Relative to the origin, then sheared.
        let x = sse._mm_sub_ps(load(self, &rows[x % 3]), sse._mm_set1_ps(origin.x));
        let y = sse._mm_sub_ps(load(self, &rows[y % 3]), sse._mm_set1_ps(origin.y));
        let z = sse._mm_sub_ps(load(self, &rows[z % 3]), sse._mm_set1_ps(origin.z));
        let x = sse._mm_sub_ps(x, sse._mm_mul_ps(sse._mm_set1_ps(shear.factors.x), z));
        let y = sse._mm_sub_ps(y, sse._mm_mul_ps(sse._mm_set1_ps(shear.factors.y), z));
        let t = sse._mm_mul_ps(z, sse._mm_set1_ps(shear.factors.z));
        // Edges (c, b), (a, c) and (b, a): from corners in the order c, a, b to those in the order b, c, a.
        const FROM: i32 = 0b11_01_00_10;
        const TO: i32 = 0b11_00_10_01;
        let [from_x, from_y] = [sse._mm_shuffle_ps::<FROM>(x, x), sse._mm_shuffle_ps::<FROM>(y, y)];
        let [to_x, to_y] = [sse._mm_shuffle_ps::<TO>(x, x), sse._mm_shuffle_ps::<TO>(y, y)];
        let (a, b) = (sse._mm_mul_ps(from_x, to_y), sse._mm_mul_ps(from_y, to_x));
        let areas = sse._mm_sub_ps(a, b);
        let sign = sse._mm_set1_ps(-0.0);
        let sizes = sse._mm_add_ps(sse._mm_andnot_ps(sign, a), sse._mm_andnot_ps(sign, b));
        let slack = sse._mm_mul_ps(sizes, sse._mm_set1_ps(EDGE_SLACK));
        let positive = avx._mm_cmp_ps::<_CMP_GE_OQ>(areas, sse._mm_xor_ps(slack, sign));
        let negative = avx._mm_cmp_ps::<_CMP_LE_OQ>(areas, slack);
        let (positive, negative) = (sse._mm_movemask_ps(positive), sse._mm_movemask_ps(negative));
        if positive & 7 != 7 && negative & 7 != 7 {
            return None;
        }
        let [wa, wb, wc, _]: [f32; 4] = bytemuck::cast(areas);
        let [ta, tb, tc, _]: [f32; 4] = bytemuck::cast(t);
        hit(ray, [wa, wb, wc], [ta, tb, tc])
    }
}

/// Returns four numbers in a register.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn load(lanes: pulp::x86::V3, row: &[f32; 4]) -> __m128 {
    lanes.sse._mm_set_ps(row[3], row[2], row[1], row[0])
}

/// Returns t at eight planes by which a ray enters, and at eight by which it leaves.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn times(lanes: pulp::x86::V3, ([enter, leave], step, first): ([u64; 2], f32, f32)) -> (__m256, __m256) {
    let (avx, avx2, fma, sse2) = (lanes.avx, lanes.avx2, lanes.fma, lanes.sse2);
    let bytes = sse2._mm_set_epi64x(leave as i64, enter as i64);
    let enter = avx._mm256_cvtepi32_ps(avx2._mm256_cvtepu8_epi32(bytes));
    let leave = avx._mm256_cvtepi32_ps(avx2._mm256_cvtepu8_epi32(sse2._mm_unpackhi_epi64(bytes, bytes)));
    let (step, first) = (avx._mm256_set1_ps(step), avx._mm256_set1_ps(first));
    (fma._mm256_fmadd_ps(enter, step, first), fma._mm256_fmadd_ps(leave, step, first))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::bvh_node::Bounds;
    use btf_runtime::testing::Random;

    /// Where a ray is within a box made larger by `more` on each side, by the slow obvious rule.
    fn within(own: &Bounds, more: f64, origin: Vec3, direction: Vec3) -> [f64; 2] {
        let times = |corner: Vec3, more: f64| ((corner - origin).as_dvec3() + more) / direction.as_dvec3();
        let (a, b) = (times(own.lo, -more), times(own.hi, more));
        [a.min(b).max_element().max(0.0), a.max(b).min_element()]
    }

    #[test]
    fn narrow_and_wide_registers_enter_the_boxes_that_the_ray_meets() {
        let mut random = Random::new(9);
        let mut counts = [0; 3];
        for number in 0..3000 {
            let mut point = || Vec3::from([(); 3].map(|()| random.within(-1.0, 1.0)));
            let boxes = [(); CHILDREN].map(|()| Bounds::EMPTY.add_point(point()).add_point(point()));
            let mut node: BvhNode = bytemuck::Zeroable::zeroed();
            node.set_boxes(boxes);
            // An axis where slab tests divide by zero if they are careless.
            let direction = if number % 5 == 0 { Vec3::AXES[number % 3] } else { point() };
            let origin = 2.0 * point();
            let ray = BoxRay::new(origin, direction);
            let reach = random.within(0.5, 3.0);
            let mut found = vec![Portable.enter(&node, &ray, reach)];
            #[cfg(target_arch = "x86_64")]
            found.extend(pulp::x86::V3::try_new().map(|lanes| lanes.vectorize(|| lanes.enter(&node, &ray, reach))));
            for (slot, own) in boxes.into_iter().enumerate() {
                let [first, last] = within(&own, 0.0, origin, direction);
                // Planes are at most two steps off, of which 127 to 255 make the node.
                let [first_of_larger, last_of_larger] = within(&own, 0.04, origin, direction);
                for (met, near) in &found {
                    let is_met = met >> slot & 1 == 1;
                    if first <= last && first < f64::from(reach) {
                        assert!(is_met && f64::from(near[slot]) <= first * 1.000_002, "{own:?} {origin} {direction}");
                        counts[0] += 1;
                    } else if first_of_larger > last_of_larger || first_of_larger >= f64::from(reach) {
                        assert!(!is_met, "{own:?} {origin} {direction}");
                        counts[1] += 1;
                    }
                }
                // Planted: a smaller node misses what it should meet.
                let [mut smaller, scale] = [node; 2];
                smaller.planes[0] = scale.planes[1];
                let (met, _) = Portable.enter(&smaller, &ray, reach);
                counts[2] += usize::from(first <= last && first < f64::from(reach) && met >> slot & 1 == 0);
            }
        }
        assert!(counts.iter().all(|count| *count > 300), "{counts:?}");
    }

    #[test]
    fn narrow_and_wide_registers_meet_triangles_in_the_same_bits() {
        let mut random = Random::new(4);
        let mut hits = 0;
        for number in 0..20_000 {
            let mut point = || Vec3::from([(); 3].map(|()| random.within(-1.0, 1.0)));
            let corners = Corners::new([point(), point(), point()]);
            let (origin, direction) = (3.0 * point(), point());
            let [a, b, _] = corners.points();
            // Some aim at an edge.
            let direction = if number % 3 == 0 { a.lerp(b, 0.3) - origin } else { direction };
            let ray = TriangleRay::new(origin, direction, number % 2 == 0);
            let expected = Portable.intersect(&ray, &corners);
            hits += usize::from(expected.is_some());
            #[cfg(target_arch = "x86_64")]
            if let Some(lanes) = pulp::x86::V3::try_new() {
                assert_eq!(lanes.vectorize(|| lanes.intersect(&ray, &corners)), expected);
            }
        }
        assert!(hits > 2000, "{hits}");
    }
}
