//! Well-spread random numbers: Sobol's sequence in two dimensions, its digits and its order scrambled after Owen by a
//! hash [Burley 2020]. Twin: `sampler.wgsl`; both give the same bits.

use glam::Vec3;

/// Hashes a word.
pub(crate) fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// Scrambles the digits of `x` from the lowest up, each by those below it [Laine and Karras 2011].
fn permute(x: u32, seed: u32) -> u32 {
    let mut x = x.wrapping_add(seed);
    x ^= x.wrapping_mul(0x6c50_b47c);
    x ^= x.wrapping_mul(0xb82f_1e52);
    x ^= x.wrapping_mul(0xc7af_e638);
    x ^ x.wrapping_mul(0x8d22_f6e6)
}

/// Scrambles the digits of `x` from the highest down, each by those above it.
fn scramble(x: u32, seed: u32) -> u32 {
    permute(x.reverse_bits(), seed).reverse_bits()
}

/// Returns the number `index` of Sobol's second dimension, binary digits behind the point.
fn second(mut index: u32) -> u32 {
    let mut direction = 1u32 << 31;
    let mut x = 0;
    while index != 0 {
        if index & 1 == 1 {
            x ^= direction;
        }
        index >>= 1;
        direction ^= direction >> 1;
    }
    x
}

/// Returns two numbers in [0, 1): those of `sample` in the stream `seed`. Any power of two of samples in a row is
/// stratified.
pub(crate) fn two(sample: u32, seed: u32) -> [f32; 2] {
    let hashed = hash(seed);
    let index = scramble(sample, hashed);
    let x = scramble(index.reverse_bits(), hash(hashed ^ 0x9e37_79b9));
    let y = scramble(second(index), hash(hashed ^ 0x3c6e_f372));
    // 24 bits, so that 1 is not reached by rounding.
    [x, y].map(|x| (x >> 8) as f32 * 5.960_464_5e-8)
}

/// Returns a number in [0, 1) without any order.
pub(crate) fn one(seed: u32) -> f32 {
    (hash(seed) >> 8) as f32 * 5.960_464_5e-8
}

/// Draws a direction about +z whose density is its cosine over pi.
pub(crate) fn cosine(at: [f32; 2]) -> Vec3 {
    let angle = std::f32::consts::TAU * at[1];
    let radius = at[0].sqrt();
    Vec3::new(radius * angle.cos(), radius * angle.sin(), (1.0 - at[0]).sqrt())
}

/// Draws a direction with the same density everywhere on the sphere.
pub(crate) fn sphere(at: [f32; 2]) -> Vec3 {
    let z = 1.0 - 2.0 * at[0];
    let angle = std::f32::consts::TAU * at[1];
    let radius = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(radius * angle.cos(), radius * angle.sin(), z)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether each of the `columns` x `rows` boxes holds one of the points.
    fn stratified(points: &[[f32; 2]], columns: usize, rows: usize) -> bool {
        let mut full = vec![false; columns * rows];
        for [x, y] in points {
            full[(y * rows as f32) as usize * columns + (x * columns as f32) as usize] = true;
        }
        full.iter().all(|full| *full)
    }

    #[test]
    fn samples_in_a_row_are_stratified_in_every_shape_and_streams_differ() {
        for seed in 0..50 {
            let points: Vec<_> = (0..64).map(|sample| two(sample, seed)).collect();
            assert!(points.iter().flatten().all(|x| (0.0..1.0).contains(x)));
            for (columns, rows) in [(64, 1), (16, 4), (8, 8), (2, 32), (1, 64)] {
                assert!(stratified(&points, columns, rows), "seed {seed}, {columns} x {rows}");
            }
            assert!(!stratified(&points[1..], 8, 8), "one point less leaves a box empty");
            assert_ne!(points[0], two(0, seed + 1));
        }
    }

    #[test]
    fn cosine_directions_have_the_moments_of_their_density() {
        let directions: Vec<Vec3> = (0..4096).map(|sample| cosine(two(sample, 7))).collect();
        let mean = directions.iter().sum::<Vec3>() / 4096.0;
        // The mean of z under cos / pi is 2/3.
        assert!((mean - Vec3::new(0.0, 0.0, 2.0 / 3.0)).length() < 1e-3, "{mean}");
        assert!(directions.iter().all(|d| (d.length() - 1.0).abs() < 1e-5 && d.z > 0.0));
    }
}
