//! `btf-synth leaf`: the capture of a leaf.

use std::time::Instant;

use btf_synth::{LeafContents, LeafFace, LeafParams, write_leaf_capture};
use clap::{Args, ValueEnum};
use serde_json::json;

use super::leaf_look::LookArgs;
use super::{CaptureArgs, Failure, RunArgs};

#[derive(Args)]
#[command(after_help = "Examples:
  btf-synth leaf my-leaf
  btf-synth leaf autumn --size 128 --cab 5 --car 12 --cbrown 0.3 --seed 7
  btf-synth leaf maize --species maize --deficiency magnesium --severity 0.8
  btf-synth leaf beech --species tree --export-textures beech-textures
  btf-synth leaf mine --textures beech-textures
  btf-synth leaf hdr-leaf --format exr --directions dome151 --json leaf.json")]
pub struct LeafArgs {
    #[command(flatten)]
    capture: CaptureArgs,
    #[command(flatten)]
    run: RunArgs,
    #[command(flatten)]
    look: LookArgs,
    /// Width and height of the patch in millimetres (1 to 200) [default: the species', otherwise 20]
    #[arg(long, value_name = "MM")]
    size_mm: Option<f32>,
    /// Model of the blade's optics
    #[arg(long, value_enum, default_value_t = Model::PlateExact)]
    model: Model,
    /// Face that is seen
    #[arg(long, value_enum, default_value_t = Side::Adaxial)]
    side: Side,
    /// Chlorophyll a + b in ug/cm2 (0 to 100) [default: the species', otherwise 40]
    #[arg(long)]
    cab: Option<f64>,
    /// Carotenoids in ug/cm2 (0 to 25) [default: the species', otherwise 8]
    #[arg(long)]
    car: Option<f64>,
    /// Brown pigment in arbitrary units (0 to 1) [default: 0, and 0.35 in a deficient leaf's dead parts]
    #[arg(long)]
    cbrown: Option<f64>,
    /// Dry matter in g/cm2 (0 to 0.02) [default: 0.005]
    #[arg(long)]
    cm: Option<f64>,
    /// Water in cm (0 to 0.04) [default: 0.01]
    #[arg(long)]
    cw: Option<f64>,
    /// Structure parameter N (1 to 3) [default: the species', otherwise 1.5]
    #[arg(long)]
    n: Option<f64>,
    /// Roughness of the gloss (0.05 to 1) [default: the species', otherwise 0.3]
    #[arg(long)]
    gamma: Option<f64>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Side {
    /// The upper face
    Adaxial,
    /// The lower face, the leaf turned over about the vertical axis
    Abaxial,
}

#[derive(Clone, Copy, ValueEnum)]
enum Model {
    /// One absorbing plate, exact equations, spectral index
    PlateExact,
}

/// Writes the capture.
pub fn run(args: &LeafArgs) -> Result<(), Failure> {
    let directions = args.capture.direction_set()?;
    let preset = args.look.params()?;
    let usual = preset.contents;
    let params = LeafParams {
        size: args.capture.size,
        size_mm: args.size_mm.unwrap_or(preset.size_mm),
        contents: LeafContents {
            chlorophyll_ug_per_cm2: args.cab.unwrap_or(usual.chlorophyll_ug_per_cm2),
            carotenoid_ug_per_cm2: args.car.unwrap_or(usual.carotenoid_ug_per_cm2),
            brown: args.cbrown.unwrap_or(usual.brown),
            water_cm: args.cw.unwrap_or(usual.water_cm),
            dry_matter_g_per_cm2: args.cm.unwrap_or(usual.dry_matter_g_per_cm2),
            structure: args.n.unwrap_or(usual.structure),
        },
        roughness: args.gamma.unwrap_or(preset.roughness),
        face: match args.side {
            Side::Adaxial => LeafFace::Adaxial,
            Side::Abaxial => LeafFace::Abaxial,
        },
        seed: args.capture.seed,
        views: directions.clone(),
        lights: directions,
        format: args.capture.format.into(),
        ..preset
    };
    params.check()?;
    let Model::PlateExact = args.model;
    let started = Instant::now();
    let images = params.views.len() * params.lights.len();
    let out_dir = &args.capture.out_dir;
    let textures = args.look.export(&params)?;
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
        "species": params.look.species.map(|species| species.name()),
        "textures": textures.map(|dir| dir.display().to_string()),
        "seed": params.seed,
    });
    args.run.report(&result, &format!("{}: {images} images in {seconds:.1} s", out_dir.display()))
}
