//! A node of the tree of voxels: which of its cells are not empty, and where their voxels and children are. Twin:
//! `voltex/node.wgsl`.

/// Number of words of a node.
pub const NODE_WORDS: usize = 4;
/// Number in place of a voxel's for an empty cell.
pub const NO_VOXEL: u32 = u32::MAX;

/// A node of the tree. Cells are numbered in Morton order (bit i of the number is bit i / 3 of coordinate i % 3), so
/// that the eight cells of a coarser one are one byte of the mask.
#[derive(Debug, Clone, Copy, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Node {
    /// Bits of the 64 cells: 1 for a cell that is not empty.
    pub mask: [u32; 2],
    /// Number of the node's first voxel. The node has a voxel for each byte of the mask that is not 0, then one for
    /// each bit that is 1.
    pub first_voxel: u32,
    /// Number of the node's first child, of which there is one for each bit that is 1; 0 for a node without children.
    pub first_child: u32,
}

impl Node {
    /// The node in the place of children that are not there: whoever looks for them meets their parent.
    pub(super) const ABSENT: Node = Node { mask: [0; 2], first_voxel: NO_VOXEL, first_child: 0 };

    /// Returns whether a cell is not empty. Twin: `voltex_has`.
    pub(super) fn has(&self, cell: u32) -> bool {
        self.mask[(cell >> 5) as usize] >> (cell & 31) & 1 == 1
    }

    /// Returns whether one of the eight cells of a coarser cell is not empty. Twin: `voltex_has_coarse`.
    pub(super) fn has_coarse(&self, coarse: u32) -> bool {
        self.mask[(coarse >> 2) as usize] >> (8 * (coarse & 3)) & 255 != 0
    }

    /// Returns how many of the cells before `cell` are not empty. Twin: `voltex_rank`.
    pub(super) fn rank(&self, cell: u32) -> u32 {
        let below = (1u64 << cell) - 1;
        (self.mask[0] & below as u32).count_ones() + (self.mask[1] & (below >> 32) as u32).count_ones()
    }

    /// Returns how many cells are not empty.
    pub(super) fn cells(&self) -> u32 {
        self.mask[0].count_ones() + self.mask[1].count_ones()
    }

    /// Returns how many of the coarser cells before `coarse` are not empty; 8 for all. Twin: `voltex_coarse_rank`.
    pub(super) fn coarse_rank(&self, coarse: u32) -> u32 {
        (0..coarse).filter(|c| self.has_coarse(*c)).count() as u32
    }
}

/// Returns the number of layers of nodes of a volume whose finest level has 2^`level_count` voxels a side. A cell of
/// the root, or a coarser one, is the whole volume. Twin: `voltex_node_depth`.
pub(super) fn node_depth(level_count: u32) -> u32 {
    level_count / 2 + 1
}

/// Returns the number of the cell with these coordinates, 0 to 3. Twin: `voltex_cell_number`.
pub(super) fn cell_number(q: [u32; 3]) -> u32 {
    // A coordinate's two bits spread to every third.
    let spread = |x: u32| x & 1 | (x & 2) << 2;
    spread(q[0]) | spread(q[1]) << 1 | spread(q[2]) << 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    #[test]
    fn ranks_count_the_cells_before() {
        let mut random = Random::new(6);
        for _ in 0..1000 {
            let bits = random.bits() & random.bits() & random.bits();
            let node = Node { mask: [bits as u32, (bits >> 32) as u32], first_voxel: 0, first_child: 0 };
            for cell in 0..64 {
                let before = (0..cell).filter(|c| bits >> c & 1 == 1).count() as u32;
                assert_eq!((node.rank(cell), node.has(cell)), (before, bits >> cell & 1 == 1));
            }
            let bytes = bits.to_le_bytes();
            for coarse in 0..=8 {
                assert_eq!(
                    node.coarse_rank(coarse),
                    bytes[..coarse as usize].iter().filter(|b| **b != 0).count() as u32
                );
            }
        }
        // Morton order: bit i of the number is bit i / 3 of coordinate i % 3.
        assert_eq!([[1, 0, 0], [0, 1, 0], [0, 0, 1], [2, 0, 0], [3, 3, 3]].map(cell_number), [1, 2, 4, 8, 63]);
    }
}
