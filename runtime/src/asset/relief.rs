//! Shading by relief: how far decoders correct the interpolation between measured directions by what a layer's heights
//! tell of normals, shadows and gloss.

/// Largest value of [`Relief::likeness`].
pub const MAX_LIKENESS: f32 = 1e4;

/// Number of words of a texel's record: slopes as two 16-bit numbers, the root of the albedo as three bytes, then eight
/// horizons as bytes.
pub const RELIEF_WORDS: usize = 4;
/// Slope of one step of a record.
pub const SLOPE_STEP: f32 = 1.0 / 8192.0;
/// Tangent of the horizon's elevation of one step of a record.
pub const HORIZON_STEP: f32 = 1.0 / 64.0;
/// Greatest albedo of a record.
pub const MAX_ALBEDO: f32 = 2.0;
/// Number of azimuths at which records have horizons: every 45 degrees counter-clockwise from +x.
pub const AZIMUTHS: usize = 8;
/// Even light besides the lamp, as a share of the lamp on an upright plane.
pub const EVEN_LIGHT: f32 = 0.2;

/// Shares of the corrections that the heights of a layer give between the measured directions. With all shares 0
/// nothing is corrected. At the measured directions nothing changes in any case.
///
/// Only a layer with heights, the root curve and lobes of [`crate::LobeRole::Base`] has any.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relief {
    /// Rate at which a neighbouring view or light loses weight where it shows a point unlike the one that the eye sees,
    /// 0 to [`MAX_LIKENESS`]. The weight is halved where the mean squared difference in the root curve is the rate's
    /// inverse.
    pub likeness: f32,
    /// Share of the shading of an upright plane that the shading of the relief replaces, 0 to 1.
    pub shading: f32,
    /// Share of the relief's gloss that is added, 0 to 1.
    pub gloss: f32,
}

impl Relief {
    /// Returns the numbers in the order of the file.
    pub fn numbers(&self) -> [f32; 3] {
        [self.likeness, self.shading, self.gloss]
    }

    /// Returns the shares with these numbers; `None` where one is out of its range.
    pub fn from_numbers([likeness, shading, gloss]: [f32; 3]) -> Option<Relief> {
        let fits = (0.0..=MAX_LIKENESS).contains(&likeness) && [shading, gloss].iter().all(|x| (0.0..=1.0).contains(x));
        fits.then_some(Relief { likeness, shading, gloss })
    }
}
