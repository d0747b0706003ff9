//! `cargo run --release -p btf-tests -- STUDY [ARGUMENTS]`: prints a study's tables as Markdown.

use btf_tests::{
    bands, bent_skins, canopies, denoise, dolly, fit_floor, flicker, irradiance, landscape_costs, leaf,
    light_directions, lobe_worth, many_captures, rays, volume_costs, voxel_bounds,
};
use std::error::Error;
use std::process::ExitCode;

type Study = fn(&[String]) -> Result<(), Box<dyn Error>>;

/// Name, arguments and entry of every study.
const STUDIES: [(&str, &str, Study); 23] = [
    ("abm_trade", "", leaf::abm_trade::run),
    ("bands", "CAPTURE ASSET.spmm...", bands::run),
    ("bent_skins", "[PIXELS]", bent_skins::run),
    ("canopies", "[PHOTONS]", canopies::run),
    ("denoise", "[WIDTH [CANOPY.glb]]", denoise::run),
    ("dolly", "MODEL FILE.voltex [PATHS]", dolly::run),
    ("fit_floor", "CAPTURE...", fit_floor::run),
    ("flicker", "[WIDTH [FRAMES [CAMERA [LANDSCAPE ...]]]]", flicker::run),
    ("irradiance", "[WIDTH [CANOPY.glb [SAMPLES]]]", irradiance::run),
    ("landscape_costs", "[WIDTH [CAMERA [both|sun|sky [BACKEND ...]]]]", landscape_costs::run),
    ("leaf_curves", "FOLDER OUT", leaf::curves::run),
    ("leaf_faces", "FOLDER", leaf::faces::run),
    ("leaf_fits", "", leaf::fits::run),
    ("leaf_inversion", "[FOLDER...]", leaf::inversion::run),
    ("leaf_live", "", leaf::live::run),
    ("leaf_table", "[RAYS]", leaf::table::run),
    ("leaf_trade", "", leaf::trade::run),
    ("light_directions", "MODEL FILE.voltex", light_directions::run),
    ("lobe_worth", "ASSET.spmm...", lobe_worth::run),
    ("many_captures", "BTF_FIT [COUNT [WORKERS [KILLS]]]", many_captures::run),
    ("rays", "CANOPY.glb [EMBREE.so]", rays::run),
    ("volume_costs", "[WIDTH]", volume_costs::run),
    ("voxel_bounds", "MODEL FILE.voltex...", voxel_bounds::run),
];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let asked = arguments.split_first().and_then(|(name, rest)| {
        let (_, _, run) = STUDIES.iter().find(|(known, ..)| known == name)?;
        Some((run, rest))
    });
    let Some((run, rest)) = asked else {
        eprintln!("Usage: cargo run --release -p btf-tests -- STUDY [ARGUMENTS]\n\nStudies:");
        STUDIES.iter().for_each(|(name, arguments, _)| eprintln!("  {name} {arguments}"));
        return ExitCode::from(2);
    };
    match run(rest) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
