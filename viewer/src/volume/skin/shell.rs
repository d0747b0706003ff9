//! The tetrahedra of a skin: a shell map [Porumbescu 2005] whose prisms and bilinear cells are cut in three and six.

use super::refine::{Cuts, Diagonal, Lattice, MIN_VOLUME, PRISM, ShellParams, cuts, diagonal, weights};
use super::thick_skin::{Corners, Skin, SkinFace, orientation};
use glam::{DMat3, DVec3, Vec3};
use std::collections::{HashMap, HashSet};

/// Link of a face behind which the skin ends.
pub const NO_LINK: u32 = u32::MAX;
/// Tetrahedra at most: a link numbers their faces.
pub(super) const MAX_TETS: usize = 1 << 28;
/// The faces of a tetrahedron: that opposite of vertex i is number i, counter-clockwise from outside.
pub(super) const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// A tetrahedron. Twin: the words of `skin_walk.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Tet {
    /// Numbers of its positions; (1 - 0) x (2 - 0) . (3 - 0) is positive unless the skin is folded, and the edge from 0
    /// to 1 runs along a height vector.
    pub positions: [u32; 4],
    /// Link behind the face opposite of each position: 4 x the tetrahedron + the number of its face, or [`NO_LINK`].
    pub links: [u32; 4],
    /// Numbers of its texture coordinates.
    pub textures: [u32; 4],
    /// Number of the pattern that is mapped there.
    pub pattern: u32,
}

/// A point of the surface between skin vertices, at whatever height.
#[derive(Debug, Clone, Copy)]
struct Column {
    vertices: [u32; 4],
    weights: [f32; 4],
}

/// The figures of a shell.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ShellReport {
    /// Tetrahedra.
    pub tets: usize,
    /// Triangles of the boundary: bottoms, tops, and the sides where the skin ends.
    pub boundary: usize,
    /// Tetrahedra that are turned over, because the skin is folded or its height vectors cross. Rays pass them without
    /// an interval.
    pub inverted: usize,
    /// Tetrahedra without a volume, as where height vectors are zero; no ray sees them.
    pub flat: usize,
    /// Sides where more than two boxes meet, which are boundary for all of them.
    pub ambiguous: usize,
    /// Faces that were there twice and count once.
    pub repeated: usize,
    /// Cuts of faces along each side.
    pub sides: u32,
    /// Cuts of height vectors.
    pub layers: u32,
    /// Greatest distance of a point from where its trilinear box has it in the texture, texels. As measured when the
    /// shell was made, by the diagonals of all tetrahedra.
    pub deviation: f32,
}

/// The tetrahedra, their neighbours and their boundary.
#[derive(Debug, Clone)]
pub struct Shell {
    layers: u32,
    skin_vertices: usize,
    /// Of positions, whose vertices are one where they lie at one place with one height, and of texture coordinates.
    columns: [Vec<Column>; 2],
    positions: Vec<Vec3>,
    textures: Vec<Vec3>,
    tets: Vec<Tet>,
    boundary: Vec<u32>,
    report: ShellReport,
}

impl Shell {
    /// Builds the shell of `skin`. Vertices at one place with one height vector are one to it, whatever their texture
    /// coordinates: a texture seam is no end of the skin. The same skin gives the same shell. Cost: a few measurements
    /// of every box, and a sort of the faces of all tetrahedra.
    ///
    /// # Errors
    /// A sentence if the parameters are out of range or there would be more than 2^28 tetrahedra.
    pub fn new(skin: &Skin, params: &ShellParams) -> Result<Shell, String> {
        params.check()?;
        if 6 * skin.faces().len() > MAX_TETS {
            return Err(format!("a skin of {} faces is too large, at most 2^28 / 6 are allowed", skin.faces().len()));
        }
        Shell::of_cuts(skin, cuts(skin, &ShellParams { most_tets: params.most_tets.min(MAX_TETS), ..*params }))
    }

    /// Builds the shell of `skin` with these cuts, see [`Shell::new`].
    ///
    /// # Errors
    /// As [`Shell::refresh`].
    pub(super) fn of_cuts(skin: &Skin, cuts: Cuts) -> Result<Shell, String> {
        let mut builder = Builder::new(skin, cuts);
        for face in skin.faces() {
            builder.add_face(face);
        }
        let Builder { columns: [places, coordinates], mut tets, repeated, .. } = builder;
        let ambiguous = link(&mut tets);
        let mut shell = Shell {
            layers: cuts.layers,
            skin_vertices: skin.vertices().len(),
            columns: [places.columns, coordinates.columns],
            positions: Vec::new(),
            textures: Vec::new(),
            boundary: boundary_of(&tets),
            tets,
            report: ShellReport::default(),
        };
        shell.refresh(skin)?;
        shell.report = ShellReport {
            ambiguous,
            repeated,
            sides: cuts.sides,
            layers: cuts.layers,
            deviation: cuts.deviation,
            ..shell.counted()
        };
        Ok(shell)
    }

    /// Moves the shell to where `skin` has gone: the one that it was made of, with other positions, height vectors and
    /// texture coordinates, as jitter and wind return it. Tetrahedra, neighbours and boundary stay. Cost: a pass over
    /// the positions.
    ///
    /// # Errors
    /// A sentence if the skin has another number of vertices.
    pub fn refresh(&mut self, skin: &Skin) -> Result<(), String> {
        if skin.vertices().len() != self.skin_vertices {
            return Err(format!(
                "the shell was made of a skin with {} vertices and this one has {}; make a new shell",
                self.skin_vertices,
                skin.vertices().len()
            ));
        }
        let [places, coordinates] = &self.columns;
        raise(&mut self.positions, places, self.layers, |i| {
            let vertex = &skin.vertices()[i as usize];
            (vertex.position, vertex.height)
        });
        raise(&mut self.textures, coordinates, self.layers, |i| {
            let vertex = &skin.vertices()[i as usize];
            (vertex.texture, vertex.rise)
        });
        Ok(())
    }

    /// Returns all positions, world units.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// Returns all texture coordinates (u, v, w), texels.
    pub fn textures(&self) -> &[Vec3] {
        &self.textures
    }

    /// Returns all tetrahedra.
    pub fn tets(&self) -> &[Tet] {
        &self.tets
    }

    /// Returns the boundary: for each of its triangles, 4 x the tetrahedron behind it + the number of its face.
    pub fn boundary(&self) -> &[u32] {
        &self.boundary
    }

    /// Returns the position numbers of a face, given as a link, counter-clockwise from outside its tetrahedron.
    pub fn face(&self, link: u32) -> [u32; 3] {
        let tet = &self.tets[link as usize / 4];
        FACES[link as usize % 4].map(|corner| tet.positions[corner])
    }

    /// Returns the corners of a triangle of the boundary, counter-clockwise from outside.
    pub fn boundary_triangle(&self, boundary: usize) -> [Vec3; 3] {
        self.face(self.boundary[boundary]).map(|i| self.positions[i as usize])
    }

    /// Returns the corners of all triangles of the boundary, three of each.
    pub fn boundary_corners(&self) -> impl Iterator<Item = Vec3> {
        (0..self.boundary.len()).flat_map(|i| self.boundary_triangle(i))
    }

    /// Returns what the shell was like when it was made.
    pub fn report(&self) -> ShellReport {
        self.report
    }

    /// Returns the width of a texel in the world: that of its longest side, on average over the texels. Cost: a pass over the tetrahedra.
    pub(super) fn texel_width(&self) -> f32 {
        let edges = |[p, q, r, s]: [DVec3; 4]| DMat3::from_cols(q - p, r - p, s - p);
        let (mut sum, mut texels) = (0.0, 0.0);
        for tet in &self.tets {
            let texture = edges(tet.textures.map(|i| self.textures[i as usize].as_dvec3()));
            let sides = edges(self.corners(tet)) * texture.inverse();
            let longest = [sides.x_axis, sides.y_axis, sides.z_axis].map(DVec3::length).into_iter().fold(0.0, f64::max);
            if longest.is_finite() {
                let own = texture.determinant().abs();
                (sum, texels) = (sum + own * longest, texels + own);
            }
        }
        if texels > 0.0 { (sum / texels) as f32 } else { 0.0 }
    }

    /// Returns the report with the counts of now, after the shell was moved. Cost: a pass over the tetrahedra.
    pub fn counted(&self) -> ShellReport {
        let mut report = ShellReport { tets: self.tets.len(), boundary: self.boundary.len(), ..self.report };
        (report.inverted, report.flat) = (0, 0);
        for tet in &self.tets {
            let volume = self.volume_share(tet);
            if volume.abs() <= MIN_VOLUME {
                report.flat += 1;
            } else if volume < 0.0 {
                report.inverted += 1;
            }
        }
        report
    }

    /// Finds a tetrahedron around `point` that is not turned over, if there is one: where an eye inside the skin
    /// starts. Cost: a pass over the tetrahedra.
    pub fn locate(&self, point: Vec3) -> Option<u32> {
        let point = point.as_dvec3();
        let is_around = |tet: &Tet| {
            let p = self.corners(tet);
            FACES.iter().all(|[a, b, c]| (p[*b] - p[*a]).cross(p[*c] - p[*a]).dot(point - p[*a]) <= 0.0)
                && self.volume_share(tet) > MIN_VOLUME
        };
        self.tets.iter().position(is_around).map(|tet| tet as u32)
    }

    fn corners(&self, tet: &Tet) -> [DVec3; 4] {
        tet.positions.map(|i| self.positions[i as usize].as_dvec3())
    }

    /// Returns the signed share of the box of its edges that a tetrahedron fills; 0 where an edge has no length.
    fn volume_share(&self, tet: &Tet) -> f64 {
        let [p, q, r, s] = self.corners(tet);
        let [a, b, c] = [q - p, r - p, s - p].map(|edge| edge.normalize_or_zero());
        a.cross(b).dot(c)
    }

    /// Returns the tetrahedra for tests that break them.
    #[cfg(test)]
    pub(super) fn tets_mut(&mut self) -> &mut [Tet] {
        &mut self.tets
    }
}

/// Returns the points of `columns` at every layer: `at` gives what a skin vertex has at the bottom, and what the top
/// adds.
fn raise(points: &mut Vec<Vec3>, columns: &[Column], layers: u32, at: impl Fn(u32) -> (Vec3, Vec3)) {
    points.clear();
    for Column { vertices, weights } in columns {
        let (mut bottom, mut rise) = (Vec3::ZERO, Vec3::ZERO);
        for (vertex, weight) in vertices.iter().zip(weights) {
            let (of_vertex, rise_of_vertex) = at(*vertex);
            bottom += *weight * of_vertex;
            rise += *weight * rise_of_vertex;
        }
        points.extend((0..=layers).map(|layer| bottom + (layer as f32 / layers as f32) * rise));
    }
}

/// Columns by the vertices that they lie between, so that faces share those on their edges.
#[derive(Default)]
struct ColumnTable {
    columns: Vec<Column>,
    numbers: HashMap<[[u32; 2]; 4], u32>,
}

impl ColumnTable {
    /// Returns the number of the column with these vertices and weights; vertices may repeat.
    fn number(&mut self, vertices: [u32; 4], weights: [u32; 4]) -> u32 {
        const NONE: [u32; 2] = [u32::MAX, 0];
        let mut key = [NONE; 4];
        for (vertex, weight) in vertices.into_iter().zip(weights).filter(|(_, weight)| *weight > 0) {
            // The vertex itself, or the first free place.
            if let Some(place) = key.iter_mut().find(|place| [vertex, u32::MAX].contains(&place[0])) {
                *place = [vertex, place[1] + weight];
            }
        }
        key.sort_unstable();
        let divisor = key.iter().fold(0, |divisor, place| greatest_common_divisor(divisor, place[1]));
        key.iter_mut().for_each(|place| place[1] /= divisor.max(1));
        let columns = &mut self.columns;
        *self.numbers.entry(key).or_insert_with(|| {
            let sum: u32 = key.iter().map(|place| place[1]).sum();
            let first = key[0][0];
            columns.push(Column {
                vertices: key.map(|[vertex, weight]| if weight > 0 { vertex } else { first }),
                weights: key.map(|[_, weight]| (f64::from(weight) / f64::from(sum)) as f32),
            });
            columns.len() as u32 - 1
        })
    }
}

fn greatest_common_divisor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

struct Builder<'a> {
    skin: &'a Skin,
    cuts: Cuts,
    /// Welded corners of the faces so far, in order.
    seen: HashSet<Vec<u32>>,
    repeated: usize,
    lattices: [Lattice; 3],
    columns: [ColumnTable; 2],
    tets: Vec<Tet>,
}

impl Builder<'_> {
    fn new(skin: &Skin, cuts: Cuts) -> Builder<'_> {
        Builder {
            skin,
            cuts,
            seen: HashSet::new(),
            repeated: 0,
            lattices: [Diagonal::None, Diagonal::FromFirst, Diagonal::FromSecond]
                .map(|diagonal| Lattice::new(diagonal, cuts.sides)),
            columns: Default::default(),
            tets: Vec::new(),
        }
    }

    fn add_face(&mut self, face: &SkinFace) {
        let indices = face.corners.indices();
        let mut corners: Vec<u32> = indices.iter().map(|i| self.skin.welded()[*i as usize]).collect();
        corners.sort_unstable();
        if !self.seen.insert(corners) {
            self.repeated += 1;
            return;
        }
        let vertices = [0, 1, 2, 3].map(|corner: usize| indices[corner.min(indices.len() - 1)]);
        // Decided over welded vertices, so that it does not depend on which of a seam's vertices a face has.
        let welded = vertices.map(|i| self.skin.welded()[i as usize]);
        let for_diagonal = match face.corners {
            Corners::Triangle(_) => face.corners,
            Corners::Patch(_) => Corners::Patch(welded),
        };
        let lattice = &self.lattices[diagonal(self.skin.vertices(), for_diagonal) as usize];
        let [places, coordinates] = &mut self.columns;
        let columns: Vec<[u32; 2]> = lattice
            .points
            .iter()
            .map(|point| {
                let weights = weights(face.corners, *point, self.cuts.sides);
                [places.number(welded, weights), coordinates.number(vertices, weights)]
            })
            .collect();
        let upright = orientation(self.skin.vertices(), face.corners) > 0.0;
        let layers = self.cuts.layers;
        for triangle in &lattice.triangles {
            let mut corners = triangle.map(|point| columns[point as usize]);
            let is_even = sort_three(&mut corners);
            for layer in 0..layers {
                let point = |corner: usize| {
                    corners[corner % 3].map(|column| column * (layers + 1) + layer + u32::from(corner >= 3))
                };
                for mut tet in PRISM {
                    if is_even != upright {
                        tet.swap(2, 3);
                    }
                    self.tets.push(Tet {
                        positions: tet.map(|corner| point(corner)[0]),
                        links: [NO_LINK; 4],
                        textures: tet.map(|corner| point(corner)[1]),
                        pattern: face.pattern,
                    });
                }
            }
        }
    }
}

/// Sorts, and returns whether that took an even number of exchanges.
fn sort_three(values: &mut [[u32; 2]; 3]) -> bool {
    let mut is_even = true;
    for (i, j) in [(0, 1), (1, 2), (0, 1)] {
        if values[i] > values[j] {
            values.swap(i, j);
            is_even = !is_even;
        }
    }
    is_even
}

/// Links faces with equal positions; tells how many had more than two tetrahedra, which stay unlinked.
fn link(tets: &mut [Tet]) -> usize {
    let mut faces: Vec<([u32; 3], u32)> = Vec::with_capacity(4 * tets.len());
    for (number, tet) in (0..).zip(tets.iter()) {
        for (face, corners) in (0..).zip(FACES) {
            let mut positions = corners.map(|corner| tet.positions[corner]);
            positions.sort_unstable();
            faces.push((positions, 4 * number + face));
        }
    }
    faces.sort_unstable();
    let mut ambiguous = 0;
    for group in faces.chunk_by(|a, b| a.0 == b.0) {
        match group {
            [(_, a), (_, b)] => {
                tets[*a as usize / 4].links[*a as usize % 4] = *b;
                tets[*b as usize / 4].links[*b as usize % 4] = *a;
            }
            [_] => {}
            _ => ambiguous += group.len(),
        }
    }
    ambiguous
}

/// Returns all faces without a link.
fn boundary_of(tets: &[Tet]) -> Vec<u32> {
    let faces = tets.iter().flat_map(|tet| tet.links).zip(0..);
    faces.filter(|(link, _)| *link == NO_LINK).map(|(_, face)| face).collect()
}

#[cfg(test)]
mod tests {
    use super::super::testing::{grid, twisted};
    use super::super::thick_skin::SkinVertex;
    use super::*;
    use crate::scene::mesh;

    /// Returns the number of wrong links of a shell.
    fn faults(shell: &Shell) -> usize {
        let links = shell.tets().iter().flat_map(|tet| tet.links).zip(0u32..);
        let wrong = links.filter(|(link, face)| {
            *link != NO_LINK && {
                let back = shell.tets()[*link as usize / 4].links[*link as usize % 4];
                let sorted = |link: u32| {
                    let mut positions = shell.face(link);
                    positions.sort_unstable();
                    positions
                };
                back != *face || sorted(*link) != sorted(*face)
            }
        });
        wrong.count()
    }

    /// Volume of all tetrahedra, and within the boundary.
    fn volumes(shell: &Shell) -> [f64; 2] {
        let of_tets = shell.tets().iter().map(|tet| {
            let [p, q, r, s] = shell.corners(tet);
            (q - p).cross(r - p).dot(s - p) / 6.0
        });
        let of_boundary = (0..shell.boundary().len()).map(|i| {
            let [a, b, c] = shell.boundary_triangle(i).map(|p| p.as_dvec3());
            a.cross(b).dot(c) / 6.0
        });
        [of_tets.sum(), of_boundary.sum()]
    }

    #[test]
    fn tetrahedra_fill_the_boundary_and_neighbours_agree() {
        for tolerance in [1.0, 0.01, 0.001] {
            for skin in [grid(5, 3), twisted(4)] {
                let mut shell = Shell::new(&skin, &ShellParams { tolerance, ..ShellParams::default() }).unwrap();
                let report = shell.report();
                assert_eq!((report.inverted, report.flat, report.ambiguous, faults(&shell)), (0, 0, 0, 0));
                let [tets, boundary] = volumes(&shell);
                assert!((tets / boundary - 1.0).abs() < 1e-5, "{tets} {boundary}");
                // Planted: a link that leads elsewhere.
                shell.tets_mut()[1].links.swap(0, 1);
                assert!(faults(&shell) > 0);
            }
        }
    }

    #[test]
    fn a_closed_mesh_has_a_shell_without_sides_and_seams_are_no_ends() {
        for (part, triangles) in [(mesh::cube("cube"), 12), (mesh::sphere(), 2 * 192 * 95)] {
            let skin = Skin::from_mesh(&part.vertices, &part.triangles, 0.2, 0).unwrap();
            let shell = Shell::new(&skin, &ShellParams { tolerance: 10.0, ..ShellParams::default() }).unwrap();
            assert_eq!((shell.tets().len(), shell.boundary().len()), (3 * triangles, 2 * triangles), "{}", part.name);
            assert_eq!((faults(&shell), shell.report().inverted), (0, 0));
        }
        // Planted: with a height of its own a corner is one no more.
        let part = mesh::cube("cube");
        let skin = Skin::from_mesh(&part.vertices, &part.triangles, 0.2, 0).unwrap();
        let mut vertices = skin.vertices().to_vec();
        vertices[0].height *= 1.1;
        let torn = Skin::new(vertices, skin.faces().to_vec()).unwrap();
        let shell = Shell::new(&torn, &ShellParams { tolerance: 10.0, ..ShellParams::default() }).unwrap();
        assert!(shell.boundary().len() > 24);
    }

    #[test]
    fn neighbours_agree_whatever_the_order_of_their_corners() {
        let (skin, params) = (grid(4, 4), ShellParams { tolerance: 0.003, ..ShellParams::default() });
        let straight = Shell::new(&skin, &params).unwrap();
        let turned = (0..).zip(skin.faces()).map(|(number, face): (usize, _)| {
            let Corners::Patch(mut four) = face.corners else { unreachable!() };
            four.rotate_left(number % 4);
            if number % 3 == 0 {
                four.reverse();
            }
            // Every fifth patch as two triangles.
            match number % 5 {
                0 => {
                    vec![Corners::Triangle([four[0], four[1], four[2]]), Corners::Triangle([four[0], four[2], four[3]])]
                }
                _ => vec![Corners::Patch(four)],
            }
        });
        let faces = turned.flatten().map(|corners| SkinFace { corners, pattern: 0 }).collect();
        let shell = Shell::new(&Skin::new(skin.vertices().to_vec(), faces).unwrap(), &params).unwrap();
        assert_eq!(shell.report().inverted, 0);
        assert_eq!((faults(&shell), shell.boundary().len()), (0, straight.boundary().len()));
        assert!((volumes(&shell)[0] / volumes(&straight)[0] - 1.0).abs() < 0.02);
    }

    #[test]
    fn repeated_faces_count_once_and_ambiguous_sides_are_boundary() {
        let corner = |x: f32, y: f32, z: f32| SkinVertex::new(Vec3::new(x, y, z), Vec3::new(0.0, 1.0, 0.2), [x, z]);
        let vertices = vec![
            corner(0.0, 0.0, 0.0),
            corner(1.0, 0.0, 0.0),
            corner(0.5, 0.0, 1.0),
            corner(0.5, 0.0, -1.0),
            corner(0.5, -1.0, 0.1),
        ];
        let triangle = |corners| SkinFace { corners: Corners::Triangle(corners), pattern: 0 };
        let faces = vec![triangle([0, 1, 2]), triangle([1, 2, 0]), triangle([0, 1, 3]), triangle([0, 1, 4])];
        let shell = Shell::new(&Skin::new(vertices, faces).unwrap(), &ShellParams::default()).unwrap();
        assert_eq!(shell.report().repeated, 1);
        assert!(shell.report().ambiguous >= 6);
        assert_eq!(faults(&shell), 0);
    }

    #[test]
    fn folded_skins_are_counted_and_points_are_found() {
        let mut skin = grid(6, 6);
        let shell = Shell::new(&skin, &ShellParams::default()).unwrap();
        let inside = Vec3::new(2.3, 3.4, 0.5);
        let tet = shell.locate(inside).unwrap();
        assert!(shell.corners(&shell.tets()[tet as usize]).iter().all(|p| p.distance(inside.as_dvec3()) < 2.5));
        assert_eq!(shell.locate(Vec3::new(2.3, 3.4, 7.0)), None);
        // Height vectors that lean against each other far below their top.
        skin = skin.with_vertices(|vertex| {
            let lean = 3.0 * (if vertex.position.x < 3.0 { Vec3::X } else { Vec3::NEG_X });
            SkinVertex { height: vertex.height + lean, ..*vertex }
        });
        let folded = Shell::new(&skin, &ShellParams::default()).unwrap();
        assert!(folded.report().inverted > 0 && folded.report().inverted < folded.tets().len());
    }

    #[test]
    fn a_refreshed_shell_is_that_of_the_moved_skin() {
        let skin = grid(5, 4);
        let params = ShellParams { tolerance: 0.02, ..ShellParams::default() };
        let mut shell = Shell::new(&skin, &params).unwrap();
        let moved = skin.with_vertices(|vertex| SkinVertex {
            height: vertex.height * 1.25,
            texture: vertex.texture + Vec3::X,
            ..*vertex
        });
        let (before, topology) = (shell.positions().to_vec(), shell.tets().to_vec());
        shell.refresh(&moved).unwrap();
        assert_eq!(shell.tets(), topology);
        assert_ne!(shell.positions(), before);
        let anew = Shell::new(&moved, &params).unwrap();
        assert_eq!(anew.report().sides, shell.report().sides);
        assert_eq!((shell.positions(), shell.textures()), (anew.positions(), anew.textures()));
        assert!(shell.refresh(&grid(5, 5)).unwrap_err().contains("make a new shell"));
    }
}
