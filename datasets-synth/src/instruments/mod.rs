//! Virtual instruments: what a laboratory would measure on a leaf model.

pub(crate) mod goniophotometer;
pub(crate) mod plot;
pub(crate) mod spectrophotometer;
