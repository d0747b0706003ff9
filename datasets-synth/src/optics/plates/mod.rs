//! Plate models: a leaf as one absorbing plate, or as a pile of them.

pub(crate) mod body;
pub(crate) mod exact;
pub(crate) mod halves_slopes;
pub(crate) mod model;
pub(crate) mod paper;
pub(crate) mod pile;
pub(crate) mod shares;
pub(crate) mod slopes;
pub(crate) mod theta;
pub(crate) mod theta_table;
pub(crate) mod two_halves;
