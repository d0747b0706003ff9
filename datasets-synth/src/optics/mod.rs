//! Leaf optics: what a point of a leaf does with light, in double precision.

pub(crate) mod colour;
pub(crate) mod cook_torrance;
pub(crate) mod fresnel;
pub(crate) mod plate;
mod tables;
