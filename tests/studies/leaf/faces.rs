//! How leaf models tell the back of a leaf from its face, and fit both: rows of docs/results/leaf-optics.md, as Markdown.
//! `cargo run --release -p btf-tests -- leaf_faces FOLDER`
//!
//! The folder holds leaves measured from both faces as data paper ERDP-2013-02 of JaLTER [Noda 2013] has them: files
//! `*_leaf_*.csv` with the columns wavelength, R and T of the upper face, R and T of the lower one. Needles are left out.

use std::error::Error;
use std::fs;
use std::path::Path;

use btf_capture::delimited::{fields, lines};
use btf_synth::{Abm97, AbmB, InversionParams, Inverter, LeafModel, LeafSpectra, SHARES, TwoHalves};

/// Wavelengths in nanometres: the instrument is noisy below and has gaps beyond.
const FIRST_NM: usize = 450;
const LAST_NM: usize = 1630;
const STEP_NM: usize = 10;
/// Largest sum of reflectance and transmittance of a leaf that counts as measured well.
const MAX_LIGHT: f64 = 1.0;

/// A leaf seen from both faces.
struct Leaf {
    /// Reflectance and transmittance of the face, then of the back, over [`wavelengths_nm`].
    shares: [Vec<f64>; SHARES],
}

fn wavelengths_nm() -> Vec<f64> {
    (FIRST_NM..=LAST_NM).step_by(STEP_NM).map(|nm| nm as f64).collect()
}

/// Prints the tables.
pub fn run(folders: &[String]) -> Result<(), Box<dyn Error>> {
    let [folder] = folders else { return Err("give the folder of the measured leaves".into()) };
    let (leaves, left_out) = read(Path::new(folder))?;
    let nm = wavelengths_nm();
    println!("## {} broad leaves from both faces ({left_out} left out: light is made)\n", leaves.len());
    println!("| nm | R face | R back | T face | T back |\n|---|---|---|---|---|");
    for wanted in [550.0, 680.0, 780.0] {
        let at = nm.iter().position(|nm| *nm == wanted).ok_or("no such wavelength")?;
        let mean = |i: usize| leaves.iter().map(|leaf| leaf.shares[i][at]).sum::<f64>() / leaves.len() as f64;
        println!("| {wanted} | {:.3} | {:.3} | {:.3} | {:.3} |", mean(0), mean(2), mean(1), mean(3));
    }
    println!("\nEach model fitted to R and T of the face alone; root mean square errors, median of the leaves.\n");
    println!("| model | R face | T face | R back, told | T back, told |\n|---|---|---|---|---|");
    let models = [
        LeafModel::default(),
        LeafModel::TwoSided(TwoHalves::default()),
        LeafModel::Abm97(Abm97::default()),
        LeafModel::AbmB(AbmB::default()),
    ];
    for model in &models {
        row(model.name(), &told(&leaves, *model, 2, &nm)?);
    }
    println!("\nThe same fitted to both faces at once.\n");
    println!("| model | R face | T face | R back | T back |\n|---|---|---|---|---|");
    for model in &models {
        row(model.name(), &told(&leaves, *model, SHARES, &nm)?);
    }
    Ok(())
}

fn row(model: &str, errors: &[[f64; SHARES]]) {
    let median = |i: usize| {
        let mut values: Vec<f64> = errors.iter().map(|errors| errors[i]).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    println!("| `{model}` | {:.4} | {:.4} | {:.4} | {:.4} |", median(0), median(1), median(2), median(3));
}

/// Returns the errors of each leaf's four spectra under a model that is fitted to its first two.
fn errors(
    leaves: &[Leaf],
    fitted: impl Fn(&Leaf) -> Result<[Vec<f64>; SHARES], Box<dyn Error>>,
) -> Result<Vec<[f64; SHARES]>, Box<dyn Error>> {
    let of = |leaf: &Leaf| {
        let fitted = fitted(leaf)?;
        Ok(std::array::from_fn(|i| {
            let squares = fitted[i].iter().zip(&leaf.shares[i]).map(|(x, y)| (x - y).powi(2));
            (squares.sum::<f64>() / fitted[i].len() as f64).sqrt()
        }))
    };
    leaves.iter().map(of).collect()
}

/// Returns what a model says of both faces once it is fitted to `fitted`, the first shares of a leaf: two or all four.
fn told(leaves: &[Leaf], model: LeafModel, fitted: usize, nm: &[f64]) -> Result<Vec<[f64; SHARES]>, Box<dyn Error>> {
    // Plain least squares, as errors are told.
    let params = InversionParams { model, faces: [true; 2], correlated: false, ..InversionParams::default() };
    let inverter = Inverter::new(&params, nm)?;
    let of = |leaf: &Leaf| {
        let shares = std::array::from_fn(|i| if i < fitted { &leaf.shares[i][..] } else { &[] });
        let found = inverter.invert(&LeafSpectra::of_faces("leaf", nm, shares)?);
        Ok(inverter.spectra_of(&found.values))
    };
    errors(leaves, of)
}

/// Reads the leaves of a folder, and counts those that reflect and transmit more than falls in.
fn read(folder: &Path) -> Result<(Vec<Leaf>, usize), Box<dyn Error>> {
    let mut paths: Vec<_> = fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<std::io::Result<_>>()?;
    paths.sort();
    let (mut leaves, mut left_out) = (Vec::new(), 0);
    for path in paths {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if !name.contains("_leaf_") || name.starts_with("Pinus") || name.starts_with("Picea") {
            continue;
        }
        let text = fs::read_to_string(&path)?;
        let mut shares: [Vec<f64>; SHARES] = Default::default();
        for (_, line) in lines(&text) {
            let numbers: Vec<f64> = fields(line, ',')?.iter().filter_map(|cell| cell.parse().ok()).collect();
            let [nm, values @ ..] = &numbers[..] else { continue };
            let wanted = (FIRST_NM..=LAST_NM).step_by(STEP_NM).any(|wanted| wanted as f64 == *nm);
            if wanted && values.len() >= 4 {
                shares.iter_mut().zip(values).for_each(|(shares, value)| shares.push(*value));
            }
        }
        let count = wavelengths_nm().len();
        let is_whole = shares.iter().all(|shares| shares.len() == count && shares.iter().all(|share| *share > -0.01));
        let sums = |a: usize| shares[a].iter().zip(&shares[a + 1]).all(|(r, t)| r + t <= MAX_LIGHT);
        match is_whole && sums(0) && sums(2) {
            true => leaves.push(Leaf { shares }),
            false => left_out += 1,
        }
    }
    Ok((leaves, left_out))
}
