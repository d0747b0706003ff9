//! How finely a skin is cut, so that tetrahedra say where the texture lies as well as its trilinear boxes do.
//!
//! A box maps (U, V, W) to the world and to the texture trilinearly [Neyret 1996, section 4.1]; a tetrahedron maps
//! affinely. Along the axes both agree. What differs are the mixed terms: that in U and V, of patches that are no
//! parallelograms, falls with the square of the cuts along the sides; those with W, of height vectors that differ
//! between corners, fall with the cuts along the sides times those along the height. Triangles have none in U and V. So
//! all faces share one count along their sides and one along the height: neighbours agree without asking each other.

use super::thick_skin::{Corners, Skin, SkinVertex, orientation};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Cuts along one axis at most.
const MAX_CUTS: u32 = 32;
/// Rounds of measuring and cutting further.
const ROUNDS: usize = 10;
/// Greatest factor by which a round cuts finer: flat tetrahedra of large boxes tell more than is there.
const FINER: u32 = 2;
/// Share of the tolerance that the next round aims at, because terms add up to a little more than their sum.
const AIM: f64 = 0.9;
/// Share of the box of its edges that a tetrahedron fills at least so as not to count as flat.
pub(super) const MIN_VOLUME: f64 = 1e-9;
/// Share by which one diagonal of a patch is better than the other before vertex numbers no longer decide.
const BETTER_DIAGONAL: f64 = 1e-3;

/// The parameters by which a skin becomes tetrahedra.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShellParams {
    /// Greatest distance of a point from where its trilinear box has it in the texture, in texels; half a voxel is
    /// 0.5 / (voxels along an edge of the volume).
    pub tolerance: f32,
    /// Tetrahedra at most. A skin that would need more is cut less and [`ShellReport::deviation`](super::ShellReport)
    /// tells what that leaves; the least is 3 for each triangle and 6 for each patch. 52 bytes each.
    pub most_tets: usize,
}

impl Default for ShellParams {
    /// Returns a tolerance of half a voxel of a volume of 64^3, and a budget of 54 MB.
    fn default() -> ShellParams {
        ShellParams { tolerance: 0.5 / 64.0, most_tets: 1 << 20 }
    }
}

impl ShellParams {
    /// Checks the parameters.
    ///
    /// # Errors
    /// A sentence if the tolerance is not a positive number.
    pub fn check(&self) -> Result<(), String> {
        if self.tolerance > 0.0 && self.tolerance.is_finite() {
            return Ok(());
        }
        Err(format!("a shell's tolerance is {}, and must be above 0 texels", self.tolerance))
    }
}

/// The cuts of all faces along each side and of all height vectors, and the deviation that these leave, in texels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cuts {
    pub sides: u32,
    pub layers: u32,
    pub deviation: f32,
}

/// Returns the fewest cuts that keep the tolerance, or the best that the budget allows.
pub(super) fn cuts(skin: &Skin, params: &ShellParams) -> Cuts {
    let triangles = skin.faces().iter().filter(|face| matches!(face.corners, Corners::Triangle(_))).count();
    let prisms = triangles + 2 * (skin.faces().len() - triangles);
    let mut best = Cuts { sides: 1, layers: 1, deviation: f32::INFINITY };
    let (mut sides, mut layers) = (1, 1);
    for _ in 0..ROUNDS {
        let [flat, upright] = deviation(skin, sides, layers);
        let found = Cuts { sides, layers, deviation: flat.max(upright) as f32 };
        if found.deviation < best.deviation {
            best = found;
        }
        if best.deviation <= params.tolerance {
            break;
        }
        // What the terms would be without cuts; diagonals that rise have both.
        let [n, m] = [sides, layers].map(f64::from);
        let terms = [flat * n * n, (upright - flat).max(0.0) * n * m];
        let goal = cheapest(terms, AIM * f64::from(params.tolerance), params.most_tets / (3 * prisms));
        let next = (goal.0.min(FINER * sides), goal.1.min(FINER * layers));
        if next == (sides, layers) {
            break;
        }
        (sides, layers) = next;
    }
    best
}

/// Cuts along sides and height for which `terms` (falling with the square of the first, and with both) come to
/// `tolerance` with the fewest parts; or nearest to it with at most so many.
fn cheapest(terms: [f64; 2], tolerance: f64, most: usize) -> (u32, u32) {
    let mut best = (f64::INFINITY, 0, (1, 1));
    for (sides, layers) in (1..=MAX_CUTS).flat_map(|sides| (1..=MAX_CUTS).map(move |layers| (sides, layers))) {
        let [n, m] = [sides, layers].map(f64::from);
        let parts = sides * sides * layers;
        let excess = (terms[0] / (n * n) + terms[1] / (n * m) - tolerance).max(0.0);
        let is_better = excess < best.0 || (excess == best.0 && parts < best.1);
        if is_better && (parts as usize <= most || parts == 1) {
            best = (excess, parts, (sides, layers));
        }
    }
    best.2
}

/// A face cut `sides` times along its sides: points by their places (i, j), U = i / sides and V = j / sides, and
/// triangles over them, counter-clockwise in (U, V).
pub(super) struct Lattice {
    pub points: Vec<[u32; 2]>,
    pub triangles: Vec<[u32; 3]>,
}

/// The diagonal by which a face is cut in two: none, or between two of its corners.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Diagonal {
    None,
    FromFirst,
    FromSecond,
}

/// Returns the diagonal of a patch that keeps both triangles from turning over where it is not convex, and otherwise
/// that from its least vertex number.
pub(super) fn diagonal(vertices: &[SkinVertex], corners: Corners) -> Diagonal {
    let Corners::Patch(four) = corners else { return Diagonal::None };
    let p = four.map(|i| vertices[i as usize].position.as_dvec3());
    let normal = (p[2] - p[0]).cross(p[3] - p[1]);
    let area = |a: usize, b: usize, c: usize| (p[b] - p[a]).cross(p[c] - p[a]).dot(normal);
    let (first, second) = (area(0, 1, 2).min(area(0, 2, 3)), area(0, 1, 3).min(area(1, 2, 3)));
    let difference = first - second;
    let from_first = match difference.abs() > BETTER_DIAGONAL * normal.length_squared() {
        true => difference > 0.0,
        false => four.iter().enumerate().min_by_key(|(_, vertex)| **vertex).is_some_and(|(corner, _)| corner % 2 == 0),
    };
    if from_first { Diagonal::FromFirst } else { Diagonal::FromSecond }
}

impl Lattice {
    /// Prepares a triangle ([`Diagonal::None`]) or a patch.
    pub(super) fn new(diagonal: Diagonal, sides: u32) -> Lattice {
        let n = sides;
        let is_triangle = diagonal == Diagonal::None;
        let row_ends_at = |j: u32| if is_triangle { n - j } else { n };
        let points: Vec<[u32; 2]> = (0..=n).flat_map(|j| (0..=row_ends_at(j)).map(move |i| [i, j])).collect();
        let first_of_row: Vec<u32> = (0..=n)
            .scan(0, |next, j| {
                let first = *next;
                *next += row_ends_at(j) + 1;
                Some(first)
            })
            .collect();
        let at = |i: u32, j: u32| first_of_row[j as usize] + i;
        let mut triangles = Vec::new();
        for j in 0..n {
            for i in 0..row_ends_at(j) {
                let [a, b, d] = [at(i, j), at(i + 1, j), at(i, j + 1)];
                match diagonal {
                    Diagonal::FromFirst => triangles.extend([[a, b, d + 1], [a, d + 1, d]]),
                    Diagonal::FromSecond => triangles.extend([[a, b, d], [b, d + 1, d]]),
                    // The other half of a small parallelogram, where that is not cut off by the long side.
                    Diagonal::None if i + 1 < row_ends_at(j) => triangles.extend([[a, b, d], [b, d + 1, d]]),
                    Diagonal::None => triangles.push([a, b, d]),
                }
            }
        }
        Lattice { points, triangles }
    }
}

/// Weights of a face's corners at a lattice point; they sum to `sides` on a triangle and to its square on a patch.
pub(super) fn weights(corners: Corners, [i, j]: [u32; 2], sides: u32) -> [u32; 4] {
    let n = sides;
    match corners {
        Corners::Triangle(_) => [n - i - j, i, j, 0],
        Corners::Patch(_) => [(n - i) * (n - j), i * (n - j), i * j, (n - i) * j],
    }
}

/// The tetrahedra of a prism over the triangle 0, 1, 2 with the top 3, 4, 5; the vertical edge comes first, which keeps
/// the determinants of thin skins exact. The diagonal of a side runs from the lower of its vertices at the bottom to
/// the higher at the top, so that neighbours agree if triangles are given in ascending order of their vertices
/// [Dompierre 1999; so Porumbescu 2005]. Positive where the triangle is counter-clockwise seen from the top.
pub(super) const PRISM: [[usize; 4]; 3] = [[2, 5, 0, 1], [1, 4, 5, 0], [0, 3, 4, 5]];

/// The trilinear maps of a face's box.
struct Trilinear {
    /// For each corner, at the bottom and at the top: position and texture coordinates.
    corners: [[(DVec3, DVec3); 2]; 4],
    is_triangle: bool,
}

impl Trilinear {
    fn new(vertices: &[SkinVertex], corners: Corners) -> Trilinear {
        let indices = corners.indices();
        let of_corner = |corner: usize| {
            let vertex = vertices[indices[corner.min(indices.len() - 1)] as usize];
            let (position, texture) = (vertex.position.as_dvec3(), vertex.texture.as_dvec3());
            [(position, texture), (position + vertex.height.as_dvec3(), texture + vertex.rise.as_dvec3())]
        };
        Trilinear { corners: [0, 1, 2, 3].map(of_corner), is_triangle: indices.len() == 3 }
    }

    /// Returns the position and texture coordinates at (U, V, W).
    fn at(&self, skin: DVec3) -> (DVec3, DVec3) {
        let DVec3 { x: u, y: v, z: w } = skin;
        let weights = match self.is_triangle {
            true => [1.0 - u - v, u, v, 0.0],
            false => [(1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v],
        };
        let mut sum = (DVec3::ZERO, DVec3::ZERO);
        for (weight, [bottom, top]) in weights.iter().zip(&self.corners) {
            sum.0 += *weight * bottom.0.lerp(top.0, w);
            sum.1 += *weight * bottom.1.lerp(top.1, w);
        }
        sum
    }

    /// Returns how far the affine map of the tetrahedron over four points (U, V, W) is off in the middles of its edges,
    /// in texels: of edges with one W, and of the others. Nothing for a tetrahedron that is flat or inverted.
    fn deviation(&self, points: [DVec3; 4], orientation: f64) -> [f64; 2] {
        let [(p0, t0), others @ ..] = points.map(|point| self.at(point));
        let edges = DMat3::from_cols_slice(&others.map(|(p, _)| (p - p0).to_array()).concat());
        let box_of_edges: f64 = others.iter().map(|(p, _)| p.distance(p0)).product();
        if edges.determinant() * orientation <= MIN_VOLUME * box_of_edges {
            return [0.0; 2];
        }
        let textures = DMat3::from_cols_slice(&others.map(|(_, t)| (t - t0).to_array()).concat());
        let texture_from_world = textures * edges.inverse();
        let mut worst = [0f64; 2];
        for (i, j) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            let (position, texture) = self.at((points[i] + points[j]) * 0.5);
            let affine = t0 + texture_from_world * (position - p0);
            let kind = usize::from(points[i].z != points[j].z);
            worst[kind] = worst[kind].max((texture - affine).abs().max_element());
        }
        worst
    }
}

/// Returns the largest deviation over a skin that is cut so often: of edges with one W, and of the others.
fn deviation(skin: &Skin, sides: u32, layers: u32) -> [f64; 2] {
    let vertices = skin.vertices();
    let lattices =
        [Diagonal::None, Diagonal::FromFirst, Diagonal::FromSecond].map(|diagonal| Lattice::new(diagonal, sides));
    let of_face = |corners: Corners| {
        let lattice = &lattices[diagonal(vertices, corners) as usize];
        let trilinear = Trilinear::new(vertices, corners);
        let orientation = f64::from(orientation(vertices, corners));
        let mut worst = [0f64; 2];
        for triangle in &lattice.triangles {
            for layer in 0..layers {
                let corner = |index: usize| {
                    let [i, j] = lattice.points[triangle[index % 3] as usize].map(f64::from);
                    let w = (layer + u32::from(index >= 3)) as f64 / f64::from(layers);
                    DVec3::new(i / f64::from(sides), j / f64::from(sides), w)
                };
                for tet in PRISM {
                    let found = trilinear.deviation(tet.map(corner), orientation);
                    worst = [worst[0].max(found[0]), worst[1].max(found[1])];
                }
            }
        }
        worst
    };
    let larger = |a: [f64; 2], b: [f64; 2]| [a[0].max(b[0]), a[1].max(b[1])];
    skin.faces().par_iter().map(|face| of_face(face.corners)).reduce(|| [0.0; 2], larger)
}

#[cfg(test)]
mod tests {
    use super::super::thick_skin::SkinFace;
    use super::*;
    use glam::Vec3;

    /// A patch with this height vector, and this lift, at one corner.
    fn patch(height: Vec3, lift: f32) -> Skin {
        let vertex = |x: u32, y: u32| {
            let lifted = x * y == 1;
            let position = Vec3::new(x as f32, y as f32, if lifted { lift } else { 0.0 });
            SkinVertex::new(position, if lifted { height } else { Vec3::Z }, [x as f32, y as f32])
        };
        Skin::from_grid(1, 1, vertex, |_, _| 0).unwrap()
    }

    #[test]
    fn a_straight_skin_is_not_cut_and_others_until_they_keep_the_tolerance() {
        let params = ShellParams { tolerance: 0.004, ..ShellParams::default() };
        let straight = cuts(&patch(Vec3::Z, 0.0), &params);
        assert_eq!((straight.sides, straight.layers), (1, 1));
        assert!(straight.deviation < 1e-12);
        for (height, lift) in [(Vec3::new(0.3, 0.0, 1.0), 0.0), (Vec3::Z * 1.5, 0.0), (Vec3::Z, 0.4)] {
            let skin = patch(height, lift);
            let found = cuts(&skin, &params);
            assert!(found.deviation <= params.tolerance, "{found:?}");
            // Planted: with fewer cuts the tolerance is not kept.
            let fewer = deviation(&skin, found.sides.div_ceil(2), found.layers.div_ceil(2));
            assert!(fewer[0].max(fewer[1]) > f64::from(params.tolerance), "{found:?}");
        }
        // Triangles are cut along their height alone.
        let four = patch(Vec3::new(0.3, 0.0, 1.0), 0.4);
        let halves = [[0, 1, 2], [1, 3, 2]].map(|i| SkinFace { corners: Corners::Triangle(i), pattern: 0 });
        let found = cuts(&Skin::new(four.vertices().to_vec(), halves.to_vec()).unwrap(), &params);
        assert!(found.sides == 1 && found.layers > 3 && found.deviation <= params.tolerance, "{found:?}");
    }

    #[test]
    fn the_budget_bounds_what_a_bad_face_can_ask_for() {
        let skin = patch(Vec3::new(0.9, 0.0, 0.1), 3.0);
        for most_tets in [0, 6, 100, 5000] {
            let found = cuts(&skin, &ShellParams { tolerance: 1e-4, most_tets });
            let tets = 6 * found.sides * found.sides * found.layers;
            assert!(tets as usize <= most_tets.max(6), "{found:?}");
            assert!(found.deviation > 1e-4);
        }
        assert!(ShellParams { tolerance: 0.0, ..ShellParams::default() }.check().is_err());
        assert!(ShellParams { tolerance: f32::NAN, ..ShellParams::default() }.check().is_err());
    }

    #[test]
    fn lattices_cover_their_face_once() {
        for sides in [1, 2, 5] {
            for (diagonal, doubled_area) in [(Diagonal::None, 1), (Diagonal::FromFirst, 2), (Diagonal::FromSecond, 2)] {
                let lattice = Lattice::new(diagonal, sides);
                let area = |triangle: &[u32; 3]| {
                    let [a, b, c] = triangle.map(|i| lattice.points[i as usize].map(|x| x as i32));
                    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
                };
                assert!(lattice.triangles.iter().all(|triangle| area(triangle) == 1));
                assert_eq!(lattice.triangles.len() as u32, doubled_area * sides * sides);
            }
        }
    }

    #[test]
    fn a_patch_that_is_not_convex_is_cut_through_its_notch() {
        let arrow = |tip: [f32; 2]| {
            let places = [[0.0, 0.0], [1.0, 0.0], tip, [0.0, 1.0]];
            places.map(|[x, y]| SkinVertex::new(Vec3::new(x, y, 0.0), Vec3::Z, [x, y]))
        };
        let four = Corners::Patch([0, 1, 2, 3]);
        assert_eq!(diagonal(&arrow([0.2, 0.2]), four), Diagonal::FromFirst);
        let turned = |tip: [f32; 2]| {
            let [a, b, c, d] = arrow(tip);
            [d, a, b, c]
        };
        assert_eq!(diagonal(&turned([0.2, 0.2]), four), Diagonal::FromSecond);
        // Where both would do, the least vertex number decides.
        assert_eq!(diagonal(&arrow([1.0, 1.0]), four), Diagonal::FromFirst);
        assert_eq!(diagonal(&arrow([1.0, 1.0]), Corners::Patch([3, 0, 1, 2])), Diagonal::FromSecond);
    }
}
