//! Leaves whose optics are evaluated live, without a capture.

pub(crate) mod body;
pub(crate) mod error;
pub(crate) mod face_gloss;
pub(crate) mod figures;
pub(crate) mod gloss;
pub(crate) mod leaf;
pub(crate) mod lobe;
pub(crate) mod optics;
pub(crate) mod scatter;
pub(crate) mod state;
pub(crate) mod texture;
pub(crate) mod theta;
pub(crate) mod viewed;
pub mod words;
