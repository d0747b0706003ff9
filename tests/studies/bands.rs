//! How far assets in bands and assets of colours are from a capture in bands, under light that they were not fitted under,
//! as Markdown: `cargo run --release -p btf-tests -- bands CAPTURE ASSET.spmm...`
//!
//! An asset of colours is drawn under another light as renderers draw it: its colours under D65, for an eye that has adapted.
//! Values are taken at random texels and pairs, at the measured directions.

use btf_capture::{Capture, Illuminant, Observer, delta_e00, lab_from_linear, shown_weights};
use btf_fit::load_asset;
use btf_runtime::{Asset, DecodeOptions, Query, Resident, evaluate, evaluate_bands};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::error::Error;
use std::path::Path;

/// Pairs that values are taken at, and texels of each.
const PAIRS: usize = 128;
const TEXELS: usize = 256;
/// Largest angle of lights and eyes from the normal: colours of what is hardly lit are noise.
const MAX_THETA_DEG: f32 = 70.0;
const ILLUMINANTS: [&str; 3] = ["D65", "A", "E"];
/// Wavelengths in nanometres of the index NDVI [Rouse 1974].
const NDVI_NM: [f64; 2] = [670.0, 800.0];

/// Bands of some texels of a pair.
struct Sample {
    query: Query,
    bands: Vec<f32>,
}

/// Prints the table.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let [capture, assets @ ..] = arguments else { return Err("bands takes CAPTURE ASSET.spmm...".into()) };
    let capture = Capture::open(capture)?;
    let samples = samples_of(&capture)?;
    let nm = &capture.info().wavelengths_nm;
    let bands: Vec<Vec<f32>> = samples.iter().map(|sample| sample.bands.clone()).collect();
    println!("| asset | bytes | bands | error of bands | {} | NDVI |", ILLUMINANTS.map(under).join(" | "));
    println!("|---|---|---|---|---|---|---|---|");
    for path in assets {
        let bytes = std::fs::metadata(path)?.len();
        let (_, asset) = load_asset(Path::new(path))?;
        let row = row_of(&asset, &samples, &bands, nm)?;
        println!("| {path} | {bytes} | {row} |");
    }
    Ok(())
}

fn under(name: &str) -> String {
    format!("Delta E00 under {name}, mean, 95 %")
}

/// Reads the bands of random texels of random pairs.
fn samples_of(capture: &Capture) -> Result<Vec<Sample>, Box<dyn Error>> {
    let info = capture.info();
    let count = info.wavelengths_nm.len();
    let near = |units: Vec<[f32; 3]>| -> Vec<(usize, [f32; 3])> {
        units.into_iter().enumerate().filter(|(_, unit)| unit[2] >= MAX_THETA_DEG.to_radians().cos()).collect()
    };
    let (lights, views) = (near(info.lights.units()), near(info.views.units()));
    let mut random = Xoshiro256PlusPlus::seed_from_u64(11);
    let mut samples = Vec::with_capacity(PAIRS * TEXELS);
    for _ in 0..PAIRS {
        let (light, wi) = lights[random.gen_range(0..lights.len())];
        let (view, wo) = views[random.gen_range(0..views.len())];
        let values = capture.read_bands(view, light)?;
        for _ in 0..TEXELS {
            let (column, row) = (random.gen_range(0..info.width), random.gen_range(0..info.height));
            let at = (row * info.width + column) * count;
            let uv = [(column as f32 + 0.5) / info.width as f32, 1.0 - (row as f32 + 0.5) / info.height as f32];
            samples.push(Sample { query: Query { uv, wi, wo }, bands: values[at..at + count].to_vec() });
        }
    }
    Ok(samples)
}

/// Returns the cells of one asset behind its bytes.
fn row_of(asset: &Asset, samples: &[Sample], truth: &[Vec<f32>], nm: &[f64]) -> Result<String, Box<dyn Error>> {
    let (resident, options) = (Resident::from_asset(asset), DecodeOptions::default());
    let spectrum = resident.spectrum();
    let told: Option<Vec<Vec<f32>>> = spectrum.as_ref().map(|spectrum| {
        let of = |sample: &Sample| {
            let mut bands = vec![0.0; nm.len()];
            evaluate_bands(&resident, spectrum, 0, &sample.query, &options, &mut bands);
            bands
        };
        samples.iter().map(of).collect()
    });
    let colours: Vec<[f32; 3]> = samples.iter().map(|sample| evaluate(&resident, 0, &sample.query, &options)).collect();
    let mut cells = match &told {
        Some(told) => vec![nm.len().to_string(), format!("{:.4}", root_mean_square(told, truth))],
        None => vec!["colours".to_owned(), "".to_owned()],
    };
    for name in ILLUMINANTS {
        let weights = shown_weights(nm, &Illuminant::by_name(name)?, &Observer::cie_1931());
        let mut errors: Vec<f64> = (0..samples.len())
            .map(|i| {
                let shown = told.as_ref().map_or(colours[i].map(f64::from), |told| seen(&told[i], &weights));
                delta_e00(lab_from_linear(shown), lab_from_linear(seen(&truth[i], &weights)))
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        cells.push(format!("{mean:.2}, {:.2}", errors[errors.len() * 95 / 100]));
    }
    let index = NDVI_NM.map(|wanted| nm.iter().position(|nm| (nm - wanted).abs() < 15.0));
    cells.push(match (&told, index) {
        (Some(told), [Some(red), Some(infrared)]) => {
            let ndvi = |bands: &Vec<f32>| {
                let [red, infrared] = [red, infrared].map(|at| bands[at].max(1e-4));
                vec![(infrared - red) / (infrared + red)]
            };
            let of = |all: &[Vec<f32>]| all.iter().map(ndvi).collect::<Vec<_>>();
            format!("{:.4}", root_mean_square(&of(told), &of(truth)))
        }
        _ => String::new(),
    });
    Ok(cells.join(" | "))
}

/// Returns linear sRGB, each at least 0, as a display shows it and as assets of colours hold it.
fn seen(bands: &[f32], weights: &[[f32; 3]]) -> [f64; 3] {
    let product = |channel: usize, (x, w): (&f32, &[f32; 3])| f64::from(*x) * f64::from(w[channel]);
    let sum = |channel: usize| bands.iter().zip(weights).map(|pair| product(channel, pair)).sum::<f64>();
    [0, 1, 2].map(|channel| sum(channel).max(0.0))
}

fn root_mean_square(told: &[Vec<f32>], truth: &[Vec<f32>]) -> f64 {
    let pairs = told.iter().flatten().zip(truth.iter().flatten());
    let (sum, count) = pairs.fold((0.0, 0usize), |(sum, count), (x, y)| (sum + f64::from(x - y).powi(2), count + 1));
    (sum / count.max(1) as f64).sqrt()
}
