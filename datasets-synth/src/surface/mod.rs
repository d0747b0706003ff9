//! Mesostructure: what a relief of any material needs to be photographed.

pub(crate) mod bounce;
pub(crate) mod capture;
pub(crate) mod capture_params;
pub(crate) mod grid;
pub(crate) mod height_field;
pub(crate) mod noise;
pub(crate) mod rig;
pub(crate) mod table;
