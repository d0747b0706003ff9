//! Numerical methods that several stages share.

pub(crate) mod principal_directions;
