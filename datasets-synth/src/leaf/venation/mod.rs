//! Veins of a leaf: where they run, and the place of a point among them.

pub(crate) mod parallel;
pub(crate) mod pinnate;
pub(crate) mod site;
pub(crate) mod traits;
pub(crate) mod vein;
pub(crate) mod veins;
