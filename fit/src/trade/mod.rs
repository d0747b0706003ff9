//! Speed against accuracy against bytes, over a grid of settings.

pub(crate) mod evaluation_time;
pub(crate) mod gpu_clock;
pub(crate) mod grid;
pub(crate) mod page;
pub(crate) mod params;
pub(crate) mod pareto;
pub(crate) mod point;
pub(crate) mod trade;
