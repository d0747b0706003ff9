//! How well and how quickly contents of leaves are found from spectra: rows of docs/results/leaf-optics.md as Markdown.
//! `cargo run --release -p btf-tests -- leaf_inversion [FOLDER...]`
//!
//! A folder is a set of measured leaves, as `spectra_db` reads them.

use std::collections::BTreeMap;
use std::error::Error;
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use crate::leaf::spectra_db::{chemistry, leaves_of};
use btf_capture::{Capture, DirectionSet, ImageFormat};
use btf_models::{LEAF_QUANTITIES, LeafDescription, TextureKind};
use btf_synth::{
    AppearanceTextures, CaptureParams, Chlorosis, Deficiency, Inversion, InversionParams, Inverter, LeafContents,
    LeafParams, LeafSpectra, MAX_UNKNOWNS, Passage, Species, State, TextureImages, any_contents, invert_captures,
    simulated_spectra, write_leaf_capture,
};
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;

/// Leaves of each row about noise.
const LEAVES: usize = 2000;

/// One thread: speeds are per core.
pub fn run(folders: &[String]) -> Result<(), Box<dyn Error>> {
    noise()?;
    maps()?;
    for folder in folders {
        measured(Path::new(folder))?;
    }
    Ok(())
}

fn evenly(first: f64, last: f64, step: f64) -> Vec<f64> {
    (0..=((last - first) / step).round() as usize).map(|i| first + step * i as f64).collect()
}

fn values_of(leaf: &LeafContents) -> [f64; MAX_UNKNOWNS] {
    let leaf = LeafDescription { contents: *leaf, ..LeafDescription::default() };
    std::array::from_fn(|i| LEAF_QUANTITIES[i].of(&leaf))
}

fn noise() -> Result<(), Box<dyn Error>> {
    println!("## Spectra of plate-n with normal noise of 0.01, {LEAVES} leaves, one core\n");
    println!(
        "| wavelengths, nm | shares | chlorophyll | carotenoids | anthocyanins | water, um | dry matter, mg/cm2 | N | \
         within two standard errors | leaves/s |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for (first, last, step) in [(400.0, 700.0, 10.0), (400.0, 800.0, 5.0), (400.0, 2500.0, 10.0), (400.0, 2500.0, 1.0)]
    {
        let nm = evenly(first, last, step);
        for both in [true, false] {
            let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
            let leaves: Vec<LeafContents> = (0..LEAVES).map(|_| any_contents(&mut random)).collect();
            let spectra = leaves.iter().map(|leaf| simulated_spectra(leaf, &nm, 0.01, &mut random));
            let mut spectra = spectra.collect::<Result<Vec<LeafSpectra>, _>>()?;
            if !both {
                spectra.iter_mut().for_each(|leaf| leaf.shares[1].fill(f64::NAN));
            }
            let inverter = Inverter::new(&InversionParams::default(), &nm)?;
            let started = Instant::now();
            let found: Vec<Inversion> = spectra.iter().map(|spectra| inverter.invert(spectra)).collect();
            let speed = LEAVES as f64 / started.elapsed().as_secs_f64();
            let rms = |i: usize| {
                let squares =
                    found.iter().zip(&leaves).map(|(found, leaf)| (found.values[i] - values_of(leaf)[i]).powi(2));
                (squares.sum::<f64>() / LEAVES as f64).sqrt()
            };
            let (mut within, mut told) = (0.0, 0.0);
            for (found, leaf) in found.iter().zip(&leaves) {
                for i in (0..MAX_UNKNOWNS).filter(|i| found.states[*i] == State::Found) {
                    told += 1.0;
                    let apart = (found.values[i] - values_of(leaf)[i]).abs();
                    within += f64::from(u8::from(apart < 2.0 * found.standard_errors[i]));
                }
            }
            let is_told = |i: usize| found.iter().all(|found| found.states[i] != State::Untold);
            println!(
                "| {first} to {last} by {step} | {} | {:.2} | {:.2} | {:.2} | {} | {:.2} | {:.3} | {:.0} % | {speed:.0} |",
                if both { "R, T" } else { "R" },
                rms(0),
                rms(1),
                rms(2),
                if is_told(4) { format!("{:.0}", 1e4 * rms(4)) } else { "untold".to_owned() },
                1e3 * rms(5),
                rms(6),
                100.0 * within / told,
            );
        }
    }
    Ok(())
}

/// Texels of a row of the photographed leaf.
const SIZE: usize = 128;

/// Photographs a maize leaf that lacks nitrogen, in colours and in bands, and compares its maps with the textures that it was
/// made of.
fn maps() -> Result<(), Box<dyn Error>> {
    let go_on = |_: usize, _: usize| ControlFlow::Continue(());
    let parent = tempfile::tempdir()?;
    let mut params = LeafParams::of(Species::Maize);
    params.contents.chlorophyll_ug_per_cm2 = 33.0;
    // Other values than those that bands are searched about.
    (params.contents.water_cm, params.contents.dry_matter_g_per_cm2, params.contents.structure) = (0.014, 0.007, 1.7);
    params.look.chlorosis = Some(Chlorosis { deficiency: Deficiency::Nitrogen, severity: Deficiency::SEVERITY });
    let set = DirectionSet::random(12, 1)?;
    params.capture = CaptureParams { size: SIZE, views: set.clone(), lights: set, ..params.capture };
    let bands_to = |most: u32| (0..31).map(|i| 400.0 + f64::from(i * (most - 400)) / 30.0).collect::<Vec<f64>>();
    let seen =
        [("colours", Vec::new()), ("31 bands to 700 nm", bands_to(700)), ("31 bands to 2400 nm", bands_to(2400))];
    let mut captures = Vec::new();
    for (name, wavelengths_nm) in seen {
        let format = if wavelengths_nm.is_empty() { params.capture.format } else { ImageFormat::Exr };
        let capture = CaptureParams { format, ..params.capture.clone() };
        let of_name = LeafParams { wavelengths_nm, capture, ..params.clone() };
        let mut both = Vec::new();
        for passage in [Passage::Reflection, Passage::Transmission] {
            let folder = parent.path().join(format!("{name} {passage:?}"));
            write_leaf_capture(&folder, &LeafParams { passage, ..of_name.clone() }, &go_on)?;
            both.push(Capture::open(&folder)?);
        }
        captures.push((name, both));
    }
    let folder = parent.path().join("textures");
    AppearanceTextures::new(&params)?.export(&folder)?;
    let textures = TextureImages::read(&folder)?;
    let size_mm = params.capture.size_mm;
    let truth = |texel: usize| {
        let place = |i: usize| (i as f32 + 0.5) / SIZE as f32 * size_mm;
        let at = [place(texel % SIZE), size_mm - place(texel / SIZE)];
        let sample = |kind: TextureKind| textures.sample(kind, at, size_mm).map_or(1.0, |value| f64::from(value[0]));
        params.contents.chlorophyll_ug_per_cm2 * sample(TextureKind::Pigment) * sample(TextureKind::Thickness)
    };
    println!("\n## Chlorophyll of a photographed leaf, ug/cm2, {SIZE} x {SIZE} texels\n");
    println!(
        "| seen | captures | RMSE | bias | correlation | standard error, median | missed by | beside chlorophyll |\n|---|---|---|---|---|---|---|---|"
    );
    for (name, captures) in captures.iter().flat_map(|(name, both)| [(name, &both[..]), (name, &both[..1])]) {
        let is_known = captures[0].info().wavelengths_nm.is_empty();
        let known = if is_known { params.contents } else { LeafContents::default() };
        let maps = invert_captures(captures, &known, &[], &go_on)?;
        let of = |texel: usize| f64::from(maps.pigment.values[3 * texel]) * maps.contents.chlorophyll_ug_per_cm2;
        let pairs: Vec<[f64; 2]> = (0..SIZE * SIZE).map(|texel| [truth(texel), of(texel)]).collect();
        let mean = |of: &dyn Fn(&[f64; 2]) -> f64| pairs.iter().map(of).sum::<f64>() / pairs.len() as f64;
        let (x, y) = (mean(&|pair| pair[0]), mean(&|pair| pair[1]));
        let spread = |i: usize, middle: f64| mean(&|pair| (pair[i] - middle).powi(2)).sqrt();
        let leaf = LeafDescription { contents: maps.contents, ..LeafDescription::default() };
        let told = |(i, error): &(usize, f64)| {
            let quantity = &LEAF_QUANTITIES[*i];
            format!("{} {:.4} +- {error:.4}", quantity.name, quantity.of(&leaf))
        };
        println!(
            "| {name} | {} | {:.2} | {:+.2} | {:.3} | {:.2} | {:.4} | {} |",
            captures.len(),
            mean(&|pair| (pair[1] - pair[0]).powi(2)).sqrt(),
            y - x,
            mean(&|pair| (pair[0] - x) * (pair[1] - y)) / (spread(0, x) * spread(1, y)),
            maps.standard_errors[0],
            maps.rmse,
            maps.beside.iter().map(told).collect::<Vec<_>>().join(", ")
        );
    }
    Ok(())
}

/// Contents with a measured counterpart: index, name with the unit, column of the metadata, factor to the unit.
const CHEMISTRY: [(usize, &str, &str, f64); 4] = [
    (0, "chlorophyll, ug/cm2", "leaf_chltot_per_area", 1.0),
    (1, "carotenoids, ug/cm2", "leaf_cartot_per_area", 1.0),
    (4, "water, mg/cm2", "leaf_water_thickness", 1e3),
    (5, "dry matter, mg/cm2", "leaf_mass_per_area", 1e3),
];

fn measured(folder: &Path) -> Result<(), Box<dyn Error>> {
    let chemistry = chemistry(&folder.join("metadata.csvy"))?;
    let mut paths: Vec<_> =
        fs::read_dir(folder.join("spectra"))?.map(|entry| Ok(entry?.path())).collect::<std::io::Result<_>>()?;
    paths.sort();
    println!("\n## Measured leaves of {}\n", folder.file_name().unwrap_or_default().to_string_lossy());
    println!(
        "| errors of the model | content | leaves | RMSE | bias | R2 | standard error, median | within two of them |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for correlated in [true, false] {
        let params = InversionParams { correlated, ..InversionParams::default() };
        let mut inverter: Option<(Vec<f64>, Inverter)> = None;
        let mut found = Vec::new();
        for path in &paths {
            let id = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let Some(truth) = chemistry.get(&id) else { continue };
            for leaf in leaves_of(path)? {
                if inverter.as_ref().is_none_or(|(nm, _)| *nm != leaf.wavelengths_nm) {
                    inverter = Some((leaf.wavelengths_nm.clone(), Inverter::new(&params, &leaf.wavelengths_nm)?));
                }
                if let Some((_, inverter)) = &inverter {
                    found.push((truth, inverter.invert(&leaf)));
                }
            }
        }
        for (index, name, column, factor) in CHEMISTRY {
            row(if correlated { "hang together" } else { "independent" }, (index, name, column, factor), &found);
        }
    }
    Ok(())
}

fn row(
    errors: &str,
    (index, name, column, factor): (usize, &str, &str, f64),
    found: &[(&BTreeMap<String, f64>, Inversion)],
) {
    let pairs: Vec<[f64; 3]> = found
        .iter()
        .filter_map(|(truth, found)| {
            let truth = truth.get(column).filter(|truth| **truth > -900.0)?;
            Some([*truth, found.values[index], found.standard_errors[index]].map(|x| factor * x))
        })
        .collect();
    let count = pairs.len() as f64;
    let mean = |of: &dyn Fn(&[f64; 3]) -> f64| pairs.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(&|pair| pair[0]), mean(&|pair| pair[1]));
    let rmse = mean(&|pair| (pair[1] - pair[0]).powi(2)).sqrt();
    let shared = mean(&|pair| (pair[0] - x) * (pair[1] - y));
    let r2 = shared * shared / (mean(&|pair| (pair[0] - x).powi(2)) * mean(&|pair| (pair[1] - y).powi(2)));
    let within = mean(&|pair| f64::from(u8::from((pair[1] - pair[0]).abs() < 2.0 * pair[2])));
    let mut worth: Vec<f64> = pairs.iter().map(|pair| pair[2]).collect();
    worth.sort_by(f64::total_cmp);
    println!(
        "| {errors} | {name} | {count} | {rmse:.2} | {:+.2} | {r2:.2} | {:.2} | {:.0} % |",
        y - x,
        worth[worth.len() / 2],
        100.0 * within
    );
}
