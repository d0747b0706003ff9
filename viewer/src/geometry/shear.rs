//! Rays as the z axis [Woop 2013]: seen along itself a ray is a point, and a triangle around it a triangle around the
//! origin. Twin: `shear.wgsl`.

use glam::Vec3;

/// A ray's direction made ready for triangles: its largest axis, and what shears it onto that axis. Twin: `Shear`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shear {
    axis: usize,
    factors: Vec3,
}

impl Shear {
    /// Prepares a direction that need not be unit, but not zero.
    pub(crate) fn new(direction: Vec3) -> Shear {
        let size = direction.abs();
        let axis = if size.x > size.y && size.x > size.z {
            0
        } else if size.y > size.z {
            1
        } else {
            2
        };
        let d = turn(direction, axis);
        let inverse = 1.0 / d.z;
        Shear { axis, factors: Vec3::new(d.x * inverse, d.y * inverse, inverse) }
    }

    /// Shears a point relative to the ray's origin: returns two coordinates across the ray, and t.
    pub(crate) fn apply(&self, v: Vec3) -> Vec3 {
        let v = turn(v, self.axis);
        Vec3::new(v.x - self.factors.x * v.z, v.y - self.factors.y * v.z, v.z * self.factors.z)
    }

    /// Returns whether a triangle that is counter-clockwise from outside, and is seen with this area, has its outside
    /// towards the ray.
    pub(crate) fn is_towards(&self, area: f32) -> bool {
        area * self.factors.z < 0.0
    }
}

/// Turns the components in cyclic order so that `axis` becomes z.
fn turn(v: Vec3, axis: usize) -> Vec3 {
    match axis {
        0 => Vec3::new(v.y, v.z, v.x),
        1 => Vec3::new(v.z, v.x, v.y),
        _ => v,
    }
}
