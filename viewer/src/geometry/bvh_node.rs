//! Axis-aligned boxes, and the nodes of hierarchies of them.

use glam::{Mat4, Vec3};

/// Children of a node.
pub(crate) const CHILDREN: usize = 8;
/// Share of a node's side by which the boxes of its children are too large: more than what distances to planes within the node are
/// rounded by [Ize 2013].
const PADDING: f64 = 1.0 / (1 << 20) as f64;
/// Largest number that a plane has within its node.
const MAX_PLANE: f64 = 255.0;
/// Bias of the exponent of an f32, and the largest of a finite one.
const EXPONENT_BIAS: f64 = 127.0;
const MAX_EXPONENT: f64 = 254.0;

/// An axis-aligned box.
#[derive(Debug, Clone, Copy, PartialEq)]
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

    /// Returns the box around this one where an affine map takes it.
    pub(crate) fn placed(self, map: Mat4) -> Bounds {
        self.corners().into_iter().map(|corner| map.transform_point3(corner)).fold(Bounds::EMPTY, Bounds::add_point)
    }

    /// Returns the eight corners.
    pub(crate) fn corners(self) -> [Vec3; 8] {
        std::array::from_fn(|i| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { self.lo[axis] } else { self.hi[axis] };
            Vec3::new(pick(0), pick(1), pick(2))
        })
    }
}

/// A node of a hierarchy: the boxes of up to eight children, in bytes [Ylitie 2017]. Twin: `BvhNode` in `bvh.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct BvhNode {
    /// Where the planes' numbers begin on each axis.
    pub lo: [f32; 3],
    /// Exponents of the steps between planes on each axis, biased as in f32; the last has a bit for every slot that holds a
    /// node.
    pub exponents: [u8; 4],
    /// First child that is a node; the others follow in the order of their slots.
    pub first_child: u32,
    /// First triangle or instance of all children that are leaves.
    pub first_primitive: u32,
    /// What the eight slots hold: 0 for nothing; for a node 32 + 24 + the slot's number; for a leaf the number of its first
    /// primitive from `first_primitive` on, below 24, and above it 1, 3 or 7 times 32 for one, two or three of them.
    pub slots: [u8; CHILDREN],
    /// Planes of the slots' boxes: least x, greatest x, least y, greatest y, least z, greatest z.
    pub planes: [[u8; CHILDREN]; 6],
}

/// A child of a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Child {
    /// The number of a node.
    Node(u32),
    /// The first primitive of a leaf, and how many it has.
    Leaf(u32, u32),
}

impl BvhNode {
    /// Returns what a slot holds.
    #[inline(always)]
    pub(crate) fn child(&self, slot: usize) -> Option<Child> {
        let holds = u32::from(self.slots[slot]);
        let nodes = u32::from(self.exponents[3]);
        if holds == 0 {
            return None;
        }
        Some(match nodes >> slot & 1 {
            0 => Child::Leaf(self.first_primitive + (holds & 31), (holds >> 5).count_ones()),
            _ => Child::Node(self.first_child + (nodes & ((1 << slot) - 1)).count_ones()),
        })
    }

    /// Returns the boxes of the slots, as they are stored; turned inside out where there is nothing.
    pub(crate) fn boxes(&self) -> [Bounds; CHILDREN] {
        std::array::from_fn(|slot| {
            let plane = |axis: usize, side: usize| {
                let step = f32::from_bits(u32::from(self.exponents[axis]) << 23);
                self.lo[axis] + step * f32::from(self.planes[2 * axis + side][slot])
            };
            let corner = |side| Vec3::new(plane(0, side), plane(1, side), plane(2, side));
            Bounds { lo: corner(0), hi: corner(1) }
        })
    }

    /// Gives the slots the boxes of what they hold, each a little larger. Slots that hold nothing have a box that no ray meets.
    pub(crate) fn set_boxes(&mut self, boxes: [Bounds; CHILDREN]) {
        let all = boxes.into_iter().fold(Bounds::EMPTY, Bounds::add);
        for axis in 0..3 {
            let [least, most] = [all.lo[axis], all.hi[axis]].map(f64::from);
            let padding = PADDING * (most - least);
            self.lo[axis] = ((least - padding) as f32).next_down();
            let origin = f64::from(self.lo[axis]);
            let exponent = ((most + padding - origin) / MAX_PLANE).log2().ceil();
            let exponent = (exponent + EXPONENT_BIAS).clamp(1.0, MAX_EXPONENT);
            self.exponents[axis] = exponent as u8;
            let planes_per_unit = (EXPONENT_BIAS - exponent).exp2();
            for (slot, own) in boxes.into_iter().enumerate() {
                let plane = |at: f64| ((at - origin) * planes_per_unit).clamp(0.0, MAX_PLANE);
                let [lo, hi] = [own.lo[axis], own.hi[axis]].map(f64::from);
                let [lo, hi] = match lo <= hi {
                    true => [plane(lo - padding).floor(), plane(hi + padding).ceil()],
                    false => [MAX_PLANE, 0.0],
                };
                self.planes[2 * axis][slot] = lo as u8;
                self.planes[2 * axis + 1][slot] = hi as u8;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_runtime::testing::Random;

    /// The box of a slot as shaders see it.
    fn decoded(node: &BvhNode, slot: usize) -> [[f64; 2]; 3] {
        [0, 1, 2].map(|axis| {
            let step = f64::from(f32::from_bits(u32::from(node.exponents[axis]) << 23));
            [0, 1].map(|side| f64::from(node.lo[axis]) + step * f64::from(node.planes[2 * axis + side][slot]))
        })
    }

    #[test]
    fn boxes_in_bytes_hold_those_that_they_were_made_of() {
        let mut random = Random::new(3);
        for (centre, size) in [(0.0, 1.0), (1e6, 1e-3), (-3.0, 1e-20), (0.0, 1e30), (5.0, 0.0)] {
            for flat in [None, Some(0), Some(2)] {
                let boxes: [Bounds; CHILDREN] = std::array::from_fn(|slot| {
                    let mut point = || Vec3::from([(); 3].map(|()| centre + size * random.within(-1.0, 1.0)));
                    let mut own = Bounds::EMPTY.add_point(point()).add_point(point());
                    if let Some(axis) = flat {
                        own.hi[axis] = own.lo[axis];
                    }
                    if slot == 5 { Bounds::EMPTY } else { own }
                });
                let mut node: BvhNode = bytemuck::Zeroable::zeroed();
                node.set_boxes(boxes);
                let all = boxes.into_iter().fold(Bounds::EMPTY, Bounds::add);
                for (slot, own) in boxes.into_iter().enumerate() {
                    for (axis, [lo, hi]) in decoded(&node, slot).into_iter().enumerate() {
                        if slot == 5 {
                            assert!(lo > hi, "{node:?}");
                            continue;
                        }
                        assert!(lo <= f64::from(own.lo[axis]) && hi >= f64::from(own.hi[axis]), "{own:?} {node:?}");
                        // Not much larger: by two steps of 255 to twice as many on a side.
                        let side = f64::from(all.hi[axis]) - f64::from(all.lo[axis]);
                        let rounding = 4.0 * f64::from(own.lo[axis].abs().next_up() - own.lo[axis].abs());
                        let excess = (f64::from(own.lo[axis]) - lo).max(hi - f64::from(own.hi[axis]));
                        assert!(excess <= side / 60.0 + rounding, "{excess} of {side}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_slot_tells_what_it_holds() {
        let mut node: BvhNode = bytemuck::Zeroable::zeroed();
        (node.first_child, node.first_primitive, node.exponents[3]) = (100, 50, 0b1000_0101);
        node.slots = [56, 0x20, 58, 0, 0x61, 0xe3, 0, 63];
        let children: Vec<Option<Child>> = (0..CHILDREN).map(|slot| node.child(slot)).collect();
        use Child::{Leaf, Node};
        let [first, second, third] = [Leaf(50, 1), Leaf(51, 2), Leaf(53, 3)];
        let nodes = [100, 101, 102].map(|number| Some(Node(number)));
        let expected = [nodes[0], Some(first), nodes[1], None, Some(second), Some(third), None, nodes[2]];
        assert_eq!(children, expected);
    }
}
