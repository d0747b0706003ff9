//! Volumetric textures beside the triangles that they stand in for: how far from the triangles a picture is, and how
//! many rays a pixel the triangles themselves need to come as near.

use crate::dolly::luminance_of;
use btf_viewer::{CpuPicture, Scene, ShadeOptions};
use std::ops::Range;

/// Rays a pixel up to which errors of triangles are measured; beyond, they fall with the root of the number.
const MAX_MEASURED: u32 = 64;
/// Linear radiance of each pixel, RGB.
pub type Radiance = Vec<[f32; 3]>;

/// The mean of some samples of a scene, drawn on the CPU.
pub fn drawn(scene: &Scene, size: [u32; 2], samples: Range<u32>) -> Radiance {
    let mut picture = CpuPicture::new(size);
    picture.samples = samples.start;
    let count = samples.len() as f32;
    samples.for_each(|_| picture.add_sample(scene, &ShadeOptions::default(), &|| true));
    picture.sums.iter().map(|sum| sum.map(|x| x / count)).collect()
}

/// What triangles look like, and how near to that so many rays a pixel come.
#[derive(Debug, Clone)]
pub struct Explicit {
    truth: Radiance,
    /// Pixels that count.
    counted: Vec<bool>,
    /// Sums over them: of the squares of `truth`, and of the squares of its own error.
    squares: f64,
    noise: f64,
    /// Rays a pixel, twice as many each, and the relative error with them.
    curve: Vec<(u32, f64)>,
}

impl Explicit {
    /// Draws `rays` rays a pixel past a scene's triangles, and others for errors. Only pixels count in which a ray
    /// meets a triangle with a number from `first_triangle` on.
    pub fn new(scene: &Scene, size: [u32; 2], rays: u32, first_triangle: u32) -> Explicit {
        let mut picture = CpuPicture::new(size);
        let mut counted = vec![false; picture.sums.len()];
        let mut fewer = Vec::new();
        while picture.samples < MAX_MEASURED {
            picture.add_sample(scene, &ShadeOptions::default(), &|| true);
            let triangles = scene.geometry.triangles().len() as u32;
            for (counted, hit) in counted.iter_mut().zip(&picture.hits) {
                *counted |= (first_triangle..triangles).contains(&hit.primitive);
            }
            if picture.samples.is_power_of_two() {
                fewer.push((picture.samples, picture.radiance()));
            }
        }
        let half = rays / 2;
        let halves = [MAX_MEASURED, MAX_MEASURED + half].map(|first| drawn(scene, size, first..first + half));
        Explicit::of(halves, counted, &fewer)
    }

    /// From two pictures by other samples, whose mean is the truth, and those with fewer rays.
    fn of(halves: [Radiance; 2], counted: Vec<bool>, fewer: &[(u32, Radiance)]) -> Explicit {
        let truth: Radiance =
            halves[0].iter().zip(&halves[1]).map(|(a, b)| [0, 1, 2].map(|i| 0.5 * (a[i] + b[i]))).collect();
        let noise = 0.25 * square_distance(&halves[0], &halves[1], &counted);
        let squares = square_distance(&truth, &vec![[0.0; 3]; truth.len()], &counted);
        let mut explicit = Explicit { truth, counted, squares, noise, curve: Vec::new() };
        explicit.curve = fewer.iter().map(|(rays, picture)| (*rays, explicit.error(picture))).collect();
        explicit
    }

    /// `sqrt(sum of squared errors / sum of squares)` of a picture over all channels, without the truth's own error.
    pub fn error(&self, picture: &[[f32; 3]]) -> f64 {
        let error = square_distance(picture, &self.truth, &self.counted) - self.noise;
        (error.max(0.0) / self.squares).sqrt()
    }

    /// Luminance of a picture, of the truth's.
    pub fn brightness(&self, picture: &[[f32; 3]]) -> f64 {
        let sum = |picture: &[[f32; 3]]| -> f64 {
            let counted = picture.iter().zip(&self.counted).filter(|(_, counted)| **counted);
            counted.map(|(pixel, _)| luminance_of(pixel.map(f64::from))).sum()
        };
        sum(picture) / sum(&self.truth)
    }

    /// Share of the pixels that count.
    pub fn coverage(&self) -> f64 {
        self.counted.iter().filter(|counted| **counted).count() as f64 / self.counted.len() as f64
    }

    /// The measured errors, by rays a pixel.
    pub fn curve(&self) -> &[(u32, f64)] {
        &self.curve
    }

    /// Rays a pixel with which triangles have an error, one at least: between measured numbers as a power of the
    /// number.
    pub fn rays_for(&self, error: f64) -> f64 {
        let (last_rays, last) = self.curve[self.curve.len() - 1];
        if error >= self.curve[0].1 {
            return f64::from(self.curve[0].0);
        }
        let within = self.curve.windows(2).find(|pair| error >= pair[1].1);
        let Some([(few, more_error), (many, less_error)]) = within else {
            return f64::from(last_rays) * (last / error).powi(2);
        };
        let share = (more_error / error).ln() / (more_error / less_error).ln();
        f64::from(*few) * f64::from(many / few).powf(share)
    }
}

/// A picture times a factor.
pub fn scaled(picture: &[[f32; 3]], factor: f64) -> Radiance {
    picture.iter().map(|pixel| pixel.map(|x| (f64::from(x) * factor) as f32)).collect()
}

fn square_distance(a: &[[f32; 3]], b: &[[f32; 3]], counted: &[bool]) -> f64 {
    let pairs = a.iter().zip(b).zip(counted).filter(|(_, counted)| **counted);
    pairs.flat_map(|((a, b), _)| [0, 1, 2].map(|i| f64::from(a[i] - b[i]).powi(2))).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    #[test]
    fn noise_is_told_as_rays_and_not_as_error_of_the_truth() {
        let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(1);
        // The mean of so many rays of an even picture, each 1 +- 0.5.
        let mut picture = |rays: u32| -> Radiance {
            let pixel = |_| [(); 3].map(|()| (0..rays).map(|_| random.gen_range(0.5..1.5)).sum::<f32>() / rays as f32);
            (0..4000).map(pixel).collect()
        };
        let fewer = [1, 2, 4, 8].map(|rays| (rays, picture(rays)));
        let halves = [picture(16), picture(16)];
        // Pixels without a plant do not count, whatever is in them.
        let counted: Vec<bool> = (0..4000).map(|pixel| pixel < 3000).collect();
        let explicit = Explicit::of(halves, counted, &fewer);
        assert_eq!(explicit.coverage(), 0.75);
        let of_one = (1.0f64 / 12.0).sqrt();
        for (rays, error) in explicit.curve() {
            assert!((error / of_one * f64::from(*rays).sqrt() - 1.0).abs() < 0.04, "{rays}: {error}");
        }
        for rays in [1.5f64, 3.0, 6.0, 50.0] {
            assert!((explicit.rays_for(of_one / rays.sqrt()) / rays - 1.0).abs() < 0.1, "{rays}");
        }
        assert_eq!(explicit.rays_for(1.0), 1.0);
        let mut marked = picture(64);
        marked[3000..].fill([9.0; 3]);
        assert!((explicit.brightness(&marked) - 1.0).abs() < 0.01 && explicit.error(&marked) < 0.05);
        // Planted: a tenth brighter, which no number of rays would tell from noise but the brightness does.
        let bright = scaled(&marked, 1.1);
        assert!((explicit.brightness(&bright) - 1.1).abs() < 0.01 && (explicit.error(&bright) - 0.106).abs() < 0.01);
    }
}
