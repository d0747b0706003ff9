//! A plant changes from its mesh to its volume without a step, in a dolly over 64 times the distance.

use btf_models::glb::glb_from;
use btf_models::{LeafDescription, Species, TextureImages};
use btf_runtime::voltex::Volume;
use btf_synth::{Existing, PlantsParams, write_plants};
use btf_tests::dolly::{MAX_LEAF_PIXELS, STEPS, dolly, largest_step, luminance, row};
use btf_viewer::{
    Body, Camera, CpuPicture, Instance, Landscape, LandscapeParams, Material, Scene, ShadeOptions, load_scene,
};
use btf_voxelize::{TriangleModel, VoltexParams, build_voltex};
use glam::{Vec3, Vec4};
use serde_json::{Value, json};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Largest step of luminance where the distance grows by the fourth root of two, up to where leaves are [`FAR_PIXELS`]
/// wide.
const BAR: f64 = 0.02;
/// The volume is alone there, and as fine as it is.
const FAR_PIXELS: f32 = 0.5;
/// Largest step beyond, from one of the volume's levels to the next. Each level is fitted on its own to rays through
/// the model, so neighbouring levels differ in brightness: by 2.6 % in this dolly, and the bar leaves room for another
/// seed of the plant. See docs/results/voltex.md, "Level-of-detail transition".
const LEVELS_BAR: f64 = 0.04;
/// Paths of one distance.
const PATHS: usize = 1 << 16;
/// From the plant to the eye; the sun is behind the eye.
const TOWARDS: Vec3 = Vec3::new(-0.5, 0.3, 1.0);

/// Refractive index of leaves that have next to no specular lobe.
const DULL_INDEX: f64 = 1.01;

/// Writes a bush, its leaves with the gloss of an index.
fn write_model(folder: &Path, index: f64) -> Volume {
    write_mesh(folder, index);
    volume_of_mesh(folder)
}

fn write_mesh(folder: &Path, index: f64) {
    let path = folder.join("bush.glb");
    let mut leaf = LeafDescription::of(Some(Species::Tree), None);
    leaf.gloss.index = index;
    let params = PlantsParams { branches: 60, leaves: 400, ..PlantsParams::of(Species::Tree) };
    let images = TextureImages::default();
    write_plants(&path, &params, &leaf, images, Existing::Refuse, &|_, _| ControlFlow::Continue(())).unwrap();
}

fn volume_of_mesh(folder: &Path) -> Volume {
    let params = VoltexParams { resolution: 64, ..VoltexParams::default() };
    build_voltex(&TriangleModel::read(&folder.join("bush.glb")).unwrap(), &params).unwrap()
}

/// Makes the bush's leaves plain: of each channel half is let through, in a colour of its own.
fn make_leaves_plain(folder: &Path) {
    let path = folder.join("bush.glb");
    let bytes = std::fs::read(&path).unwrap();
    // A header of three words, then two chunks, each behind its length and kind.
    let text = 20..20 + u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let mut document: Value = serde_json::from_slice(&bytes[text.clone()]).unwrap();
    let materials = document["materials"].as_array_mut().unwrap();
    let leaf = materials.iter_mut().find(|material| material["extensions"].is_object()).unwrap();
    leaf["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.1, 0.3, 0.2, 1.0]);
    let transmission = json!({ "diffuseTransmissionFactor": 0.5, "diffuseTransmissionColorFactor": [0.2, 0.8, 0.1] });
    leaf["extensions"] = json!({ "KHR_materials_diffuse_transmission": transmission });
    std::fs::write(&path, glb_from(&document, bytes[text.end + 8..].to_vec()).unwrap()).unwrap();
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
    let volume = write_model(folder.path(), LeafDescription::of(Some(Species::Tree), None).gloss.index);
    let (own, leaf_width) = scene(folder.path(), &volume);
    let rows = dolly(&own, TOWARDS, leaf_width, PATHS);
    rows.iter().for_each(|row| println!("{:.3} {} {:?}", row.leaf_pixels, row.pixels, row.radiance));
    let [first, last] = [&rows[0], &rows[rows.len() - 1]];
    assert!((last.leaf_pixels * 64.0 / first.leaf_pixels - 1.0).abs() < 1e-4);
    let near = rows.partition_point(|row| row.leaf_pixels >= 0.99 * FAR_PIXELS);
    let [near, far] = [&rows[..near], &rows[near - 1..]].map(largest_step);
    println!("largest steps {near:.4}, {far:.4}");
    assert!(luminance(first) > 0.0 && near < BAR && far < LEVELS_BAR, "{near} {far}");
    // Planted: a volume that reflects a half more, and one of half the microflakes; over the band they come in.
    let brighter = |volume: &mut Volume| {
        volume.materials.iter_mut().for_each(|material| material.reflectance = material.reflectance.map(|x| 1.5 * x));
    };
    let thinner = |volume: &mut Volume| {
        let voxels = volume.levels.iter_mut().flat_map(|level| &mut level.voxels);
        voxels.for_each(|(_, voxel)| *voxel = voxel.scaled(0.5));
    };
    for plant in [&brighter as &dyn Fn(&mut Volume), &thinner] {
        let mut wrong = volume.clone();
        plant(&mut wrong);
        let (wrong, leaf_width) = scene(folder.path(), &wrong);
        // From 2 pixels to half of one.
        let band = (0..=2 * STEPS).map(|i| MAX_LEAF_PIXELS * 0.25 * (-i as f32 / STEPS as f32).exp2());
        let rows: Vec<_> = band.map(|pixels| row(&wrong, TOWARDS, leaf_width, pixels, PATHS)).collect();
        assert!(largest_step(&rows) > BAR, "{}", largest_step(&rows));
    }
}

/// Largest relative difference of luminance of a plant as a mesh and as its volume, lit from behind or from in front.
/// It is 1.5 % with the sun behind the plant and 3.4 % with the sun behind the eye: what 26 numbers for all directions
/// leave of one.
const PLAIN_BAR: f64 = 0.06;

#[test]
fn leaves_that_a_gltf_file_makes_translucent_have_one_brightness_as_a_mesh_and_as_a_volume() {
    let folder = tempfile::tempdir().unwrap();
    write_mesh(folder.path(), DULL_INDEX);
    make_leaves_plain(folder.path());
    let (both, leaf_width) = scene(folder.path(), &volume_of_mesh(folder.path()));
    let mut opaque = both.clone();
    for material in &mut opaque.materials {
        if let Body::Plain(colour) = &mut material.body {
            colour.transmittance = [0.0; 3];
        }
    }
    // As small as a mesh can be that is alone, and a volume that is.
    let seen = |scene: &Scene, towards, pixels| row(scene, towards, leaf_width, pixels, PATHS);
    for towards in [-TOWARDS, TOWARDS] {
        let (mesh, volume) = (seen(&both, towards, 2.0), seen(&both, towards, 0.5));
        println!("towards {towards}: mesh {:?}, volume {:?}", mesh.radiance, volume.radiance);
        let apart = largest_step(&[mesh, volume]);
        println!("apart {apart:.4}");
        assert!(apart < PLAIN_BAR, "{apart}");
    }
    // Planted: a mesh that lets nothing through is dark before the sun.
    let apart = largest_step(&[seen(&opaque, -TOWARDS, 2.0), seen(&both, -TOWARDS, 0.5)]);
    assert!(apart > 5.0 * PLAIN_BAR, "{apart}");
}

/// Largest difference of the mean colours of a plant as a mesh and as its volume, as a share of the brighter channel,
/// in red and green. Light that passes a leaf is so green that its blue is below 0 in sRGB, which a volume cannot store.
/// The three plants differ by 2.1, 1.3 and 6.1 %, the darkest tint most.
const COLOUR_BAR: f32 = 0.1;

/// From a plant to the eye, m: mostly from above, where no other one is in the way.
const FROM_ABOVE_M: Vec3 = Vec3::new(-20.0, 55.0, 25.0);

/// Mean radiance of a plant whose middle is `middle_m` above its foot. `as_mesh`, or as its volume.
fn mean_radiance(scene: &Scene, plant: &Instance, middle_m: f32, as_mesh: bool) -> [f32; 3] {
    let target = Vec3::from(plant.world_from_object.map(|row| Vec4::from(row).dot(Vec4::new(0.0, middle_m, 0.0, 1.0))));
    // Its middle fills the picture.
    let fov_deg = 2.0 * (0.3 * middle_m / FROM_ABOVE_M.length()).atan().to_degrees();
    let camera = Camera { eye: target + FROM_ABOVE_M, target, up: Vec3::Y, fov_deg };
    let mut scene = Scene { camera, ..scene.clone() };
    // The ground's, so that the plants are all there is to see.
    scene.materials[0] = Material::plain([0.0; 3]);
    if as_mesh {
        scene.volumes = None;
        Arc::make_mut(&mut scene.geometry).set_leaf_widths(|_, _| 0.0);
    }
    let mut picture = CpuPicture::new([24, 24]);
    (0..32).for_each(|_| picture.add_sample(&scene, &ShadeOptions::default(), &|| true));
    let radiance = picture.radiance();
    [0, 1, 2].map(|channel| radiance.iter().map(|rgb| rgb[channel]).sum::<f32>() / radiance.len() as f32)
}

#[test]
fn a_tinted_plant_has_the_same_colour_as_a_mesh_and_as_its_volume() {
    let folder = tempfile::tempdir().unwrap();
    let volume = write_model(folder.path(), DULL_INDEX);
    let file = folder.path().join("bush.voltex");
    std::fs::write(&file, volume.pack().unwrap()).unwrap();
    let grove = |meshes: Vec<PathBuf>| {
        let volumes = vec![file.clone()];
        Landscape::Grove.scene(&LandscapeParams { times: 1, volumes, meshes, wind_m_per_s: None }).unwrap().0
    };
    let [as_volumes, as_meshes] = [grove(Vec::new()), grove(vec![folder.path().join("bush.glb")])];
    // One plant of each tint: those whose meshes begin with different triangles.
    let mut plants: Vec<&Instance> = Vec::new();
    for plant in as_meshes.geometry.instances().iter().filter(|instance| instance.handedness != 0.0) {
        if plants.iter().all(|known| known.first_triangle != plant.first_triangle) {
            plants.push(plant);
        }
    }
    let middle_m = 0.5 * volume.extent[2] * volume.side_m;
    let colours: Vec<[[f32; 3]; 2]> = plants
        .iter()
        .map(|plant| {
            [(&as_volumes, false), (&as_meshes, true)]
                .map(|(scene, as_mesh)| mean_radiance(scene, plant, middle_m, as_mesh))
        })
        .collect();
    println!("{colours:?}");
    assert_eq!(colours.len(), 3);
    let differ = |[a, b]: [[f32; 3]; 2]| {
        let apart = (0..2).map(|i| (a[i] - b[i]).abs()).fold(0f32, f32::max);
        apart / b.into_iter().fold(0f32, f32::max)
    };
    assert!(colours.iter().all(|both| differ(*both) < COLOUR_BAR), "{colours:?}");
    // Planted: all in the tint of one.
    let warm = as_meshes.materials.iter().map(|material| material.tint).find(|[red, ..]| *red > 1.0).unwrap();
    let mut alike = as_meshes.clone();
    alike.materials.iter_mut().for_each(|material| material.tint = warm);
    let alike = plants.iter().map(|plant| mean_radiance(&alike, plant, middle_m, true));
    let wrong: Vec<f32> = alike.zip(&colours).map(|(mesh, [volume, _])| differ([*volume, mesh])).collect();
    assert_eq!(wrong.iter().filter(|apart| **apart > COLOUR_BAR).count(), 2, "{wrong:?}");
}
