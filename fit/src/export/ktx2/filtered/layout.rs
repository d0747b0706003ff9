//! Sizes of the textures of a layer, and how many components a size in memory allows.

use crate::export::ktx2::filtered::bc4;

/// Bytes of a block of 4 x 4 texels in BC5 and in BC7.
pub const BLOCK_BYTES: usize = 2 * bc4::BLOCK_BYTES;
/// Components at least: two with mip levels and two without.
pub const MIN_COMPONENTS: usize = 4;
/// Components at most: as many array layers as WebGPU has by default.
pub const MAX_COMPONENTS: usize = 256;
/// One component in so many has mip levels.
const COARSE_SHARE: usize = 4;
/// Bytes of a texel of the mean (halves) and of the tables (singles).
const MEAN_BYTES: usize = 8;
const TABLE_BYTES: usize = 16;

/// Sizes of a layer's textures.
#[derive(Debug, Clone)]
pub struct Layout {
    /// Width and height of each mip level of the planes.
    pub levels: Vec<[usize; 2]>,
    /// Nodes a side of a view's tile ([`super::light_map`]).
    pub nodes: usize,
    /// Tiles in a row of the bases, and rows of tiles.
    pub tiles: [usize; 2],
    /// Texels of the tables without the planes' scales.
    pub table_texels: usize,
}

impl Layout {
    /// Returns the width and the height of the bases.
    pub fn atlas(&self) -> [usize; 2] {
        self.tiles.map(|tiles| tiles * self.nodes)
    }

    /// Returns how many of `components` have mip levels: an even number.
    pub fn coarse(components: usize) -> usize {
        components.div_ceil(COARSE_SHARE).next_multiple_of(2).min(components)
    }

    /// Returns the bytes that textures of `components` (an even number) take in memory, mip levels included.
    pub fn bytes(&self, components: usize) -> usize {
        let blocks = |[width, height]: [usize; 2]| width.div_ceil(4) * height.div_ceil(4);
        let coarse = Layout::coarse(components);
        let all_levels: usize = self.levels.iter().map(|size| blocks(*size)).sum();
        let planes = coarse / 2 * all_levels + (components - coarse) / 2 * blocks(self.levels[0]);
        let [width, height] = self.atlas();
        let bases = components * blocks([width, height]);
        let tables = (self.table_texels + components / 2).next_multiple_of(64);
        (planes + bases) * BLOCK_BYTES + width * height * MEAN_BYTES + tables * TABLE_BYTES
    }

    /// Returns the largest even number of components whose textures take at most `bytes`; 0 if not even [`MIN_COMPONENTS`] do.
    pub fn components_within(&self, bytes: usize) -> usize {
        (MIN_COMPONENTS / 2..=MAX_COMPONENTS / 2)
            .map(|pairs| 2 * pairs)
            .take_while(|count| self.bytes(*count) <= bytes)
            .last()
            .unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_those_of_the_textures() {
        let levels = vec![[8, 4], [4, 2], [2, 1], [1, 1]];
        let layout = Layout { levels, nodes: 4, tiles: [2, 1], table_texels: 64 };
        // Two components with levels (2 + 1 + 1 + 1 blocks), four without; bases of two blocks each.
        assert_eq!(Layout::coarse(6), 2);
        let (planes, bases, mean, tables) = (5 + 2 * 2, 6 * 2, 8 * 4 * 8, 128 * 16);
        assert_eq!(layout.bytes(6), (planes + bases) * 16 + mean + tables);
        assert_eq!(layout.components_within(layout.bytes(6)), 6);
        assert_eq!(layout.components_within(layout.bytes(6) - 1), 4);
        assert_eq!(
            (layout.components_within(layout.bytes(4) - 1), layout.components_within(usize::MAX)),
            (0, MAX_COMPONENTS)
        );
    }
}
