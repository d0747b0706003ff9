//! Reads UBO2014 files (`.btf`): DFMF, FMF, PVF and BDI, whose images are computed when they are asked for.
//!
//! The layout is the one that the published readers agree on [Weinmann 2014]; docs/guide/captures.md describes it. Numbers
//! are little endian. The file is mapped, never loaded: memory holds the directions, a few numbers per matrix, and the
//! blocks of images that were asked for last.

mod bdi;
mod blocks;
mod colour_model;
mod factored;
mod header;
mod matrix;

use std::path::{Path, PathBuf};

use bdi::Bdi;
use blocks::Blocks;
use colour_model::{Reduction, ToRgb};
use factored::{Factored, read_height_map};
use header::{Cursor, Header, read_header, read_signature};

pub use header::ContainerKind;
pub(crate) use header::is_container;

use crate::error::CaptureError;
use crate::images::decoded::{DecodedImage, Samples};
use crate::info::{CaptureInfo, Cosine, ImageFormat};
use crate::shared_bytes::SharedBytes;

/// Bytes, and largest number, of the images that a factorised file computes at a time: enough that reading the matrix
/// over texels costs little beside the product.
const FACTORED_BLOCK: (usize, usize) = (32 << 20, 16);

/// Bytes, and largest number, of the images that a BDI file computes at a time. The samples of a view stand together
/// there, and each block walks over all texels.
const BDI_BLOCK: (usize, usize) = (64 << 20, 256);

/// Displacement map that lies in a file beside the samples.
#[derive(Debug, Clone, PartialEq)]
pub struct HeightMap {
    /// Number of values per row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Heights `[row, column]`, in the unit of the file.
    pub values: Vec<f32>,
}

/// Description of a UBO2014 file beyond its [`CaptureInfo`].
#[derive(Debug, Clone, PartialEq)]
pub struct ContainerInfo {
    /// Kind of the file.
    pub kind: ContainerKind,
    /// Names of the colour channels: wavelengths in nanometres, or R, G and B.
    pub channels: Vec<String>,
    /// Number of the colour model of a DFMF file, see docs/guide/captures.md; 0 for other kinds.
    pub colour_model: i32,
    /// Maximum number of components over all matrix factorisations of the file; 0 for BDI files, which have none.
    pub components: usize,
    /// Factors of red, green and blue that the measurement notes. They are not applied.
    pub rgb_scale: [f32; 3],
    /// Rotations of local frames, row-major; usually none. They are not applied.
    pub rotations: Vec<[f32; 9]>,
    /// Displacement map of an FMF file.
    pub height_map: Option<HeightMap>,
}

#[derive(Debug)]
enum Data {
    Factored(Factored),
    Bdi(Bdi),
}

/// An open UBO2014 file.
#[derive(Debug)]
pub(crate) struct Container {
    path: PathBuf,
    bytes: SharedBytes,
    data: Data,
    info: ContainerInfo,
    size: (usize, usize),
    /// Indices in the file of the views and lights of the sorted sets.
    views: Vec<usize>,
    lights: Vec<usize>,
    /// Number of lights in a block.
    block_lights: usize,
    blocks: Blocks,
}

impl Container {
    /// Opens the file at `path` and describes the capture; everything is checked against the file's length.
    pub(crate) fn open(path: &Path, name: String) -> Result<(Container, CaptureInfo), CaptureError> {
        let bad = |reason: String| CaptureError::BadContainer { path: path.display().to_string(), reason };
        let bytes = SharedBytes::map(path)?.ok_or_else(|| bad("it is an empty file".into()))?;
        let (header, data, info) = read(bytes.as_ref()).map_err(bad)?;

        let size = (header.width, header.height);
        let mut capture = CaptureInfo::new(name, size.0, size.1, header.views.set, header.lights.set, ImageFormat::Exr);
        capture.cosine = if header.cosine_included { Cosine::Included } else { Cosine::Excluded };
        let millimetres = |texels: usize| texels as f32 / header.texels_per_mm;
        let size_mm = [millimetres(size.0), millimetres(size.1)];
        capture.size_mm = size_mm.iter().all(|mm| mm.is_normal() && *mm > 0.0).then_some(size_mm);
        capture.provenance = provenance(&info, &header.words);

        let (bytes_at_a_time, most) = match data {
            Data::Factored(_) => FACTORED_BLOCK,
            Data::Bdi(_) => BDI_BLOCK,
        };
        let block_lights = (bytes_at_a_time / (size.0 * size.1 * 12)).clamp(1, most);
        let (views, lights) = (header.views.in_file, header.lights.in_file);
        let path = path.to_path_buf();
        let blocks = Blocks::default();
        Ok((Container { path, bytes, data, info, size, views, lights, block_lights, blocks }, capture))
    }

    pub(crate) fn info(&self) -> &ContainerInfo {
        &self.info
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the image of a pair. Images of neighbouring lights are computed with it and kept for a while.
    pub(crate) fn image(&self, view: usize, light: usize) -> DecodedImage {
        let block = light / self.block_lights;
        let first = block * self.block_lights;
        let lights = &self.lights[first..(first + self.block_lights).min(self.lights.len())];
        let make = || match &self.data {
            Data::Factored(data) => data.images(self.bytes.as_ref(), self.views[view], lights),
            Data::Bdi(data) => data.images(self.bytes.as_ref(), self.views[view], lights),
        };
        let (width, height) = self.size;
        let image = width * height * 3;
        let at = (light - first) * image;
        let values = self.blocks.with((view, block), make, |images| images[at..at + image].to_vec());
        DecodedImage::rgb(width, height, Samples::Computed(values))
    }
}

/// Reads everything but the samples.
fn read(bytes: &[u8]) -> Result<(Header, Data, ContainerInfo), String> {
    let mut cursor = Cursor::new(bytes);
    let cursor = &mut cursor;
    let signature = read_signature(cursor)?;
    let (mut header, legacy) = read_header(cursor, signature)?;
    let (mut colour_model, mut height_map) = (0, None);
    let data = match signature.kind {
        ContainerKind::Dfmf => {
            let (data, number) = Factored::read_dfmf(cursor, &header)?;
            colour_model = number;
            Data::Factored(data)
        }
        ContainerKind::Fmf => {
            let version = if signature.extended { cursor.u8("its extended header")? } else { 0 };
            if version > 2 {
                return Err(format!("its header has version {version}; 0 to 2 are read"));
            }
            let is_reduced = version >= 1 && cursor.u32("its extended header")? != 0;
            let reduction = if is_reduced { Reduction::Logarithm } else { Reduction::None };
            if version == 2 {
                height_map =
                    read_height_map(cursor)?.map(|(width, height, values)| HeightMap { width, height, values });
            }
            let to_rgb = ToRgb::plain(&header, reduction)?;
            Data::Factored(Factored::read_fmf(cursor, &header, to_rgb)?)
        }
        ContainerKind::Pvf => {
            let slots = match legacy {
                Some([_, slots]) => slots,
                None => {
                    cursor.count("its number of components")?;
                    cursor.count("its number of view slots")?
                }
            };
            let to_rgb = ToRgb::plain(&header, Reduction::None)?;
            Data::Factored(Factored::read_pvf(cursor, &header, slots, to_rgb)?)
        }
        ContainerKind::Bdi => {
            let to_rgb = ToRgb::plain(&header, Reduction::None)?;
            Data::Bdi(Bdi::read(cursor, &mut header, to_rgb)?)
        }
    };
    let components = match &data {
        Data::Factored(data) => {
            cursor.expect_end()?;
            data.components
        }
        Data::Bdi(_) => 0,
    };
    let info = ContainerInfo {
        kind: signature.kind,
        channels: header.channels.clone(),
        colour_model,
        components,
        rgb_scale: header.rgb_scale,
        rotations: header.rotations.clone(),
        height_map,
    };
    Ok((header, data, info))
}

fn provenance(info: &ContainerInfo, words: &[String]) -> String {
    let mut parts = vec![format!("UBO2014 {}", info.kind.name())];
    if info.components > 0 {
        parts.push(format!("{} components", info.components));
    }
    if info.colour_model != 0 {
        parts.push(format!("colour model {}", info.colour_model));
    }
    if !info.rotations.is_empty() {
        parts.push(format!("{} local frames, not applied", info.rotations.len()));
    }
    parts.extend(words.iter().cloned());
    parts.join("; ")
}

#[cfg(test)]
#[path = "../../tests/support/ubo2014_writer.rs"]
mod ubo2014_writer;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_prefix_is_refused() {
        for bytes in ubo2014_writer::one_of_each_kind() {
            assert!(read(&bytes).is_ok());
            for length in 0..bytes.len() {
                let reason = read(&bytes[..length]).err().unwrap_or_else(|| panic!("prefix of {length} is read"));
                assert!(!reason.is_empty() && !reason.contains('\n') && !reason.ends_with('.'), "{reason}");
            }
            assert!(read(&[&bytes[..], &[0]].concat()).is_err());
        }
    }

    #[test]
    fn no_lie_in_a_header_panics_or_allocates_beyond_the_file() {
        for bytes in ubo2014_writer::one_of_each_kind() {
            for position in 0..bytes.len() - 4 {
                for lie in [[0xFF; 4], [0, 0, 0, 0x80], [0; 4], [0xFF, 0xFF, 0xFF, 0x03], [1, 0, 0, 0]] {
                    let mut damaged = bytes.clone();
                    damaged[position..position + 4].copy_from_slice(&lie);
                    let Ok((header, data, _)) = read(&damaged) else { continue };
                    // What is taken for good can be computed.
                    let lights = &header.lights.in_file;
                    let images = match data {
                        Data::Factored(data) => data.images(&damaged, 0, lights),
                        Data::Bdi(data) => data.images(&damaged, 0, lights),
                    };
                    assert_eq!(images.len(), lights.len() * header.texel_count() * 3);
                }
            }
        }
    }
}
