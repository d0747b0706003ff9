//! Traversal of a volume by a ray, cell by cell. Twin: `voltex/walk.wgsl`.

use super::tree::Cell;
use super::words::Voltex;

/// A ray in texture space. `direction` need not be unit, so that t can be the same as in the world.
#[derive(Debug, Clone, Copy)]
pub struct VoltexRay {
    /// Point at t = 0.
    pub origin: [f32; 3],
    /// Distance in texture space per unit of t.
    pub direction: [f32; 3],
}

/// The part of a ray within one cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// Beginning of the segment.
    pub t0: f32,
    /// End of the segment.
    pub t1: f32,
    /// Cell that the segment lies in.
    pub cell: Cell,
}

/// The state of a traversal.
#[derive(Debug, Clone, Copy)]
pub struct Walk {
    ray: VoltexRay,
    inverse: [f32; 3],
    t: f32,
    t_end: f32,
    /// Coordinates of the current finest voxel.
    q: [i32; 3],
    resolution: i32,
}

/// Least magnitude of a direction's component that is divided by.
pub const MIN_DIRECTION: f32 = 1e-20;

impl Walk {
    /// Begins a traversal along `ray` between `t0` and `t1`, cut to the unit cube. It has no cells if a number of the
    /// ray is not finite. Twin: `voltex_walk_new`.
    pub fn new(ray: VoltexRay, t0: f32, t1: f32, level_count: u32) -> Walk {
        let least = |d: f32| if d < 0.0 { -MIN_DIRECTION } else { MIN_DIRECTION };
        let inverse = ray.direction.map(|d| 1.0 / if d.abs() < MIN_DIRECTION { least(d) } else { d });
        let finite = ray.origin.iter().chain(&ray.direction).all(|x| x.is_finite());
        let (mut start, mut end) = (t0, t1);
        for axis in 0..3 {
            let a = -ray.origin[axis] * inverse[axis];
            let b = (1.0 - ray.origin[axis]) * inverse[axis];
            start = start.max(a.min(b));
            end = end.min(a.max(b));
        }
        let resolution = 1 << level_count;
        let t_end = if finite { end } else { start };
        let mut walk = Walk { ray, inverse, t: start, t_end, q: [0; 3], resolution };
        walk.q = std::array::from_fn(|axis| walk.voxel_along(axis, start).clamp(0, resolution - 1));
        walk
    }

    /// Returns the coordinate of the finest voxel at t, which callers bound to those that there are; 0 just below 0.
    /// Twin: `voltex_walk_voxel_along`.
    fn voxel_along(&self, axis: usize, t: f32) -> i32 {
        ((self.ray.origin[axis] + self.ray.direction[axis] * t) * self.resolution as f32) as i32
    }

    /// Returns the current t.
    pub fn t(&self) -> f32 {
        self.t
    }

    /// Returns the next cell at `level`; `None` at the end. The current voxel is kept in integers, so that the
    /// traversal advances however t rounds: each step moves one coordinate on and none back, at most three times the
    /// voxels a side in all. Twin: `voltex_walk_next`.
    pub fn next(&mut self, voltex: &Voltex, level: u32) -> Option<Segment> {
        if self.t.is_nan() || self.t >= self.t_end {
            return None;
        }
        let cell = voltex.cell(self.q.map(|x| x as u32), level.min(voltex.level_count()));
        let side = 1 << cell.size;
        let low = self.q.map(|x| x >> cell.size << cell.size);
        let scale = 1.0 / self.resolution as f32;
        let (mut exit, mut through) = (f32::INFINITY, 0);
        for axis in 0..3 {
            let plane = if self.inverse[axis] > 0.0 { low[axis] + side } else { low[axis] };
            let t = (plane as f32 * scale - self.ray.origin[axis]) * self.inverse[axis];
            if t < exit {
                (exit, through) = (t, axis);
            }
        }
        let t0 = self.t;
        self.t = exit.max(t0);
        for axis in 0..3 {
            let (at, last) = (self.q[axis], low[axis] + side - 1);
            let ahead = self.inverse[axis] > 0.0;
            let (least, most) = if ahead { (at, last) } else { (low[axis], at) };
            self.q[axis] = if axis != through {
                self.voxel_along(axis, self.t).clamp(least, most)
            } else if ahead {
                last + 1
            } else {
                low[axis] - 1
            };
        }
        if !(0..self.resolution).contains(&self.q[through]) {
            self.t = self.t_end;
        }
        Some(Segment { t0, t1: exit.clamp(t0, self.t_end), cell })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{RAY_KINDS, Random, random_volume, sample_ray};
    use crate::voltex::{NO_VOXEL, Sym3, Volume, VolumeLevel, Voxel};

    const T1: f32 = 1e15;

    /// Returns all segments of a traversal, and panics after more steps than it may take.
    fn segments(voltex: &Voltex, ray: VoltexRay, t0: f32, t1: f32, level: u32) -> Vec<Segment> {
        let mut walk = Walk::new(ray, t0, t1, voltex.level_count());
        let mut found = Vec::new();
        while let Some(segment) = walk.next(voltex, level) {
            found.push(segment);
            assert!(found.len() <= 3 << voltex.level_count(), "{ray:?} does not end");
        }
        found
    }

    /// Returns the fault of the segments of a ray from t = 0 on, in double precision.
    fn fault(voltex: &Voltex, ray: VoltexRay, level: u32, segments: &[Segment]) -> Option<String> {
        let (o, d) = (ray.origin.map(f64::from), ray.direction.map(f64::from));
        // How far from its place a point may be, and a t along an axis.
        let tolerance = 1e-6 * o.iter().fold(1.0f64, |most, x| most.max(x.abs()));
        let tolerance_t = |axis: usize| tolerance / d[axis].abs();
        let (mut start, mut end) = ((0.0, 0.0), (f64::from(T1), 0.0));
        for axis in (0..3).filter(|axis| d[*axis].abs() >= f64::from(MIN_DIRECTION)) {
            let (a, b) = (-o[axis] / d[axis], (1.0 - o[axis]) / d[axis]);
            if a.min(b) > start.0 {
                start = (a.min(b), tolerance_t(axis));
            }
            if a.max(b) < end.0 {
                end = (a.max(b), tolerance_t(axis));
            }
        }
        if end.0 - start.0 <= start.1 + end.1 {
            return None;
        }
        let (Some(first), Some(last)) = (segments.first(), segments.last()) else {
            // In the face at 1, or outside by rounding.
            let beside = (0..3).any(|axis| d[axis] == 0.0 && !(tolerance..1.0 - tolerance).contains(&o[axis]));
            return (!beside).then(|| "nothing".into());
        };
        let wrong = |found: f32, (t, tolerance): (f64, f64)| (f64::from(found) - t).abs() > tolerance;
        if wrong(first.t0, start) || wrong(last.t1, end) {
            return Some(format!("{} to {}, not {start:?} to {end:?}", first.t0, last.t1));
        }
        if let Some(pair) = segments.windows(2).find(|pair| pair[0].t1 != pair[1].t0) {
            return Some(format!("{pair:?} do not follow each other"));
        }
        let resolution = f64::from(1u32 << voltex.level_count());
        for segment in segments {
            let at = |t: f64| [0, 1, 2].map(|axis| (o[axis] + d[axis] * t) * resolution);
            let near = 2.0 * tolerance * resolution;
            // Not the middle, which from face to face lies in the next plane.
            let within = at(0.38 * f64::from(segment.t0) + 0.62 * f64::from(segment.t1));
            if segment.t1 < segment.t0 {
                return Some(format!("{segment:?} ends before it begins"));
            }
            if within.iter().any(|x| (x - x.round()).abs() <= near) {
                continue;
            }
            let q = within.map(|x| x as u32);
            if voltex.cell(q, level) != segment.cell {
                return Some(format!("{segment:?} is in {:?}", voltex.cell(q, level)));
            }
            for (t, axis) in [segment.t0, segment.t1].into_iter().flat_map(|t| [(t, 0), (t, 1), (t, 2)]) {
                let low = f64::from(q[axis] >> segment.cell.size << segment.cell.size);
                let place = at(f64::from(t))[axis];
                // T's own rounding besides.
                let near = near + 1e-6 * resolution * (d[axis] * f64::from(t)).abs();
                if place < low - near || place > low + f64::from(1u32 << segment.cell.size) + near {
                    return Some(format!("{segment:?} leaves its cell: {place} from {low} on"));
                }
            }
        }
        None
    }

    #[test]
    fn segments_tile_the_ray_and_lie_in_their_cells() {
        let mut random = Random::new(7);
        let (mut planted, mut seen) = (0, 0);
        for level_count in [0, 1, 2, 3, 4, 5, 6] {
            for share in [0.0, 0.2, 0.7] {
                let voltex = Voltex::new(&random_volume(&mut random, level_count, share));
                for round in 0..2000 {
                    let ray = sample_ray(&mut random, level_count, round % RAY_KINDS);
                    let level = random.below(level_count as usize + 2) as u32;
                    let found = segments(&voltex, ray, 0.0, T1, level);
                    let level = level.min(level_count);
                    if let Some(fault) = fault(&voltex, ray, level, &found) {
                        panic!("{ray:?} at {level} of {level_count}: {fault}, {found:?}");
                    }
                    // Planted differences, where the ray is in no plane between voxels: a segment left out, and one in
                    // another cell.
                    if ![0, 4, 5, 6].contains(&(round % RAY_KINDS)) {
                        continue;
                    }
                    let Some(cut) = found.iter().position(|s| s.t1 > 1.01 * s.t0 && s.cell.voxel != NO_VOXEL) else {
                        continue;
                    };
                    seen += 1;
                    let mut short = found.clone();
                    short.remove(cut);
                    let mut other = found.clone();
                    other[cut].cell.voxel ^= 1;
                    let both = [short, other].iter().all(|segments| fault(&voltex, ray, level, segments).is_some());
                    planted += usize::from(both);
                }
            }
        }
        assert!(seen > 5000 && planted > seen * 95 / 100, "{planted} of {seen}");
    }

    #[test]
    fn walks_end_whatever_the_ray_is() {
        let mut random = Random::new(8);
        let voltex = Voltex::new(&random_volume(&mut random, 5, 0.4));
        let odd = [
            0.0,
            -0.0,
            1.0,
            0.5,
            1e-30,
            1e-45,
            -1e-20,
            1e20,
            1e38,
            -1e6,
            f32::MAX,
            f32::INFINITY,
            -f32::INFINITY,
            f32::NAN,
        ];
        for _ in 0..200_000 {
            let mut any = || odd[random.below(odd.len())];
            let ray = VoltexRay { origin: [any(), any(), any()], direction: [any(), any(), any()] };
            let (t0, t1) = (any(), any());
            let found = segments(&voltex, ray, t0, t1, random.below(8) as u32);
            let finite = ray.origin.iter().chain(&ray.direction).all(|x| x.is_finite());
            assert!(finite || found.is_empty(), "{ray:?}");
            assert!(found.windows(2).all(|pair| pair[0].t1 == pair[1].t0), "{ray:?} {found:?}");
        }
        // From 10^6 away t is known to 0.06 only.
        for _ in 0..10_000 {
            let mut ray = sample_ray(&mut random, 5, 0);
            ray.origin = std::array::from_fn(|i| ray.origin[i] - 1e6 * ray.direction[i]);
            let found = segments(&voltex, ray, 0.0, T1, 0);
            assert!(fault(&voltex, ray, 0, &found).is_none(), "{ray:?}");
        }
        // No direction: where it stands, for ever.
        let still = VoltexRay { origin: [0.3; 3], direction: [0.0; 3] };
        let found = segments(&voltex, still, 0.0, 2.0, 0);
        assert_eq!((found.len(), found[0].t0, found[0].t1), (1, 0.0, 2.0));
    }

    #[test]
    fn empty_space_is_skipped_by_its_largest_cells() {
        let voxel = Voxel::new(Sym3([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]), 0);
        let levels =
            (0..=10).map(|_| VolumeLevel { voxels: vec![([0; 3], voxel)], ..VolumeLevel::default() }).collect();
        let voltex = Voltex::new(&Volume { levels, ..Volume::default() });
        // Along the edge with the voxel: cells of 1, 1, 2, 4 ... 512.
        let along = VoltexRay { origin: [-1.0, 1e-4, 1e-4], direction: [1.0, 0.0, 0.0] };
        let sizes: Vec<u32> = segments(&voltex, along, 0.0, T1, 0).iter().map(|segment| segment.cell.size).collect();
        assert_eq!(sizes, [0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9]);
        // Far from it: two cells of a half.
        let beside = VoltexRay { origin: [-1.0, 0.9, 0.9], direction: [1.0, 0.0, 0.0] };
        assert_eq!(segments(&voltex, beside, 0.0, T1, 0).len(), 2);
        assert_eq!(segments(&voltex, along, 0.0, T1, 10).len(), 1);
    }
}
