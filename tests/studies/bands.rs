//! How far assets in bands and assets of colours are from a capture in bands, under light that they were not fitted under,
//! as Markdown: `cargo run --release -p btf-tests -- bands CAPTURE ASSET.spmm...`
//!
//! An asset of colours is drawn under another light as renderers draw it: its colours under D65, for an eye that has adapted.
//! Values are taken at random texels and pairs of the capture. A capture of the same material in other directions than those of
//! the fit gives the error between the measured directions. Filtered texels are those of a coarser level, 4 x 4 to one, beside
//! the means of the capture's. Times are those of one evaluation on one core, relative to colours of the first asset.

use crate::leaf::live::nanoseconds;
use btf_capture::{Capture, Illuminant, Observer, delta_e00, lab_from_linear, shown_weights};
use btf_fit::load_asset;
use btf_runtime::{DecodeOptions, Query, Resident, evaluate, evaluate_bands, evaluate_many, with_levels};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
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

/// Level that filtered texels are taken from, and texels of the finest along a side of one.
const LEVEL: u32 = 2;
const SIDE: usize = 1 << LEVEL;

/// Bands of some texels of a pair.
struct Sample {
    query: Query,
    bands: Vec<f32>,
    /// Bands of the block of texels that one of the coarser level stands for.
    filtered: Vec<f32>,
}

/// Prints the table.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let [capture, assets @ ..] = arguments else { return Err("bands takes CAPTURE ASSET.spmm...".into()) };
    let capture = Capture::open(capture)?;
    let samples = samples_of(&capture)?;
    let nm = &capture.info().wavelengths_nm;
    println!(
        "| asset | bytes | bands | error of bands | of filtered texels | {} | filtered, D65 | NDVI | time, colours | time, bands |",
        ILLUMINANTS.map(under).join(" | ")
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
    let parallel = |count: usize, work: &(dyn Fn(usize) + Sync)| (0..count).into_par_iter().for_each(work);
    let mut unit_ns = None;
    for path in assets {
        let bytes = std::fs::metadata(path)?.len();
        let (_, asset) = load_asset(Path::new(path))?;
        let resident = Resident::from_asset(&with_levels(&asset, &parallel));
        let row = row_of(&resident, &samples, nm)?;
        let [colours_ns, bands_ns] = times(&resident, &samples);
        let unit_ns = *unit_ns.get_or_insert(colours_ns);
        let times = format!("{:.2} | {:.2}", colours_ns / unit_ns, bands_ns / unit_ns);
        println!("| {path} | {bytes} | {row} | {times} |");
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
    if !(info.width.is_multiple_of(SIDE) && info.height.is_multiple_of(SIDE)) {
        return Err(format!("{}: its sides are no multiples of {SIDE} texels, which are filtered", info.name).into());
    }
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
            let (left, top) = (column / SIDE * SIDE, row / SIDE * SIDE);
            let block = (top..top + SIDE).flat_map(|row| (left..left + SIDE).map(move |column| (row, column)));
            let mut filtered = vec![0.0; count];
            for (row, column) in block {
                let texel = &values[(row * info.width + column) * count..][..count];
                filtered.iter_mut().zip(texel).for_each(|(sum, x)| *sum += x / (SIDE * SIDE) as f32);
            }
            let uv = [(column as f32 + 0.5) / info.width as f32, 1.0 - (row as f32 + 0.5) / info.height as f32];
            samples.push(Sample { query: Query { uv, wi, wo }, bands: values[at..at + count].to_vec(), filtered });
        }
    }
    Ok(samples)
}

/// Returns what the asset tells of each sample at a level: bands, or `None` for an asset of colours, and colours.
fn told_at(
    resident: &Resident,
    samples: &[Sample],
    level: u32,
    bands: usize,
) -> (Option<Vec<Vec<f32>>>, Vec<[f32; 3]>) {
    let options = DecodeOptions::default();
    let told = resident.spectrum().map(|spectrum| {
        let of = |sample: &Sample| {
            let mut bands = vec![0.0; bands];
            evaluate_bands(resident, &spectrum, level, &sample.query, &options, &mut bands);
            bands
        };
        samples.iter().map(of).collect()
    });
    (told, samples.iter().map(|sample| evaluate(resident, level, &sample.query, &options)).collect())
}

/// Returns mean and 95th percentile of the colour differences under an illuminant.
fn differences(
    name: &str,
    nm: &[f64],
    (told, colours): (&Option<Vec<Vec<f32>>>, &[[f32; 3]]),
    truth: &[&Vec<f32>],
) -> Result<[f64; 2], Box<dyn Error>> {
    let weights = shown_weights(nm, &Illuminant::by_name(name)?, &Observer::cie_1931());
    let mut errors: Vec<f64> = (0..truth.len())
        .map(|i| {
            let shown = told.as_ref().map_or(colours[i].map(f64::from), |told| seen(&told[i], &weights));
            delta_e00(lab_from_linear(shown), lab_from_linear(seen(truth[i], &weights)))
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    Ok([errors.iter().sum::<f64>() / errors.len() as f64, errors[errors.len() * 95 / 100]])
}

/// Returns the cells of one asset between its bytes and its times.
fn row_of(resident: &Resident, samples: &[Sample], nm: &[f64]) -> Result<String, Box<dyn Error>> {
    let truth: Vec<&Vec<f32>> = samples.iter().map(|sample| &sample.bands).collect();
    let filtered: Vec<&Vec<f32>> = samples.iter().map(|sample| &sample.filtered).collect();
    let (told, colours) = told_at(resident, samples, 0, nm.len());
    let (told_filtered, colours_filtered) = told_at(resident, samples, LEVEL, nm.len());
    let mut cells = match (&told, &told_filtered) {
        (Some(told), Some(of_level)) => {
            let errors = [root_mean_square(told, &truth), root_mean_square(of_level, &filtered)];
            vec![nm.len().to_string(), format!("{:.4}", errors[0]), format!("{:.4}", errors[1])]
        }
        _ => vec!["colours".to_owned(), String::new(), String::new()],
    };
    for name in ILLUMINANTS {
        let [mean, most] = differences(name, nm, (&told, &colours), &truth)?;
        cells.push(format!("{mean:.2}, {most:.2}"));
    }
    let [mean, most] = differences("D65", nm, (&told_filtered, &colours_filtered), &filtered)?;
    cells.push(format!("{mean:.2}, {most:.2}"));
    let index = NDVI_NM.map(|wanted| nm.iter().position(|nm| (nm - wanted).abs() < 15.0));
    cells.push(match (&told, index) {
        (Some(told), [Some(red), Some(infrared)]) => {
            let ndvi = |bands: &Vec<f32>| {
                let [red, infrared] = [red, infrared].map(|at| bands[at].max(1e-4));
                vec![(infrared - red) / (infrared + red)]
            };
            let truth: Vec<Vec<f32>> = truth.iter().map(|bands| ndvi(bands)).collect();
            format!(
                "{:.4}",
                root_mean_square(&told.iter().map(ndvi).collect::<Vec<_>>(), &truth.iter().collect::<Vec<_>>())
            )
        }
        _ => String::new(),
    });
    Ok(cells.join(" | "))
}

/// Returns the nanoseconds of an evaluation of colours, many at a time, and of bands, which are colours where there are none.
fn times(resident: &Resident, samples: &[Sample]) -> [f64; 2] {
    let (options, queries) =
        (DecodeOptions::default(), samples.iter().map(|sample| sample.query).collect::<Vec<Query>>());
    let mut values = vec![[0.0; 3]; queries.len()];
    let colours = nanoseconds(queries.len(), || evaluate_many(resident, 0, &queries, &options, &mut values));
    let Some(spectrum) = resident.spectrum() else { return [colours, colours] };
    let mut bands = vec![0.0; spectrum.weights.len()];
    let of_bands = nanoseconds(queries.len(), || {
        for query in &queries {
            evaluate_bands(resident, &spectrum, 0, query, &options, std::hint::black_box(&mut bands));
        }
    });
    [colours, of_bands]
}

/// Returns linear sRGB, each at least 0, as a display shows it and as assets of colours hold it.
fn seen(bands: &[f32], weights: &[[f32; 3]]) -> [f64; 3] {
    let product = |channel: usize, (x, w): (&f32, &[f32; 3])| f64::from(*x) * f64::from(w[channel]);
    let sum = |channel: usize| bands.iter().zip(weights).map(|pair| product(channel, pair)).sum::<f64>();
    [0, 1, 2].map(|channel| sum(channel).max(0.0))
}

fn root_mean_square(told: &[Vec<f32>], truth: &[&Vec<f32>]) -> f64 {
    let pairs = told.iter().flatten().zip(truth.iter().copied().flatten());
    let (sum, count) = pairs.fold((0.0, 0usize), |(sum, count), (x, y)| (sum + f64::from(x - y).powi(2), count + 1));
    (sum / count.max(1) as f64).sqrt()
}
