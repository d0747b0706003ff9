//! `btf-synth leaf`: the capture of a leaf.

use std::time::Instant;

use btf_synth::{LeafContents, LeafParams, write_leaf_capture};
use clap::{Args, ValueEnum};
use serde_json::json;

use super::{CaptureArgs, Failure, RunArgs};

#[derive(Args)]
#[command(after_help = "Examples:
  btf-synth leaf my-leaf
  btf-synth leaf autumn --size 128 --cab 5 --car 12 --cbrown 0.3 --seed 7
  btf-synth leaf hdr-leaf --format exr --directions dome151 --json leaf.json")]
pub struct LeafArgs {
    #[command(flatten)]
    capture: CaptureArgs,
    #[command(flatten)]
    run: RunArgs,
    /// Width and height of the patch in millimetres (1 to 200)
    #[arg(long, default_value_t = 20.0, value_name = "MM")]
    size_mm: f32,
    /// Model of the blade's optics
    #[arg(long, value_enum, default_value_t = Model::PlateExact)]
    model: Model,
    /// Chlorophyll a + b in ug/cm2 (0 to 100)
    #[arg(long, default_value_t = 40.0)]
    cab: f64,
    /// Carotenoids in ug/cm2 (0 to 25)
    #[arg(long, default_value_t = 8.0)]
    car: f64,
    /// Brown pigment in arbitrary units (0 to 1)
    #[arg(long, default_value_t = 0.0)]
    cbrown: f64,
    /// Dry matter in g/cm2 (0 to 0.02)
    #[arg(long, default_value_t = 0.005)]
    cm: f64,
    /// Water in cm (0 to 0.04)
    #[arg(long, default_value_t = 0.01)]
    cw: f64,
    /// Structure parameter N (1 to 3)
    #[arg(long, default_value_t = 1.5)]
    n: f64,
    /// Roughness of the gloss (0.05 to 1)
    #[arg(long, default_value_t = 0.3)]
    gamma: f64,
}

#[derive(Clone, Copy, ValueEnum)]
enum Model {
    /// One absorbing plate, exact equations, spectral index
    PlateExact,
}

/// Writes the capture.
pub fn run(args: &LeafArgs) -> Result<(), Failure> {
    let directions = args.capture.direction_set()?;
    let params = LeafParams {
        size: args.capture.size,
        size_mm: args.size_mm,
        contents: LeafContents {
            chlorophyll_ug_per_cm2: args.cab,
            carotenoid_ug_per_cm2: args.car,
            anthocyanin_ug_per_cm2: 0.0,
            brown: args.cbrown,
            water_cm: args.cw,
            dry_matter_g_per_cm2: args.cm,
            structure: args.n,
        },
        roughness: args.gamma,
        seed: args.capture.seed,
        views: directions.clone(),
        lights: directions,
        format: args.capture.format.into(),
    };
    params.check()?;
    let Model::PlateExact = args.model;
    let started = Instant::now();
    let images = params.views.len() * params.lights.len();
    let out_dir = &args.capture.out_dir;
    args.run.work("leaf", "images", images, |progress| write_leaf_capture(out_dir, &params, progress))?;
    let seconds = started.elapsed().as_secs_f64();
    let result = json!({
        "path": out_dir.display().to_string(),
        "images": images,
        "seconds": seconds,
        "width": params.size,
        "height": params.size,
        "views": params.views.len(),
        "lights": params.lights.len(),
        "size_mm": params.size_mm,
        "format": params.format.to_string(),
        "model": "plate-exact",
        "seed": params.seed,
    });
    args.run.report(&result, &format!("{}: {images} images in {seconds:.1} s", out_dir.display()))
}
