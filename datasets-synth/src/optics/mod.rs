//! Leaf optics: reflection and transmission at a point of a leaf, in double precision.

pub(crate) mod abm;
pub(crate) mod colour;
pub(crate) mod contents;
pub(crate) mod fresnel;
pub(crate) mod gloss;
pub(crate) mod interface;
pub(crate) mod plates;
pub(crate) mod specific_absorption;
mod tables;
pub(crate) mod two_sided;
pub(crate) mod units;
