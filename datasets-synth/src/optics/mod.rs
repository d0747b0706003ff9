//! Leaf optics: what a point of a leaf does with light, in double precision.

pub(crate) mod abm97;
pub(crate) mod abm_b;
mod abm_tables;
pub(crate) mod abm_u;
pub(crate) mod colour;
pub(crate) mod cook_torrance;
pub(crate) mod fresnel;
pub(crate) mod path_lengths;
pub(crate) mod plate;
pub(crate) mod scatter_table;
pub(crate) mod stack;
mod tables;
pub(crate) mod tissue;
pub(crate) mod units;
pub(crate) mod walk;
