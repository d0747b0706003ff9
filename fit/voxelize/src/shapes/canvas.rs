//! Canvas that shapes are painted on: voxels of microflakes over the box of a script, and the triangles that rays meet
//! there.

use btf_models::shapes::Space;
use glam::{DVec2, DVec3, Vec3};

use super::brush::{Brush, Coat};
use crate::build::clip::{Polygon, clip_polygon};
use crate::build::gather::VoxelSums;
use crate::model::microflakes::MicroflakeSums;

/// Share of a closed surface's area that counts: a ray that passes a body crosses two of its faces and is stopped once.
pub const CLOSED: f64 = 0.5;

/// Periods of a cyclic space that one thing may cover at most.
const MAX_PERIODS: f64 = 64.0;

/// A triangle in metres, with texture coordinates where it has some.
#[derive(Debug, Clone, Copy)]
pub struct Facet {
    /// Corners in metres, counterclockwise.
    pub corners_m: [DVec3; 3],
    /// Texture coordinates at the corners.
    pub uvs: Option<[DVec2; 3]>,
}

impl Facet {
    /// Returns twice the area along the normal.
    fn across(&self) -> DVec3 {
        let [a, b, c] = self.corners_m;
        (b - a).cross(c - a)
    }

    /// Returns the texture coordinates at a place of the triangle.
    fn uv(&self, place_m: DVec3) -> Option<DVec2> {
        let [a, b, c] = self.corners_m.map(|corner| corner - place_m);
        let across = self.across();
        let weight = |p: DVec3, q: DVec3| p.cross(q).dot(across) / across.length_squared();
        self.uvs.map(|uvs| uvs[0] * weight(b, c) + uvs[1] * weight(c, a) + uvs[2] * weight(a, b))
    }
}

/// Voxels over a script's space. The unit cube is as large as the space's longest side; the space lies at its origin.
#[derive(Debug, Clone)]
pub struct Canvas {
    space: Space,
    resolution: u32,
    /// Side of the cube in metres.
    pub side_m: f64,
    /// Microflakes in the finest voxels; areas in units of the cube's face.
    pub voxels: VoxelSums,
    /// Triangles that rays meet in the unit cube.
    pub triangles: Vec<[Vec3; 3]>,
    /// Coat of each of the triangles.
    pub coats: Vec<Coat>,
    /// Whether there are fields, which rays do not meet.
    pub has_fields: bool,
}

impl Canvas {
    /// Returns an empty canvas of `resolution` voxels along the longest side.
    pub fn new(space: &Space, resolution: u32) -> Canvas {
        let side_m = (0..3).map(|k| space.most_m[k] - space.least_m[k]).fold(0.0, f64::max);
        Canvas {
            space: space.clone(),
            resolution,
            side_m,
            voxels: VoxelSums::new(),
            triangles: Vec::new(),
            coats: Vec::new(),
            has_fields: false,
        }
    }

    /// Returns a canvas of the same space without anything on it.
    pub fn blank(&self) -> Canvas {
        Canvas::new(&self.space, self.resolution)
    }

    /// Returns the space.
    pub fn space(&self) -> &Space {
        &self.space
    }

    /// Returns the part of the unit cube that the space takes.
    pub fn extent(&self) -> DVec3 {
        (DVec3::from(self.space.most_m) - DVec3::from(self.space.least_m)) / self.side_m
    }

    /// Returns the corner of the space's least coordinates, in metres.
    pub fn least_m(&self) -> DVec3 {
        self.space.least_m.into()
    }

    /// Returns the corner of the space's greatest coordinates, in metres.
    pub fn most_m(&self) -> DVec3 {
        self.space.most_m.into()
    }

    /// Tells whether the space is one period along x and along y.
    pub fn cyclic(&self) -> [bool; 2] {
        self.space.cyclic
    }

    /// Returns the side of a voxel in metres.
    pub fn voxel_m(&self) -> f64 {
        self.side_m / f64::from(self.resolution)
    }

    /// Returns the number of voxels along the longest side.
    pub fn resolution(&self) -> u32 {
        self.resolution
    }

    /// Tells whether something between two corners, in metres, covers no more periods of a cyclic space than is
    /// sensible.
    pub fn holds(&self, least_m: DVec3, most_m: DVec3) -> bool {
        let size_m = self.most_m() - self.least_m();
        (0..2).all(|k| !self.space.cyclic[k] || most_m[k] - least_m[k] <= MAX_PERIODS * size_m[k])
    }

    /// Converts a place from metres to voxels.
    pub fn grid_from_m(&self, place_m: DVec3) -> DVec3 {
        (place_m - self.least_m()) / self.voxel_m()
    }

    /// Converts a place from voxels to metres.
    pub fn m_from_grid(&self, place: DVec3) -> DVec3 {
        self.least_m() + place * self.voxel_m()
    }

    /// Returns the space's greatest corner in voxels.
    pub fn size(&self) -> DVec3 {
        self.extent() * f64::from(self.resolution)
    }

    /// Calls `each` with every shift, in voxels, that brings something between two corners onto the canvas.
    pub fn each_copy(&self, least: DVec3, most: DVec3, mut each: impl FnMut(DVec3)) {
        let size = self.size();
        let range = |k: usize| match k < 2 && self.space.cyclic[k] {
            true => ((least[k] / size[k]).floor() as i64, (most[k] / size[k]).floor() as i64),
            // What touches the canvas.
            false if most[k] >= 0.0 && least[k] <= size[k] => (0, 0),
            false => (1, 0),
        };
        let [x, y, z] = [0, 1, 2].map(range);
        if z.0 > z.1 {
            return;
        }
        for i in x.0..=x.1 {
            for j in y.0..=y.1 {
                each(-DVec3::new(i as f64, j as f64, 0.0) * size.with_z(0.0));
            }
        }
    }

    /// Adds microflakes of one sort to a voxel. Beyond the end of the canvas they go to the last voxel.
    pub fn add(&mut self, cell: [i32; 3], microflakes: &MicroflakeSums) {
        let cells = self.size().ceil().as_ivec3().to_array();
        let inside: [u32; 3] = std::array::from_fn(|k| cell[k].clamp(0, cells[k] - 1) as u32);
        self.voxels.entry(inside).or_default().add(microflakes);
    }

    /// Paints a triangle, of whose area `weight` counts.
    pub fn facet(&mut self, facet: &Facet, weight: f64, brush: &Brush) {
        let normal = facet.across().normalize_or_zero();
        if normal == DVec3::ZERO {
            return;
        }
        let resolution = self.resolution as f32;
        let scale = weight as f32 * 0.5 / (resolution * resolution);
        for (polygon, shift) in self.occlude(facet, brush) {
            clip_polygon(polygon, &mut |cell, piece| {
                let corners = piece.corners();
                let middle = corners.iter().sum::<Vec3>() / corners.len().max(1) as f32;
                let place_m = self.m_from_grid(middle.as_dvec3() - shift);
                let area = piece.double_area().length() * scale;
                self.add(
                    cell,
                    &MicroflakeSums::microflake(area, normal.as_vec3(), &brush.colour(place_m, facet.uv(place_m))),
                );
            });
        }
    }

    /// Adds a triangle that rays meet, without microflakes. Returns its parts on the canvas in voxels, with the shifts
    /// that brought them there.
    pub fn occlude(&mut self, facet: &Facet, brush: &Brush) -> Vec<(Polygon, DVec3)> {
        let corners = facet.corners_m.map(|corner| self.grid_from_m(corner));
        let (least, most) = (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
        let (size, resolution) = (self.size().as_vec3(), self.resolution as f32);
        let mut parts = Vec::with_capacity(1);
        self.each_copy(least, most, |shift| {
            let polygon = Polygon::triangle(corners.map(|corner| (corner + shift).as_vec3())).within(Vec3::ZERO, size);
            parts.push((polygon, shift));
        });
        for (polygon, shift) in &parts {
            let fan = polygon.corners();
            for i in 2..fan.len() {
                let triangle = [fan[0], fan[i - 1], fan[i]];
                let place_m = self.m_from_grid((triangle.iter().sum::<Vec3>() / 3.0).as_dvec3() - *shift);
                self.triangles.push(triangle.map(|corner| corner / resolution));
                self.coats.push(brush.coat(place_m, facet.uv(place_m)));
            }
        }
        parts
    }

    /// Calls `each(cell, from, to)` for the shares of a segment, in metres, that lie in each voxel, copies included.
    pub fn each_piece(&self, ends_m: [DVec3; 2], mut each: impl FnMut([i32; 3], f64, f64)) {
        let [a, b] = ends_m.map(|end| self.grid_from_m(end));
        let size = self.size();
        self.each_copy(a.min(b), a.max(b), |shift| {
            let (start, along) = (a + shift, b - a);
            let (mut enter, mut leave) = (0.0f64, 1.0f64);
            for k in 0..3 {
                let ends = if along[k] == 0.0 {
                    if (0.0..=size[k]).contains(&start[k]) { [0.0, 1.0] } else { [1.0, 0.0] }
                } else {
                    let at = [-start[k] / along[k], (size[k] - start[k]) / along[k]];
                    [at[0].min(at[1]), at[0].max(at[1])]
                };
                (enter, leave) = (enter.max(ends[0]), leave.min(ends[1]));
            }
            if enter >= leave {
                return;
            }
            // Where planes between voxels are crossed.
            let mut cuts = vec![enter, leave];
            for k in 0..3 {
                let [from, to] = [start[k] + along[k] * enter, start[k] + along[k] * leave];
                let (low, high) = (from.min(to), from.max(to));
                for plane in low.ceil() as i64..=high.floor() as i64 {
                    let at = (plane as f64 - start[k]) / along[k];
                    if at > enter && at < leave {
                        cuts.push(at);
                    }
                }
            }
            cuts.sort_by(f64::total_cmp);
            for pair in cuts.windows(2) {
                if pair[1] > pair[0] {
                    let middle = start + along * (0.5 * (pair[0] + pair[1]));
                    each(middle.floor().as_ivec3().to_array(), pair[0], pair[1]);
                }
            }
        });
    }

    /// Returns the area of all microflakes in square metres.
    pub fn area_m2(&self) -> f64 {
        self.voxels.values().map(|sums| f64::from(sums.all().area)).sum::<f64>() * self.side_m * self.side_m
    }
}
