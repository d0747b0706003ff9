//! From a solid to the facets of its surface: a descent that splits only what the surface may pass [Neyret 1996,
//! section 3.1], to a grid that is up to four times as fine as the voxels, where tetrahedra are cut by the plane on which
//! the solid's function is zero [Doi & Koide 1991].
//!
//! Facets share their edges, so no ray passes between them. Edges and tips of the solid are blunted by a cell of that
//! grid.

use glam::{DVec3, I64Vec3};

use super::canvas::Canvas;
use super::solid::Solid;

/// Most cells of the finer grid along a voxel.
const MOST_CELLS: u32 = 4;

/// Cells along the canvas that are fine enough: a body as large as it has two million facets then.
const ENOUGH_CELLS: u32 = 512;

/// Samples along a voxel of which a part is inside.
const SAMPLES: u32 = 4;

/// The six tetrahedra of a cube around its diagonal from corner 0 to corner 7; bit k of a corner's number is its
/// coordinate along axis k. Neighbouring cubes cut their common face along the same diagonal.
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

/// Calls `each` for every facet of a solid's surface that may lie on the canvas or be a copy of what does, in metres,
/// counterclockwise seen from outside. Gives the volume inside, in cubic metres, of what has been looked at.
///
/// Cost: some 100 values of the solid's function for each voxel that the surface passes, and `log` of the size.
pub fn polygonise(solid: &Solid, canvas: &Canvas, each: &mut impl FnMut([DVec3; 3])) -> f64 {
    let fine = f64::from((ENOUGH_CELLS / canvas.resolution()).clamp(1, MOST_CELLS));
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

/// Share of a voxel's volume that lies inside, its least corner at `from` in voxels: 1 and 0 are exact.
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
    /// Where blocks end.
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

/// Cuts a tetrahedron where the linear function through its corners is zero; gives the share of its volume that is
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
