//! The options of one evaluation: how exact and how fast it is.

/// How the residual is carried from the measured directions to others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Interpolation {
    /// Interpolate the residual, then combine it with the lobes: one lobe evaluation.
    Fast = 0,
    /// Decode the nine neighbours to linear, interpolate those, multiply by the clamped ratio of the
    /// lobes here to the lobes interpolated: ten lobe evaluations.
    Exact = 1,
}

impl Interpolation {
    /// As on command lines and in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Interpolation::Fast => "fast",
            Interpolation::Exact => "exact",
        }
    }
}

/// The speed and accuracy dial of one evaluation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DecodeOptions {
    /// Residual components at most; `u32::MAX` for all. 0 keeps the residual's mean.
    pub components: u32,
    /// Lobes per texel at most; `u32::MAX` for all.
    pub lobes: u32,
    /// Interpolation rule.
    pub interpolation: Interpolation,
    /// Remove the parallax of eyes outside the measured views' hull, where the asset has heights: four rays through
    /// them, and three texels in place of one.
    pub parallax: bool,
}

impl Default for DecodeOptions {
    fn default() -> DecodeOptions {
        DecodeOptions { components: u32::MAX, lobes: u32::MAX, interpolation: Interpolation::Fast, parallax: true }
    }
}

/// Added to both lobe sums before their ratio is taken (exact rule).
pub const RATIO_EPSILON: f32 = 0.03;
/// Range of that ratio.
pub const RATIO_RANGE: [f32; 2] = [0.3, 4.0];
