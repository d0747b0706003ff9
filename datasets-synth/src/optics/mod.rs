//! Leaf optics: what a point of a leaf does with light, in double precision.

pub(crate) mod abm97;
pub(crate) mod abm_b;
pub(crate) mod abm_u;
pub(crate) mod colour;
pub(crate) mod contents;
pub(crate) mod fresnel;
pub(crate) mod gloss;
pub(crate) mod gloss_params;
pub(crate) mod interface;
pub(crate) mod path_lengths;
pub(crate) mod plate_body;
pub(crate) mod plate_exact;
pub(crate) mod plate_model;
pub(crate) mod plate_n;
pub(crate) mod plate_paper;
pub(crate) mod scatter_table;
pub(crate) mod specific_absorption;
pub(crate) mod specimen;
pub(crate) mod stack;
mod tables;
pub(crate) mod theta;
pub(crate) mod tissue;
pub(crate) mod two_sided;
pub(crate) mod units;
pub(crate) mod walk;
