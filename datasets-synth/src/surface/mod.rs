//! Mesostructure: height fields of any material, and their photography.

pub(crate) mod bounce;
pub(crate) mod capture;
pub(crate) mod capture_params;
pub(crate) mod grid;
pub(crate) mod height_field;
pub(crate) mod noise;
pub(crate) mod rig;
pub(crate) mod table;
