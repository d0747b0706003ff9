//! `btf-synth invert`: the contents of leaves from their measured spectra.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use btf_synth::{
    Inversion, InversionParams, Inverter, LeafSpectra, LinePlot, PROSPECT_CONE_DEG, SHARES, Series, SynthError,
    Unknown, read_spectra, significant,
};
use clap::Args;
use rayon::prelude::*;
use serde_json::{Map, Value, json};

use super::arguments::whole_number;
use super::failure::Failure;
use super::invert_maps;
use super::model::{Model, Side, TissueArgs};
use super::run_args::{RunArgs, write_text};

#[derive(Args)]
#[command(after_help = "Examples:
  btf-synth invert leaves.csv
  btf-synth invert leaves.csv --hold cbrown=0,cant=0 --csv contents.csv --plots fits
  btf-synth invert percent.csv --percent --model abm-b --side abaxial --json -
  btf-synth invert both-faces.csv --model plate-two-sided
  btf-synth invert --capture LEAF --capture LEAF-FROM-BEHIND -o leaf")]
pub struct InvertArgs {
    /// Tables of spectra (CSV): wavelengths in nm in the first column and a share of light of a leaf in each other one,
    /// or a leaf's share in each row
    #[arg(required_unless_present = "captures", value_name = "SPECTRA.csv")]
    files: Vec<PathBuf>,
    /// Capture of a leaf (with another one, lit from behind): maps of its contents, as textures of a leaf file
    #[arg(long = "capture", value_name = "CAPTURE", requires = "out",
        conflicts_with_all = ["files", "model", "percent", "side", "cone_deg", "independent", "rays", "seed", "csv", "plots"])]
    captures: Vec<PathBuf>,
    /// New folder for leaf.toml, its textures and their standard errors
    #[arg(short = 'o', long, value_name = "DIR", requires = "captures")]
    out: Option<PathBuf>,
    /// Model of the leaf's optics: plate-n, plate-two-sided, abm97, abm-b or abm-u
    #[arg(long, value_enum, default_value_t = Model::PlateN)]
    model: Model,
    /// Values that are known, such as cbrown=0,cw=0.012 (cab, car, cant, cbrown, cw, cm, n; palisade-layers,
    /// palisade-pigments, palisade-body of plate-two-sided; rest of algorithmic models)
    #[arg(long, value_name = "KEY=VALUE", value_delimiter = ',')]
    hold: Vec<String>,
    /// Values of the tables are percent
    #[arg(long)]
    percent: bool,
    /// Face that was lit where a table names none, as the words adaxial and abaxial do
    #[arg(long, value_enum, default_value_t = Side::Adaxial)]
    side: Side,
    /// Half-angle of the cone of incident light in degrees, plates only
    #[arg(long, default_value_t = PROSPECT_CONE_DEG)]
    cone_deg: f64,
    /// Take errors at neighbouring wavelengths for independent, as plain least squares do
    #[arg(long)]
    independent: bool,
    #[command(flatten)]
    tissue: TissueArgs,
    #[command(flatten)]
    run: RunArgs,
    /// Rays of each trace of an algorithmic model, such as 1e6
    #[arg(long, value_parser = whole_number, default_value = "2e5")]
    rays: u64,
    /// Seed of the rays
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Write the contents as a table, one row a leaf
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// Write measured and fitted spectra as an SVG plot for each leaf into a folder
    #[arg(long, value_name = "DIR")]
    plots: Option<PathBuf>,
}

/// Finds the contents and writes the results.
pub fn run(args: &InvertArgs) -> Result<(), Failure> {
    let mut params = params(args)?;
    if let Some(out) = &args.out {
        return invert_maps::run(&args.captures, out, &params.unknowns(), &params.held, &args.run);
    }
    let mut leaves = Vec::new();
    let mut notes = Vec::new();
    for file in &args.files {
        let read = read_spectra(file, if args.percent { 0.01 } else { 1.0 }, args.side.into());
        let read = read.map_err(|error| match error {
            SynthError::BadSpectra { path, reason } if reason.contains("percent") && !args.percent => {
                SynthError::BadSpectra { path, reason: format!("{reason}, or give --percent") }
            }
            other => other,
        })?;
        let name = file.display();
        if read.gaps > 0 {
            notes.push(format!("{name} has {} cells without a measurement", read.gaps));
        }
        if !read.left_out.is_empty() {
            notes.push(format!("nothing was measured of {} in {name}", read.left_out.join(", ")));
        }
        leaves.extend(read.leaves);
    }
    params.faces = [0, 1].map(|face| leaves.iter().any(|leaf| leaf.faces()[face]));
    let started = Instant::now();
    let groups = groups(&leaves);
    let done = AtomicUsize::new(0);
    let found: Vec<Found> = args.run.work("invert", "leaves", leaves.len(), |progress| {
        let inverters: Vec<Inverter> = groups
            .firsts
            .iter()
            .map(|first| Inverter::new(&params, &leaves[*first].wavelengths_nm))
            .collect::<Result<_, _>>()?;
        let invert = |(leaf, group): (&LeafSpectra, &usize)| {
            let inverter = &inverters[*group];
            let found = inverter.invert(leaf);
            let done = 1 + done.fetch_add(1, Ordering::Relaxed);
            if progress(done, leaves.len()).is_break() {
                return Err(SynthError::Stopped);
            }
            let fitted = if args.plots.is_some() { inverter.spectra_of(&found.values) } else { Default::default() };
            Ok(Found { inversion: found, fitted })
        };
        leaves.par_iter().zip(&groups.of_leaf).map(invert).collect()
    })?;
    let seconds = started.elapsed().as_secs_f64();
    let unknowns = &params.unknowns();
    let rows: Vec<(&LeafSpectra, &Inversion)> = leaves.iter().zip(found.iter().map(|found| &found.inversion)).collect();
    if let Some(file) = &args.csv {
        write_text(file, &csv(unknowns, &rows))?;
    }
    if let Some(folder) = &args.plots {
        write_plots(folder, args, &leaves, &found)?;
    }
    let result = json!({
        "model": args.model.to_string(),
        "unknowns": unknowns.iter().map(|unknown| unknown.key).collect::<Vec<_>>(),
        "leaves": rows.iter().map(|(leaf, found)| figures(unknowns, leaf, found)).collect::<Vec<_>>(),
        "notes": notes,
        "seconds": seconds,
    });
    let notes: String = notes.iter().map(|note| format!("\nnote: {note}")).collect();
    args.run.report(&result, &(table(unknowns, &rows) + &notes))
}

/// Result of a leaf, with the model's spectra where plots are asked for.
struct Found {
    inversion: Inversion,
    fitted: [Vec<f64>; SHARES],
}

fn params(args: &InvertArgs) -> Result<InversionParams, Failure> {
    let model = args.tissue.leaf_model(args.model, None, None)?;
    if !(0.0..=90.0).contains(&args.cone_deg) {
        return Err(Failure::Usage(format!("--cone-deg is {}; give 0 to 90", args.cone_deg)));
    }
    let mut params = InversionParams {
        model,
        cone_deg: args.cone_deg,
        rays: args.rays.max(1),
        seed: args.seed,
        correlated: !args.independent,
        ..InversionParams::default()
    };
    for pair in &args.hold {
        let known = params.unknowns();
        let options = || known.iter().map(|unknown| unknown.option).collect::<Vec<_>>().join(", ");
        let held = pair.split_once('=').and_then(|(key, value)| {
            let at = known.iter().position(|unknown| unknown.option == key.trim())?;
            Some((at, value.trim().parse::<f64>().ok().filter(|value| value.is_finite())?))
        });
        let (at, value) = held.ok_or_else(|| {
            Failure::Usage(format!(
                "--hold {pair} is no KEY=VALUE with a number and one of {} for {}",
                options(),
                args.model
            ))
        })?;
        params.held[at] = Some(value);
    }
    Ok(params)
}

/// Leaves that share their wavelengths.
struct Groups {
    /// A leaf of each group.
    firsts: Vec<usize>,
    /// Group of each leaf.
    of_leaf: Vec<usize>,
}

fn groups(leaves: &[LeafSpectra]) -> Groups {
    let mut groups = Groups { firsts: Vec::new(), of_leaf: Vec::new() };
    for (i, leaf) in leaves.iter().enumerate() {
        let same = |first: &usize| leaves[*first].wavelengths_nm == leaf.wavelengths_nm;
        // Most tables have one.
        let group = groups.firsts.iter().rposition(same).unwrap_or_else(|| {
            groups.firsts.push(i);
            groups.firsts.len() - 1
        });
        groups.of_leaf.push(group);
    }
    groups
}

/// Returns the JSON form of a leaf's result.
fn figures(unknowns: &[Unknown], leaf: &LeafSpectra, found: &Inversion) -> Value {
    let content = |i: usize| {
        json!({
            "value": found.values[i],
            "standard_error": told_error(found, i),
            "state": found.states[i].name(),
        })
    };
    let contents: Map<String, Value> =
        unknowns.iter().enumerate().map(|(i, unknown)| (unknown.key.to_owned(), content(i))).collect();
    let count = unknowns.len();
    json!({
        "name": leaf.name,
        "contents": contents,
        "correlations": found.correlations[..count].iter().map(|row| &row[..count]).collect::<Vec<_>>(),
        "rmse_reflectance": found.rmse[0],
        "rmse_transmittance": found.rmse[1],
        "rmse_abaxial_reflectance": found.rmse[2],
        "rmse_abaxial_transmittance": found.rmse[3],
        "remarks": found.remarks,
    })
}

/// Returns a row for each leaf.
fn csv(unknowns: &[Unknown], rows: &[(&LeafSpectra, &Inversion)]) -> String {
    let mut text = String::from("name");
    for unknown in unknowns {
        text += &format!(",{0},{0}_standard_error,{0}_state", unknown.key);
    }
    text += ",rmse_reflectance,rmse_transmittance,rmse_abaxial_reflectance,rmse_abaxial_transmittance,remarks\n";
    for (leaf, found) in rows {
        text += &quoted(&leaf.name);
        for i in 0..unknowns.len() {
            let error = told_error(found, i).map_or_else(String::new, |error| error.to_string());
            text += &format!(",{},{error},{}", found.values[i], found.states[i].name());
        }
        for rmse in found.rmse {
            text += &rmse.map_or_else(|| ",".to_owned(), |rmse| format!(",{rmse}"));
        }
        text += &format!(",{}\n", quoted(&found.remarks.join("; ")));
    }
    text
}

/// Returns a standard error, which what was not found has none of, as JSON has no NaN.
fn told_error(found: &Inversion, i: usize) -> Option<f64> {
    Some(found.standard_errors[i]).filter(|error| error.is_finite())
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

/// Leaves that are written with a line for each content; more get a row each.
const FEW: usize = 4;

/// Returns the results for a reader.
fn table(unknowns: &[Unknown], rows: &[(&LeafSpectra, &Inversion)]) -> String {
    let mut text = String::new();
    if rows.len() <= FEW {
        for (leaf, found) in rows {
            text += &format!("{}, misses its spectra by {}\n", leaf.name, missed(found));
            for (i, unknown) in unknowns.iter().enumerate() {
                let worth = match found.states[i] {
                    state if state.is_found() => format!("+- {}", significant(found.standard_errors[i], 2)),
                    state => format!("({})", state.name()),
                };
                text += &format!(
                    "  {:>10} {:<7} {worth:<12} {}\n",
                    significant(found.values[i], 4),
                    unknown.unit,
                    unknown.name
                );
            }
            text.extend(found.remarks.iter().map(|remark| format!("  note: {remark}\n")));
        }
        return text.trim_end().to_owned();
    }
    let width = rows.iter().map(|(leaf, _)| leaf.name.chars().count()).fold(4, usize::max);
    text += &format!("{:<width$}", "leaf");
    text.extend(unknowns.iter().map(|unknown| format!("  {:>16}", unknown.option)));
    text += "  misses by\n";
    for (leaf, found) in rows {
        text += &format!("{:<width$}", leaf.name);
        for i in 0..unknowns.len() {
            let worth = match found.states[i] {
                state if state.is_found() => {
                    format!("{} +- {}", significant(found.values[i], 4), significant(found.standard_errors[i], 2))
                }
                state => format!("{} {}", significant(found.values[i], 4), state.name()),
            };
            text += &format!("  {worth:>16}");
        }
        text += &format!("  {}\n", missed(found));
    }
    let remarked = rows.iter().filter(|(_, found)| !found.remarks.is_empty()).count();
    if remarked > 0 {
        text += &format!("{remarked} of {} leaves have remarks: --json or --csv tells them\n", rows.len());
    }
    text.trim_end().to_owned()
}

/// Letters of the shares of light in tables and plots.
const LETTERS: [&str; SHARES] = ["R", "T", "abaxial R", "abaxial T"];

fn missed(found: &Inversion) -> String {
    let told =
        found.rmse.iter().zip(LETTERS).filter_map(|(rmse, letter)| rmse.map(|rmse| format!("{rmse:.4} {letter}")));
    told.collect::<Vec<_>>().join(", ")
}

fn write_plots(folder: &Path, args: &InvertArgs, leaves: &[LeafSpectra], found: &[Found]) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)
        .map_err(|error| Failure::Failed(format!("{} cannot be made ({error})", folder.display())))?;
    let mut names = BTreeSet::new();
    for (number, (leaf, Found { fitted, .. })) in leaves.iter().zip(found).enumerate() {
        let plain: String =
            leaf.name.chars().map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '-' }).collect();
        let name = if names.insert(plain.clone()) { plain } else { format!("{plain}-{number}") };
        write_text(&folder.join(format!("{name}.svg")), &plot(args, leaf, fitted))?;
    }
    Ok(())
}

fn plot(args: &InvertArgs, leaf: &LeafSpectra, fitted: &[Vec<f64>; SHARES]) -> String {
    let mut series = Vec::new();
    for (what, (measured, fitted)) in LETTERS.into_iter().zip(leaf.shares.iter().zip(fitted)) {
        if measured.iter().all(|share| share.is_nan()) {
            continue;
        }
        let over = |values: &[f64]| leaf.wavelengths_nm.iter().copied().zip(values.iter().copied()).collect();
        series.push(Series { label: format!("{what}, measured"), points: over(measured) });
        series.push(Series { label: format!("{what}, {}", args.model), points: over(fitted) });
    }
    LinePlot {
        title: leaf.name.clone(),
        x_label: "wavelength in nm".into(),
        y_label: "share of incident light".into(),
        series,
        dashed: Vec::new(),
    }
    .svg()
}
