//! `btf-synth leaf`: the capture of a leaf.

use btf_capture::MAX_BANDS;
use btf_synth::{
    CaptureParams, GlossCoupling, GlossForm, GlossParams, LeafParams, Passage, RgbBands, write_leaf_capture,
};
use clap::Args;
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
  btf-synth leaf spectral --bands 31 --size 128
  btf-synth leaf red-edge --bands 31 --to-nm 1000 --model abm-b
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
    /// Number of spectral bands of the capture, evenly from --from-nm to --to-nm, written as EXR files; or the wavelengths of
    /// the plate models' colour: `spectral` for 400 to 700 nm every 10 nm, `three` for 675, 546 and 435 nm
    #[arg(long, value_name = "N|spectral|three", default_value = "spectral", value_parser = bands)]
    bands: Bands,
    /// First band in nm (400 to 2500)
    #[arg(long, value_name = "NM", default_value_t = 400.0)]
    from_nm: f64,
    /// Last band in nm
    #[arg(long, value_name = "NM", default_value_t = 700.0)]
    to_nm: f64,
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

#[derive(Clone, Copy, PartialEq, Eq)]
enum Bands {
    Spectral,
    Three,
    Count(usize),
}

fn bands(text: &str) -> Result<Bands, String> {
    match (text, text.parse()) {
        ("spectral", _) => Ok(Bands::Spectral),
        ("three", _) => Ok(Bands::Three),
        (_, Ok(count @ 2..=MAX_BANDS)) => Ok(Bands::Count(count)),
        _ => Err(format!("give a number of bands from 2 to {MAX_BANDS}, spectral or three")),
    }
}

impl LeafArgs {
    /// Returns the bands of the capture in nanometres; none for colours.
    fn wavelengths_nm(&self) -> Result<Vec<f64>, Failure> {
        let Bands::Count(count) = self.bands else { return Ok(Vec::new()) };
        let (from, to) = (self.from_nm, self.to_nm);
        if from.partial_cmp(&to) != Some(std::cmp::Ordering::Less) {
            return Err(Failure::Usage(format!("--from-nm {from} is not below --to-nm {to}; give a lower one")));
        }
        // Hundredths of a nanometre, as files name them.
        let at = |i: usize| (100.0 * (from + (to - from) * i as f64 / (count - 1) as f64)).round() / 100.0;
        Ok((0..count).map(at).collect())
    }
}

/// Writes the capture.
pub fn run(args: &LeafArgs) -> Result<(), Failure> {
    let looked = describe(args)?;
    let leaf = &looked.leaf;
    let whole = looked.own_pigments.then_some(&leaf.contents);
    let [cab, car] = args.contents.own_pigments(whole);
    let described = LeafParams::described(leaf, looked.images()?);
    let wavelengths_nm = args.wavelengths_nm()?;
    let mut capture = CaptureParams { seed: leaf.seed, ..args.capture.params(leaf.size_mm as f32)? };
    if !wavelengths_nm.is_empty() {
        capture.format = args.capture.format_of_bands()?;
    }
    let params = LeafParams {
        capture,
        wavelengths_nm,
        model: args.tissue.leaf_model(args.model, cab, car)?,
        bands: match args.bands {
            Bands::Spectral | Bands::Count(_) => RgbBands::Spectral31,
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
