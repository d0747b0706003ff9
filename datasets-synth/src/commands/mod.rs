//! The subcommands, one file each, and what they share.

mod cloth;
mod goniophotometer;
mod leaf;
mod leaf_file;
mod leaf_look;
mod leather;
mod model;
mod plants;
mod spectrum;

use std::io::Write;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use btf_capture::{DirectionSet, ImageFormat, write_file_atomically};
use btf_synth::{CaptureParams, HEIGHT_MAP_NAME, Progress, SynthError};
use clap::{Args, Parser, Subcommand, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};

/// Set by Ctrl-C; the work stops at the next step.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

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
    /// Measure spectral reflectance and transmittance of a leaf model.
    Spectrum(spectrum::SpectrumArgs),
    /// Measure BRDF and BTDF of a leaf model over the sphere.
    Goniophotometer(goniophotometer::GoniophotometerArgs),
    /// Photograph pebbled leather: grain, creases, pores and finish.
    Leather(leather::LeatherArgs),
    /// Grow maize, soybean, trees or grass: meshes and instances as a glTF file, or a script of shapes.
    Plants(plants::PlantsArgs),
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

/// Runs the command that the program was started with.
pub fn run() -> ExitCode {
    let cli = Cli::parse();
    let result = match cli.command {
        Command::Cloth(args) => cloth::run(&args),
        Command::Leaf(args) => leaf::run(&args),
        Command::Spectrum(args) => spectrum::run(&args),
        Command::Goniophotometer(args) => goniophotometer::run(&args),
        Command::Leather(args) => leather::run(&args),
        Command::Plants(args) => plants::run(&args),
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

/// Options of every command that works for a while.
#[derive(Args)]
struct RunArgs {
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

impl RunArgs {
    /// Runs `work` on a pool of the wished size with a progress bar over `total` steps, until Ctrl-C.
    /// `work` is given a function that takes the number of steps done and says whether to go on.
    fn work<T: Send>(
        &self,
        message: &'static str,
        unit: &str,
        total: usize,
        work: impl FnOnce(&(dyn Fn(usize, usize) -> ControlFlow<()> + Sync)) -> Result<T, SynthError> + Send,
    ) -> Result<T, Failure> {
        ctrlc::set_handler(|| INTERRUPTED.store(true, Ordering::Relaxed)).map_err(|error| {
            Failure::Failed(format!("Ctrl-C cannot be caught ({error}); start the program from a shell"))
        })?;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.threads.map_or(0, usize::from)).build().map_err(
            |error| Failure::Failed(format!("no threads can be started ({error}); give a smaller --threads")),
        )?;
        // Draws on standard error, and only where that is a terminal.
        let bar = if self.quiet { ProgressBar::hidden() } else { ProgressBar::new(total as u64) };
        let style = ProgressStyle::with_template(&format!("{{msg}} {{wide_bar}} {{pos}}/{{len}} {unit}, {{eta}} left"));
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_message(message);
        let progress = |done: usize, _: usize| {
            bar.set_position(done as u64);
            if INTERRUPTED.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let result = pool.install(|| work(&progress));
        bar.finish_and_clear();
        Ok(result?)
    }

    /// Writes the JSON result where it was asked for, and the result line unless standard output holds
    /// the JSON or the user wants quiet.
    fn report(&self, result: &Value, line: &str) -> Result<(), Failure> {
        if let Some(path) = &self.json {
            let text = format!("{result:#}\n");
            if path.as_os_str() == "-" {
                // Standard output then holds the JSON and nothing else.
                return std::io::stdout()
                    .write_all(text.as_bytes())
                    .map_err(|error| Failure::Failed(format!("standard output could not be written ({error})")));
            }
            write_text(path, &text)?;
        }
        if !self.quiet {
            println!("{line}");
        }
        Ok(())
    }
}

/// Options of every command that writes a capture.
#[derive(Args)]
struct CaptureArgs {
    /// Folder to make, in Bonn's layout; must not exist or be empty
    out_dir: PathBuf,
    /// Width and height of the images in texels (8 to 2048)
    #[arg(long, default_value_t = 256)]
    size: usize,
    /// Light and view directions: bonn81, dome151, random:N or a file of `theta phi` lines in degrees
    #[arg(long, default_value = "bonn81", value_name = "SET")]
    directions: String,
    /// Format of the images: png and jpg are 8-bit sRGB, exr is linear half precision
    #[arg(long, value_enum, default_value_t = Format::Png)]
    format: Format,
    /// Seed of everything random [default: 1]
    #[arg(long)]
    seed: Option<u64>,
}

impl CaptureArgs {
    /// What is asked for, of a patch of `size_mm`.
    fn params(&self, size_mm: f32) -> Result<CaptureParams, Failure> {
        let set = DirectionSet::by_name(&self.directions).map_err(|error| Failure::Failed(error.to_string()))?;
        Ok(CaptureParams {
            size: self.size,
            size_mm,
            seed: self.seed.unwrap_or(1),
            views: set.clone(),
            lights: set,
            format: self.format.into(),
        })
    }

    /// Writes the capture of `params` by `write` with a progress bar and reports it; `more` are the material's
    /// own keys of the JSON result.
    fn photograph(
        &self,
        run: &RunArgs,
        material: &'static str,
        params: &CaptureParams,
        more: &Value,
        write: impl FnOnce(&Path, Progress) -> Result<(), SynthError> + Send,
    ) -> Result<(), Failure> {
        let started = Instant::now();
        let images = params.views.len() * params.lights.len();
        let out_dir = &self.out_dir;
        run.work(material, "images", images, |progress| write(out_dir, progress))?;
        let seconds = started.elapsed().as_secs_f64();
        let mut result = json!({
            "path": out_dir.display().to_string(),
            "height_map": out_dir.join(HEIGHT_MAP_NAME).display().to_string(),
            "images": images,
            "seconds": seconds,
            "width": params.size,
            "height": params.size,
            "views": params.views.len(),
            "lights": params.lights.len(),
            "size_mm": params.size_mm,
            "format": params.format.to_string(),
            "seed": params.seed,
        });
        for (key, value) in more.as_object().into_iter().flatten() {
            result[key] = value.clone();
        }
        run.report(&result, &format!("{}: {images} images in {seconds:.1} s", out_dir.display()))
    }
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    Png,
    Jpg,
    Exr,
}

impl From<Format> for ImageFormat {
    fn from(format: Format) -> ImageFormat {
        match format {
            Format::Png => ImageFormat::Png,
            Format::Jpg => ImageFormat::Jpg,
            Format::Exr => ImageFormat::Exr,
        }
    }
}

/// Reads a colour of three numbers with commas between.
fn parse_colour(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    numbers
        .and_then(|numbers| <[f64; 3]>::try_from(numbers).ok())
        .ok_or_else(|| "write three numbers with commas between, such as 0.3,0.1,0.05".into())
}

/// Writes a text file that is whole or not there.
fn write_text(path: &Path, text: &str) -> Result<(), Failure> {
    write_file_atomically(path, text.as_bytes()).map_err(|error| Failure::Failed(error.to_string()))
}

/// A count as people type it: 1000000 or 1e6.
fn whole_number(text: &str) -> Result<u64, String> {
    match text.parse::<f64>() {
        Ok(x) if (1.0..=1e12).contains(&x) && x.fract() == 0.0 => Ok(x as u64),
        _ => Err("give a whole number from 1 to 1e12, such as 1000000 or 1e6".into()),
    }
}
