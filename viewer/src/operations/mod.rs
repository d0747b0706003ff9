//! What shaders do, counted: a copy of a shader that counts its own operations while it runs.

#[cfg(not(target_arch = "wasm32"))]
pub(crate) mod cost;
pub(crate) mod counts;
#[cfg(not(target_arch = "wasm32"))]
pub(crate) mod instrument;
