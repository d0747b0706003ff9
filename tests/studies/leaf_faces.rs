//! How leaf models tell the back of a leaf from its face: a row of docs/results/leaf-optics.md for each, as Markdown.
//! `cargo run --release -p btf-tests -- leaf_faces FOLDER`
//!
//! The folder holds leaves measured from both faces as data paper ERDP-2013-02 of JaLTER [Noda 2013] has them: files
//! `*_leaf_*.csv` with the columns wavelength, R and T of the upper face, R and T of the lower one. Needles are left out.

use std::error::Error;
use std::fs;
use std::path::Path;

use btf_capture::delimited::{fields, lines};
use btf_models::{LEAF_QUANTITIES, LeafDescription};
use btf_synth::{
    Abm97, AbmB, Face, InversionParams, Inverter, LeafContents, LeafModel, LeafSpectra, MAX_UNKNOWNS,
    PROSPECT_CONE_DEG, SpecificAbsorption, TwoHalves, two_sided_spectrum,
};
use nalgebra::{DMatrix, DVector};

/// Wavelengths in nanometres: the instrument is noisy below and has gaps beyond.
const FIRST_NM: usize = 450;
const LAST_NM: usize = 1630;
const STEP_NM: usize = 10;
/// Largest sum of reflectance and transmittance of a leaf that counts as measured well.
const MAX_LIGHT: f64 = 1.0;

/// A leaf seen from both faces.
struct Leaf {
    /// Reflectance and transmittance of the face, then of the back, over [`wavelengths_nm`].
    shares: [Vec<f64>; 4],
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
    row("plate-n", &errors(&leaves, |leaf| of_inverter(leaf, &LeafModel::default(), &nm))?);
    row("plate-two-sided", &errors(&leaves, |leaf| of_halves(leaf, &TwoHalves::default(), &nm))?);
    row("abm97", &errors(&leaves, |leaf| of_inverter(leaf, &LeafModel::Abm97(Abm97::default()), &nm))?);
    row("abm-b", &errors(&leaves, |leaf| of_inverter(leaf, &LeafModel::AbmB(AbmB::default()), &nm))?);
    Ok(())
}

fn row(model: &str, errors: &[[f64; 4]]) {
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
    fitted: impl Fn(&Leaf) -> Result<[Vec<f64>; 4], Box<dyn Error>>,
) -> Result<Vec<[f64; 4]>, Box<dyn Error>> {
    let of = |leaf: &Leaf| {
        let fitted = fitted(leaf)?;
        Ok(std::array::from_fn(|i| {
            let squares = fitted[i].iter().zip(&leaf.shares[i]).map(|(x, y)| (x - y).powi(2));
            (squares.sum::<f64>() / fitted[i].len() as f64).sqrt()
        }))
    };
    leaves.iter().map(of).collect()
}

/// Inverts the face by a model of the program, and asks the model for both faces.
fn of_inverter(leaf: &Leaf, model: &LeafModel, nm: &[f64]) -> Result<[Vec<f64>; 4], Box<dyn Error>> {
    thread_local! {
        /// The two faces of the last model, which take a while to trace.
        static READY: std::cell::RefCell<Option<(LeafModel, [Inverter; 2])>> = const { std::cell::RefCell::new(None) };
    }
    READY.with_borrow_mut(|ready| {
        if ready.as_ref().is_none_or(|(known, _)| known != model) {
            let of = |face| {
                let params = InversionParams { model: *model, face, correlated: false, ..InversionParams::default() };
                Inverter::new(&params, nm)
            };
            *ready = Some((*model, [of(Face::Adaxial)?, of(Face::Abaxial)?]));
        }
        let Some((_, [face, back])) = ready else { return Err("no model".into()) };
        let found = face.invert(&LeafSpectra::new("leaf", nm, &leaf.shares[0], &leaf.shares[1])?);
        let ([r, t], [back_r, back_t]) = (face.spectra_of(&found.values), back.spectra_of(&found.values));
        Ok([r, t, back_r, back_t])
    })
}

/// Fits unequal halves to the face by damped Gauss-Newton steps with differences for derivatives.
fn of_halves(leaf: &Leaf, halves: &TwoHalves, nm: &[f64]) -> Result<[Vec<f64>; 4], Box<dyn Error>> {
    /// Greatest values that are tried; the least are those of leaf files.
    const MOST: [f64; MAX_UNKNOWNS] = [200.0, 60.0, 60.0, 5.0, 0.1, 0.06, 5.0];
    let contents_of = |values: &DVector<f64>| {
        let mut leaf = LeafDescription::default();
        (0..MAX_UNKNOWNS).for_each(|i| LEAF_QUANTITIES[i].set(&mut leaf, values[i]));
        leaf.contents
    };
    let spectra = |values: &DVector<f64>, face: Face| -> Result<[Vec<f64>; 2], Box<dyn Error>> {
        let contents: LeafContents = contents_of(values);
        let optics = two_sided_spectrum(halves, SpecificAbsorption::ProspectD, &contents, PROSPECT_CONE_DEG, face, nm)?;
        Ok([optics.iter().map(|x| x.reflectance).collect(), optics.iter().map(|x| x.transmittance).collect()])
    };
    let misses = |values: &DVector<f64>| -> Result<DVector<f64>, Box<dyn Error>> {
        let [r, t] = spectra(values, Face::Adaxial)?;
        let told = r.into_iter().chain(t);
        let measured = leaf.shares[0].iter().chain(&leaf.shares[1]);
        Ok(DVector::from_iterator(2 * nm.len(), told.zip(measured).map(|(x, y)| x - y)))
    };
    let mut values = DVector::from_vec(vec![35.0, 8.0, 1.0, 0.02, 0.012, 0.006, 1.6]);
    let (mut here, mut damping) = (misses(&values)?, 1e-3);
    for _ in 0..60 {
        let mut slopes = DMatrix::zeros(here.len(), MAX_UNKNOWNS);
        for i in 0..MAX_UNKNOWNS {
            let step = 1e-5 * MOST[i];
            let mut moved = values.clone();
            moved[i] += step;
            slopes.set_column(i, &((misses(&moved)? - &here) / step * MOST[i]));
        }
        let mut products = slopes.tr_mul(&slopes);
        (0..MAX_UNKNOWNS).for_each(|i| products[(i, i)] *= 1.0 + damping);
        let Some(solved) = products.cholesky() else { break };
        let step = solved.solve(&slopes.tr_mul(&here));
        let moved = DVector::from_fn(MAX_UNKNOWNS, |i, _| {
            (values[i] - step[i] * MOST[i]).clamp(LEAF_QUANTITIES[i].range[0], MOST[i])
        });
        let there = misses(&moved)?;
        if there.norm_squared() < here.norm_squared() {
            (values, here, damping) = (moved, there, damping * 0.3);
        } else {
            damping *= 8.0;
        }
    }
    let ([r, t], [back_r, back_t]) = (spectra(&values, Face::Adaxial)?, spectra(&values, Face::Abaxial)?);
    Ok([r, t, back_r, back_t])
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
        let mut shares: [Vec<f64>; 4] = Default::default();
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
