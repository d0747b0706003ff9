//! The GPU renderer: device, buffers, pipelines, passes.

pub(crate) mod acceleration_structure;
pub(crate) mod arena;
pub(crate) mod backend;
pub(crate) mod device;
pub(crate) mod expand;
pub(crate) mod frame;
pub(crate) mod layout;
pub(crate) mod limits;
pub(crate) mod modules;
pub(crate) mod operation_counters;
pub(crate) mod pass_shaders;
pub(crate) mod pieces;
pub(crate) mod pipeline_constants;
pub(crate) mod pipelines;
pub(crate) mod preparation;
pub(crate) mod queries;
pub(crate) mod results;
pub(crate) mod scene_change;
pub(crate) mod scene_words;
pub(crate) mod structure;
pub(crate) mod target;
#[cfg(test)]
mod tests;
pub(crate) mod tracer;
