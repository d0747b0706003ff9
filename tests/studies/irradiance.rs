//! Prints how far pictures with an irradiance volume are from ones whose paths have one bounce, and the time that both take, as
//! Markdown: `cargo run --release -p btf-tests -- irradiance [WIDTH [CANOPY.glb [SAMPLES]]]`.
//!
//! The truth are 1,024 samples (SAMPLES) of paths of two rays. Differences are those of linear radiance over its mean, of pictures
//! of a quarter as many samples; what paths of two rays differ by with as many is noise. Times are of this machine and run: compare
//! them with each other.

use crate::denoise::{GOAL_DB, time_to, timed};
use btf_viewer::{
    BackendChoice, Camera, Landscape, LandscapeParams, MeshChoice, Picture, RenderMode, RenderParams, Scene,
    ShadeOptions,
};
use std::error::Error;
use std::path::Path;

/// Cells along the longest side of the volumes whose error is told.
const CELLS: [u32; 3] = [8, 16, 32];
/// Those of the volume whose time is told.
const USUAL_CELLS: u32 = 32;
/// Samples after which a volume has all its rays.
const FILLED: u32 = 32;
/// Samples of the pictures that are timed.
const SAMPLES: [u32; 8] = [1, 2, 4, 8, 16, 32, 64, 128];
/// The eye's distance from the canopy's middle, in its radii, and the direction there.
const CANOPY_EYE: [f32; 3] = [0.1, 0.16, 0.32];

/// A way to draw light after one bounce, and none of it.
fn ways() -> Vec<(String, ShadeOptions)> {
    let direct = ShadeOptions { levels: false, ..ShadeOptions::default() };
    let path = ShadeOptions { mode: RenderMode::Path, depth: 2, ..ShadeOptions::default() };
    let volume = |cells| (format!("{cells} cells"), ShadeOptions { irradiance_cells: cells, ..direct });
    let mut ways = vec![("paths of two rays".into(), path), ("no bounce".into(), direct)];
    ways.extend(CELLS.map(volume));
    ways
}

fn drawn(scene: &Scene, size: [u32; 2], frames: u32, shade: ShadeOptions) -> Result<(Picture, f64), Box<dyn Error>> {
    timed(scene, &RenderParams { size, frames, backend: BackendChoice::Cpu, shade, ..RenderParams::default() })
}

/// Returns the mean difference of two pictures and the root mean square of it, over the mean of the second.
fn differences(picture: &[[f32; 3]], truth: &[[f32; 3]]) -> [f64; 2] {
    let (mut sum, mut squares, mut level) = (0.0, 0.0, 0.0);
    for (a, b) in picture.iter().flatten().zip(truth.iter().flatten()) {
        let (a, b) = (f64::from(*a), f64::from(*b));
        (sum, squares, level) = (sum + a - b, squares + (a - b) * (a - b), level + b);
    }
    let count = 3.0 * truth.len() as f64;
    [sum / level, (squares / count).sqrt() / (level / count)]
}

/// Runs the study.
///
/// # Errors
/// Those of scenes, and of drawing.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let width: u32 = arguments.first().map_or(Ok(160), |width| width.parse())?;
    let truth_samples: u32 = arguments.get(2).map_or(Ok(1024), |samples| samples.parse())?;
    let size = [width, width * 9 / 16];
    let (forest, _) = Landscape::Forest.scene(&LandscapeParams::default())?;
    let mut scenes = Vec::new();
    if let Some(canopy) = arguments.get(1) {
        let mut scene = Scene::built_in(&MeshChoice::File(Path::new(canopy).into()), Vec::new(), [1.0; 2])?;
        (scene.sun, scene.environment, scene.ambient) = (forest.sun, forest.environment.clone(), forest.ambient);
        scene.lights.clear();
        scene.exposure_ev = forest.exposure_ev;
        let Camera { eye, target, .. } = scene.camera;
        let eye = target + eye.distance(target) * glam::Vec3::from(CANOPY_EYE);
        scene.camera = Camera { eye, ..scene.camera };
        scenes.push(("canopy", scene));
    }
    scenes.push(("forest", forest));
    println!("| scene | light | mean difference | root mean square | s | filled in, s |\n|---|---|---|---|---|---|");
    let mut rows = Vec::new();
    for (name, scene) in &scenes {
        let ways = ways();
        let (truth, _) = drawn(scene, size, truth_samples, ways[0].1)?;
        for (way, shade) in &ways {
            let (picture, s) = drawn(scene, size, truth_samples / 4, *shade)?;
            let [mean, rms] = differences(&picture.radiance, &truth.radiance);
            // A picture of one pixel takes no time but that of the volume.
            let (_, filled_s) = drawn(scene, [1, 1], FILLED, *shade)?;
            println!("| {name} | {way} | {:+.1} % | {:.1} % | {s:.1} | {filled_s:.1} |", 100.0 * mean, 100.0 * rms);
        }
        let volume = ways.iter().find(|(way, _)| *way == format!("{USUAL_CELLS} cells"));
        for (way, shade) in [&ways[0]].into_iter().chain(volume) {
            let mut row = Vec::new();
            for samples in SAMPLES.into_iter().filter(|samples| 4 * samples <= truth_samples) {
                let (picture, s) = drawn(scene, size, samples, *shade)?;
                row.push((samples, picture.psnr_db(&truth, scene.exposure_ev), s));
            }
            rows.push((name, way.clone(), row));
        }
    }
    println!("\n| scene | light | samples, dB, s | s to {GOAL_DB} dB |\n|---|---|---|---|");
    for (name, way, row) in rows {
        let cells: Vec<String> = row.iter().map(|(samples, db, s)| format!("{samples}: {db:.1}, {s:.2}")).collect();
        let time = time_to(GOAL_DB, &row).map_or("more".into(), |s| format!("{s:.2}"));
        println!("| {name} | {way} | {} | {time} |", cells.join("; "));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_told_over_the_mean() {
        let [mean, rms] = differences(&[[1.0; 3], [3.0; 3]], &[[2.0; 3], [2.0; 3]]);
        assert!(mean.abs() < 1e-12 && (rms - 0.5).abs() < 1e-12);
        assert!((differences(&[[3.0; 3]], &[[2.0; 3]])[0] - 0.5).abs() < 1e-12);
    }
}
