//! Diffuse colour of each texel of a capture, or its bands: what its body sends back, without gloss and shadows.
//!
//! Under each of some pairs of view and light that are neither grazing nor near the mirror direction a texel shows
//! `colour x cosine`. Gloss adds to a few of them, shadows take from a few; the median over all is neither.

use btf_capture::{Capture, CaptureInfo, Pixels};
use rayon::prelude::*;

use crate::error::SynthError;
use crate::surface::capture::Progress;
use crate::vector::dot;

/// Polar angle in degrees up to which views and lights count.
const MAX_THETA_DEG: f64 = 62.0;
/// Angle in degrees from the mirror direction from which on a view counts.
const MIN_FROM_MIRROR_DEG: f64 = 35.0;
/// Pairs that are looked at, at most, and the bytes that their values may take.
pub(crate) const MAX_PAIRS: usize = 48;
const MAX_BYTES: usize = 1 << 30;
/// Pairs below which a median says little.
const MIN_PAIRS: usize = 3;
/// Standard error of a colour at least: that of 8-bit values.
const MIN_ERROR: f32 = 2e-3;
/// Standard deviation of normal errors over their median absolute deviation, and of a median over that of a mean.
const DEVIATION: f32 = 1.4826;
const MEDIAN: f32 = 1.2533;

/// Colour of each texel, row-major from the top left.
#[derive(Debug, Clone)]
pub(crate) struct DiffuseColour {
    /// Channels of a texel: linear sRGB, or bands.
    pub(crate) channels: usize,
    /// Shares of the light that falls in, `[texel, channel]`.
    pub(crate) values: Vec<f32>,
    /// Standard error of each, from how the pairs differ.
    pub(crate) errors: Vec<f32>,
}

impl DiffuseColour {
    /// Returns the colour as the other face has it, whose rows of `width` texels run the other way.
    pub(crate) fn turned_over(mut self, width: usize) -> DiffuseColour {
        for rows in [&mut self.values, &mut self.errors] {
            for row in rows.chunks_exact_mut(width * self.channels) {
                row.reverse();
                row.chunks_exact_mut(self.channels).for_each(<[f32]>::reverse);
            }
        }
        self
    }

    /// Returns the values of a texel.
    pub(crate) fn value(&self, texel: usize) -> &[f32] {
        &self.values[texel * self.channels..(texel + 1) * self.channels]
    }

    /// Returns the standard errors of a texel.
    pub(crate) fn error(&self, texel: usize) -> &[f32] {
        &self.errors[texel * self.channels..(texel + 1) * self.channels]
    }

    /// Returns the medians over all texels, of values and of errors.
    pub(crate) fn medians(&self) -> [Vec<f32>; 2] {
        [&self.values, &self.errors].map(|all| {
            let of = |channel: usize| {
                median(&mut all.iter().skip(channel).step_by(self.channels).copied().collect::<Vec<_>>())
            };
            (0..self.channels).map(of).collect()
        })
    }
}

/// Returns the colour of each texel of `capture`; for a capture in bands, those of its `bands`, where some are given.
///
/// # Errors
/// Those of reading; [`SynthError::BadParameter`] for a capture without enough pairs that count;
/// [`SynthError::Stopped`] if `progress`, which gets the number of images read, asks for it.
pub(crate) fn diffuse_colour(
    capture: &Capture,
    bands: Option<&[usize]>,
    progress: Progress,
) -> Result<DiffuseColour, SynthError> {
    let info = capture.info();
    let texels = info.texel_count();
    let channels = bands.map_or(3, <[usize]>::len);
    let pairs = chosen(info, (MAX_BYTES / (4 * channels * texels).max(1)).clamp(MIN_PAIRS, MAX_PAIRS));
    if pairs.len() < MIN_PAIRS {
        return Err(SynthError::BadParameter {
            name: "--capture",
            value: info.name.clone(),
            allowed: format!(
                "one with {MIN_PAIRS} images or more below {MAX_THETA_DEG} degrees and {MIN_FROM_MIRROR_DEG} degrees off the mirror direction"
            ),
        });
    }
    let done = std::sync::atomic::AtomicUsize::new(0);
    let images: Vec<Vec<f32>> = pairs
        .par_iter()
        .map(|pair| {
            let (view, light) = (pair / info.lights.len(), pair % info.lights.len());
            let cosine = info.lights.directions()[light].theta_deg.to_radians().cos().abs() as f32;
            let linear: Vec<f32> = match bands {
                Some(bands) => {
                    let all = capture.read_bands(view, light)?;
                    let texels = all.chunks_exact(info.wavelengths_nm.len());
                    texels.flat_map(|texel| bands.iter().map(|band| texel[*band])).collect()
                }
                None => match capture.read(view, light)? {
                    Pixels::Encoded8(values) => {
                        let table = info.linear_from_encoded8(light);
                        values.iter().map(|value| table[usize::from(*value)]).collect()
                    }
                    Pixels::Linear(values) => values,
                },
            };
            let done = 1 + done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            if progress(done, pairs.len()).is_break() {
                return Err(SynthError::Stopped);
            }
            Ok(linear.iter().map(|value| value / cosine).collect())
        })
        .collect::<Result<_, SynthError>>()?;
    let (values, errors) = (0..texels * channels).into_par_iter().map(|at| median_over(&images, at)).unzip();
    Ok(DiffuseColour { channels, values, errors })
}

/// Returns the pairs that count, at most `most`, spread over all.
fn chosen(info: &CaptureInfo, most: usize) -> Vec<usize> {
    let (views, lights) = (info.views.units(), info.lights.units());
    let least_cos = MAX_THETA_DEG.to_radians().cos() as f32;
    let most_along = MIN_FROM_MIRROR_DEG.to_radians().cos() as f32;
    let counts = |pair: &usize| {
        let (wo, wi) = (views[pair / lights.len()], lights[pair % lights.len()]);
        // Behind the leaf the light goes straight on, which no gloss does.
        let mirror = [-wi[0], -wi[1], wi[2]];
        wo[2] >= least_cos && wi[2].abs() >= least_cos && (info.side.is_transmission() || dot(wo, mirror) < most_along)
    };
    let all: Vec<usize> = info.present_pairs().filter(counts).collect();
    let count = most.min(all.len());
    // Steps of the golden ratio meet views and lights alike, where even steps would keep to some lights.
    let mut order: Vec<(f64, usize)> =
        all.iter().enumerate().map(|(i, pair)| ((i as f64 * GOLDEN).fract(), *pair)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut pairs: Vec<usize> = order[..count].iter().map(|(_, pair)| *pair).collect();
    pairs.sort_unstable();
    pairs
}

/// Fraction of the golden ratio.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Returns the median over the images at place `at`, and its standard error.
fn median_over(images: &[Vec<f32>], at: usize) -> (f32, f32) {
    let mut values: Vec<f32> = images.iter().map(|image| image[at]).collect();
    let middle = median(&mut values);
    values.iter_mut().for_each(|value| *value = (*value - middle).abs());
    let deviation = DEVIATION * median(&mut values);
    (middle, (MEDIAN * deviation / (images.len() as f32).sqrt()).max(MIN_ERROR))
}

/// Returns the median: the mean of the two in the middle of an even number.
pub(crate) fn median(values: &mut [f32]) -> f32 {
    let (count, middle) = (values.len(), values.len() / 2);
    let (below, upper, _) = values.select_nth_unstable_by(middle, f32::total_cmp);
    match count % 2 {
        1 => *upper,
        _ => 0.5 * (*upper + below.iter().copied().fold(f32::MIN, f32::max)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_capture::{DirectionSet, ImageFormat};

    #[test]
    fn the_middle_of_even_and_odd_numbers_is_found() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [4.0, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!(median(&mut [7.0]), 7.0);
    }

    #[test]
    fn gloss_and_shadow_leave_the_colour_of_the_body() {
        let set = DirectionSet::random(9, 3).unwrap();
        let info = CaptureInfo::new("body", 2, 1, set.clone(), set.clone(), ImageFormat::Exr);
        let units = set.units();
        let colours = [[0.2, 0.3, 0.1], [0.05, 0.1, 0.02]];
        let images = |gloss: f32| {
            let mut images = Vec::new();
            for wo in &units {
                for wi in &units {
                    let along = dot(*wo, [-wi[0], -wi[1], wi[2]]).max(0.0).powi(40);
                    for colour in colours {
                        images.extend(colour.map(|x: f32| x * wi[2] + gloss * along));
                    }
                }
            }
            images
        };
        let go_on = |_: usize, _: usize| std::ops::ControlFlow::Continue(());
        let of = |images: Vec<f32>| {
            diffuse_colour(&Capture::from_linear(info.clone(), images).unwrap(), None, &go_on).unwrap()
        };
        let mut shadowed = images(2.0);
        // One view in nine lies in shadow.
        shadowed[..6 * 9].fill(0.0);
        let found = of(shadowed);
        for (texel, colour) in colours.into_iter().enumerate() {
            let found = found.value(texel);
            assert!(found.iter().zip(colour).all(|(x, y)| (x - y).abs() < 0.004), "{found:?} {colour:?}");
        }
        assert!(found.errors.iter().all(|error| *error >= MIN_ERROR));
        // Planted difference: gloss without end is no body.
        let metal = of(images(2.0).iter().map(|x| x + 0.1).collect());
        assert!((metal.value(0)[0] - 0.2).abs() > 0.05);
        let turned = found.clone().turned_over(2);
        assert_eq!((turned.value(0), turned.error(1)), (found.value(1), found.error(0)));
        let stop = |_: usize, _: usize| std::ops::ControlFlow::Break(());
        let capture = Capture::from_linear(info.clone(), images(0.0)).unwrap();
        assert!(matches!(diffuse_colour(&capture, None, &stop), Err(SynthError::Stopped)));
    }
}
