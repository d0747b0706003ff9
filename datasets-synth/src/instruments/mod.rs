//! Virtual instruments that measure leaf models as a laboratory measures leaves.

pub(crate) mod goniophotometer;
pub(crate) mod plot;
pub(crate) mod spectrophotometer;
