//! One indirect bounce: light that reaches a point by way of other points of the surface.
//!
//! `E(p) = integral over the hemisphere of L(q(w)) cos dw`, where the ray from p along w meets the surface at q and
//! `pi L(q) = albedo(q) V(q) max(0, n_q.wi)` for a lamp of unit normal irradiance. With K directions of cosine density
//! this is the mean of `albedo V cos` over the K points q: a sparse matrix of node x K, traced once per material and
//! applied once per light.
//!
//! Nodes are every [`STRIDE`]-th of the grid of heights, one per texel; each has the same spiral of directions about
//! its own normal, turned by an angle of its own.
//!
//! When it is wrong: points reflect diffusely on the way (a specular one would throw caustics that are missing here),
//! only one bounce is counted, a point q is moved to the nearest node, and rays that leave the grid count as escaped.

use rayon::prelude::*;

use crate::surface::grid::Grid;
use crate::surface::height_field::{HeightField, LightVisibility};
use crate::surface::noise::lattice_unit;
use crate::vector::dot;

/// Number of nodes of heights per bounce node and axis.
const STRIDE: usize = 2;

/// Number of directions per node.
const DIRECTIONS: usize = 48;

/// Angle from one point of the spiral to the next: the golden angle in radians.
const GOLDEN_ANGLE_RAD: f32 = 2.399_963;

/// Marker of a ray that meets nothing.
const ESCAPED: u32 = u32::MAX;

/// Transport of light from the surface to itself.
#[derive(Debug, Clone)]
pub struct Bounce {
    grid: Grid,
    /// Share of incident light that each node reflects, linear sRGB.
    albedo: Vec<[f32; 3]>,
    /// Node that the ray of each direction meets, `[node, direction]`, or [`ESCAPED`].
    met: Vec<u32>,
}

/// Light of one lamp after one bounce.
#[derive(Debug, Clone)]
pub struct BouncedLight {
    grid: Grid,
    /// Factor from cells of the grid of heights to cells of this grid.
    scale: f32,
    /// Irradiance at each node over the lamp's normal irradiance, linear sRGB.
    irradiance: Vec<[f32; 3]>,
}

impl Bounce {
    /// Traces the directions of every node over `field`, whose point at a position in millimetres reflects `albedo` of
    /// the incident light, linear sRGB. Runs in parallel; the number of threads never matters. Cost: 48 marched rays
    /// per texel.
    pub fn new(field: &HeightField, albedo: impl Fn([f32; 2]) -> [f32; 3] + Sync) -> Bounce {
        let grid = field.grid.coarse(STRIDE);
        let positions = |node: usize| grid.position_mm(node % grid.side, node / grid.side);
        let met = (0..grid.len())
            .into_par_iter()
            .flat_map_iter(|node| {
                let (column, row) = (node % grid.side, node / grid.side);
                let place = field.grid.cells(positions(node));
                let normal = field.normal_at(place);
                let turn = std::f32::consts::TAU * lattice_unit(column as i32, row as i32, 0xB0);
                (0..DIRECTIONS).map(move |i| {
                    let direction = about(normal, spiral(i, turn));
                    field.march_out(place, direction).map_or(ESCAPED, |[x, y]| {
                        let nearest = |cells: f32| ((cells / STRIDE as f32).round() as usize).min(grid.side - 1);
                        (nearest(y) * grid.side + nearest(x)) as u32
                    })
                })
            })
            .collect();
        let albedo = (0..grid.len()).into_par_iter().map(|node| albedo(positions(node))).collect();
        Bounce { grid, albedo, met }
    }

    /// Returns the bounced light of the lamp `wi`, of which `visibility` reaches `field` directly. Runs on the calling
    /// thread.
    pub(crate) fn gather(&self, field: &HeightField, visibility: &LightVisibility, wi: [f32; 3]) -> BouncedLight {
        let grid = self.grid;
        let sent: Vec<[f32; 3]> = (0..grid.len())
            .map(|node| {
                let place = field.grid.cells(grid.position_mm(node % grid.side, node / grid.side));
                let direct = dot(field.normal_at(place), wi).max(0.0)
                    * field.grid.corners(place).sample_share(&visibility.share)
                    / DIRECTIONS as f32;
                self.albedo[node].map(|c| c * direct)
            })
            .collect();
        let irradiance = self
            .met
            .chunks_exact(DIRECTIONS)
            .map(|met| {
                let mut sum = [0f32; 3];
                for &node in met {
                    if node != ESCAPED {
                        for (sum, sent) in sum.iter_mut().zip(sent[node as usize]) {
                            *sum += sent;
                        }
                    }
                }
                sum
            })
            .collect();
        BouncedLight { grid, scale: 1.0 / STRIDE as f32, irradiance }
    }

    /// Returns the size in bytes of the bounced light of one lamp.
    pub(crate) fn bytes_per_light(&self) -> usize {
        self.grid.len() * size_of::<[f32; 3]>()
    }
}

impl BouncedLight {
    /// Returns the irradiance at a place in cells of the grid of heights.
    #[inline]
    pub(crate) fn at(&self, place: [f32; 2]) -> [f32; 3] {
        self.grid.corners(place.map(|x| x * self.scale)).sample_all(&self.irradiance)
    }
}

/// Returns the direction `i` of a cosine density about z: a golden spiral over the unit disk, lifted.
fn spiral(i: usize, turn: f32) -> [f32; 3] {
    let radius2 = (i as f32 + 0.5) / DIRECTIONS as f32;
    let (sin, cos) = (i as f32 * GOLDEN_ANGLE_RAD + turn).sin_cos();
    let radius = radius2.sqrt();
    [radius * cos, radius * sin, (1.0 - radius2).sqrt()]
}

/// Returns a direction given about z, rotated to `normal` [Duff 2017]; normals point upwards here.
fn about(normal: [f32; 3], local: [f32; 3]) -> [f32; 3] {
    let a = -1.0 / (1.0 + normal[2]);
    let b = normal[0] * normal[1] * a;
    let tangent = [1.0 + normal[0] * normal[0] * a, b, -normal[0]];
    let bitangent = [b, 1.0 + normal[1] * normal[1] * a, -normal[1]];
    std::array::from_fn(|k| local[0] * tangent[k] + local[1] * bitangent[k] + local[2] * normal[k])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::height_field::tests::shaped;

    const ALBEDO: [f32; 3] = [0.8, 0.4, 0.0];

    fn bounced(field: &HeightField, wi: [f32; 3]) -> BouncedLight {
        Bounce::new(field, |_| ALBEDO).gather(field, &LightVisibility::new(field, wi), wi)
    }

    /// Returns the mean irradiance along y at one x, over nodes away from the ends of the patch.
    fn along_y(field: &HeightField, light: &BouncedLight, x: f32) -> [f32; 3] {
        let mut mean = [0.0; 3];
        for i in 0..200 {
            let e = light.at(field.grid.cells([x, 7.0 + 0.03 * i as f32]));
            for k in 0..3 {
                mean[k] += e[k] / 200.0;
            }
        }
        mean
    }

    #[test]
    fn the_faces_of_a_right_angled_groove_light_each_other_by_their_form_factors() {
        // Faces of slope 1 that meet at x = 10 and end at a rim 2 mm away, lit from the zenith.
        let reach = 2.0f32;
        let groove = shaped(|p| (p[0] - 10.0).abs().min(reach));
        let light = bounced(&groove, [0.0, 0.0, 1.0]);
        let width = reach * 2f32.sqrt();
        for away in [0.4f32, 0.8, 1.2, 1.6] {
            // From a point of one face at a way d from the corner to the other face of width W, both
            // endless along y: F = (1 - d / sqrt(d^2 + W^2)) / 2.
            let d = away * 2f32.sqrt();
            let factor = 0.5 * (1.0 - d / (d * d + width * width).sqrt());
            for (x, side) in [(10.0 - away, "left"), (10.0 + away, "right")] {
                let found = along_y(&groove, &light, x);
                let expected = ALBEDO[0] * 0.5f32.sqrt() * factor;
                assert!((found[0] - expected).abs() < 0.07 * expected, "{side} {away}: {found:?} {expected}");
                assert!((found[1] - 0.5 * found[0]).abs() < 1e-5 && found[2] == 0.0, "channels by their albedo");
            }
        }
        // The same form factors without the cosine of the lamp would be refused.
        let wrong = ALBEDO[0] * 0.5 * (1.0 - 0.4 / (0.16f32 + 4.0).sqrt());
        assert!((along_y(&groove, &light, 9.6)[0] - wrong).abs() > 0.07 * wrong);
    }

    #[test]
    fn only_the_lit_face_of_a_groove_sends_light_to_the_other() {
        let groove = shaped(|p| (p[0] - 10.0).abs().min(2.0));
        // At 50 degrees from the right: the right face, which leans to the left, is turned away.
        let wi = [50f32.to_radians().sin(), 0.0, 50f32.to_radians().cos()];
        let light = bounced(&groove, wi);
        let (left, right) = (along_y(&groove, &light, 9.0), along_y(&groove, &light, 11.0));
        assert!(right[0] > 0.05 && left[0] < 0.03 * right[0], "{left:?} {right:?}");
    }

    #[test]
    fn a_plane_and_a_dome_receive_nothing_from_themselves() {
        for field in [shaped(|p| 0.3 * p[0]), shaped(|p| -0.02 * ((p[0] - 10.0).powi(2) + (p[1] - 10.0).powi(2)))] {
            let light = bounced(&field, [0.0, 0.0, 1.0]);
            let most = (0..400).map(|i| light.at([40.0 + (i % 20) as f32 * 4.0, 40.0 + (i / 20) as f32 * 4.0])[0]);
            assert!(most.fold(0.0, f32::max) < 1e-3);
        }
    }

    #[test]
    fn the_directions_have_the_cosine_density_and_lie_about_the_normal() {
        let normal = [0.6, 0.0, 0.8];
        let mean_cosine: f32 =
            (0..DIRECTIONS).map(|i| dot(about(normal, spiral(i, 1.0)), normal)).sum::<f32>() / DIRECTIONS as f32;
        assert!((mean_cosine - 2.0 / 3.0).abs() < 2e-3, "{mean_cosine}");
        let direction = about(normal, spiral(7, 0.3));
        assert!((dot(direction, direction) - 1.0).abs() < 1e-5);
    }
}
