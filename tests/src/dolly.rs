//! A dolly past the level-of-detail transition of a plant: how much light of it reaches the eye, from where its leaves are many pixels wide to where
//! they are a small part of one.

use btf_viewer::{Camera, CpuPicture, Scene, ShadeOptions};
use glam::Vec3;

/// Leaves are so many pixels wide where the dolly begins, and as much less than one where it ends: 64 times the distance.
pub const MAX_LEAF_PIXELS: f32 = 8.0;
/// Places in which the distance doubles.
pub const STEPS: i32 = 4;
/// Width of a pixel at distance 1: so small that the plant is seen from one side all the way.
pub const PIXEL_WIDTH: f32 = 2e-4;

/// What is seen at one distance.
#[derive(Debug, Clone, Copy)]
pub struct DollyRow {
    /// How many pixels wide a leaf is.
    pub leaf_pixels: f32,
    /// Pixels across the plant.
    pub pixels: u32,
    /// Mean radiance over a disc about the plant, as large as itself, linear RGB.
    pub radiance: [f64; 3],
}

/// Looks at a scene with one plant, before black, from all distances along `towards` (from the plant to the eye), by
/// `paths` a distance at least. Leaves are `leaf_width` wide.
pub fn dolly(scene: &Scene, towards: Vec3, leaf_width: f32, paths: usize) -> Vec<DollyRow> {
    let octaves = 2 * MAX_LEAF_PIXELS.log2() as i32;
    (0..=octaves * STEPS)
        .map(|i| row(scene, towards, leaf_width, MAX_LEAF_PIXELS * (-i as f32 / STEPS as f32).exp2(), paths))
        .collect()
}

/// The row where a leaf is `leaf_pixels` wide.
pub fn row(scene: &Scene, towards: Vec3, leaf_width: f32, leaf_pixels: f32, paths: usize) -> DollyRow {
    let (centre, radius) = scene.geometry.bounding_sphere();
    let distance = leaf_width / (leaf_pixels * PIXEL_WIDTH);
    // All of the sphere, and an edge of one pixel.
    let pixels = (2.0 * radius / (distance * PIXEL_WIDTH)).ceil() as u32 + 2;
    let fov_deg = 2.0 * (0.5 * pixels as f32 * PIXEL_WIDTH).atan().to_degrees();
    let camera = Camera { eye: centre + distance * towards.normalize(), target: centre, up: Vec3::Y, fov_deg };
    let scene = Scene { camera, ..scene.clone() };
    let mut picture = CpuPicture::new([pixels; 2]);
    // Samples are stratified by powers of two.
    let samples = paths.div_ceil((pixels * pixels) as usize).next_power_of_two();
    for _ in 0..samples {
        picture.add_sample(&scene, &ShadeOptions::default(), &|| true);
    }
    let side = f64::from(distance * PIXEL_WIDTH);
    let disc = std::f64::consts::PI * f64::from(radius).powi(2);
    let radiance = picture.radiance();
    let sum = |channel: usize| radiance.iter().map(|pixel| f64::from(pixel[channel])).sum::<f64>();
    DollyRow { leaf_pixels, pixels, radiance: [0, 1, 2].map(|channel| sum(channel) * side * side / disc) }
}

/// Luminance of a row.
pub fn luminance(row: &DollyRow) -> f64 {
    luminance_of(row.radiance)
}

/// Luminance of linear sRGB.
pub(crate) fn luminance_of([r, g, b]: [f64; 3]) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// The largest relative step from one row to the next, in luminance.
pub fn largest_step(rows: &[DollyRow]) -> f64 {
    rows.windows(2).map(|pair| (luminance(&pair[1]) / luminance(&pair[0]) - 1.0).abs()).fold(0.0, f64::max)
}
