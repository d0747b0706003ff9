//! The files of an export.

use serde_json::Value;
use std::path::{Path, PathBuf};
use wgpu::TextureFormat;

/// Key in the first file that names the others.
const KEY: &str = "BTFspmm";
/// Version of the textures' layout that this reads.
const LAYOUT: u64 = 2;
/// The textures in the order of the shader's bindings.
const KINDS: [&str; 5] = ["tables", "planes", "fine", "bases", "mean"];

/// Largest side and most layers of a texture that common devices take.
const MAX_SIDE: u32 = 16_384;
const MAX_LAYERS: u32 = 2048;

/// What is wrong with the files.
#[derive(Debug, thiserror::Error)]
pub enum TextureError {
    /// A file cannot be read.
    #[error("{path}: {source}; keep all files that export-ktx2 wrote in one folder")]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file is no texture of this kind.
    #[error("{path}: {what}; write it anew with btf-fit export-ktx2 --bc")]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
}

/// A texture as it is uploaded.
#[derive(Debug, Clone)]
pub struct Texture {
    /// Format of the texels.
    pub format: TextureFormat,
    /// Width and height of the finest level.
    pub size: [u32; 2],
    /// Layers of an array; `None` for a single texture.
    pub layers: Option<u32>,
    /// Blocks `[layer, row, column]` of each level.
    pub levels: Vec<Vec<u8>>,
}

/// The textures of a layer of an asset.
#[derive(Debug, Clone)]
pub struct Textures {
    /// Tables, planes, fine planes, bases and mean.
    pub all: [Texture; 5],
    /// Physical width and height in millimetres, where they are known.
    pub size_mm: Option<[f64; 2]>,
}

/// Reads the textures of the layer of `side` (`front`, `back`, `transmission-back` or `transmission-front`); `path` is the
/// file that names the others.
///
/// # Errors
/// If a file is not there or not what the first one says; the message names it and the remedy.
pub fn read_textures(path: &Path, side: &str) -> Result<Textures, TextureError> {
    let fault = |what: String| TextureError::Content { path: path.to_path_buf(), what };
    let index = read_index(path)?;
    if index["layout"].as_u64() != Some(LAYOUT) {
        return Err(fault(format!("its layout is not {LAYOUT}, that of block-compressed textures")));
    }
    let layers = index["layers"].as_array().map(Vec::as_slice).unwrap_or_default();
    let Some(layer) = layers.iter().find(|layer| layer["side"] == side) else {
        return Err(fault(format!("it has no layer of the side {side}")));
    };
    let mut all = Vec::new();
    for kind in KINDS {
        let name = layer[kind].as_str().ok_or_else(|| fault(format!("it names no file for {kind}")))?;
        // A name, not a way out of the folder.
        let name = Path::new(name).file_name().ok_or_else(|| fault(format!("{name} is no file name")))?;
        all.push(read_texture(&path.with_file_name(name), kind)?);
    }
    let all = all.try_into().map_err(|_| fault("it names too few files".into()))?;
    let size = |axis: usize| index["sizeMm"][axis].as_f64();
    Ok(Textures { all, size_mm: size(0).zip(size(1)).map(|(width, height)| [width, height]) })
}

fn read_file(path: &Path) -> Result<Vec<u8>, TextureError> {
    std::fs::read(path).map_err(|source| TextureError::File { path: path.to_path_buf(), source })
}

fn read_index(path: &Path) -> Result<Value, TextureError> {
    let bytes = read_file(path)?;
    let fault = |what: String| TextureError::Content { path: path.to_path_buf(), what };
    let reader = ktx2::Reader::new(&bytes[..]).map_err(|error| fault(format!("it is no KTX2 file: {error}")))?;
    let found = reader.key_value_data().find(|(key, _)| *key == KEY);
    let (_, value) = found.ok_or_else(|| {
        fault("it does not name the other files; give the one that export-ktx2 was told to write".into())
    })?;
    let text = value.strip_suffix(&[0]).unwrap_or(value);
    serde_json::from_slice(text).map_err(|error| fault(format!("its key {KEY} holds no JSON: {error}")))
}

fn read_texture(path: &Path, kind: &str) -> Result<Texture, TextureError> {
    let bytes = read_file(path)?;
    let fault = |what: String| TextureError::Content { path: path.to_path_buf(), what };
    let reader = ktx2::Reader::new(&bytes[..]).map_err(|error| fault(format!("it is no KTX2 file: {error}")))?;
    let header = reader.header();
    let (format, wanted, is_array) = match kind {
        "tables" => (TextureFormat::Rgba32Float, ktx2::Format::R32G32B32A32_SFLOAT, false),
        "mean" => (TextureFormat::Rgba16Float, ktx2::Format::R16G16B16A16_SFLOAT, false),
        "bases" => (TextureFormat::Bc7RgbaUnorm, ktx2::Format::BC7_UNORM_BLOCK, true),
        _ => (TextureFormat::Bc5RgUnorm, ktx2::Format::BC5_UNORM_BLOCK, true),
    };
    if header.format != Some(wanted) || (header.layer_count > 0) != is_array {
        return Err(fault(format!("it is no texture of {kind}: its format is {:?}", header.format)));
    }
    let (size, side) = ([header.pixel_width, header.pixel_height], format.block_dimensions().0);
    let is_sized = size.iter().all(|texels| (1..=MAX_SIDE).contains(texels) && texels.is_multiple_of(side));
    if !is_sized || header.layer_count > MAX_LAYERS || header.level_count > MAX_SIDE.ilog2() + 1 {
        return Err(fault(format!(
            "{} x {} texels, {} layers and {} levels are none that a device takes",
            size[0], size[1], header.layer_count, header.level_count
        )));
    }
    let layers = is_array.then_some(header.layer_count);
    let levels: Vec<Vec<u8>> = reader.levels().map(|level| level.data.to_vec()).collect();
    let block_bytes = format.block_copy_size(None).unwrap_or(0);
    for (number, level) in levels.iter().enumerate() {
        let blocks = |texels: u32| u64::from((texels >> number).max(1).div_ceil(side));
        let wanted = blocks(size[0]) * blocks(size[1]) * u64::from(layers.unwrap_or(1)) * u64::from(block_bytes);
        if level.len() as u64 != wanted {
            return Err(fault(format!("level {number} has {} bytes, {wanted} are needed", level.len())));
        }
    }
    Ok(Texture { format, size, layers, levels })
}
