//! Optical models of a blade.

use crate::optics::abm::abm_b::AbmB;
use crate::optics::abm::abm_u::AbmU;
use crate::optics::abm::abm97::Abm97;
use crate::optics::abm::tissue::Tissue;
use crate::optics::plates::model::PlateModel;
use crate::optics::plates::two_halves::TwoHalves;

/// Optical model of a blade.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LeafModel {
    /// Absorbing plates below a Cook-Torrance lobe, with contents by [`crate::LeafContents`].
    Plate(PlateModel),
    /// Two unequal piles of plates below a Cook-Torrance lobe, with contents by [`crate::LeafContents`].
    TwoSided(TwoHalves),
    /// Random walk of 1997, with its own surface and contents.
    Abm97(Abm97),
    /// Random walk through a two-sided leaf.
    AbmB(AbmB),
    /// Random walk through a one-sided leaf.
    AbmU(AbmU),
}

impl Default for LeafModel {
    /// Returns `plate-n`.
    fn default() -> LeafModel {
        LeafModel::Plate(PlateModel::N)
    }
}

impl LeafModel {
    /// Returns the name of the model on the command line.
    pub fn name(&self) -> &'static str {
        match self {
            LeafModel::Plate(model) => model.name(),
            LeafModel::TwoSided(_) => "plate-two-sided",
            LeafModel::Abm97(_) => "abm97",
            LeafModel::AbmB(_) => "abm-b",
            LeafModel::AbmU(_) => "abm-u",
        }
    }

    /// Returns the tissue that rays walk through, for the algorithmic models.
    pub fn tissue(&self) -> Option<&dyn Tissue> {
        match self {
            LeafModel::Plate(_) | LeafModel::TwoSided(_) => None,
            LeafModel::Abm97(tissue) => Some(tissue),
            LeafModel::AbmB(tissue) => Some(tissue),
            LeafModel::AbmU(tissue) => Some(tissue),
        }
    }
}
