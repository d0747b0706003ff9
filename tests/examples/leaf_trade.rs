//! Prints what the plate models and theta's forms cost and lose, as Markdown tables:
//! `cargo run --release -p btf-tests --example leaf_trade`.
//!
//! Times are of one thread and of this run: compare them with each other.

use btf_synth::{LeafContents, PlateBody, PlateModel, RgbBands, RgbFromSpectrum, SpecificAbsorption, ThetaForm};
use btf_tests::leaf_trade::{colour_errors, contents_grid, single_plate_errors, theta_errors};
use std::hint::black_box;
use std::time::Instant;

/// Measurements of which the fastest counts.
const REPEATS: usize = 7;

/// Nanoseconds per item of `work`, which treats `count` of them.
fn nanoseconds(count: usize, mut work: impl FnMut()) -> f64 {
    work();
    let once = |work: &mut dyn FnMut()| {
        let started = Instant::now();
        work();
        started.elapsed().as_secs_f64()
    };
    (0..REPEATS).map(|_| once(&mut work)).fold(f64::MAX, f64::min) * 1e9 / count as f64
}

fn theta_nanoseconds(form: ThetaForm) -> f64 {
    // In an order that no branch predictor learns.
    let ks: Vec<f64> =
        (0..1_000_000u32).map(|i| f64::from(i.wrapping_mul(2_654_435_761)) / f64::from(u32::MAX) * 5.0).collect();
    nanoseconds(ks.len(), || {
        black_box(ks.iter().map(|&k| form.at(k)).sum::<f64>());
    })
}

fn texel_nanoseconds(body: &PlateBody) -> f64 {
    let contents: Vec<LeafContents> = contents_grid().into_iter().cycle().take(20_000).collect();
    nanoseconds(contents.len(), || {
        black_box(contents.iter().map(|contents| body.rgb(contents, 1.1).reflectance[1]).sum::<f32>());
    })
}

/// Which leaves of the grid count.
type Keep = fn(&LeafContents) -> bool;

/// Neither red nor brown pigment.
fn plain(contents: &LeafContents) -> bool {
    contents.anthocyanin_ug_per_cm2 == 0.0 && contents.brown == 0.0
}

fn main() {
    println!("| theta(k) | ns | theta max / mean | rho max / mean | tau max / mean | dE00 max / mean |");
    println!("|---|---|---|---|---|---|");
    for form in ThetaForm::ALL {
        let e = theta_errors(form);
        let ns = theta_nanoseconds(form);
        println!(
            "| {} | {ns:.1} | {:.1e} / {:.1e} | {:.1e} / {:.1e} | {:.1e} / {:.1e} | {:.4} / {:.4} |",
            form.name(),
            e.theta.max,
            e.theta.mean,
            e.reflectance.max,
            e.reflectance.mean,
            e.transmittance.max,
            e.transmittance.mean,
            e.colour.max,
            e.colour.mean,
        );
    }

    println!("\n| model | wavelengths | theta | ns per texel | dE00 front max / mean | dE00 behind max / mean |");
    println!("|---|---|---|---|---|---|");
    for model in PlateModel::ALL {
        for bands in [RgbBands::ThreeWavelength, RgbBands::Spectral31] {
            let Ok(body) = PlateBody::new(model, SpecificAbsorption::ProspectD, bands) else { continue };
            let convert = RgbFromSpectrum::new(bands);
            // The paper knows no anthocyanins.
            let known = |contents: &LeafContents| model != PlateModel::Paper || contents.anthocyanin_ug_per_cm2 == 0.0;
            let [front, behind] = colour_errors(model, &convert, known);
            let forms: &[ThetaForm] = if model == PlateModel::Paper {
                &[ThetaForm::ThreePiece]
            } else {
                &[ThetaForm::Exact, ThetaForm::Single, ThetaForm::RationalP2Q3]
            };
            for &form in forms {
                let ns = texel_nanoseconds(&body.clone().with_theta(form));
                println!(
                    "| {} | {} | {} | {ns:.0} | {:.2} / {:.2} | {:.2} / {:.2} |",
                    model.name(),
                    convert.wavelengths_nm().len(),
                    form.name(),
                    front.max,
                    front.mean,
                    behind.max,
                    behind.mean,
                );
            }
        }
    }

    println!("\n| plate-n, three wavelengths against 31 | dE00 front max / mean | dE00 behind max / mean |");
    println!("|---|---|---|");
    let three = RgbFromSpectrum::new(RgbBands::ThreeWavelength);
    let sets: [(&str, Keep); 4] = [
        ("green: chlorophyll 20 ug/cm2 up", |c| plain(c) && c.chlorophyll_ug_per_cm2 >= 20.0),
        ("yellow: chlorophyll up to 2 ug/cm2", |c| plain(c) && c.chlorophyll_ug_per_cm2 <= 2.0),
        ("red: anthocyanins", |c| c.anthocyanin_ug_per_cm2 > 0.0 && c.brown == 0.0),
        ("brown: brown pigment", |c| c.brown > 0.0),
    ];
    for (name, keep) in sets {
        let [front, behind] = colour_errors(PlateModel::N, &three, keep);
        println!("| {name} | {:.1} / {:.1} | {:.1} / {:.1} |", front.max, front.mean, behind.max, behind.mean);
    }

    println!("\n| nm | plate-exact R / T | printed R / T | printed with its slip R / T |");
    println!("|---|---|---|---|");
    for row in single_plate_errors(1, 3000) {
        let pair = |[r, t]: [f64; 2]| format!("{r:.4} / {t:.4}");
        println!(
            "| {} | {} | {} | {} |",
            row.wavelength_nm,
            pair(row.exact),
            pair(row.printed),
            pair(row.printed_slip)
        );
    }
}
