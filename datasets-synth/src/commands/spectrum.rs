//! `btf-synth spectrum`: spectral reflectance and transmittance of a leaf model.

use std::path::PathBuf;
use std::time::Instant;

use btf_synth::{
    Estimate, LeafContents, LeafModel, LinePlot, Method, PAPER_WAVELENGTHS_NM, Rays, Series, Spectrophotometer,
    Spectrum, plate_spectrum,
};
use clap::{Args, ValueEnum};
use serde_json::json;

use super::model::{Model, Side, TissueArgs};
use super::{Failure, RunArgs, write_text};

#[derive(Args)]
#[command(after_help = "Examples:
  btf-synth spectrum --model plate-n --cab 25 --plot spectrum.svg
  btf-synth spectrum --model abm97 --side abaxial --rays 1e6 --json -
  btf-synth spectrum --model abm97 --beam emitter --method direct --precision 0.001
  btf-synth spectrum --model abm-b --to-nm 2500 --step-nm 20 --rays 1e5 --plot soybean.svg")]
pub struct SpectrumArgs {
    /// Model of the leaf's optics
    #[arg(long, value_enum, default_value_t = Model::PlateN)]
    model: Model,
    #[command(flatten)]
    contents: super::model::ContentsArgs,
    #[command(flatten)]
    tissue: TissueArgs,
    #[command(flatten)]
    run: RunArgs,
    /// Face towards the light (the plates are alike from both)
    #[arg(long, value_enum, default_value_t = Side::Adaxial)]
    side: Side,
    /// First wavelength in nm (from 400); plate-paper knows 435, 546 and 675 nm alone
    #[arg(long, default_value_t = 400.0)]
    from_nm: f64,
    /// Last wavelength in nm (to 780; algorithmic models to 2500)
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
    #[arg(long, value_parser = super::whole_number, conflicts_with = "precision")]
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
    /// The same with rays that split at every interface
    Splitting,
    /// Every wavelength simulated by itself, as in the paper
    Direct,
}

/// Measures and writes.
pub fn run(args: &SpectrumArgs) -> Result<(), Failure> {
    let wavelength_nm = wavelengths(args)?;
    let model = args.tissue.leaf_model(args.model, args.contents.cab, args.contents.car)?;
    let started = Instant::now();
    let spectrum = match (model, model.tissue()) {
        (LeafModel::Plate(model), _) => {
            let exact = |mean| Estimate { mean, standard_error: 0.0 };
            let contents = args.contents.over(LeafContents::default());
            model.check(model.default_table(), &contents)?;
            let cone_deg = args.contents.cone_deg.unwrap_or(model.default_cone_deg());
            let optics = plate_spectrum(model, model.default_table(), &contents, cone_deg, &wavelength_nm)?;
            Spectrum {
                reflectance: optics.iter().map(|o| exact(o.reflectance)).collect(),
                transmittance: optics.iter().map(|o| exact(o.transmittance)).collect(),
                wavelength_nm,
                rays: 0,
            }
        }
        (_, None) => unreachable!("a model without a tissue is made of plates"),
        (_, Some(tissue)) => {
            let beam = match args.beam {
                BeamName::Parallel => Spectrophotometer::parallel(),
                BeamName::Emitter => Spectrophotometer::default(),
            };
            let instrument = Spectrophotometer { incidence_deg: args.incidence_deg, face: args.side.into(), ..beam };
            let rays = match (args.rays, args.precision) {
                (_, Some(precision)) => Rays::Precision(precision),
                (rays, None) => Rays::Count(rays.unwrap_or(1_000_000)),
            };
            let method = match args.method {
                MethodName::PathLengths => Method::PathLengths,
                MethodName::Splitting => Method::Splitting,
                MethodName::Direct => Method::Direct,
            };
            args.run.work("spectrum", "wavelengths", wavelength_nm.len(), |progress| {
                instrument.measure(tissue, &wavelength_nm, rays, method, args.seed, progress)
            })?
        }
    };
    let seconds = started.elapsed().as_secs_f64();
    if let Some(path) = &args.plot {
        write_text(path, &plot(args, &spectrum))?;
    }
    let mean = |values: &[Estimate]| values.iter().map(|e| e.mean).collect::<Vec<f64>>();
    let error = |values: &[Estimate]| values.iter().map(|e| e.standard_error).collect::<Vec<f64>>();
    let result = json!({
        "model": args.model.to_string(),
        "side": side_name(args.side),
        "incidence_deg": args.incidence_deg,
        "wavelength_nm": spectrum.wavelength_nm,
        "reflectance": mean(&spectrum.reflectance),
        "transmittance": mean(&spectrum.transmittance),
        "reflectance_standard_error": error(&spectrum.reflectance),
        "transmittance_standard_error": error(&spectrum.transmittance),
        "rays": spectrum.rays,
        "seed": args.seed,
        "seconds": seconds,
    });
    args.run.report(&result, table(&spectrum).trim_end())
}

pub(super) fn side_name(side: Side) -> &'static str {
    match side {
        Side::Adaxial => "adaxial",
        Side::Abaxial => "abaxial",
    }
}

fn wavelengths(args: &SpectrumArgs) -> Result<Vec<f64>, Failure> {
    if args.model == Model::PlatePaper {
        // Printed for no other wavelengths.
        return Ok(PAPER_WAVELENGTHS_NM.into_iter().rev().collect());
    }
    let algorithmic = matches!(args.model, Model::Abm97 | Model::AbmB | Model::AbmU);
    let last = if algorithmic { 2500.0 } else { 780.0 };
    let (from, to, step) = (args.from_nm, args.to_nm, args.step_nm);
    if !(400.0..=last).contains(&from) || !(from..=last).contains(&to) || !(0.1..=1000.0).contains(&step) {
        return Err(Failure::Usage(format!(
            "--from-nm {from} --to-nm {to} --step-nm {step} is no range of wavelengths; give 400 to {last} for {} and a \
             step from 0.1",
            args.model
        )));
    }
    let count = ((to - from) / step + 1e-9).floor() as usize;
    Ok((0..=count).map(|i| from + step * i as f64).collect())
}

fn plot(args: &SpectrumArgs, spectrum: &Spectrum) -> String {
    let line = |label: &str, values: &[Estimate]| Series {
        label: label.into(),
        points: spectrum.wavelength_nm.iter().copied().zip(values.iter().map(|e| e.mean)).collect(),
    };
    LinePlot {
        title: format!("{}, {} face, {} degrees", args.model, side_name(args.side), args.incidence_deg),
        x_label: "wavelength in nm".into(),
        y_label: "share of incident light".into(),
        series: vec![line("reflectance", &spectrum.reflectance), line("transmittance", &spectrum.transmittance)],
    }
    .svg()
}

/// The figures for a reader, one line per wavelength.
fn table(spectrum: &Spectrum) -> String {
    let mut text = String::from("   nm  reflectance  transmittance\n");
    for (i, nm) in spectrum.wavelength_nm.iter().enumerate() {
        let (r, t) = (spectrum.reflectance[i].mean, spectrum.transmittance[i].mean);
        text += &format!("{nm:>5}  {r:>11.4}  {t:>13.4}\n");
    }
    text
}
