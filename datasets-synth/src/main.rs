//! `btf-synth`: synthetic captures from the command line.

use std::io::Write;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use btf_capture::{DirectionSet, ImageFormat, write_file_atomically};
use btf_synth::{LeafContents, LeafParams, SynthError, write_leaf_capture};
use clap::{Args, Parser, Subcommand, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

/// Set by Ctrl-C; the work stops at the next image.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Makes synthetic BTF captures.
#[derive(Parser)]
#[command(name = "btf-synth", version, after_help = "Example: btf-synth leaf my-leaf --size 128 --cab 25")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Photograph a leaf's upper face: veins, relief, pigments and gloss.
    Leaf(LeafArgs),
}

#[derive(Args)]
#[command(after_help = "Examples:
  btf-synth leaf my-leaf
  btf-synth leaf autumn --size 128 --cab 5 --car 12 --cbrown 0.3 --seed 7
  btf-synth leaf hdr-leaf --format exr --directions dome151 --json leaf.json")]
struct LeafArgs {
    /// Folder to make, in Bonn's layout; must not exist or be empty
    out_dir: PathBuf,
    /// Width and height of the images in texels (8 to 2048)
    #[arg(long, default_value_t = 256)]
    size: usize,
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
    /// Light and view directions: bonn81, dome151, random:N or a file of `theta phi` lines in degrees
    #[arg(long, default_value = "bonn81", value_name = "SET")]
    directions: String,
    /// Format of the images: png and jpg are 8-bit sRGB, exr is linear half precision
    #[arg(long, value_enum, default_value_t = Format::Png)]
    format: Format,
    /// Seed of veins and relief
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of threads [default: all cores]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Show no progress and no result line
    #[arg(long)]
    quiet: bool,
    /// Write the result as JSON to FILE; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Model {
    /// One absorbing plate, exact equations, spectral index
    PlateExact,
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    Png,
    Jpg,
    Exr,
}

/// How the program ends.
enum Failure {
    /// Bad usage.
    Usage(String),
    /// Bad input, or the work failed.
    Failed(String),
    /// Ctrl-C.
    Interrupted,
}

impl From<SynthError> for Failure {
    fn from(error: SynthError) -> Failure {
        match error {
            SynthError::BadParameter { .. } => Failure::Usage(error.to_string()),
            SynthError::Stopped => Failure::Interrupted,
            other => Failure::Failed(other.to_string()),
        }
    }
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let result = match cli.command {
        Command::Leaf(args) => leaf(&args),
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

fn leaf(args: &LeafArgs) -> Result<(), Failure> {
    let directions = DirectionSet::by_name(&args.directions).map_err(|error| Failure::Failed(error.to_string()))?;
    let params = LeafParams {
        size: args.size,
        size_mm: args.size_mm,
        contents: LeafContents {
            chlorophyll_ug_per_cm2: args.cab,
            carotenoid_ug_per_cm2: args.car,
            brown: args.cbrown,
            water_cm: args.cw,
            dry_matter_g_per_cm2: args.cm,
            structure: args.n,
        },
        roughness: args.gamma,
        seed: args.seed,
        views: directions.clone(),
        lights: directions,
        format: match args.format {
            Format::Png => ImageFormat::Png,
            Format::Jpg => ImageFormat::Jpg,
            Format::Exr => ImageFormat::Exr,
        },
    };
    params.check()?;
    let Model::PlateExact = args.model;
    ctrlc::set_handler(|| INTERRUPTED.store(true, Ordering::Relaxed)).map_err(|error| {
        Failure::Failed(format!("Ctrl-C cannot be caught ({error}); start the program from a shell"))
    })?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(args.threads.map_or(0, usize::from))
        .build()
        .map_err(|error| Failure::Failed(format!("no threads can be started ({error}); give a smaller --threads")))?;

    let started = Instant::now();
    let images = params.views.len() * params.lights.len();
    // Draws on standard error, and only where that is a terminal.
    let bar = if args.quiet { ProgressBar::hidden() } else { ProgressBar::new(images as u64) };
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} images, {eta} left");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.set_message("leaf");
    let progress = |done: usize, _: usize| {
        bar.set_position(done as u64);
        if INTERRUPTED.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let written = pool.install(|| write_leaf_capture(&args.out_dir, &params, &progress));
    bar.finish_and_clear();
    written?;
    let seconds = started.elapsed().as_secs_f64();

    if let Some(path) = &args.json {
        let result = json!({
            "path": args.out_dir.display().to_string(),
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
        let text = format!("{result:#}\n");
        if path.as_os_str() == "-" {
            // Standard output then holds the JSON and nothing else.
            return std::io::stdout()
                .write_all(text.as_bytes())
                .map_err(|error| Failure::Failed(format!("standard output could not be written ({error})")));
        }
        write_file_atomically(path, text.as_bytes()).map_err(|error| Failure::Failed(error.to_string()))?;
    }
    if !args.quiet {
        println!("{}: {images} images in {seconds:.1} s", args.out_dir.display());
    }
    Ok(())
}
