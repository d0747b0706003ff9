//! `btf-synth spectrum`: spectral reflectance and transmittance of a leaf model.

use std::path::PathBuf;
use std::time::Instant;

use btf_synth::{
    Estimate, LEAF_TABLE_NM, LeafContents, LeafModel, LinePlot, MeanSpectra, Method, PAPER_WAVELENGTHS_NM, PlateModel,
    PlateOptics, Rays, Series, Spectrophotometer, Spectrum, SynthError, plate_spectrum, read_spectra,
    two_sided_spectrum,
};
use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::arguments::whole_number;
use super::failure::Failure;
use super::leaf_file::LeafFileArgs;
use super::model::{ContentsArgs, Model, Side, TissueArgs, side_name};
use super::run_args::{RunArgs, write_text};

#[derive(Args)]
#[command(after_help = "Examples:
  btf-synth spectrum --model plate-n --cab 25 --plot spectrum.svg
  btf-synth spectrum --leaf leaf.toml --plot spectrum.svg
  btf-synth spectrum --model plate-two-sided --both-sides --to-nm 2500 --csv faces.csv
  btf-synth spectrum --model abm97 --side abaxial --rays 1e6 --json -
  btf-synth spectrum --model abm97 --beam emitter --method direct --precision 0.001
  btf-synth spectrum --model abm-b --measured leaves.csv --plot against.svg
  btf-synth spectrum --model abm-b --to-nm 2500 --step-nm 20 --rays 1e5 --plot soybean.svg")]
pub struct SpectrumArgs {
    /// Model of the leaf's optics
    #[arg(long, value_enum, default_value_t = Model::PlateN)]
    model: Model,
    #[command(flatten)]
    contents: ContentsArgs,
    #[command(flatten)]
    leaf: LeafFileArgs,
    #[command(flatten)]
    tissue: TissueArgs,
    #[command(flatten)]
    run: RunArgs,
    /// Face towards the light (the plates are alike from both)
    #[arg(long, value_enum, default_value_t = Side::Adaxial)]
    side: Side,
    /// Measure the other face too
    #[arg(long)]
    both_sides: bool,
    /// First wavelength in nm (from 400); plate-paper knows 435, 546 and 675 nm alone
    #[arg(long, default_value_t = 400.0)]
    from_nm: f64,
    /// Last wavelength in nm (to 2500)
    #[arg(long, default_value_t = 780.0)]
    to_nm: f64,
    /// Distance between wavelengths in nm
    #[arg(long, default_value_t = 10.0)]
    step_nm: f64,
    /// Angle between the beam's axis and the normal in degrees
    #[arg(long, default_value_t = 8.0)]
    incidence_deg: f64,
    /// Beam: collimated, or the paper's emitter disk of 8 mm radius at 30 mm over 40 mm2 of leaf
    #[arg(long, value_enum, default_value_t = BeamName::Parallel)]
    beam: BeamName,
    /// Rays per trace, such as 1e6 [default: 1e6]
    #[arg(long, value_parser = whole_number, conflicts_with = "precision")]
    rays: Option<u64>,
    /// As many rays as keep 95 of 100 repetitions within this, such as 0.001
    #[arg(long)]
    precision: Option<f64>,
    /// How absorption is simulated
    #[arg(long, value_enum, default_value_t = MethodName::PathLengths)]
    method: MethodName,
    /// Seed of the rays
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Compare with measured leaves, a table as `btf-synth invert` reads: their mean is dashed in the plot
    #[arg(long, value_name = "SPECTRA.csv")]
    measured: Option<PathBuf>,
    /// Values of the table of measured leaves are percent
    #[arg(long, requires = "measured")]
    percent: bool,
    /// Write the curves as a table, which `btf-synth invert` reads
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// Write the curves as an SVG plot
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

#[derive(Clone, Copy, ValueEnum)]
enum BeamName {
    Parallel,
    Emitter,
}

#[derive(Clone, Copy, ValueEnum)]
enum MethodName {
    /// One absorption-free trace serves all wavelengths
    PathLengths,
    /// One absorption-free trace whose rays split at every interface
    Splitting,
    /// Every wavelength simulated by itself, as in the paper
    Direct,
}

/// Measures the model and writes the results.
pub fn run(args: &SpectrumArgs) -> Result<(), Failure> {
    let mut sides = vec![args.side];
    if args.both_sides {
        sides.push(if args.side == Side::Adaxial { Side::Abaxial } else { Side::Adaxial });
    }
    let compared = compared(args, &sides)?;
    let (spectra, seconds) = measure(args, &sides)?;
    if let Some(path) = &args.plot {
        write_text(path, &plot(args, &sides, &spectra, compared.as_ref()))?;
    }
    if let Some(path) = &args.csv {
        write_text(path, &csv(&sides, &spectra))?;
    }
    let mut result = figures(&spectra[0]);
    result["model"] = json!(args.model.to_string());
    result["side"] = json!(side_name(args.side));
    result["incidence_deg"] = json!(args.incidence_deg);
    result["seed"] = json!(args.seed);
    result["seconds"] = json!(seconds);
    if let Some(other) = spectra.get(1) {
        result[side_name(sides[1])] = figures(other);
    }
    let against = compared.as_ref().map(|mean| errors(mean, &sides, &spectra));
    if let Some((figures, _)) = &against {
        result["measured"] = figures.clone();
    }
    let mut tables: Vec<String> = spectra
        .iter()
        .zip(&sides)
        .map(|(spectrum, side)| {
            let heading = if args.both_sides { format!("{}\n", side_name(*side)) } else { String::new() };
            heading + &table(spectrum)
        })
        .collect();
    tables.extend(against.map(|(_, said)| said));
    args.run.report(&result, tables.concat().trim_end())
}

/// Returns the mean of the leaves that the models are compared with, of which one of `sides` must have been measured.
fn compared(args: &SpectrumArgs, sides: &[Side]) -> Result<Option<MeanSpectra>, Failure> {
    let Some(path) = &args.measured else { return Ok(None) };
    let scale = if args.percent { 0.01 } else { 1.0 };
    let read = read_spectra(path, scale, args.side.into())?;
    let mean = MeanSpectra::of(&read.leaves, &wavelengths(args)?);
    let known =
        |side: &Side| shares_of(*side).into_iter().any(|share| mean.shares[share].iter().any(|x| x.is_finite()));
    match sides.iter().any(known) {
        true => Ok(Some(mean)),
        false => Err(Failure::Usage(format!(
            "{} has no measurement of the {} face at the wavelengths of the model; give --side, --from-nm, --to-nm and \
             --step-nm that fit",
            path.display(),
            side_name(args.side)
        ))),
    }
}

/// Returns name and values of a spectrum's reflectance and transmittance, each after its place in [`MeanSpectra::shares`].
fn quantities(side: Side, spectrum: &Spectrum) -> [(usize, &'static str, &[Estimate]); 2] {
    let [reflectance, transmittance] = shares_of(side);
    [(reflectance, "reflectance", &spectrum.reflectance), (transmittance, "transmittance", &spectrum.transmittance)]
}

/// Returns the places of the reflectance and the transmittance of a face in [`MeanSpectra::shares`].
fn shares_of(side: Side) -> [usize; 2] {
    match side {
        Side::Adaxial => [0, 1],
        Side::Abaxial => [2, 3],
    }
}

/// Returns how far a model is from measured leaves: as JSON and for a reader.
fn errors(mean: &MeanSpectra, sides: &[Side], spectra: &[Spectrum]) -> (Value, String) {
    let (mut figures, mut text) = (json!({}), String::new());
    for (side, spectrum) in sides.iter().zip(spectra) {
        for (share, quantity, values) in quantities(*side, spectrum) {
            let values: Vec<f64> = values.iter().map(|estimate| estimate.mean).collect();
            let Some(error) = mean.error_of(share, &values) else { continue };
            let (face, leaves) = (side_name(*side), mean.leaves[share]);
            figures[face][quantity] =
                json!({ "leaves": leaves, "root_mean_square_error": error, "mean": mean.shares[share] });
            text += &format!(
                "{face} {quantity}: root mean square difference to the mean of {leaves} measured leaves {error:.4}\n"
            );
        }
    }
    (figures, text)
}

/// Measures the spectrum of each of `sides`. Also returns the seconds that it took.
fn measure(args: &SpectrumArgs, sides: &[Side]) -> Result<(Vec<Spectrum>, f64), Failure> {
    let wavelength_nm = wavelengths(args)?;
    let leaf = args.leaf.read()?;
    let [cab, car] = args.contents.own_pigments(leaf.as_ref().map(|leaf| &leaf.contents));
    let model = args.tissue.leaf_model(args.model, cab, car)?;
    let started = Instant::now();
    let contents = args.contents.over(leaf.map_or_else(LeafContents::default, |leaf| leaf.contents));
    let spectra: Vec<Spectrum> = match (model, model.tissue()) {
        (LeafModel::Plate(model), _) => {
            model.check(model.default_table(), &contents)?;
            let cone_deg = args.contents.cone_deg.unwrap_or(model.default_cone_deg());
            let optics = plate_spectrum(model, model.default_table(), &contents, cone_deg, &wavelength_nm)?;
            vec![without_noise(&wavelength_nm, &optics); sides.len()]
        }
        (LeafModel::TwoSided(halves), _) => {
            let plates = PlateModel::N;
            plates.check(plates.default_table(), &contents)?;
            let cone_deg = args.contents.cone_deg.unwrap_or(plates.default_cone_deg());
            let of = |side: &Side| {
                let face = (*side).into();
                let optics =
                    two_sided_spectrum(&halves, plates.default_table(), &contents, cone_deg, face, &wavelength_nm)?;
                Ok(without_noise(&wavelength_nm, &optics))
            };
            sides.iter().map(of).collect::<Result<_, SynthError>>()?
        }
        (_, None) => unreachable!("a model without a tissue is made of plates"),
        (_, Some(tissue)) => {
            let beam = match args.beam {
                BeamName::Parallel => Spectrophotometer::parallel(),
                BeamName::Emitter => Spectrophotometer::default(),
            };
            let rays = match (args.rays, args.precision) {
                (_, Some(precision)) => Rays::Precision(precision),
                (rays, None) => Rays::Count(rays.unwrap_or(1_000_000)),
            };
            let method = match args.method {
                MethodName::PathLengths => Method::PathLengths,
                MethodName::Splitting => Method::Splitting,
                MethodName::Direct => Method::Direct,
            };
            let (count, total) = (wavelength_nm.len(), wavelength_nm.len() * sides.len());
            args.run.work("spectrum", "wavelengths", total, |progress| {
                let measured = sides.iter().enumerate().map(|(i, &side)| {
                    let instrument = Spectrophotometer { incidence_deg: args.incidence_deg, face: side.into(), ..beam };
                    let onwards = |done: usize, _: usize| progress(i * count + done, total);
                    instrument.measure(tissue, &wavelength_nm, rays, method, args.seed, &onwards)
                });
                measured.collect()
            })?
        }
    };
    Ok((spectra, started.elapsed().as_secs_f64()))
}

/// Returns a spectrum that no ray has measured.
fn without_noise(wavelength_nm: &[f64], optics: &[PlateOptics]) -> Spectrum {
    let exact = |mean| Estimate { mean, standard_error: 0.0 };
    Spectrum {
        reflectance: optics.iter().map(|optics| exact(optics.reflectance)).collect(),
        transmittance: optics.iter().map(|optics| exact(optics.transmittance)).collect(),
        wavelength_nm: wavelength_nm.to_vec(),
        rays: 0,
    }
}

/// Returns the JSON form of a spectrum.
fn figures(spectrum: &Spectrum) -> Value {
    let mean = |values: &[Estimate]| values.iter().map(|e| e.mean).collect::<Vec<f64>>();
    let error = |values: &[Estimate]| values.iter().map(|e| e.standard_error).collect::<Vec<f64>>();
    json!({
        "wavelength_nm": spectrum.wavelength_nm,
        "reflectance": mean(&spectrum.reflectance),
        "transmittance": mean(&spectrum.transmittance),
        "reflectance_standard_error": error(&spectrum.reflectance),
        "transmittance_standard_error": error(&spectrum.transmittance),
        "rays": spectrum.rays,
    })
}

fn wavelengths(args: &SpectrumArgs) -> Result<Vec<f64>, Failure> {
    if args.model == Model::PlatePaper {
        // Printed for no other wavelengths.
        return Ok(PAPER_WAVELENGTHS_NM.into_iter().rev().collect());
    }
    let (from, to, step) = (args.from_nm, args.to_nm, args.step_nm);
    let [first, last] = LEAF_TABLE_NM;
    if !(first..=last).contains(&from) || !(from..=last).contains(&to) || !(0.1..=1000.0).contains(&step) {
        return Err(Failure::Usage(format!(
            "--from-nm {from} --to-nm {to} --step-nm {step} is no range of wavelengths; give {first} to {last} and a step \
             from 0.1"
        )));
    }
    let count = ((to - from) / step + 1e-9).floor() as usize;
    Ok((0..=count).map(|i| from + step * i as f64).collect())
}

/// Returns the curves as a table with a column for each share of light.
fn csv(sides: &[Side], spectra: &[Spectrum]) -> String {
    let mut text = String::from("wavelength_nm");
    for side in sides {
        text += &format!(",{0} reflectance,{0} transmittance", side_name(*side));
    }
    for (i, nm) in spectra[0].wavelength_nm.iter().enumerate() {
        text += &format!("\n{nm}");
        for spectrum in spectra {
            text += &format!(",{},{}", spectrum.reflectance[i].mean, spectrum.transmittance[i].mean);
        }
    }
    text + "\n"
}

fn plot(args: &SpectrumArgs, sides: &[Side], spectra: &[Spectrum], compared: Option<&MeanSpectra>) -> String {
    let (mut series, mut dashed) = (Vec::new(), Vec::new());
    for (side, spectrum) in sides.iter().zip(spectra) {
        for (share, quantity, values) in quantities(*side, spectrum) {
            let label = if args.both_sides { format!("{}, {quantity}", side_name(*side)) } else { quantity.into() };
            let points = spectrum.wavelength_nm.iter().copied().zip(values.iter().map(|e| e.mean)).collect();
            series.push(Series { label, points });
            if let Some(mean) = compared {
                let points = spectrum.wavelength_nm.iter().copied().zip(mean.shares[share].iter().copied()).collect();
                dashed.push(Series { label: "measured".into(), points });
            }
        }
    }
    let faces = if args.both_sides { "both faces".into() } else { format!("{} face", side_name(args.side)) };
    let beside = if compared.is_some() { ", dashed: measured" } else { "" };
    LinePlot {
        title: format!("{}, {faces}, {} degrees{beside}", args.model, args.incidence_deg),
        x_label: "wavelength in nm".into(),
        y_label: "share of incident light".into(),
        series,
        dashed,
    }
    .svg()
}

/// Returns the figures for a reader, one line per wavelength.
fn table(spectrum: &Spectrum) -> String {
    let mut text = String::from("   nm  reflectance  transmittance\n");
    for (i, nm) in spectrum.wavelength_nm.iter().enumerate() {
        let (r, t) = (spectrum.reflectance[i].mean, spectrum.transmittance[i].mean);
        text += &format!("{nm:>5}  {r:>11.4}  {t:>13.4}\n");
    }
    text
}
