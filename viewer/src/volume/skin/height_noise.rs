//! Gradient noise [Perlin 2002].

use crate::sampler::hash;
use glam::Vec3;

/// Smooth noise over space, between -1 and 1, 0 in the mean, and 0 at the corners of its lattice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Length of a cell of its lattice, in the units of the positions.
    pub wavelength: f32,
    /// Cells after which it repeats along each axis; 0 where it does not.
    pub period: [u32; 3],
    /// Which noise.
    pub seed: u32,
}

/// Largest lattice coordinate; further out single precision has no place between lattice points.
const MAX_CELLS: f32 = (1 << 23) as f32;

impl Noise {
    /// Checks the parameters.
    ///
    /// # Errors
    /// A sentence if the wavelength is not a positive number.
    pub fn check(&self) -> Result<(), String> {
        if self.wavelength > 0.0 && self.wavelength.is_finite() {
            return Ok(());
        }
        Err(format!("a noise's wavelength is {}, and must be above 0", self.wavelength))
    }

    /// Returns the noise at a position.
    pub fn at(&self, position: Vec3) -> f32 {
        let place = (position / self.wavelength).clamp(Vec3::splat(-MAX_CELLS), Vec3::splat(MAX_CELLS));
        let cell = place.floor();
        let within = place - cell;
        let cell = cell.to_array().map(|x| x as i32);
        // 6 x^5 - 15 x^4 + 10 x^3: slope and curvature are continuous.
        let blend = within * within * within * (within * (within * 6.0 - 15.0) + 10.0);
        let mut sum = 0.0;
        for corner in 0..8u32 {
            let offset = [0, 1, 2].map(|axis| (corner >> axis & 1) as i32);
            let weight: f32 = (0..3).map(|i| if offset[i] == 1 { blend[i] } else { 1.0 - blend[i] }).product();
            let gradient = self.gradient([0, 1, 2].map(|i| cell[i] + offset[i]));
            sum += weight * gradient.dot(within - Vec3::from(offset.map(|x| x as f32)));
        }
        sum
    }

    /// Returns three independent noises at a position.
    pub fn three_at(&self, position: Vec3) -> Vec3 {
        Vec3::from([0, 1, 2].map(|axis| Noise { seed: hash(self.seed ^ axis), ..*self }.at(position)))
    }

    /// Returns the gradient at a lattice point: to the middle of one of a cube's twelve edges.
    fn gradient(&self, point: [i32; 3]) -> Vec3 {
        let hashed = (0..3).fold(hash(self.seed), |hashed, axis| {
            let period = self.period[axis];
            let along = if period > 0 { point[axis].rem_euclid(period as i32) } else { point[axis] };
            hash(hashed ^ along as u32)
        });
        let edge = hashed % 12;
        let [one, other] = [1, 2].map(|bit| if hashed >> (15 + bit) & 1 == 0 { 1.0 } else { -1.0 });
        match edge / 4 {
            0 => Vec3::new(one, other, 0.0),
            1 => Vec3::new(0.0, one, other),
            _ => Vec3::new(other, 0.0, one),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_runtime::testing::Random;

    const NOISE: Noise = Noise { wavelength: 0.5, period: [0; 3], seed: 3 };

    /// Mean and mean square over so many positions.
    fn moments(noise: &Noise, count: usize) -> [f64; 2] {
        let mut random = Random::new(5);
        let mut sums = [0f64; 2];
        for _ in 0..count {
            let at = Vec3::from([(); 3].map(|()| random.within(-50.0, 50.0)));
            let value = f64::from(noise.at(at));
            assert!(value.abs() <= 1.0 + 1e-6);
            sums[0] += value;
            sums[1] += value * value;
        }
        sums.map(|sum| sum / count as f64)
    }

    #[test]
    fn noise_is_balanced_smooth_and_zero_on_its_lattice() {
        let [mean, square] = moments(&NOISE, 100_000);
        assert!(mean.abs() < 0.005 && (0.05..0.1).contains(&square), "{mean} {square}");
        for at in [Vec3::ZERO, Vec3::new(0.5, -1.0, 33.5)] {
            assert_eq!(NOISE.at(at), 0.0);
        }
        let at = Vec3::new(0.49, 0.3, 0.77);
        let steps = [1e-2, 1e-3].map(|step| (NOISE.at(at + Vec3::X * step) - NOISE.at(at)) / step);
        assert!((steps[0] - steps[1]).abs() < 0.2, "{steps:?}");
        assert_ne!(NOISE.at(at), Noise { seed: 4, ..NOISE }.at(at));
        assert!([1e30, -1e30].iter().all(|far| NOISE.at(Vec3::splat(*far)).is_finite()));
        assert!(Noise { wavelength: 0.0, ..NOISE }.check().is_err());
    }

    #[test]
    fn noise_with_a_period_repeats_and_other_noise_does_not() {
        let periodic = Noise { period: [4, 3, 0], ..NOISE };
        let differs = |noise: &Noise, by: Vec3| {
            let mut random = Random::new(9);
            (0..100).any(|_| {
                let at = Vec3::from([(); 3].map(|()| random.within(-3.0, 3.0)));
                (noise.at(at) - noise.at(at + by)).abs() > 1e-5
            })
        };
        assert!(!differs(&periodic, Vec3::X * 2.0) && !differs(&periodic, Vec3::Y * -1.5));
        assert!(differs(&periodic, Vec3::X) && differs(&periodic, Vec3::Z * 2.0) && differs(&NOISE, Vec3::X * 2.0));
    }
}
