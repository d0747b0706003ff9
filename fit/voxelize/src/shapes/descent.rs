//! Facets of a solid's surface: a descent splits only what the surface may pass [Neyret 1996, section 3.1], to a grid
//! that is up to four times as fine as the voxels, where tetrahedra are cut by the plane on which the solid's function
//! is zero [Doi & Koide 1991].
//!
//! Facets share their edges, so no ray passes between them. Edges and tips of the solid are blunted by a cell of that
//! grid.

use glam::{DVec3, I64Vec3};

use super::canvas::Canvas;
use super::solid::Solid;

/// Cells of the finer grid along a voxel at most.
const MAX_CELLS: u32 = 4;

/// Cells along the canvas that are fine enough: a body as large as it has two million facets then.
const ENOUGH_CELLS: u32 = 512;

/// Samples along a voxel of which a part is inside.
const SAMPLES: u32 = 4;

/// The six tetrahedra of a cube around its diagonal from corner 0 to corner 7; bit k of a corner's number is its
/// coordinate along axis k. Neighbouring cubes cut their common face along the same diagonal.
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

/// Calls `each` for every facet of a solid's surface that may lie on the canvas or be a copy of what does, in metres,
/// counterclockwise seen from outside. Returns the volume inside, in cubic metres, of what has been looked at.
///
/// Cost: some 100 values of the solid's function for each voxel that the surface passes, and `log` of the size.
pub fn polygonise(solid: &Solid, canvas: &Canvas, each: &mut impl FnMut([DVec3; 3])) -> f64 {
    let fine = f64::from((ENOUGH_CELLS / canvas.resolution()).clamp(1, MAX_CELLS));
    let cell_m = canvas.voxel_m() / fine;
    let [mut least, mut most] = solid.bounds(0.0);
    for k in 0..3 {
        if k == 2 || !canvas.cyclic()[k] {
            least[k] = least[k].max(canvas.least_m()[k]);
            most[k] = most[k].min(canvas.most_m()[k]);
        }
    }
    if !(least.cmple(most)).all() {
        return 0.0;
    }
    let cells = |place_m: DVec3| (canvas.grid_from_m(place_m) * fine).floor().as_i64vec3();
    // One cell of air around it, so that facets on the border are whole.
    let (from, to) = (cells(least) - 1, cells(most) + 2);
    let size = ((to - from).max_element() as u64).next_power_of_two() as i64;
    let mut descent = Descent { solid, origin_m: canvas.least_m(), cell_m, to, volume_m3: 0.0 };
    descent.block(from, size, each);
    descent.volume_m3
}

/// Returns the share of a voxel's volume that lies inside, its least corner at `from` in voxels: 1 and 0 are exact.
pub fn coverage(solid: &Solid, canvas: &Canvas, from: DVec3) -> f64 {
    let middle_m = canvas.m_from_grid(from + 0.5);
    let [low, high] = solid.range(middle_m, 0.5 * 3f64.sqrt() * canvas.voxel_m());
    if low > 0.0 || high < 0.0 {
        return f64::from(u8::from(high < 0.0));
    }
    let count = SAMPLES;
    let mut inside = 0;
    for i in 0..count.pow(3) {
        let at = DVec3::new(f64::from(i % count), f64::from(i / count % count), f64::from(i / (count * count)));
        inside += u32::from(solid.value(canvas.m_from_grid(from + (at + 0.5) / f64::from(count))) < 0.0);
    }
    f64::from(inside) / f64::from(count.pow(3))
}

struct Descent<'a> {
    solid: &'a Solid,
    origin_m: DVec3,
    cell_m: f64,
    /// End of the blocks.
    to: I64Vec3,
    volume_m3: f64,
}

impl Descent<'_> {
    fn place_m(&self, cell: DVec3) -> DVec3 {
        self.origin_m + cell * self.cell_m
    }

    fn block(&mut self, from: I64Vec3, size: i64, each: &mut impl FnMut([DVec3; 3])) {
        if !from.cmplt(self.to).all() {
            return;
        }
        let half = 0.5 * size as f64;
        let radius_m = half * 3f64.sqrt() * self.cell_m;
        let [low, high] = self.solid.range(self.place_m(from.as_dvec3() + half), radius_m);
        if low > 0.0 {
            return;
        }
        if high < 0.0 {
            self.volume_m3 += (size as f64 * self.cell_m).powi(3);
            return;
        }
        if size == 1 {
            self.cell(from, each);
            return;
        }
        for i in 0..8 {
            let step = I64Vec3::new(i & 1, i >> 1 & 1, i >> 2) * (size / 2);
            self.block(from + step, size / 2, each);
        }
    }

    fn cell(&mut self, from: I64Vec3, each: &mut impl FnMut([DVec3; 3])) {
        let place =
            |i: usize| self.place_m((from + I64Vec3::new(i as i64 & 1, i as i64 >> 1 & 1, i as i64 >> 2)).as_dvec3());
        let corners: [(DVec3, f64); 8] = std::array::from_fn(|i| (place(i), self.solid.value(place(i))));
        let sixth_m3 = self.cell_m.powi(3) / 6.0;
        let mut volume_m3 = 0.0;
        for tetrahedron in TETRAHEDRA {
            volume_m3 += sixth_m3 * cut(tetrahedron.map(|i| corners[i]), each);
        }
        self.volume_m3 += volume_m3;
    }
}

/// Cuts a tetrahedron where the linear function through its corners is zero; returns the share of its volume that is
/// inside.
fn cut(corners: [(DVec3, f64); 4], each: &mut impl FnMut([DVec3; 3])) -> f64 {
    let inside = |i: &usize| corners[*i].1 < 0.0;
    let (within, without): (Vec<usize>, Vec<usize>) = (0..4).partition(inside);
    let share = |a: usize, b: usize| corners[a].1 / (corners[a].1 - corners[b].1);
    // From the inside whoever asks, so that neighbours have the same bits.
    let zero = |a: usize, b: usize| corners[a].0 + (corners[b].0 - corners[a].0) * share(a, b);
    // Outwards is where the function grows.
    let mut facet = |triangle: [DVec3; 3]| {
        let normal = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]);
        let out = corners[without[0]].0 - corners[within[0]].0;
        let [a, b, c] = triangle;
        each(if normal.dot(out) >= 0.0 { [a, b, c] } else { [a, c, b] });
    };
    match (within.as_slice(), without.as_slice()) {
        ([], _) => 0.0,
        (_, []) => 1.0,
        (&[a], &[b, c, d]) => {
            facet([zero(a, b), zero(a, c), zero(a, d)]);
            share(a, b) * share(a, c) * share(a, d)
        }
        (&[a, b, c], &[d]) => {
            facet([zero(a, d), zero(b, d), zero(c, d)]);
            1.0 - share(d, a) * share(d, b) * share(d, c)
        }
        (&[a, b], &[c, d]) => {
            let quad = [zero(a, c), zero(a, d), zero(b, d), zero(b, c)];
            facet([quad[0], quad[1], quad[2]]);
            facet([quad[0], quad[2], quad[3]]);
            let [ac, ad, bc, bd] = [share(a, c), share(a, d), share(b, c), share(b, d)];
            // A prism, as three tetrahedra.
            ac * ad + ac * bd * (1.0 - ad) + (1.0 - ac) * bc * bd
        }
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::f64::consts::PI;

    use btf_models::shapes::{BlendElement, Shape, Space};

    use super::*;

    fn canvas(resolution: u32) -> Canvas {
        Canvas::new(&Space { least_m: [-1.0; 3], most_m: [1.0; 3], cyclic: [false; 2] }, resolution)
    }

    fn area(facet: [DVec3; 3]) -> DVec3 {
        0.5 * (facet[1] - facet[0]).cross(facet[2] - facet[0])
    }

    /// Returns the area, volume, and the sum of facets' area vectors over the area: 0 of what is closed.
    fn measured(shape: &Shape, resolution: u32) -> [f64; 3] {
        let (mut sum, mut across) = (0.0, DVec3::ZERO);
        let volume = polygonise(&Solid::of(shape).unwrap(), &canvas(resolution), &mut |facet| {
            sum += area(facet).length();
            across += area(facet);
        });
        [sum, volume, across.length() / sum]
    }

    fn sphere(centre_m: [f64; 3], radius_m: f64) -> Shape {
        Shape::Sphere { centre_m, radius_m }
    }

    fn blend() -> Shape {
        let element = |points_m: &[[f64; 3]], weight_m2| BlendElement { points_m: points_m.to_vec(), weight_m2 };
        let elements = vec![
            element(&[[-0.3, 0.1, 0.0]], 0.04),
            element(&[[0.3, 0.0, 0.1]], 0.01),
            element(&[[0.0, -0.4, -0.2], [0.1, 0.4, 0.3]], 0.005),
            element(&[[0.4, 0.4, -0.4], [0.6, 0.1, -0.4], [0.3, 0.2, -0.5]], 0.002),
        ];
        Shape::Blend { elements, threshold: 1.2 }
    }

    #[test]
    fn areas_and_volumes_are_the_solids_wherever_they_lie() {
        let shapes: [(Shape, f64, f64); 4] = [
            (sphere([0.0; 3], 0.5), 4.0 * PI * 0.25, 4.0 / 3.0 * PI * 0.125),
            (Shape::Box { least_m: [-0.4, -0.3, -0.2], most_m: [0.4, 0.3, 0.2] }, 2.0 * (0.48 + 0.32 + 0.24), 0.192),
            (
                Shape::Cylinder { ends_m: [[0.0, 0.0, -0.4], [0.0, 0.0, 0.4]], radius_m: 0.3 },
                2.0 * PI * 0.3 * (0.8 + 0.3),
                PI * 0.09 * 0.8,
            ),
            (
                Shape::Cone { ends_m: [[0.0, 0.0, -0.4], [0.0, 0.0, 0.4]], radii_m: [0.4, 0.1] },
                PI * (0.16 + 0.01 + 0.5 * 0.73f64.sqrt()),
                PI * 0.8 / 3.0 * (0.16 + 0.04 + 0.01),
            ),
        ];
        for (shape, area, volume) in shapes {
            for (move_m, turn_deg) in
                [([0.0; 3], [0.0; 3]), ([0.0137, -0.0071, 0.0193], [0.0; 3]), ([0.05; 3], [30.0, 50.0, -20.0])]
            {
                let placed = Shape::Placed { of: shape.clone().into(), scale: 0.9, turn_deg, move_m };
                let [found_area, found_volume, open] = measured(&placed, 64);
                let (area, volume) = (area * 0.81, volume * 0.729);
                // Edges are blunted by a cell of 1/256.
                assert!((found_area / area - 1.0).abs() < 0.01, "{} area {found_area} {area}", shape.kind());
                assert!((found_volume / volume - 1.0).abs() < 0.005, "{} volume {found_volume} {volume}", shape.kind());
                assert!(open < 1e-9, "{} {open}", shape.kind());
            }
        }
        // A smooth one to its second order: four times as near with cells half as large.
        let error = |resolution| (measured(&sphere([0.011, 0.02, -0.01], 0.5), resolution)[0] / PI - 1.0).abs();
        assert!(error(32) < 3e-4 && error(64) < 0.4 * error(32), "{} {}", error(32), error(64));
    }

    #[test]
    fn a_union_is_the_union_of_its_parts_and_a_difference_what_is_left() {
        // Two spheres of radius 0.4, 0.4 apart: each loses a cap of height 0.2.
        let [a, b] = [-0.2, 0.2].map(|x| sphere([x, 0.01, 0.02], 0.4));
        let (whole, cap) = (4.0 * PI * 0.16, 2.0 * PI * 0.4 * 0.2);
        let (ball, segment) = (4.0 / 3.0 * PI * 0.064, PI * 0.04 * (0.4 - 0.2 / 3.0));
        for (shape, area, volume) in [
            (Shape::Union { of: vec![a.clone(), b.clone()] }, 2.0 * (whole - cap), 2.0 * (ball - segment)),
            (Shape::Intersection { of: vec![a.clone(), b.clone()] }, 2.0 * cap, 2.0 * segment),
            (Shape::Difference { of: vec![a, b] }, whole, ball - 2.0 * segment),
        ] {
            let [found_area, found_volume, open] = measured(&shape, 64);
            assert!((found_area / area - 1.0).abs() < 0.01, "{} {found_area} {area}", shape.kind());
            assert!((found_volume / volume - 1.0).abs() < 0.005, "{} {found_volume} {volume}", shape.kind());
            assert!(open < 1e-9);
        }
    }

    #[test]
    fn the_descent_finds_every_cell_that_a_dense_scan_does() {
        let difference = Shape::Difference { of: vec![sphere([0.0; 3], 0.6), sphere([0.05, 0.0, 0.0], 0.58)] };
        for shape in [blend(), difference] {
            let (solid, canvas) = (Solid::of(&shape).unwrap(), canvas(16));
            let fine = f64::from(MAX_CELLS);
            let mut found = BTreeSet::new();
            polygonise(&solid, &canvas, &mut |facet| {
                let cell = (canvas.grid_from_m((facet[0] + facet[1] + facet[2]) / 3.0) * fine).floor().as_i64vec3();
                found.insert(cell.to_array());
            });
            let count = 16 * i64::from(MAX_CELLS);
            let value = |cell: I64Vec3| solid.value(canvas.m_from_grid(cell.as_dvec3() / fine)) < 0.0;
            let mut scanned = BTreeSet::new();
            for i in 0..count.pow(3) {
                let cell = I64Vec3::new(i % count, i / count % count, i / (count * count));
                let first = value(cell);
                if (1..8).any(|k| value(cell + I64Vec3::new(k & 1, k >> 1 & 1, k >> 2)) != first) {
                    scanned.insert(cell.to_array());
                }
            }
            assert!(scanned.len() > 500);
            // Facets that touch a cell's face may be told to its neighbour.
            let missed = scanned.difference(&found).count();
            assert!(missed * 200 < scanned.len(), "{}: {missed} of {}", shape.kind(), scanned.len());
        }
    }

    #[test]
    fn ranges_hold_all_values_in_their_ball_and_no_value_exceeds_the_distance() {
        let parts = vec![sphere([0.1, 0.0, 0.0], 0.5), Shape::Box { least_m: [0.0; 3], most_m: [0.4, 0.6, 0.2] }];
        let cone = Shape::Cone { ends_m: [[0.0; 3], [0.3, 0.2, 0.5]], radii_m: [0.0, 0.3] };
        let placed =
            Shape::Placed { of: cone.clone().into(), scale: 1.7, turn_deg: [10.0, 20.0, 30.0], move_m: [0.1; 3] };
        let shapes = [
            Shape::Union { of: parts.clone() },
            Shape::Intersection { of: parts.clone() },
            Shape::Difference { of: parts },
            cone,
            placed,
            blend(),
        ];
        let at = |i: i32| {
            DVec3::new(0.8191725134, 0.6710436067, 0.5497004779).map(|x| (x * f64::from(i)).fract() * 2.4 - 1.2)
        };
        for shape in &shapes {
            let solid = Solid::of(shape).unwrap();
            let mut surface = Vec::new();
            polygonise(&solid, &canvas(16), &mut |facet| surface.push((facet[0] + facet[1] + facet[2]) / 3.0));
            for i in 0..60 {
                let (centre, radius) = (at(i), 0.02 + 0.01 * f64::from(i % 13));
                let [low, high] = solid.range(centre, radius);
                for j in 0..50 {
                    let p = centre + at(7 * i + j).normalize() * radius * f64::from(j) / 50.0;
                    let value = solid.value(p);
                    assert!((low - 1e-12..=high + 1e-12).contains(&value), "{} {low} {value} {high}", shape.kind());
                }
                let nearest = surface.iter().map(|p| p.distance(centre)).fold(f64::INFINITY, f64::min);
                assert!(solid.value(centre).abs() < nearest + 1e-3, "{}", shape.kind());
                // Within the bounds wherever it is as small as they say.
                let [least, most] = solid.bounds(0.1);
                let inside = centre.cmpge(least).all() && centre.cmple(most).all();
                assert!(inside || solid.value(centre) > 0.1, "{}", shape.kind());
            }
        }
    }

    #[test]
    fn a_voxel_s_coverage_is_its_share_inside() {
        let canvas = canvas(16);
        let solid = Solid::of(&sphere([0.0; 3], 0.5)).unwrap();
        let cells = (0..16i32.pow(3)).map(|i| DVec3::from([i % 16, i / 16 % 16, i / 256].map(f64::from)));
        let volume: f64 = cells.map(|cell| coverage(&solid, &canvas, cell)).sum::<f64>() * canvas.voxel_m().powi(3);
        assert!((volume / (4.0 / 3.0 * PI * 0.125) - 1.0).abs() < 0.01, "{volume}");
        assert_eq!((coverage(&solid, &canvas, DVec3::splat(7.0)), coverage(&solid, &canvas, DVec3::ZERO)), (1.0, 0.0));
    }
}
