//! Brightness of a capture's samples, from some of its images: what its tone curve and the error that is minimised
//! follow from.

use crate::error::FitError;
use crate::input::pair_stride::{pairs_at_stride, stride_over_pairs};
use btf_capture::{CaptureInfo, ImageFormat, Pixels};
use rayon::prelude::*;

/// Images that are looked at.
const IMAGES: usize = 64;
/// Smallest value that the logarithmic mean takes in, relative to the mean.
const MIN_IN_LOG_MEAN: f64 = 1e-3;
/// Share of the samples above white up to which 8-bit values show a capture.
const MAX_ABOVE_WHITE: f64 = 0.001;

/// Brightness of the linear samples of a capture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Brightness {
    /// Share of the samples above white, which is the capture's `scale`.
    pub above_white: f64,
    /// Mean; negative samples count as 0.
    pub mean: f64,
    /// Logarithmic mean; samples below a thousandth of the mean count as that. Above 0.
    pub log_mean: f64,
    /// Largest sample.
    pub largest: f32,
}

impl Brightness {
    /// Returns whether more samples than one in a thousand are above white.
    pub fn is_above_white(&self) -> bool {
        self.above_white > MAX_ABOVE_WHITE
    }

    /// Returns the brightness of a capture's linear images, from at most 64 of them, which show all views and lights
    /// alike; `None` for 8-bit images and where all is black.
    ///
    /// # Errors
    /// If an image cannot be read.
    pub fn of_capture(
        info: &CaptureInfo,
        read: &(dyn Fn(usize, usize) -> Result<Pixels, FitError> + Sync),
    ) -> Result<Option<Brightness>, FitError> {
        if info.format != ImageFormat::Exr {
            return Ok(None);
        }
        let (pairs, lights) = (info.pair_count(), info.lights.len());
        let stride = stride_over_pairs(pairs.div_ceil(IMAGES), lights);
        let chosen = pairs_at_stride(info, stride);
        let images = chosen.par_iter().map(|pair| match read(pair / lights, pair % lights)? {
            Pixels::Linear(values) => Ok(values),
            Pixels::Encoded8(_) => Ok(Vec::new()),
        });
        let images: Vec<Vec<f32>> = images.collect::<Result<_, FitError>>()?;
        Ok(Brightness::of_samples(&images.concat(), info.scale))
    }

    fn of_samples(samples: &[f32], white: f32) -> Option<Brightness> {
        let count = samples.len().max(1) as f64;
        let mean = samples.iter().map(|x| f64::from(x.max(0.0))).sum::<f64>() / count;
        if mean <= 0.0 {
            return None;
        }
        let logs = samples.iter().map(|x| f64::from(*x).max(MIN_IN_LOG_MEAN * mean).ln()).sum::<f64>();
        Some(Brightness {
            above_white: samples.iter().filter(|x| **x > white).count() as f64 / count,
            mean,
            log_mean: (logs / count).exp(),
            largest: samples.iter().copied().fold(0.0, f32::max),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brightness_is_that_of_the_samples() {
        let found = Brightness::of_samples(&[0.0, 1.0, 4.0, 3.0], 2.0).unwrap();
        assert_eq!((found.above_white, found.mean, found.largest), (0.5, 2.0, 4.0));
        assert!(found.is_above_white());
        assert!((found.log_mean - (0.002f64 * 12.0).powf(0.25)).abs() < 1e-6, "{found:?}");
        assert_eq!(Brightness::of_samples(&[0.0, -0.1], 1.0), None);
    }
}
