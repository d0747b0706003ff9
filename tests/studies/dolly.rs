//! A dolly past the level-of-detail transition of a plant: how much of its light reaches the eye, from where its leaves
//! are many pixels wide to where they are a small part of one.
//!
//! Rows of docs/results/voltex.md, "Level-of-detail transition":
//! `cargo run --release -p btf-tests -- dolly MODEL FILE.voltex [PATHS]`.
//!
//! For each of two suns, light of the plant at distances that grow by the fourth root of two, as it is handed over, as
//! a mesh everywhere, and as a volume everywhere.

use btf_viewer::{Camera, CpuPicture, DetailWidths, Scene, ShadeOptions, load_scene};
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

/// Pixels along each side of the picture by whose rays a plant is looked at from all distances.
const SIDE: u32 = 64;
/// Parts of the samples that are summed apart, to tell how uncertain their sum is.
const BATCHES: u32 = 8;
/// Largest step of the bar.
const BAR: f64 = 0.01;

/// Lights of the dolly: name, part of daylight, and from the plant to the eye.
const LIGHTS: [(&str, &str, Vec3); 3] = [
    ("sun behind the eye", "sun", Vec3::new(-0.5, 0.3, 1.0)),
    ("sun behind the plant", "sun", Vec3::new(0.5, 0.3, -1.0)),
    ("sky", "sky", Vec3::new(-0.5, 0.3, 1.0)),
];

/// A number and its standard error.
#[derive(Debug, Clone, Copy)]
struct Estimate {
    value: f64,
    error: f64,
}

/// Mean luminance of a plant at one distance by each of the [`BATCHES`].
type Batches = Vec<f64>;

/// A plant's sphere, and the width of its leaves.
#[derive(Debug, Clone, Copy)]
struct Plant {
    centre: Vec3,
    radius: f32,
    leaf_width: f32,
}

/// A dolly in which only the widths change by which levels of detail are chosen, and every distance has the same rays and
/// the same random numbers: what differs from one distance to the next is what levels and the transition make of them.
fn dolly_of_same_rays(scene: &Scene, plant: Plant, towards: Vec3, paths: usize) -> Vec<(f32, Batches)> {
    let Plant { centre, radius, leaf_width } = plant;
    // Where a leaf is one pixel wide.
    let distance = leaf_width / PIXEL_WIDTH;
    let fov_deg = 2.0 * (radius / distance).atan().to_degrees();
    let camera = Camera { eye: centre + distance * towards.normalize(), target: centre, up: Vec3::Y, fov_deg };
    let scene = Scene { camera, ..scene.clone() };
    let samples = (paths as u32 / (SIDE * SIDE * BATCHES)).max(1).next_power_of_two();
    let at = |leaf_pixels: f32| -> Batches {
        let pixel = PIXEL_WIDTH / leaf_pixels;
        let batch = |number: u32| {
            let mut picture = CpuPicture::new([SIDE; 2]);
            picture.widths = Some(DetailWidths { pixel, ray: pixel });
            picture.samples = number * samples;
            (0..samples).for_each(|_| picture.add_sample(&scene, &ShadeOptions::default(), &|| true));
            let sum: f64 = picture.sums.iter().map(|rgb| luminance_of(rgb.map(f64::from))).sum();
            // Of the square about the disc.
            sum / f64::from(samples * SIDE * SIDE) * 4.0 / std::f64::consts::PI
        };
        (0..BATCHES).map(batch).collect()
    };
    let octaves = 2 * MAX_LEAF_PIXELS.log2() as i32;
    let leaf_pixels = (0..=octaves * STEPS).map(|i| MAX_LEAF_PIXELS * (-i as f32 / STEPS as f32).exp2());
    leaf_pixels.map(|leaf_pixels| (leaf_pixels, at(leaf_pixels))).collect()
}

/// The mean of what the batches give for a ratio of sums, and its standard error by how they differ.
fn ratio(above: &Batches, below: &Batches) -> Estimate {
    let value = above.iter().sum::<f64>() / below.iter().sum::<f64>();
    let squares: f64 = above.iter().zip(below).map(|(a, b)| (a / b - value).powi(2)).sum();
    let count = above.len() as f64;
    Estimate { value, error: (squares / (count * (count - 1.0))).sqrt() }
}

/// The relative step from each row to the next.
fn steps(rows: &[(f32, Batches)]) -> Vec<Estimate> {
    let step = |pair: &[(f32, Batches)]| {
        let Estimate { value, error } = ratio(&pair[1].1, &pair[0].1);
        Estimate { value: value - 1.0, error }
    };
    rows.windows(2).map(step).collect()
}

/// The largest of some steps, as text.
fn largest(steps: &[Estimate]) -> String {
    let most = steps.iter().max_by(|a, b| a.value.abs().total_cmp(&b.value.abs()));
    most.map_or("none".into(), |step| format!("{:+.2} ± {:.2} %", 100.0 * step.value, 100.0 * step.error))
}

/// Looks at a plant under one light; prints a row for each distance, and returns cells of the summary.
fn look(scenes: &[Scene; 3], plant: Plant, towards: Vec3, paths: usize) -> String {
    let Plant { radius, leaf_width, .. } = plant;
    let rows = scenes.each_ref().map(|scene| dolly_of_same_rays(scene, plant, towards, paths));
    let steps = rows.each_ref().map(|rows| steps(rows));
    println!(
        "| leaf, pixels | plant, pixels | mesh | volume / mesh | transition | step of the volume | of the transition |"
    );
    println!("|---|---|---|---|---|---|---|");
    let mean = |batches: &Batches| batches.iter().sum::<f64>() / batches.len() as f64;
    for i in 0..rows[0].len() {
        let [own, mesh, volume] = rows.each_ref().map(|rows| &rows[i].1);
        let pixels = 2.0 * radius / leaf_width * rows[0][i].0;
        let Estimate { value, error } = ratio(volume, mesh);
        let cell = |steps: &[Estimate]| {
            let step = i.checked_sub(1).map(|before| steps[before]);
            step.map_or(String::new(), |step| format!("{:+.2} ± {:.2} %", 100.0 * step.value, 100.0 * step.error))
        };
        let own_cells = [cell(&steps[2]), cell(&steps[0])].join(" | ");
        let [own, mesh] = [own, mesh].map(mean);
        println!(
            "| {:.3} | {pixels:.1} | {mesh:.5} | {value:.3} ± {error:.3} | {own:.5} | {own_cells} |",
            rows[0][i].0
        );
    }
    // Between leaves of 2 pixels and of 1/2.
    let (first, last) = (2 * STEPS as usize, 4 * STEPS as usize);
    let whole = |rows: &[(f32, Batches)]| -> Batches {
        (0..BATCHES as usize).map(|k| rows.iter().map(|(_, batches)| batches[k]).sum()).collect()
    };
    let Estimate { value, error } = ratio(&whole(&rows[2]), &whole(&rows[1]));
    let missed = steps[0].iter().filter(|step| step.value.abs() > BAR).count();
    format!(
        "{value:.3} ± {error:.3} | {} | {} | {} | {} | {missed}",
        largest(&steps[1]),
        largest(&steps[2]),
        largest(&steps[0][first..last]),
        largest(&steps[0])
    )
}

/// The three scenes of a plant under a part of daylight: handed over, as a mesh and as a volume everywhere.
fn scenes_of([model, volume]: [&Path; 2], parts: &str) -> Result<([Scene; 3], Plant), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("scene.toml");
    let load = |leaf_size: &str, around: &str| -> Result<Scene, Box<dyn Error>> {
        let text = format!(
            "background = [0, 0, 0]\n[[volume]]\nfile = {volume:?}\nmesh = {model:?}\n{leaf_size}\n\
             [daylight]\ndate_time = \"2026-06-21T15:00+02:00\"\nplace = \"52.5,13.4\"\nparts = \"{parts}\"\n{around}"
        );
        std::fs::write(&path, text)?;
        Ok(load_scene(&path, Vec::new())?)
    };
    let alone = load("", "")?;
    let (centre, radius) = alone.geometry.bounding_sphere();
    let plant = Plant { centre, radius, leaf_width: alone.geometry.instances()[0].leaf_width };
    // The sky is not to be seen: a black sphere is in its way, farther from the plant than what shades it and than the eye.
    let is_sky = parts == "sky";
    let far = 4.0 * plant.leaf_width / PIXEL_WIDTH;
    let around = format!(
        "[[material]]\nname = \"black\"\ndiffuse = [0, 0, 0]\n\
         [[object]]\nmesh = \"sphere\"\nmaterial = \"black\"\nscale = [{far}, {far}, {far}]\n"
    );
    let mut scenes = Vec::new();
    for leaf_size in ["", "leaf_size = 1e9", "leaf_size = 1e-9"] {
        let mut scene = load(leaf_size, if is_sky { &around } else { "" })?;
        if is_sky {
            scene.ambient.distance = 4.0 * radius;
        }
        scenes.push(scene);
    }
    Ok((scenes.try_into().map_err(|_| "three scenes")?, plant))
}

/// Runs the study.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let [model, volume, rest @ ..] = arguments else {
        return Err("dolly takes MODEL FILE.voltex [PATHS]".into());
    };
    let paths: usize = rest.first().map_or(Ok(1 << 18), |paths| paths.parse())?;
    let [model, volume] = [model, volume].map(|file| Path::new(file).canonicalize());
    let (model, volume) = (model?, volume?);
    let mut summary = Vec::new();
    for (name, parts, towards) in LIGHTS {
        let (scenes, plant) = scenes_of([&model, &volume], parts)?;
        println!("\n{name}\n");
        summary.push(format!("| {name} | {} |", look(&scenes, plant, towards, paths)));
    }
    println!(
        "\n| light | volume / mesh | largest step of the mesh | of the volume | of the transition, leaves of 2 to 1/2 \
         pixels | of the transition, 8 to 1/8 | steps above {:.0} % |",
        100.0 * BAR
    );
    println!("|{}", "---|".repeat(7));
    summary.iter().for_each(|row| println!("{row}"));
    Ok(())
}
