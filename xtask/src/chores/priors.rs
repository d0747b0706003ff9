//! `cargo xtask priors`: the priors that come with the fitter, learnt from captures of btf-synth.

use crate::arguments::asks_for_help;
use crate::failure::Failure;
use crate::shell::{cargo, root, run_checked};

const HELP: &str = "\
Writes the priors of `btf-fit fit`, fit/src/priors/priors.spmm, or priors without a kind of material into target/priors, to
measure how a kind is predicted that priors have not seen.

Usage: cargo xtask priors [--without cloth|leather|leaf]

Example:
  cargo xtask priors --without cloth && btf-fit fit FEW_IMAGES -o a.spmm --priors target/priors/without-cloth.spmm";

/// Folder in which the captures are made, relative to the repository's root.
const FOLDER: &str = "target/priors";
/// The file that comes with the fitter.
const BUILT_IN: &str = "fit/src/priors/priors.spmm";
/// Width and height of the captures in texels; the priors take a part of them.
const SIZE: &str = "32";
/// Texels that are taken of each capture.
const TEXELS: &str = "192";
/// Size of the priors.
const BYTES: &str = "300kB";
/// The captures: name, kind, and options of btf-synth. Weaves, grains and species are different, and so are gloss and
/// colours, dark and bright; patches are as large as 32 texels of a common capture's resolution.
const CAPTURES: [(&str, &str, &str); 16] = [
    ("twill", "cloth", "--size-mm 1.25"),
    ("plain", "cloth", "--weave plain --size-mm 1.25 --warp-colour 0.5,0.1,0.05 --weft-colour 0.3,0.3,0.1 --seed 2"),
    (
        "satin",
        "cloth",
        "--weave satin --size-mm 2 --warp-per-cm 40 --weft-per-cm 30 --warp-colour 0.05,0.05,0.05 --weft-colour 0.1,0.2,0.3 --flatness 0.3 --seed 3",
    ),
    (
        "wool",
        "cloth",
        "--weave plain --size-mm 4 --warp-per-cm 8 --weft-per-cm 8 --warp-colour 0.7,0.65,0.5 --weft-colour 0.6,0.6,0.6 --flatness 0.8 --seed 4",
    ),
    ("denim", "cloth", "--size-mm 2.5 --warp-per-cm 26 --weft-per-cm 18 --warp-colour 0.02,0.04,0.12 --seed 5"),
    (
        "lining",
        "cloth",
        "--weave satin --size-mm 1 --warp-per-cm 60 --weft-per-cm 40 --warp-colour 0.4,0.02,0.03 --weft-colour 0.4,0.02,0.03 --flatness 0.25 --seed 6",
    ),
    ("calf", "leather", "--size-mm 2"),
    ("black", "leather", "--size-mm 2 --colour 0.012,0.011,0.011 --grain-mm 0.8 --roughness 0.18 --seed 2"),
    ("suede", "leather", "--size-mm 2 --roughness 0.7 --relief-mm 0.05 --wrinkles 2 --colour 0.4,0.3,0.2 --seed 3"),
    ("pebble", "leather", "--size-mm 8 --colour 0.1,0.2,0.3 --grain-mm 3 --relief-mm 0.5 --roughness 0.3 --seed 4"),
    (
        "patent",
        "leather",
        "--size-mm 8 --colour 0.3,0.02,0.02 --relief-mm 0.03 --wrinkles 0.3 --roughness 0.08 --seed 5",
    ),
    ("maize", "leaf", "--species maize"),
    ("soybean", "leaf", "--species soybean"),
    ("tree", "leaf", "--species tree"),
    ("grass", "leaf", "--species grass"),
    ("autumn", "leaf", "--species tree --deficiency nitrogen --seed 2"),
];

/// Runs the chore.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if asks_for_help(arguments) {
        println!("{HELP}");
        return Ok(());
    }
    let without = match arguments {
        [] => None,
        [option, kind] if option == "--without" && CAPTURES.iter().any(|(_, known, _)| known == kind) => Some(kind),
        _ => return Err(Failure::usage(format!("`priors` takes --without cloth, leather or leaf\n\n{HELP}"))),
    };
    let chosen: Vec<_> = CAPTURES.iter().filter(|(_, kind, _)| without.is_none_or(|without| without != kind)).collect();
    let mut folders = Vec::new();
    for (name, kind, options) in chosen {
        let folder = format!("{FOLDER}/{name}");
        // Made anew, because options may have changed.
        let _ = std::fs::remove_dir_all(root().join(&folder));
        let mut synth = cargo(&["run", "--release", "--quiet", "-p", "btf-synth", "--", kind, &folder]);
        run_checked(synth.args(["--size", SIZE, "--quiet"]).args(options.split(' ')))?;
        folders.push(folder);
    }
    let out = without.map_or_else(|| BUILT_IN.to_string(), |kind| format!("{FOLDER}/without-{kind}.spmm"));
    let mut learn = cargo(&["run", "--release", "--quiet", "-p", "btf-fit", "--", "learn-priors"]);
    run_checked(learn.args(&folders).args(["-o", &out, "--texels", TEXELS, "--bytes", BYTES]))
}
