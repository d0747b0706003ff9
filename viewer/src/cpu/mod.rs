//! The reference renderer.

pub(crate) mod cpu;
pub(crate) mod volumes;
