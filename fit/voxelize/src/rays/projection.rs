//! Parallel rays through the unit cube.

use glam::Vec3;

/// Half the side of a square in which every view of the unit cube lies.
pub const HALF_SIDE: f32 = 0.867;

/// Rays of one direction over a square across the middle of the unit cube.
#[derive(Debug, Clone, Copy)]
pub struct Projection {
    /// Unit vector along the rays.
    pub direction: Vec3,
    right: Vec3,
    up: Vec3,
}

/// Rays along the side of a view at least, so that views of a few large pixels see what is in them.
const MIN_RAYS: usize = 32;

/// Returns the number of rays along each side of a pixel: `asked`, or more where there are few pixels on a side.
pub fn rays_of_pixel(asked: usize, pixels: usize) -> usize {
    asked.max(MIN_RAYS.div_ceil(pixels))
}

impl Projection {
    /// Returns the rays along a unit vector.
    pub fn new(direction: Vec3) -> Projection {
        let right = direction.any_orthonormal_vector();
        Projection { direction, right, up: direction.cross(right) }
    }

    /// Returns the origin of the ray at `u`, `v` (within [`HALF_SIDE`] of 0), outside the cube.
    pub fn origin(&self, u: f32, v: f32) -> Vec3 {
        Vec3::splat(0.5) + self.right * u + self.up * v - self.direction
    }

    /// Returns a unit vector across the rays, turned by `turn` radians.
    pub fn across(&self, turn: f32) -> Vec3 {
        self.right * turn.cos() + self.up * turn.sin()
    }
}

/// Returns `count` unit vectors spread over the sphere in a spiral, turned by `turn` radians round its axis.
pub fn spread_directions(count: usize, turn: f32) -> Vec<Vec3> {
    let golden = std::f32::consts::PI * (3.0 - 5f32.sqrt());
    (0..count)
        .map(|i| {
            let z = 1.0 - (2.0 * i as f32 + 1.0) / count as f32;
            let (sin, cos) = (golden * i as f32 + turn).sin_cos();
            let r = (1.0 - z * z).sqrt();
            Vec3::new(r * cos, r * sin, z)
        })
        .collect()
}
