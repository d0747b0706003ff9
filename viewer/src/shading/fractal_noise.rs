//! Fractal noise over texture coordinates [Perlin 1985]: what makes ground uneven from the size of fields down to that of
//! crumbs. Octaves of value noise, each as strong as the one before. Twin: `fractal_noise.wgsl`.

use crate::sampler::{hash, one};
use crate::scene::material::NOISE_OCTAVES;
use glam::Vec2;

/// Greatest difference that an octave makes.
const NOISE_AMPLITUDE: f32 = 0.3;

/// The constants that the shader has too.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, f32)] = &[("NOISE_AMPLITUDE", NOISE_AMPLITUDE)];

/// Returns the noise at a place, 0 to 1, a half in the mean, without its `level` finest octaves.
pub(crate) fn fractal_noise(uv: Vec2, level: u32) -> f32 {
    let mut sum = 0.5;
    for octave in 0..NOISE_OCTAVES.saturating_sub(level) {
        sum += NOISE_AMPLITUDE * (value_noise(uv * (1u32 << octave) as f32, octave) - 0.5);
    }
    sum.clamp(0.0, 1.0)
}

/// Returns a noise whose values at whole places are random, 0 to 1, and between them smooth.
fn value_noise(at: Vec2, seed: u32) -> f32 {
    let corner = at.floor();
    let within = at - corner;
    let blend = within * within * (3.0 - 2.0 * within);
    let (x, y) = (corner.x as i32, corner.y as i32);
    let lower = noise_value(x, y, seed) * (1.0 - blend.x) + noise_value(x + 1, y, seed) * blend.x;
    let upper = noise_value(x, y + 1, seed) * (1.0 - blend.x) + noise_value(x + 1, y + 1, seed) * blend.x;
    lower * (1.0 - blend.y) + upper * blend.y
}

/// Returns the random value at a whole place, 0 to 1.
fn noise_value(x: i32, y: i32, seed: u32) -> f32 {
    one(hash(x as u32 ^ hash(y as u32 ^ hash(seed))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(level: u32) -> Vec<f32> {
        let at = |i: u32| 0.137 + i as f32 * 0.37;
        (0..64).flat_map(|i| (0..64).map(move |j| fractal_noise(Vec2::new(at(i), -at(j)), level))).collect()
    }

    #[test]
    fn noise_is_a_half_in_the_mean_and_without_octaves_everywhere() {
        for level in [0, 4, 9] {
            let values = grid(level);
            let mean = values.iter().sum::<f32>() / values.len() as f32;
            let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f32>() / values.len() as f32;
            assert!((mean - 0.5).abs() < 0.02 && (0.005..0.06).contains(&variance), "{mean} {variance}");
            assert!(values.iter().all(|x| (0.0..=1.0).contains(x)));
        }
        assert!(grid(NOISE_OCTAVES).iter().chain(&grid(40)).all(|x| *x == 0.5));
    }

    #[test]
    fn what_a_level_leaves_out_is_fine() {
        // Neighbours within the finest cell that is left are nearly equal.
        for level in 0..NOISE_OCTAVES {
            let cell = 2f32.powi(level as i32 + 1 - NOISE_OCTAVES as i32);
            let (at, near) = (Vec2::new(3.3, 1.7), Vec2::new(3.3 + 0.05 * cell, 1.7));
            assert!((fractal_noise(at, level) - fractal_noise(near, level)).abs() < 0.08);
        }
    }
}
