//! Options of every command that writes a capture, and the writing of the capture.

use std::path::{Path, PathBuf};
use std::time::Instant;

use btf_capture::{DirectionSet, ImageFormat};
use btf_synth::{CaptureParams, HEIGHT_MAP_NAME, Progress, SynthError};
use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::failure::Failure;
use super::run_args::RunArgs;

/// Options of every command that writes a capture.
#[derive(Args)]
pub(super) struct CaptureArgs {
    /// Folder to make, in Bonn's layout; must not exist or be empty
    out_dir: PathBuf,
    /// Width and height of the images in texels (8 to 2048)
    #[arg(long, default_value_t = 256)]
    size: usize,
    /// Light and view directions: bonn81, dome151, random:N or a file of `theta phi` lines in degrees
    #[arg(long, default_value = "bonn81", value_name = "SET")]
    directions: String,
    /// Format of the images: png and jpg are 8-bit sRGB, exr is linear half precision [default: png, exr for bands]
    #[arg(long, value_enum)]
    format: Option<Format>,
    /// Seed of everything random [default: 1]
    #[arg(long)]
    pub(super) seed: Option<u64>,
}

impl CaptureArgs {
    /// Returns the parameters of a capture of a patch of `size_mm`.
    pub(super) fn params(&self, size_mm: f32) -> Result<CaptureParams, Failure> {
        let set = DirectionSet::by_name(&self.directions).map_err(|error| Failure::Failed(error.to_string()))?;
        Ok(CaptureParams {
            size: self.size,
            size_mm,
            seed: self.seed.unwrap_or(1),
            views: set.clone(),
            lights: set,
            format: self.format.map_or(ImageFormat::Png, ImageFormat::from),
        })
    }

    /// Returns the format of images in spectral bands.
    pub(super) fn format_of_bands(&self) -> Result<ImageFormat, Failure> {
        match self.format {
            None | Some(Format::Exr) => Ok(ImageFormat::Exr),
            Some(_) => Err(Failure::Usage("bands are written as exr; give --format exr, or leave it out".into())),
        }
    }

    /// Writes the capture of `params` by `write` with a progress bar, and reports the result. `more` are additional
    /// keys of the JSON result.
    pub(super) fn photograph(
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
