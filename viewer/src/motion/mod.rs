//! Motion vectors: where each pixel's content was in the picture before, for compositors, temporal denoisers and
//! upscalers. They are computed from the scene on the CPU, whichever renderer draws the picture.

pub(crate) mod motion_picture;
pub(crate) mod pose;
pub(crate) mod vectors;

#[cfg(test)]
mod tests;
