//! Pictures without a window, and how much of a scene they need.

pub(crate) mod bricks;
pub(crate) mod control;
pub(crate) mod engine;
pub(crate) mod governor;
pub(crate) mod headless;
pub(crate) mod plan;
mod plan_memory;
#[cfg(not(target_arch = "wasm32"))]
pub(crate) mod server;
pub(crate) mod transition_cost;
