//! Gradient noise that repeats at the sides of a box [Perlin 2002].

use btf_models::shapes::{Noise, Space};
use glam::DVec3;

/// Directions to the edges of a cube, of length root 2.
const GRADIENTS: [[f64; 3]; 12] = [
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
    [1.0, -1.0, 0.0],
    [-1.0, -1.0, 0.0],
    [1.0, 0.0, 1.0],
    [-1.0, 0.0, 1.0],
    [1.0, 0.0, -1.0],
    [-1.0, 0.0, -1.0],
    [0.0, 1.0, 1.0],
    [0.0, -1.0, 1.0],
    [0.0, 1.0, -1.0],
    [0.0, -1.0, -1.0],
];

/// Bound of an octave's distance from 0: in the middle of a cell all eight corners can agree on 3/4 of `root 2`,
/// elsewhere on less than this.
const BOUND: f64 = 1.1;

/// Noise over a box.
#[derive(Debug, Clone)]
pub struct NoiseField {
    noise: Noise,
    least: DVec3,
    size: DVec3,
}

impl NoiseField {
    /// Returns the noise over a script's space.
    pub fn new(noise: &Noise, space: &Space) -> NoiseField {
        let least = DVec3::from(space.least_m);
        NoiseField { noise: noise.clone(), least, size: DVec3::from(space.most_m) - least }
    }

    /// Returns the height of the noise and its gradient per metre at a place in metres.
    pub fn at(&self, place_m: DVec3) -> (f64, DVec3) {
        let share = (place_m - self.least) / self.size;
        let (mut height, mut gradient, mut gain) = (0.0, DVec3::ZERO, 1.0);
        for octave in 0..self.noise.octaves {
            let cells = self.noise.cells.map(|cells| i64::from(cells) << octave);
            let per_m = DVec3::from(cells.map(|cells| cells as f64)) / self.size;
            let (value, slope) = self.octave(octave, cells, share * DVec3::from(cells.map(|cells| cells as f64)));
            height += gain * value;
            gradient += gain * slope * per_m;
            gain *= self.noise.gain;
        }
        (height, gradient)
    }

    /// Returns the bound of the height.
    pub fn bound(&self) -> f64 {
        BOUND * (0..self.noise.octaves).map(|octave| self.noise.gain.powi(octave as i32)).sum::<f64>()
    }

    fn octave(&self, octave: u32, cells: [i64; 3], place: DVec3) -> (f64, DVec3) {
        let corner = place.floor();
        let offset = place - corner;
        let fade = |t: f64| t * t * t * (t * (6.0 * t - 15.0) + 10.0);
        let slope = |t: f64| 30.0 * t * t * (t - 1.0) * (t - 1.0);
        let (fades, slopes) = (offset.map(fade), offset.map(slope));
        let (mut value, mut gradient) = (0.0, DVec3::ZERO);
        for i in 0..8 {
            let step = [i & 1, i >> 1 & 1, i >> 2].map(f64::from);
            let lattice = std::array::from_fn(|k| (corner[k] as i64 + step[k] as i64).rem_euclid(cells[k]) as u64);
            let direction = DVec3::from(GRADIENTS[self.hash(octave, lattice) as usize % GRADIENTS.len()]);
            let rise = direction.dot(offset - DVec3::from(step));
            let weight = |k: usize| if step[k] == 1.0 { fades[k] } else { 1.0 - fades[k] };
            let change = |k: usize| if step[k] == 1.0 { slopes[k] } else { -slopes[k] };
            let [x, y, z] = [0, 1, 2].map(weight);
            value += x * y * z * rise;
            gradient +=
                direction * (x * y * z) + rise * DVec3::new(change(0) * y * z, x * change(1) * z, x * y * change(2));
        }
        (value, gradient)
    }

    /// Returns SplitMix64's finaliser over the lattice point, seed and octave.
    fn hash(&self, octave: u32, [x, y, z]: [u64; 3]) -> u64 {
        let mut h = self.noise.seed ^ u64::from(octave) << 56;
        for part in [x, y, z] {
            h = (h ^ part).wrapping_add(0x9E37_79B9_7F4A_7C15);
            h = (h ^ h >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            h = (h ^ h >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
            h ^= h >> 31;
        }
        h >> 8
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(octaves: u32) -> NoiseField {
        let noise = Noise { cells: [5, 4, 3], octaves, gain: 0.5, seed: 7 };
        NoiseField::new(&noise, &Space { least_m: [1.0, -2.0, 0.5], most_m: [2.0, 0.0, 3.5], cyclic: [true; 2] })
    }

    fn places(count: usize) -> impl Iterator<Item = DVec3> {
        // Additive recurrence: even over the box.
        (0..count).map(|i| DVec3::new(0.8191725134, 0.6710436067, 0.5497004779) * (i as f64 + 0.5)).map(DVec3::fract)
    }

    #[test]
    fn its_mean_is_zero_and_its_variance_that_of_independent_gradients() {
        // Of one octave, over a cell: sum over corners of weight^2 times the mean square of gradient and offset, 2/3.
        let fade = |t: f64| 1.0 - t * t * t * (t * (6.0 * t - 15.0) + 10.0);
        let steps: Vec<f64> = (0..1000).map(|i| (f64::from(i) + 0.5) / 1000.0).collect();
        let mean = |of: &dyn Fn(f64) -> f64| steps.iter().map(|&t| of(t)).sum::<f64>() / 1000.0;
        let (squares, moments) = (mean(&|t| fade(t).powi(2)), mean(&|t| (fade(t) * t).powi(2)));
        let expected = 16.0 * squares * squares * moments;
        let (mut sum, mut sum2, count) = (0.0, 0.0, 100_000);
        // Many seeds, because a box has few lattice points.
        for seed in 0..50 {
            let mut field = field(1);
            field.noise.seed = seed;
            for place in places(count / 50) {
                let (height, _) = field.at(field.least + place * field.size);
                assert!(height.abs() <= field.bound());
                sum += height;
                sum2 += height * height;
            }
        }
        let (mean, variance) = (sum / count as f64, sum2 / count as f64);
        assert!(mean.abs() < 0.005, "{mean}");
        assert!((variance / expected - 1.0).abs() < 0.05, "{variance} {expected}");
    }

    #[test]
    fn it_repeats_at_the_sides_of_the_box_and_nowhere_before() {
        let field = field(3);
        for place in places(100) {
            let p = field.least + place * field.size;
            for k in 0..3 {
                let mut q = p;
                q[k] += field.size[k];
                let (here, there) = (field.at(p), field.at(q));
                assert!((here.0 - there.0).abs() < 1e-12 && (here.1 - there.1).length() < 1e-10);
            }
        }
        // On the seam itself; and half a period is none.
        let (left, right) = (DVec3::new(1.0, -1.3, 1.1), DVec3::new(2.0, -1.3, 1.1));
        assert_eq!(field.at(left), field.at(right));
        assert!((field.at(left + DVec3::X * 0.3).0 - field.at(left + DVec3::X * 0.8).0).abs() > 1e-3);
    }

    #[test]
    fn its_gradient_is_that_of_its_height() {
        let field = field(3);
        for place in places(200) {
            let p = field.least + place * field.size;
            let gradient = field.at(p).1;
            for k in 0..3 {
                let mut step = DVec3::ZERO;
                step[k] = 1e-6;
                let slope = (field.at(p + step).0 - field.at(p - step).0) / 2e-6;
                assert!((slope - gradient[k]).abs() < 1e-6 * (1.0 + slope.abs()), "{slope} {}", gradient[k]);
            }
        }
    }
}
