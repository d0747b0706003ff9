//! The specular lobe of a leaf's cuticle.

pub(crate) mod lobe;
pub(crate) mod params;
