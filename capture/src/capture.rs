//! A capture opened for reading.

use std::path::Path;

use crate::error::CaptureError;
use crate::images::decoded::{DecodedImage, ImageFault, Samples};
use crate::images::file_format::{self, FileFormat};
use crate::info::CaptureInfo;
use crate::layout::bonn;
use crate::layout::grid::grid_of;
use crate::layout::list;
use crate::layout::manifest::{self, MANIFEST_NAME, MAX_MANIFEST_BYTES};
use crate::layout::source::{MAX_FILE_BYTES, Source};
use crate::ubo2014::{Container, ContainerInfo, is_container};

/// The most negative linear value that is taken for a colour outside the gamut; below it an image
/// is refused.
pub const MIN_LINEAR: f32 = -0.1;

/// An image file may have this many bytes whatever its size in texels: headers, thumbnails,
/// profiles.
const FREE_FILE_BYTES: u64 = 4 << 20;

/// Bytes that an image file may have per texel: sixteen float channels.
const MAX_BYTES_PER_TEXEL: u64 = 64;

/// The same for EXR, whose channels may be wavelengths: 256 of them.
const MAX_SPECTRAL_BYTES_PER_TEXEL: u64 = 1024;

/// A capture of any kind that is read, opened for reading from any number of threads.
#[derive(Debug)]
pub struct Capture {
    pub(crate) images: Images,
    info: CaptureInfo,
}

/// Where images come from.
#[derive(Debug)]
pub(crate) enum Images {
    /// One file each.
    Files {
        source: Source,
        format: FileFormat,
        /// File of each pair, `view * lights + light`.
        files: Vec<usize>,
    },
    /// One file that they are computed from.
    Container(Box<Container>),
}

/// The pixels of one image, row-major from the top left, `[texel, channel]`, three channels.
#[derive(Debug, Clone, PartialEq)]
pub enum Pixels {
    /// 8-bit file values, the transfer curve not undone: decode them by
    /// [`CaptureInfo::linear_from_encoded8`].
    Encoded8(Vec<u8>),
    /// Reflectance x cosine; curve, scale and cosine are applied. Of all others: EXR, Radiance, 16-bit PNG and
    /// UBO2014 files.
    Linear(Vec<f32>),
}

impl Capture {
    /// Opens the capture at `path`. It is recognised by what it is:
    ///
    /// - a folder or a zip of images in Bonn's layout, whose names carry the angles (UBO2003, ATRIUM, spectral
    ///   sets), or with a list of its images (a `.csv`); also the list itself;
    /// - a UBO2014 file (`.btf`).
    ///
    /// Checks that the angles form a full grid of views x lights, reads `capture.toml` where there is one
    /// (beside `NAME.btf` it is `NAME.toml`), checks that angles and side agree (see [`crate::Side`]), and
    /// decodes the first image, of files for the size. Other files are passed over.
    ///
    /// # Errors
    /// Each of [`CaptureError`]'s reading variants; nothing is written and nothing unpacked.
    ///
    /// Cost: a listing and one image; some milliseconds for 6561 files in a warm cache. A UBO2014 file is
    /// mapped and its first block of images computed.
    pub fn open(path: impl AsRef<Path>) -> Result<Capture, CaptureError> {
        let path = path.as_ref();
        let meta = std::fs::metadata(path).map_err(|source| CaptureError::read(path, source))?;
        // The name may be `.`, so ask for the real path.
        let name = std::fs::canonicalize(path)
            .ok()
            .and_then(|real| real.file_stem().map(|stem| stem.to_string_lossy().into_owned()))
            .unwrap_or_default();
        let is_file = meta.is_file();
        let has_extension = |wanted: &str| path.extension().is_some_and(|found| found.eq_ignore_ascii_case(wanted));
        if is_file && (has_extension("btf") || is_container(&first_bytes(path)?)) {
            return Capture::open_container(path, name);
        }
        match path.file_name().and_then(|list| list.to_str()) {
            Some(list) if is_file && has_extension(list::LIST_EXTENSION) => {
                let folder = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
                Capture::open_files(Source::open(folder)?, Some(list), name)
            }
            _ => Capture::open_files(Source::open(path)?, None, name),
        }
    }

    fn open_container(path: &Path, name: String) -> Result<Capture, CaptureError> {
        let (container, mut info) = Container::open(path, name)?;
        let beside = path.with_extension("toml");
        if beside.is_file() {
            let size = std::fs::metadata(&beside).map_or(0, |meta| meta.len());
            if size > MAX_MANIFEST_BYTES {
                let path = beside.display().to_string();
                return Err(CaptureError::TooLarge { path, claim: format!("has {size} bytes") });
            }
            let bytes = std::fs::read(&beside).map_err(|source| CaptureError::read(&beside, source))?;
            apply_manifest(bytes, &beside.display().to_string(), &mut info)?;
        }
        info.check_sides().map_err(|reason| CaptureError::BadSides { path: path.display().to_string(), reason })?;
        let capture = Capture { images: Images::Container(Box::new(container)), info };
        capture.read(0, 0)?;
        Ok(capture)
    }

    fn open_files(source: Source, list: Option<&str>, name: String) -> Result<Capture, CaptureError> {
        let root = source.root().display().to_string();
        if source.names().is_empty() {
            return Err(CaptureError::Empty { path: root });
        }
        let grid = match list::find_images(&source, list)? {
            Some(images) => grid_of(&source, &images, &list::missing_name)?,
            None => {
                let images = bonn::find_images(&source);
                if images.is_empty() {
                    return Err(CaptureError::NoImages { path: root, files: source.names().len() });
                }
                grid_of(&source, &images, &|grid, view, light| bonn::missing_name(&source, &images, grid, view, light))?
            }
        };
        let mut info = CaptureInfo::new(name, 0, 0, grid.views, grid.lights, grid.format.written_as());
        if let Some(file) = find_manifest(&source) {
            apply_manifest(source.read(file, MAX_MANIFEST_BYTES)?, &source.shown(file), &mut info)?;
        }
        info.check_sides().map_err(|reason| CaptureError::BadSides { path: root, reason })?;
        let images = Images::Files { source, format: grid.format, files: grid.files };
        let mut capture = Capture { images, info };
        let first = capture.decode(0, 0, None)?;
        (capture.info.width, capture.info.height) = (first.width, first.height);
        capture.pixels(0, 0, first)?;
        Ok(capture)
    }

    /// What the capture is.
    pub fn info(&self) -> &CaptureInfo {
        &self.info
    }

    /// What a UBO2014 file says besides; `None` for captures of image files.
    pub fn container(&self) -> Option<&ContainerInfo> {
        match &self.images {
            Images::Files { .. } => None,
            Images::Container(container) => Some(container.info()),
        }
    }

    /// Path of an image, for messages; of a zip `ARCHIVE: ENTRY`, of a UBO2014 file the file and the pair.
    ///
    /// # Panics
    /// If `view` or `light` is out of range.
    pub fn path_of(&self, view: usize, light: usize) -> String {
        let pair = self.pair(view, light);
        match &self.images {
            Images::Files { source, files, .. } => source.shown(files[pair]),
            Images::Container(container) => {
                let (view, light) = (self.info.views.directions()[view], self.info.lights.directions()[light]);
                format!("{}: view {view}, light {light}", container.path().display())
            }
        }
    }

    /// Reads and decodes one image: call it from many threads. Image files are read without a lock.
    /// UBO2014 files compute up to 16 lights of a view at a time (BDI: 256) and keep them for a while, 32 MB
    /// (64 MB) for each thread, so ask in the order of the pairs.
    ///
    /// # Errors
    /// [`CaptureError::BadImage`] for an image that is empty, cut, damaged or of another kind,
    /// [`CaptureError::WrongSize`], [`CaptureError::TooLarge`], and [`CaptureError::BadValue`] for
    /// NaN, infinity or a value below [`MIN_LINEAR`]; [`CaptureError::Read`]. RGB that is computed, from spectra
    /// and UBO2014 files, is set to [`MIN_LINEAR`] where it would be below.
    ///
    /// # Panics
    /// If `view` or `light` is out of range.
    pub fn read(&self, view: usize, light: usize) -> Result<Pixels, CaptureError> {
        let image = self.decode(view, light, Some((self.info.width, self.info.height)))?;
        self.pixels(view, light, image)
    }

    fn pair(&self, view: usize, light: usize) -> usize {
        assert!(view < self.info.views.len() && light < self.info.lights.len(), "pair ({view}, {light}) out of range");
        view * self.info.lights.len() + light
    }

    fn decode(&self, view: usize, light: usize, size: Option<(usize, usize)>) -> Result<DecodedImage, CaptureError> {
        let pair = self.pair(view, light);
        let (source, format, file) = match &self.images {
            Images::Files { source, format, files } => (source, *format, files[pair]),
            Images::Container(container) => return Ok(container.image(view, light)),
        };
        let per_texel = if format == FileFormat::Exr { MAX_SPECTRAL_BYTES_PER_TEXEL } else { MAX_BYTES_PER_TEXEL };
        let limit =
            size.map_or(MAX_FILE_BYTES, |(width, height)| FREE_FILE_BYTES + (width * height) as u64 * per_texel);
        let bytes = source.read(file, limit)?;
        file_format::decode(&bytes, format, size).map_err(|fault| {
            let path = source.shown(file);
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
            Samples::Computed(mut values) => {
                // Not `max`, which would turn a NaN into a number.
                let clamped = |value: f32| if value < MIN_LINEAR { MIN_LINEAR } else { value };
                let held = |value: f32| if value.is_finite() { clamped(value * factor) } else { value };
                values.iter_mut().for_each(|value| *value = held(*value));
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

/// The first bytes of the file at `path`.
fn first_bytes(path: &Path) -> Result<Vec<u8>, CaptureError> {
    use std::io::Read;
    let mut bytes = Vec::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(16).read_to_end(&mut bytes))
        .map_err(|source| CaptureError::read(path, source))?;
    Ok(bytes)
}

/// Takes what the manifest in `bytes` says into `info`.
fn apply_manifest(bytes: Vec<u8>, shown: &str, info: &mut CaptureInfo) -> Result<(), CaptureError> {
    let text = String::from_utf8(bytes).map_err(|error| CaptureError::BadManifest {
        path: shown.into(),
        line: error.as_bytes()[..error.utf8_error().valid_up_to()].iter().filter(|&&b| b == b'\n').count() + 1,
        reason: "it is not UTF-8 text".into(),
    })?;
    manifest::apply(&text, shown, info)
}

/// The manifest nearest the root; `None` where there is none.
fn find_manifest(source: &Source) -> Option<usize> {
    let names = source.names();
    (0..names.len())
        .filter(|&file| names[file].rsplit('/').next() == Some(MANIFEST_NAME))
        .min_by_key(|&file| names[file].matches('/').count())
}
