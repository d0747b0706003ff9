//! Leaves: veins, displacement and appearance textures, and the capture of a patch.

pub(crate) mod capture;
pub(crate) mod chlorosis;
pub(crate) mod face;
pub(crate) mod look;
pub(crate) mod model;
pub(crate) mod params;
pub(crate) mod patch;
pub(crate) mod plate_leaf;
pub(crate) mod relief;
pub(crate) mod species;
pub(crate) mod table;
pub(crate) mod textures;
pub(crate) mod tissue_leaf;
pub(crate) mod venation;
