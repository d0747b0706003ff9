//! The texels that a straight stretch of a ray meets in texture space. Twin: `cell.wgsl`.

use super::walk::TextureRay;
use crate::sampler::{hash, one};
use glam::Vec3;

/// Texels of one stretch at most; what lies behind is told as part of the last one. A tetrahedron that is wider has
/// texels far below a pixel. Twin: `MAX_CELLS`.
pub const MAX_CELLS: u32 = 4096;
/// Largest number of a texel along u and v. Twin: `MAX_COORDINATE`.
const MAX_COORDINATE: f32 = (1 << 24) as f32;
/// The constants that the shader has too, by name.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, f32)] = &[("MAX_COORDINATE", MAX_COORDINATE)];

/// A stretch of a ray within one texel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellSpan {
    /// Begin of the span, in units of the ray's direction.
    pub t0: f32,
    /// End of the span, beyond `t0`.
    pub t1: f32,
    /// The texel's (i, j).
    pub cell: [i32; 2],
}

/// Goes from texel to texel. An iterator over spans that follow each other without gaps within 0 <= w <= 1. The texels
/// are counted in whole numbers from that of the first point to that of the last, so it ends whatever rounding does.
/// Twin: `CellWalk`.
#[derive(Debug, Clone, Copy)]
pub struct CellWalk {
    ray: TextureRay,
    /// t of the ray's point.
    t0: f32,
    /// Present place and end of the walk, from there.
    at: f32,
    end: f32,
    cell: [i32; 2],
    last: [i32; 2],
    left: u32,
}

impl CellWalk {
    /// Returns the walk over the texels of `ray` between `t0`, where its point is, and `t1`.
    pub fn new(ray: TextureRay, t0: f32, t1: f32) -> CellWalk {
        let whole = (t1 - t0).max(0.0);
        let (mut at, mut end) = (0.0, whole);
        // Keep what is between floor and lid; a division is only made by what leads across them.
        let (w, along) = (ray.point.z, ray.direction.z);
        let w_end = w + end * along;
        let is_outside = (w < 0.0 && w_end < 0.0) || (w > 1.0 && w_end > 1.0);
        let crossing = |bound: f32| ((bound - w) / along).clamp(0.0, whole);
        if !is_outside {
            if w < 0.0 {
                at = crossing(0.0);
            } else if w > 1.0 {
                at = crossing(1.0);
            }
            if w_end < 0.0 {
                end = crossing(0.0);
            } else if w_end > 1.0 {
                end = crossing(1.0);
            }
        }
        let is_full = at < end && !is_outside;
        CellWalk {
            ray,
            t0,
            at,
            end,
            cell: cell_of(ray.point + at * ray.direction),
            last: cell_of(ray.point + end * ray.direction),
            left: if is_full { MAX_CELLS } else { 0 },
        }
    }

    /// Returns the next span that is longer than nothing.
    fn step(&mut self) -> Option<CellSpan> {
        while self.left > 0 {
            self.left -= 1;
            let (from, cell) = (self.at, self.cell);
            if cell == self.last || self.left == 0 {
                self.left = 0;
                self.at = self.end;
            } else {
                let along_u = self.crossing(0);
                let along_v = self.crossing(1);
                // The border that comes first, of the axes that have not arrived.
                let axis = usize::from(cell[0] == self.last[0] || (cell[1] != self.last[1] && along_v < along_u));
                self.at = (if axis == 0 { along_u } else { along_v }).clamp(from, self.end);
                self.cell[axis] += if self.last[axis] > cell[axis] { 1 } else { -1 };
            }
            if self.at > from {
                return Some(CellSpan { t0: self.t0 + from, t1: self.t0 + self.at, cell });
            }
        }
        None
    }

    /// Returns where the ray leaves the texel along an axis on which it has not arrived.
    fn crossing(&self, axis: usize) -> f32 {
        if self.cell[axis] == self.last[axis] {
            return self.end;
        }
        let border = self.cell[axis] + i32::from(self.last[axis] > self.cell[axis]);
        (border as f32 - self.ray.point[axis]) / self.ray.direction[axis]
    }
}

impl Iterator for CellWalk {
    type Item = CellSpan;

    fn next(&mut self) -> Option<CellSpan> {
        self.step()
    }
}

/// Returns the texel around a point of the texture.
pub(super) fn cell_of(texture: Vec3) -> [i32; 2] {
    // Baseline processors have no instruction that rounds down.
    let floor = |x: f32| {
        let x = x.clamp(-MAX_COORDINATE, MAX_COORDINATE);
        let whole = x as i32;
        whole - i32::from(x < whole as f32)
    };
    [floor(texture.x), floor(texture.y)]
}

/// Hashes a texel: everything that is drawn for it comes from this number alone.
pub(super) fn cell_hash(cell: [i32; 2], seed: u32) -> u32 {
    hash(cell[0] as u32 ^ hash(cell[1] as u32 ^ hash(seed)))
}

/// Returns the share in [0, 1) that a texel has drawn.
pub(super) fn cell_share(hashed: u32, draw: u32) -> f32 {
    one(hashed ^ (draw << 24 | draw))
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_runtime::testing::Random;

    fn spans(point: Vec3, direction: Vec3, length: f32) -> Vec<CellSpan> {
        CellWalk::new(TextureRay { point, direction }, 2.0, 2.0 + length).collect()
    }

    /// Spans that do not follow each other, or whose middle is in another texel.
    fn faults(point: Vec3, direction: Vec3, spans: &[CellSpan]) -> usize {
        let apart = spans.windows(2).filter(|pair| pair[0].t1 != pair[1].t0).count();
        let elsewhere = spans.iter().filter(|span| {
            let middle = point + ((span.t0 + span.t1) * 0.5 - 2.0) * direction;
            let slack = 1e-4;
            [0, 1].iter().any(|i| {
                let within = middle[*i] - span.cell[*i] as f32;
                !(-slack..=1.0 + slack).contains(&within)
            })
        });
        apart + elsewhere.count()
    }

    #[test]
    fn texels_follow_each_other_and_hold_their_stretch() {
        let mut random = Random::new(4);
        for _ in 0..20_000 {
            let mut within = |range: f32| Vec3::from([(); 3].map(|()| random.within(-range, range)));
            let (point, direction) = (within(9.0) * Vec3::new(1.0, 1.0, 0.2), within(4.0));
            let found = spans(point, direction, 3.0);
            assert_eq!(faults(point, direction, &found), 0);
            // All of what is between floor and lid.
            let sum: f32 = found.iter().map(|span| span.t1 - span.t0).sum();
            let [a, b] = [0.0, 1.0].map(|bound| (bound - point.z) / direction.z);
            let expected = (a.max(b).min(3.0) - a.min(b).max(0.0)).max(0.0);
            assert!((sum - expected).abs() < 1e-4, "{sum} {expected}");
            // Planted: a texel's number that is one off.
            if let Some(mut wrong) = (!found.is_empty()).then(|| found.clone()) {
                wrong[0].cell[0] += 2;
                assert!(faults(point, direction, &wrong) > 0);
            }
        }
    }

    #[test]
    fn rays_along_borders_through_corners_and_at_rest_are_whole() {
        let half = Vec3::Z * 0.5;
        let sum = |point: Vec3, direction: Vec3| -> f32 {
            spans(point, direction, 4.0).iter().map(|span| span.t1 - span.t0).sum()
        };
        for point in [half, half + Vec3::X, half + Vec3::Y * 0.5, half + Vec3::new(-3.0, 7.0, 0.0)] {
            for direction in
                [Vec3::X, Vec3::NEG_X, Vec3::NEG_Y, Vec3::new(1.0, 1.0, 0.0), Vec3::new(-1.0, 1.0, 0.0), Vec3::ZERO]
            {
                assert_eq!(sum(point, direction), 4.0, "{point} {direction}");
            }
        }
        assert_eq!(sum(Vec3::Z * 1.5, Vec3::X), 0.0);
        assert_eq!(sum(Vec3::ZERO, Vec3::X), 4.0, "on the floor");
        assert_eq!(sum(Vec3::Z * 2.0, Vec3::NEG_Z), 1.0);
        // Through a corner: two texels, not three.
        assert_eq!(spans(half - Vec3::new(1.0, 1.0, 0.0), Vec3::new(1.0, 1.0, 0.0), 1.5).len(), 2);
    }

    #[test]
    fn extreme_coordinates_end() {
        for scale in [1e-30, 1e5, 1e9, 1e30] {
            for direction in [Vec3::X, Vec3::new(1.0, -0.3, 0.0), Vec3::new(-1.0, 1e-20, 0.0)] {
                let found = spans(Vec3::new(-scale, scale, 0.5), direction * scale, 2.0);
                assert!(!found.is_empty() && found.len() <= MAX_CELLS as usize, "{scale} {direction}");
                let sum: f32 = found.iter().map(|span| span.t1 - span.t0).sum();
                assert!((sum - 2.0).abs() < 1e-3, "{sum}");
            }
        }
        assert!(spans(Vec3::NAN, Vec3::X, 1.0).len() <= 1);
        assert!([-1.0, 0.0, f32::NAN].iter().all(|length| spans(Vec3::ZERO, Vec3::X, *length).is_empty()));
    }
}
