//! What the entry points read and write, as Rust has it. Twins: `queries.wgsl`, `depths.wgsl`; a test compares
//! names and offsets.

use btf_runtime::DecodeOptions;
use bytemuck::{Pod, Zeroable};

/// Questions that one workgroup answers. Twin: `@workgroup_size`.
pub const WORKGROUP: u32 = 64;

/// One question; 64 bytes. See `queries.wgsl` for what each entry point reads.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub struct Query {
    /// Unit vector to the light; for `sample_main` three numbers in [0, 1) to draw with.
    pub wi: [f32; 3],
    /// Level, 0 the finest.
    pub level: u32,
    /// Unit vector to the eye.
    pub wo: [f32; 3],
    /// First word of the asset in the buffer of asset words.
    pub asset: u32,
    /// Texture coordinate.
    pub uv: [f32; 2],
    /// The speed and accuracy dial.
    pub options: Options,
    /// Zeros.
    pub pad: [u32; 2],
}

/// [`DecodeOptions`] as the shader has them; 16 bytes. Twin: `BtfOptions`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Options {
    /// Residual components at most.
    pub components: u32,
    /// Lobes per texel at most.
    pub lobes: u32,
    /// [`btf_runtime::Interpolation`] as a number.
    pub interpolation: u32,
    /// 1 removes the parallax of eyes outside the measured views' hull, 0 leaves it.
    pub parallax: u32,
}

impl From<DecodeOptions> for Options {
    fn from(options: DecodeOptions) -> Options {
        let DecodeOptions { components, lobes, interpolation, parallax } = options;
        Options { components, lobes, interpolation: interpolation as u32, parallax: parallax.into() }
    }
}

/// The answer to one question; 32 bytes. See `queries.wgsl` for what each entry point writes.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub struct Answer {
    /// Unit vector to the light that was drawn.
    pub wi: [f32; 3],
    /// Probability density, per steradian.
    pub density: f32,
    /// `pi * BRDF * |n.wi|`, linear RGB.
    pub value: [f32; 3],
    /// Zero.
    pub pad: f32,
}

/// One ray through a volumetric texture; 48 bytes. See `depths.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub struct Ray {
    /// Where t is 0, in texture space.
    pub origin: [f32; 3],
    /// Level of the voxels, 0 the finest.
    pub level: u32,
    /// Way per t.
    pub direction: [f32; 3],
    /// First word of the volume in the buffer of words.
    pub volume: u32,
    /// Where the ray begins.
    pub t0: f32,
    /// Where it ends.
    pub t1: f32,
    /// Zeros.
    pub pad: [u32; 2],
}

/// The answer to one ray; 16 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub struct Depth {
    /// Optical depth.
    pub depth: f32,
    /// Where the first voxel with microflakes begins; `t1` if there is none.
    pub first_t: f32,
    /// Its number, or [`btf_runtime::voltex::NO_VOXEL`].
    pub first_voxel: u32,
    /// Cells that the ray went through.
    pub steps: u32,
}

/// Which questions a dispatch answers; 16 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Range {
    /// Number of the first question.
    pub first: u32,
    /// How many, at most 65535 times [`WORKGROUP`].
    pub count: u32,
    /// Zeros.
    pub pad: [u32; 2],
}
