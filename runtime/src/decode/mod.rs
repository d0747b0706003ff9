//! The decoder: from texel, light and eye to reflectance times cosine.

pub(crate) mod decode;
pub(crate) mod evaluate;
pub(crate) mod lobe_queue;
pub(crate) mod measured;
pub(crate) mod options;
pub(crate) mod packed_sum;
pub(crate) mod parallax;
pub(crate) mod part_queue;
pub(crate) mod relief;
pub(crate) mod residual_sum;
pub(crate) mod sample;
pub(crate) mod shown;
#[cfg(test)]
mod tests;
pub(crate) mod texel;
pub(crate) mod viewed_texel;
