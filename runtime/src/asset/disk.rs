//! The geometry of a direction set on the unit disk: Delaunay triangles, hull edges, and a compact uniform grid [Lagae
//! 2008] over both. Everything is in double precision.

use spade::{DelaunayTriangulation, Point2, Triangulation};

/// Bit that marks a grid item as an edge.
pub const ITEM_EDGE: u32 = 0x8000_0000;
/// Least area (doubled) of a triangle on the disk.
pub(super) const MIN_AREA: f64 = 1e-9;

/// Ids of the corners of each triangle, and of the ends of each hull edge.
type Triangles = (Vec<[usize; 3]>, Vec<(usize, usize)>);

/// Triangulates points of the disk. The result does not depend on the order in which the triangulation finds its parts.
///
/// Errors, as clauses: points that cannot be triangulated, or that coincide.
pub(super) fn triangulate(disk: &[[f64; 2]]) -> Result<Triangles, String> {
    let points: Vec<Point2<f64>> = disk.iter().map(|p| Point2::new(tiny_to_zero(p[0]), tiny_to_zero(p[1]))).collect();
    let delaunay = DelaunayTriangulation::<Point2<f64>>::bulk_load_stable(points)
        .map_err(|error| format!("the direction set cannot be triangulated ({error:?})"))?;
    if delaunay.num_vertices() != disk.len() {
        return Err("two directions of a set coincide".to_string());
    }
    let mut triangles: Vec<[usize; 3]> = delaunay
        .inner_faces()
        .map(|face| {
            let mut ids = face.vertices().map(|vertex| vertex.index());
            let least = (0..3).min_by_key(|&i| ids[i]).unwrap_or(0);
            ids.rotate_left(least);
            ids
        })
        // A sliver between nearly collinear directions has no usable inverse; its edges carry on.
        .filter(|ids| signed_area(disk, ids).abs() > MIN_AREA)
        .collect();
    triangles.sort_unstable();
    Ok((triangles, hull_edges(disk, &delaunay)))
}

/// Returns the squared distance of a point from the segment between `a` and `b`.
pub(super) fn segment_distance2(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let length2 = dx * dx + dy * dy;
    let t = if length2 > 0.0 { (((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / length2).clamp(0.0, 1.0) } else { 0.0 };
    let (ex, ey) = (p[0] - a[0] - t * dx, p[1] - a[1] - t * dy);
    ex * ex + ey * ey
}

/// Returns 0 for a coordinate that spade refuses. spade refuses coordinates below 1e-60, which cos(90 degrees) is.
fn tiny_to_zero(x: f64) -> f64 {
    if x.abs() < 1e-12 { 0.0 } else { x }
}

/// Returns twice the area of the triangle of three points of the disk, negative where they go clockwise.
pub(super) fn signed_area(disk: &[[f64; 2]], ids: &[usize; 3]) -> f64 {
    let [a, b, c] = ids.map(|id| disk[id]);
    (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
}

/// Returns the edges of the convex hull; for a collinear set the segments between neighbours; for one direction the
/// edge from it to itself.
fn hull_edges(disk: &[[f64; 2]], delaunay: &DelaunayTriangulation<Point2<f64>>) -> Vec<(usize, usize)> {
    let mut edges: Vec<(usize, usize)> = delaunay
        .convex_hull()
        .map(|edge| {
            let (a, b) = (edge.from().index(), edge.to().index());
            (a.min(b), a.max(b))
        })
        .collect();
    if delaunay.all_vertices_on_line() && disk.len() > 1 {
        let (low, high) = (disk[0], disk[disk.len() - 1]);
        let axis = if (low[0] - high[0]).abs() > (low[1] - high[1]).abs() { 0 } else { 1 };
        let mut order: Vec<usize> = (0..disk.len()).collect();
        order.sort_by(|&a, &b| disk[a][axis].total_cmp(&disk[b][axis]));
        edges = order.windows(2).map(|pair| (pair[0], pair[1])).collect();
    }
    if edges.is_empty() {
        edges.push((0, 0));
    }
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// Returns the number of cells along a side of the grid of a set with `triangles` triangles.
pub(crate) fn cells_a_side(triangles: usize) -> usize {
    ((2.0 * triangles as f64).sqrt().ceil() as usize).clamp(4, 64)
}

/// Builds the grid over the square around the disk, `side` x `side` cells: offsets of the cells' items (`side^2 + 1`),
/// and the items: every triangle that may cover a point of the cell and, for cells that reach outside the hull, every
/// hull edge that may be nearest to one.
pub(super) fn build_grid(
    side: usize,
    disk: &[[f64; 2]],
    triangles: &[[usize; 3]],
    edges: &[(usize, usize)],
) -> (Vec<u32>, Vec<u32>) {
    let size = 2.0 / side as f64;
    let margin = 1e-6;
    let mut offsets = vec![0u32];
    let mut items = Vec::new();
    for cell in 0..side * side {
        let (cx, cy) = (cell % side, cell / side);
        let low = [-1.0 + cx as f64 * size - margin, -1.0 + cy as f64 * size - margin];
        let high = [low[0] + size + 2.0 * margin, low[1] + size + 2.0 * margin];
        let corners = [low, [high[0], low[1]], high, [low[0], high[1]]];
        for (i, ids) in triangles.iter().enumerate() {
            if triangle_touches_box(ids.map(|id| disk[id]), low, high) {
                items.push(i as u32);
            }
        }
        let covered = |p: &[f64; 2]| triangles.iter().any(|ids| contains(ids.map(|id| disk[id]), *p));
        if !corners.iter().all(covered) {
            let centre = [(low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0];
            let half_diagonal = ((high[0] - low[0]).powi(2) + (high[1] - low[1]).powi(2)).sqrt() / 2.0;
            let distance = |&(a, b): &(usize, usize)| segment_distance2(centre, disk[a], disk[b]).sqrt();
            let nearest = edges.iter().map(distance).fold(f64::INFINITY, f64::min);
            for (i, edge) in edges.iter().enumerate() {
                if distance(edge) <= nearest + 2.0 * half_diagonal + margin {
                    items.push(i as u32 | ITEM_EDGE);
                }
            }
        }
        offsets.push(items.len() as u32);
    }
    (offsets, items)
}

/// Returns whether a triangle, its border included, contains a point.
pub(super) fn contains(triangle: [[f64; 2]; 3], p: [f64; 2]) -> bool {
    let side = |a: [f64; 2], b: [f64; 2]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
    let [a, b, c] = triangle;
    let s = [side(a, b), side(b, c), side(c, a)];
    s.iter().all(|x| *x >= 0.0) || s.iter().all(|x| *x <= 0.0)
}

/// Returns whether a triangle touches a box, by the separating-axis test in two dimensions: the box's axes and the
/// triangle's three edge normals.
fn triangle_touches_box(t: [[f64; 2]; 3], low: [f64; 2], high: [f64; 2]) -> bool {
    for axis in 0..2 {
        let (least, most) =
            t.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, m), p| (l.min(p[axis]), m.max(p[axis])));
        if most < low[axis] || least > high[axis] {
            return false;
        }
    }
    let corners = [low, [high[0], low[1]], high, [low[0], high[1]]];
    for i in 0..3 {
        let (a, b, c) = (t[i], t[(i + 1) % 3], t[(i + 2) % 3]);
        let normal = [b[1] - a[1], a[0] - b[0]];
        let along = |p: [f64; 2]| (p[0] - a[0]) * normal[0] + (p[1] - a[1]) * normal[1];
        let inner = along(c).signum();
        if corners.iter().all(|p| along(*p) * inner < 0.0) {
            return false;
        }
    }
    true
}
