//! Land of bilinear patches: its height, the thick skin over it, and the ground below that.

use crate::geometry::geometry::Vertex;
use crate::scene::mesh::{MeshPart, tangent_of};
use crate::volume::skin::{Corners, Skin, SkinVertex};
use btf_models::DiffuseColour;
use glam::{Vec2, Vec3};

/// Each patch of the ground is cut so often along a side: its triangles follow the bilinear patch.
const CUTS: u32 = 4;
/// How far the ground goes on beyond the land, in lengths of the land's longer side.
const BEYOND: f32 = 40.0;
/// Over which share of a patch the slope is measured.
const SLOPE_STEP: f32 = 0.1;

/// Land around the origin: x to the east, z to the south, y up, metres.
pub(super) struct Terrain {
    /// From west to east and from south to north.
    pub size_m: Vec2,
    /// Patches along both.
    pub patches: [u32; 2],
    /// Height at metres east and north of the middle.
    pub height_m: Box<dyn Fn(Vec2) -> f32>,
}

impl Terrain {
    /// Makes land of `patches` times `times` in number, and as much more land: the factors of `times` that are nearest
    /// to a square, the larger one from west to east.
    pub fn times(
        patches: [u32; 2],
        patch_m: Vec2,
        times: u32,
        height_m: impl FnOnce(Vec2) -> Box<dyn Fn(Vec2) -> f32>,
    ) -> Terrain {
        let northwards = (1..=times).filter(|n| times.is_multiple_of(*n) && n * n <= times).max().unwrap_or(1);
        let patches = [patches[0] * (times / northwards), patches[1] * northwards];
        let size_m = patch_m * Vec2::from(patches.map(|count| count as f32));
        Terrain { size_m, patches, height_m: height_m(size_m) }
    }

    /// Returns how many patches there are.
    pub fn count(&self) -> u32 {
        self.patches[0] * self.patches[1]
    }

    /// Returns the place on the land above a point.
    pub fn at(&self, east_north: Vec2) -> Vec3 {
        Vec3::new(east_north.x, (self.height_m)(east_north), -east_north.y)
    }

    /// Returns the normal of the land at a point.
    pub fn normal(&self, east_north: Vec2) -> Vec3 {
        let step = SLOPE_STEP * (self.size_m / self.patch_counts()).min_element();
        let slope = |along: Vec2| self.at(east_north + along * step) - self.at(east_north - along * step);
        slope(Vec2::X).cross(slope(Vec2::Y)).normalize()
    }

    /// Returns a corner of patches as metres east and north of the middle.
    fn corner(&self, column: u32, row: u32) -> Vec2 {
        let share = Vec2::new(column as f32 / self.patches[0] as f32, row as f32 / self.patches[1] as f32);
        (share - 0.5) * self.size_m
    }

    /// Makes the thick skin over the land, `texels` from west to east and from south to north; `height` gives the
    /// height vectors.
    ///
    /// # Errors
    /// The errors of [`Skin::new`].
    pub fn skin(
        &self,
        texels: [f32; 2],
        height: impl Fn(Vec2) -> Vec3,
        pattern: impl Fn(u32, u32) -> u32,
    ) -> Result<Skin, String> {
        let [columns, rows] = self.patches;
        let per_patch = [texels[0] / columns as f32, texels[1] / rows as f32];
        let vertex = |column: u32, row: u32| {
            let place = self.corner(column, row);
            let uv = [column as f32 * per_patch[0], row as f32 * per_patch[1]];
            SkinVertex::new(self.at(place), height(place), uv)
        };
        Skin::from_grid(columns, rows, vertex, pattern)
    }

    /// Makes the ground: the skin's base, and level land around it to the horizon.
    pub fn ground(&self, diffuse: [f32; 3]) -> MeshPart {
        let [columns, rows] = self.patches.map(|count| CUTS * count + 3);
        let beyond = BEYOND * self.size_m.max_element();
        // The first and the last line lie far out, at the border's height.
        let along = |line: u32, count: u32, size: f32| {
            let inner = line.saturating_sub(1).min(count - 3);
            let out = if line == 0 { -beyond } else { beyond * f32::from(line == count - 1) };
            (inner, (inner as f32 / (count - 3) as f32 - 0.5) * size + out)
        };
        let vertex = |column: u32, row: u32| {
            let (x, east) = along(column, columns, self.size_m.x);
            let (y, north) = along(row, rows, self.size_m.y);
            let height = self.bilinear_height(x, y);
            let normal =
                self.normal((Vec2::new(x as f32, y as f32) / CUTS as f32 / self.patch_counts() - 0.5) * self.size_m);
            Vertex {
                position: [east, height, -north],
                u: east,
                normal: normal.to_array(),
                v: north,
                tangent: tangent_of(normal, Vec3::X, 1.0),
            }
        };
        let vertices = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row)));
        let vertices = vertices.map(|(column, row)| vertex(column, row)).collect();
        let triangles = (0..rows - 1).flat_map(|row| (0..columns - 1).map(move |column| row * columns + column));
        let triangles = triangles.flat_map(|first| {
            let [a, b, c, d] = [first, first + 1, first + columns + 1, first + columns];
            [[a, b, c], [a, c, d]]
        });
        MeshPart {
            name: "ground".into(),
            group: 0,
            colour: DiffuseColour::opaque(diffuse),
            has_uv: false,
            vertices,
            triangles: triangles.collect(),
        }
    }

    fn patch_counts(&self) -> Vec2 {
        Vec2::from(self.patches.map(|count| count as f32))
    }

    /// Returns the height of the bilinear patches at a line of the ground's cuts.
    fn bilinear_height(&self, x: u32, y: u32) -> f32 {
        let [column, row] = [(x / CUTS).min(self.patches[0] - 1), (y / CUTS).min(self.patches[1] - 1)];
        let [s, t] = [(x - CUTS * column) as f32 / CUTS as f32, (y - CUTS * row) as f32 / CUTS as f32];
        let height = |column: u32, row: u32| (self.height_m)(self.corner(column, row));
        let across = |row: u32| height(column, row) * (1.0 - s) + height(column + 1, row) * s;
        across(row) * (1.0 - t) + across(row + 1) * t
    }
}

/// Returns how many texels a skin covers: the area of its faces in the texture, which jitter within the skin does not
/// change.
pub(super) fn texels_of(skin: &Skin) -> f64 {
    let area = |corners: &[u32]| -> f64 {
        let place = |i: usize| skin.vertices()[corners[i % corners.len()] as usize].texture.truncate().as_dvec2();
        (0..corners.len()).map(|i| 0.5 * place(i).perp_dot(place(i + 1))).sum()
    };
    skin.faces().iter().map(|face| area(face.corners.indices())).sum()
}

/// Puts the texture of what lies at the border of a grid back to where it was before jitter moved it, so that whole
/// texels stay whole.
///
/// # Errors
/// The errors of [`Skin::new`].
pub(super) fn with_border_of(moved: &Skin, rest: &Skin) -> Result<Skin, String> {
    let mut faces_at = vec![0u8; rest.vertices().len()];
    for face in rest.faces() {
        let Corners::Patch(corners) = face.corners else { continue };
        corners.iter().for_each(|corner| faces_at[*corner as usize] += 1);
    }
    // Within a grid four patches meet at a vertex.
    let vertex = |(number, vertex): (usize, &SkinVertex)| match faces_at[number] {
        4.. => *vertex,
        _ => SkinVertex { texture: rest.vertices()[number].texture, ..*vertex },
    };
    Skin::new(moved.vertices().iter().enumerate().map(vertex).collect(), moved.faces().to_vec())
}
