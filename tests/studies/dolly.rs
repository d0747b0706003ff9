//! A dolly past the level-of-detail transition of a plant: how much of its light reaches the eye, from where its leaves
//! are many pixels wide to where they are a small part of one.
//!
//! Rows of docs/results/voltex.md, "Level-of-detail transition":
//! `cargo run --release -p btf-tests -- dolly MODEL FILE.voltex [PATHS]`.
//!
//! For each of two suns, light of the plant at distances that grow by the fourth root of two, as it is handed over, as
//! a mesh everywhere, and as a volume everywhere.

use btf_viewer::{Camera, CpuPicture, Scene, ShadeOptions, load_scene};
use glam::Vec3;
use std::error::Error;
use std::path::Path;

/// Leaves are so many pixels wide where the dolly begins, and as much less than one where it ends: 64 times the
/// distance.
pub const MAX_LEAF_PIXELS: f32 = 8.0;
/// Places in which the distance doubles.
pub const STEPS: i32 = 4;
/// Width of a pixel at distance 1: so small that the plant is seen from one side all the way.
pub const PIXEL_WIDTH: f32 = 2e-4;

/// Measurement at one distance.
#[derive(Debug, Clone, Copy)]
pub struct DollyRow {
    /// Width of a leaf in pixels.
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

/// Sun from the side of the eye, and from behind the plant.
const SUNS: [(&str, Vec3); 2] =
    [("behind the eye", Vec3::new(-0.5, 0.3, 1.0)), ("behind the plant", Vec3::new(0.5, 0.3, -1.0))];

/// Runs the study.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let [model, volume, rest @ ..] = arguments else {
        return Err("dolly takes MODEL FILE.voltex [PATHS]".into());
    };
    let paths: usize = rest.first().map_or(Ok(1 << 18), |paths| paths.parse())?;
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("scene.toml");
    let [model, volume] = [model, volume].map(|file| Path::new(file).canonicalize());
    let (model, volume) = (model?, volume?);
    let scene = |leaf_size: &str| -> Result<_, Box<dyn Error>> {
        let text = format!(
            "background = [0, 0, 0]\n[[volume]]\nfile = {volume:?}\nmesh = {model:?}\n{leaf_size}\n\
             [daylight]\ndate_time = \"2026-06-21T15:00+02:00\"\nplace = \"52.5,13.4\"\nparts = \"sun\"\n"
        );
        std::fs::write(&path, text)?;
        Ok(load_scene(&path, Vec::new())?)
    };
    let scenes = [scene("")?, scene("leaf_size = 1e9")?, scene("leaf_size = 1e-9")?];
    let leaf_width = scenes[0].geometry.instances()[0].leaf_width;
    println!("leaves {:.1} mm wide", 1e3 * leaf_width);
    for (name, towards) in SUNS {
        let rows: Vec<Vec<DollyRow>> = scenes.iter().map(|scene| dolly(scene, towards, leaf_width, paths)).collect();
        println!("\nsun {name}; largest step {:.2} %\n", 100.0 * largest_step(&rows[0]));
        println!("| leaf, pixels | plant, pixels | handed over | mesh | volume | step |\n|---|---|---|---|---|---|");
        for i in 0..rows[0].len() {
            let [own, mesh, volume] = [0, 1, 2].map(|k| luminance(&rows[k][i]));
            let step = if i > 0 { own / luminance(&rows[0][i - 1]) - 1.0 } else { 0.0 };
            let DollyRow { leaf_pixels, pixels, .. } = rows[0][i];
            println!("| {leaf_pixels:.3} | {pixels} | {own:.5} | {mesh:.5} | {volume:.5} | {:+.2} % |", 100.0 * step);
        }
        let steps = rows.iter().map(|rows| format!("{:.2} %", 100.0 * largest_step(rows))).collect::<Vec<_>>();
        println!("\nlargest steps {}, {STEPS} to an octave", steps.join(", "));
    }
    Ok(())
}
