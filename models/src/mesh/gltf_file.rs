//! Opens glTF files so that no file can make a reader panic.
//!
//! The `gltf` crate does not check everything: its validation indexes the accessors by the number in `POSITION` before
//! it has compared that number with their count, a binary file with a header length below 12 makes it subtract with
//! overflow, and an escaped byte that is no UTF-8 in an address makes it panic. Everyone who opens a glTF file uses
//! [`open_gltf`] and [`gltf_buffers`], which check first.

use super::address::beside;
use super::model::fault;
use crate::error::ModelError;
use btf_capture::files;
use gltf::buffer::{Data, Source};
use gltf::json::validation::Checked;
use gltf::mesh::Semantic;
use gltf::{Document, Gltf};
use std::path::{Path, PathBuf};

/// Bytes of the header of a binary glTF file [glTF 2.0, section 4.4.2].
const HEADER_BYTES: u32 = 12;

/// Opens a `.gltf` or `.glb` file. Every index between parts of the returned document is within its range.
///
/// # Errors
/// [`ModelError::Mesh`] for a file that cannot be read, is no glTF 2.0, or names a part that is not there.
pub fn open_gltf(path: &Path) -> Result<Gltf, ModelError> {
    let unreadable =
        |error: String| fault(path, format!("the glTF file cannot be read: {error}; copy or export it again"));
    let bytes = read_file(path).map_err(|error| unreadable(error.to_string()))?;
    // The crate subtracts the header's length from the file's.
    let length = bytes.strip_prefix(b"glTF").and_then(|rest| rest.get(4..8));
    if length.is_some_and(|length| u32::from_le_bytes([length[0], length[1], length[2], length[3]]) < HEADER_BYTES) {
        return Err(unreadable("its header says that it is shorter than its header".into()));
    }
    let unchecked = Gltf::from_slice_without_validation(&bytes).map_err(|error| unreadable(error.to_string()))?;
    let json = unchecked.document.into_json();
    // The crate's own validation looks these up before it has checked them.
    for (number, mesh) in json.meshes.iter().enumerate() {
        for primitive in &mesh.primitives {
            let positions = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
            if let Some(accessor) = positions.filter(|accessor| accessor.value() >= json.accessors.len()) {
                return Err(fault(
                    path,
                    format!(
                        "mesh {number} has its positions in accessor {}, and the file has {} accessors; export it again",
                        accessor.value(),
                        json.accessors.len()
                    ),
                ));
            }
        }
    }
    let document = Document::from_json(json).map_err(|error| unreadable(error.to_string()))?;
    Ok(Gltf { document, blob: unchecked.blob })
}

/// Reads the buffers of a glTF file that was opened from `path`: from the file itself, from addresses that hold their
/// data, and from files beside it. Each has at least as many bytes as the document says.
///
/// # Errors
/// [`ModelError::Mesh`] for a buffer that cannot be read or is too short.
pub fn gltf_buffers(path: &Path, gltf: &Gltf) -> Result<Vec<Data>, ModelError> {
    let mut blob = gltf.blob.clone();
    let mut buffers = Vec::new();
    for buffer in gltf.buffers() {
        let data = match buffer.source() {
            Source::Uri(uri) => match file_of(path, uri) {
                Some(file) => read_file(&file).map(padded).map_err(|error| format!("{}: {error}", file.display())),
                None => Data::from_source(Source::Uri(uri), None).map_err(|error| error.to_string()),
            },
            Source::Bin => Data::from_source_and_blob(Source::Bin, None, &mut blob).map_err(|error| error.to_string()),
        };
        let data = data.and_then(|data| match data.len() < buffer.length() {
            true => Err(format!("buffer {} has {} bytes, not {}", buffer.index(), data.len(), buffer.length())),
            false => Ok(data),
        });
        buffers.push(data.map_err(|error| {
            fault(path, format!("the glTF file's buffers cannot be read: {error}; copy or export it again"))
        })?);
    }
    Ok(buffers)
}

/// Returns the path of the file that the address of a buffer means; `None` for an address that holds its data or that
/// is of an unknown kind.
fn file_of(path: &Path, uri: &str) -> Option<PathBuf> {
    match uri.strip_prefix("file:") {
        Some(rest) => Some(PathBuf::from(rest.strip_prefix("//").unwrap_or(rest))),
        None => (!uri.contains(':')).then(|| beside(path, uri)),
    }
}

/// Pads the bytes of a buffer to whole words, as the `gltf` crate has them.
fn padded(mut bytes: Vec<u8>) -> Data {
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    Data(bytes)
}

/// Reads a file whole. Refuses devices and pipes, which may have no end.
pub(super) fn read_file(path: &Path) -> std::io::Result<Vec<u8>> {
    if cfg!(not(target_arch = "wasm32")) && !std::fs::metadata(path)?.is_file() {
        return Err(std::io::Error::new(std::io::ErrorKind::InvalidInput, "it is no file"));
    }
    files::read(path)
}
