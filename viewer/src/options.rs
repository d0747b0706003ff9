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

/// Largest [`ShadeOptions::depth`].
pub const MAX_DEPTH: u32 = 16;

impl Default for ShadeOptions {
    fn default() -> ShadeOptions {
        ShadeOptions { decode: DecodeOptions::default(), depth: 4 }
    }
}
