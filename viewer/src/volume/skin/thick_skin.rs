//! The thick skin as a user maps it: faces of three or four corners with a height vector and texture coordinates at
//! each vertex [Neyret 1996, section 4.1].

use super::weld::weld;
use crate::geometry::geometry::Vertex;
use glam::Vec3;
use std::collections::HashMap;

/// Sine of the angle between a face and its mean height vector below which the face's box has no volume: some ten times
/// what rounding leaves of a right angle.
const MIN_RISE: f32 = 1e-6;
/// Cosine of the angle between two normals at one place up to which they are parts of one rounded corner: 120 degrees,
/// so that the three sides at a box's corner share a height vector and the two sides of a sheet do not.
const SAME_SIDE: f32 = -0.5;

/// A vertex of the skin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkinVertex {
    /// Position on the surface, where W = 0, world units.
    pub position: Vec3,
    /// Height vector H: `position + height` is the top, where W = 1. World units; combing leans it.
    pub height: Vec3,
    /// Texture coordinates (u, v, w) at the surface, in texels; w = 0 is the volume's floor and 1 its lid.
    pub texture: Vec3,
    /// Texture coordinates that are added at the top. Neyret's dw is its third component; the first two lean the
    /// texture without moving the skin.
    pub rise: Vec3,
}

impl SkinVertex {
    /// Returns a vertex over which the texture stands upright, once: w = 0, dw = 1.
    pub fn new(position: Vec3, height: Vec3, uv: [f32; 2]) -> SkinVertex {
        SkinVertex { position, height, texture: Vec3::new(uv[0], uv[1], 0.0), rise: Vec3::Z }
    }

    fn is_finite(&self) -> bool {
        [self.position, self.height, self.texture, self.rise].iter().all(|v| v.is_finite())
    }
}

/// Vertex numbers of a face, one after the other around it, either way round.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Corners {
    /// A triangle.
    Triangle([u32; 3]),
    /// A bilinear patch.
    Patch([u32; 4]),
}

impl Corners {
    /// Returns the vertex numbers.
    pub fn indices(&self) -> &[u32] {
        match self {
            Corners::Triangle(corners) => corners,
            Corners::Patch(corners) => corners,
        }
    }
}

/// A face of the skin; what stands over it is called its box.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SkinFace {
    /// Vertices of the face.
    pub corners: Corners,
    /// Number of the pattern that is mapped there.
    pub pattern: u32,
}

/// A thick skin whose every face has a box with a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct Skin {
    vertices: Vec<SkinVertex>,
    faces: Vec<SkinFace>,
    /// For each vertex, the number of the first one at its place with its height vector.
    welded: Vec<u32>,
    dropped: usize,
}

impl Skin {
    /// Returns a skin of `faces` over `vertices`. Faces whose boxes have no volume are left out: without an area, or
    /// with height vectors that are zero in the mean or lie in the face. A patch with two neighbouring corners at one
    /// place becomes the triangle that it is. Cost: a pass over the faces.
    ///
    /// # Errors
    /// A sentence if a number is not finite, a face names a vertex that is not there, or no face is left.
    pub fn new(vertices: Vec<SkinVertex>, faces: Vec<SkinFace>) -> Result<Skin, String> {
        if let Some(bad) = vertices.iter().position(|vertex| !vertex.is_finite()) {
            return Err(format!("vertex {bad} of the skin has a number that is not finite, correct it"));
        }
        if let Some(bad) =
            faces.iter().position(|face| face.corners.indices().iter().any(|i| *i as usize >= vertices.len()))
        {
            return Err(format!(
                "face {bad} of the skin names a vertex that is not there, there are {}",
                vertices.len()
            ));
        }
        let welded = weld(vertices.iter().map(|vertex| (vertex.position, vertex.height)));
        let given = faces.len();
        let faces: Vec<SkinFace> = faces
            .into_iter()
            .map(|face| SkinFace { corners: without_repeats(&welded, face.corners), ..face })
            .filter(|face| are_apart(&welded, face.corners) && orientation(&vertices, face.corners) != 0.0)
            .collect();
        if faces.is_empty() {
            return Err(format!(
                "none of the skin's {given} faces has a volume over it: give faces with an area, and height vectors that \
                 are neither zero nor in the face"
            ));
        }
        Ok(Skin { dropped: given - faces.len(), vertices, faces, welded })
    }

    /// Returns a skin `thickness` thick (world units; negative grows inwards) over a mesh. Height vectors follow the
    /// normals; where vertices lie at one place, as at hard edges and texture seams, they share the mean of the normals
    /// within 120 degrees of theirs, so that the skin has no gap.
    ///
    /// # Errors
    /// As [`Skin::new`].
    pub fn from_mesh(
        vertices: &[Vertex],
        triangles: &[[u32; 3]],
        thickness: f32,
        pattern: u32,
    ) -> Result<Skin, String> {
        let places = weld(vertices.iter().map(|vertex| (vertex.position.into(), Vec3::ZERO)));
        let mut at_place: HashMap<u32, Vec<Vec3>> = HashMap::new();
        for (place, vertex) in places.iter().zip(vertices) {
            at_place.entry(*place).or_default().push(vertex.normal.into());
        }
        let vertices = places.iter().zip(vertices).map(|(place, vertex)| {
            let normal = Vec3::from(vertex.normal);
            let same_side = at_place[place].iter().filter(|other| other.dot(normal) > SAME_SIDE);
            let height = same_side.copied().sum::<Vec3>().normalize_or_zero() * thickness;
            SkinVertex::new(vertex.position.into(), height, [vertex.u, vertex.v])
        });
        let faces = triangles.iter().map(|corners| SkinFace { corners: Corners::Triangle(*corners), pattern });
        Skin::new(vertices.collect(), faces.collect())
    }

    /// Returns a skin of `columns` x `rows` bilinear patches; `vertex(column, row)` tells the vertices, for columns up
    /// to and with `columns` and rows up to and with `rows`, and `pattern(column, row)` what is mapped on a patch.
    ///
    /// # Errors
    /// As [`Skin::new`], and if there would be more than 2^24 patches.
    pub fn from_grid(
        columns: u32,
        rows: u32,
        vertex: impl Fn(u32, u32) -> SkinVertex,
        pattern: impl Fn(u32, u32) -> u32,
    ) -> Result<Skin, String> {
        if u64::from(columns) * u64::from(rows) > 1 << 24 {
            return Err(format!("a skin of {columns} x {rows} patches is too large, 2^24 are allowed"));
        }
        let across = |count: u32, along: u32| (0..count).flat_map(move |y| (0..along).map(move |x| (x, y)));
        let vertices = across(rows + 1, columns + 1).map(|(x, y)| vertex(x, y)).collect();
        let faces = across(rows, columns).map(|(x, y)| {
            let first = y * (columns + 1) + x;
            let corners = [first, first + 1, first + columns + 2, first + columns + 1];
            SkinFace { corners: Corners::Patch(corners), pattern: pattern(x, y) }
        });
        Skin::new(vertices, faces.collect())
    }

    /// Returns all vertices, also those that no face uses.
    pub fn vertices(&self) -> &[SkinVertex] {
        &self.vertices
    }

    /// Returns the length of the longest height vector.
    pub fn thickness(&self) -> f32 {
        self.vertices.iter().map(|vertex| vertex.height.length()).fold(0.0, f32::max)
    }

    /// Returns all faces with a volume over them.
    pub fn faces(&self) -> &[SkinFace] {
        &self.faces
    }

    /// Returns for each vertex the number of the first one at its place with its height vector, as the skin was given;
    /// jitter, wind and layers keep what was one together.
    pub fn welded(&self) -> &[u32] {
        &self.welded
    }

    /// Counts the faces that were given and left out.
    pub fn dropped(&self) -> usize {
        self.dropped
    }

    /// Returns the same faces over moved vertices: what jitter and wind return. Faces stay even where they have lost
    /// their volume, so that a shell over them can be refreshed.
    pub(crate) fn with_vertices(&self, change: impl Fn(&SkinVertex) -> SkinVertex) -> Skin {
        // What a far too strong change makes of a vertex is not taken over.
        let change = |vertex: &SkinVertex| Some(change(vertex)).filter(SkinVertex::is_finite).unwrap_or(*vertex);
        Skin { vertices: self.vertices.iter().map(change).collect(), ..self.clone() }
    }

    /// Returns the skin with one pattern everywhere.
    pub(crate) fn with_pattern(&self, pattern: u32) -> Skin {
        let faces = self.faces.iter().map(|face| SkinFace { pattern, ..*face }).collect();
        Skin { faces, ..self.clone() }
    }
}

/// Turns a patch of which two neighbouring corners lie at one place into a triangle.
fn without_repeats(welded: &[u32], corners: Corners) -> Corners {
    let Corners::Patch(four) = corners else { return corners };
    let place = |i: usize| welded[four[i % 4] as usize];
    match (0..4).find(|i| place(*i) == place(i + 1)) {
        Some(i) => Corners::Triangle([1, 2, 3].map(|step| four[(i + step) % 4])),
        None => corners,
    }
}

/// Returns whether no two corners lie at one place.
fn are_apart(welded: &[u32], corners: Corners) -> bool {
    let places: Vec<u32> = corners.indices().iter().map(|i| welded[*i as usize]).collect();
    (1..places.len()).all(|i| !places[..i].contains(&places[i]))
}

/// Returns +1 where a face runs counter-clockwise as seen from the top of its mean height vector, -1 where clockwise, 0
/// where its box has no volume.
pub(crate) fn orientation(vertices: &[SkinVertex], corners: Corners) -> f32 {
    let vertex = |i: &u32| &vertices[*i as usize];
    let indices = corners.indices();
    let height: Vec3 = indices.iter().map(|i| vertex(i).height).sum();
    let position = |i: usize| vertex(&indices[i]).position;
    // Of a patch, its diagonals.
    let (along, across) = match corners {
        Corners::Triangle(_) => (position(1) - position(0), position(2) - position(0)),
        Corners::Patch(_) => (position(2) - position(0), position(3) - position(1)),
    };
    // In double precision, so that neither large nor small faces overflow.
    let normal = along.as_dvec3().cross(across.as_dvec3());
    let height = height.as_dvec3();
    let volume = normal.dot(height);
    let box_of_edges = along.as_dvec3().length() * across.as_dvec3().length() * height.length();
    if volume.abs() > f64::from(MIN_RISE) * box_of_edges { volume.signum() as f32 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::mesh;

    fn square() -> Vec<SkinVertex> {
        let corner = |x: f32, y: f32| SkinVertex::new(Vec3::new(x, y, 0.0), Vec3::Z, [x, y]);
        vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)]
    }

    fn patch(corners: [u32; 4]) -> SkinFace {
        SkinFace { corners: Corners::Patch(corners), pattern: 0 }
    }

    #[test]
    fn says_in_a_sentence_what_is_wrong() {
        let mut bad = square();
        bad[2].rise.z = f32::NAN;
        assert!(Skin::new(bad, vec![patch([0, 1, 2, 3])]).unwrap_err().contains("vertex 2"));
        let error = Skin::new(square(), vec![patch([0, 1, 2, 3]), patch([0, 1, 2, 4])]).unwrap_err();
        assert!(error.contains("face 1") && error.contains("there are 4"), "{error}");
        for height in [Vec3::ZERO, Vec3::X, Vec3::new(1.0, -2.0, 0.0)] {
            let flat = square().iter().map(|vertex| SkinVertex { height, ..*vertex }).collect();
            let error = Skin::new(flat, vec![patch([0, 1, 2, 3])]).unwrap_err();
            assert!(error.contains("none of the skin's 1 faces"), "{error}");
        }
        assert!(Skin::new(square(), Vec::new()).is_err());
    }

    #[test]
    fn drops_degenerate_faces_and_keeps_the_others() {
        let triangle = |corners| SkinFace { corners: Corners::Triangle(corners), pattern: 3 };
        let faces = vec![patch([0, 1, 2, 3]), triangle([0, 0, 1]), patch([0, 2, 2, 0]), triangle([0, 1, 2])];
        let skin = Skin::new(square(), faces).unwrap();
        assert_eq!((skin.faces().len(), skin.dropped()), (2, 2));
        // A patch with a repeated corner is a triangle.
        let skin = Skin::new(square(), vec![patch([0, 1, 1, 2])]).unwrap();
        assert_eq!(skin.faces()[0].corners, Corners::Triangle([1, 2, 0]));
        // So is a triangle with two corners that only rounding tells apart.
        let mut near = square();
        near.push(SkinVertex { position: near[1].position + 1e-7, ..near[1] });
        let skin = Skin::new(near, vec![triangle([0, 1, 4]), patch([0, 1, 4, 2])]).unwrap();
        assert_eq!((skin.dropped(), skin.faces()[0].corners), (1, Corners::Triangle([4, 2, 0])));
        assert_eq!(skin.welded(), [0, 1, 2, 3, 1]);
        // Tiny and huge ones are kept.
        for size in [1e-18, 1e-3, 1e5, 1e12] {
            let scaled = square().iter().map(|v| SkinVertex { position: v.position * size, ..*v }).collect();
            assert!(Skin::new(scaled, vec![patch([0, 1, 2, 3])]).is_ok(), "{size}");
        }
    }

    #[test]
    fn skins_of_meshes_have_no_gap_at_hard_edges() {
        let cube = mesh::cube("cube");
        let skin = Skin::from_mesh(&cube.vertices, &cube.triangles, 0.3, 0).unwrap();
        let mut heights: HashMap<[u32; 3], Vec3> = HashMap::new();
        for vertex in skin.vertices() {
            let height = *heights.entry(vertex.position.to_array().map(f32::to_bits)).or_insert(vertex.height);
            assert_eq!(height, vertex.height);
            assert!((height.length() - 0.3).abs() < 1e-6 && height.dot(vertex.position) > 0.5);
        }
        assert_eq!(heights.len(), 8);
        // The two sides of a sheet grow away from each other.
        let mut sheet = mesh::plane();
        let back: Vec<Vertex> =
            sheet.vertices.iter().map(|vertex| Vertex { normal: [0.0, 0.0, -1.0], ..*vertex }).collect();
        sheet.vertices.extend(back);
        let skin = Skin::from_mesh(&sheet.vertices, &[[0, 1, 2], [6, 5, 4]], 1.0, 0).unwrap();
        assert_eq!((skin.vertices()[0].height, skin.vertices()[4].height), (Vec3::Z, Vec3::NEG_Z));
    }

    #[test]
    fn a_grid_is_made_of_patches_that_face_their_height() {
        let vertex =
            |x: u32, y: u32| SkinVertex::new(Vec3::new(x as f32, y as f32, 0.0), Vec3::Z, [x as f32, y as f32]);
        let skin = Skin::from_grid(3, 2, vertex, |x, y| 10 * y + x).unwrap();
        assert_eq!((skin.vertices().len(), skin.faces().len(), skin.faces()[4].pattern), (12, 6, 11));
        assert!(skin.faces().iter().all(|face| orientation(skin.vertices(), face.corners) == 1.0));
        assert!(Skin::from_grid(1 << 13, 1 << 13, vertex, |_, _| 0).is_err());
        assert!(Skin::from_grid(0, 4, vertex, |_, _| 0).is_err());
    }
}
