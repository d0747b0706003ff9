//! A capture opened for reading.

use std::path::Path;

use crate::bonn;
use crate::error::CaptureError;
use crate::images::{self, DecodedImage, ImageFault, Samples};
use crate::info::CaptureInfo;
use crate::manifest::{self, MANIFEST_NAME, MAX_MANIFEST_BYTES};
use crate::source::{MAX_FILE_BYTES, Source};

/// The most negative linear value that is taken for a colour outside the gamut; below it an image
/// is refused.
pub const MIN_LINEAR: f32 = -0.1;

/// An image file may have this many bytes whatever its size in texels: headers, thumbnails,
/// profiles.
const FREE_FILE_BYTES: u64 = 4 << 20;

/// Bytes that an image file may have per texel: sixteen float channels.
const MAX_BYTES_PER_TEXEL: u64 = 64;

/// A Bonn-layout folder, or a zip of one, opened for reading from any number of threads.
#[derive(Debug)]
pub struct Capture {
    source: Source,
    info: CaptureInfo,
    /// File of each pair, `view * lights + light`.
    files: Vec<usize>,
}

/// The pixels of one image, row-major from the top left, `[texel, channel]`, three channels.
#[derive(Debug, Clone, PartialEq)]
pub enum Pixels {
    /// 8-bit file values, the transfer curve not undone: decode them by
    /// [`CaptureInfo::linear_from_encoded8`].
    Encoded8(Vec<u8>),
    /// Reflectance x cosine; curve, scale and cosine are applied. Of EXR and 16-bit PNG.
    Linear(Vec<f32>),
}

impl Capture {
    /// Opens the folder or zip at `path`: reads the angles from the names, checks that they form a
    /// full grid of views x lights, reads `capture.toml` where there is one, checks that angles and
    /// side agree (see [`crate::Side`]), and decodes the first image for the size. Other files are
    /// passed over.
    ///
    /// # Errors
    /// Each of [`CaptureError`]'s reading variants; nothing is written and nothing unpacked.
    ///
    /// Cost: a listing and one image; some milliseconds for 6561 files in a warm cache.
    pub fn open(path: impl AsRef<Path>) -> Result<Capture, CaptureError> {
        let path = path.as_ref();
        let source = Source::open(path)?;
        let layout = bonn::find_layout(&source)?;
        // The name may be `.`, so ask for the real path.
        let name = std::fs::canonicalize(path)
            .ok()
            .and_then(|real| real.file_stem().map(|stem| stem.to_string_lossy().into_owned()))
            .unwrap_or_default();
        let mut info = CaptureInfo::new(name, 0, 0, layout.views, layout.lights, layout.format);
        if let Some(file) = find_manifest(&source) {
            let bytes = source.read(file, MAX_MANIFEST_BYTES)?;
            let shown = source.shown(file);
            let text = String::from_utf8(bytes).map_err(|error| CaptureError::BadManifest {
                path: shown.clone(),
                line: error.as_bytes()[..error.utf8_error().valid_up_to()].iter().filter(|&&b| b == b'\n').count() + 1,
                reason: "it is not UTF-8 text".into(),
            })?;
            manifest::apply(&text, &shown, &mut info)?;
        }
        info.check_sides().map_err(|reason| CaptureError::BadSides { path: path.display().to_string(), reason })?;
        let mut capture = Capture { source, info, files: layout.files };
        let first = capture.decode(0, 0, None)?;
        (capture.info.width, capture.info.height) = (first.width, first.height);
        capture.pixels(0, 0, first)?;
        Ok(capture)
    }

    /// What the capture is.
    pub fn info(&self) -> &CaptureInfo {
        &self.info
    }

    /// Path of an image, for messages; of a zip `ARCHIVE: ENTRY`.
    ///
    /// # Panics
    /// If `view` or `light` is out of range.
    pub fn path_of(&self, view: usize, light: usize) -> String {
        self.source.shown(self.file_of(view, light))
    }

    /// Reads and decodes one image. Takes no lock: call it from many threads.
    ///
    /// # Errors
    /// [`CaptureError::BadImage`] for an image that is empty, cut, damaged or of another kind,
    /// [`CaptureError::WrongSize`], [`CaptureError::TooLarge`], and [`CaptureError::BadValue`] for
    /// NaN, infinity or a value below [`MIN_LINEAR`]; [`CaptureError::Read`].
    ///
    /// # Panics
    /// If `view` or `light` is out of range.
    pub fn read(&self, view: usize, light: usize) -> Result<Pixels, CaptureError> {
        let image = self.decode(view, light, Some((self.info.width, self.info.height)))?;
        self.pixels(view, light, image)
    }

    fn file_of(&self, view: usize, light: usize) -> usize {
        assert!(view < self.info.views.len() && light < self.info.lights.len(), "pair ({view}, {light}) out of range");
        self.files[view * self.info.lights.len() + light]
    }

    fn decode(&self, view: usize, light: usize, size: Option<(usize, usize)>) -> Result<DecodedImage, CaptureError> {
        let file = self.file_of(view, light);
        let limit = size
            .map_or(MAX_FILE_BYTES, |(width, height)| FREE_FILE_BYTES + (width * height) as u64 * MAX_BYTES_PER_TEXEL);
        let bytes = self.source.read(file, limit)?;
        images::decode(&bytes, self.info.format, size).map_err(|fault| {
            let path = self.source.shown(file);
            match fault {
                ImageFault::Damaged(reason) => CaptureError::BadImage { path, reason },
                ImageFault::WrongSize { width, height } => {
                    let (expected_width, expected_height) = (self.info.width, self.info.height);
                    CaptureError::WrongSize { path, width, height, expected_width, expected_height }
                }
            }
        })
    }

    fn pixels(&self, view: usize, light: usize, image: DecodedImage) -> Result<Pixels, CaptureError> {
        let factor = self.info.linear_factor(light);
        let linear = match image.samples {
            Samples::U8(values) => return Ok(Pixels::Encoded8(values)),
            Samples::U16(values) => {
                let transfer = self.info.transfer;
                values.iter().map(|&v| transfer.linear_from_encoded(f32::from(v) / 65535.0) * factor).collect()
            }
            Samples::F32(mut values) => {
                values.iter_mut().for_each(|value| *value *= factor);
                values
            }
        };
        if let Some(at) = linear.iter().position(|value| !(value.is_finite() && *value >= MIN_LINEAR)) {
            return Err(CaptureError::BadValue {
                path: self.path_of(view, light),
                value: linear[at],
                column: at / 3 % self.info.width,
                row: at / 3 / self.info.width,
                channel: at % 3,
            });
        }
        Ok(Pixels::Linear(linear))
    }
}

/// The manifest nearest the root; `None` where there is none.
fn find_manifest(source: &Source) -> Option<usize> {
    let names = source.names();
    (0..names.len())
        .filter(|&file| names[file].rsplit('/').next() == Some(MANIFEST_NAME))
        .min_by_key(|&file| names[file].matches('/').count())
}
