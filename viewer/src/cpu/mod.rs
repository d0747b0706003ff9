//! The reference renderer: the CPU decoder and hierarchy, with the formulas of the shaders. Each `.wgsl` is the twin of
//! the `.rs` beside it.

pub(crate) mod air;
pub(crate) mod bounced_light;
pub(crate) mod direct_light;
pub(crate) mod integrator;
pub(crate) mod path;
pub(crate) mod pick;
pub(crate) mod picture;
pub(crate) mod scatter;
pub(crate) mod shader;
pub(crate) mod volumes;
