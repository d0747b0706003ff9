//! Rays as the z axis [Woop 2013]: seen along itself a ray is a point, and a triangle around it a triangle around the
//! origin. Twin: `shear.wgsl`.

use glam::Vec3;

/// A ray's direction made ready for triangles: its largest axis, and what shears it onto that axis. Twin: `Shear`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shear {
    /// The axes in cyclic order, the direction's largest last.
    pub axes: [usize; 3],
    pub factors: Vec3,
}

impl Shear {
    /// Prepares a direction that need not be unit, but not zero.
    #[inline(always)]
    pub(crate) fn new(direction: Vec3) -> Shear {
        let size = direction.abs();
        let axes = if size.x > size.y && size.x > size.z {
            [1, 2, 0]
        } else if size.y > size.z {
            [2, 0, 1]
        } else {
            [0, 1, 2]
        };
        let d = turn(direction, axes);
        let inverse = 1.0 / d.z;
        Shear { axes, factors: Vec3::new(d.x * inverse, d.y * inverse, inverse) }
    }

    /// Shears a point relative to the ray's origin: returns two coordinates across the ray, and t.
    #[inline(always)]
    pub(crate) fn apply(&self, v: Vec3) -> Vec3 {
        self.apply_turned(turn(v, self.axes))
    }

    /// Shears a point whose components are in the order of the axes.
    #[inline(always)]
    pub(crate) fn apply_turned(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.x - self.factors.x * v.z, v.y - self.factors.y * v.z, v.z * self.factors.z)
    }

    /// Returns whether a triangle that is counter-clockwise from outside, and is seen with this area, has its outside
    /// towards the ray.
    #[inline(always)]
    pub(crate) fn is_towards(&self, area: f32) -> bool {
        area * self.factors.z < 0.0
    }
}

/// Takes the components in the order of `axes`.
#[inline(always)]
pub(crate) fn turn(v: Vec3, [x, y, z]: [usize; 3]) -> Vec3 {
    Vec3::new(v[x], v[y], v[z])
}
