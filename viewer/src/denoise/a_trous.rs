//! The filter: five passes, whose taps are twice as far apart each time, over the light that falls on what pixels show; and as much of it as
//! takes more noise than it blurs.

use super::features::Features;
use glam::Vec3;
use rayon::prelude::*;

/// Passes; taps are 1 to 16 pixels apart.
const PASSES: u32 = 5;
/// Weights of the taps along an axis: a cubic B-spline.
const TAPS: [f32; 5] = [1.0 / 16.0, 1.0 / 4.0, 3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];
/// Luminance of linear sRGB [IEC 61966-2-1].
const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);
/// Least albedo by which radiance is divided.
const MIN_ALBEDO: f32 = 0.02;
/// Differences of luminance that count as noise, in standard deviations.
const LUMINANCE_DEVIATIONS: f32 = 4.0;
/// Share of the nearness by which it may differ on any slope.
const LEVEL: f32 = 0.02;
/// Exponent of the cosine between two normals.
const NORMAL_POWER: i32 = 64;
/// Length of a mean normal from which on it is one.
const MIN_NORMAL: f32 = 0.3;
/// Weights along an axis of the pixels around one over which its variance is a mean: that of a single one is known from two values.
const VARIANCE_TAPS: [f32; 7] = [1.0; 7];
/// Factor on the variance of noise, which 49 pixels tell to a fifth: what is only noise must not be kept by chance.
const MARGIN: f32 = 1.2;
/// Radiance below which differences are not seen the more.
const MIN_SEEN: f32 = 1e-3;
/// Weights along an axis of the neighbours from which a pass learns a pixel's variance.
const NEAR_TAPS: [f32; 3] = [0.25, 0.5, 0.25];

/// A picture's light as the filter has it.
#[derive(Clone, Copy)]
struct Light {
    /// Radiance over albedo.
    light: Vec3,
    /// Variance of its luminance.
    variance: f32,
}

/// Width and height.
#[derive(Clone, Copy)]
struct Size([i32; 2]);

impl Size {
    /// Returns the number of a pixel, `None` outside of the picture.
    fn pixel(self, x: i32, y: i32) -> Option<usize> {
        let Size([width, height]) = self;
        ((0..width).contains(&x) && (0..height).contains(&y)).then(|| (y * width + x) as usize)
    }
}

/// Returns the picture without its noise. `radiance` is the mean of `samples` samples, at least two, `halfway` that of the first
/// `samples / 2` of them: what they differ by is noise. As a picture has more samples, less is filtered.
///
/// Cost: 125 taps a pixel, shared by all cores.
pub(crate) fn a_trous(
    radiance: &[[f32; 3]],
    halfway: &[[f32; 3]],
    samples: u32,
    features: &[Features],
    [width, height]: [u32; 2],
) -> Vec<[f32; 3]> {
    let size = Size([width as i32, height as i32]);
    let first = (samples / 2).max(1) as f32;
    let (all, rest) = (samples as f32, samples as f32 - first);
    let albedo = |pixel: usize| features[pixel].albedo.max(Vec3::splat(MIN_ALBEDO));
    let light_of = |radiance: &[f32; 3], pixel: usize| (Vec3::from(*radiance) - features[pixel].own) / albedo(pixel);
    let single: Vec<Light> = (0..radiance.len())
        .into_par_iter()
        .map(|pixel| {
            let light = light_of(&radiance[pixel], pixel);
            let before = light_of(&halfway[pixel], pixel);
            let after = (light * all - before * first) / rest;
            let apart = (before - after).dot(LUMINANCE);
            Light { light, variance: apart * apart * first * rest / (all * all) }
        })
        .collect();
    let variances = mean_around(|pixel| single[pixel].variance, size, &VARIANCE_TAPS);
    let noisy: Vec<Light> =
        single.iter().zip(variances).map(|(light, variance)| Light { variance, ..*light }).collect();
    let clear = smoothed(noisy, features, size);
    // Squares of what is seen: of the radiance, whose differences are seen the less the brighter it is.
    let weight = |pixel: usize| {
        let albedo = albedo(pixel).dot(LUMINANCE);
        albedo * albedo / (Vec3::from(radiance[pixel]).dot(LUMINANCE).max(0.0) + MIN_SEEN)
    };
    let weights: Vec<f32> = (0..radiance.len()).map(weight).collect();
    let nearest = combined(&single, &clear, &weights, size);
    nearest.iter().enumerate().map(|(pixel, of)| (*of * albedo(pixel) + features[pixel].own).to_array()).collect()
}

/// Returns the light after all passes.
fn smoothed(noisy: Vec<Light>, features: &[Features], size: Size) -> Vec<Light> {
    let slopes: Vec<f32> = (0..noisy.len()).into_par_iter().map(|pixel| slope(features, size, pixel)).collect();
    (0..PASSES).fold(noisy, |now, pass| filtered(&now, features, &slopes, size, 1 << pass))
}

/// Returns the light that is nearest to the truth in the mean of all between what is noisy and what is filtered [James and Stein
/// 1961]: what both differ by around a pixel is noise and blur, and the share of noise is what the filter may take. Squares count by
/// `weights`.
fn combined(noisy: &[Light], clear: &[Light], weights: &[f32], size: Size) -> Vec<Vec3> {
    let difference = |pixel: usize| noisy[pixel].light - clear[pixel].light;
    let noise = mean_around(|pixel| weights[pixel] * noisy[pixel].variance, size, &VARIANCE_TAPS);
    let both = mean_around(|pixel| weights[pixel] * difference(pixel).dot(LUMINANCE).powi(2), size, &VARIANCE_TAPS);
    let kept = |pixel: usize| 1.0 - (MARGIN * noise[pixel] / both[pixel].max(f32::MIN_POSITIVE)).min(1.0);
    (0..noisy.len()).map(|pixel| clear[pixel].light + kept(pixel) * difference(pixel)).collect()
}

/// Returns the mean of a number of the pixels around each pixel, by the weights of an odd number of taps along both axes.
fn mean_around(value: impl Fn(usize) -> f32 + Sync, size: Size, taps: &[f32]) -> Vec<f32> {
    let Size([width, height]) = size;
    let radius = taps.len() as i32 / 2;
    let mean = |pixel: usize| {
        let (x, y) = (pixel as i32 % width, pixel as i32 / width);
        let (mut sum, mut weights) = (0.0, 0.0);
        for (j, row) in (-radius..).zip(taps) {
            for (i, tap) in (-radius..).zip(taps) {
                if let Some(other) = size.pixel(x + i, y + j) {
                    sum += row * tap * value(other);
                    weights += row * tap;
                }
            }
        }
        sum / weights
    };
    (0..(width * height) as usize).into_par_iter().map(mean).collect()
}

/// Returns how much the nearness changes from a pixel to the next one, on the smoother side of both axes.
fn slope(features: &[Features], size: Size, pixel: usize) -> f32 {
    let Size([width, _]) = size;
    let (x, y) = (pixel as i32 % width, pixel as i32 / width);
    let here = features[pixel].nearness;
    let along = |dx: i32, dy: i32| {
        let to = |sign: i32| {
            size.pixel(x + sign * dx, y + sign * dy)
                .map_or(f32::INFINITY, |other| (features[other].nearness - here).abs())
        };
        let least = to(1).min(to(-1));
        if least.is_finite() { least } else { 0.0 }
    };
    along(1, 0).max(along(0, 1))
}

/// Returns how much two pixels show the same, 0 to 1; `far` is how many pixels they are apart.
fn likeness(a: &Features, b: &Features, slope: f32, far: f32) -> f32 {
    let (length_a, length_b) = (a.normal.length(), b.normal.length());
    let normals = if length_a > MIN_NORMAL && length_b > MIN_NORMAL {
        (a.normal.dot(b.normal) / (length_a * length_b)).max(0.0).powi(NORMAL_POWER)
    } else {
        // Volumes have none.
        (-4.0 * (length_a - length_b).abs()).exp()
    };
    let nearness = a.nearness.max(b.nearness);
    let apart = (a.nearness - b.nearness).abs() / (slope * far + LEVEL * nearness + f32::MIN_POSITIVE);
    normals * (-apart).exp()
}

/// Returns one pass of the filter, whose taps are `step` pixels apart.
fn filtered(lights: &[Light], features: &[Features], slopes: &[f32], size: Size, step: i32) -> Vec<Light> {
    let Size([width, _]) = size;
    let blurred = mean_around(|pixel| lights[pixel].variance, size, &NEAR_TAPS);
    let one = |pixel: usize| {
        let (x, y) = (pixel as i32 % width, pixel as i32 / width);
        let here = lights[pixel].light.dot(LUMINANCE);
        let deviation = LUMINANCE_DEVIATIONS * blurred[pixel].max(0.0).sqrt() + 1e-6;
        let (mut light, mut variance, mut weights) = (Vec3::ZERO, 0.0, 0.0);
        for (j, row) in TAPS.iter().enumerate() {
            for (i, tap) in TAPS.iter().enumerate() {
                let (dx, dy) = (step * (i as i32 - 2), step * (j as i32 - 2));
                let Some(other) = size.pixel(x + dx, y + dy) else { continue };
                let mut weight = row * tap;
                if other != pixel {
                    let far = ((dx * dx + dy * dy) as f32).sqrt();
                    let there = lights[other].light.dot(LUMINANCE);
                    weight *= likeness(&features[pixel], &features[other], slopes[pixel], far)
                        * (-(here - there).abs() / deviation).exp();
                }
                light += weight * lights[other].light;
                variance += weight * weight * lights[other].variance;
                weights += weight;
            }
        }
        Light { light: light / weights, variance: variance / (weights * weights) }
    };
    (0..lights.len()).into_par_iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_runtime::testing::Random;

    const SIZE: [u32; 2] = [48, 32];

    /// Two halves of a picture whose left is lit by `levels[0]`, its right by `levels[1]`, with noise of this deviation, and the
    /// mean of both.
    fn noisy(levels: [f32; 2], deviation: f32) -> [Vec<[f32; 3]>; 2] {
        let mut random = Random::new(5);
        let mut half = || -> Vec<f32> {
            (0..SIZE[0] * SIZE[1])
                .map(|pixel| {
                    let level = levels[usize::from(pixel % SIZE[0] >= SIZE[0] / 2)];
                    level + deviation * 3f32.sqrt() * random.within(-1.0, 1.0)
                })
                .collect()
        };
        let (first, second) = (half(), half());
        let mean = first.iter().zip(&second).map(|(a, b)| [0.5 * (a + b); 3]).collect();
        [mean, first.into_iter().map(|x| [x; 3]).collect()]
    }

    fn plane(normal_of_right: Vec3) -> Vec<Features> {
        let of = |pixel: u32| Features {
            albedo: Vec3::splat(0.5),
            normal: if pixel % SIZE[0] >= SIZE[0] / 2 { normal_of_right } else { Vec3::Z },
            nearness: 1.0,
            own: Vec3::ZERO,
        };
        (0..SIZE[0] * SIZE[1]).map(of).collect()
    }

    /// Mean and variance of a half of a picture.
    fn moments(picture: &[[f32; 3]], right: bool) -> [f32; 2] {
        let values: Vec<f32> = picture
            .iter()
            .enumerate()
            .filter(|(pixel, _)| (*pixel as u32 % SIZE[0] >= SIZE[0] / 2) == right)
            .map(|(_, x)| x[1])
            .collect();
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        [mean, values.iter().map(|x| (x - mean).powi(2)).sum::<f32>() / values.len() as f32]
    }

    #[test]
    fn noise_goes_and_what_is_lit_stays_as_bright() {
        let [mean, half] = noisy([1.0, 1.0], 0.3);
        let clear = a_trous(&mean, &half, 2, &plane(Vec3::Z), SIZE);
        let ([before, noise], [after, left]) = (moments(&mean, false), moments(&clear, false));
        assert!((after / before - 1.0).abs() < 0.02, "{before} {after}");
        assert!(left < 0.05 * noise, "{noise} {left}");
    }

    #[test]
    fn edges_of_normals_and_of_strong_light_stay() {
        // A faint edge between two sides of a thing, and a strong one on one side.
        for (levels, normal) in [([1.0, 1.2], Vec3::X), ([0.2, 3.0], Vec3::Z)] {
            let [mean, half] = noisy(levels, 0.1);
            let clear = a_trous(&mean, &half, 2, &plane(normal), SIZE);
            for (right, level) in [(false, levels[0]), (true, levels[1])] {
                assert!((moments(&clear, right)[0] / level - 1.0).abs() < 0.03, "{levels:?}");
            }
            let beside = clear[SIZE[0] as usize / 2 - 1][0] - clear[SIZE[0] as usize / 2][0];
            assert!(beside.abs() > 0.7 * (levels[1] - levels[0]), "{levels:?} {beside}");
        }
    }

    #[test]
    fn what_only_the_picture_knows_is_blurred_no_more_than_it_has_noise() {
        let count = (SIZE[0] * SIZE[1]) as usize;
        let mut random = Random::new(9);
        // Light differs from pixel to pixel, by two deviations of the noise; features say nothing of it.
        let truth: Vec<f32> = (0..count).map(|_| random.within(0.6, 1.4)).collect();
        let mut half = || -> Vec<f32> { truth.iter().map(|x| x + 0.25 * random.within(-1.0, 1.0)).collect() };
        let (first, second) = (half(), half());
        let mean: Vec<[f32; 3]> = first.iter().zip(&second).map(|(a, b)| [0.5 * (a + b); 3]).collect();
        let halfway: Vec<[f32; 3]> = first.iter().map(|x| [*x; 3]).collect();
        let rms = |own: &mut dyn Iterator<Item = f32>| {
            (own.zip(&truth).map(|(own, truth)| (own - truth).powi(2)).sum::<f32>() / count as f32).sqrt()
        };
        let features = plane(Vec3::Z);
        let clear = a_trous(&mean, &halfway, 2, &features, SIZE);
        let [noise, left] = [&mean, &clear].map(|picture| rms(&mut picture.iter().map(|pixel| pixel[1])));
        assert!(left < 1.05 * noise, "{noise} {left}");
        // Planted: the passes alone blur more than they clear.
        let noisy = mean.iter().map(|x| Light { light: Vec3::from(*x), variance: noise * noise }).collect();
        let blurred = smoothed(noisy, &features, Size(SIZE.map(|side| side as i32)));
        let alone = rms(&mut blurred.iter().map(|own| own.light.y));
        assert!(alone > 1.3 * noise, "{noise} {alone}");
    }

    #[test]
    fn a_picture_without_noise_stays_and_nothing_is_nan() {
        let ramp: Vec<[f32; 3]> = (0..SIZE[0] * SIZE[1]).map(|pixel| [0.01 * pixel as f32, 0.5, 0.0]).collect();
        let clear = a_trous(&ramp, &ramp, 8, &plane(Vec3::X), SIZE);
        let most = ramp.iter().zip(&clear).flat_map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).abs())).fold(0.0, f32::max);
        assert!(most < 1e-3, "{most}");
        let black = a_trous(
            &vec![[0.0; 3]; ramp.len()],
            &vec![[0.0; 3]; ramp.len()],
            2,
            &vec![Features::default(); ramp.len()],
            SIZE,
        );
        assert!(black.iter().flatten().all(|x| *x == 0.0));
    }
}
