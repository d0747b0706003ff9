//! Where the numbers of packed bases stand within the rows of each cluster, and the codes within those of a texel. It follows
//! from the words of the bases, and is kept beside the words for decoders that read many texels one after the other.

use crate::resident::layout::block;
use crate::resident::packed_part::{PackedBasis, PackedPart};

/// A basis of a cluster that has numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PlacedBasis {
    /// Step of its numbers.
    pub step: f32,
    /// Number of bits before its numbers in a row.
    pub bit: u16,
    /// Number of bits before its code in those of a texel.
    pub code_bit: u16,
    /// Number of the basis.
    pub index: u8,
    /// Bits of its code.
    pub code_width: u8,
    /// Bits of a number of each channel, four each, the first channel lowest.
    pub widths: u16,
}

/// The bases with numbers of the clusters of a layer; by default of none.
#[derive(Debug, Clone, Default)]
pub(crate) struct PackedTable {
    bases: Vec<PlacedBasis>,
    /// Number of bases before those of each cluster, and of all.
    ends: Vec<u32>,
}

impl PackedTable {
    /// Makes the table of the layer whose block begins at word `layer`; its bases must be packed.
    pub(crate) fn of_layer(words: &[u32], layer: usize) -> PackedTable {
        let field = |field: usize| words[layer + field] as usize;
        let mut table = PackedTable { bases: Vec::new(), ends: vec![0] };
        let part = PackedPart::new(words, field(block::BASIS));
        for cluster in 0..field(block::CLUSTERS) {
            let (mut bit, mut code_bit) = (0, 0);
            for (index, word) in part.bases(cluster, field(block::BASES)).iter().enumerate() {
                let basis = PackedBasis::from_word(*word);
                let placed = PlacedBasis {
                    step: basis.step() * part.unit(),
                    bit,
                    code_bit,
                    index: index as u8,
                    code_width: basis.code_width as u8,
                    widths: (*word >> 16 & 0xfff) as u16,
                };
                if index == 0 || placed.widths > 0 {
                    table.bases.push(placed);
                }
                bit += basis.widths.iter().sum::<u32>() as u16;
                code_bit += basis.code_width as u16;
            }
            table.ends.push(table.bases.len() as u32);
        }
        table
    }

    /// Returns the bases of a cluster that have numbers, the mean first.
    pub(crate) fn of_cluster(&self, cluster: usize) -> &[PlacedBasis] {
        &self.bases[self.ends[cluster] as usize..self.ends[cluster + 1] as usize]
    }
}
