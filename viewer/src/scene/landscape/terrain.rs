//! Land of bilinear patches: its height, the thick skin over it, and the ground below that.

use crate::geometry::geometry::Vertex;
use crate::scene::mesh::{MeshPart, tangent_of};
use crate::volume::skin::{Corners, Noise, Skin, SkinVertex};
use btf_models::DiffuseColour;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Each patch of the ground is cut so often along a side: its triangles follow the bilinear patch.
const CUTS: u32 = 4;
/// How far the ground goes on beyond the land: nothing is seen through so much air.
const BEYOND_M: f32 = 40_000.0;
/// Factor from each line of the ground beyond the land to the next one, in distance from the middle.
const WIDENING: f32 = 1.12;
/// Hills beyond the land: how far from its border they are as high as they get, their wavelength and their height.
const HILLS_M: [[f32; 3]; 3] = [[500.0, 260.0, 12.0], [2_500.0, 1_300.0, 90.0], [12_000.0, 5_000.0, 700.0]];
/// Over which share of a patch the slope is measured.
const SLOPE_STEP: f32 = 0.1;

/// Land around the origin: x to the east, z to the south, y up, metres.
pub(super) struct Terrain {
    /// From west to east and from south to north.
    pub size_m: Vec2,
    /// Patches along both.
    pub patches: [u32; 2],
    /// Height at metres east and north of the middle.
    pub height_m: Box<dyn Fn(Vec2) -> f32 + Sync>,
}

impl Terrain {
    /// Makes land of `patches` times `times` in number, and as much more land: the factors of `times` that are nearest
    /// to a square, the larger one from west to east.
    pub fn times(
        patches: [u32; 2],
        patch_m: Vec2,
        times: u32,
        height_m: impl FnOnce(Vec2) -> Box<dyn Fn(Vec2) -> f32 + Sync>,
    ) -> Terrain {
        let northwards = (1..=times).filter(|n| times.is_multiple_of(*n) && n * n <= times).max().unwrap_or(1);
        let patches = [patches[0] * (times / northwards), patches[1] * northwards];
        let size_m = patch_m * Vec2::from(patches.map(|count| count as f32));
        Terrain { size_m, patches, height_m: height_m(size_m) }
    }

    /// Returns the place on the land above a point.
    pub fn at(&self, east_north: Vec2) -> Vec3 {
        Vec3::new(east_north.x, (self.height_m)(east_north), -east_north.y)
    }

    /// Returns the place on the ground above a point: that of the patches, and of the hills beyond them.
    pub fn on_ground(&self, east_north: Vec2) -> Vec3 {
        Vec3::new(east_north.x, self.bilinear_height(east_north) + self.rise(east_north), -east_north.y)
    }

    /// Returns the normal of the land at a point.
    pub fn normal(&self, east_north: Vec2) -> Vec3 {
        let step = SLOPE_STEP * (self.size_m / self.patch_counts()).min_element();
        let slope = |along: Vec2| self.at(east_north + along * step) - self.at(east_north - along * step);
        slope(Vec2::X).cross(slope(Vec2::Y)).normalize()
    }

    /// Returns the middle of a patch as metres east and north of the land's middle.
    pub fn middle(&self, [column, row]: [u32; 2]) -> Vec2 {
        ((Vec2::new(column as f32, row as f32) + 0.5) / self.patch_counts() - 0.5) * self.size_m
    }

    /// Returns all patches, by column and row, in the order of their numbers.
    pub fn all_patches(&self) -> impl Iterator<Item = [u32; 2]> {
        let [columns, rows] = self.patches;
        (0..rows).flat_map(move |row| (0..columns).map(move |column| [column, row]))
    }

    /// Returns a corner of patches as metres east and north of the middle.
    fn corner(&self, column: u32, row: u32) -> Vec2 {
        let share = Vec2::new(column as f32 / self.patches[0] as f32, row as f32 / self.patches[1] as f32);
        (share - 0.5) * self.size_m
    }

    /// Makes the thick skin over the land, `texels` from west to east and from south to north; `height` gives the
    /// height vectors, `pattern` the pattern of each patch by its number, none where there is no skin.
    ///
    /// # Errors
    /// The errors of [`Skin::new`].
    pub fn skin(
        &self,
        texels: [f32; 2],
        height: impl Fn(Vec2) -> Vec3,
        pattern: impl Fn(usize) -> Option<u32>,
    ) -> Result<Skin, String> {
        const NO_SKIN: u32 = u32::MAX;
        let [columns, rows] = self.patches;
        let per_patch = [texels[0] / columns as f32, texels[1] / rows as f32];
        let vertex = |column: u32, row: u32| {
            let place = self.corner(column, row);
            let uv = [column as f32 * per_patch[0], row as f32 * per_patch[1]];
            SkinVertex::new(self.at(place), height(place), uv)
        };
        let skin = Skin::from_grid(columns, rows, vertex, |column, row| {
            pattern((row * columns + column) as usize).unwrap_or(NO_SKIN)
        })?;
        if skin.faces().iter().all(|face| face.pattern != NO_SKIN) {
            return Ok(skin);
        }
        let covered = skin.faces().iter().filter(|face| face.pattern != NO_SKIN).copied();
        Skin::new(skin.vertices().to_vec(), covered.collect())
    }

    /// Returns how much higher than its nearest border the land beyond lies at a point: hills that are higher the farther
    /// away they are. 0 within.
    fn rise(&self, east_north: Vec2) -> f32 {
        let beyond_m = (east_north.abs() - 0.5 * self.size_m).max(Vec2::ZERO).length();
        let mut height = 0.0;
        for (seed, [full, wavelength, height_m]) in HILLS_M.into_iter().enumerate() {
            let noise = Noise { wavelength, period: [0; 3], seed: 31 + seed as u32 };
            let hill = 0.4 + noise.at(Vec3::new(east_north.x, east_north.y, 0.3 * wavelength));
            height += height_m * smooth_step(beyond_m / full) * hill.max(0.0);
        }
        height
    }

    /// Makes the ground: the skin's base, and hills around it to the horizon.
    pub fn ground(&self, diffuse: [f32; 3]) -> MeshPart {
        let inner = self.patches.map(|count| CUTS * count);
        // Lines beyond the land on each side.
        let beyond = [0, 1].map(|axis| (2.0 * BEYOND_M / self.size_m[axis]).log(WIDENING).ceil().max(1.0) as u32);
        let [columns, rows] = [0, 1].map(|axis| inner[axis] + 1 + 2 * beyond[axis]);
        // The place of a line along an axis, and whether it is one of the land.
        let along = |line: u32, axis: usize| {
            let within = line.clamp(beyond[axis], beyond[axis] + inner[axis]) - beyond[axis];
            let out = line.abs_diff(beyond[axis] + within);
            let place = (within as f32 / inner[axis] as f32 - 0.5) * self.size_m[axis];
            (place * WIDENING.powi(out as i32), out == 0)
        };
        let row_of_places =
            |row: u32| (0..columns).map(move |column| self.on_ground(Vec2::new(along(column, 0).0, along(row, 1).0)));
        let places: Vec<Vec3> = (0..rows).into_par_iter().flat_map_iter(row_of_places).collect();
        let at = |column: u32, row: u32| places[(row * columns + column) as usize];
        let vertex = |column: u32, row: u32| {
            let position = at(column, row);
            let normal = if along(column, 0).1 && along(row, 1).1 {
                self.normal(Vec2::new(position.x, -position.z))
            } else {
                let [left, right] = [column.max(1) - 1, (column + 1).min(columns - 1)].map(|column| at(column, row));
                let [south, north] = [row.max(1) - 1, (row + 1).min(rows - 1)].map(|row| at(column, row));
                (right - left).cross(north - south).normalize()
            };
            Vertex {
                position: position.to_array(),
                u: position.x,
                normal: normal.to_array(),
                v: -position.z,
                tangent: tangent_of(normal, Vec3::X, 1.0),
            }
        };
        let row_of_vertices = |row: u32| (0..columns).map(move |column| vertex(column, row));
        let vertices = (0..rows).into_par_iter().flat_map_iter(row_of_vertices).collect();
        let triangles = (0..rows - 1).flat_map(|row| (0..columns - 1).map(move |column| row * columns + column));
        let triangles = triangles.flat_map(|first| {
            let [a, b, c, d] = [first, first + 1, first + columns + 1, first + columns];
            [[a, b, c], [a, c, d]]
        });
        MeshPart {
            name: "ground".into(),
            group: 0,
            colour: DiffuseColour::opaque(diffuse),
            has_uv: true,
            vertices,
            triangles: triangles.collect(),
        }
    }

    fn patch_counts(&self) -> Vec2 {
        Vec2::from(self.patches.map(|count| count as f32))
    }

    /// Returns the height of the bilinear patches at a point; beyond the land that of the nearest border.
    fn bilinear_height(&self, east_north: Vec2) -> f32 {
        let place = ((east_north / self.size_m + 0.5) * self.patch_counts()).clamp(Vec2::ZERO, self.patch_counts());
        let patch = place.floor().min(self.patch_counts() - 1.0);
        let [column, row] = patch.to_array().map(|x| x as u32);
        let Vec2 { x: s, y: t } = place - patch;
        let height = |column: u32, row: u32| (self.height_m)(self.corner(column, row));
        let across = |row: u32| height(column, row) * (1.0 - s) + height(column + 1, row) * s;
        across(row) * (1.0 - t) + across(row + 1) * t
    }
}

/// Rises from 0 to 1 as `share` does, level at both ends.
pub(super) fn smooth_step(share: f32) -> f32 {
    let share = share.clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}

/// Returns a noise at a point of the land, away from the lattice, where all noises are 0.
pub(super) fn over_land(noise: &Noise, east_north: Vec2) -> f32 {
    noise.at(east_north.extend(0.4 * noise.wavelength))
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
