//! Shading by relief: how far decoders correct the interpolation between measured directions by what a layer's heights
//! tell of normals, shadows and gloss.

/// Largest value of [`Relief::likeness`].
pub const MAX_LIKENESS: f32 = 1e4;

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
