//! A capture turned from images into blocks of texels, once, so that every later pass reads a texel's
//! whole function at a stretch. In memory where it fits, else in a file beside the output that is
//! gone when the cache is dropped. Texels are in the asset's order: the images of a capture that is turned
//! over are mirrored here.

use crate::error::FitError;
use crate::frame::turn_image;
use crate::monitor::Monitor;
use btf_capture::{Capture, Pixels};
use half::f16;
use rayon::prelude::*;
use std::fs::File;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Texels of a block: 20 MB of 8-bit samples for Bonn's 6,561 pairs.
const TILE_TEXELS: usize = 1024;

/// The capture's samples in blocks.
pub struct TileCache {
    texels: usize,
    pairs: usize,
    lights: usize,
    eight_bit: bool,
    /// Samples as they are, linear.
    linear: Mapping,
    storage: Storage,
}

enum Storage {
    Memory(Vec<u8>),
    File { file: File, path: PathBuf },
}

impl Drop for TileCache {
    fn drop(&mut self) {
        if let Storage::File { path, .. } = &self.storage {
            // Nothing is lost if this fails: the file only holds what the capture holds.
            let _ = std::fs::remove_file(path);
        }
    }
}

/// A block of texels, each with all its samples.
pub struct Tile<'a> {
    cache: &'a TileCache,
    /// Which texels.
    pub texels: Range<usize>,
    /// `[texel, pair, channel]` codes, or half-precision bits for linear captures.
    samples: Vec<u8>,
}

impl TileCache {
    /// Reads every image of `capture` once, in parallel.
    ///
    /// Holds the samples in memory if they take at most half of `memory_bytes`, else in a temporary file
    /// in `directory`. Needs beside them two views' worth of images.
    pub fn build(
        capture: &Capture,
        memory_bytes: u64,
        directory: &Path,
        monitor: &Monitor,
    ) -> Result<TileCache, FitError> {
        let info = capture.info();
        let (texels, views, lights) = (info.texel_count(), info.views.len(), info.lights.len());
        let pairs = views * lights;
        let eight_bit = matches!(capture.read(0, 0)?, Pixels::Encoded8(_));
        let bytes_per_sample = if eight_bit { 1 } else { 2 };
        let total = texels * pairs * 3 * bytes_per_sample;
        let storage = if total as u64 <= memory_bytes / 2 {
            Storage::Memory(vec![0; total])
        } else {
            let fail = |source| FitError::File {
                path: directory.to_path_buf(),
                action: "making a temporary file for the decoded capture",
                source,
                remedy: "free some space there or write the asset elsewhere",
            };
            let (file, path) = tempfile::Builder::new()
                .prefix(".btf-fit-")
                .tempfile_in(directory)
                .and_then(|temporary| temporary.keep().map_err(|error| error.error))
                .map_err(fail)?;
            file.set_len(total as u64).map_err(fail)?;
            Storage::File { file, path }
        };
        let tables =
            if eight_bit { (0..lights).map(|light| info.linear_from_encoded8(light)).collect() } else { Vec::new() };
        let mut cache =
            TileCache { texels, pairs, lights, eight_bit, linear: Mapping { tables, curve: Box::new(|x| x) }, storage };

        // Batches bound the images in memory to about an eighth of the limit.
        let image_bytes = texels * 3 * bytes_per_sample;
        let batch = ((memory_bytes / 8) as usize / image_bytes.max(1)).clamp(1, 256);
        for first in (0..pairs).step_by(batch) {
            let range = first..(first + batch).min(pairs);
            let images: Vec<Vec<u8>> = range
                .clone()
                .into_par_iter()
                .map(|pair| {
                    monitor.check()?;
                    Ok(match capture.read(pair / lights, pair % lights)? {
                        Pixels::Encoded8(mut codes) => {
                            turn_image(&mut codes, info.width, info.side);
                            codes
                        }
                        Pixels::Linear(mut values) => {
                            turn_image(&mut values, info.width, info.side);
                            let half = |x: &f32| f16::from_f32(x.clamp(-65504.0, 65504.0)).to_bits().to_le_bytes();
                            values.iter().flat_map(half).collect()
                        }
                    })
                })
                .collect::<Result<_, FitError>>()?;
            if images.iter().any(|image| image.len() != image_bytes) {
                return Err(FitError::Params(format!(
                    "{}: the capture mixes 8-bit and linear images; convert them to one kind",
                    capture.path_of(first / lights, first % lights)
                )));
            }
            cache.store(range, &images)?;
            monitor.report("read", (first + batch).min(pairs), pairs)?;
        }
        Ok(cache)
    }

    /// Blocks.
    pub fn tile_count(&self) -> usize {
        self.texels.div_ceil(TILE_TEXELS)
    }

    /// Texels of the whole capture.
    pub fn texel_count(&self) -> usize {
        self.texels
    }

    /// Direction pairs.
    pub fn pair_count(&self) -> usize {
        self.pairs
    }

    /// Bytes that [`TileCache::read`] allocates at most, for the caller's memory plan.
    pub fn tile_bytes(&self) -> usize {
        2 * TILE_TEXELS.min(self.texels) * self.pairs * self.sample_bytes()
    }

    fn sample_bytes(&self) -> usize {
        if self.eight_bit { 3 } else { 6 }
    }

    /// Byte range of a block; within it samples lie `[pair, texel, channel]`.
    fn tile_range(&self, tile: usize) -> Range<usize> {
        let texels = self.tile_texels(tile);
        let texel_bytes = self.pairs * self.sample_bytes();
        texels.start * texel_bytes..texels.end * texel_bytes
    }

    /// Texels of block `tile`.
    pub fn tile_texels(&self, tile: usize) -> Range<usize> {
        tile * TILE_TEXELS..((tile + 1) * TILE_TEXELS).min(self.texels)
    }

    fn store(&mut self, pairs: Range<usize>, images: &[Vec<u8>]) -> Result<(), FitError> {
        let unit = self.sample_bytes();
        let mut run = Vec::new();
        for tile in 0..self.tile_count() {
            let texels = self.tile_texels(tile);
            run.clear();
            for image in images {
                run.extend_from_slice(&image[texels.start * unit..texels.end * unit]);
            }
            let start = self.tile_range(tile).start + pairs.start * texels.len() * unit;
            match &mut self.storage {
                Storage::Memory(bytes) => bytes[start..start + run.len()].copy_from_slice(&run),
                Storage::File { file, path } => {
                    write_at(file, &run, start as u64).map_err(|source| FitError::File {
                        path: path.clone(),
                        action: "writing the decoded capture",
                        source,
                        remedy: "free some space there or raise --memory",
                    })?
                }
            }
        }
        Ok(())
    }

    /// The texels `chosen` (ascending) as one block: its texel `i` is `chosen[i]`. Memory: their samples.
    pub fn gather(&self, chosen: &[usize]) -> Result<Tile<'_>, FitError> {
        let unit = self.sample_bytes();
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
                for (i, texel) in chosen[first..next].iter().enumerate() {
                    let to = &mut samples[(first + i) * stride..(first + i + 1) * stride];
                    for (pair, to) in to.chunks_exact_mut(unit).enumerate() {
                        let from = (pair * texels.len() + texel - texels.start) * unit;
                        to.copy_from_slice(&pair_major[from..from + unit]);
                    }
                }
            })?;
        }
        Ok(Tile { cache: self, texels: 0..chosen.len(), samples })
    }

    /// Block `tile` as it lies: `[pair, texel, channel]`.
    fn with_pair_major<R>(&self, tile: usize, work: impl FnOnce(&[u8]) -> R) -> Result<R, FitError> {
        let range = self.tile_range(tile);
        match &self.storage {
            Storage::Memory(bytes) => Ok(work(&bytes[range])),
            Storage::File { file, path } => {
                let mut bytes = vec![0; range.len()];
                read_at(file, &mut bytes, range.start as u64).map_err(|source| FitError::File {
                    path: path.clone(),
                    action: "reading the decoded capture back",
                    source,
                    remedy: "run the fit again",
                })?;
                Ok(work(&bytes))
            }
        }
    }

    /// Reads block `tile` and turns it texel-major.
    pub fn read(&self, tile: usize) -> Result<Tile<'_>, FitError> {
        let (texels, unit) = (self.tile_texels(tile), self.sample_bytes());
        let samples = self.with_pair_major(tile, |pair_major| self.texel_major(pair_major, texels.len(), unit))?;
        Ok(Tile { cache: self, texels, samples })
    }

    fn texel_major(&self, pair_major: &[u8], count: usize, unit: usize) -> Vec<u8> {
        let mut samples = vec![0; pair_major.len()];
        let stride = self.pairs * unit;
        // Blocked, so that both sides stay in the cache.
        const BLOCK: usize = 64;
        for pair_block in (0..self.pairs).step_by(BLOCK) {
            for texel_block in (0..count).step_by(BLOCK) {
                for pair in pair_block..(pair_block + BLOCK).min(self.pairs) {
                    for texel in texel_block..(texel_block + BLOCK).min(count) {
                        let from = (pair * count + texel) * unit;
                        let to = texel * stride + pair * unit;
                        samples[to..to + unit].copy_from_slice(&pair_major[from..from + unit]);
                    }
                }
            }
        }
        samples
    }
}

impl Tile<'_> {
    /// Samples of the block's texel `index` through `mapping`: `out` is `[pair, channel]`.
    pub fn texel_mapped(&self, index: usize, out: &mut [f32], mapping: &Mapping) {
        let stride = self.cache.pairs * self.cache.sample_bytes();
        let samples = &self.samples[index * stride..(index + 1) * stride];
        if self.cache.eight_bit {
            let row = self.cache.lights * 3;
            for (out, codes) in out.chunks_exact_mut(row).zip(samples.chunks_exact(row)) {
                for ((out, codes), table) in out.chunks_exact_mut(3).zip(codes.chunks_exact(3)).zip(&mapping.tables) {
                    for c in 0..3 {
                        out[c] = table[usize::from(codes[c])];
                    }
                }
            }
        } else {
            for (out, bytes) in out.iter_mut().zip(samples.chunks_exact(2)) {
                *out = (mapping.curve)(f16::from_bits(u16::from_le_bytes([bytes[0], bytes[1]])).to_f32());
            }
        }
    }

    /// Linear reflectance times cosine of the block's texel `index`, `[pair, channel]`.
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
    /// `curve` of the linear sample.
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
