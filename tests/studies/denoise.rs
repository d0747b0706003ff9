//! Prints how far pictures of few samples are from one of 1,024, with and without the filter of noise, over the time that they take,
//! as Markdown: `cargo run --release -p btf-tests -- denoise [WIDTH [CANOPY.glb [SCENE ...]]]`.
//!
//! Scenes are all, or those that are named: forest, grove, lawn, canopy. Landscapes are those of `btf-view scene`, the
//! canopy stands in the same evening. All are drawn by paths of up to four rays. The filter's time is in its column. Times are
//! of this machine and run: compare them with each other.

use btf_viewer::{
    BackendChoice, Control, Landscape, LandscapeParams, MeshChoice, Picture, RenderMode, RenderParams, Scene,
    ShadeOptions, render,
};
use std::error::Error;
use std::path::Path;
use std::time::Instant;

/// Samples of the picture that errors are against.
const TRUTH: u32 = 1024;
/// Samples of the pictures.
const SAMPLES: [u32; 7] = [2, 4, 8, 16, 32, 64, 128];
/// Quality that pictures are to reach, dB.
pub(crate) const GOAL_DB: f64 = 30.0;
/// Rays of a path.
const DEPTH: u32 = 4;

/// A picture's number of samples, its quality in dB and the seconds that it took.
pub(crate) type Measured = (u32, f64, f64);

/// Draws a picture; also returns the seconds that it took.
pub(crate) fn timed(scene: &Scene, params: &RenderParams) -> Result<(Picture, f64), Box<dyn Error>> {
    let start = Instant::now();
    let picture = render(scene, params, &Control::SILENT)?.picture;
    Ok((picture, start.elapsed().as_secs_f64()))
}

fn drawn(scene: &Scene, size: [u32; 2], frames: u32, denoise: bool) -> Result<(Picture, f64), Box<dyn Error>> {
    let shade = ShadeOptions { mode: RenderMode::Path, depth: DEPTH, ..ShadeOptions::default() };
    let params = RenderParams { size, frames, backend: BackendChoice::Cpu, shade, denoise, ..RenderParams::default() };
    timed(scene, &params)
}

/// Returns the seconds after which a row of pictures has the quality asked for: between two of them as the logarithm of time.
pub(crate) fn time_to(goal_db: f64, row: &[Measured]) -> Option<f64> {
    let at = row.iter().position(|(_, db, _)| *db >= goal_db)?;
    let (_, db, s) = row[at];
    let Some(before) = at.checked_sub(1) else { return Some(s) };
    let (_, db_before, s_before) = row[before];
    let share = (goal_db - db_before) / (db - db_before).max(1e-9);
    Some((s_before.ln() + share * (s / s_before).ln()).exp())
}

/// Runs the study.
///
/// # Errors
/// Those of scenes, and of drawing.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let width: u32 = arguments.first().map_or(Ok(160), |width| width.parse())?;
    let size = [width, width * 9 / 16];
    let mut scenes = Vec::new();
    for (landscape, camera) in [(Landscape::Forest, 1), (Landscape::Grove, 2), (Landscape::Lawn, 0)] {
        let (mut scene, _) = landscape.scene(&LandscapeParams::default())?;
        scene.camera = *scene.cameras().get(camera).ok_or("a landscape has three cameras")?;
        scenes.push((landscape.name().to_string(), scene));
    }
    if let Some(canopy) = arguments.get(1) {
        let mut scene = Scene::built_in(&MeshChoice::File(Path::new(canopy).into()), Vec::new(), [1.0; 2])?;
        let evening = &scenes[0].1;
        (scene.sun, scene.environment, scene.ambient) = (evening.sun, evening.environment.clone(), evening.ambient);
        scene.lights.clear();
        scene.exposure_ev = evening.exposure_ev;
        scenes.push(("canopy".into(), scene));
    }
    let asked = arguments.get(2..).unwrap_or_default();
    scenes.retain(|(name, _)| asked.is_empty() || asked.contains(name));
    println!("| scene | samples | s | dB | with the filter: s | dB |\n|---|---|---|---|---|---|");
    let mut times = Vec::new();
    for (name, scene) in &scenes {
        let (truth, _) = drawn(scene, size, TRUTH, false)?;
        let mut rows = [Vec::new(), Vec::new()];
        for samples in SAMPLES {
            for (row, denoise) in rows.iter_mut().zip([false, true]) {
                let (picture, s) = drawn(scene, size, samples, denoise)?;
                row.push((samples, picture.psnr_db(&truth, scene.exposure_ev), s));
            }
        }
        for ((samples, db, s), (_, filtered_db, filtered_s)) in rows[0].iter().zip(&rows[1]) {
            println!("| {name} | {samples} | {s:.2} | {db:.1} | {filtered_s:.2} | {filtered_db:.1} |");
        }
        times.push((name, rows.map(|row| time_to(GOAL_DB, &row))));
    }
    println!("\n| scene | s to {GOAL_DB} dB | with the filter | of that time |\n|---|---|---|---|");
    for (name, [plain, filtered]) in times {
        let cell = |s: Option<f64>| s.map_or("more".to_string(), |s| format!("{s:.2}"));
        let share = plain.zip(filtered).map_or(String::new(), |(plain, filtered)| format!("{:.2}", filtered / plain));
        println!("| {name} | {} | {} | {share} |", cell(plain), cell(filtered));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_to_a_quality_lies_between_two_pictures() {
        let row = [(2, 20.0, 1.0), (8, 32.0, 4.0)];
        let at = |db| time_to(db, &row);
        assert!((at(26.0).unwrap_or(0.0) - 2.0).abs() < 1e-9);
        assert_eq!((at(10.0), at(40.0)), (Some(1.0), None));
    }
}
