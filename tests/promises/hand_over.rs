//! A plant is handed over from its mesh to its volume without a step, in a dolly over 64 times the distance.

use btf_capture::{LeafDescription, Species, TextureImages};
use btf_fit::voltex::build::{VoltexParams, build_voltex};
use btf_fit::voltex::model::TriangleModel;
use btf_runtime::voltex::Volume;
use btf_synth::{Existing, PlantsParams, write_plants};
use btf_tests::dolly::{MOST_LEAF_PIXELS, STEPS, dolly, largest_step, luminance, row};
use btf_viewer::{Scene, load_scene};
use glam::Vec3;
use std::ops::ControlFlow;
use std::path::Path;

/// Largest step of luminance where the distance grows by the fourth root of two, up to where leaves are [`FAR_PIXELS`] wide.
const BAR: f64 = 0.02;
/// The volume is alone there, and as fine as it is.
const FAR_PIXELS: f32 = 0.5;
/// Largest step beyond, from one of the volume's levels to the next: these are not as bright as each other, see
/// docs/VOLTEX_FIGURES.md, "Hand-over".
const LEVELS_BAR: f64 = 0.06;
/// Paths of one distance.
const PATHS: usize = 1 << 16;
/// From the plant to the eye; the sun is behind the eye.
const TOWARDS: Vec3 = Vec3::new(-0.5, 0.3, 1.0);

/// Writes a bush whose leaves have next to no gloss, which volumes have none of.
fn write_model(folder: &Path) -> Volume {
    let path = folder.join("bush.glb");
    let mut leaf = LeafDescription::of(Some(Species::Tree), None);
    leaf.gloss.index = 1.01;
    let params = PlantsParams { branches: 60, leaves: 400, ..PlantsParams::of(Species::Tree) };
    let images = TextureImages::default();
    write_plants(&path, &params, &leaf, images, Existing::Refuse, &|_, _| ControlFlow::Continue(())).unwrap();
    let params = VoltexParams { resolution: 64, ..VoltexParams::default() };
    build_voltex(&TriangleModel::read(&path).unwrap(), &params).unwrap()
}

fn scene(folder: &Path, volume: &Volume) -> (Scene, f32) {
    std::fs::write(folder.join("bush.voltex"), volume.pack().unwrap()).unwrap();
    let path = folder.join("scene.toml");
    let text = "background = [0, 0, 0]\n[[volume]]\nfile = \"bush.voltex\"\nmesh = \"bush.glb\"\n\
                [daylight]\ndate_time = \"2026-06-21T15:00+02:00\"\nplace = \"52.5,13.4\"\nparts = \"sun\"\n";
    std::fs::write(&path, text).unwrap();
    let scene = load_scene(&path, Vec::new()).unwrap();
    let leaf_width = scene.geometry.instances()[0].leaf_width;
    (scene, leaf_width)
}

#[test]
fn a_dolly_from_a_mesh_to_its_volume_has_no_step() {
    let folder = tempfile::tempdir().unwrap();
    let volume = write_model(folder.path());
    let (own, leaf_width) = scene(folder.path(), &volume);
    let rows = dolly(&own, TOWARDS, leaf_width, PATHS);
    rows.iter().for_each(|row| println!("{:.3} {} {:?}", row.leaf_pixels, row.pixels, row.radiance));
    let [first, last] = [&rows[0], &rows[rows.len() - 1]];
    assert!((last.leaf_pixels * 64.0 / first.leaf_pixels - 1.0).abs() < 1e-4);
    let near = rows.partition_point(|row| row.leaf_pixels >= 0.99 * FAR_PIXELS);
    let [near, far] = [&rows[..near], &rows[near - 1..]].map(largest_step);
    assert!(luminance(first) > 0.0 && near < BAR && far < LEVELS_BAR, "{near} {far}");
    // Planted: a volume that reflects a fifth more, and one of half the flakes; over the band they come in.
    let brighter = |volume: &mut Volume| {
        volume.materials.iter_mut().for_each(|material| material.reflectance = material.reflectance.map(|x| 1.2 * x));
    };
    let thinner = |volume: &mut Volume| {
        let voxels = volume.levels.iter_mut().flat_map(|level| &mut level.voxels);
        voxels.for_each(|(_, voxel)| *voxel = voxel.scaled(0.5));
    };
    for plant in [&brighter as &dyn Fn(&mut Volume), &thinner] {
        let mut wrong = volume.clone();
        plant(&mut wrong);
        let (wrong, leaf_width) = scene(folder.path(), &wrong);
        // From 2 pixels to 1.
        let band = (0..=STEPS).map(|i| MOST_LEAF_PIXELS * 0.25 * (-i as f32 / STEPS as f32).exp2());
        let rows: Vec<_> = band.map(|pixels| row(&wrong, TOWARDS, leaf_width, pixels, PATHS)).collect();
        assert!(largest_step(&rows) > BAR, "{}", largest_step(&rows));
    }
}
