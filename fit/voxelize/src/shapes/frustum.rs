//! Round sticks: a piece of a branch, a stem or a hair, between two discs.
//!
//! A stick that is thinner than a voxel is a distribution of normals around its axis: what it projects and its moment
//! are known in closed form [Kajiya & Kay 1989, for the cylinder]. A thicker one is facets, whose area is scaled to its
//! own.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::brush::Brush;
use super::canvas::{CLOSED, Canvas, Facet};
use crate::model::microflakes::{DIRECTIONS, MicroflakeColour, MicroflakeSums};

/// Radius in voxels below which a stick lies on its axis.
const THIN: f64 = 0.5;

/// Sides of a thick stick, at least and at most.
const SIDES: [f64; 2] = [16.0, 64.0];

/// Sides of a thin stick for the triangles that rays meet.
const THIN_SIDES: usize = 3;

/// A cone between two points, without its ends.
#[derive(Debug, Clone, Copy)]
pub struct Frustum {
    /// Middles of both ends in metres.
    pub ends_m: [DVec3; 2],
    /// Radii at both ends in metres.
    pub radii_m: [f64; 2],
}

impl Frustum {
    /// Returns the length along the slope in metres.
    fn slant_m(&self) -> f64 {
        self.ends_m[0].distance(self.ends_m[1]).hypot(self.radii_m[1] - self.radii_m[0])
    }

    /// Returns the area of the side in square metres.
    pub fn area_m2(&self) -> f64 {
        PI * (self.radii_m[0] + self.radii_m[1]) * self.slant_m()
    }

    /// Paints the side.
    pub fn paint(&self, canvas: &mut Canvas, brush: &Brush) {
        let along = self.ends_m[1] - self.ends_m[0];
        let axis = along.normalize_or_zero();
        if axis == DVec3::ZERO || self.area_m2() == 0.0 {
            return;
        }
        let thickest = self.radii_m[0].max(self.radii_m[1]);
        if thickest < THIN * canvas.voxel_m() {
            self.paint_thin(canvas, axis, brush);
            return;
        }
        let sides = (TAU * thickest / (0.5 * canvas.voxel_m())).clamp(SIDES[0], SIDES[1]).ceil() as usize;
        let facets = self.facets(axis, sides);
        let area = |facet: &[DVec3; 3]| 0.5 * (facet[1] - facet[0]).cross(facet[2] - facet[0]).length();
        let weight = CLOSED * self.area_m2() / facets.iter().map(area).sum::<f64>();
        for corners_m in facets {
            canvas.facet(&Facet { corners_m, uvs: None }, weight, brush);
        }
    }

    fn paint_thin(&self, canvas: &mut Canvas, axis: DVec3, brush: &Brush) {
        let [from, to] = self.radii_m;
        let slope = (from - to) / self.slant_m();
        let mut pieces = Vec::new();
        canvas.each_piece(self.ends_m, |cell, start, end| pieces.push((cell, start, end)));
        for (cell, start, end) in pieces {
            let middle = 0.5 * (start + end);
            let area_m2 = TAU * (from + (to - from) * middle) * self.slant_m() * (end - start);
            let colour = brush.colour(self.ends_m[0].lerp(self.ends_m[1], middle), None);
            let area = (CLOSED * area_m2 / (canvas.side_m * canvas.side_m)) as f32;
            canvas.add(cell, &round_microflakes(area, axis, slope, &colour));
        }
        // As wide as it on average over all directions: of the same circumference.
        let widen = PI / (THIN_SIDES as f64 * (PI / THIN_SIDES as f64).sin());
        let wide = Frustum { radii_m: self.radii_m.map(|radius| widen * radius), ..*self };
        for corners_m in wide.facets(axis, THIN_SIDES) {
            canvas.occlude(&Facet { corners_m, uvs: None }, brush);
        }
    }

    /// Paints the disc at an end, 0 or 1.
    pub fn paint_end(&self, end: usize, canvas: &mut Canvas, brush: &Brush) {
        let axis = (self.ends_m[1] - self.ends_m[0]).normalize_or_zero();
        let radius = self.radii_m[end];
        if axis == DVec3::ZERO || radius == 0.0 {
            return;
        }
        let sides = SIDES[0] as usize;
        let ring = ring(self.ends_m[end], axis, radius, sides);
        let weight = CLOSED * PI / (0.5 * sides as f64 * (TAU / sides as f64).sin());
        for i in 0..sides {
            let [a, b] = [ring[i], ring[(i + 1) % sides]];
            let corners_m = if end == 0 { [self.ends_m[0], b, a] } else { [self.ends_m[1], a, b] };
            canvas.facet(&Facet { corners_m, uvs: None }, weight, brush);
        }
    }

    fn facets(&self, axis: DVec3, sides: usize) -> Vec<[DVec3; 3]> {
        let [below, above] = [0, 1].map(|end| ring(self.ends_m[end], axis, self.radii_m[end], sides));
        let side = |i: usize| {
            let j = (i + 1) % sides;
            [[below[i], below[j], above[j]], [below[i], above[j], above[i]]]
        };
        (0..sides).flat_map(side).collect()
    }
}

/// Returns points on a circle around an axis, counterclockwise seen against it.
fn ring(middle: DVec3, axis: DVec3, radius: f64, sides: usize) -> Vec<DVec3> {
    let (right, up) = axis.any_orthonormal_pair();
    let (right, up) = if right.cross(up).dot(axis) > 0.0 { (right, up) } else { (up, right) };
    let point = |i: usize| {
        let (sin, cos) = (TAU * i as f64 / sides as f64).sin_cos();
        middle + radius * (cos * right + sin * up)
    };
    (0..sides).map(point).collect()
}

/// Returns the microflakes all around an axis, whose normals lean along the axis with the sine `slope`.
///
/// Normals are `c e + s a` with e around the axis a; along d they project `|A cos t + B|` with `A = c |d - (d.a) a|`
/// and `B = s d.a`, of which the mean over the circle is `2/pi (sqrt(A^2 - B^2) + B asin(B / A))`, or |B| where that is
/// greater than A.
pub fn round_microflakes(area: f32, axis: DVec3, slope: f64, colour: &MicroflakeColour) -> MicroflakeSums {
    let upright = 1.0 - slope * slope;
    let projected = DIRECTIONS.map(|d| {
        let along = d.as_dvec3().dot(axis);
        let (a, b) = ((upright * (1.0 - along * along).max(0.0)).sqrt(), (slope * along).abs());
        let mean = if b < a { 2.0 / PI * ((a * a - b * b).sqrt() + b * (b / a).asin()) } else { b };
        area * mean as f32
    });
    let [x, y, z] = axis.to_array();
    let (across, along) = (0.5 * upright, slope * slope - 0.5 * upright);
    let moment = [x * x, y * y, z * z, x * y, x * z, y * z];
    let moment = std::array::from_fn(|k| area * (along * moment[k] + if k < 3 { across } else { 0.0 }) as f32);
    MicroflakeSums::new(area, projected, moment, colour)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_microflakes_are_many_microflakes_around_the_axis() {
        let colour = MicroflakeColour {
            reflectance: [0.1, 0.2, 0.3],
            transmittance: [0.3, 0.2, 0.1],
            ..MicroflakeColour::default()
        };
        for (axis, slope) in [(DVec3::Z, 0.0), (DVec3::new(1.0, 2.0, -0.5), 0.2), (DVec3::new(0.3, -1.0, 0.1), -0.9)] {
            let axis = axis.normalize();
            let found = round_microflakes(2.0, axis, slope, &colour);
            let mut sum = MicroflakeSums::default();
            for direction in ring(DVec3::ZERO, axis, 1.0, 4000) {
                let normal = (1.0 - slope * slope).sqrt() * direction + slope * axis;
                sum.add(&MicroflakeSums::microflake(2.0 / 4000.0, normal.as_vec3(), &colour));
            }
            let near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 2e-4);
            assert!((found.area - sum.area).abs() < 1e-4 && near(&found.reflected, &sum.reflected));
            assert!(near(&found.projected, &sum.projected), "{:?} {:?}", found.projected, sum.projected);
            assert!(near(&found.moment, &sum.moment), "{:?} {:?}", found.moment, sum.moment);
            // Planted difference: another axis.
            assert!(!near(&round_microflakes(2.0, DVec3::X, slope, &colour).projected, &sum.projected));
        }
    }
}
