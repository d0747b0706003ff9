//! Opens captures and reads their images.

use std::path::Path;
use std::sync::Arc;

use crate::colour::transfer::Transfer;
use crate::direction::MAX_DIRECTIONS;
use crate::error::CaptureError;
use crate::image_file::ImageFile;
use crate::images::bands::{BandReading, BandSums, Weighing};
use crate::images::corrections::{Corrections, Light, MIN_FLAT, linear, nearest_valid};
use crate::images::decoded::{DecodedImage, ImageFault, MIN_LINEAR, Samples};
use crate::images::file_format::FileFormat;
use crate::images::homography::{is_within, rectify};
use crate::info::{CaptureInfo, ImageFormat};
use crate::layout::grid::{Grid, GridImage, Shot, grid_of, snap};
use crate::layout::manifest::{self, MANIFEST_NAME, MAX_MANIFEST_BYTES, Reading};
use crate::layout::source::{Source, safe_name};
use crate::layout::{bonn, list};
use crate::ubo2014::{Container, ContainerInfo, is_container};

/// A capture of any kind, open for reading from any number of threads. A clone is another handle of the same images.
#[derive(Debug, Clone)]
pub struct Capture {
    pub(crate) images: Arc<Images>,
    info: CaptureInfo,
    corrections: Arc<Corrections>,
    /// What becomes of the bands of spectral images.
    pub(crate) weighing: Weighing,
    /// Parts of a capture in groups of channels.
    pub(crate) groups: Option<Arc<Vec<Capture>>>,
    /// Size of the files, which is that of the images unless they are rectified.
    photograph: Option<(usize, usize)>,
    snapped: Option<Snapped>,
}

/// What became of the directions of a capture whose `capture.toml` names the views or lights that images count as.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snapped {
    /// Largest angle between a direction and the one that it counts as, degrees.
    pub largest_deg: f64,
    /// Images that were left out because another one was nearer to their pair.
    pub left_out: usize,
}

/// Source of a capture's images.
#[derive(Debug)]
pub(crate) enum Images {
    /// Image files.
    Files {
        source: Source,
        format: FileFormat,
        /// Format in which files with the samples of the first would be written.
        written_as: ImageFormat,
        /// Wavelengths of the bands in nanometres that `capture.toml` tells, in the files' order; empty where it tells none.
        told_nm: Vec<f64>,
        /// Photographs of each pair, `view * lights + light`; none for a pair without an image.
        shots: Vec<Vec<Shot>>,
        /// Curve of the files where their values are merged or corrected, so that images are linear; `None` where the file
        /// values are the images'.
        merged: Option<Transfer>,
    },
    /// One UBO2014 file that all images are computed from.
    Container(Box<Container>),
    /// Linear values in memory, `[pair, texel, channel]`; channels are bands where there are wavelengths.
    Memory { values: Vec<f32>, wavelengths_nm: Vec<f64> },
}

/// Pixels of one image, row-major from the top left, `[texel, channel]`, three channels.
#[derive(Debug, Clone, PartialEq)]
pub enum Pixels {
    /// 8-bit file values with the transfer curve still applied; [`CaptureInfo::linear_from_encoded8`] decodes them.
    Encoded8(Vec<u8>),
    /// Reflectance x cosine with curve, scale and cosine applied. Pixels of EXR, Radiance, ENVI and UBO2014 files, of PNG
    /// and TIFF files of 16 bits and of TIFF files of floats or bands are linear.
    Linear(Vec<f32>),
}

impl Capture {
    /// Opens the capture at `path`, which is one of these:
    ///
    /// - a folder or a zip of images in Bonn's layout, whose names carry the angles (UBO2003, ATRIUM, spectral sets),
    ///   or with a list of its images (a `.csv` file); the list itself can be given as well;
    /// - a UBO2014 file (`.btf`).
    ///
    /// Reads `capture.toml` where there is one (`NAME.toml` beside `NAME.btf`), checks that the angles form a full grid of
    /// views x lights, unless that says `incomplete = true`, and that angles and side agree (see [`crate::Side`]), and
    /// decodes the first image, which gives the size of a capture of files. Other files are ignored.
    ///
    /// # Errors
    /// Any of [`CaptureError`]'s variants for reading. Nothing is written and nothing is unpacked.
    ///
    /// Cost: one listing of the folder and one image, some milliseconds for 6561 files in a warm cache. A UBO2014 file
    /// is mapped and its first block of images is computed.
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

    /// Makes a capture of linear images in memory: reflectance x cosine `[view, light, texel, channel]`, three channels or the
    /// bands of `info`, texels row by row from the top left. The format of `info` is [`ImageFormat::Exr`].
    ///
    /// # Errors
    /// [`CaptureError::BadImages`] for another number of values than `info` has, [`CaptureError::BadSides`]. Values are
    /// checked when they are read.
    pub fn from_linear(info: CaptureInfo, images: Vec<f32>) -> Result<Capture, CaptureError> {
        let expected = info.pair_count() * info.texel_count() * info.channels();
        if info.texel_count() == 0 {
            let reason = format!("{} columns and {} rows: give at least one texel", info.width, info.height);
            return Err(CaptureError::BadImages { reason });
        }
        if !info.missing.is_empty() {
            return Err(CaptureError::BadImages { reason: "images in memory are of all pairs".into() });
        }
        if info.format != ImageFormat::Exr || images.len() != expected {
            let reason = format!("{} values, where directions and size ask for {expected}", images.len());
            return Err(CaptureError::BadImages { reason });
        }
        info.check_sides().map_err(|reason| CaptureError::BadSides { path: info.name.clone(), reason })?;
        let wavelengths_nm = info.wavelengths_nm.clone();
        if wavelengths_nm.windows(2).any(|pair| pair[0].partial_cmp(&pair[1]) != Some(std::cmp::Ordering::Less)) {
            return Err(CaptureError::BadImages { reason: "its wavelengths do not ascend".into() });
        }
        Ok(Capture {
            images: Arc::new(Images::Memory { values: images, wavelengths_nm }),
            info,
            corrections: Arc::default(),
            weighing: Weighing::default(),
            groups: None,
            photograph: None,
            snapped: None,
        })
    }

    fn open_container(path: &Path, name: String) -> Result<Capture, CaptureError> {
        let (container, mut info) = Container::open(path, name)?;
        let mut corrections = Corrections::default();
        let beside = path.with_extension("toml");
        if beside.is_file() {
            let size = std::fs::metadata(&beside).map_or(0, |meta| meta.len());
            if size > MAX_MANIFEST_BYTES {
                let path = beside.display().to_string();
                return Err(CaptureError::TooLarge { path, claim: format!("has {size} bytes") });
            }
            let bytes = std::fs::read(&beside).map_err(|source| CaptureError::read(&beside, source))?;
            let shown = beside.display().to_string();
            let text = text_of_manifest(bytes, &shown)?;
            manifest::apply(&text, &shown, &mut info)?;
            let reading = manifest::reading(&text, &shown)?;
            if reading.is_of_files() {
                let reason = "a UBO2014 file takes none of incomplete, views, lights, black, flat, mask, saturation, \
                              rectified and wavelengths_nm; remove these keys";
                return Err(CaptureError::BadKeys { path: shown, reason: reason.into() });
            }
            corrections.rows_up = reading.rows_up;
        }
        info.check_sides().map_err(|reason| CaptureError::BadSides { path: path.display().to_string(), reason })?;
        let images = Arc::new(Images::Container(Box::new(container)));
        let capture = Capture {
            images,
            info,
            corrections: Arc::new(corrections),
            weighing: Weighing::default(),
            groups: None,
            photograph: None,
            snapped: None,
        };
        capture.read(0, 0)?;
        Ok(capture)
    }

    fn open_files(source: Source, list: Option<&str>, name: String) -> Result<Capture, CaptureError> {
        let root = source.root().display().to_string();
        if source.names().is_empty() {
            return Err(CaptureError::Empty { path: root });
        }
        let manifest = match find_manifest(&source) {
            Some(file) => Some((text_of_manifest(source.read(file, MAX_MANIFEST_BYTES)?, &source.shown(file))?, file)),
            None => None,
        };
        let reading = match &manifest {
            Some((text, file)) => manifest::reading(text, &source.shown(*file))?,
            None => Reading::default(),
        };
        let (grid, snapped) = find_grid(&source, list, &reading)?;
        let one = grid.shots.iter().find_map(|shots| shots.last()).map_or(0, |shot| shot.file);
        let one = ImageFile::of_name(&source, one, grid.format)?;
        let first = one.decode(None, BandReading { weighing: &Weighing::Colour, told_nm: &reading.wavelengths_nm })?;
        let (format, written_as) = (one.format, one.format.written_as(&first.samples));
        let mut info = CaptureInfo::new(name, first.width, first.height, grid.views, grid.lights, written_as);
        info.wavelengths_nm = first.wavelengths_nm;
        if let Some((text, file)) = &manifest {
            manifest::apply(text, &source.shown(*file), &mut info)?;
        }
        info.missing = (0..grid.shots.len()).filter(|pair| grid.shots[*pair].is_empty()).collect();
        info.check_sides().map_err(|reason| CaptureError::BadSides { path: root, reason })?;
        let shots = &grid.shots;
        let is_exposed = shots.iter().flatten().any(|shot| shot.exposure != 1.0);
        let is_rectified = shots.iter().flatten().any(|shot| shot.homography.is_some());
        if is_rectified && reading.rows_up {
            let reason =
                "rows = \"up\" and rectified cannot both be; write maps for the pictures as they are".to_string();
            return Err(CaptureError::BadKeys { path: source.root().display().to_string(), reason });
        }
        if is_rectified != reading.rectified.is_some() {
            return Err(CaptureError::NotRectified { path: source.root().display().to_string() });
        }
        let merged =
            (is_exposed || is_rectified || reading.black.is_some() || reading.flat.is_some()).then_some(info.transfer);
        let folder = manifest.map_or(String::new(), |(_, file)| {
            source.names()[file].rsplit_once('/').map_or(String::new(), |(folder, _)| format!("{folder}/"))
        });
        let (told_nm, shots) = (reading.wavelengths_nm.clone(), grid.shots);
        let mut capture = Capture {
            images: Arc::new(Images::Files { source, format, written_as, told_nm, shots, merged }),
            info,
            corrections: Arc::default(),
            weighing: Weighing::default(),
            groups: None,
            // Calibration images are of the files' size, a mask of the texels'.
            photograph: Some((first.width, first.height)),
            snapped,
        };
        if let Some([width, height]) = reading.rectified {
            (capture.info.width, capture.info.height) = (width, height);
        }
        capture.corrections = Arc::new(capture.corrections_of(&reading, &folder)?);
        if merged.is_some() {
            // The images are linear whatever the files are.
            (capture.info.format, capture.info.transfer) = (ImageFormat::Exr, Transfer::Linear);
        }
        let pair = capture.info.present_pairs().next().unwrap_or(0);
        capture.read(pair / capture.info.lights.len(), pair % capture.info.lights.len())?;
        Ok(capture)
    }

    /// Reads the images of black level, flat field and mask, whose names are relative to `folder`.
    fn corrections_of(&self, reading: &Reading, folder: &str) -> Result<Corrections, CaptureError> {
        let mut found =
            Corrections { rows_up: reading.rows_up, saturation: reading.saturation, ..Corrections::default() };
        let Images::Files { source, merged, format: photographs, .. } = &*self.images else { return Ok(found) };
        let transfer = merged.unwrap_or(self.info.transfer);
        let texels = Some((self.info.width, self.info.height));
        let image = |key: &str, name: &Option<String>, size| -> Result<Option<(String, DecodedImage)>, CaptureError> {
            let Some(name) = name else { return Ok(None) };
            let place = safe_name(name).map(|name| format!("{folder}{name}"));
            let file = place.and_then(|place| source.names().iter().position(|other| *other == place));
            let extension = name.rsplit_once('.').map_or("", |(_, extension)| extension);
            let (Some(file), Some(format)) = (file, FileFormat::from_extension(extension)) else {
                let path = source.shown_name(&format!("{folder}{}", name.escape_debug()));
                let reason = format!("capture.toml names it for `{key}`, and it is no image there");
                return Err(CaptureError::BadImage { path, reason });
            };
            let named = ImageFile::of_name(source, file, format)?;
            if key != "mask" && named.format != *photographs {
                let reason = format!("the photographs are of another format; give `{key}` in theirs");
                return Err(CaptureError::BadImage { path: source.shown(file), reason });
            }
            // A mask has no bands.
            let mut image =
                if key == "mask" { named.decode(size, BandReading::COLOUR)? } else { self.photograph(file, size)? };
            found.turn(&mut image);
            Ok(Some((source.shown(file), image)))
        };
        let black = match image("black", &reading.black, self.photograph)? {
            None => None,
            Some((path, image)) => {
                let black = linear(&image, transfer);
                if black.iter().any(|value| !value.is_finite()) {
                    return Err(CaptureError::BadImage { path, reason: "it holds values that are no numbers".into() });
                }
                Some(black)
            }
        };
        let flat = match image("flat", &reading.flat, self.photograph)? {
            None => None,
            Some((path, image)) => {
                let mut flat = linear(&image, transfer);
                if let Some(black) = &black {
                    flat.iter_mut().zip(black).for_each(|(flat, black)| *flat -= black);
                }
                if let Some(at) = flat.iter().position(|value| !(MIN_FLAT..f32::INFINITY).contains(value)) {
                    let width = self.photograph.map_or(1, |(width, _)| width);
                    let (column, row) = (at / 3 % width, at / 3 / width);
                    let reason = format!("the flat field is dark, or no number, at column {column}, row {row}");
                    return Err(CaptureError::BadImage { path, reason });
                }
                Some(flat)
            }
        };
        let stand_ins = match image("mask", &reading.mask, texels)? {
            None => None,
            Some((path, image)) => {
                let values = linear(&image, Transfer::Linear);
                let valid: Vec<bool> = values.chunks_exact(3).map(|rgb| rgb.iter().sum::<f32>() > 1.5).collect();
                let found = nearest_valid(&valid, self.info.width);
                Some(found.ok_or(CaptureError::BadImage { path, reason: "the mask leaves no texel".into() })?)
            }
        };
        (found.black, found.flat, found.stand_ins) = (black, flat, stand_ins);
        Ok(found)
    }

    /// Returns by how much directions were moved to those that `capture.toml` names; `None` where it names none.
    pub fn snapped(&self) -> Option<Snapped> {
        self.snapped
    }

    /// Returns the description of the capture.
    pub fn info(&self) -> &CaptureInfo {
        &self.info
    }

    /// Returns what a UBO2014 file says beyond the [`CaptureInfo`]; `None` for captures of image files.
    pub fn container(&self) -> Option<&ContainerInfo> {
        match &*self.images {
            Images::Files { .. } | Images::Memory { .. } => None,
            Images::Container(container) => Some(container.info()),
        }
    }

    /// Returns the path of an image for messages: `ARCHIVE: ENTRY` for a zip, the file and the pair for a UBO2014 file.
    ///
    /// # Panics
    /// If `view` or `light` is out of range.
    pub fn path_of(&self, view: usize, light: usize) -> String {
        if let Some((part, light)) = self.part(light) {
            return part.path_of(view, light);
        }
        let pair = self.pair(view, light);
        match &*self.images {
            Images::Files { source, shots, .. } => match shots[pair].last() {
                Some(shot) => source.shown(shot.file),
                None => format!("{}: {}", source.root().display(), self.pair_words(pair)),
            },
            Images::Container(container) => {
                format!("{}: {}", container.path().display(), self.pair_words(pair))
            }
            Images::Memory { .. } => format!("{}: {}", self.info.name, self.pair_words(pair)),
        }
    }

    fn pair_words(&self, pair: usize) -> String {
        let lights = self.info.lights.len();
        let (view, light) = (self.info.views.directions()[pair / lights], self.info.lights.directions()[pair % lights]);
        format!("view {view}, light {light}")
    }

    /// Reads and decodes one image. May be called from many threads; image files are read without a lock. UBO2014 files
    /// compute up to 16 lights of a view at a time (BDI: 256) and keep them for a while, 32 MB (64 MB) for each thread,
    /// so read the pairs in their order.
    ///
    /// # Errors
    /// [`CaptureError::BadImage`] for an image that is empty, cut, damaged or of another kind,
    /// [`CaptureError::NoImage`] for a pair of [`CaptureInfo::missing`],
    /// [`CaptureError::WrongSize`], [`CaptureError::TooLarge`], [`CaptureError::Read`], and [`CaptureError::BadValue`]
    /// for NaN, infinity or a value below [`MIN_LINEAR`]. RGB that is computed, from spectra and UBO2014 files, is
    /// clamped to [`MIN_LINEAR`] instead.
    ///
    /// # Panics
    /// If `view` or `light` is out of range.
    pub fn read(&self, view: usize, light: usize) -> Result<Pixels, CaptureError> {
        if let Some((part, light)) = self.part(light) {
            return part.read(view, light);
        }
        let size = Some((self.info.width, self.info.height));
        if let Images::Files { source, shots, merged: Some(transfer), .. } = &*self.images {
            let shots = &shots[self.pair(view, light)];
            if shots.is_empty() {
                return Err(CaptureError::NoImage { path: self.path_of(view, light) });
            }
            let lit_of = |shot: &Shot| {
                let mut image = self.photograph(shot.file, self.photograph)?;
                self.corrections.turn(&mut image);
                let pixels = [image.width, image.height];
                let light = self.corrections.light(&image, *transfer, shot.exposure);
                let Some(map) = &shot.homography else { return Ok(light) };
                let texels = [self.info.width, self.info.height];
                if !is_within(map, texels, pixels) {
                    let reason = "its map from texels leads out of the picture".to_string();
                    return Err(CaptureError::BadImage { path: source.shown(shot.file), reason });
                }
                let (values, valid) = rectify(&light.values, &light.valid, pixels, map, texels);
                Ok(Light { values, valid, ..light })
            };
            let lit = shots.iter().map(lit_of).collect::<Result<Vec<_>, CaptureError>>()?;
            let samples = Samples::F32(self.corrections.merge(&lit));
            let (width, height) = (self.info.width, self.info.height);
            return self.pixels(view, light, DecodedImage::rgb(width, height, samples));
        }
        let image = self.decode(view, light, size)?;
        self.pixels(view, light, image)
    }

    /// Returns this spectral capture with three channels that are weighted sums of its bands, `weights[band][channel]` in
    /// the order of [`CaptureInfo::wavelengths_nm`], in place of the colours under D65. Sums below [`MIN_LINEAR`] are
    /// clamped to it, as such colours are. The result has no bands any more.
    ///
    /// # Errors
    /// [`CaptureError::NotSpectral`] for a capture without bands, and for one whose photographs are corrected by black
    /// level, flat field, exposures or rectification, which are taken in colours.
    ///
    /// # Panics
    /// If there are more or fewer weights than bands.
    pub fn through(&self, weights: &[[f32; 3]]) -> Result<Capture, CaptureError> {
        let wavelengths_nm = self.bands()?.to_vec();
        assert_eq!(weights.len(), wavelengths_nm.len(), "weights for each band");
        let sums = BandSums { wavelengths_nm, weights: weights.to_vec() };
        let mut capture = Capture { weighing: Weighing::Sums(Arc::new(sums)), ..self.clone() };
        capture.info.wavelengths_nm = Vec::new();
        Ok(capture)
    }

    /// Returns this spectral capture in groups of three channels, each as [`Capture::through`] makes it: its lights are there
    /// once for each group, one round after the other, and light `group * lights + light` has that group's channels.
    ///
    /// # Errors
    /// Those of [`Capture::through`]; [`CaptureError::BadDirections`] for more lights than a set may have.
    ///
    /// # Panics
    /// If there is no group, or one has more or fewer weights than bands.
    pub fn in_groups(&self, groups: &[Vec<[f32; 3]>]) -> Result<Capture, CaptureError> {
        let parts = groups.iter().map(|weights| self.through(weights)).collect::<Result<Vec<_>, _>>()?;
        let mut capture = parts[0].clone();
        let (info, lights) = (&mut capture.info, self.info.lights.len());
        if lights * parts.len() > MAX_DIRECTIONS {
            let reason = format!("{lights} lights, {} times, are more than {MAX_DIRECTIONS}", parts.len());
            return Err(CaptureError::BadDirections { reason });
        }
        info.lights = info.lights.repeated(parts.len());
        let place = |pair: &usize, group: usize| pair / lights * lights * parts.len() + group * lights + pair % lights;
        info.missing =
            (0..parts.len()).flat_map(|group| self.info.missing.iter().map(move |pair| place(pair, group))).collect();
        info.missing.sort_unstable();
        capture.groups = Some(Arc::new(parts));
        Ok(capture)
    }

    /// Returns the part of a capture in groups that has a light, and the light's number there.
    fn part(&self, light: usize) -> Option<(&Capture, usize)> {
        let parts = self.groups.as_ref()?;
        let lights = self.info.lights.len() / parts.len();
        Some((&parts[light / lights], light % lights))
    }

    /// Returns the wavelengths of a capture whose bands can be had.
    fn bands(&self) -> Result<&[f64], CaptureError> {
        let not = |reason: &str| CaptureError::NotSpectral { name: self.info.name.clone(), reason: reason.into() };
        if self.info.wavelengths_nm.is_empty() {
            return Err(not("its images have no bands"));
        }
        if matches!(&*self.images, Images::Files { merged: Some(_), .. }) {
            return Err(not(
                "its images are corrected by black level, flat field, exposures or maps, which are taken in \
                            colours; give images that are corrected already",
            ));
        }
        Ok(&self.info.wavelengths_nm)
    }

    /// Reads all bands of one image, reflectance x cosine `[texel, band]`, in the order of
    /// [`CaptureInfo::wavelengths_nm`]. Values below [`MIN_LINEAR`] are clamped to it.
    ///
    /// # Errors
    /// Those of [`Capture::read`] and [`Capture::through`].
    ///
    /// # Panics
    /// If `view` or `light` is out of range.
    pub fn read_bands(&self, view: usize, light: usize) -> Result<Vec<f32>, CaptureError> {
        self.bands()?;
        let whole = Capture { weighing: Weighing::Bands, ..self.clone() };
        match whole.read(view, light)? {
            Pixels::Linear(values) => Ok(values),
            Pixels::Encoded8(_) => Err(CaptureError::NotSpectral {
                name: self.info.name.clone(),
                reason: "its images are of 8 bits".into(),
            }),
        }
    }

    fn pair(&self, view: usize, light: usize) -> usize {
        assert!(view < self.info.views.len() && light < self.info.lights.len(), "pair ({view}, {light}) out of range");
        view * self.info.lights.len() + light
    }

    /// Decodes the file values of a pair's image, of the last of its photographs.
    fn decode(&self, view: usize, light: usize, size: Option<(usize, usize)>) -> Result<DecodedImage, CaptureError> {
        let pair = self.pair(view, light);
        let mut image = match &*self.images {
            Images::Files { shots, .. } => match shots[pair].last() {
                Some(shot) => self.photograph(shot.file, size)?,
                None => return Err(CaptureError::NoImage { path: self.path_of(view, light) }),
            },
            Images::Container(container) => container.image(view, light),
            Images::Memory { values, wavelengths_nm } => {
                let count = values.len() / self.info.pair_count();
                self.of_memory(&values[pair * count..(pair + 1) * count], wavelengths_nm)?
            }
        };
        if matches!(self.weighing, Weighing::Bands) && image.wavelengths_nm != self.info.wavelengths_nm {
            let reason = "its wavelengths are not those of the capture's first image".to_string();
            return Err(CaptureError::BadImage { path: self.path_of(view, light), reason });
        }
        self.corrections.place(&mut image);
        Ok(image)
    }

    /// Returns an image in memory whose channels are bands if it has wavelengths.
    fn of_memory(&self, stored: &[f32], wavelengths_nm: &[f64]) -> Result<DecodedImage, CaptureError> {
        let (width, height) = (self.info.width, self.info.height);
        if wavelengths_nm.is_empty() {
            return Ok(DecodedImage::rgb(width, height, Samples::F32(stored.to_vec())));
        }
        let bands = self.weighing.of(wavelengths_nm).map_err(|fault| {
            let reason = match fault {
                ImageFault::Damaged(reason) | ImageFault::Unfit(reason) => reason,
                ImageFault::WrongSize { .. } => "their size differs".into(),
            };
            CaptureError::BadImages { reason }
        })?;
        let mut values = vec![0.0; width * height * bands.channels];
        for band in 0..wavelengths_nm.len() {
            bands.add(band, stored[band..].iter().step_by(wavelengths_nm.len()).copied(), &mut values);
        }
        let (channels, wavelengths_nm) = (bands.channels, bands.wavelengths_nm);
        Ok(DecodedImage { width, height, channels, wavelengths_nm, samples: Samples::Computed(values) })
    }

    /// Decodes a photograph, or an image of black level or flat field.
    fn photograph(&self, file: usize, size: Option<(usize, usize)>) -> Result<DecodedImage, CaptureError> {
        let Images::Files { source, format, written_as, told_nm, .. } = &*self.images else {
            return Err(CaptureError::NoImage { path: self.info.name.clone() });
        };
        let image = ImageFile { source, file, format: *format }
            .decode(size, BandReading { weighing: &self.weighing, told_nm })?;
        if format.written_as(&image.samples) != *written_as {
            let [has, other] = match written_as {
                ImageFormat::Exr => ["whole numbers with a curve", "linear values"],
                _ => ["linear values", "whole numbers with a curve"],
            };
            let reason = format!("has {has}, and the capture's first image has {other}; convert it");
            return Err(CaptureError::UnfitImage { path: source.shown(file), reason });
        }
        Ok(image)
    }

    fn pixels(&self, view: usize, light: usize, image: DecodedImage) -> Result<Pixels, CaptureError> {
        let channels = image.channels;
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
                column: at / channels % self.info.width,
                row: at / channels / self.info.width,
                channel: at % channels,
            });
        }
        Ok(Pixels::Linear(linear))
    }
}

/// Finds the images of a source and orders them as a grid.
fn find_grid(source: &Source, list: Option<&str>, reading: &Reading) -> Result<(Grid, Option<Snapped>), CaptureError> {
    let snapped_of = |images: &mut Vec<GridImage>| {
        (reading.views.is_some() || reading.lights.is_some()).then(|| {
            let (largest_deg, left_out) = snap(images, reading.views.as_ref(), reading.lights.as_ref());
            Snapped { largest_deg, left_out }
        })
    };
    match list::find_images(source, list)? {
        Some(mut images) => {
            let snapped = snapped_of(&mut images);
            Ok((grid_of(source, &images, reading.incomplete, &list::missing_name)?, snapped))
        }
        None => {
            let mut images = bonn::find_images(source);
            if images.is_empty() {
                let path = source.root().display().to_string();
                return Err(CaptureError::NoImages { path, files: source.names().len() });
            }
            let snapped = snapped_of(&mut images);
            let name = |grid: &Grid, view, light| bonn::missing_name(source, &images, grid, view, light);
            Ok((grid_of(source, &images, reading.incomplete, &name)?, snapped))
        }
    }
}

/// Returns the first bytes of the file at `path`.
fn first_bytes(path: &Path) -> Result<Vec<u8>, CaptureError> {
    use std::io::Read;
    let mut bytes = Vec::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(16).read_to_end(&mut bytes))
        .map_err(|source| CaptureError::read(path, source))?;
    Ok(bytes)
}

/// Returns the text of the manifest in `bytes`. `shown` is its path for messages.
fn text_of_manifest(bytes: Vec<u8>, shown: &str) -> Result<String, CaptureError> {
    String::from_utf8(bytes).map_err(|error| CaptureError::BadManifest {
        path: shown.into(),
        line: error.as_bytes()[..error.utf8_error().valid_up_to()].iter().filter(|&&b| b == b'\n').count() + 1,
        reason: "it is not UTF-8 text".into(),
    })
}

/// Returns the index of the `capture.toml` nearest to the root; `None` where there is none.
fn find_manifest(source: &Source) -> Option<usize> {
    let names = source.names();
    (0..names.len())
        .filter(|&file| names[file].rsplit('/').next() == Some(MANIFEST_NAME))
        .min_by_key(|&file| names[file].matches('/').count())
}
