//! A capture turned once from images into blocks of texels, so that every later pass reads a texel's whole function in
//! one piece. The blocks lie in memory where they fit, else in a file beside the output, which is removed when the
//! cache is dropped unless finished stages are kept. Texels are in the asset's order: the images of a capture that is
//! turned over are mirrored here.

use crate::error::FitError;
use crate::input::layer_frame::turn_image;
use crate::monitor::Monitor;
use crate::params::{ErrorMeasure, MAX_HALF};
use crate::resume::checkpoint::Stages;
use crate::resume::stored::{Input, Stored};
use blake3::Hasher;
use btf_capture::{Capture, Pixels, Side};
use half::f16;
use rayon::prelude::*;
use std::fs::File;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Texels of a block: 20 MB of 8-bit samples for Bonn's 6,561 pairs.
pub(crate) const TILE_TEXELS: usize = 1024;

/// Returns the samples of `pair` at all `texels` texels, put together from the blocks.
fn image_bytes(decoded: &Decoded, texels: usize, pairs: usize, pair: usize) -> Result<Vec<u8>, FitError> {
    let unit = decoded.form.unit();
    let mut bytes = vec![0; texels * unit];
    for tile in 0..texels.div_ceil(TILE_TEXELS) {
        let texels = tile_texels(tile, texels);
        let start = (texels.start * pairs + pair * texels.len()) * unit;
        decoded.place.read(&mut bytes[texels.start * unit..texels.end * unit], start)?;
    }
    Ok(bytes)
}

/// Returns which of `texels` texels lie in block `tile`.
fn tile_texels(tile: usize, texels: usize) -> Range<usize> {
    tile * TILE_TEXELS..((tile + 1) * TILE_TEXELS).min(texels)
}

/// The capture's samples in blocks. Images are decoded when a block is asked for first.
pub struct TileCache<'a> {
    capture: &'a Capture,
    monitor: &'a Monitor,
    /// Finished stages among which a decoded capture in a file is kept, if any.
    stages: Option<&'a Stages<'a>>,
    memory_bytes: u64,
    directory: PathBuf,
    /// Largest linear sample that is accepted.
    most: f32,
    texels: usize,
    pairs: usize,
    lights: usize,
    /// Mapping to linear samples.
    linear: Mapping,
    decoded: OnceLock<Decoded>,
}

/// Form in which samples are held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
enum Form {
    /// The file's own 8-bit code.
    Encoded8 = 0,
    /// Linear samples in half precision.
    Half = 1,
    /// Linear samples in single precision, where one is above the range of half precision.
    Single = 2,
}

impl Form {
    const ALL: [Form; 3] = [Form::Encoded8, Form::Half, Form::Single];

    /// Returns the bytes of a texel's three samples.
    fn unit(self) -> usize {
        match self {
            Form::Encoded8 => 3,
            Form::Half => 6,
            Form::Single => 12,
        }
    }
}

struct Decoded {
    form: Form,
    place: Place,
}

enum Place {
    Memory(Vec<u8>),
    File { file: File, path: PathBuf, kept: bool },
}

impl Drop for Place {
    fn drop(&mut self) {
        if let Place::File { path, kept: false, .. } = self {
            // Nothing is lost if this fails: the file only holds what the capture holds.
            let _ = std::fs::remove_file(path);
        }
    }
}

impl Place {
    fn write(&mut self, bytes: &[u8], start: usize) -> Result<(), FitError> {
        match self {
            Place::Memory(all) => all[start..start + bytes.len()].copy_from_slice(bytes),
            Place::File { file, path, .. } => {
                write_at(file, bytes, start as u64).map_err(|source| FitError::File {
                    path: path.clone(),
                    action: "writing the decoded capture",
                    source,
                    remedy: "free some space there or raise --memory",
                })?;
            }
        }
        Ok(())
    }

    fn read(&self, bytes: &mut [u8], start: usize) -> Result<(), FitError> {
        match self {
            Place::Memory(all) => bytes.copy_from_slice(&all[start..start + bytes.len()]),
            Place::File { file, path, .. } => {
                read_at(file, bytes, start as u64).map_err(|source| FitError::File {
                    path: path.clone(),
                    action: "reading the decoded capture back",
                    source,
                    remedy: "run the fit again",
                })?;
            }
        }
        Ok(())
    }
}

/// A decoded capture's images, as the capture itself gives them.
pub struct DecodedImages {
    decoded: Decoded,
    texels: usize,
    pairs: usize,
    width: usize,
    side: Side,
}

impl DecodedImages {
    /// Returns the image of `pair` (`view * lights + light`).
    ///
    /// # Errors
    /// If the temporary file cannot be read back.
    pub fn read(&self, pair: usize) -> Result<Pixels, FitError> {
        let mut bytes = image_bytes(&self.decoded, self.texels, self.pairs, pair)?;
        Ok(match self.decoded.form {
            Form::Encoded8 => {
                turn_image(&mut bytes, self.width, self.side);
                Pixels::Encoded8(bytes)
            }
            _ => {
                let mut values: Vec<f32> =
                    bytes.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
                turn_image(&mut values, self.width, self.side);
                Pixels::Linear(values)
            }
        })
    }
}

/// Returns a function that reads the image of a view and a light of `capture`: from `decoded` where the images are in
/// memory, else from the capture's files.
pub fn read_images<'a>(
    capture: &'a Capture,
    decoded: Option<&'a DecodedImages>,
) -> impl Fn(usize, usize) -> Result<Pixels, FitError> + Sync + 'a {
    move |view, light| match decoded {
        Some(images) => images.read(view * capture.info().lights.len() + light),
        None => Ok(capture.read(view, light)?),
    }
}

/// Record beside a decoded capture's file, by which a later run sees that the file is whole.
struct Record {
    form: u8,
    /// Hash of each block.
    blocks: Vec<[u8; 32]>,
}

impl Stored for Record {
    fn put(&self, to: &mut dyn std::io::Write) -> std::io::Result<()> {
        self.form.put(to)?;
        self.blocks.put(to)
    }

    fn take(from: &mut Input) -> std::io::Result<Record> {
        Ok(Record { form: u8::take(from)?, blocks: Vec::take(from)? })
    }
}

/// A block of texels, each with all its samples.
pub struct Tile<'a> {
    cache: &'a TileCache<'a>,
    form: Form,
    /// Range of the block's texels.
    pub texels: Range<usize>,
    /// Samples, `[texel, pair, channel]`.
    samples: Vec<u8>,
}

impl<'a> TileCache<'a> {
    /// Reads every image of `capture` once, in parallel. A pair without an image is black.
    ///
    /// Holds the samples in memory if they take at most half of `memory_bytes`, else in a temporary file
    /// in `directory`. Needs beside them two views' worth of images.
    pub fn build(
        capture: &'a Capture,
        memory_bytes: u64,
        directory: &Path,
        monitor: &'a Monitor,
    ) -> Result<TileCache<'a>, FitError> {
        let cache = TileCache::new(capture, memory_bytes, directory, f32::INFINITY, None, monitor)?;
        cache.decoded()?;
        Ok(cache)
    }

    /// Returns a cache whose images are read (as the stage `read`) only when the first block is asked for;
    /// [`TileCache::build`] reads them at once. A decoded capture that does not fit into memory is kept among `stages`.
    /// A sample above `most` is an error.
    pub(crate) fn new(
        capture: &'a Capture,
        memory_bytes: u64,
        directory: &Path,
        most: f32,
        stages: Option<&'a Stages<'a>>,
        monitor: &'a Monitor,
    ) -> Result<TileCache<'a>, FitError> {
        let info = capture.info();
        let lights = info.lights.len();
        let first = info.present_pairs().next().unwrap_or(0);
        let tables = match capture.read(first / lights, first % lights)? {
            Pixels::Encoded8(_) => (0..lights).map(|light| info.linear_from_encoded8(light)).collect(),
            Pixels::Linear(_) => Vec::new(),
        };
        Ok(TileCache {
            capture,
            monitor,
            stages,
            memory_bytes,
            directory: directory.to_path_buf(),
            most,
            texels: info.texel_count(),
            pairs: info.pair_count(),
            lights,
            linear: Mapping { tables, curve: Box::new(|x| x) },
            decoded: OnceLock::new(),
        })
    }

    /// Returns the decoded samples: from memory, else from what an earlier run kept, else by decoding the images.
    fn decoded(&self) -> Result<&Decoded, FitError> {
        if let Some(decoded) = self.decoded.get() {
            return Ok(decoded);
        }
        let found = match self.kept() {
            Some(kept) => kept,
            None => self.monitor.stage("read", || {
                if !self.linear.tables.is_empty() {
                    return Ok(self.decode(Form::Encoded8)?.unwrap_or_else(|| unreachable!("codes fit into bytes")));
                }
                match self.decode(Form::Half)? {
                    Some(decoded) => Ok(decoded),
                    None => Ok(self.decode(Form::Single)?.unwrap_or_else(|| unreachable!("floats fit into floats"))),
                }
            })?,
        };
        Ok(self.decoded.get_or_init(|| found))
    }

    /// Returns what an earlier run decoded into a file, if every block of it is unchanged.
    fn kept(&self) -> Option<Decoded> {
        let stages = self.stages?;
        let path = stages.texels_path()?;
        let record: Record = stages.load("read")?;
        let form = *Form::ALL.get(usize::from(record.form))?;
        let whole = || -> std::io::Result<Option<File>> {
            let file = File::open(&path)?;
            if file.metadata()?.len() != (self.texels * self.pairs * form.unit()) as u64 {
                return Ok(None);
            }
            if record.blocks.len() != self.tile_count() {
                return Ok(None);
            }
            for (tile, hash) in record.blocks.iter().enumerate() {
                let range = self.tile_range(tile, form);
                let mut bytes = vec![0; range.len()];
                read_at(&file, &mut bytes, range.start as u64)?;
                if *blake3::hash(&bytes).as_bytes() != *hash {
                    return Ok(None);
                }
            }
            Ok(Some(file))
        };
        match whole() {
            Ok(Some(file)) => {
                self.monitor.skip("read");
                Some(Decoded { form, place: Place::File { file, path, kept: true } })
            }
            _ => {
                stages.ignore(&path);
                None
            }
        }
    }

    /// Returns a new file for the decoded capture: among the kept stages, else a temporary one.
    fn make_file(&self, bytes: usize) -> Result<Place, FitError> {
        let kept = self.stages.and_then(Stages::texels_path);
        let shown = kept.as_deref().unwrap_or(&self.directory).to_path_buf();
        let fail = |source| FitError::File {
            path: shown.clone(),
            action: "making a file for the decoded capture",
            source,
            remedy: "free some space there or write the asset elsewhere",
        };
        let (file, path, kept) = match kept {
            Some(path) => {
                let file = File::options().read(true).write(true).create(true).truncate(true).open(&path);
                (file.map_err(fail)?, path, true)
            }
            None => {
                let temporary = tempfile::Builder::new().prefix(".btf-fit-").tempfile_in(&self.directory);
                let (file, path) = temporary.and_then(|file| file.keep().map_err(|error| error.error)).map_err(fail)?;
                (file, path, false)
            }
        };
        file.set_len(bytes as u64).map_err(fail)?;
        Ok(Place::File { file, path, kept })
    }

    /// Decodes all images into `form`; `None` if a sample does not fit into it.
    fn decode(&self, form: Form) -> Result<Option<Decoded>, FitError> {
        let (capture, info) = (self.capture, self.capture.info());
        let total = self.texels * self.pairs * form.unit();
        let place =
            if total as u64 <= self.memory_bytes / 2 { Place::Memory(vec![0; total]) } else { self.make_file(total)? };
        let keep = matches!(place, Place::File { kept: true, .. });
        let mut decoded = Decoded { form, place };
        let mut hashers = if keep { vec![Hasher::new(); self.tile_count()] } else { Vec::new() };
        // Batches bound the images in memory to about an eighth of the limit.
        let image_bytes = self.texels * form.unit();
        let batch = ((self.memory_bytes / 8) as usize / image_bytes.max(1)).clamp(1, 256);
        for first in (0..self.pairs).step_by(batch) {
            let range = first..(first + batch).min(self.pairs);
            let images: Vec<Vec<u8>> = range
                .clone()
                .into_par_iter()
                .map(|pair| {
                    self.monitor.check()?;
                    if !info.has_image(pair) {
                        return Ok(vec![0; image_bytes]);
                    }
                    Ok(match (capture.read(pair / self.lights, pair % self.lights)?, form) {
                        (Pixels::Encoded8(mut codes), _) => {
                            turn_image(&mut codes, info.width, info.side);
                            codes
                        }
                        (Pixels::Linear(mut values), Form::Single) => {
                            if let Some(value) = values.iter().copied().find(|x| *x > self.most) {
                                let path = capture.path_of(pair / self.lights, pair % self.lights);
                                let remedy = if value <= ErrorMeasure::Gamma.most() {
                                    "use --error gamma"
                                } else {
                                    "divide all images of the capture by one number"
                                };
                                return Err(FitError::TooBright { path, value, most: self.most, remedy });
                            }
                            turn_image(&mut values, info.width, info.side);
                            values.iter().flat_map(|x| x.to_le_bytes()).collect()
                        }
                        (Pixels::Linear(values), _) if values.iter().any(|x| *x > MAX_HALF) => Vec::new(),
                        (Pixels::Linear(mut values), _) => {
                            turn_image(&mut values, info.width, info.side);
                            values.iter().flat_map(|x| f16::from_f32(*x).to_bits().to_le_bytes()).collect()
                        }
                    })
                })
                .collect::<Result<_, FitError>>()?;
            if form == Form::Half && images.iter().any(Vec::is_empty) {
                return Ok(None);
            }
            if images.iter().any(|image| image.len() != image_bytes) {
                return Err(FitError::Params(format!(
                    "{}: the capture mixes 8-bit and linear images; convert them to one kind",
                    capture.path_of(first / self.lights, first % self.lights)
                )));
            }
            self.store(&mut decoded, &mut hashers, range, &images)?;
            self.monitor.report("read", (first + batch).min(self.pairs), self.pairs)?;
        }
        if let (Place::File { file, kept: true, .. }, Some(stages)) = (&decoded.place, self.stages) {
            // The record must not outlive blocks that a power cut took.
            if file.sync_all().is_ok() {
                let blocks = hashers.iter().map(|hasher| *hasher.finalize().as_bytes()).collect();
                stages.keep("read", &Record { form: form as u8, blocks });
            }
        }
        Ok(Some(decoded))
    }

    /// Returns the number of blocks.
    pub fn tile_count(&self) -> usize {
        self.texels.div_ceil(TILE_TEXELS)
    }

    /// Returns the number of texels of the capture.
    pub fn texel_count(&self) -> usize {
        self.texels
    }

    /// Returns whether samples are held as the 8-bit codes of the files.
    pub(crate) fn is_encoded(&self) -> Result<bool, FitError> {
        Ok(self.decoded()?.form == Form::Encoded8)
    }

    /// Returns the number of direction pairs.
    pub fn pair_count(&self) -> usize {
        self.pairs
    }

    /// Returns the byte range of block `tile`; within it samples lie `[pair, texel, channel]`.
    fn tile_range(&self, tile: usize, form: Form) -> Range<usize> {
        let texels = self.tile_texels(tile);
        let texel_bytes = self.pairs * form.unit();
        texels.start * texel_bytes..texels.end * texel_bytes
    }

    /// Returns which texels lie in block `tile`.
    pub fn tile_texels(&self, tile: usize) -> Range<usize> {
        tile_texels(tile, self.texels)
    }

    /// Returns the decoded images if all of them are held exactly as they were read. `None` where they are rounded to
    /// half precision, or where a resumed run read none.
    pub fn into_images(self) -> Option<DecodedImages> {
        let (texels, pairs, info) = (self.texels, self.pairs, self.capture.info());
        let decoded = self.decoded.into_inner().filter(|decoded| decoded.form != Form::Half)?;
        Some(DecodedImages { decoded, texels, pairs, width: info.width, side: info.side })
    }

    fn store(
        &self,
        decoded: &mut Decoded,
        hashers: &mut [Hasher],
        pairs: Range<usize>,
        images: &[Vec<u8>],
    ) -> Result<(), FitError> {
        let unit = decoded.form.unit();
        let mut run = Vec::new();
        for tile in 0..self.tile_count() {
            let texels = self.tile_texels(tile);
            run.clear();
            for image in images {
                run.extend_from_slice(&image[texels.start * unit..texels.end * unit]);
            }
            let start = self.tile_range(tile, decoded.form).start + pairs.start * texels.len() * unit;
            decoded.place.write(&run, start)?;
            // The runs of a block come in its own order.
            if let Some(hasher) = hashers.get_mut(tile) {
                hasher.update(&run);
            }
        }
        Ok(())
    }

    /// Returns the texels `chosen` (ascending) as one block: its texel `i` is `chosen[i]`. Memory: their samples.
    pub fn gather(&self, chosen: &[usize]) -> Result<Tile<'_>, FitError> {
        let form = self.decoded()?.form;
        let unit = form.unit();
        let stride = self.pairs * unit;
        let mut samples = vec![0; chosen.len() * stride];
        let mut next = 0;
        for tile in 0..self.tile_count() {
            let texels = self.tile_texels(tile);
            let first = next;
            while next < chosen.len() && chosen[next] < texels.end {
                next += 1;
            }
            if first == next {
                continue;
            }
            self.with_pair_major(tile, |pair_major| {
                let to = &mut samples[first * stride..next * stride];
                to.par_chunks_mut(stride).zip(&chosen[first..next]).for_each(|(to, texel)| {
                    for (pair, to) in to.chunks_exact_mut(unit).enumerate() {
                        let from = (pair * texels.len() + texel - texels.start) * unit;
                        to.copy_from_slice(&pair_major[from..from + unit]);
                    }
                });
            })?;
        }
        Ok(Tile { cache: self, form, texels: 0..chosen.len(), samples })
    }

    /// Returns the image of `pair` through `mapping`, `[texel, channel]`, texels in the asset's order.
    pub fn image(&self, pair: usize, mapping: &Mapping) -> Result<Vec<f32>, FitError> {
        let (decoded, light) = (self.decoded()?, pair % self.lights);
        let bytes = image_bytes(decoded, self.texels, self.pairs, pair)?;
        Ok(match decoded.form {
            Form::Encoded8 => bytes.iter().map(|code| mapping.tables[light][usize::from(*code)]).collect(),
            Form::Half => {
                let halves = bytes.as_chunks::<2>().0.iter().map(|bytes| f16::from_le_bytes(*bytes).to_f32());
                halves.map(&mapping.curve).collect()
            }
            Form::Single => {
                let singles = bytes.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes));
                singles.map(&mapping.curve).collect()
            }
        })
    }

    /// Calls `work` with block `tile` as it is stored, `[pair, texel, channel]`, and returns its result.
    fn with_pair_major<R>(&self, tile: usize, work: impl FnOnce(&[u8]) -> R) -> Result<R, FitError> {
        let decoded = self.decoded()?;
        let range = self.tile_range(tile, decoded.form);
        match &decoded.place {
            Place::Memory(bytes) => Ok(work(&bytes[range])),
            place => {
                let mut bytes = vec![0; range.len()];
                place.read(&mut bytes, range.start)?;
                Ok(work(&bytes))
            }
        }
    }

    /// Reads block `tile` and turns it texel-major.
    pub fn read(&self, tile: usize) -> Result<Tile<'_>, FitError> {
        let (texels, form) = (self.tile_texels(tile), self.decoded()?.form);
        let samples =
            self.with_pair_major(tile, |pair_major| self.texel_major(pair_major, texels.len(), form.unit()))?;
        Ok(Tile { cache: self, form, texels, samples })
    }

    fn texel_major(&self, pair_major: &[u8], count: usize, unit: usize) -> Vec<u8> {
        match unit {
            3 => self.texel_major_of::<3>(pair_major, count),
            6 => self.texel_major_of::<6>(pair_major, count),
            _ => self.texel_major_of::<12>(pair_major, count),
        }
    }

    fn texel_major_of<const UNIT: usize>(&self, pair_major: &[u8], count: usize) -> Vec<u8> {
        // Blocked, so that both sides stay in the cache.
        const BLOCK: usize = 64;
        let mut samples = vec![0; pair_major.len()];
        let (from, _) = pair_major.as_chunks::<UNIT>();
        samples.as_chunks_mut::<UNIT>().0.par_chunks_mut(BLOCK * self.pairs).enumerate().for_each(|(block, to)| {
            for pair_block in (0..self.pairs).step_by(BLOCK) {
                for (i, to) in to.chunks_exact_mut(self.pairs).enumerate() {
                    for pair in pair_block..(pair_block + BLOCK).min(self.pairs) {
                        to[pair] = from[pair * count + block * BLOCK + i];
                    }
                }
            }
        });
        samples
    }
}

impl Tile<'_> {
    /// Writes the samples of the block's texel `index` through `mapping` into `out`, `[pair, channel]`.
    pub fn texel_mapped(&self, index: usize, out: &mut [f32], mapping: &Mapping) {
        let stride = self.cache.pairs * self.form.unit();
        let samples = &self.samples[index * stride..(index + 1) * stride];
        if self.form == Form::Single {
            for (out, bytes) in out.iter_mut().zip(samples.chunks_exact(4)) {
                *out = (mapping.curve)(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
            }
        } else if self.form == Form::Encoded8 {
            let row = self.cache.lights * 3;
            for (out, codes) in out.chunks_exact_mut(row).zip(samples.chunks_exact(row)) {
                let (out, codes) = (out.as_chunks_mut::<3>().0, codes.as_chunks::<3>().0);
                for ((out, codes), table) in out.iter_mut().zip(codes).zip(&mapping.tables) {
                    *out = codes.map(|code| table[usize::from(code)]);
                }
            }
        } else {
            for (out, bytes) in out.iter_mut().zip(samples.chunks_exact(2)) {
                *out = (mapping.curve)(f16::from_bits(u16::from_le_bytes([bytes[0], bytes[1]])).to_f32());
            }
        }
    }

    /// Writes linear reflectance times cosine of the block's texel `index` into `out`, `[pair, channel]`.
    pub fn texel_linear(&self, index: usize, out: &mut [f32]) {
        self.texel_mapped(index, out, &self.cache.linear);
    }
}

/// A curve applied to samples as they are read; tabulated for 8-bit captures.
pub struct Mapping {
    tables: Vec<[f32; 256]>,
    curve: Box<dyn Fn(f32) -> f32 + Sync + Send>,
}

impl Mapping {
    /// Returns the mapping of a sample to `curve` of its linear value.
    pub fn new(cache: &TileCache, curve: impl Fn(f32) -> f32 + Sync + Send + 'static) -> Mapping {
        let tables = cache.linear.tables.iter().map(|table| table.map(&curve)).collect();
        Mapping { tables, curve: Box::new(curve) }
    }
}

#[cfg(unix)]
fn write_at(file: &File, bytes: &[u8], offset: u64) -> std::io::Result<()> {
    std::os::unix::fs::FileExt::write_all_at(file, bytes, offset)
}

#[cfg(unix)]
fn read_at(file: &File, bytes: &mut [u8], offset: u64) -> std::io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, offset)
}

#[cfg(windows)]
fn write_at(file: &File, mut bytes: &[u8], mut offset: u64) -> std::io::Result<()> {
    while !bytes.is_empty() {
        let written = std::os::windows::fs::FileExt::seek_write(file, bytes, offset)?;
        bytes = &bytes[written..];
        offset += written as u64;
    }
    Ok(())
}

#[cfg(windows)]
fn read_at(file: &File, mut bytes: &mut [u8], mut offset: u64) -> std::io::Result<()> {
    while !bytes.is_empty() {
        let read = std::os::windows::fs::FileExt::seek_read(file, bytes, offset)?;
        if read == 0 {
            return Err(std::io::ErrorKind::UnexpectedEof.into());
        }
        bytes = &mut bytes[read..];
        offset += read as u64;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
