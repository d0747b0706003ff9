//! Leaves: veins, relief and appearance textures, and the capture of a patch.

pub(crate) mod capture;
pub(crate) mod face;
pub(crate) mod model;
pub(crate) mod patch;
pub(crate) mod plate_leaf;
pub(crate) mod relief;
pub(crate) mod tissue_leaf;
pub(crate) mod venation;
