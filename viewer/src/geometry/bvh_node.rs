//! Axis-aligned boxes, and the nodes of hierarchies of them.

use glam::Vec3;

/// An axis-aligned box.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds {
    /// Least corner.
    pub lo: Vec3,
    /// Greatest corner.
    pub hi: Vec3,
}

impl Bounds {
    /// The box around nothing.
    pub(crate) const EMPTY: Bounds = Bounds { lo: Vec3::INFINITY, hi: Vec3::NEG_INFINITY };

    /// Returns the box around both.
    pub(crate) fn add(self, other: Bounds) -> Bounds {
        Bounds { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }

    /// Returns the box around `self` and a point.
    pub(crate) fn add_point(self, point: Vec3) -> Bounds {
        self.add(Bounds { lo: point, hi: point })
    }

    /// Returns the eight corners.
    pub(crate) fn corners(self) -> [Vec3; 8] {
        std::array::from_fn(|i| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { self.lo[axis] } else { self.hi[axis] };
            Vec3::new(pick(0), pick(1), pick(2))
        })
    }

    /// Returns half of the surface area.
    pub(crate) fn half_area(self) -> f32 {
        let d = (self.hi - self.lo).max(Vec3::ZERO);
        d.x * d.y + d.y * d.z + d.z * d.x
    }
}

/// A node of a hierarchy. Twin: `BvhNode` in `bvh.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct BvhNode {
    /// Least corner.
    pub lo: [f32; 3],
    /// Leaf: its first triangle, or its instance. Inner node: its left child; the right one follows.
    pub first: u32,
    /// Greatest corner.
    pub hi: [f32; 3],
    /// Leaf: number of triangles, or 1. Inner node: 0.
    pub count: u32,
}

impl BvhNode {
    /// Returns the box of the node.
    pub(crate) fn bounds(&self) -> Bounds {
        Bounds { lo: self.lo.into(), hi: self.hi.into() }
    }
}
