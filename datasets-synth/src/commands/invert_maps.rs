//! `btf-synth invert --capture`: maps of a leaf's contents from its captures.

use std::path::{Path, PathBuf};

use btf_capture::Capture;
use btf_capture::atomic::StagedFolder;
use btf_models::{LEAF_QUANTITIES, LeafDescription, TextureGrid, TextureKind, write_textures};
use btf_synth::{COLOURS_TELL, LeafContents, LeafMaps, MAX_UNKNOWNS, Unknown, invert_captures};
use serde_json::json;

use super::failure::Failure;
use super::leaf_file;
use super::run_args::RunArgs;

/// Width of a patch in millimetres where no capture says it, that of a plain leaf.
const USUAL_MM: f32 = 20.0;
/// Widest patch that a leaf file takes, in millimetres.
const MAX_MM: f32 = 200.0;

/// Finds the maps and writes them into the new folder `out`: `leaf.toml`, `textures` and `standard-errors`.
pub(super) fn run(
    captures: &[PathBuf],
    out: &Path,
    unknowns: &[Unknown],
    held: &[Option<f64>; MAX_UNKNOWNS],
    run: &RunArgs,
) -> Result<(), Failure> {
    let mut known = LeafDescription::default();
    let mut stays = Vec::new();
    for (i, (unknown, held)) in unknowns.iter().zip(held).enumerate() {
        let Some(value) = held else { continue };
        let option = unknown.option;
        if COLOURS_TELL.contains(&i) {
            let sentence = format!("--hold {option}: captures hold cant, cw, cm and n; the rest is what colours tell");
            return Err(Failure::Usage(sentence));
        }
        let quantity = &LEAF_QUANTITIES[i];
        if quantity.fault(*value).is_some() {
            let [least, most] = quantity.range;
            let range = format!("give {least} to {most} {}", quantity.unit);
            return Err(Failure::Usage(format!(
                "--hold {option}={value} is no leaf's {}; {}",
                quantity.name,
                range.trim_end()
            )));
        }
        quantity.set(&mut known, *value);
        stays.push(i);
    }
    let opened: Vec<Capture> =
        captures.iter().map(|path| Capture::open(path).map_err(|error| failed(&error))).collect::<Result<_, _>>()?;
    // It refuses a folder that is not empty, before any work.
    let staging = StagedFolder::create(out).map_err(|error| failed(&error))?;
    let maps =
        run.work("invert", "parts", 1, |progress| invert_captures(&opened, &known.contents, &stays, progress))?;
    write(staging, &maps)?;
    let LeafContents { chlorophyll_ug_per_cm2: cab, carotenoid_ug_per_cm2: car, brown, .. } = maps.contents;
    let [cab_error, car_error, brown_error] = maps.standard_errors;
    let file = out.join("leaf.toml");
    let leaf = LeafDescription { contents: maps.contents, ..LeafDescription::default() };
    let beside: serde_json::Map<String, serde_json::Value> = maps
        .beside
        .iter()
        .map(|(i, error)| {
            let quantity = &LEAF_QUANTITIES[*i];
            (quantity.key.to_owned(), json!({ "value": quantity.of(&leaf), "standard_error": error }))
        })
        .collect();
    let of_leaf: String = maps
        .beside
        .iter()
        .map(|(i, error)| {
            let quantity = &LEAF_QUANTITIES[*i];
            let unit = if quantity.unit.is_empty() { String::new() } else { format!(" {}", quantity.unit) };
            format!("\n  {} {:.4} +- {error:.4}{unit}", quantity.name, quantity.of(&leaf))
        })
        .collect();
    let (seen, rmse_key) = match maps.bands {
        0 => ("colours".to_owned(), "rmse_linear_rgb"),
        bands => (format!("{bands} bands"), "rmse_bands"),
    };
    let result = json!({
        "chlorophyll_ug_per_cm2": cab,
        "carotenoid_ug_per_cm2": car,
        "brown": brown,
        "standard_errors_of_a_texel": maps.standard_errors,
        "of_the_whole_leaf": beside,
        "bands": maps.bands,
        rmse_key: maps.rmse,
        "leaf": file,
    });
    let line = format!(
        "{}: chlorophyll {cab:.1} ug/cm2 (a texel +- {cab_error:.1}), carotenoids {car:.1} ug/cm2 (+- {car_error:.1}), brown \
         pigment {brown:.3} (+- {brown_error:.3}); {seen} are missed by {:.4}{of_leaf}",
        file.display(),
        maps.rmse
    );
    run.report(&result, &line)
}

fn failed(error: &dyn std::fmt::Display) -> Failure {
    Failure::Failed(error.to_string())
}

/// Writes the folder whole or not at all.
fn write(staging: StagedFolder, maps: &LeafMaps) -> Result<(), Failure> {
    let width = maps.size_mm.map_or(USUAL_MM, |[width, _]| width).min(MAX_MM);
    let rows = maps.pigment.values.len() / 3 / maps.pigment.width;
    let area = [0.0, 0.0, f64::from(width), f64::from(width) * rows as f64 / maps.pigment.width as f64];
    let textures = staging.path().join("textures");
    // What a colour holds, thickness and veins among it, is in the pigments; nothing is grown on top.
    let even = |kind: TextureKind, value: f32| {
        let [width, rows] = [maps.pigment.width, rows];
        TextureGrid { kind, width, range: kind.default_range(), values: vec![value; width * rows * kind.channels()] }
    };
    let grids = [
        maps.pigment.clone(),
        even(TextureKind::Gloss, 1.0),
        even(TextureKind::GlossAbaxial, 1.0),
        even(TextureKind::Thickness, 1.0),
        even(TextureKind::Height, 0.0),
        even(TextureKind::HeightAbaxial, 0.0),
    ];
    let about = "Found by btf-synth invert --capture.";
    write_textures(&textures, area, width, about, &grids).map_err(|error| failed(&error))?;
    let about = "Standard errors of the factors in ../textures, found by btf-synth invert --capture.";
    let errors = std::slice::from_ref(&maps.pigment_errors);
    write_textures(staging.path().join("standard-errors"), area, width, about, errors)
        .map_err(|error| failed(&error))?;
    let leaf = LeafDescription { contents: maps.contents, size_mm: f64::from(width), ..LeafDescription::default() };
    leaf_file::write(&leaf, Some(&textures), &staging.path().join("leaf.toml"))?;
    staging.commit().map_err(|error| failed(&error))
}
