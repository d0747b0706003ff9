//! Bricks: the parts by which the fine levels of a file are stored, read and kept. A brick is a voxel of the level with
//! eight voxels a side, and what lies in it at finer levels.

use super::level_stream::PlacedVoxel;
use super::volume::order;
use std::ops::Range;

/// Level of a file, counted from the coarsest, whose voxels are the bricks.
pub const BRICK_LEVEL: u32 = 3;
/// Finest level of a file, counted from the coarsest, that is stored whole: 128 voxels a side. Finer ones are stored by
/// brick.
pub const MAX_WHOLE_LEVEL: u32 = 7;

/// The number of a brick's voxels at one level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BrickCount {
    /// Voxels that are not empty.
    pub voxels: u32,
    /// Second sorts of microflakes in their cells.
    pub others: u32,
}

/// Returns the index of the section of a brick at a level.
pub(super) fn brick_index(level: u32, brick: u64) -> u32 {
    level << (3 * BRICK_LEVEL) | brick as u32
}

/// Returns the level whose voxels a Brick section of this index has.
pub fn level_of_brick(index: u32) -> u32 {
    index >> (3 * BRICK_LEVEL)
}

/// Returns the Morton numbers of the bricks, ascending; `voxels` are those of [`BRICK_LEVEL`], by their coordinates.
pub(super) fn bricks_of<T>(voxels: &[([u32; 3], T)]) -> Vec<u64> {
    voxels.iter().map(|(at, _)| order(*at)).collect()
}

/// Returns where a level, not coarser than [`BRICK_LEVEL`], has the voxels of a brick.
pub(super) fn within_brick(voxels: &[PlacedVoxel], level: u32, brick: u64) -> Range<usize> {
    let shift = 3 * (level - BRICK_LEVEL);
    let first = |brick: u64| voxels.partition_point(|(at, _)| order(*at) >> shift < brick);
    first(brick)..first(brick + 1)
}
