//! Writes the container of binary glTF files: a buffer that grows with its views, and the chunks around it [glTF 2.0,
//! section 4].

use serde_json::{Value, json};

/// Component type of single-precision numbers.
pub const F32: u32 = 5126;
/// Component type of 16-bit indices.
pub const U16: u32 = 5123;
/// Component type of 32-bit indices.
pub const U32: u32 = 5125;
/// Primitive mode of triangles.
pub const TRIANGLES: u32 = 4;
/// Target of a buffer view that holds vertices.
pub const VERTICES: u32 = 34962;
/// Target of a buffer view that holds indices.
pub const INDICES: u32 = 34963;

/// Binary chunk as it grows, with its views.
#[derive(Debug, Default)]
pub struct GlbBuffer {
    /// Bytes so far.
    pub bytes: Vec<u8>,
    /// Entries of `bufferViews` in the document.
    pub views: Vec<Value>,
}

impl GlbBuffer {
    /// Appends `bytes` at the next multiple of 4 and returns the index of their view. `target` is [`VERTICES`],
    /// [`INDICES`] or none.
    pub fn push(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut view = json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bytes.extend_from_slice(bytes);
        self.views.push(view);
        self.views.len() - 1
    }
}

/// Returns the bytes of a binary glTF file: a header of three words and two chunks, each padded to whole words. Returns
/// `None` if the file would have 4 GiB or more.
pub fn glb_from(document: &Value, mut binary: Vec<u8>) -> Option<Vec<u8>> {
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let total = 12 + 8 + text.len() + 8 + binary.len();
    let length = u32::try_from(total).ok()?;
    let mut out = Vec::with_capacity(total);
    out.extend_from_slice(b"glTF");
    out.extend([2, length].map(u32::to_le_bytes).as_flattened());
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &binary)] {
        out.extend((chunk.len() as u32).to_le_bytes());
        out.extend_from_slice(kind);
        out.extend_from_slice(chunk);
    }
    Some(out)
}

/// Escapes everything but the unreserved characters in a part of a relative address [RFC 3986].
pub fn escaped(part: &str) -> String {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~".contains(&byte);
    part.bytes().map(|byte| if plain(byte) { char::from(byte).to_string() } else { format!("%{byte:02X}") }).collect()
}
