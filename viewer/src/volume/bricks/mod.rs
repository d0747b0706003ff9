//! Bricks of volumetric textures: which of them cameras need, and how fine they may be within a budget of memory.

mod need;
mod plan;

pub(crate) use need::BrickView;
pub(crate) use plan::BrickPlan;
