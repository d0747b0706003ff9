//! Leaves: veins, relief and appearance textures, and the capture of a patch.

pub(crate) mod capture;
pub(crate) mod patch;
pub(crate) mod relief;
pub(crate) mod shading;
pub(crate) mod venation;
