//! What a sky gives a surface, by its normal: a small table.

use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::{PI, TAU};

/// Rows of the table, poles included.
pub(crate) const IRRADIANCE_ROWS: usize = 17;
/// Columns of the table, once round.
pub(crate) const IRRADIANCE_COLUMNS: usize = 32;

/// Computes the irradiance by normal, without shadows, of an equirectangular picture as [`crate::Environment`] has it:
/// radiance, `[row, column, rgb]`. Cost: the sum over all its pixels for each entry, 544 a pixel.
///
/// `[row][column][channel]`, 17 x 32 x 3 words, linear sRGB, pi for what makes a white diffuser 1. Row r stands at the
/// angle `pi r / 16` from +y, column c at the azimuth `2 pi c / 32` from -z towards +x; every entry of a pole's row is
/// the same. Between entries it is bilinear; columns go round.
pub(crate) fn irradiance_table(width: usize, height: usize, rgb: &[f32]) -> Vec<f32> {
    let light = arriving(width, height, rgb);
    let entry = |at: usize| {
        let polar = PI * (at / IRRADIANCE_COLUMNS) as f32 / (IRRADIANCE_ROWS - 1) as f32;
        let azimuth = TAU * (at % IRRADIANCE_COLUMNS) as f32 / IRRADIANCE_COLUMNS as f32;
        irradiance_of(&light, Vec3::new(polar.sin() * azimuth.sin(), polar.cos(), -polar.sin() * azimuth.cos()))
    };
    let entries: Vec<Vec3> = (0..IRRADIANCE_ROWS * IRRADIANCE_COLUMNS).into_par_iter().map(entry).collect();
    entries.iter().flat_map(|entry| entry.to_array()).collect()
}

/// Returns the irradiance of a unit normal, from what [`irradiance_table`] gives. Twin: `environment_irradiance` in
/// `environment.wgsl`.
pub(crate) fn irradiance_from_table(table: &[f32], normal: Vec3) -> Vec3 {
    let x = (normal.x.atan2(-normal.z) / TAU).rem_euclid(1.0) * IRRADIANCE_COLUMNS as f32;
    let y = normal.y.clamp(-1.0, 1.0).acos() / PI * (IRRADIANCE_ROWS - 1) as f32;
    let left = (x as usize) % IRRADIANCE_COLUMNS;
    let upper = (y as usize).min(IRRADIANCE_ROWS - 2);
    let (right, along, down) = ((left + 1) % IRRADIANCE_COLUMNS, x - x.floor(), y - upper as f32);
    let entry = |row: usize, column: usize| Vec3::from_slice(&table[(row * IRRADIANCE_COLUMNS + column) * 3..]);
    let row = |row: usize| entry(row, left).lerp(entry(row, right), along);
    row(upper).lerp(row(upper + 1), down)
}

/// Returns the irradiance of one unit normal, the exact sum over a picture's pixels.
pub(crate) fn irradiance_at(width: usize, height: usize, rgb: &[f32], normal: Vec3) -> Vec3 {
    irradiance_of(&arriving(width, height, rgb), normal)
}

/// Returns the direction of each pixel's middle, and its radiance times its solid angle.
fn arriving(width: usize, height: usize, rgb: &[f32]) -> Vec<[Vec3; 2]> {
    let light = |at: usize| {
        let (row, column) = (at / width, at % width);
        let polar = |row: f32| PI * row / height as f32;
        let azimuth = TAU * ((column as f32 + 0.5) / width as f32 - 0.5);
        let (sin, cos) = polar(row as f32 + 0.5).sin_cos();
        let solid_angle = TAU / width as f32 * (polar(row as f32).cos() - polar(row as f32 + 1.0).cos());
        [Vec3::new(sin * azimuth.sin(), cos, -sin * azimuth.cos()), Vec3::from_slice(&rgb[at * 3..]) * solid_angle]
    };
    (0..width * height).map(light).collect()
}

/// Returns the sum over all light that arrives on the side of the normal.
fn irradiance_of(light: &[[Vec3; 2]], normal: Vec3) -> Vec3 {
    light.iter().map(|[from, light]| *light * normal.dot(*from).max(0.0)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bright ground, a bright horizon on one side, and a sky that is bluer above.
    fn picture() -> (usize, usize, Vec<f32>) {
        let (width, height) = (64, 32);
        let pixel = |at: usize| {
            let (row, column) = (at / width, at % width);
            let polar = PI * (row as f32 + 0.5) / height as f32;
            let glow = (-(column as f32 - 20.0).powi(2) / 40.0 - (polar - 1.4).powi(2) * 10.0).exp();
            if row < height / 2 { [0.1 + 3.0 * glow, 0.2 + glow, 0.3 + 0.2 * polar.cos()] } else { [0.15, 0.15, 0.1] }
        };
        (width, height, (0..width * height).flat_map(pixel).collect())
    }

    #[test]
    fn an_even_surrounding_gives_pi_and_half_of_one_what_it_covers() {
        let even = irradiance_table(64, 32, &[1.0; 64 * 32 * 3]);
        let rgb: Vec<f32> = (0..64 * 32 * 3).map(|at| if at < 64 * 16 * 3 { 1.0 } else { 0.0 }).collect();
        let above = irradiance_table(64, 32, &rgb);
        assert_eq!(above.len(), IRRADIANCE_ROWS * IRRADIANCE_COLUMNS * 3);
        for degrees in [0.0f32, 20.0, 45.0, 90.0, 150.0, 180.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let normal = Vec3::new(sin * 0.6, cos, sin * 0.8);
            assert!((irradiance_from_table(&even, normal)[1] / PI - 1.0).abs() < 0.003, "{degrees}");
            // The share of a half sphere that a tilted surface sees, weighted by cosines.
            let expected = PI * 0.5 * (1.0 + cos);
            assert!(
                (irradiance_from_table(&above, normal)[2] - expected).abs() < 0.02,
                "{degrees}: {}",
                irradiance_from_table(&above, normal)[2]
            );
        }
    }

    #[test]
    fn the_table_is_the_sum_over_the_picture() {
        let (width, height, rgb) = picture();
        let table = irradiance_table(width, height, &rgb);
        let brightest = table.iter().fold(0f32, |a, b| a.max(*b));
        let farthest = |turn: f32| {
            (0..500).fold(0f32, |farthest, i| {
                let [x, y] = crate::sampler::two(i, 5);
                let (cos, azimuth) = (2.0 * x - 1.0, TAU * y);
                let sin = (1.0 - cos * cos).sqrt();
                let normal = |azimuth: f32| Vec3::new(sin * azimuth.sin(), cos, -sin * azimuth.cos());
                let found = irradiance_from_table(&table, normal(azimuth + turn));
                farthest.max((found - irradiance_at(width, height, &rgb, normal(azimuth))).abs().max_element())
            })
        };
        assert!(farthest(0.0) < 0.01 * brightest, "{}", farthest(0.0) / brightest);
        // Planted difference: turned by half a column.
        assert!(farthest(0.1) > 0.03 * brightest, "{}", farthest(0.1) / brightest);
    }
}
