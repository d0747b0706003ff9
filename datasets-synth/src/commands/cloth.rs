//! `btf-synth cloth`: the capture of woven cloth.

use btf_synth::{ClothParams, FibreParams, Weave, write_cloth_capture};
use clap::{Args, ValueEnum};
use serde_json::json;

use super::arguments::parse_colour;
use super::capture_args::CaptureArgs;
use super::failure::Failure;
use super::run_args::RunArgs;

#[derive(Args)]
#[command(after_help = "Examples:
  btf-synth cloth my-twill
  btf-synth cloth linen --weave plain --plies 1 --warp-colour 0.5,0.45,0.35 --weft-colour 0.5,0.45,0.35
  btf-synth cloth sateen --weave satin --plies 1 --surface-width-deg 7 --warp-colour 0.3,0.02,0.03 --format exr")]
pub struct ClothArgs {
    #[command(flatten)]
    capture: CaptureArgs,
    #[command(flatten)]
    run: RunArgs,
    /// Width and height of the patch in millimetres (1 to 200)
    #[arg(long, default_value_t = 10.0, value_name = "MM")]
    size_mm: f32,
    /// How warp and weft are interlaced
    #[arg(long, value_enum, default_value_t = WeaveArg::Twill)]
    weave: WeaveArg,
    /// Warp yarns per centimetre (4 to 80)
    #[arg(long, default_value_t = 20.0)]
    warp_per_cm: f64,
    /// Weft yarns per centimetre (4 to 80)
    #[arg(long, default_value_t = 18.0)]
    weft_per_cm: f64,
    /// Diffuse albedo of the warp, linear sRGB (each 0 to 0.9)
    #[arg(long, value_name = "R,G,B", default_value = "0.045,0.075,0.19", value_parser = parse_colour)]
    warp_colour: [f64; 3],
    /// Diffuse albedo of the weft, linear sRGB (each 0 to 0.9)
    #[arg(long, value_name = "R,G,B", default_value = "0.58,0.56,0.5", value_parser = parse_colour)]
    weft_colour: [f64; 3],
    /// Thickness of a yarn over its width (0.2 to 1)
    #[arg(long, default_value_t = 0.5)]
    flatness: f64,
    /// Twist of the yarn in degrees, the sign its sense (-50 to 50)
    #[arg(long, default_value_t = 32.0, allow_negative_numbers = true)]
    twist_deg: f64,
    /// Strands that a yarn is plied of (1 to 4)
    #[arg(long, default_value_t = 2)]
    plies: u32,
    /// Height of the smallest bumps in micrometres (0 to 30)
    #[arg(long, default_value_t = 3.0)]
    fuzz_um: f64,
    /// How much yarns differ and wander (0 to 1)
    #[arg(long, default_value_t = 0.35)]
    irregularity: f64,
    /// Refractive index of the fibre (1.2 to 2)
    #[arg(long, default_value_t = 1.53)]
    fibre_index: f64,
    /// Width of the highlight along a fibre in degrees (4 to 40)
    #[arg(long, default_value_t = 14.0)]
    surface_width_deg: f64,
    /// Width of the scattering inside a fibre in degrees (4 to 60)
    #[arg(long, default_value_t = 28.0)]
    volume_width_deg: f64,
    /// Leave out light that comes by way of other yarns
    #[arg(long)]
    no_bounce: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum WeaveArg {
    /// Over one, under one
    Plain,
    /// Over two, under two: diagonal ribs
    Twill,
    /// Warp over four, under one: long floats
    Satin,
}

/// Writes the capture.
pub fn run(args: &ClothArgs) -> Result<(), Failure> {
    let params = ClothParams {
        capture: args.capture.params(args.size_mm)?,
        weave: match args.weave {
            WeaveArg::Plain => Weave::Plain,
            WeaveArg::Twill => Weave::Twill,
            WeaveArg::Satin => Weave::Satin,
        },
        warp_per_cm: args.warp_per_cm,
        weft_per_cm: args.weft_per_cm,
        flatness: args.flatness,
        twist_deg: args.twist_deg,
        plies: args.plies,
        fuzz_um: args.fuzz_um,
        irregularity: args.irregularity,
        warp_colour: args.warp_colour,
        weft_colour: args.weft_colour,
        fibre: FibreParams {
            index: args.fibre_index,
            surface_width_deg: args.surface_width_deg,
            volume_width_deg: args.volume_width_deg,
            ..FibreParams::default()
        },
        bounce: !args.no_bounce,
    };
    params.check()?;
    args.capture.photograph(
        &args.run,
        "cloth",
        &params.capture,
        &json!({ "weave": params.weave.to_string() }),
        |dir, progress| write_cloth_capture(dir, &params, progress),
    )
}
