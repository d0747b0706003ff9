//! A ray's way through a volume, cell by cell. Twin: `shaders/voltex_walk.wgsl`.

use super::tree::Cell;
use super::words::Voltex;

/// A ray in texture space; `direction` is not unit, so that t is the same as in the world.
#[derive(Debug, Clone, Copy)]
pub struct VoltexRay {
    /// Where t is 0.
    pub origin: [f32; 3],
    /// Way per t.
    pub direction: [f32; 3],
}

/// A part of a ray within one cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// Where it begins.
    pub t0: f32,
    /// Where it ends.
    pub t1: f32,
    /// The cell.
    pub cell: Cell,
}

/// Where a walk stands.
#[derive(Debug, Clone, Copy)]
pub struct Walk {
    ray: VoltexRay,
    inverse: [f32; 3],
    t: f32,
    t_end: f32,
    /// Finest voxel that it is in.
    q: [i32; 3],
    resolution: i32,
}

/// Smallest component of a direction that is divided by.
const LEAST_DIRECTION: f32 = 1e-20;

impl Walk {
    /// Along `ray` between `t0` and `t1`, cut to the unit cube. Twin: `voltex_walk_new`.
    pub fn new(ray: VoltexRay, t0: f32, t1: f32, level_count: u32) -> Walk {
        let inverse =
            ray.direction.map(|d| 1.0 / if d.abs() < LEAST_DIRECTION { LEAST_DIRECTION.copysign(d) } else { d });
        let (mut start, mut end) = (t0, t1);
        for axis in 0..3 {
            let a = -ray.origin[axis] * inverse[axis];
            let b = (1.0 - ray.origin[axis]) * inverse[axis];
            start = start.max(a.min(b));
            end = end.min(a.max(b));
        }
        let resolution = 1 << level_count;
        let mut walk = Walk { ray, inverse, t: start, t_end: end, q: [0; 3], resolution };
        walk.q = std::array::from_fn(|axis| walk.voxel_along(axis, start).clamp(0, resolution - 1));
        walk
    }

    fn voxel_along(&self, axis: usize, t: f32) -> i32 {
        ((self.ray.origin[axis] + self.ray.direction[axis] * t) * self.resolution as f32).floor() as i32
    }

    /// Where it stands.
    pub fn t(&self) -> f32 {
        self.t
    }

    /// The next cell at `level`; `None` at the end. Which voxel a walk is in it keeps in whole numbers, so that it goes on
    /// whatever t rounds to. Twin: `voltex_walk_next`.
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
            let plane = if self.ray.direction[axis] > 0.0 { low[axis] + side } else { low[axis] };
            let t = (plane as f32 * scale - self.ray.origin[axis]) * self.inverse[axis];
            if t < exit {
                (exit, through) = (t, axis);
            }
        }
        let t0 = self.t;
        self.t = exit.max(t0);
        for axis in 0..3 {
            self.q[axis] = if axis != through {
                self.voxel_along(axis, self.t).clamp(low[axis], low[axis] + side - 1)
            } else if self.ray.direction[axis] > 0.0 {
                low[axis] + side
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
