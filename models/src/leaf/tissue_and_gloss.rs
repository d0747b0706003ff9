//! Returns contents and gloss of a leaf as one array of numbers.

use crate::leaf::description::LeafDescription;
use crate::leaf::quantity::LEAF_QUANTITIES;

impl LeafDescription {
    /// Returns contents and gloss in the units and the order of the first ten [`LEAF_QUANTITIES`].
    pub fn tissue_and_gloss(&self) -> [f32; 10] {
        std::array::from_fn(|i| LEAF_QUANTITIES[i].of(self) as f32)
    }
}
