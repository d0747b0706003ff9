//! The options of one evaluation: precision against time.

/// The rule by which the residual is carried from the measured directions to others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Interpolation {
    /// Interpolates the residual, then combines it with the lobes. Costs one evaluation of the lobes.
    Fast = 0,
    /// Decodes the nine neighbours to linear, interpolates those, and multiplies by the clamped ratio of the lobes here
    /// to the lobes interpolated. Costs ten evaluations of the lobes.
    Exact = 1,
}

impl Interpolation {
    /// Returns the name on command lines and in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Interpolation::Fast => "fast",
            Interpolation::Exact => "exact",
        }
    }
}

/// The use that decoders make of a layer's heights.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u32)]
pub enum HeightUse {
    /// Ignores them.
    None = 0,
    /// Removes the parallax of eyes outside the measured views' hull. Costs four rays through the heights, and three
    /// texels in place of one.
    Parallax = 1,
    /// Also corrects what is interpolated between the measured directions, where the layer has [`crate::Relief`]. Fast
    /// rule only. Costs four rays, and the shading of up to ten points a light.
    Relief = 2,
}

impl HeightUse {
    /// All uses, each with those before it.
    pub const ALL: [HeightUse; 3] = [HeightUse::None, HeightUse::Parallax, HeightUse::Relief];

    /// Returns the use that is left where the parallax, with all that stands on it, or the relief alone is not wanted.
    pub fn unless(no_parallax: bool, no_relief: bool) -> HeightUse {
        match (no_parallax, no_relief) {
            (true, _) => HeightUse::None,
            (false, true) => HeightUse::Parallax,
            (false, false) => HeightUse::Relief,
        }
    }

    /// Returns the use with a number; `None` for an unknown one.
    pub fn from_number(number: u32) -> Option<HeightUse> {
        HeightUse::ALL.into_iter().find(|known| *known as u32 == number)
    }

    /// Returns the name on command lines and in JSON.
    pub fn name(self) -> &'static str {
        match self {
            HeightUse::None => "none",
            HeightUse::Parallax => "parallax",
            HeightUse::Relief => "relief",
        }
    }
}

/// The options of one evaluation, from fast to exact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DecodeOptions {
    /// Largest number of residual components that are used; `u32::MAX` for all. 0 keeps the residual's mean.
    pub components: u32,
    /// Largest number of lobes of a texel that are used; `u32::MAX` for all.
    pub lobes: u32,
    /// Interpolation rule.
    pub interpolation: Interpolation,
    /// Use of the heights, where the asset has any.
    pub heights: HeightUse,
}

impl Default for DecodeOptions {
    fn default() -> DecodeOptions {
        DecodeOptions {
            components: u32::MAX,
            lobes: u32::MAX,
            interpolation: Interpolation::Fast,
            heights: HeightUse::Relief,
        }
    }
}

/// Number added to both lobe sums before their ratio is taken (exact rule).
pub const RATIO_EPSILON: f32 = 0.03;
/// Range to which the ratio of the lobe sums is clamped (exact rule).
pub const RATIO_RANGE: [f32; 2] = [0.3, 4.0];
