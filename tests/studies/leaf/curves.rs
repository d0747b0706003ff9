//! Leaf models beside the measured leaves that they were made for: rows of docs/results/leaf-optics.md as Markdown.
//! `cargo run --release -p btf-tests -- leaf_curves FOLDER OUT`
//!
//! The folder holds LOPEX as `spectra_db` reads it. The measured spectra are written into the folder OUT as tables that
//! `btf-synth spectrum --measured` and `btf-synth invert` read.

use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

use crate::leaf::spectra_db::{chemistry, leaves_of};
use btf_synth::{
    Abm97, AbmB, AbmU, LeafContents, LeafSpectra, MeanSpectra, Method, PROSPECT_CONE_DEG, PlateModel, Rays, Specimen,
    Spectrophotometer, Tissue, plate_spectrum,
};

/// Samples of LOPEX, each of five leaves: name and identifier.
const SAMPLES: [(&str, &str); 2] = [("soybean", "lopex_21"), ("maize", "lopex_64")];
/// Ranges of wavelengths in nanometres: that of Fig. 5 of 1997, and all.
const RANGES_NM: [[usize; 2]; 2] = [[400, 700], [400, 2500]];
/// Distance of wavelengths in nanometres.
const STEP_NM: usize = 5;
/// Rays of each trace.
const RAYS: u64 = 1_000_000;

/// Prints the table and writes the measured spectra.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let [folder, out] = arguments else { return Err("give the folder of LOPEX and one for the spectra".into()) };
    let folder = Path::new(folder);
    let chemistry = chemistry(&folder.join("metadata.csvy"))?;
    fs::create_dir_all(out)?;
    println!("| leaf | model | R, 400 to 700 nm | T, 400 to 700 nm | R, 400 to 2500 nm | T, 400 to 2500 nm |");
    println!("|---|---|---|---|---|---|");
    for (name, id) in SAMPLES {
        let leaves = leaves_of(&folder.join("spectra").join(format!("{id}.csvy")))?;
        fs::write(Path::new(out).join(format!("{name}.csv")), table(&leaves))?;
        let mean = MeanSpectra::of(&leaves, &wavelengths_nm(RANGES_NM[1]));
        let told = chemistry.get(id).ok_or("the metadata lack a sample")?;
        let of = |column: &str| told.get(column).copied().ok_or("the chemistry of a sample is incomplete");
        let contents = LeafContents {
            chlorophyll_ug_per_cm2: of("leaf_chltot_per_area")?,
            carotenoid_ug_per_cm2: of("leaf_cartot_per_area")?,
            water_cm: of("leaf_water_thickness")?,
            dry_matter_g_per_cm2: of("leaf_mass_per_area")?,
            structure: of("leaf_prospect_N")?,
            ..LeafContents::default()
        };
        row(name, "`plate-n`, the chemistry and N of the sample", &mean, |nm| {
            let plates = PlateModel::N;
            let optics = plate_spectrum(plates, plates.default_table(), &contents, PROSPECT_CONE_DEG, nm)?;
            Ok(optics.iter().map(|optics| [optics.reflectance, optics.transmittance]).collect())
        })?;
        let specimen = if name == "soybean" { Specimen::soybean() } else { Specimen::maize() };
        let (b, u) = (AbmB { specimen, ..AbmB::default() }, AbmU { specimen, ..AbmU::default() });
        let old = Abm97::default();
        let models: [(&str, &dyn Tissue); 2] =
            if name == "soybean" { [("`abm97`", &old), ("`abm-b`", &b)] } else { [("`abm-b`", &b), ("`abm-u`", &u)] };
        for (label, tissue) in models {
            row(name, label, &mean, |nm| traced(tissue, nm))?;
        }
        println!("| {name} | one leaf of the sample, mean of five | {} |", own_spread(&leaves));
    }
    Ok(())
}

fn wavelengths_nm([first, last]: [usize; 2]) -> Vec<f64> {
    (first..=last).step_by(STEP_NM).map(|nm| nm as f64).collect()
}

/// Reflectance and transmittance at each wavelength.
type Curves = Vec<[f64; 2]>;

fn traced(tissue: &dyn Tissue, nm: &[f64]) -> Result<Curves, Box<dyn Error>> {
    let beam = Spectrophotometer::parallel();
    let go_on = |_: usize, _: usize| ControlFlow::Continue(());
    let spectrum = beam.measure(tissue, nm, Rays::Count(RAYS), Method::PathLengths, 1, &go_on)?;
    Ok(spectrum.reflectance.iter().zip(&spectrum.transmittance).map(|(r, t)| [r.mean, t.mean]).collect())
}

/// Prints the errors of a model against the mean of the sample, range by range.
fn row(
    leaf: &str,
    label: &str,
    mean: &MeanSpectra,
    model: impl Fn(&[f64]) -> Result<Curves, Box<dyn Error>>,
) -> Result<(), Box<dyn Error>> {
    let curves = model(&wavelengths_nm(RANGES_NM[1]))?;
    let mut cells = Vec::new();
    for range in RANGES_NM {
        let count = wavelengths_nm(range).len();
        for share in 0..2 {
            let mut values: Vec<f64> = curves.iter().map(|pair| pair[share]).collect();
            values[count..].fill(f64::NAN);
            cells.push(format!("{:.3}", mean.error_of(share, &values).ok_or("nothing was measured")?));
        }
    }
    println!("| {leaf} | {label} | {} |", cells.join(" | "));
    Ok(())
}

/// Returns how far a leaf is from the mean of its sample, the mean over the leaves, as cells.
fn own_spread(leaves: &[LeafSpectra]) -> String {
    let mut cells = Vec::new();
    for range in RANGES_NM {
        let nm = wavelengths_nm(range);
        let mean = MeanSpectra::of(leaves, &nm);
        for share in 0..2 {
            let own = |leaf: &LeafSpectra| {
                let one = MeanSpectra::of(std::slice::from_ref(leaf), &nm);
                mean.error_of(share, &one.shares[share]).unwrap_or(f64::NAN)
            };
            cells.push(format!("{:.3}", leaves.iter().map(own).sum::<f64>() / leaves.len() as f64));
        }
    }
    cells.join(" | ")
}

/// Returns spectra as a table with two columns for each leaf.
fn table(leaves: &[LeafSpectra]) -> String {
    let mut text = String::from("wavelength_nm");
    for i in 1..=leaves.len() {
        let _ = write!(text, ",leaf{i} reflectance,leaf{i} transmittance");
    }
    for (at, nm) in leaves[0].wavelengths_nm.iter().enumerate() {
        let _ = write!(text, "\n{nm}");
        for leaf in leaves {
            let _ = write!(text, ",{},{}", leaf.shares[0][at], leaf.shares[1][at]);
        }
    }
    text + "\n"
}
