//! Prints what `btf-view scene lawn|grove|forest` cost as volumes and as triangles with the same error, as Markdown:
//! `cargo run --release -p btf-tests -- landscape_costs [WIDTH [CAMERA [both|sun|sky [BACKEND ...]]]]`.
//!
//! Triangles are the plants that the volumes are made of, each where the skin has its volume, by the affine map of its
//! texel: trees and tufts lean and stretch, and are not bent. Both stand under the landscape's own sun and sky, or one
//! of them, whose noise counts in both. Times are of this machine and run: compare them with each other.

use crate::beside::{Explicit, drawn, scaled};
use btf_models::{LeafDescription, Species, TextureImages};
use btf_synth::{Existing, PlantsParams, write_plants};
use btf_viewer::{
    BackendChoice, Control, DaylightParts, GpuTracer, Instance, Landscape, LandscapeParams, Outdoors, RenderParams,
    Scene, render,
};
use std::error::Error;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Rays a pixel of the picture that errors are against.
const TRUTH: u32 = 256;
/// Rays a pixel of volumes.
const VOLUME_RAYS: [u32; 3] = [1, 4, 16];
/// Rays a pixel by which triangles are timed.
const TIMED_RAYS: u32 = 4;
/// Seconds for which a picture is drawn again, up to three times in all; the least time counts.
const REPEAT_S: f64 = 3.0;
/// Bytes of a triangle: three corners of three f32.
const TRIANGLE_BYTES: f64 = 36.0;
/// Renderers by their names.
const BACKENDS: [(&str, BackendChoice); 3] = [
    ("cpu", BackendChoice::Cpu),
    ("bvh", BackendChoice::Gpu(GpuTracer::Bvh)),
    ("ray-query", BackendChoice::Gpu(GpuTracer::RayQuery)),
];

/// Writes the models of a landscape's plants into a folder, as `cargo xtask volumes` grows them for its volumes.
fn models(landscape: Landscape, folder: &Path) -> Result<Vec<PathBuf>, Box<dyn Error>> {
    let grass = PlantsParams { flowers: 0.0, ..PlantsParams::of(Species::Grass) };
    let tree = PlantsParams { branches: 2154, leaves: 6336, ..PlantsParams::of(Species::Tree) };
    let spruce = PlantsParams { branches: 2154, leaves: 6336, ..PlantsParams::of(Species::Spruce) };
    let second = |plant: &PlantsParams| PlantsParams { seed: 7, ..plant.clone() };
    let grown = match landscape {
        Landscape::Lawn => vec![grass.clone(), PlantsParams { flowers: 1.0, seed: 2, ..grass }],
        Landscape::Grove => vec![tree],
        Landscape::Forest => vec![tree.clone(), second(&tree), spruce.clone(), second(&spruce)],
    };
    let mut files = Vec::new();
    for (number, params) in grown.iter().enumerate() {
        let file = folder.join(format!("{}{number}.glb", landscape.name()));
        let leaf = LeafDescription::of(Some(params.species), None);
        let silent = |_, _| ControlFlow::Continue(());
        write_plants(&file, params, &leaf, TextureImages::default(), Existing::Refuse, &silent)?;
        files.push(file);
    }
    Ok(files)
}

/// A landscape whose plants are triangles alone. Writes their models into a folder.
pub(crate) fn as_triangles(landscape: Landscape, folder: &Path) -> Result<Scene, Box<dyn Error>> {
    let params = LandscapeParams { meshes: models(landscape, folder)?, ..LandscapeParams::default() };
    let (mut scene, _) = landscape.scene(&params)?;
    // No volume stands in for the models any more.
    scene.volumes = None;
    Arc::make_mut(&mut scene.geometry).set_leaf_widths(|_, _| 0.0);
    Ok(scene)
}

/// Least mean time of a frame, seconds.
fn frame_s(scene: &Scene, size: [u32; 2], frames: u32, backend: BackendChoice) -> Result<f64, Box<dyn Error>> {
    let params = RenderParams { size, frames, backend, ..RenderParams::default() };
    let (mut least, mut spent) = (f64::INFINITY, 0.0);
    for _ in 0..3 {
        let s = 1e-3 * render(scene, &params, &Control::SILENT)?.report.frame_ms;
        (least, spent) = (s.min(least), spent + s * f64::from(frames));
        if spent > REPEAT_S {
            break;
        }
    }
    Ok(least)
}

/// View of a landscape: size, camera, and parts of daylight.
#[derive(Clone, Copy)]
struct View {
    size: [u32; 2],
    /// 1 to 3.
    camera: usize,
    parts: DaylightParts,
}

/// A landscape as volumes and as triangles.
struct Both {
    volumes: Scene,
    triangles: Scene,
    /// Triangles before those of the plants.
    of_ground: u32,
    /// Cells of a table.
    memory: String,
}

fn both(landscape: Landscape, view: View, folder: &Path) -> Result<Both, Box<dyn Error>> {
    let of_volumes = LandscapeParams::default();
    let (mut volumes, counts) = landscape.scene(&of_volumes)?;
    let mut triangles = as_triangles(landscape, folder)?;
    for scene in [&mut volumes, &mut triangles] {
        scene.camera = *scene.cameras().get(view.camera.wrapping_sub(1)).ok_or("CAMERA is 1 to 3")?;
        let Some(Outdoors { daylight, .. }) = scene.outdoors.take() else { return Err("no daylight".into()) };
        let light = daylight.sun_and_sky()?;
        scene.stand_outdoors(Outdoors { daylight, parts: view.parts }, light);
    }
    let of_ground = volumes.geometry.triangles().len() as u32;
    let mut skin_words = 0;
    for skin in volumes.volumes.iter().flat_map(|volumes| volumes.skins()) {
        for level in &skin.levels {
            skin_words += level.shell.words()?.len();
        }
    }
    let geometry = &triangles.geometry;
    let plants = geometry.triangles().len() - of_ground as usize;
    let instances = geometry.instances().len() - 1;
    let placed = geometry.placed_triangles() - u64::from(of_ground);
    let mb = |bytes: f64| format!("{:.2}", 1e-6 * bytes);
    let memory = format!(
        "| {} | {} | {} | {plants} | {} | {} | {:.0} |",
        landscape.name(),
        mb(counts.volume_bytes as f64),
        mb(4.0 * skin_words as f64),
        mb(TRIANGLE_BYTES * plants as f64),
        mb((instances * size_of::<Instance>()) as f64),
        1e-6 * TRIANGLE_BYTES * placed as f64,
    );
    Ok(Both { volumes, triangles, of_ground, memory })
}

/// A picture of volumes with so many rays a pixel.
struct VolumeRow {
    rays: u32,
    brightness: f64,
    /// Relative error, and that of the picture made as bright as the triangles'.
    errors: [f64; 2],
    /// Rays a pixel of triangles for both.
    needed: [f64; 2],
    /// Of each renderer: seconds of the volumes, and of one ray of the triangles.
    seconds: Vec<[f64; 2]>,
}

/// What is measured of one landscape; prints its memory and its triangles' errors.
fn measure(
    landscape: Landscape,
    view: View,
    backends: &[(&str, BackendChoice)],
) -> Result<Vec<VolumeRow>, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let Both { volumes, triangles, of_ground, memory } = both(landscape, view, folder.path())?;
    let size = view.size;
    let explicit = Explicit::new(&triangles, size, TRUTH, of_ground);
    let [(_, one), .., (many, less)] = explicit.curve() else { return Err("no errors of triangles".into()) };
    println!("{memory} {:.0} % | {one:.2}, {less:.2} with {many} |", 100.0 * explicit.coverage());
    let ray_s = backends.iter().map(|(_, backend)| frame_s(&triangles, size, TIMED_RAYS, *backend));
    let ray_s = ray_s.collect::<Result<Vec<f64>, _>>()?;
    let mut rows = Vec::new();
    for rays in VOLUME_RAYS {
        let picture = drawn(&volumes, size, 0..rays);
        let brightness = explicit.brightness(&picture);
        let errors = [explicit.error(&picture), explicit.error(&scaled(&picture, 1.0 / brightness))];
        let mut seconds = Vec::new();
        for ((_, backend), ray_s) in backends.iter().zip(&ray_s) {
            seconds.push([f64::from(rays) * frame_s(&volumes, size, rays, *backend)?, *ray_s]);
        }
        rows.push(VolumeRow {
            rays,
            brightness,
            errors,
            needed: errors.map(|error| explicit.rays_for(error)),
            seconds,
        });
    }
    Ok(rows)
}

/// Runs the study.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let number = |place: usize, usual: u32| arguments.get(place).map_or(Ok(usual), |argument| argument.parse());
    let (width, camera) = (number(0, 128)?, number(1, 1)? as usize);
    let parts = match arguments.get(2).map_or("both", String::as_str) {
        "both" => DaylightParts::Both,
        "sun" => DaylightParts::Sun,
        "sky" => DaylightParts::Sky,
        other => return Err(format!("the light is both, sun or sky, not {other}").into()),
    };
    let view = View { size: [width, width * 3 / 4], camera, parts };
    let asked = arguments.get(3..).unwrap_or_default();
    if let Some(unknown) = asked.iter().find(|own| BACKENDS.iter().all(|(name, _)| own != name)) {
        return Err(format!("BACKEND is cpu, bvh or ray-query, not {unknown}").into());
    }
    let backends: Vec<_> =
        BACKENDS.into_iter().filter(|(name, _)| asked.is_empty() || asked.iter().any(|own| own == name)).collect();
    println!(
        "| landscape | volumes, MB | skin, MB | triangles | MB | places, MB | one by one, MB | pixels with plants | triangles' error with one ray |"
    );
    println!("|{}", "---|".repeat(9));
    let mut all = Vec::new();
    for landscape in [Landscape::Lawn, Landscape::Grove, Landscape::Forest] {
        let rows = measure(landscape, view, &backends)?;
        all.extend(rows.into_iter().map(|row| (landscape.name(), row)));
    }
    println!(
        "\n| landscape | rays a pixel of volumes | brightness | relative error | as bright as the triangles | rays a pixel of triangles for that |"
    );
    println!("|{}", "---|".repeat(6));
    for (name, VolumeRow { rays, brightness, errors, needed, .. }) in &all {
        let [error, as_bright] = errors;
        println!(
            "| {name} | {rays} | {brightness:.3} | {error:.3} | {as_bright:.3} | {:.0} ({:.0}) |",
            needed[0], needed[1]
        );
    }
    print!("\n| landscape | rays a pixel of volumes |");
    backends.iter().for_each(|(name, _)| print!(" {name}: s of volumes | s of triangles | these take |"));
    println!("\n|{}", "---|".repeat(2 + 3 * backends.len()));
    for (name, VolumeRow { rays, needed, seconds, .. }) in &all {
        print!("| {name} | {rays} |");
        for [volume_s, ray_s] in seconds {
            let [triangles_s, as_bright_s] = needed.map(|rays| rays * ray_s);
            print!(
                " {volume_s:.2} | {triangles_s:.2} | {:.2} x ({:.2}) |",
                triangles_s / volume_s,
                as_bright_s / volume_s
            );
        }
        println!();
    }
    Ok(())
}
