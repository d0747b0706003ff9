//! Rows of docs/results/voltex.md, "Level-of-detail transition": `cargo run --release -p btf-tests --example dolly -- MODEL FILE.voltex [PATHS]`.
//!
//! For each of two suns, light of the plant at distances that grow by the fourth root of two, as it is handed over, as a mesh
//! everywhere, and as a volume everywhere.

use btf_tests::dolly::{DollyRow, STEPS, dolly, largest_step, luminance};
use btf_viewer::load_scene;
use glam::Vec3;
use std::error::Error;
use std::path::Path;

/// Sun from the side of the eye, and from behind the plant.
const SUNS: [(&str, Vec3); 2] =
    [("behind the eye", Vec3::new(-0.5, 0.3, 1.0)), ("behind the plant", Vec3::new(0.5, 0.3, -1.0))];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [model, volume, rest @ ..] = arguments.as_slice() else {
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
