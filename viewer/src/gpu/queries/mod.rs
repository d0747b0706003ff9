//! Lists of questions that shaders answer, for comparison with the CPU and for timing.

pub(crate) mod decode_queries;
pub(crate) mod expand_queries;
pub(crate) mod shader_queries;
pub(crate) mod walk_queries;
