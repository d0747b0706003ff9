//! Clipping of polygons to the cells of a grid of voxels.

use glam::Vec3;

/// Corners of a triangle cut by six planes at most.
const MAX_CORNERS: usize = 10;

/// A convex polygon.
#[derive(Debug, Clone, Copy)]
pub struct Polygon {
    corners: [Vec3; MAX_CORNERS],
    count: usize,
}

impl Polygon {
    /// Returns a polygon of three corners.
    pub fn triangle(corners: [Vec3; 3]) -> Polygon {
        let mut all = [Vec3::ZERO; MAX_CORNERS];
        all[..3].copy_from_slice(&corners);
        Polygon { corners: all, count: 3 }
    }

    /// Returns the part of the polygon inside a box.
    pub fn within(self, least: Vec3, most: Vec3) -> Polygon {
        (0..3).fold(self, |polygon, axis| polygon.cut(axis, least[axis])[1].cut(axis, most[axis])[0])
    }

    /// Returns the corners in order.
    pub fn corners(&self) -> &[Vec3] {
        &self.corners[..self.count]
    }

    /// Returns the part of the polygon inside a box.
    fn cut(&self, axis: usize, at: f32) -> [Polygon; 2] {
        let mut parts = [Polygon { corners: [Vec3::ZERO; MAX_CORNERS], count: 0 }; 2];
        for i in 0..self.count {
            let (p, q) = (self.corners[i], self.corners[(i + 1) % self.count]);
            let (dp, dq) = (p[axis] - at, q[axis] - at);
            if dp <= 0.0 {
                parts[0].push(p);
            }
            if dp >= 0.0 {
                parts[1].push(p);
            }
            if dp * dq < 0.0 {
                let mut middle = p + (q - p) * (dp / (dp - dq));
                middle[axis] = at;
                parts[0].push(middle);
                parts[1].push(middle);
            }
        }
        parts
    }

    fn push(&mut self, p: Vec3) {
        // Rounding can make one corner more than geometry does; it lies on an edge.
        if self.count < MAX_CORNERS {
            self.corners[self.count] = p;
            self.count += 1;
        }
    }

    /// Returns twice the area as a vector along the normal.
    pub fn double_area(&self) -> Vec3 {
        let c = self.corners();
        (2..self.count).fold(Vec3::ZERO, |sum, i| sum + (c[i - 1] - c[0]).cross(c[i] - c[0]))
    }
}

/// Calls `each(cell, polygon)` for the part of a triangle in each cell of the unit grid, whose cell (0, 0, 0) begins at
/// the origin.
pub fn clip_triangle(corners: [Vec3; 3], each: &mut impl FnMut([i32; 3], &Polygon)) {
    clip_polygon(Polygon::triangle(corners), each);
}

/// Calls `each(cell, polygon)` for the part in each cell of the unit grid of a triangle of which a part has been cut
/// off ([`Polygon::within`]).
pub fn clip_polygon(polygon: Polygon, each: &mut impl FnMut([i32; 3], &Polygon)) {
    if polygon.count >= 3 {
        along(polygon, 0, [0; 3], each);
    }
}

fn along(polygon: Polygon, axis: usize, mut cell: [i32; 3], each: &mut impl FnMut([i32; 3], &Polygon)) {
    if axis == 3 {
        each(cell, &polygon);
        return;
    }
    let (low, high) = polygon
        .corners()
        .iter()
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), p| (low.min(p[axis]), high.max(p[axis])));
    let first = low.floor() as i32;
    // What ends on a plane belongs below it, unless it lies in it.
    let last = if high > low { high.ceil() as i32 - 1 } else { first };
    let mut rest = polygon;
    for slab in first..=last {
        cell[axis] = slab;
        if slab == last {
            along(rest, axis + 1, cell, each);
            return;
        }
        let [below, above] = rest.cut(axis, (slab + 1) as f32);
        if below.count >= 3 {
            along(below, axis + 1, cell, each);
        }
        if above.count < 3 {
            return;
        }
        rest = above;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_runtime::testing::Random;

    fn point(random: &mut Random, reach: f32) -> Vec3 {
        Vec3::new(random.within(-reach, reach), random.within(-reach, reach), random.within(-reach, reach))
    }

    /// Returns the sum of the areas of the parts, after checking that each lies in its cell.
    fn clipped_area(corners: [Vec3; 3]) -> f64 {
        let mut sum = 0.0;
        clip_triangle(corners, &mut |cell, polygon| {
            for p in polygon.corners() {
                for axis in 0..3 {
                    let low = cell[axis] as f32;
                    assert!(p[axis] >= low - 1e-5 && p[axis] <= low + 1.0 + 1e-5, "{p} in {cell:?}");
                }
            }
            sum += 0.5 * f64::from(polygon.double_area().length());
        });
        sum
    }

    #[test]
    fn the_parts_of_a_triangle_have_its_area() {
        let mut random = Random::new(1);
        for reach in [0.2, 3.0, 40.0] {
            for _ in 0..200 {
                let [a, b, c] = [0; 3].map(|_| point(&mut random, reach));
                let area = 0.5 * f64::from((b - a).cross(c - a).length());
                let parts = clipped_area([a, b, c]);
                assert!((parts - area).abs() <= 1e-5 * f64::from(reach * reach), "{parts} of {area}");
                // Cut in two, and in another order.
                let middle = 0.5 * (b + c);
                let halves = clipped_area([c, a, middle]) + clipped_area([middle, a, b]);
                assert!((halves - parts).abs() <= 1e-5 * f64::from(reach * reach));
            }
        }
        // Planted: a smaller triangle has less.
        let [a, b] = [Vec3::ZERO, Vec3::X * 3.0];
        assert!(clipped_area([a, b, Vec3::Y]) > 1.05 * clipped_area([a, b, Vec3::Y * 0.9]));
    }

    #[test]
    fn what_lies_in_a_plane_of_the_grid_is_in_one_cell() {
        let corners = [Vec3::new(0.1, 0.1, 2.0), Vec3::new(0.8, 0.1, 2.0), Vec3::new(0.1, 0.8, 2.0)];
        let mut cells = Vec::new();
        clip_triangle(corners, &mut |cell, _| cells.push(cell));
        assert_eq!(cells, [[0, 0, 2]]);
    }
}
