//! Parameters of a capture of any material, apart from the material itself.

use btf_capture::{CaptureInfo, DirectionSet, ImageFormat};

use crate::error::{SynthError, check_ranges};
use crate::surface::grid::{Grid, MAX_SIDE};

/// Largest side of a capture in texels.
pub const MAX_CAPTURE_SIZE: usize = 2048;

/// Steepest direction that a material is rendered under, in degrees; beyond it a ray crosses more surface than a patch
/// has.
pub const MAX_CAPTURE_THETA_DEG: f64 = 88.0;

/// Patch, directions and images of a capture.
#[derive(Debug, Clone, PartialEq)]
pub struct CaptureParams {
    /// Width and height of the images in texels, 8 to [`MAX_CAPTURE_SIZE`].
    pub size: usize,
    /// Width and height of the patch in millimetres, 1 to 200.
    pub size_mm: f32,
    /// Seed of everything random in the material.
    pub seed: u64,
    /// Directions towards the eye, polar angle at most [`MAX_CAPTURE_THETA_DEG`].
    pub views: DirectionSet,
    /// Directions towards the light, polar angle at most [`MAX_CAPTURE_THETA_DEG`].
    pub lights: DirectionSet,
    /// Format of the images.
    pub format: ImageFormat,
}

impl CaptureParams {
    /// Returns 256 x 256 texels of a patch of `size_mm`, Bonn's 81 x 81 directions, png, seed 1.
    pub fn new(size_mm: f32) -> CaptureParams {
        CaptureParams {
            size: 256,
            size_mm,
            seed: 1,
            views: DirectionSet::bonn81(),
            lights: DirectionSet::bonn81(),
            format: ImageFormat::Png,
        }
    }

    /// Checks every range.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for the first that is out of its range.
    pub fn check(&self) -> Result<(), SynthError> {
        check_ranges(&[
            ("--size", self.size as f64, 8.0, MAX_CAPTURE_SIZE as f64),
            ("--size-mm", f64::from(self.size_mm), 1.0, 200.0),
        ])?;
        for set in [&self.views, &self.lights] {
            if let Some(d) = set.directions().iter().find(|d| d.theta_deg > MAX_CAPTURE_THETA_DEG) {
                let allowed = format!("directions within {MAX_CAPTURE_THETA_DEG} degrees of the normal");
                return Err(SynthError::BadParameter { name: "--directions", value: d.to_string(), allowed });
            }
        }
        Ok(())
    }

    /// Returns the width of a texel in millimetres.
    pub(crate) fn texel_mm(&self) -> f32 {
        self.size_mm / self.size as f32
    }

    /// Returns the grid for heights that stay within `relief_bound_mm` of their mean.
    pub(crate) fn grid(&self, relief_bound_mm: f32) -> Grid {
        Grid::for_patch(self.size, self.size_mm, relief_bound_mm, &self.views)
    }

    /// Refuses a patch so small for its texels that the margin for oblique views would be far larger than the patch.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`].
    pub(crate) fn check_grid(&self, relief_bound_mm: f32) -> Result<(), SynthError> {
        if self.grid(relief_bound_mm).side <= MAX_SIDE {
            return Ok(());
        }
        let allowed = format!("a larger patch or a smaller --size, so that {MAX_SIDE} nodes a side are enough");
        let value = format!("{} for {} texels", self.size_mm, self.size);
        Err(SynthError::BadParameter { name: "--size-mm", value, allowed })
    }

    /// Returns the description of the capture.
    pub(crate) fn info(&self, name: &str, provenance: String) -> CaptureInfo {
        let mut info =
            CaptureInfo::new(name, self.size, self.size, self.views.clone(), self.lights.clone(), self.format);
        info.size_mm = Some([self.size_mm; 2]);
        info.provenance = provenance;
        info
    }
}

#[cfg(test)]
mod tests {
    use btf_capture::Direction;

    use super::*;

    #[test]
    fn parameters_out_of_range_are_named() {
        let good = CaptureParams::new(10.0);
        good.check().unwrap();
        let named = |params: CaptureParams| params.check().unwrap_err().to_string();
        assert!(named(CaptureParams { size: 7, ..good.clone() }).contains("--size is 7"));
        assert!(named(CaptureParams { size_mm: f32::NAN, ..good.clone() }).contains("--size-mm"));
        let lights = DirectionSet::new(vec![Direction::new(89.0, 0.0)]).unwrap();
        assert!(named(CaptureParams { lights, ..good }).contains("--directions"));
    }
}
