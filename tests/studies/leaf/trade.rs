//! What the plate models and theta's forms lose, as figures that promises hold.
//!
//! Prints what the plate models and theta's forms cost and lose, as Markdown tables:
//! `cargo run --release -p btf-tests -- leaf_trade`.
//!
//! Times are of one thread and of this run: compare them with each other.

use btf_capture::{delta_e00, lab_from_linear};
use btf_synth::{
    BodyRgb, LeafContents, PlateBody, PlateModel, PlateOptics, RgbBands, RgbFromSpectrum, SpecificAbsorption,
    ThetaForm, diffuse_transmission, plate, plate_paper_absorption, plate_paper_of_theta, plate_spectrum,
    three_piece_fit,
};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

/// The paper's index, of which printed eq. 6 is the plate.
const PAPER_INDEX: f64 = 1.42;

/// The dry matter absorption at 435 nm that the paper prints a tenth of, in cm2/g [Feret 2008].
const DRY_MATTER_435: [f64; 2] = [14.81, 1.481];

/// Largest and mean of a set of differences.
#[derive(Debug, Clone, Copy, Default)]
pub struct Spread {
    /// Largest.
    pub max: f64,
    /// Mean.
    pub mean: f64,
}

impl Spread {
    /// Of some differences, all at least 0.
    pub fn of(differences: impl IntoIterator<Item = f64>) -> Spread {
        let (max, sum, count) =
            differences.into_iter().fold((0f64, 0.0, 0usize), |(max, sum, count), x| (max.max(x), sum + x, count + 1));
        Spread { max, mean: sum / count.max(1) as f64 }
    }
}

/// CIEDE2000 between two linear colours.
pub fn delta_e00_linear(x: [f64; 3], y: [f64; 3]) -> f64 {
    delta_e00(lab_from_linear(x), lab_from_linear(y))
}

/// Leaves from green over yellow and red to brown, thin and thick, each within the models' ranges:
/// 378 sets of contents.
pub fn contents_grid() -> Vec<LeafContents> {
    let mut grid = Vec::new();
    for chlorophyll_ug_per_cm2 in [0.0, 2.0, 10.0, 20.0, 40.0, 60.0, 80.0] {
        for carotenoid_ug_per_cm2 in [1.0, 8.0, 16.0] {
            for anthocyanin_ug_per_cm2 in [0.0, 3.0, 10.0] {
                for brown in [0.0, 0.5] {
                    for structure in [1.0, 1.5, 2.5] {
                        grid.push(LeafContents {
                            chlorophyll_ug_per_cm2,
                            carotenoid_ug_per_cm2,
                            anthocyanin_ug_per_cm2,
                            brown,
                            structure,
                            ..LeafContents::default()
                        });
                    }
                }
            }
        }
    }
    grid
}

/// Errors of a form of theta.
#[derive(Debug, Clone, Copy)]
pub struct ThetaErrors {
    /// In theta, over 0 <= k <= 10 in even steps.
    pub theta: Spread,
    /// In the reflectance of one plate of index 1.42 lit along its normal, over the same.
    pub reflectance: Spread,
    /// In its transmittance.
    pub transmittance: Spread,
    /// CIEDE2000 of the body's colour in front and behind, `plate-n` over [`contents_grid`].
    pub colour: Spread,
}

/// Measures a form against the exact theta.
pub fn theta_errors(form: ThetaForm) -> ThetaErrors {
    let steps = 100_000;
    let ks = || (0..=steps).map(|i| 10.0 * f64::from(i) / f64::from(steps));
    // The plate as a function of theta: eq. 3-4 with k = 0's optics as the scale-free parts.
    let clear = plate(0.0, PAPER_INDEX, 0.0);
    let surface = ((PAPER_INDEX - 1.0) / (PAPER_INDEX + 1.0)).powi(2);
    // R = s + c q th^2 / (1 - q^2 th^2), T = c th / (1 - q^2 th^2), with q from R and T at th = 1.
    let q = (clear.reflectance - surface) / clear.transmittance;
    let c = clear.transmittance * (1.0 - q * q);
    let optics = |theta: f64| {
        let behind = c * theta / (1.0 - q * q * theta * theta);
        PlateOptics { reflectance: surface + q * theta * behind, transmittance: behind }
    };
    let both = |k: f64| (optics(form.at(k)), optics(diffuse_transmission(k)));
    let exact = plate_n_body(ThetaForm::Exact);
    let body = plate_n_body(form);
    let sides = |x: BodyRgb| [x.reflectance.map(f64::from), x.transmittance.map(f64::from)];
    ThetaErrors {
        theta: Spread::of(ks().map(|k| (form.at(k) - diffuse_transmission(k)).abs())),
        reflectance: Spread::of(ks().map(both).map(|(x, y)| (x.reflectance - y.reflectance).abs())),
        transmittance: Spread::of(ks().map(both).map(|(x, y)| (x.transmittance - y.transmittance).abs())),
        colour: Spread::of(contents_grid().iter().flat_map(|contents| {
            let (x, y) = (sides(body.rgb(contents, 1.0)), sides(exact.rgb(contents, 1.0)));
            [0, 1].map(|side| delta_e00_linear(x[side], y[side]))
        })),
    }
}

fn plate_n_body(form: ThetaForm) -> PlateBody {
    let body = PlateBody::new(PlateModel::N, SpecificAbsorption::ProspectD, RgbBands::Spectral31);
    body.expect("plate-n has spectral bands").with_theta(form)
}

/// Linear sRGB of a whole leaf's reflectance and transmittance, under the model's own cone.
///
/// # Panics
/// For `plate-paper` at other than three wavelengths.
pub fn leaf_rgb(model: PlateModel, contents: &LeafContents, convert: &RgbFromSpectrum) -> [[f64; 3]; 2] {
    let table = SpecificAbsorption::ProspectD;
    let spectrum = plate_spectrum(model, table, contents, model.default_cone_deg(), convert.wavelengths_nm());
    let (front, behind): (Vec<f64>, Vec<f64>) =
        spectrum.expect("the contents are in range").iter().map(|x| (x.reflectance, x.transmittance)).unzip();
    [convert.rgb(&front), convert.rgb(&behind)]
}

/// CIEDE2000 of a model's colours, reflected and transmitted, against `plate-n` at 31 wavelengths,
/// over the members of [`contents_grid`] that `keep` keeps. All from PROSPECT-D, but for
/// `plate-paper`, which has its own numbers.
pub fn colour_errors(
    model: PlateModel,
    convert: &RgbFromSpectrum,
    keep: impl Fn(&LeafContents) -> bool,
) -> [Spread; 2] {
    let reference = RgbFromSpectrum::new(RgbBands::Spectral31);
    let pairs: Vec<[f64; 2]> = contents_grid()
        .iter()
        .filter(|contents| keep(contents))
        .map(|contents| {
            let (x, y) = (leaf_rgb(model, contents, convert), leaf_rgb(PlateModel::N, contents, &reference));
            [0, 1].map(|side| delta_e00_linear(x[side], y[side]))
        })
        .collect();
    [0, 1].map(|side| Spread::of(pairs.iter().map(|pair| pair[side])))
}

/// Root mean square differences to `plate-n` at one wavelength: reflectance, transmittance.
#[derive(Debug, Clone, Copy)]
pub struct SinglePlateRow {
    /// Wavelength in nanometres.
    pub wavelength_nm: f64,
    /// `plate-exact`.
    pub exact: [f64; 2],
    /// Printed eq. 6 and three-piece fit, with the dry matter absorption of the source.
    pub printed: [f64; 2],
    /// Reflectance and transmittance as printed, with the paper's slip in the absorption at 435 nm.
    pub printed_slip: [f64; 2],
}

/// How far a single plate is from N layers, over `sets` random contents (chlorophyll 0 to 80 ug/cm2,
/// carotenoids 0 to 20, N 1 to 2.5, dry matter 0.001 to 0.02 g/cm2, in 30 % of them brown pigment 0
/// to 0.5). All from PROSPECT-5, N layers lit over 40 degrees, single plates along the normal.
pub fn single_plate_errors(seed: u64, sets: usize) -> Vec<SinglePlateRow> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let contents: Vec<LeafContents> = (0..sets)
        .map(|_| LeafContents {
            chlorophyll_ug_per_cm2: random.gen_range(0.0..80.0),
            carotenoid_ug_per_cm2: random.gen_range(0.0..20.0),
            anthocyanin_ug_per_cm2: 0.0,
            brown: if random.gen_bool(0.3) { random.gen_range(0.0..0.5) } else { 0.0 },
            water_cm: 0.01,
            dry_matter_g_per_cm2: random.gen_range(0.001..0.02),
            structure: random.gen_range(1.0..2.5),
        })
        .collect();
    let table = SpecificAbsorption::Prospect5;
    [(435.0, 2), (546.0, 1), (675.0, 0)]
        .map(|(wavelength_nm, band)| {
            let of = |model: PlateModel, x: &LeafContents| {
                plate_spectrum(model, table, x, model.default_cone_deg(), &[wavelength_nm]).expect("in range")[0]
            };
            let printed = |x: &LeafContents| {
                let [right, slip] = DRY_MATTER_435;
                let missing = if band == 2 { (right - slip) * x.dry_matter_g_per_cm2 / x.structure } else { 0.0 };
                plate_paper_of_theta(three_piece_fit(plate_paper_absorption(x)[band] + missing))
            };
            let rmse = |model: &dyn Fn(&LeafContents) -> PlateOptics| {
                let squares = contents.iter().fold([0.0; 2], |sum, x| {
                    let (a, b) = (model(x), of(PlateModel::N, x));
                    [
                        sum[0] + (a.reflectance - b.reflectance).powi(2),
                        sum[1] + (a.transmittance - b.transmittance).powi(2),
                    ]
                });
                squares.map(|square| (square / sets as f64).sqrt())
            };
            SinglePlateRow {
                wavelength_nm,
                exact: rmse(&|x| of(PlateModel::Exact, x)),
                printed: rmse(&printed),
                printed_slip: rmse(&|x| of(PlateModel::Paper, x)),
            }
        })
        .to_vec()
}

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

/// Runs the study.
pub fn run(_: &[String]) -> Result<(), Box<dyn Error>> {
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
    Ok(())
}
