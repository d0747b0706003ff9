//! Leaf optics: what a point of a leaf does with light, in double precision.

pub(crate) mod colour;
pub(crate) mod contents;
pub(crate) mod cook_torrance;
pub(crate) mod interface;
pub(crate) mod plate_body;
pub(crate) mod plate_exact;
pub(crate) mod plate_model;
pub(crate) mod plate_n;
pub(crate) mod plate_paper;
pub(crate) mod specific_absorption;
mod tables;
pub(crate) mod theta;
