//! `btf-synth leaf`: the capture of a leaf.

use std::time::Instant;

use btf_synth::{
    GlossCoupling, GlossForm, GlossParams, LeafContents, LeafParams, Passage, RgbBands, write_leaf_capture,
};
use clap::{Args, ValueEnum};
use serde_json::json;

use super::model::{ContentsArgs, Model, Side, TissueArgs};
use super::{CaptureArgs, Failure, RunArgs};

#[derive(Args)]
#[command(after_help = "Examples:
  btf-synth leaf my-leaf
  btf-synth leaf autumn --size 128 --cab 5 --car 12 --cbrown 0.3 --seed 7
  btf-synth leaf back --model abm97 --side abaxial
  btf-synth leaf through --transmission
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
    #[arg(long, value_enum, default_value_t = Model::PlateN)]
    model: Model,
    /// Face that is seen
    #[arg(long, value_enum, default_value_t = Side::Adaxial)]
    side: Side,
    /// Put the lights behind the leaf: angles above 90 degrees
    #[arg(long)]
    transmission: bool,
    /// Wavelengths of the plate models' colour: 400 to 700 nm every 10 nm, or 675, 546 and 435 nm
    #[arg(long, value_enum, default_value_t = Bands::Spectral)]
    bands: Bands,
    /// Roughness of the plates' gloss (0.05 to 1)
    #[arg(long, default_value_t = 0.3)]
    gamma: f64,
    /// Roughness across the veins, where it differs from --gamma along them
    #[arg(long)]
    gamma_across: Option<f64>,
    /// Gloss with the printed factor, four times too bright
    #[arg(long)]
    legacy_4x: bool,
    /// Add the gloss on top of the body instead of taking from it what the gloss reflects
    #[arg(long)]
    uncoupled: bool,
    #[command(flatten)]
    contents: ContentsArgs,
    #[command(flatten)]
    tissue: TissueArgs,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Bands {
    Spectral,
    Three,
}

/// Writes the capture.
pub fn run(args: &LeafArgs) -> Result<(), Failure> {
    let directions = args.capture.direction_set()?;
    let params = LeafParams {
        size: args.capture.size,
        size_mm: args.size_mm,
        model: args.tissue.leaf_model(args.model, args.contents.cab, args.contents.car)?,
        contents: args.contents.over(LeafContents::default()),
        bands: match args.bands {
            Bands::Spectral => RgbBands::Spectral31,
            Bands::Three => RgbBands::ThreeWavelength,
        },
        side: args.side.into(),
        passage: if args.transmission { Passage::Transmission } else { Passage::Reflection },
        gloss: GlossParams {
            gamma_along: args.gamma,
            gamma_across: args.gamma_across.unwrap_or(args.gamma),
            form: if args.legacy_4x { GlossForm::Legacy4x } else { GlossForm::Corrected },
            coupling: if args.uncoupled { GlossCoupling::None } else { GlossCoupling::Energy },
            ..GlossParams::default()
        },
        seed: args.capture.seed,
        views: directions.clone(),
        lights: directions,
        format: args.capture.format.into(),
    };
    params.check()?;
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
        "model": args.model.to_string(),
        "side": params.capture_side().to_string(),
        "seed": params.seed,
    });
    args.run.report(&result, &format!("{}: {images} images in {seconds:.1} s", out_dir.display()))
}
