//! Leaf optics: what a point of a leaf does with light, in double precision.

pub(crate) mod colour;
pub(crate) mod fresnel;
pub(crate) mod gloss;
pub(crate) mod plate;
mod tables;
pub(crate) mod two_sided;
