//! Subcommands, one file each.

mod arguments;
mod capture_args;
mod cloth;
mod failure;
mod goniophotometer;
mod invert;
mod invert_maps;
mod leaf;
mod leaf_file;
mod leaf_look;
mod leather;
mod model;
mod plants;
mod run_args;
mod scatter;
mod spectrum;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use failure::Failure;

/// Makes synthetic BTF captures and measures the leaf models behind them.
#[derive(Parser)]
#[command(name = "btf-synth", version, after_help = "Example: btf-synth leaf my-leaf --size 128 --cab 25")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Photograph woven cloth: yarns, plies and fibres.
    Cloth(cloth::ClothArgs),
    /// Photograph a leaf: veins, relief, pigments and gloss.
    Leaf(leaf::LeafArgs),
    /// Find the contents of leaves from their measured spectra.
    Invert(invert::InvertArgs),
    /// Measure spectral reflectance and transmittance of a leaf model.
    Spectrum(spectrum::SpectrumArgs),
    /// Measure BRDF and BTDF of a leaf model over the sphere.
    Goniophotometer(goniophotometer::GoniophotometerArgs),
    /// Trace the table of an algorithmic leaf model, by which btf-view draws the model live.
    Scatter(scatter::ScatterArgs),
    /// Photograph pebbled leather: grain, creases, pores and finish.
    Leather(leather::LeatherArgs),
    /// Grow maize, soybean, trees, spruces or grass: meshes and instances as a glTF file, or a script of shapes.
    Plants(plants::PlantsArgs),
}

/// Runs the command that the program was started with.
pub fn run() -> ExitCode {
    let cli = Cli::parse();
    let result = match cli.command {
        Command::Cloth(args) => cloth::run(&args),
        Command::Invert(args) => invert::run(&args),
        Command::Leaf(args) => leaf::run(&args),
        Command::Spectrum(args) => spectrum::run(&args),
        Command::Goniophotometer(args) => goniophotometer::run(&args),
        Command::Leather(args) => leather::run(&args),
        Command::Plants(args) => plants::run(&args),
        Command::Scatter(args) => scatter::run(&args),
    };
    let (sentence, code) = match result {
        Ok(()) => return ExitCode::SUCCESS,
        Err(Failure::Usage(sentence)) => (sentence, 2),
        Err(Failure::Failed(sentence)) => (sentence, 1),
        Err(Failure::Interrupted) => ("interrupted; nothing was written".into(), 130),
    };
    eprintln!("error: {sentence}");
    ExitCode::from(code)
}
