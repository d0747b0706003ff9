//! `btf-synth goniophotometer`: BRDF and BTDF of an algorithmic leaf model over the sphere.

use std::path::PathBuf;
use std::time::Instant;

use btf_synth::{
    CookTorrance, GlossCoupling, GlossParams, Goniogram, Goniophotometer, Interactions, LeafContents, LeafModel,
    Nanometres, PlateModel, PlateOptics, Series, check_wavelengths, counts_svg, disk_svg, goniogram_svg, plate_inside,
    plate_n_inside, plate_spectrum,
};
use clap::Args;
use serde_json::{Value, json};

use super::arguments::whole_number;
use super::failure::Failure;
use super::model::{ContentsArgs, Model, Side, TissueArgs, side_name};
use super::run_args::{RunArgs, write_text};

/// Number of rays for which interactions are counted, as in the paper's figure 8.
const INTERACTION_RAYS: u64 = 10_000;

#[derive(Args)]
#[command(after_help = "Examples:
  btf-synth goniophotometer --model abm97 --incidence-deg 45 --wavelength-nm 550 --rays 1e7 --json -
  btf-synth goniophotometer --incidence-deg 15,30,45 --plot brdf.svg --interactions-plot interactions.svg")]
pub struct GoniophotometerArgs {
    /// Model of the leaf's optics
    #[arg(long, value_enum, default_value_t = Model::Abm97)]
    model: Model,
    #[command(flatten)]
    contents: ContentsArgs,
    #[command(flatten)]
    tissue: TissueArgs,
    #[command(flatten)]
    run: RunArgs,
    /// Roughness of the plates' gloss (0.05 to 1)
    #[arg(long, default_value_t = 0.3)]
    gamma: f64,
    /// Face towards the light
    #[arg(long, value_enum, default_value_t = Side::Adaxial)]
    side: Side,
    /// Angles of incidence in degrees, by commas
    #[arg(long, value_delimiter = ',', default_value = "45")]
    incidence_deg: Vec<f64>,
    /// Wavelength in nm (400 to 2500)
    #[arg(long, default_value_t = 550.0)]
    wavelength_nm: f64,
    /// Rays per incidence, such as 1e7
    #[arg(long, value_parser = whole_number, default_value = "1e6")]
    rays: u64,
    /// Patches of the whole sphere along the latitude (even)
    #[arg(long, default_value_t = 20)]
    latitudes: usize,
    /// Patches along the longitude
    #[arg(long, default_value_t = 40)]
    longitudes: usize,
    /// Seed of the rays
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Write BRDF and BTDF in the plane of incidence as an SVG plot
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Write the BRDF of the first incidence over the disk of directions
    #[arg(long, value_name = "FILE.svg")]
    disk_plot: Option<PathBuf>,
    /// Write the histogram of interactions per ray at 450, 550 and 680 nm
    #[arg(long, value_name = "FILE.svg")]
    interactions_plot: Option<PathBuf>,
}

/// Results of a measurement, for the plots, the JSON result and the table.
struct Measured {
    /// Goniograms, one for each angle of incidence.
    grams: Vec<Goniogram>,
    /// Wavelengths in nanometres, each with the counts of its interactions; none for the plates.
    counted: Vec<(f64, Interactions)>,
    /// Number of rays of all incidences together.
    rays: usize,
    seconds: f64,
}

/// Measures the model and writes the results.
pub fn run(args: &GoniophotometerArgs) -> Result<(), Failure> {
    if !(400.0..=2500.0).contains(&args.wavelength_nm) {
        let given = args.wavelength_nm;
        return Err(Failure::Usage(format!("--wavelength-nm is {given}, which is out of range; give 400 to 2500")));
    }
    let measured = measure(args)?;
    write_plots(args, &measured)?;
    args.run.report(&json_result(args, &measured), table(args, &measured).trim_end())
}

/// Measures the model under every incidence.
fn measure(args: &GoniophotometerArgs) -> Result<Measured, Failure> {
    let model = args.tissue.leaf_model(args.model, args.contents.cab, args.contents.car)?;
    let wavelength = Nanometres(args.wavelength_nm);
    let instrument = |incidence_deg: f64| Goniophotometer {
        latitudes: args.latitudes,
        longitudes: args.longitudes,
        incidence_deg,
        face: args.side.into(),
    };
    args.incidence_deg.iter().try_for_each(|&deg| instrument(deg).check())?;
    let started = Instant::now();
    let rays = args.rays;
    let total = args.incidence_deg.len() * rays as usize;
    let (grams, counted): (Vec<Goniogram>, Vec<(f64, Interactions)>) = match (model, model.tissue()) {
        (_, Some(tissue)) => {
            let grams = args.run.work("goniophotometer", "rays", total, |progress| {
                let measured = args.incidence_deg.iter().enumerate().map(|(i, &deg)| {
                    let onwards = |done: usize, _: usize| progress(i * rays as usize + done, total);
                    instrument(deg).measure(tissue, wavelength, rays, args.seed, &onwards)
                });
                measured.collect()
            })?;
            let first = instrument(args.incidence_deg[0]);
            let counted = [450.0, 550.0, 680.0]
                .map(|nm| Ok((nm, first.interactions(tissue, Nanometres(nm), INTERACTION_RAYS, args.seed)?)));
            (grams, counted.into_iter().collect::<Result<_, Failure>>()?)
        }
        (model, None) => {
            let (inside, lobe) = plate_and_gloss(args, &model)?;
            let measured = args.incidence_deg.iter().map(|&deg| instrument(deg).measure_plate(inside, &lobe));
            (measured.collect::<Result<_, _>>()?, Vec::new())
        }
    };
    Ok(Measured { grams, counted, rays: total, seconds: started.elapsed().as_secs_f64() })
}

/// Writes the plots that were asked for.
fn write_plots(args: &GoniophotometerArgs, Measured { grams, counted, .. }: &Measured) -> Result<(), Failure> {
    let in_plane = |pick: fn(&Goniogram) -> &[f64]| -> Vec<Series> {
        let label = |deg: &f64| format!("incidence {deg}\u{b0}");
        let angles = args.incidence_deg.iter().zip(grams);
        angles.map(|(deg, gram)| Series { label: label(deg), points: gram.in_plane(pick(gram)) }).collect()
    };
    if let Some(path) = &args.plot {
        let title = format!("{}, {} face, {} nm", args.model, side_name(args.side), args.wavelength_nm);
        write_text(path, &goniogram_svg(&title, "1/sr", &in_plane(|g| &g.brdf), &in_plane(|g| &g.btdf)))?;
    }
    if let Some(path) = &args.disk_plot {
        let title =
            format!("BRDF, {}, light at {}\u{b0}, {} nm", args.model, args.incidence_deg[0], args.wavelength_nm);
        write_text(path, &disk_svg(&title, args.latitudes / 2, args.longitudes, &grams[0].brdf))?;
    }
    if let (Some(path), false) = (&args.interactions_plot, counted.is_empty()) {
        let series: Vec<Series> = counted
            .iter()
            .map(|(nm, counts)| Series {
                label: format!("{nm} nm, mean {:.1}", counts.mean),
                points: counts.counts.iter().take(51).enumerate().map(|(n, c)| (n as f64, *c as f64)).collect(),
            })
            .collect();
        let title = format!("{}: interfaces met by {INTERACTION_RAYS} rays", args.model);
        write_text(path, &counts_svg(&title, "interactions per ray", "rays", &series))?;
    }
    Ok(())
}

/// Returns the result for `--json`.
fn json_result(args: &GoniophotometerArgs, Measured { grams, counted, rays, seconds }: &Measured) -> Value {
    let goniograms: Vec<_> = args
        .incidence_deg
        .iter()
        .zip(grams)
        .map(|(deg, gram)| {
            let rows = |values: &[f64]| values.chunks(args.longitudes).map(<[f64]>::to_vec).collect::<Vec<_>>();
            json!({
                "incidence_deg": deg,
                "theta_deg": gram.theta_deg,
                "phi_deg": gram.phi_deg,
                "brdf": rows(&gram.brdf),
                "btdf": rows(&gram.btdf),
                "brdf_standard_error": rows(&gram.brdf_error),
                "btdf_standard_error": rows(&gram.btdf_error),
                "reflectance": gram.reflectance,
                "transmittance": gram.transmittance,
            })
        })
        .collect();
    let interactions: Vec<_> = counted
        .iter()
        .map(|(nm, counts)| {
            json!({
                "wavelength_nm": nm,
                "rays": INTERACTION_RAYS,
                "mean": counts.mean,
                "percentile_99": counts.percentile_99(),
                "most": counts.most,
                "counts": counts.counts,
            })
        })
        .collect();
    json!({
        "model": args.model.to_string(),
        "side": side_name(args.side),
        "wavelength_nm": args.wavelength_nm,
        "rays": grams.iter().map(|gram| gram.rays).max(),
        "seed": args.seed,
        "seconds": seconds,
        "rays_per_second": *rays as f64 / seconds,
        "goniograms": goniograms,
        "interactions": interactions,
    })
}

/// Returns the figures for a reader, one line per incidence.
fn table(args: &GoniophotometerArgs, Measured { grams, counted, rays, seconds }: &Measured) -> String {
    let mut text = String::from("incidence  reflectance  transmittance  BRDF at the mirror direction\n");
    for (deg, gram) in args.incidence_deg.iter().zip(grams) {
        let plane = gram.in_plane(&gram.brdf);
        let mirror = plane.iter().min_by(|a, b| (a.0 - deg).abs().total_cmp(&(b.0 - deg).abs()));
        let f = mirror.map_or(0.0, |p| p.1);
        text += &format!("{deg:>9}  {:>11.4}  {:>13.4}  {f:>8.4} / sr\n", gram.reflectance, gram.transmittance);
    }
    if !counted.is_empty() {
        text += &format!("{:.2e} rays/s", *rays as f64 / seconds);
    }
    text
}

/// Returns the shares of entered light of plates at the wavelength, and the specular lobe on top of them.
fn plate_and_gloss(args: &GoniophotometerArgs, model: &LeafModel) -> Result<(PlateOptics, CookTorrance), Failure> {
    let plates = match model {
        LeafModel::Plate(plates) => *plates,
        _ => PlateModel::N,
    };
    let contents = args.contents.over(LeafContents::default());
    let table = plates.default_table();
    plates.check(table, &contents)?;
    let nm = args.wavelength_nm;
    let printed = GlossParams { coupling: GlossCoupling::None, ..GlossParams::default() };
    let inside = || -> Result<PlateOptics, Failure> {
        check_wavelengths(&[nm])?;
        let (k, index) = (table.absorption(&contents, nm) / contents.structure, table.index(nm));
        Ok(match (model, plates) {
            (LeafModel::TwoSided(halves), _) => halves.entered(table, &contents, args.side.into(), nm),
            (_, PlateModel::N) => plate_n_inside(k, index, contents.structure)?,
            _ => plate_inside(k, index),
        })
    };
    let (inside, params) = match plates {
        // The printed body holds the surface's reflection already; at its three wavelengths alone.
        PlateModel::Paper => (plate_spectrum(plates, table, &contents, 0.0, &[nm])?[0], printed),
        PlateModel::Exact | PlateModel::N => (inside()?, GlossParams::default()),
    };
    let params = GlossParams { gamma_along: args.gamma, gamma_across: args.gamma, ..params };
    params.check()?;
    Ok((inside, CookTorrance::from_params(&params)))
}
