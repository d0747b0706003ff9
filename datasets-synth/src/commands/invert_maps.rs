//! `btf-synth invert --capture`: maps of a leaf's contents from its captures.

use std::path::{Path, PathBuf};

use btf_capture::Capture;
use btf_models::{LEAF_QUANTITIES, LeafDescription, write_textures};
use btf_synth::{LeafContents, LeafMaps, invert_captures};
use serde_json::json;

use super::failure::Failure;
use super::leaf_file;
use super::run_args::RunArgs;

/// Width of a patch in millimetres where no capture says it, that of a plain leaf.
const USUAL_MM: f32 = 20.0;
/// Images of a capture that are looked at, about, for the progress bar.
const IMAGES: usize = 48;

/// Finds the maps and writes them into the new folder `out`: `leaf.toml`, `textures` and `standard-errors`.
pub(super) fn run(
    captures: &[PathBuf],
    out: &Path,
    held: &[(&'static str, f64)],
    run: &RunArgs,
) -> Result<(), Failure> {
    let mut known = LeafDescription::default();
    for (option, value) in held {
        let at = ["cab", "car", "cant", "cbrown", "cw", "cm", "n"].iter().position(|known| known == option);
        let at = at.filter(|at| ![0, 1, 3].contains(at)).ok_or_else(|| {
            Failure::Usage(format!("--hold {option}: captures hold cant, cw, cm and n; the rest is what colours tell"))
        })?;
        LEAF_QUANTITIES[at].set(&mut known, *value);
    }
    btf_synth::check_contents(&known.contents)?;
    if out.read_dir().is_ok_and(|mut entries| entries.next().is_some()) {
        return Err(Failure::Failed(format!(
            "{} holds files already; give a folder that is new or empty",
            out.display()
        )));
    }
    let opened: Vec<Capture> = captures
        .iter()
        .map(|path| Capture::open(path).map_err(|error| Failure::Failed(error.to_string())))
        .collect::<Result<_, _>>()?;
    let total = IMAGES * opened.len();
    let maps = run.work("read", "images", total, |progress| invert_captures(&opened, &known.contents, progress))?;
    write(out, &maps)?;
    let LeafContents { chlorophyll_ug_per_cm2: cab, carotenoid_ug_per_cm2: car, brown, .. } = maps.contents;
    let [cab_error, car_error, brown_error] = maps.standard_errors;
    let result = json!({
        "chlorophyll_ug_per_cm2": cab,
        "carotenoid_ug_per_cm2": car,
        "brown": brown,
        "standard_errors_of_a_texel": maps.standard_errors,
        "rmse_linear_rgb": maps.rmse,
        "leaf": out.join("leaf.toml"),
    });
    let line = format!(
        "{}: chlorophyll {cab:.1} ug/cm2 (a texel +- {cab_error:.1}), carotenoids {car:.1} ug/cm2 (+- {car_error:.1}), brown \
         pigment {brown:.3} (+- {brown_error:.3}); colours are missed by {:.4}",
        out.join("leaf.toml").display(),
        maps.rmse
    );
    run.report(&result, &line)
}

fn write(out: &Path, maps: &LeafMaps) -> Result<(), Failure> {
    let failed = |error: &dyn std::fmt::Display| Failure::Failed(error.to_string());
    std::fs::create_dir_all(out)
        .map_err(|error| Failure::Failed(format!("{} cannot be made ({error})", out.display())))?;
    let [width, height] = maps.size_mm.unwrap_or([USUAL_MM; 2]);
    let area = [0.0, 0.0, f64::from(width), f64::from(height)];
    let textures = out.join("textures");
    let about = "Found by btf-synth invert --capture.";
    write_textures(&textures, area, width, about, std::slice::from_ref(&maps.pigment))
        .map_err(|error| failed(&error))?;
    let about = "Standard errors of the factors in ../textures, found by btf-synth invert --capture.";
    let errors = std::slice::from_ref(&maps.pigment_errors);
    write_textures(out.join("standard-errors"), area, width, about, errors).map_err(|error| failed(&error))?;
    let mut leaf = LeafDescription { contents: maps.contents, size_mm: f64::from(width), ..LeafDescription::default() };
    for quantity in LEAF_QUANTITIES {
        // Colours may ask for more than leaf files take.
        let [least, most] = quantity.range;
        let value = quantity.of(&leaf);
        quantity.set(&mut leaf, value.clamp(least, most));
    }
    leaf_file::write(&leaf, Some(&textures), &out.join("leaf.toml"))
}
