//! A ray's way through a shell, from one tetrahedron to the next. Twin: `walk.wgsl`.
//!
//! Seen along the ray the ray is a point. It lies within the face through which a tetrahedron was entered; the fourth
//! vertex joins that face's corners by three edges, and the sides on which the ray passes them tell which of the other
//! three faces it leaves by [Aman 2022]. Each edge is judged once and its sign is kept while the ray is beside it, so
//! what two tetrahedra share has one answer: the walk cannot fall between them. A point on an edge is moved aside by
//! less than any number [Edelsbrunner 1990]. What rounding still makes contradictory takes the likeliest face.
//!
//! A line's way through tetrahedra, folded or not, visits each at most once; where the skin is folded t runs back for a
//! while, and what was passed already is not told again.

use super::shell::{NO_LINK, Shell};
use crate::geometry::shear::Shear;
use glam::Vec3;

/// Cosine between the height and the normal of a tetrahedron's base below which its map is taken to be flat.
const MIN_UPRIGHT: f32 = 1e-7;
/// Largest component of a direction: below and above, its inverse is no number that can be reckoned with.
const MIN_RAY: f32 = 1e-30;
/// See [`MIN_RAY`].
const MAX_RAY: f32 = 1e30;
/// The constants that the shader has too, by name.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, f32)] =
    &[("MIN_UPRIGHT", MIN_UPRIGHT), ("MIN_RAY", MIN_RAY), ("MAX_RAY", MAX_RAY)];

/// A stretch of a ray within one tetrahedron.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Begin of the interval, in units of the ray's direction.
    pub t0: f32,
    /// End of the interval, beyond `t0`.
    pub t1: f32,
    /// The tetrahedron.
    pub tet: u32,
}

/// The affine map of a tetrahedron from the world to the texture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TextureMap {
    /// A position,
    pub position: Vec3,
    /// and its texture coordinates.
    pub texture: Vec3,
    /// Gradients of u, v and w, texels per world unit: the rows of J^-1. Zero in a flat tetrahedron.
    pub gradients: [Vec3; 3],
}

/// A straight stretch of a ray in texture space: `point + (t - t0) direction`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TextureRay {
    /// Texture coordinates where the stretch begins.
    pub point: Vec3,
    /// Texels per unit of the ray's direction; not unit.
    pub direction: Vec3,
}

/// The walk of one ray. An iterator over disjoint intervals in the order of t; between the first and the last nothing
/// is missing. Twin: `ShellWalk`.
#[derive(Debug, Clone)]
pub struct Walk<'a> {
    shell: &'a Shell,
    origin: Vec3,
    shear: Shear,
    /// Present face: 4 x the tetrahedron + the face that it came through, or [`NO_LINK`].
    link: u32,
    /// Position numbers of that face, around the ray, and the positions as the ray sees them.
    face: [u32; 3],
    corners: [Vec3; 3],
    /// Edge functions from each corner to the next; none is negative.
    edges: [f32; 3],
    t: f32,
    t_max: f32,
    /// Tetrahedra that it may still visit.
    left: u32,
    /// The face by which it left.
    exit: u32,
}

impl Shell {
    /// Starts the walk of a ray from `t_min` on that enters the tetrahedron of `link` (4 x its number + its face) by
    /// that face, as one of [`boundary`](Shell::boundary) that faces the ray. The face may lie before `t_min`, as where
    /// an eye is inside.
    pub fn enter(&self, origin: Vec3, direction: Vec3, link: u32, t_min: f32, t_max: f32) -> Walk<'_> {
        let mut walk = self.facing(origin, direction, link, t_max);
        if walk.edges.iter().sum::<f32>() < 0.0 {
            walk.face.swap(1, 2);
            walk.corners.swap(1, 2);
            walk.edges = walk.edges.map(|edge| -edge);
            walk.edges.swap(0, 2);
        }
        walk.t = crossing(walk.corners, walk.edges, t_min).max(t_min);
        walk
    }

    /// Starts the walk of a ray that is inside `tet` at `t_min`, as after [`locate`](Shell::locate) or from a point of
    /// an interval.
    pub fn start(&self, origin: Vec3, direction: Vec3, tet: u32, t_min: f32, t_max: f32) -> Walk<'_> {
        // By the face through which the ray came: of those that face it the one that it is deepest within.
        let mut best = (4 * tet, f32::NEG_INFINITY);
        for link in 4 * tet..4 * tet + 4 {
            let walk = self.facing(origin, direction, link, t_max);
            let area: f32 = walk.edges.iter().sum();
            let depth = walk.edges.map(|edge| edge / area).into_iter().fold(f32::INFINITY, f32::min);
            if walk.shear.is_towards(area) && depth > best.1 {
                best = (link, depth);
            }
        }
        self.enter(origin, direction, best.0, t_min, t_max)
    }

    /// Returns a walk at the face of `link`, as that is seen.
    fn facing(&self, origin: Vec3, direction: Vec3, link: u32, t_max: f32) -> Walk<'_> {
        let size = direction.abs().max_element();
        let is_ray = size > MIN_RAY && size < MAX_RAY;
        let shear = Shear::new(if is_ray { direction } else { Vec3::Z });
        let face = self.face(link);
        let mut walk = Walk {
            shell: self,
            origin,
            shear,
            link: if is_ray { link } else { NO_LINK },
            face,
            corners: [Vec3::ZERO; 3],
            edges: [0.0; 3],
            t: t_max,
            t_max,
            left: self.tets().len() as u32,
            exit: NO_LINK,
        };
        let [a, b, c] = face.map(|position| walk.sheared(position));
        walk.corners = [a, b, c];
        walk.edges = [edge(a, b), edge(b, c), edge(c, a)];
        walk
    }

    /// Returns the map of a tetrahedron, from its positions and texture coordinates alone.
    pub fn map(&self, tet: u32) -> TextureMap {
        let tet = &self.tets()[tet as usize];
        let [p, a, b, c] = tet.positions.map(|i| self.positions()[i as usize]);
        let [t, ta, tb, tc] = tet.textures.map(|i| self.textures()[i as usize]);
        let [a, b, c] = [a - p, b - p, c - p];
        let [bc, ca, ab] = [b.cross(c), c.cross(a), a.cross(b)];
        let volume = a.dot(bc);
        // a is along the height, which is short where the skin is thin: its product with the base loses nothing.
        let has_volume = volume.abs() > MIN_UPRIGHT * a.length() * bc.length();
        if !has_volume {
            return TextureMap { position: p, texture: t, gradients: [Vec3::ZERO; 3] };
        }
        let inverse = 1.0 / volume;
        let [bc, ca, ab] = [bc * inverse, ca * inverse, ab * inverse];
        let [ta, tb, tc] = [ta - t, tb - t, tc - t];
        let gradients =
            [bc * ta.x + ca * tb.x + ab * tc.x, bc * ta.y + ca * tb.y + ab * tc.y, bc * ta.z + ca * tb.z + ab * tc.z];
        TextureMap { position: p, texture: t, gradients }
    }
}

impl TextureMap {
    /// Returns the texture coordinates of a position.
    pub fn point(&self, position: Vec3) -> Vec3 {
        self.texture + self.direction(position - self.position)
    }

    /// Transforms a direction, or a difference of positions, into texels.
    pub fn direction(&self, direction: Vec3) -> Vec3 {
        Vec3::from(self.gradients.map(|gradient| gradient.dot(direction)))
    }

    /// Transforms a ray from where its interval begins into the texture.
    pub fn ray(&self, origin: Vec3, direction: Vec3, t0: f32) -> TextureRay {
        // What is near the ray stays exact far from the world's origin.
        let from_position = (origin - self.position) + t0 * direction;
        TextureRay { point: self.texture + self.direction(from_position), direction: self.direction(direction) }
    }

    /// Returns the width in texels of a cone that is `width` world units wide about `direction`, where its disc is as
    /// large as the ellipse that it becomes: volumes grow by |det J^-1| and lengths along the ray by |J^-1 d| / |d|, so
    /// areas across it by their quotient. 0 in a flat tetrahedron.
    pub fn width(&self, direction: Vec3, width: f32) -> f32 {
        let [u, v, w] = self.gradients;
        let along = self.direction(direction).length();
        if along > 0.0 { width * (u.dot(v.cross(w)).abs() * direction.length() / along).sqrt() } else { 0.0 }
    }

    /// Returns the three rows of the map.
    pub fn texture_from_world(&self) -> [[f32; 4]; 3] {
        [0, 1, 2].map(|row| {
            let gradient = self.gradients[row];
            gradient.extend(self.texture[row] - gradient.dot(self.position)).to_array()
        })
    }
}

impl Walk<'_> {
    /// Returns the next interval that is longer than nothing.
    fn step(&mut self) -> Option<Interval> {
        while self.link != NO_LINK && self.left > 0 && self.t < self.t_max {
            self.left -= 1;
            let (number, apex) = (self.link / 4, self.link as usize % 4);
            let tet = &self.shell.tets()[number as usize];
            let position = tet.positions[apex];
            let corner = self.sheared(position);
            // From the face's corners to the new one, and whether the ray passes on the far side.
            let edges = self.corners.map(|other| edge(other, corner));
            let behind = [0, 1, 2].map(|i| is_behind(edges[i], self.corners[i], corner));
            let kept = kept_edge(edges, behind);
            let (next, dropped) = ((kept + 1) % 3, (kept + 2) % 3);
            let dropped = (0..4).find(|i| tet.positions[*i] == self.face[dropped]).unwrap_or(apex);
            self.face = [self.face[kept], self.face[next], position];
            self.corners = [self.corners[kept], self.corners[next], corner];
            self.edges = [self.edges[kept], edges[next], -edges[kept]];
            self.exit = 4 * number + dropped as u32;
            self.link = tet.links[dropped];
            let t1 = crossing(self.corners, self.edges, self.t).clamp(self.t, self.t_max);
            let interval = Interval { t0: self.t, t1, tet: number };
            self.t = t1;
            if interval.t1 > interval.t0 {
                return Some(interval);
            }
        }
        None
    }

    /// Returns a position relative to the origin of the ray, sheared along it.
    fn sheared(&self, position: u32) -> Vec3 {
        self.shear.apply(self.shell.positions()[position as usize] - self.origin)
    }

    /// Returns where the ray is: the end of the last interval.
    pub fn t(&self) -> f32 {
        self.t
    }

    /// Returns the face by which the ray has left the shell (4 x the tetrahedron + its face), if it has.
    pub fn exit(&self) -> Option<u32> {
        (self.link == NO_LINK && self.exit != NO_LINK).then_some(self.exit)
    }
}

impl Iterator for Walk<'_> {
    type Item = Interval;

    fn next(&mut self) -> Option<Interval> {
        self.step()
    }
}

/// Returns the number of the corner from which the edge runs that the ray's face keeps; the one two further is dropped.
/// `edges` run from the corners to the new one, and the ray passes those `behind` on the far side.
fn kept_edge(edges: [f32; 3], behind: [bool; 3]) -> usize {
    if let Some(kept) = (0..3).find(|i| behind[*i] && !behind[(i + 1) % 3]) {
        return kept;
    }
    // Impossible but for rounding: the one nearest to being on the other side is.
    let sign = if behind[0] { -1.0 } else { 1.0 };
    let [a, b, c] = edges.map(|edge| sign * edge);
    let least = if a <= b && a <= c {
        0
    } else if b <= c {
        1
    } else {
        2
    };
    if behind[0] { (least + 2) % 3 } else { least }
}

/// Returns twice the signed area of the origin, p and q: on which side of their edge the ray passes.
fn edge(p: Vec3, q: Vec3) -> f32 {
    p.x * q.y - p.y * q.x
}

/// Returns whether an edge function is negative, or becomes so when all corners move by (e, e^2) for a positive e below
/// any number.
fn is_behind(edge: f32, p: Vec3, q: Vec3) -> bool {
    edge < 0.0 || (edge == 0.0 && (q.y < p.y || (q.y == p.y && p.x < q.x)))
}

/// Returns t at which the ray meets a face around it, within what the corners have; `otherwise` where the face is seen
/// on edge.
fn crossing([a, b, c]: [Vec3; 3], edges: [f32; 3], otherwise: f32) -> f32 {
    let area = edges[0] + edges[1] + edges[2];
    if area > 0.0 {
        let t = (edges[1] * a.z + edges[2] * b.z + edges[0] * c.z) / area;
        t.clamp(a.z.min(b.z).min(c.z), a.z.max(b.z).max(c.z))
    } else {
        otherwise
    }
}

#[cfg(test)]
mod tests {
    use super::super::refine::ShellParams;
    use super::super::testing::{
        Crossing, combed, crossings, grid, intervals, scaled, sheared, triangles, twisted, vector,
    };
    use super::super::thick_skin::{Skin, SkinVertex};
    use super::*;
    use crate::geometry::bvh::{AnyHit, NO_HIT};
    use crate::geometry::geometry::{Geometry, Triangle, Vertex};
    use btf_runtime::testing::Random;
    use glam::{Mat3, Vec3Swizzles};
    use rayon::prelude::*;

    fn shell_of(skin: &Skin, tolerance: f32) -> Shell {
        Shell::new(skin, &ShellParams { tolerance, ..ShellParams::default() }).unwrap()
    }

    /// A ray through about where a skin of 4 x 4 texels of this size is.
    fn ray(random: &mut Random, size: f32) -> (Vec3, Vec3) {
        let middle = Vec3::new(2.0, 2.0, 0.5);
        let [from, to] = [middle + vector(random, 6.0), middle + vector(random, 2.0) * Vec3::new(1.0, 1.0, 0.3)];
        let length = random.within(0.1, 3.0);
        (from * size, (to - from) * (size * length))
    }

    fn sum(intervals: &[Interval]) -> f64 {
        intervals.iter().map(|interval| f64::from(interval.t1 - interval.t0)).sum()
    }

    /// Whether intervals follow each other.
    fn are_in_order(intervals: &[Interval]) -> bool {
        intervals.windows(2).all(|pair| pair[0].t1 <= pair[1].t0) && intervals.iter().all(|one| one.t0 < one.t1)
    }

    /// The chord of a line, and how far rounding may move its ends, which grows where it meets the boundary at a flat
    /// angle.
    fn chord(found: &[Crossing], span: f64) -> (f64, f64) {
        let flattest = found.iter().fold(1f64, |least, crossing| least.min(crossing.cosine.abs()));
        let chord = found.iter().map(|crossing| crossing.t * crossing.cosine.signum()).sum();
        (chord, 4e-6 * span * (1.0 + found.len() as f64) / flattest)
    }

    /// Rays of `count` whose intervals do not add up to the chord, and rays that met the shell.
    fn cracks(shell: &Shell, size: f32, count: usize) -> [usize; 2] {
        const BLOCKS: usize = 100;
        let boundary = triangles(shell);
        let of_block = |block: usize| {
            let mut random = Random::new(block as u64);
            let mut found = [0; 2];
            for _ in 0..count / BLOCKS {
                let (origin, direction) = ray(&mut random, size);
                let crossings = crossings(&boundary, origin, direction);
                let walked = intervals(shell, origin, direction, &crossings);
                let scale = f64::from(direction.length());
                let (chord, slack) = chord(&crossings, f64::from(origin.length() + 8.0 * size) / scale);
                let is_wrong = !are_in_order(&walked) || (sum(&walked) - chord).abs() > slack;
                found = [found[0] + usize::from(is_wrong), found[1] + usize::from(!crossings.is_empty())];
            }
            found
        };
        (0..BLOCKS).into_par_iter().map(of_block).reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]])
    }

    #[test]
    fn a_million_rays_cross_bent_skins_without_crack_or_overlap() {
        let skins = [("sheared", sheared(4), 1.0), ("twisted", twisted(4), 0.2), ("combed", combed(4), 0.2)];
        for (name, skin, tolerance) in skins {
            let mut shell = shell_of(&skin, tolerance);
            assert_eq!(shell.report().inverted, 0, "{name}");
            let [wrong, met] = cracks(&shell, 1.0, 340_000);
            assert_eq!(wrong, 0, "{name}: {wrong} of {met}");
            assert!(met > 200_000, "{name}: {met}");
            // Planted: one face between two neighbours is no way through.
            let middle = shell.tets().len() / 2;
            let face = shell.tets()[middle].links.iter().position(|link| *link != NO_LINK).unwrap();
            shell.tets_mut()[middle].links[face] = NO_LINK;
            let [wrong, _] = cracks(&shell, 1.0, 34_000);
            assert!(wrong > 10, "{name}: {wrong}");
        }
    }

    #[test]
    fn tiny_huge_thin_and_thick_skins_have_no_cracks_either() {
        for (size, thickness) in [(1e-3, 1.0), (1e5, 1.0), (1.0, 1e-4), (1.0, 30.0), (1e5, 1e-3), (1e-3, 1e-3)] {
            // Height vectors of 30 texels that differ would cross.
            let skin = if thickness > 1.0 { sheared(4) } else { twisted(4) };
            let shell = shell_of(&scaled(&skin, size, thickness), 10.0);
            let [wrong, met] = cracks(&shell, size, 20_000);
            assert!(wrong == 0 && met > 5_000, "{size} {thickness}: {wrong} of {met}");
        }
    }

    #[test]
    fn optical_depth_under_an_affine_skin_is_the_closed_form() {
        let shell = shell_of(&sheared(4), 1.0);
        let boundary = triangles(&shell);
        // World from texture: u along x, v along y, w along the height vectors.
        let texture_from_world = Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::new(0.4, -0.7, 0.5)).inverse();
        let s = Mat3::from_cols(Vec3::new(1.0, 0.2, 0.1), Vec3::new(0.2, 0.5, -0.1), Vec3::new(0.1, -0.1, 2.0));
        let mut random = Random::new(8);
        let mut met = 0;
        for _ in 0..20_000 {
            let (origin, direction) = ray(&mut random, 1.0);
            let own = texture_from_world * direction;
            let in_texture = texture_from_world * origin;
            // The texture's box of 4 x 4 x 1, clipped axis by axis.
            let (mut from, mut to) = (f32::MIN, f32::MAX);
            for (axis, top) in [4.0, 4.0, 1.0].into_iter().enumerate() {
                let [a, b] = [0.0, top].map(|bound| (bound - in_texture[axis]) / own[axis]);
                (from, to) = (from.max(a.min(b)), to.min(a.max(b)));
            }
            let extinction = own.dot(s * own).sqrt();
            let expected = f64::from(extinction * (to - from).max(0.0));
            let walked = intervals(&shell, origin, direction, &crossings(&boundary, origin, direction));
            let depth: f64 = walked
                .iter()
                .map(|interval| {
                    let d = shell.map(interval.tet).ray(origin, direction, interval.t0).direction;
                    f64::from(d.dot(s * d).sqrt() * (interval.t1 - interval.t0))
                })
                .sum();
            met += usize::from(depth > 0.1);
            assert!((depth - expected).abs() < 1e-4 * (1.0 + f64::from(extinction)), "{depth} {expected}");
        }
        assert!(met > 10_000, "{met}");
    }

    #[test]
    fn maps_are_exact_at_corners_and_continuous_between_neighbours() {
        for (size, thickness) in [(1.0, 1.0), (1e-3, 1e-4), (1e5, 1e-3), (1.0, 1e3)] {
            let skin = if thickness > 1.0 { sheared(4) } else { twisted(4) };
            let shell = shell_of(&scaled(&skin, size, thickness), 10.0);
            for (number, tet) in (0..).zip(shell.tets()) {
                let map = shell.map(number);
                let rows = map.texture_from_world();
                for corner in 0..4 {
                    let position = shell.positions()[tet.positions[corner] as usize];
                    let texture = shell.textures()[tet.textures[corner] as usize];
                    // What rounding of positions leaves, over the thickness.
                    let slack = 1e-5 + 1e-6 / thickness + 4e-6 * thickness;
                    let off = (map.point(position) - texture).abs().max_element();
                    assert!(off < slack, "{size} {thickness}: {off}");
                    let by_rows = Vec3::from(rows.map(|row| position.extend(1.0).dot(row.into())));
                    let off = (by_rows - texture).abs().max_element();
                    assert!(off < 4.0 * slack, "{size} {thickness}: {off}");
                }
            }
        }
        // Planted: another tetrahedron's map is not right.
        let shell = shell_of(&twisted(4), 10.0);
        let far = shell.tets()[90];
        let off = shell.map(0).point(shell.positions()[far.positions[0] as usize]);
        assert!((off - shell.textures()[far.textures[0] as usize]).length() > 0.1);
    }

    #[test]
    fn cones_are_as_wide_in_the_texture_as_their_discs_are_large() {
        let shell = shell_of(&combed(4), 0.5);
        let mut random = Random::new(6);
        for tet in 0..shell.tets().len() as u32 {
            let map = shell.map(tet);
            let direction = vector(&mut random, 3.0);
            let (x, y) = direction.normalize().any_orthonormal_pair();
            // What two sides of the disc's square span, across the ray in the texture.
            let area = map.direction(x).cross(map.direction(y)).dot(map.direction(direction).normalize()).abs();
            let width = map.width(direction, 0.1);
            assert!((width - 0.1 * area.sqrt()).abs() < 1e-4 * width + 1e-6, "{width} {area}");
        }
        assert_eq!(TextureMap { gradients: [Vec3::ZERO; 3], ..shell.map(0) }.width(Vec3::X, 1.0), 0.0);
    }

    #[test]
    fn the_texture_lies_where_the_trilinear_boxes_have_it() {
        let skin = combed(4);
        let worst = |shell: &Shell| {
            let mut random = Random::new(3);
            let mut worst = 0f32;
            for _ in 0..2000 {
                let [x, y, w] = [random.within(0.0, 4.0), random.within(0.0, 4.0), random.within(0.0, 1.0)];
                let [i, j] = [x, y].map(|x| x as usize);
                let (u, v) = (x - i as f32, y - j as f32);
                let at = |di: usize, dj: usize| skin.vertices()[(j + dj) * 5 + i + di];
                let height = at(0, 0).height.lerp(at(1, 0).height, u).lerp(at(0, 1).height.lerp(at(1, 1).height, u), v);
                let position = Vec3::new(x, y, 0.0) + w * height;
                if let Some(tet) = shell.locate(position) {
                    worst = worst.max((shell.map(tet).point(position) - Vec3::new(x, y, w)).abs().max_element());
                }
            }
            worst
        };
        let (coarse, fine) = (shell_of(&skin, 1.0), shell_of(&skin, 0.02));
        assert!(fine.report().deviation <= 0.02 && worst(&fine) <= 0.025, "{} {:?}", worst(&fine), fine.report());
        assert!(worst(&coarse) > 0.05, "{}", worst(&coarse));
    }

    /// A geometry of the boundary whose materials are the triangles' numbers.
    fn boundary_geometry(shell: &Shell) -> Geometry {
        let vertex = |position: &Vec3| Vertex {
            position: position.to_array(),
            u: 0.0,
            normal: [0.0, 0.0, 1.0],
            v: 0.0,
            tangent: [1.0, 0.0, 0.0, 1.0],
        };
        let triangles = (0..).zip(shell.boundary());
        let triangles = triangles.map(|(material, link)| Triangle { vertices: shell.face(*link), material });
        Geometry::new(shell.positions().iter().map(vertex).collect(), triangles.collect()).unwrap()
    }

    #[test]
    fn rays_along_faces_edges_and_through_vertices_cross_all_of_a_skin() {
        let shell = shell_of(&grid(4, 4), 1.0);
        let geometry = boundary_geometry(&shell);
        let mut rays = Vec::new();
        for i in 1..8 {
            for j in 1..8 {
                // Straight and slanted, through vertices, edges and the middles of texels, from above and from below.
                let at = Vec3::new(i as f32 * 0.5, j as f32 * 0.5, 0.0);
                rays.push((at + Vec3::Z * 3.0, Vec3::NEG_Z, 1.0));
                rays.push((at - Vec3::Z * 3.0, Vec3::Z, 1.0));
                rays.push((at * 0.5 + Vec3::new(1.0, 1.0, 2.0), Vec3::new(0.25, -0.25, -1.0), 1.0));
            }
            // Along planes of sides and diagonals, at any height.
            let height = Vec3::Z * (i as f32 * 0.125);
            for j in 1..8 {
                let along = Vec3::new(-2.0, j as f32 * 0.5, 0.0) + height;
                rays.push((along, Vec3::X, 4.0));
                rays.push((along.yxz(), Vec3::Y, 4.0));
            }
            rays.push((Vec3::new(-1.0, -1.0, 0.0) + height, Vec3::new(1.0, 1.0, 0.0), 4.0));
            rays.push((Vec3::new(5.0, -1.0, 0.0) + height, Vec3::new(-1.0, 1.0, 0.0), 4.0));
        }
        for (origin, direction, expected) in rays {
            let length = direction.length();
            let hit = geometry.trace(origin, direction / length, 100.0, AnyHit::No);
            assert_ne!(hit.primitive, NO_HIT, "{origin} {direction}");
            let link = shell.boundary()[geometry.triangles()[hit.primitive as usize].material as usize];
            let walked: Vec<Interval> = shell.enter(origin, direction, link, 0.0, f32::MAX).collect();
            assert!(are_in_order(&walked));
            assert!((sum(&walked) - expected).abs() < 1e-5, "{origin} {direction}: {}", sum(&walked));
        }
    }

    #[test]
    fn rays_that_graze_the_shell_have_little_of_it() {
        let shell = shell_of(&grid(4, 4), 1.0);
        let link = |boundary: usize| shell.boundary()[boundary];
        // In the plane of the top, of a side, and past a corner, by whichever face they are said to enter.
        let grazing = [
            (Vec3::new(-1.0, 1.3, 1.0), Vec3::X),
            (Vec3::new(-1.0, 0.0, 0.5), Vec3::X),
            (Vec3::new(-1.0, 1.0, 0.0), Vec3::new(1.0, -1.0, 0.0)),
            (Vec3::new(0.0, 0.0, 5.0), Vec3::NEG_Z),
        ];
        for (origin, direction) in grazing {
            for boundary in 0..shell.boundary().len() {
                let walked: Vec<Interval> = shell.enter(origin, direction, link(boundary), 0.0, 100.0).collect();
                assert!(are_in_order(&walked) && walked.len() <= shell.tets().len());
            }
        }
        // Flat over a hill: what adds up is what is there.
        let shell = shell_of(&twisted(4), 0.05);
        let boundary = triangles(&shell);
        let mut random = Random::new(12);
        for _ in 0..2000 {
            let origin = Vec3::new(-3.0, random.within(0.0, 4.0), random.within(0.2, 1.4));
            let direction = Vec3::new(1.0, random.within(-0.1, 0.1), random.within(-1e-3, 1e-3));
            let found = crossings(&boundary, origin, direction);
            let (chord, slack) = chord(&found, 10.0);
            assert!((sum(&intervals(&shell, origin, direction, &found)) - chord).abs() <= slack);
        }
    }

    #[test]
    fn an_eye_inside_sees_the_rest_of_its_chord() {
        let shell = shell_of(&twisted(4), 0.05);
        let boundary = triangles(&shell);
        let mut random = Random::new(21);
        let mut inside = 0;
        for _ in 0..3000 {
            let origin = vector(&mut random, 2.0) + Vec3::new(2.0, 2.0, 0.5);
            let Some(tet) = shell.locate(origin) else { continue };
            let direction = vector(&mut random, 1.0);
            let found = crossings(&boundary, origin, direction);
            let exit = found.iter().find(|crossing| crossing.t > 0.0).unwrap();
            let mut walk = shell.start(origin, direction, tet, 0.0, f32::MAX);
            let walked: Vec<Interval> = (&mut walk).collect();
            let slack = 4e-5 / (f64::from(direction.length()) * exit.cosine.abs());
            assert!((sum(&walked) - exit.t).abs() < slack, "{} {}", sum(&walked), exit.t);
            assert!(are_in_order(&walked) && walked.first().is_none_or(|first| first.t0 == 0.0));
            let through = walk.exit().and_then(|link| shell.boundary().iter().position(|face| *face == link));
            assert!(through.is_some());
            // The same by the face before the eye, and up to a point.
            if let Some(entry) = found.iter().rev().find(|crossing| crossing.t < 0.0) {
                let walk = shell.enter(origin, direction, shell.boundary()[entry.boundary], 0.0, f32::MAX);
                assert!((sum(&walk.collect::<Vec<_>>()) - exit.t).abs() < slack);
            }
            let half = 0.5 * exit.t as f32;
            let walked: Vec<Interval> = shell.start(origin, direction, tet, 0.0, half).collect();
            assert!((sum(&walked) - f64::from(half)).abs() < 1e-6 + slack && walked.iter().all(|one| one.t1 <= half));
            inside += 1;
        }
        assert!(inside > 300, "{inside}");
    }

    #[test]
    fn walks_through_folded_and_collapsed_skins_end() {
        let folded = twisted(5).with_vertices(|vertex| SkinVertex {
            height: vertex.height + 4.0 * Vec3::new(2.5 - vertex.position.x, (3.0 * vertex.position.x).sin(), 0.0),
            ..*vertex
        });
        // Height vectors that are zero on one side.
        let tapered =
            grid(4, 4).with_vertices(|vertex| SkinVertex { height: vertex.height * vertex.position.x, ..*vertex });
        for (skin, is_folded) in [(folded, true), (tapered, false)] {
            let shell = shell_of(&skin, 0.1);
            let report = shell.report();
            assert_eq!((report.inverted > 0, report.flat > 0), (is_folded, !is_folded), "{report:?}");
            let boundary = triangles(&shell);
            let mut random = Random::new(2);
            let mut longest = 0;
            let lo = shell.positions().iter().fold(Vec3::MAX, |lo, position| lo.min(*position));
            let hi = shell.positions().iter().fold(Vec3::MIN, |hi, position| hi.max(*position));
            for _ in 0..20_000 {
                let (origin, direction) = ray(&mut random, 1.0);
                let found = crossings(&boundary, origin, direction);
                let walked = intervals(&shell, origin, direction, &found);
                assert!(are_in_order(&walked));
                // A fold may lie outside of the boundary, but not outside of all vertices.
                let is_within = |t: f32| {
                    let at = origin + t * direction;
                    (at.clamp(lo, hi) - at).length() < 1e-3
                };
                assert!(walked.iter().all(|one| is_within(one.t0) && is_within(one.t1)));
                if !is_folded {
                    let (chord, slack) = chord(&found, 10.0);
                    assert!((sum(&walked) - chord).abs() <= slack, "{} {chord}", sum(&walked));
                }
                longest = longest.max(walked.len());
            }
            assert!(longest > 4 && longest < shell.tets().len(), "{longest}");
        }
    }

    #[test]
    fn rays_that_are_none_have_no_intervals() {
        let shell = shell_of(&grid(2, 2), 1.0);
        let above = Vec3::new(0.7, 0.3, 2.0);
        for (origin, direction) in [
            (above, Vec3::ZERO),
            (above, Vec3::NAN),
            (above, Vec3::splat(f32::INFINITY)),
            (Vec3::NAN, Vec3::NEG_Z),
            (Vec3::splat(1e38), Vec3::NEG_Z),
        ] {
            for link in shell.boundary() {
                let walked: Vec<Interval> = shell.enter(origin, direction, *link, 0.0, 10.0).collect();
                assert!(walked.iter().all(|one| one.t0 < one.t1) && walked.len() < 30, "{origin} {direction}");
            }
            assert!(shell.start(origin, direction, 3, 0.0, 10.0).count() < 30);
        }
        // Nothing between t_min and t_max.
        assert_eq!(shell.enter(above, Vec3::NEG_Z, shell.boundary()[0], 5.0, 4.0).count(), 0);
    }
}
