//! A direction set on the disk: Delaunay triangles, hull edges and a compact uniform grid [Lagae 2008], which finds the
//! three neighbours of any direction. Twin: `asset/sphere.wgsl`.
//!
//! Directions are projected orthographically onto the unit disk, as in [Silva 2012]. A direction outside the hull gets
//! the nearest point of the hull, so that every direction of the hemisphere has an answer, and the answer is
//! continuous.

use crate::asset::disk::{ITEM_EDGE, MIN_AREA, build_grid, cells_a_side, signed_area, triangulate};
use crate::asset::limits::MAX_DIRECTIONS;
use crate::error::FormatError;
use crate::rule::{self, Rule};

/// Number of words before the arrays: numbers of directions, triangles and edges, side of the grid, number of its
/// items, three zeros.
pub const SPHERE_HEADER_WORDS: usize = 8;
/// Number of words of a direction: x, y, z.
pub const DIRECTION_WORDS: usize = 3;
/// Number of words of a triangle: corner 0, the inverse 2 x 2 matrix, three ids, three zeros.
pub const TRIANGLE_WORDS: usize = 12;
/// Number of words of a hull edge: start, extent, 1 / length^2, two ids, zero.
pub const EDGE_WORDS: usize = 8;
/// Least barycentric weight with which a direction counts as inside a triangle: f32 rounds on an edge.
pub const INSIDE_TOLERANCE: f32 = -1e-5;
/// Largest side of the grid in cells.
const MAX_GRID: u32 = 256;
/// Largest entry of a triangle's inverse matrix: bounded, so that no barycentric weight overflows. The least area that
/// is kept is 1e-9.
const MAX_INVERSE: f32 = 1e10;
/// Largest 1 / length^2 of an edge: two directions closer than this coincide.
const MAX_INVERSE_LENGTH2: f32 = 1e30;

/// A direction set, as the words of its resident form.
#[derive(Debug, Clone, PartialEq)]
pub struct Sphere {
    words: Vec<u32>,
}

/// The three neighbours of a direction, and their weights, which are not negative and sum up to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbours {
    /// Ids of the neighbours in the direction set; an id may repeat where its weight is 0.
    pub ids: [u32; 3],
    /// Barycentric weights.
    pub weights: [f32; 3],
    /// Attenuation outside the hull, `min(1, cos / cos at the hull)`: 1 inside the hull, falling to 0 at the horizon
    /// outside.
    pub beyond: f32,
}

impl Sphere {
    /// Triangulates `directions` (unit, z > 0, distinct) and builds the grid.
    ///
    /// Errors: no direction, more than 4096, one that is not unit or below the horizon, or two that
    /// coincide. Cost: a millisecond for the 81 directions of a Bonn capture.
    pub fn new(directions: &[[f32; 3]]) -> Result<Sphere, FormatError> {
        Sphere::of_rounds(directions, 1)
    }

    /// Triangulates directions like [`Sphere::new`] that are the same ones `rounds` times over, one round after the other:
    /// triangles and edges name those of the first round alone.
    pub fn of_rounds(directions: &[[f32; 3]], rounds: usize) -> Result<Sphere, FormatError> {
        let refuse = |reason: String| FormatError::Pack { reason };
        let n = directions.len();
        if n == 0 || n > MAX_DIRECTIONS {
            return Err(refuse(format!("a direction set needs 1 to {MAX_DIRECTIONS} directions, it has {n}")));
        }
        for (i, d) in directions.iter().enumerate() {
            let length2 = d.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
            if !(0.999..=1.001).contains(&length2) || d[2] <= 0.0 {
                return Err(refuse(format!("direction {i} ({d:?}) is not a unit vector above the horizon")));
            }
        }
        let count = n / rounds.max(1);
        if count == 0 || n != count * rounds || (count..n).any(|i| directions[i] != directions[i % count]) {
            return Err(refuse(format!("its directions are not {rounds} times the same")));
        }
        let disk: Vec<[f64; 2]> = directions.iter().map(|d| [d[0].into(), d[1].into()]).collect();
        let (triangles, edges) = triangulate(&disk[..count]).map_err(refuse)?;
        Ok(Sphere::from_parts(directions, &triangles, &edges))
    }

    /// Returns the number of directions before they come again: all of a set that does not repeat.
    pub fn distinct(&self) -> usize {
        round_of(&(0..self.len()).map(|id| self.direction(id as u32)).collect::<Vec<_>>())
    }

    /// Returns whether the set is `rounds` times the same directions, of which triangles and edges name the first round.
    pub(crate) fn repeats(&self, rounds: usize) -> bool {
        let count = self.len() / rounds;
        let below = |id: &u32| (*id as usize) < count;
        let triangles = (0..self.words[1] as usize).map(|i| self.triangles_at() + i * TRIANGLE_WORDS + 6);
        let edges = (0..self.words[2] as usize).map(|i| self.edges_at() + i * EDGE_WORDS + 5);
        self.len() == count * rounds
            && (count..self.len()).all(|i| self.direction(i as u32) == self.direction((i % count) as u32))
            && triangles.flat_map(|at| &self.words[at..at + 3]).all(below)
            && edges.flat_map(|at| &self.words[at..at + 2]).all(below)
    }

    /// Lays out the words of a set whose triangles and edges are known. It uses sums, products, quotients and square
    /// roots in double precision only, so that every machine makes the same words.
    fn from_parts(directions: &[[f32; 3]], triangles: &[[usize; 3]], edges: &[(usize, usize)]) -> Sphere {
        let disk: Vec<[f64; 2]> = directions.iter().map(|d| [d[0].into(), d[1].into()]).collect();
        let n = directions.len();
        let side = cells_a_side(triangles.len());
        let (offsets, items) = build_grid(side, &disk, triangles, edges);

        let mut words =
            vec![n as u32, triangles.len() as u32, edges.len() as u32, side as u32, items.len() as u32, 0, 0, 0];
        words.extend(directions.iter().flatten().map(|x| x.to_bits()));
        for ids in triangles {
            let [p0, p1, p2] = ids.map(|id| disk[id]);
            let (ax, ay, bx, by) = (p1[0] - p0[0], p1[1] - p0[1], p2[0] - p0[0], p2[1] - p0[1]);
            let inverse = 1.0 / (ax * by - bx * ay);
            for value in [p0[0], p0[1], by * inverse, -bx * inverse, -ay * inverse, ax * inverse] {
                words.push((value as f32).to_bits());
            }
            words.extend(ids.map(|id| id as u32));
            words.extend([0, 0, 0]);
        }
        for &(a, b) in edges {
            let (pa, pb) = (disk[a], disk[b]);
            let (dx, dy) = (pb[0] - pa[0], pb[1] - pa[1]);
            let length2 = dx * dx + dy * dy;
            let inverse = if length2 > 0.0 { 1.0 / length2 } else { 0.0 };
            for value in [pa[0], pa[1], dx, dy, inverse] {
                words.push((value as f32).to_bits());
            }
            words.extend([a as u32, b as u32, 0]);
        }
        words.extend(offsets);
        words.extend(items);
        Sphere { words }
    }

    /// Returns the words of the file form: counts, directions, triangles and edges. The rest follows from these.
    pub fn to_file_words(&self) -> Vec<u32> {
        let [n, triangles, edges] = [0, 1, 2].map(|i| self.words[i] as usize);
        let mut words = vec![n as u32, triangles as u32, edges as u32];
        words.extend(&self.words[SPHERE_HEADER_WORDS..self.triangles_at()]);
        let triangle_ids =
            (0..triangles).flat_map(|i| &self.words[self.triangles_at() + i * TRIANGLE_WORDS + 6..][..3]);
        let edge_ids = (0..edges).flat_map(|i| &self.words[self.edges_at() + i * EDGE_WORDS + 5..][..2]);
        let ids: Vec<u32> = triangle_ids.chain(edge_ids).copied().collect();
        words.extend(ids.chunks(2).map(|pair| pair[0] | pair.get(1).copied().unwrap_or(0) << 16));
        words
    }

    /// Checks and reads the words that [`Sphere::to_file_words`] gives. Cost: that of building the grid, about a
    /// millisecond for 81 directions.
    pub fn from_file_words(words: &[u32]) -> Result<Sphere, Rule> {
        let [n, t, e] = *words.first_chunk::<3>().ok_or(rule::SET_SHORT)?;
        let [n, t, e] = [n, t, e].map(|count| count as usize);
        if n == 0 || n > MAX_DIRECTIONS || t > 2 * n || e == 0 || e > n {
            return Err(rule::COUNT);
        }
        let id_words = (3 * t + 2 * e).div_ceil(2);
        if words.len() != 3 + 3 * n + id_words {
            return Err(rule::SET_LENGTH);
        }
        let directions: Vec<[f32; 3]> =
            words[3..3 + 3 * n].chunks_exact(3).map(|d| [0, 1, 2].map(|i| f32::from_bits(d[i]))).collect();
        for d in &directions {
            let length2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
            if !(0.998..=1.002).contains(&length2) || d[2].is_nan() || d[2] <= 0.0 {
                return Err(rule::DIRECTION);
            }
        }
        let mut ids: Vec<usize> =
            words[3 + 3 * n..].iter().flat_map(|word| [(word & 0xffff) as usize, (word >> 16) as usize]).collect();
        if ids.drain(3 * t + 2 * e..).any(|padding| padding != 0) {
            return Err(rule::PADDING);
        }
        if ids.iter().any(|id| *id >= n) {
            return Err(rule::DIRECTION_NAMED);
        }
        let triangles: Vec<[usize; 3]> = ids[..3 * t].chunks_exact(3).map(|id| [id[0], id[1], id[2]]).collect();
        let edges: Vec<(usize, usize)> = ids[3 * t..].chunks_exact(2).map(|id| (id[0], id[1])).collect();
        let disk: Vec<[f64; 2]> = directions.iter().map(|d| [d[0].into(), d[1].into()]).collect();
        if triangles.iter().any(|ids| signed_area(&disk, ids).abs() <= MIN_AREA) {
            return Err(rule::NO_AREA);
        }
        // Every rule that keeps `locate` in bounds is checked on the whole.
        Sphere::from_words(Sphere::from_parts(&directions, &triangles, &edges).words)
    }

    /// Returns the number of words of a set whose resident words begin with `words`; `None` where `words` has no whole
    /// header, or the number overflows.
    pub(crate) fn words_told_by(words: &[u32]) -> Option<usize> {
        let [n, triangles, edges, side, items] = [0, 1, 2, 3, 4].map(|i| words.get(i).map(|word| *word as usize));
        let [n, triangles, edges, side, items] = [n?, triangles?, edges?, side?, items?];
        let cells = side.checked_mul(side)?.checked_add(1)?;
        let parts =
            [n.checked_mul(DIRECTION_WORDS)?, triangles.checked_mul(TRIANGLE_WORDS)?, edges.checked_mul(EDGE_WORDS)?];
        parts.into_iter().try_fold(SPHERE_HEADER_WORDS.checked_add(cells)?, usize::checked_add)?.checked_add(items)
    }

    /// Checks resident words against every rule that keeps [`Sphere::locate`] in bounds.
    pub(crate) fn from_words(words: Vec<u32>) -> Result<Sphere, Rule> {
        if words.len() < SPHERE_HEADER_WORDS {
            return Err(rule::SET_SHORT);
        }
        let [n, triangles, edges, side, items] = [0, 1, 2, 3, 4].map(|i| words[i] as usize);
        if n == 0 || n > MAX_DIRECTIONS || triangles > 2 * MAX_DIRECTIONS || edges == 0 || edges > MAX_DIRECTIONS {
            return Err(rule::COUNT);
        }
        if side == 0 || side > MAX_GRID as usize || words[5] | words[6] | words[7] != 0 {
            return Err(rule::GRID_SIDE);
        }
        let sphere = Sphere { words };
        let expected = sphere.items_at().checked_add(items).ok_or(rule::COUNT)?;
        if sphere.words.len() != expected {
            return Err(rule::SET_LENGTH);
        }
        let words = &sphere.words;
        // False for NaN.
        let within = |at: usize, count: usize, most: f32| (at..at + count).all(|i| f(words, i).abs() <= most);
        for i in 0..n {
            let d = sphere.direction(i as u32);
            let length2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
            if !(0.998..=1.002).contains(&length2) || d[2] <= 0.0 {
                return Err(rule::DIRECTION);
            }
        }
        for i in 0..triangles {
            let at = sphere.triangles_at() + i * TRIANGLE_WORDS;
            let fine = within(at, 2, 1.01) && within(at + 2, 4, MAX_INVERSE);
            if !fine || words[at + 6..at + 9].iter().any(|id| *id as usize >= n) {
                return Err(rule::TRIANGLE);
            }
        }
        for i in 0..edges {
            let at = sphere.edges_at() + i * EDGE_WORDS;
            let fine = within(at, 2, 1.01) && within(at + 2, 2, 2.02) && within(at + 4, 1, MAX_INVERSE_LENGTH2);
            if !fine || words[at + 5..at + 7].iter().any(|id| *id as usize >= n) {
                return Err(rule::EDGE);
            }
        }
        let offsets = &words[sphere.cells_at()..sphere.items_at()];
        let rising = offsets.windows(2).all(|pair| pair[0] < pair[1]);
        if offsets[0] != 0 || !rising || offsets[side * side] as usize != items {
            return Err(rule::GRID_CELL);
        }
        let item_ok = |item: &u32| {
            let index = (item & !ITEM_EDGE) as usize;
            index < if item & ITEM_EDGE != 0 { edges } else { triangles }
        };
        if !words[sphere.items_at()..].iter().all(item_ok) {
            return Err(rule::GRID_ITEM);
        }
        Ok(sphere)
    }

    /// Returns the words of the resident form.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// Returns the number of directions.
    pub fn len(&self) -> usize {
        self.words[0] as usize
    }

    /// Returns false: a set has at least one direction.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns direction `id`, a unit vector.
    pub fn direction(&self, id: u32) -> [f32; 3] {
        direction(&self.words, 0, id)
    }

    /// Finds the neighbours of a unit direction with z >= 0.
    pub fn locate(&self, direction: [f32; 3]) -> Neighbours {
        locate(&self.words, 0, direction)
    }

    /// Returns the direction within the hull that is nearest to `unit`, whose neighbours are `place`: `unit` itself
    /// within the hull, else a point of the hull's edge.
    pub fn within_hull(&self, unit: [f32; 3], place: &Neighbours) -> [f32; 3] {
        within_hull(&self.words, 0, unit, place)
    }

    /// Returns the neighbours of each direction in the triangulation and along the hull, ascending.
    pub fn neighbours(&self) -> Vec<Vec<usize>> {
        let mut near = vec![std::collections::BTreeSet::new(); self.len()];
        let mut join = |a: u32, b: u32| {
            if a != b {
                near[a as usize].insert(b as usize);
                near[b as usize].insert(a as usize);
            }
        };
        for i in 0..self.words[1] as usize {
            let at = self.triangles_at() + i * TRIANGLE_WORDS + 6;
            let ids = &self.words[at..at + 3];
            join(ids[0], ids[1]);
            join(ids[1], ids[2]);
            join(ids[2], ids[0]);
        }
        for i in 0..self.words[2] as usize {
            let at = self.edges_at() + i * EDGE_WORDS + 5;
            join(self.words[at], self.words[at + 1]);
        }
        near.into_iter().map(|ids| ids.into_iter().collect()).collect()
    }

    /// Returns the smallest cosine to the normal in the set.
    pub fn least_cosine(&self) -> f32 {
        (0..self.len() as u32).map(|i| self.direction(i)[2]).fold(1.0, f32::min)
    }

    /// Returns the set without its grid, for measuring what the grid saves: every search goes through all triangles and
    /// edges.
    pub fn without_grid(&self) -> Sphere {
        let [triangles, edges] = [self.words[1], self.words[2]];
        let mut words = self.words[..self.cells_at()].to_vec();
        (words[3], words[4]) = (1, triangles + edges);
        words.extend([0, triangles + edges]);
        words.extend((0..triangles).chain((0..edges).map(|edge| edge | ITEM_EDGE)));
        Sphere { words }
    }

    /// Returns the number of triangles and edges that a search for `direction` goes through.
    pub fn tests_of(&self, direction: [f32; 3]) -> u32 {
        let cell = cell_at(self.words[3], direction);
        self.words[self.cells_at() + cell + 1] - self.words[self.cells_at() + cell]
    }

    fn triangles_at(&self) -> usize {
        SPHERE_HEADER_WORDS + self.len() * DIRECTION_WORDS
    }
    fn edges_at(&self) -> usize {
        self.triangles_at() + self.words[1] as usize * TRIANGLE_WORDS
    }
    fn cells_at(&self) -> usize {
        self.edges_at() + self.words[2] as usize * EDGE_WORDS
    }
    fn items_at(&self) -> usize {
        let side = self.words[3] as usize;
        self.cells_at() + side * side + 1
    }
}

fn f(words: &[u32], index: usize) -> f32 {
    f32::from_bits(words[index])
}

/// Returns the number of the grid cell in which a direction lies; the grid has `side` x `side` cells.
fn cell_at(side: u32, d: [f32; 3]) -> usize {
    let along = |x: f32| ((x + 1.0) * 0.5 * side as f32).clamp(0.0, side as f32 - 1.0) as u32;
    (along(d[1]) * side + along(d[0])) as usize
}

/// Returns direction `id` of the set whose words start at `at`.
pub(crate) fn direction(words: &[u32], at: usize, id: u32) -> [f32; 3] {
    let base = at + SPHERE_HEADER_WORDS + id as usize * DIRECTION_WORDS;
    [f(words, base), f(words, base + 1), f(words, base + 2)]
}

/// Finds the neighbours of unit direction `d` (z >= 0) in the set whose words start at `at`.
///
/// Cost: the triangles of one grid cell (three to six for the set of a Bonn capture), and outside the hull the hull's
/// edges.
pub(crate) fn locate(words: &[u32], at: usize, d: [f32; 3]) -> Neighbours {
    let side = words[at + 3];
    let triangles_at = at + SPHERE_HEADER_WORDS + words[at] as usize * DIRECTION_WORDS;
    let edges_at = triangles_at + words[at + 1] as usize * TRIANGLE_WORDS;
    let cells_at = edges_at + words[at + 2] as usize * EDGE_WORDS;
    let items_at = cells_at + (side * side) as usize + 1;
    let cell = cell_at(side, d);

    let mut best_inside = f32::NEG_INFINITY;
    let mut best_distance = f32::INFINITY;
    let mut inside = Neighbours { ids: [0; 3], weights: [1.0, 0.0, 0.0], beyond: 1.0 };
    let mut outside = inside;
    for slot in words[cells_at + cell]..words[cells_at + cell + 1] {
        let item = words[items_at + slot as usize];
        if item & ITEM_EDGE == 0 {
            let t = triangles_at + item as usize * TRIANGLE_WORDS;
            let (x, y) = (d[0] - f(words, t), d[1] - f(words, t + 1));
            let w1 = f(words, t + 2) * x + f(words, t + 3) * y;
            let w2 = f(words, t + 4) * x + f(words, t + 5) * y;
            let w0 = 1.0 - w1 - w2;
            let least = w0.min(w1.min(w2));
            if least > best_inside {
                best_inside = least;
                inside.ids = [words[t + 6], words[t + 7], words[t + 8]];
                inside.weights = [w0, w1, w2];
                // No other triangle holds it, but on a border, where both mean the same.
                if least >= 0.0 {
                    break;
                }
            }
        } else {
            let e = edges_at + (item & !ITEM_EDGE) as usize * EDGE_WORDS;
            let (ax, ay, dx, dy) = (f(words, e), f(words, e + 1), f(words, e + 2), f(words, e + 3));
            let t = (((d[0] - ax) * dx + (d[1] - ay) * dy) * f(words, e + 4)).clamp(0.0, 1.0);
            let (px, py) = (ax + t * dx, ay + t * dy);
            let distance = (d[0] - px) * (d[0] - px) + (d[1] - py) * (d[1] - py);
            if distance < best_distance {
                best_distance = distance;
                let cos_hull = (1.0 - px * px - py * py).max(1e-6).sqrt();
                outside.ids = [words[e + 5], words[e + 6], words[e + 5]];
                outside.weights = [1.0 - t, t, 0.0];
                outside.beyond = (d[2] / cos_hull).min(1.0);
            }
        }
    }
    if best_inside >= INSIDE_TOLERANCE || best_distance == f32::INFINITY {
        let clamped = inside.weights.map(|w| w.max(0.0));
        let sum = clamped[0] + clamped[1] + clamped[2];
        inside.weights = clamped.map(|w| w / sum);
        return inside;
    }
    outside
}

/// Returns the direction within the hull of the set whose words start at `at` that is nearest to `d`, whose neighbours
/// are `place`.
pub(crate) fn within_hull(words: &[u32], at: usize, d: [f32; 3], place: &Neighbours) -> [f32; 3] {
    if place.beyond >= 1.0 {
        return d;
    }
    let [p, q] = [0, 1].map(|i| direction(words, at, place.ids[i]));
    let along = |axis: usize| place.weights[0] * p[axis] + place.weights[1] * q[axis];
    let (x, y) = (along(0), along(1));
    [x, y, (1.0 - x * x - y * y).max(1e-6).sqrt()]
}

/// Returns after how many directions the first comes again, and all others with it; all of them where it does not.
fn round_of(directions: &[[f32; 3]]) -> usize {
    let round = directions.iter().skip(1).position(|d| *d == directions[0]).map_or(directions.len(), |at| at + 1);
    let repeats = directions.iter().enumerate().all(|(i, d)| *d == directions[i % round]);
    if repeats && directions.len().is_multiple_of(round) { round } else { directions.len() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::disk::{contains, segment_distance2};

    fn bonn81() -> Vec<[f32; 3]> {
        [(0, 1, 0), (15, 6, 60), (30, 12, 30), (45, 18, 20), (60, 20, 18), (75, 24, 15)]
            .iter()
            .flat_map(|&(theta, n, step)| (0..n).map(move |i| unit(f64::from(theta), f64::from(i * step))))
            .collect()
    }

    fn unit(theta_deg: f64, phi_deg: f64) -> [f32; 3] {
        let (t, p) = (theta_deg.to_radians(), phi_deg.to_radians());
        [(t.sin() * p.cos()) as f32, (t.sin() * p.sin()) as f32, t.cos() as f32]
    }

    #[test]
    fn directions_that_come_again_are_named_once() {
        let once = crate::testing::ring_directions(&[(30.0, 6), (60.0, 12)]);
        let thrice = [once.clone(), once.clone(), once.clone()].concat();
        let (one, three) = (Sphere::new(&once).unwrap(), Sphere::of_rounds(&thrice, 3).unwrap());
        assert_eq!((three.len(), three.distinct()), (3 * once.len(), once.len()));
        assert!(three.repeats(3) && one.repeats(1) && !three.repeats(2) && !one.repeats(2));
        let back = Sphere::from_file_words(&three.to_file_words()).unwrap();
        assert!(back == three && back.repeats(3));
        for wi in [[0.1, 0.2, 0.97], [0.9, 0.1, 0.42], [0.0, 0.0, 1.0]] {
            assert_eq!(one.locate(wi), three.locate(wi));
        }
        // Planted difference: one direction of the second round is another.
        let mut other = thrice;
        other[25] = [0.6, 0.0, 0.8];
        assert!(Sphere::of_rounds(&other, 3).is_err() && Sphere::new(&once.repeat(2)).is_err());
    }

    #[test]
    fn the_grid_finds_what_all_triangles_find_with_a_fraction_of_the_tests() {
        let sphere = Sphere::new(&bonn81()).unwrap();
        let plain = sphere.without_grid();
        let (mut with, mut without) = (0, 0);
        for i in 0..2000 {
            // Even over the hemisphere.
            let (z, phi) = (1.0 - (f64::from(i) + 0.5) / 2000.0, f64::from(i) * 2.399_963);
            let d = unit(z.acos().to_degrees(), phi.to_degrees());
            assert_eq!(sphere.locate(d), plain.locate(d));
            with += sphere.tests_of(d);
            without += plain.tests_of(d);
        }
        assert!(without >= 5 * with, "{without} {with}");
    }

    /// Finds the neighbours the slow and obvious way: by every triangle, then by every hull edge.
    fn locate_by_brute_force(sphere: &Sphere, d: [f32; 3]) -> (bool, f64) {
        let disk: Vec<[f64; 2]> =
            (0..sphere.len()).map(|i| sphere.direction(i as u32)).map(|v| [v[0].into(), v[1].into()]).collect();
        let p = [f64::from(d[0]), f64::from(d[1])];
        let at = sphere.triangles_at();
        let inside = (0..sphere.words[1] as usize).any(|i| {
            let ids = [6, 7, 8].map(|k| sphere.words[at + i * TRIANGLE_WORDS + k] as usize);
            contains(ids.map(|id| disk[id]), p)
        });
        let e = sphere.edges_at();
        let distance = (0..sphere.words[2] as usize)
            .map(|i| {
                let [a, b] = [5, 6].map(|k| sphere.words[e + i * EDGE_WORDS + k] as usize);
                segment_distance2(p, disk[a], disk[b])
            })
            .fold(f64::INFINITY, f64::min);
        (inside, distance.sqrt())
    }

    #[test]
    fn bonns_directions_give_136_triangles_and_24_hull_edges() {
        let sphere = Sphere::new(&bonn81()).unwrap();
        assert_eq!((sphere.words[0], sphere.words[1], sphere.words[2]), (81, 136, 24));
        assert_eq!(Sphere::from_words(sphere.words().to_vec()).unwrap(), sphere);
    }

    #[test]
    fn the_grid_agrees_with_brute_force_everywhere() {
        let directions = bonn81();
        let sphere = Sphere::new(&directions).unwrap();
        for i in 0..4000 {
            let d = unit(f64::from(i % 91) * 0.999, f64::from(i) * 7.31);
            let found = sphere.locate(d);
            let sum: f32 = found.weights.iter().sum();
            assert!((sum - 1.0).abs() < 1e-5 && found.weights.iter().all(|w| *w >= 0.0));
            let mut p = [0.0f64; 2];
            for (id, w) in found.ids.iter().zip(found.weights) {
                let v = directions[*id as usize];
                p[0] += f64::from(v[0] * w);
                p[1] += f64::from(v[1] * w);
            }
            let off = ((p[0] - f64::from(d[0])).powi(2) + (p[1] - f64::from(d[1])).powi(2)).sqrt();
            let (inside, distance) = locate_by_brute_force(&sphere, d);
            let expected = if inside { 0.0 } else { distance };
            assert!((off - expected).abs() < 1e-4, "{d:?}: off by {off}, expected {expected}");
        }
    }

    #[test]
    fn a_measured_direction_finds_itself() {
        let directions = bonn81();
        let sphere = Sphere::new(&directions).unwrap();
        for (i, d) in directions.iter().enumerate() {
            let found = sphere.locate(*d);
            let own: f32 = (0..3).filter(|&k| found.ids[k] as usize == i).map(|k| found.weights[k]).sum();
            assert!(own > 0.999, "direction {i}: {found:?}");
        }
    }

    #[test]
    fn degenerate_sets_still_answer() {
        for directions in [
            vec![[0.0, 0.0, 1.0]],
            vec![unit(10.0, 0.0), unit(50.0, 0.0)],
            (0..5).map(|i| unit(15.0 * f64::from(i), 0.0)).collect(),
        ] {
            let sphere = Sphere::new(&directions).unwrap();
            let found = sphere.locate(unit(80.0, 123.0));
            assert!((found.weights.iter().sum::<f32>() - 1.0).abs() < 1e-5);
            assert!(Sphere::from_words(sphere.words().to_vec()).is_ok());
        }
        assert!(Sphere::new(&[]).is_err());
        assert!(Sphere::new(&[[0.0, 0.0, 1.0], [0.0, 0.0, 1.0]]).is_err());
    }

    #[test]
    fn every_damaged_word_is_refused_or_harmless() {
        let words = Sphere::new(&bonn81()).unwrap().words().to_vec();
        for i in 0..words.len() {
            for value in [u32::MAX, 0x7f80_0000, 5000, 3e38f32.to_bits(), (-1e10f32).to_bits(), 0] {
                let mut damaged = words.clone();
                damaged[i] = value;
                if let Ok(sphere) = Sphere::from_words(damaged) {
                    for j in 0..10 {
                        let found = sphere.locate(unit(f64::from(j) * 9.0, f64::from(j) * 33.0));
                        let sum: f32 = found.weights.iter().sum();
                        assert!((sum - 1.0).abs() < 1e-5 && found.beyond.is_finite(), "word {i}: {found:?}");
                        assert!(found.ids.iter().all(|id| (*id as usize) < sphere.len()));
                    }
                }
            }
        }
    }
}
