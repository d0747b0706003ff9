//! What an asset's file has of its own within the container: words of the header, kinds of sections, limits. Normative text:
//! docs/reference/format.md.

use crate::container::container::{
    ALIGNMENT, Directory, FileFormat, HEADER_WORDS, HeaderReader, SectionEntry, read_directory_of,
};
use crate::error::{FormatError, Names, SPMM_NAMES};
use crate::threads::serial;

/// `SPMM` as a little-endian word.
pub const MAGIC: u32 = u32::from_le_bytes(SPMM_NAMES.magic);
/// The version that this crate writes and reads.
pub const VERSION: u32 = 1;
/// Every section of the resident form does: where a GPU lets a binding begin.
pub const RESIDENT_ALIGNMENT: usize = 256;
/// Bytes of each section of the resident form's words but the last: what WebGPU binds at least.
pub const PIECE_BYTES: usize = 1 << 27;
/// Largest physical side, millimetres.
pub const MAX_SIDE_MM: f32 = 1e6;
/// Most layers in a file (front, back, and the two transmissions).
pub const MAX_LAYERS: usize = 4;
/// Largest width or height in texels.
pub const MAX_SIDE: u32 = 16_384;
/// Most levels: down to one texel from the widest asset.
pub const MAX_LEVELS: usize = 15;
/// Most clusters in a layer: a cluster id is one byte.
pub const MAX_CLUSTERS: usize = 256;
/// Most lobes in one cluster's dictionary: a lobe id is one byte.
pub const MAX_DICTIONARY: usize = 256;
/// Most directions in a set.
pub const MAX_DIRECTIONS: usize = 4096;
/// Most residual components.
pub const MAX_COMPONENTS: usize = 128;
/// Most shared bases of a layer.
pub const MAX_SHARED: usize = 1024;
/// Largest step of a shared basis or of a cluster's mixture: bounded, so that no expanded basis overflows to NaN.
pub const MAX_BASIS_STEP: f32 = 1e4;
/// Largest step of a coefficient.
pub const MAX_COEFFICIENT_STEP: f32 = 1e9;
/// Largest rank of a factor matrix.
pub const MAX_RANK: usize = 256;
/// Most words that one layer's expanded bases may take (1 GiB): a few hundred bytes of factors must not
/// make a reader allocate without bound.
pub const MAX_BASIS_WORDS: u64 = 1 << 28;

/// Words of a layer's expanded bases: halves `[cluster, pair, channel, basis]`, bases padded to an even count.
pub fn basis_words(shape: [usize; 2], clusters: usize, bases: usize) -> u64 {
    [shape[0], shape[1], 3, clusters, bases.div_ceil(2)].iter().map(|n| *n as u64).product()
}

/// Header words, by name.
pub mod header {
    pub use crate::container::container::header::*;

    /// Number of layers.
    pub const LAYERS: usize = 6;
    /// Texels per row.
    pub const WIDTH: usize = 7;
    /// Rows.
    pub const HEIGHT: usize = 8;
    /// Channels per sample (3).
    pub const CHANNELS: usize = 9;
    /// Channel basis (0: linear sRGB primaries, D65).
    pub const BASIS: usize = 10;
    /// Flags: bit 1 left and right edge continue each other, bit 2 top and bottom; bit 0 is reserved for signed weights.
    pub const FLAGS: usize = 11;
    /// Form: 0 the file form, 1 the resident form.
    pub const FORM: usize = 14;
    /// Physical width in millimetres (f32); 0 with the height where it is not known.
    pub const WIDTH_MM: usize = 15;
    /// Physical height in millimetres (f32).
    pub const HEIGHT_MM: usize = 16;
}

/// What the sections of a file make up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Form {
    /// Small: entropy-coded, bases shared. What is stored and sent.
    File = 0,
    /// Large: the words that decoders read, to be mapped and bound as they lie.
    Resident = 1,
}

impl Form {
    /// What its sections' offsets are multiples of, bytes.
    pub fn alignment(self) -> usize {
        match self {
            Form::File => ALIGNMENT,
            Form::Resident => RESIDENT_ALIGNMENT,
        }
    }
}

/// What a section holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u32)]
pub enum SectionKind {
    /// UTF-8 JSON: name, capture source, error figures, fit parameters.
    Material = 1,
    /// A layer's parameters.
    Layer = 2,
    /// A direction set with triangles and hull edges; index 0 light, 1 view.
    Directions = 3,
    /// Cluster id per texel.
    TexelClusters = 4,
    /// Lobe count per texel.
    TexelLobeCounts = 5,
    /// Per cluster a dictionary of lobes.
    Dictionary = 6,
    /// Lobe references with RGB weights, texel by texel.
    LobeRefs = 7,
    /// Factor matrices of the residual bases.
    Factors = 8,
    /// Cores of the bases that all clusters share.
    SharedBases = 9,
    /// One basis of every cluster as a mixture of the shared ones; index 0 the mean, j the j-th component.
    Basis = 10,
    /// Coefficients of the j-th component for all texels (index j from 1).
    Coefficients = 11,
    /// Height per texel.
    Height = 12,
    /// A layer's texels at a coarser level; index 1 half as wide and high, and so on.
    Level = 13,
    /// Edits of the whole asset, and each texel's.
    Edits = 14,
    /// The resident form's words, [`PIECE_BYTES`] a section.
    Words = 15,
}

impl SectionKind {
    /// The kind with number `kind`, if this version knows it.
    pub fn from_number(kind: u32) -> Option<SectionKind> {
        use SectionKind::*;
        [
            Material,
            Layer,
            Directions,
            TexelClusters,
            TexelLobeCounts,
            Dictionary,
            LobeRefs,
            Factors,
            SharedBases,
            Basis,
            Coefficients,
            Height,
            Level,
            Edits,
            Words,
        ]
        .into_iter()
        .find(|known| *known as u32 == kind)
    }
}

impl SectionEntry {
    /// For messages: `Basis 3 of layer 0`.
    pub fn name(&self) -> String {
        self.name_in::<Spmm>()
    }
}

/// Bit of the first flag of [`Head::seamless`].
const SEAMLESS_BIT: u32 = 1;

/// Whether a physical size is one.
pub(crate) fn in_mm_range(size: [f32; 2]) -> bool {
    size.iter().all(|mm| *mm > 0.0 && *mm <= MAX_SIDE_MM)
}

/// What header and sections say of the whole asset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Head {
    /// What the sections make up.
    pub form: Form,
    /// Texels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Number of layers, 1 to 4.
    pub layers: u32,
    /// Physical width and height in millimetres, where known; above 0, at most [`MAX_SIDE_MM`].
    pub size_mm: Option<[f32; 2]>,
    /// Whether the left edge continues the right one, and the bottom edge the top one.
    pub seamless: [bool; 2],
}

/// The format of assets.
pub(crate) enum Spmm {}

impl FileFormat for Spmm {
    type Head = Head;
    type Kind = SectionKind;
    const NAMES: Names = SPMM_NAMES;
    const VERSION: u32 = VERSION;

    fn read_head(header: &mut HeaderReader) -> Option<Head> {
        let layers = header.within("layer_count", header::LAYERS, [1, MAX_LAYERS as u32], "1 to 4");
        let width = header.within("width", header::WIDTH, [1, MAX_SIDE], "1 to 16384");
        let height = header.within("height", header::HEIGHT, [1, MAX_SIDE], "1 to 16384");
        header.within("channels", header::CHANNELS, [3, 3], "3 in version 1");
        header.within("basis", header::BASIS, [0, 0], "0 (linear sRGB) in version 1");
        let form = header.within("form", header::FORM, [0, 1], "0 or 1");
        for reserved in header::HEIGHT_MM + 1..HEADER_WORDS {
            header.within("reserved", reserved, [0, 0], "0");
        }
        let flags = header.word(header::FLAGS);
        if flags & !(3 << SEAMLESS_BIT) != 0 {
            header.refuse("flags", header::FLAGS, "0, 2, 4 or 6 in version 1");
        }
        let seamless = [0, 1].map(|axis| flags >> (SEAMLESS_BIT + axis) & 1 == 1);
        let size_words = [header::WIDTH_MM, header::HEIGHT_MM].map(|field| header.word(field));
        let size_mm = (size_words != [0, 0]).then(|| size_words.map(f32::from_bits));
        if !size_mm.is_none_or(in_mm_range) {
            let allowed = "a size above 0 mm and at most 1000000 mm, or both 0";
            header.refuse("width_mm or height_mm", header::WIDTH_MM, allowed);
        }
        let form = if form == 0 { Form::File } else { Form::Resident };
        Some(Head { form, width, height, layers, size_mm, seamless })
    }

    fn write_head(head: &Head, words: &mut [u32]) {
        words[header::LAYERS] = head.layers;
        words[header::WIDTH] = head.width;
        words[header::HEIGHT] = head.height;
        words[header::CHANNELS] = 3;
        words[header::FLAGS] = (0..2).map(|axis| u32::from(head.seamless[axis]) << (SEAMLESS_BIT + axis as u32)).sum();
        words[header::FORM] = head.form as u32;
        let size_mm = head.size_mm.unwrap_or_default();
        words[header::WIDTH_MM] = size_mm[0].to_bits();
        words[header::HEIGHT_MM] = size_mm[1].to_bits();
    }

    fn alignment(head: &Head) -> usize {
        head.form.alignment()
    }

    fn layers(head: &Head) -> u32 {
        head.layers
    }

    fn kind(number: u32) -> Option<SectionKind> {
        SectionKind::from_number(number)
    }

    fn number(kind: SectionKind) -> u32 {
        kind as u32
    }

    fn section_name(kind: SectionKind, layer: u32, index: u32) -> String {
        format!("{kind:?} {index} of layer {layer}")
    }
}

/// Checks header, tables, section bounds, padding and every present section's checksum.
///
/// Cost: one hash of the bytes. Allocation: bounded by the tables, which are bounded by `bytes`.
pub fn read_directory(bytes: &[u8]) -> Result<Directory, FormatError> {
    read_directory_of::<Spmm>(bytes, &serial)
}
