//! The structs that the entry points read and write. Twins: `queries.wgsl`, `depths.wgsl`; a test compares names and
//! offsets.

use btf_runtime::DecodeOptions;
use bytemuck::{Pod, Zeroable};

/// Number of questions that one workgroup answers. Twin: `@workgroup_size`.
pub const WORKGROUP: u32 = 64;

/// A question; 64 bytes. `queries.wgsl` says which fields each entry point reads.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub struct Query {
    /// Unit vector to the light; for `sample_main` three numbers in [0, 1) to draw with.
    pub wi: [f32; 3],
    /// Level, 0 the finest.
    pub level: u32,
    /// Unit vector to the eye.
    pub wo: [f32; 3],
    /// Index of the asset's first word in the buffer of assets.
    pub asset: u32,
    /// Texture coordinate.
    pub uv: [f32; 2],
    /// Options of the evaluation.
    pub options: Options,
    /// Padding: zeros.
    pub pad: [u32; 2],
}

/// The options of an evaluation in the shader's layout; 16 bytes. Made from [`DecodeOptions`]. Twin: `BtfOptions`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Options {
    /// Largest number of residual components that are used.
    pub components: u32,
    /// Largest number of lobes of a texel that are used.
    pub lobes: u32,
    /// Number of a [`btf_runtime::Interpolation`].
    pub interpolation: u32,
    /// Number of the [`HeightUse`](btf_runtime::HeightUse).
    pub heights: u32,
}

impl From<DecodeOptions> for Options {
    fn from(options: DecodeOptions) -> Options {
        let DecodeOptions { components, lobes, interpolation, heights } = options;
        Options { components, lobes, interpolation: interpolation as u32, heights: heights as u32 }
    }
}

/// The answer to a question; 32 bytes. `queries.wgsl` says which fields each entry point writes.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub struct Answer {
    /// Unit vector to the light that was drawn.
    pub wi: [f32; 3],
    /// Probability density, per steradian.
    pub density: f32,
    /// `pi * BRDF * |n.wi|`, linear RGB.
    pub value: [f32; 3],
    /// Padding: zero.
    pub pad: f32,
}

/// A ray through a volumetric texture; 48 bytes. Twin: `Ray` in `depths.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub struct Ray {
    /// Point at t = 0, in texture space.
    pub origin: [f32; 3],
    /// Level of the voxels, 0 the finest.
    pub level: u32,
    /// Distance in texture space per unit of t.
    pub direction: [f32; 3],
    /// First word of the volume in the buffer of words.
    pub volume: u32,
    /// Beginning of the followed part, in t.
    pub t0: f32,
    /// End of the followed part, in t.
    pub t1: f32,
    /// Padding: zeros.
    pub pad: [u32; 2],
}

/// The answer to a ray; 16 bytes. Twin: `Depth` in `depths.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub struct Depth {
    /// Optical depth.
    pub depth: f32,
    /// Beginning of the first voxel with microflakes; `t1` if there is none.
    pub first_t: f32,
    /// Number of that voxel, or [`btf_runtime::voltex::NO_VOXEL`].
    pub first_voxel: u32,
    /// Number of cells that the ray went through.
    pub steps: u32,
}

/// The questions that a dispatch answers; 16 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Range {
    /// Number of the first question.
    pub first: u32,
    /// Number of questions, at most 65535 times [`WORKGROUP`].
    pub count: u32,
    /// Padding: zeros.
    pub pad: [u32; 2],
}
