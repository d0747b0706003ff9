//! How a picture is computed: what costs time and changes accuracy.

use btf_runtime::DecodeOptions;

/// The settings of a rendering that trade speed for accuracy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShadeOptions {
    /// How assets are decoded.
    pub decode: DecodeOptions,
    /// Rays of a path at most, the first from the eye: 1 shows no mirror images, 1 to [`MAX_DEPTH`].
    pub depth: u32,
}

/// How the GPU decodes a texel that several lights shine on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DecoderForm {
    /// What depends on texel and eye once, and for each light the rest.
    #[default]
    Halves,
    /// Everything anew for every light: what the halves are measured by.
    Whole,
}

/// Largest [`ShadeOptions::depth`].
pub const MAX_DEPTH: u32 = 16;

impl Default for ShadeOptions {
    fn default() -> ShadeOptions {
        ShadeOptions { decode: DecodeOptions::default(), depth: 4 }
    }
}
