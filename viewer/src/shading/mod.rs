//! A point of a surface as the eye sees it, whatever its material is.

pub(crate) mod fractal_noise;
pub(crate) mod relief;
pub(crate) mod viewed_body;
