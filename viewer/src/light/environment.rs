//! Light from all around: a picture of the sky, looked up by direction and drawn where it is bright. Twin:
//! `environment.wgsl`.
//!
//! Equirectangular: the top row is up (+y), the middle column lies towards -z, and columns go on to the right as seen
//! from within. Directions are drawn from a table of the brightest of each pixel's neighbourhood, so that whatever is
//! interpolated from can be drawn.

use crate::light::sky_irradiance::{irradiance_from_table, irradiance_table};
use crate::light::solar_spectrum::luminance;
use btf_capture::{CaptureError, RadianceMap};
use glam::Vec3;
use std::f32::consts::{PI, TAU};
use std::path::Path;

/// Columns at most; larger pictures are averaged down.
pub const MAX_COLUMNS: usize = 1024;
/// Columns at most of the picture that irradiance is summed from: those of a clear sky.
const IRRADIANCE_PICTURE_COLUMNS: usize = 256;

/// A sky, ready to be drawn from.
#[derive(Debug, Clone, PartialEq)]
pub struct Environment {
    width: usize,
    height: usize,
    /// The table as the GPU has it: distribution of the rows (height + 1), of the columns of each row (width + 1 a
    /// row), radiance (3 a pixel); then irradiance by normal (see `sky_irradiance.rs`).
    table: Vec<f32>,
}

impl Environment {
    /// Reads an `.exr` or `.hdr` file; `gain` multiplies it.
    ///
    /// # Errors
    /// As [`RadianceMap::read`].
    pub fn load(path: &Path, gain: f32) -> Result<Environment, CaptureError> {
        Environment::load_turned(path, gain, 0.0)
    }

    /// Reads an `.exr` or `.hdr` file as [`Environment::load`] does, turned about +y by `turn_deg`, to the nearest column
    /// of the picture: by 90 its middle comes to lie towards -x.
    ///
    /// # Errors
    /// As [`RadianceMap::read`].
    pub fn load_turned(path: &Path, gain: f32, turn_deg: f32) -> Result<Environment, CaptureError> {
        let map = RadianceMap::read(path)?;
        let mut rgb: Vec<f32> = map.rgb.iter().map(|x| x * gain).collect();
        let columns = (f64::from(turn_deg) / 360.0 * map.width as f64).round() as i64;
        let shift = columns.rem_euclid(map.width as i64) as usize;
        rgb.chunks_exact_mut(3 * map.width).for_each(|row| row.rotate_left(3 * shift));
        Ok(Environment::new(map.width, map.height, &rgb))
    }

    /// Returns the environment of linear radiance, `[row, column, rgb]`, finite and at least 0. Neither side is 0.
    pub fn new(width: usize, height: usize, rgb: &[f32]) -> Environment {
        let (width, height, rgb) = averaged_down(width, height, rgb, MAX_COLUMNS);
        let brightest = |row: usize, column: usize| {
            let rows = row.saturating_sub(1)..(row + 2).min(height);
            let columns = [column + width - 1, column, column + 1].map(|column| column % width);
            rows.flat_map(|row| columns.map(|column| (row * width + column) * 3))
                .map(|at| rgb[at].max(rgb[at + 1]).max(rgb[at + 2]))
                .fold(0f32, f32::max)
        };
        let mut columns = Vec::with_capacity(height * (width + 1));
        let mut row_sums = Vec::with_capacity(height);
        for row in 0..height {
            let area = (PI * (row as f32 + 0.5) / height as f32).sin();
            let weights: Vec<f64> = (0..width).map(|column| f64::from(brightest(row, column) * area)).collect();
            row_sums.push(weights.iter().sum::<f64>());
            columns.extend(distribution(&weights));
        }
        let mut table = distribution(&row_sums);
        table.extend(columns);
        table.extend(&rgb);
        // A surface sums over so much of the picture that its details do not count.
        let (columns, rows, coarse) = averaged_down(width, height, &rgb, IRRADIANCE_PICTURE_COLUMNS);
        table.extend(irradiance_table(columns, rows, &coarse));
        Environment { width, height, table }
    }

    /// Returns the environment that sends as much in all channels as this does of linear sRGB's luminance.
    pub fn grey(&self) -> Environment {
        let pixels = self.pixels_at();
        let rgb = self.table[pixels..pixels + 3 * self.width * self.height].chunks_exact(3);
        let grey: Vec<f32> =
            rgb.flat_map(|rgb| [luminance([rgb[0], rgb[1], rgb[2]].map(f64::from)) as f32; 3]).collect();
        Environment::new(self.width, self.height, &grey)
    }

    /// Returns the columns and rows.
    pub(crate) fn size(&self) -> [u32; 2] {
        [self.width as u32, self.height as u32]
    }

    /// Returns the table that the GPU reads.
    pub(crate) fn table(&self) -> &[f32] {
        &self.table
    }

    fn columns_at(&self) -> usize {
        self.height + 1
    }

    fn pixels_at(&self) -> usize {
        self.columns_at() + self.height * (self.width + 1)
    }

    fn pixel(&self, row: usize, column: usize) -> Vec3 {
        Vec3::from_slice(&self.table[self.pixels_at() + (row * self.width + column) * 3..])
    }

    /// Returns the radiance from a unit direction, bilinear.
    pub fn radiance(&self, d: Vec3) -> Vec3 {
        let [x, y] = place(d);
        let (x, y) = (x * self.width as f32 - 0.5, (y * self.height as f32 - 0.5).clamp(0.0, self.height as f32 - 1.0));
        let left = (x.floor() as i32).rem_euclid(self.width as i32) as usize;
        let upper = y as usize;
        let (right, lower) = ((left + 1) % self.width, (upper + 1).min(self.height - 1));
        let (along, down) = (x - x.floor(), y - upper as f32);
        let top = self.pixel(upper, left).lerp(self.pixel(upper, right), along);
        let bottom = self.pixel(lower, left).lerp(self.pixel(lower, right), along);
        top.lerp(bottom, down)
    }

    /// Returns the irradiance of a unit normal, without shadows.
    pub fn irradiance(&self, normal: Vec3) -> Vec3 {
        let pixels = 3 * self.width * self.height;
        irradiance_from_table(&self.table[self.pixels_at() + pixels..], normal)
    }

    /// Draws a direction from two numbers in [0, 1).
    pub(crate) fn sample(&self, at: [f32; 2]) -> Vec3 {
        let (row, y) = self.find(0, self.height, at[1]);
        let (column, x) = self.find(self.columns_at() + row * (self.width + 1), self.width, at[0]);
        let azimuth = TAU * ((column as f32 + x) / self.width as f32 - 0.5);
        let polar = PI * (row as f32 + y) / self.height as f32;
        Vec3::new(polar.sin() * azimuth.sin(), polar.cos(), -polar.sin() * azimuth.cos())
    }

    /// Returns the density of [`Environment::sample`], per steradian.
    pub(crate) fn density(&self, d: Vec3) -> f32 {
        let [x, y] = place(d);
        let row = ((y * self.height as f32) as usize).min(self.height - 1);
        let column = ((x * self.width as f32) as usize).min(self.width - 1);
        let of_row = self.columns_at() + row * (self.width + 1) + column;
        let share = (self.table[row + 1] - self.table[row]) * (self.table[of_row + 1] - self.table[of_row]);
        let sin = (1.0 - d.y * d.y).max(1e-8).sqrt();
        share * (self.width * self.height) as f32 / (2.0 * PI * PI * sin)
    }

    /// Returns the step of the distribution at `first` with `count` steps in which `x` lies, and where in it.
    fn find(&self, first: usize, count: usize, x: f32) -> (usize, f32) {
        let (mut low, mut high) = (0, count);
        while high - low > 1 {
            let middle = (low + high) / 2;
            if self.table[first + middle] <= x {
                low = middle;
            } else {
                high = middle;
            }
        }
        let (from, to) = (self.table[first + low], self.table[first + low + 1]);
        (low, if to > from { ((x - from) / (to - from)).clamp(0.0, 1.0) } else { 0.5 })
    }
}

/// Returns where in the picture a unit direction lies, 0 to 1 to the right and downwards.
fn place(d: Vec3) -> [f32; 2] {
    [0.5 + d.x.atan2(-d.z) / TAU, d.y.clamp(-1.0, 1.0).acos() / PI]
}

/// Sums up to each weight, over the sum of all; even where there is no weight.
fn distribution(weights: &[f64]) -> Vec<f32> {
    let total: f64 = weights.iter().sum();
    let mut sums = vec![0.0f32];
    let mut sum = 0.0;
    for (i, weight) in weights.iter().enumerate() {
        sum += weight;
        sums.push(if total > 0.0 { (sum / total) as f32 } else { (i + 1) as f32 / weights.len() as f32 });
    }
    // The last step ends at 1 whatever was rounded.
    sums[weights.len()] = 1.0;
    sums
}

/// Averages a picture down to at most `most_columns` columns and half as many rows, by the mean of square blocks.
fn averaged_down(width: usize, height: usize, rgb: &[f32], most_columns: usize) -> (usize, usize, Vec<f32>) {
    let block = width.div_ceil(most_columns).max(height.div_ceil(most_columns / 2)).max(1);
    if block == 1 {
        return (width, height, rgb.to_vec());
    }
    let (columns, rows) = ((width / block).max(1), (height / block).max(1));
    let mut small = vec![0.0; columns * rows * 3];
    for (at, value) in small.iter_mut().enumerate() {
        let (texel, channel) = (at / 3, at % 3);
        let (row, column) = (texel / columns * block, texel % columns * block);
        let (mut sum, mut count) = (0.0f64, 0.0);
        for r in row..(row + block).min(height) {
            for c in column..(column + block).min(width) {
                sum += f64::from(rgb[(r * width + c) * 3 + channel]);
                count += 1.0;
            }
        }
        *value = (sum / count) as f32;
    }
    (columns, rows, small)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_picture_has_its_middle_towards_minus_x() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("sky.exr");
        // One bright column right of the middle, of eight.
        let rgb = (0..32).flat_map(|pixel| [if pixel % 8 == 4 { 8.0 } else { 1.0 }; 3]).collect();
        std::fs::write(&path, RadianceMap { width: 8, height: 4, rgb }.exr().unwrap()).unwrap();
        // Half a column to the right of -z, and of -x.
        let (sin, cos) = 22.5f32.to_radians().sin_cos();
        let (ahead, left) = (Vec3::new(sin, 0.0, -cos), Vec3::new(-cos, 0.0, -sin));
        let seen = |turn_deg: f32, towards: Vec3| {
            (2.0 * Environment::load_turned(&path, 0.5, turn_deg).unwrap().radiance(towards)[0]).round()
        };
        assert_eq!([seen(0.0, ahead), seen(0.0, left)], [8.0, 1.0]);
        assert_eq!([seen(90.0, ahead), seen(90.0, left)], [1.0, 8.0]);
        assert_eq!([seen(-270.0, left), seen(450.0, left), seen(88.0, left)], [8.0; 3]);
    }
    use crate::sampler;

    #[test]
    fn a_grey_sky_has_the_luminance_of_the_coloured_one() {
        let mut rgb = vec![0.5; 8 * 4 * 3];
        rgb[..3].copy_from_slice(&[10.0, 20.0, 30.0]);
        let sky = Environment::new(8, 4, &rgb);
        let pixel = |sky: &Environment, column: usize| sky.pixel(0, column).to_array();
        let grey = sky.grey();
        for (column, luminance) in [(0, 18.596), (5, 0.5)] {
            let told = pixel(&grey, column);
            assert!(told.iter().all(|value| (value - luminance).abs() < 1e-4), "{told:?}");
        }
        assert_ne!(pixel(&sky, 0), pixel(&grey, 0));
    }

    /// A dim sky with a small sun.
    fn sky() -> Environment {
        let (width, height) = (64, 32);
        let mut rgb = vec![0.1; width * height * 3];
        for (row, column) in [(8, 20), (8, 21), (9, 20)] {
            rgb[(row * width + column) * 3..][..3].copy_from_slice(&[300.0, 200.0, 100.0]);
        }
        Environment::new(width, height, &rgb)
    }

    #[test]
    fn directions_are_drawn_with_their_density_and_give_the_integral() {
        let sky = sky();
        // The integral over the sphere by fine steps in z and angle.
        let (mut integral, mut sum) = (Vec3::ZERO, 0.0);
        let (rows, columns) = (512, 1024);
        for i in 0..rows {
            let polar = PI * (i as f32 + 0.5) / rows as f32;
            for j in 0..columns {
                let azimuth = TAU * (j as f32 + 0.5) / columns as f32;
                let d = Vec3::new(polar.sin() * azimuth.cos(), polar.cos(), polar.sin() * azimuth.sin());
                let area = polar.sin() * PI / rows as f32 * TAU / columns as f32;
                integral += sky.radiance(d) * area;
                sum += sky.density(d) * area;
            }
        }
        assert!((sum - 1.0).abs() < 0.01, "{sum}");
        let mean = |draw: &dyn Fn([f32; 2]) -> Vec3| {
            (0..4096)
                .map(|i| {
                    let d = draw(sampler::two(i, 3));
                    assert!((d.length() - 1.0).abs() < 1e-5);
                    sky.radiance(d) / sky.density(d)
                })
                .sum::<Vec3>()
                / 4096.0
        };
        let found = mean(&|at| sky.sample(at));
        assert!((found.x / integral.x - 1.0).abs() < 0.03, "{found} {integral}");
        // Planted difference: directions turned by a few degrees do not have that density.
        let turned = mean(&|at| glam::Quat::from_rotation_y(0.3) * sky.sample(at));
        assert!((turned.x / integral.x - 1.0).abs() > 0.2, "{turned} {integral}");
    }

    #[test]
    fn up_is_the_top_row_and_the_middle_lies_towards_minus_z() {
        let mut rgb = vec![0.0; 8 * 4 * 3];
        rgb[..24].fill(1.0);
        rgb[(8 + 3) * 3] = 5.0;
        rgb[(8 + 4) * 3] = 5.0;
        let sky = Environment::new(8, 4, &rgb);
        assert_eq!(sky.radiance(Vec3::Y), Vec3::ONE);
        assert_eq!(sky.radiance(Vec3::NEG_Y), Vec3::ZERO);
        let ahead = Vec3::new(0.0, (PI * 0.125).sin(), -(PI * 0.125).cos());
        assert!((sky.radiance(ahead).x - 5.0).abs() < 1e-4);
        assert!(sky.radiance(ahead * Vec3::new(1.0, 1.0, -1.0)).x < 0.01);
    }

    #[test]
    fn large_pictures_are_averaged_and_black_ones_are_drawn_evenly() {
        let rgb: Vec<f32> = (0..2048 * 1024).flat_map(|i| [(i % 2) as f32; 3]).collect();
        let sky = Environment::new(2048, 1024, &rgb);
        assert_eq!(sky.size(), [1024, 512]);
        assert!((sky.radiance(Vec3::new(0.6, 0.0, 0.8)).x - 0.5).abs() < 1e-5);
        let black = Environment::new(4, 2, &[0.0; 24]);
        assert!((0..64).all(|i| black.density(black.sample(sampler::two(i, 1))) > 0.0));
    }
}
