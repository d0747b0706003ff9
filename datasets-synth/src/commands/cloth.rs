//! `btf-synth cloth`: the capture of woven cloth.

use std::time::Instant;

use btf_synth::{CaptureParams, ClothParams, FibreParams, HEIGHT_MAP_NAME, Weave, write_cloth_capture};
use clap::{Args, ValueEnum};
use serde_json::json;

use super::{CaptureArgs, Failure, RunArgs, parse_colour};

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
    let directions = args.capture.direction_set()?;
    let params = ClothParams {
        capture: CaptureParams {
            size: args.capture.size,
            size_mm: args.size_mm,
            seed: args.capture.seed,
            views: directions.clone(),
            lights: directions,
            format: args.capture.format.into(),
        },
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
    let started = Instant::now();
    let capture = &params.capture;
    let images = capture.views.len() * capture.lights.len();
    let out_dir = &args.capture.out_dir;
    args.run.work("cloth", "images", images, |progress| write_cloth_capture(out_dir, &params, progress))?;
    let seconds = started.elapsed().as_secs_f64();
    let result = json!({
        "path": out_dir.display().to_string(),
        "height_map": out_dir.join(HEIGHT_MAP_NAME).display().to_string(),
        "images": images,
        "seconds": seconds,
        "width": capture.size,
        "height": capture.size,
        "views": capture.views.len(),
        "lights": capture.lights.len(),
        "size_mm": capture.size_mm,
        "format": capture.format.to_string(),
        "weave": params.weave.to_string(),
        "seed": capture.seed,
    });
    args.run.report(&result, &format!("{}: {images} images in {seconds:.1} s", out_dir.display()))
}
