//! Leaf optics: what a point of a leaf does with light, in double precision.

pub(crate) mod cook_torrance;
pub(crate) mod plate;
pub(crate) mod spectrum;
mod tables;
