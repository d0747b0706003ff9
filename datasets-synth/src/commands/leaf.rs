//! `btf-synth leaf`: the capture of a leaf.

use btf_synth::{
    CaptureParams, GlossCoupling, GlossForm, GlossParams, LeafParams, Passage, RgbBands, write_leaf_capture,
};
use clap::{Args, ValueEnum};
use serde_json::json;

use super::capture_args::CaptureArgs;
use super::failure::Failure;
use super::leaf_look::{LookArgs, Looked};
use super::model::{ContentsArgs, Model, Side, TissueArgs};
use super::run_args::RunArgs;

#[derive(Args)]
#[command(after_help = "Examples:
  btf-synth leaf my-leaf
  btf-synth leaf autumn --size 128 --cab 5 --car 12 --cbrown 0.3 --seed 7
  btf-synth leaf maize --species maize --deficiency magnesium --severity 0.8
  btf-synth leaf beech --species tree --export-textures beech-textures
  btf-synth leaf mine --textures beech-textures
  btf-synth leaf mine --cab 55 --write-leaf leaf.toml
  btf-synth leaf again --leaf leaf.toml --size 512
  btf-synth leaf back --model abm97 --side abaxial
  btf-synth leaf through --transmission
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
    size_mm: Option<f64>,
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
    /// Roughness of the plates' gloss (0.05 to 1) [default: the species', otherwise 0.3]
    #[arg(long)]
    gamma: Option<f64>,
    /// Roughness across the veins, where it differs from --gamma along them [default: the species', or --gamma]
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
    let looked = describe(args)?;
    let leaf = &looked.leaf;
    let whole = looked.own_pigments.then_some(&leaf.contents);
    let [cab, car] = args.contents.own_pigments(whole);
    let described = LeafParams::described(leaf, looked.images()?);
    let params = LeafParams {
        capture: CaptureParams { seed: leaf.seed, ..args.capture.params(leaf.size_mm as f32)? },
        model: args.tissue.leaf_model(args.model, cab, car)?,
        bands: match args.bands {
            Bands::Spectral => RgbBands::Spectral31,
            Bands::Three => RgbBands::ThreeWavelength,
        },
        side: args.side.into(),
        passage: if args.transmission { Passage::Transmission } else { Passage::Reflection },
        gloss: GlossParams {
            form: if args.legacy_4x { GlossForm::Legacy4x } else { GlossForm::Corrected },
            coupling: if args.uncoupled { GlossCoupling::None } else { GlossCoupling::Energy },
            ..described.gloss
        },
        ..described
    };
    params.check()?;
    let textures = args.look.export(&looked, &params)?;
    let more = json!({
        "model": args.model.to_string(),
        "side": params.capture_side().to_string(),
        "species": params.look.species.map(|species| species.name()),
        "textures": textures.map(|dir| dir.display().to_string()),
    });
    args.capture.photograph(&args.run, "leaf", &params.capture, &more, |dir, progress| {
        write_leaf_capture(dir, &params, progress)
    })
}

/// Returns the leaf that the options describe.
fn describe(args: &LeafArgs) -> Result<Looked, Failure> {
    let mut looked = args.look.leaf()?;
    let leaf = &mut looked.leaf;
    leaf.contents = args.contents.over(leaf.contents);
    leaf.gloss.gamma_along = args.gamma.unwrap_or(leaf.gloss.gamma_along);
    leaf.gloss.gamma_across = args.gamma_across.or(args.gamma).unwrap_or(leaf.gloss.gamma_across);
    leaf.size_mm = args.size_mm.unwrap_or(leaf.size_mm);
    leaf.seed = args.capture.seed.unwrap_or(leaf.seed);
    Ok(looked)
}
