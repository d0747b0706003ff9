//! What shaders do, counted: a copy of a shader that counts its own operations while it runs.

pub(crate) mod cost;
pub(crate) mod counts;
pub(crate) mod instrument;
