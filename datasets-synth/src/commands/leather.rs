//! `btf-synth leather`: the capture of pebbled leather.

use btf_synth::{FinishParams, LeatherParams, write_leather_capture};
use clap::Args;
use serde_json::json;

use super::arguments::parse_colour;
use super::capture_args::CaptureArgs;
use super::failure::Failure;
use super::run_args::RunArgs;

#[derive(Args)]
#[command(after_help = "Examples:
  btf-synth leather my-leather
  btf-synth leather black --colour 0.012,0.011,0.011 --grain-mm 0.8 --roughness 0.18
  btf-synth leather suede-like --roughness 0.7 --relief-mm 0.05 --wrinkles 2 --format exr --json leather.json")]
pub struct LeatherArgs {
    #[command(flatten)]
    capture: CaptureArgs,
    #[command(flatten)]
    run: RunArgs,
    /// Width and height of the patch in millimetres (1 to 200)
    #[arg(long, default_value_t = 16.0, value_name = "MM")]
    size_mm: f32,
    /// Colour of the body below the finish, linear sRGB (each 0.002 to 0.8)
    #[arg(long, value_name = "R,G,B", default_value = "0.24,0.095,0.038", value_parser = parse_colour)]
    colour: [f64; 3],
    /// Mean size of a pebble in millimetres (0.2 to 10)
    #[arg(long, default_value_t = 1.1, value_name = "MM")]
    grain_mm: f64,
    /// Height of a pebble in millimetres (0 to 1)
    #[arg(long, default_value_t = 0.14, value_name = "MM")]
    relief_mm: f64,
    /// Strength of the fine wrinkles (0 to 3)
    #[arg(long, default_value_t = 1.0)]
    wrinkles: f64,
    /// Share of the hair follicles that show (0 to 1)
    #[arg(long, default_value_t = 0.45)]
    pores: f64,
    /// How much more pigment lies in the creases (0 to 2)
    #[arg(long, default_value_t = 0.6)]
    antique: f64,
    /// Refractive index of the finish (1.05 to 3)
    #[arg(long, default_value_t = 1.49)]
    finish_index: f64,
    /// Roughness of the whole finish (0.03 to 1)
    #[arg(long, default_value_t = 0.24)]
    roughness: f64,
    /// Roughness of the broken finish in the creases (0.03 to 1)
    #[arg(long, default_value_t = 0.5)]
    broken_roughness: f64,
    /// Length of the highlight's tail (1.55, long, to 20)
    #[arg(long, default_value_t = 2.6)]
    tail: f64,
    /// Leave out light that comes by way of other pebbles
    #[arg(long)]
    no_bounce: bool,
}

/// Writes the capture.
pub fn run(args: &LeatherArgs) -> Result<(), Failure> {
    let params = LeatherParams {
        capture: args.capture.params(args.size_mm)?,
        grain_mm: args.grain_mm,
        relief_mm: args.relief_mm,
        wrinkles: args.wrinkles,
        pores: args.pores,
        colour: args.colour,
        antique: args.antique,
        finish: FinishParams {
            index: args.finish_index,
            roughness: args.roughness,
            broken_roughness: args.broken_roughness,
            tail: args.tail,
        },
        bounce: !args.no_bounce,
    };
    params.check()?;
    args.capture.photograph(&args.run, "leather", &params.capture, &json!({}), |dir, progress| {
        write_leather_capture(dir, &params, progress)
    })
}
