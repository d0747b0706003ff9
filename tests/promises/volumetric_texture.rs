//! A volume stands for the plant that it was built of: measured where it was not fitted, against explicit triangles,
//! against the rule of 1996 and against fewer triangles; and the triangles' own pictures are what Mitsuba's rays see.

use crate::mitsuba_peers::ask_script;
use btf_models::{LeafDescription, Species, TextureImages};
use btf_runtime::voltex::{Voltex, Volume};
use btf_synth::{Existing, PlantsParams, write_plants};
use btf_voxelize::Ablation;
use btf_voxelize::MarchParams;
use btf_voxelize::Occluder;
use btf_voxelize::TriangleModel;
use btf_voxelize::{Frame, VoltexParams, build_voltex};
use btf_voxelize::{HALF_SIDE, Projection, spread_directions};
use btf_voxelize::{Lit, model_light};
use btf_voxelize::{PixelFigures, VoltexRow, VoltexTruth};
use glam::Vec3;
use serde_json::{Value, json};
use std::ops::ControlFlow;

/// Refractive index of leaves that have next to no specular lobe.
const DULL_INDEX: f64 = 1.01;

/// A small tree, whose leaves have this refractive index, or that of the species.
fn tree(index: Option<f64>) -> TriangleModel {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tree.glb");
    let mut leaf = LeafDescription::of(Some(Species::Tree), None);
    leaf.gloss.index = index.unwrap_or(leaf.gloss.index);
    let params = PlantsParams { branches: 60, leaves: 400, ..PlantsParams::of(Species::Tree) };
    let images = TextureImages::default();
    write_plants(&path, &params, &leaf, images, Existing::Refuse, &|_, _| ControlFlow::Continue(())).unwrap();
    TriangleModel::read(&path).unwrap()
}

/// The bars of pixels of one size.
struct Bars {
    pixels: u32,
    opacity: [f64; 2],
    transmittance_rmse: f64,
    rel_rmse: f64,
    energy: [f64; 2],
}

/// What holds of this tree; docs/results/voltex.md tells of larger plants, and which bars they miss.
const BARS: [Bars; 2] = [
    Bars { pixels: 16, opacity: [0.97, 1.03], transmittance_rmse: 0.05, rel_rmse: 0.22, energy: [0.9, 1.1] },
    Bars { pixels: 8, opacity: [0.97, 1.03], transmittance_rmse: 0.04, rel_rmse: 0.20, energy: [0.9, 1.1] },
];

/// What holds of the tree with gloss, whose leaves glint one by one.
const GLOSSY_BARS: [Bars; 2] = [
    Bars { pixels: 16, opacity: [0.97, 1.03], transmittance_rmse: 0.05, rel_rmse: 0.34, energy: [0.9, 1.1] },
    Bars { pixels: 8, opacity: [0.97, 1.03], transmittance_rmse: 0.04, rel_rmse: 0.27, energy: [0.9, 1.1] },
];

impl Bars {
    /// The bars that figures miss.
    fn missed(&self, found: &PixelFigures) -> Vec<&'static str> {
        assert_eq!(found.pixels, self.pixels);
        let within = |x: f64, [least, most]: [f64; 2]| (least..=most).contains(&x);
        let energy = found.energy();
        [
            ("opacity", within(found.opacity_ratio, self.opacity)),
            ("transmittance", found.transmittance_rmse <= self.transmittance_rmse),
            ("image", found.rel_rmse <= self.rel_rmse),
            ("energy", energy.iter().all(|energy| within(*energy, self.energy))),
        ]
        .into_iter()
        .filter_map(|(name, holds)| (!holds).then_some(name))
        .collect()
    }
}

/// The figures of the pixels that have bars, the largest.
fn coarse(row: &VoltexRow) -> &[PixelFigures] {
    &row.pixels[row.pixels.len() - BARS.len()..]
}

fn missed(row: &VoltexRow, bars: &[Bars; 2]) -> Vec<Vec<&'static str>> {
    bars.iter().zip(coarse(row)).map(|(bars, found)| bars.missed(found)).collect()
}

/// With all its microflakes `factor` times.
fn times(volume: &Volume, factor: f32) -> Voltex {
    let mut volume = volume.clone();
    let voxels = volume.levels.iter_mut().flat_map(|level| &mut level.voxels);
    voxels.for_each(|(_, voxel)| *voxel = voxel.scaled(factor));
    Voltex::new(&volume)
}

#[test]
fn a_volume_looks_like_its_plant_from_where_it_was_not_fitted() {
    let model = tree(Some(DULL_INDEX));
    let params = VoltexParams { resolution: 32, ..VoltexParams::default() };
    let bytes = build_voltex(&model, &params).unwrap().pack().unwrap();
    let mesh_bytes = 36 * model.triangles.len();
    assert!(8 * bytes.len() <= mesh_bytes, "{} bytes, the mesh {mesh_bytes}", bytes.len());
    // As it is read back.
    let volume = Volume::parse(&bytes).unwrap();
    let truth = VoltexTruth::new(&model).unwrap();
    // So many rays that the volume itself is measured.
    let march = MarchParams { rays: 4, finer: 2, ..MarchParams::default() };
    let own = truth.measure("volume", &Voltex::new(&volume), &march);
    println!("{} triangles, {} bytes: {own:#?}", model.triangles.len(), bytes.len());
    assert!(missed(&own, &BARS).iter().all(Vec::is_empty), "{:?}", missed(&own, &BARS));

    // Planted differences: a fifth more microflakes; and shadows as if eye and light were independent.
    for list in missed(&truth.measure("more", &times(&volume, 1.2), &march), &BARS) {
        assert!(list.contains(&"opacity"), "{list:?}");
    }
    let (unfitted, params) = Ablation::NoShadowFit.apply(&model, &volume).unwrap();
    let unfitted = truth.measure("unfitted", &Voltex::new(&unfitted), &params);
    assert!(missed(&unfitted, &BARS).iter().all(|list| list.contains(&"energy")), "{unfitted:?}");

    // What it replaces and what is as small are further off.
    let (old, params) = Ablation::Rule1996.apply(&model, &volume).unwrap();
    let old = truth.measure("1996", &Voltex::new(&old), &params);
    let fewer = truth.measure_simplified("fewer triangles", bytes.len());
    for rival in [&old, &fewer] {
        for (own, rival) in coarse(&own).iter().zip(coarse(rival)) {
            assert_eq!(own.pixels, rival.pixels);
            assert!(own.rel_rmse < rival.rel_rmse, "{own:?} {rival:?}");
            assert!(own.transmittance_rmse < rival.transmittance_rmse, "{own:?} {rival:?}");
        }
    }
}

#[test]
fn a_glossy_volume_looks_like_its_plant_too() {
    let model = tree(None);
    let params = VoltexParams { resolution: 32, ..VoltexParams::default() };
    let volume = build_voltex(&model, &params).unwrap();
    let truth = VoltexTruth::new(&model).unwrap();
    let march = MarchParams { rays: 4, finer: 2, ..MarchParams::default() };
    let own = truth.measure("volume", &Voltex::new(&volume), &march);
    println!("{own:#?}");
    assert!(missed(&own, &GLOSSY_BARS).iter().all(Vec::is_empty), "{:?}", missed(&own, &GLOSSY_BARS));
    // Planted: without gloss.
    let mut dull = volume.clone();
    dull.materials.iter_mut().for_each(|material| material.specular = 0.0);
    for list in missed(&truth.measure("dull", &Voltex::new(&dull), &march), &GLOSSY_BARS) {
        assert!(list.contains(&"energy") && list.contains(&"image"), "{list:?}");
    }
}

/// Share of rays that pass in one and not in the other, and relative difference of the light.
fn apart(ours: &[(f64, Vec<f64>)], theirs: &Value) -> [f64; 2] {
    let number = |value: &Value| value.as_f64().unwrap();
    let (mut unlike, mut squares, mut all) = (0.0, 0.0, 0.0);
    assert_eq!(theirs["free"].as_array().unwrap().len(), ours.len());
    for (i, (free, light)) in ours.iter().enumerate() {
        unlike += (free - number(&theirs["free"][i])).abs();
        for (k, light) in light.iter().enumerate() {
            let their = number(&theirs["light"][i][k]);
            squares += (light - their).powi(2);
            all += their * their;
        }
    }
    [unlike / ours.len() as f64, (squares / all).sqrt()]
}

#[test]
fn triangles_hide_and_show_what_mitsuba_s_rays_see() {
    let model = tree(Some(DULL_INDEX));
    let mut cube = model.in_cube(&Frame::around(model.bounds()).unwrap());
    // As its colours say, without what a leaf's light by its directions adds to that.
    cube.tables.clear();
    cube.colours.iter_mut().for_each(|colour| colour.specular = 0.0);
    let occluder = Occluder::new(&cube.triangles);
    let lights = spread_directions(3, 0.7);
    const SIDE: usize = 40;
    let rays: Vec<(Vec3, Vec3)> = spread_directions(5, 2.0)
        .into_iter()
        .flat_map(|direction| {
            let view = Projection::new(direction);
            let at = |i: usize| ((i as f32 + 0.5) / SIDE as f32 * 2.0 - 1.0) * HALF_SIDE;
            (0..SIDE * SIDE).map(move |i| (view.origin(at(i % SIDE), at(i / SIDE)), direction))
        })
        .collect();
    let look = |occluder: &Occluder, lights: &[Vec3]| -> Vec<(f64, Vec<f64>)> {
        rays.iter()
            .map(|(origin, direction)| {
                let light = |light: &Vec3| f64::from(model_light(occluder, &cube, *origin, *direction, *light));
                let free = !occluder.occluded(*origin, *direction, 4.0);
                (f64::from(u8::from(free)), lights.iter().map(light).collect())
            })
            .collect()
    };
    let shares = |i: usize| -> Vec<f32> { (0..cube.triangles.len()).map(|t| cube.surface(t).0[i]).collect() };
    let triples = |all: &[Vec3]| -> Vec<[f32; 3]> { all.iter().map(Vec3::to_array).collect() };
    let query = json!({
        "positions": cube.triangles.iter().map(|t| triples(t)).collect::<Vec<_>>(),
        "reflectance": shares(0),
        "transmittance": shares(1),
        "lights": triples(&lights),
        "rays": rays.iter().map(|(origin, direction)| triples(&[*origin, *direction])).collect::<Vec<_>>(),
    });
    let Some(theirs) = ask_script("voltex_mitsuba.py", &query) else { return };
    let ours = look(&occluder, &lights);
    let met = ours.iter().filter(|(free, _)| *free == 0.0).count();
    let found = apart(&ours, &theirs);
    println!("{met} of {} rays meet something; apart {:.5}, light {:.5}", ours.len(), found[0], found[1]);
    // Rays past an edge fall to either side.
    assert!(met > 200 && found[0] <= 0.0005 && found[1] <= 0.01, "{found:?}");
    // Planted differences: every other triangle missing, and lights a degree off.
    let fewer: Vec<_> = cube.triangles.iter().enumerate().filter(|(t, _)| t % 2 > 0).map(|(_, t)| *t).collect();
    assert!(apart(&look(&Occluder::new(&fewer), &[Vec3::Z; 3]), &theirs)[0] > 0.005);
    let turned: Vec<Vec3> = lights.iter().map(|l| (*l + Vec3::new(0.017, 0.0, 0.0)).normalize()).collect();
    assert!(apart(&look(&occluder, &turned), &theirs)[1] > 0.02);
}
