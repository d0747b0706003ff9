//! The file format of assets within the container: header words and kinds of sections. Normative text: docs/reference/format.md.

use crate::asset::limits::{MAX_LAYERS, MAX_SIDE, MAX_SIDE_MM};
use crate::container::directory::{Directory, SectionEntry, read_directory_of, tier_lengths_of};
use crate::container::file_format::{ALIGNMENT, FileFormat, HEADER_WORDS, HeaderReader};
use crate::error::{FormatError, Names, SPMM_NAMES};
use crate::threads::serial;

/// Magic number `SPMM` as a little-endian word.
pub const MAGIC: u32 = u32::from_le_bytes(SPMM_NAMES.magic);
/// Newest format version that this crate writes; it reads all from 1 on.
pub const VERSION: u32 = 3;
/// Alignment of the sections of a resident form, bytes: that of a GPU's bindings.
pub const RESIDENT_ALIGNMENT: usize = 256;
/// Length in bytes of each section of the resident form's words but the last: the size that WebGPU binds at least.
pub const PIECE_BYTES: usize = 1 << 27;
/// Positions of the header words of assets; includes those that all formats have.
pub mod header {
    pub use crate::container::file_format::header::*;

    /// Number of layers.
    pub const LAYERS: usize = 6;
    /// Texels per row.
    pub const WIDTH: usize = 7;
    /// Number of rows.
    pub const HEIGHT: usize = 8;
    /// Channels of a sample (3).
    pub const CHANNELS: usize = 9;
    /// Channel basis: 0 linear sRGB primaries, D65; 1 channels of a spectrum.
    pub const BASIS: usize = 10;
    /// Flags: bit 1 left and right edge continue each other, bit 2 top and bottom; bit 0 is reserved for signed
    /// weights.
    pub const FLAGS: usize = 11;
    /// Form: 0 the file form, 1 the resident form.
    pub const FORM: usize = 14;
    /// Physical width in millimetres (f32); 0 with the height where it is not known.
    pub const WIDTH_MM: usize = 15;
    /// Physical height in millimetres (f32).
    pub const HEIGHT_MM: usize = 16;
}

/// The form of an asset's file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Form {
    /// File form: small, entropy-coded, with shared bases; for storing and sending.
    File = 0,
    /// Resident form: large, the words that decoders read, to be mapped and bound as they lie.
    Resident = 1,
}

impl Form {
    /// Returns the alignment of the sections, bytes.
    pub fn alignment(self) -> usize {
        match self {
            Form::File => ALIGNMENT,
            Form::Resident => RESIDENT_ALIGNMENT,
        }
    }
}

/// The kinds of sections of an asset's file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u32)]
pub enum SectionKind {
    /// UTF-8 JSON: name, capture source, error figures, fit parameters.
    Material = 1,
    /// Parameters of a layer.
    Layer = 2,
    /// A direction set with triangles and hull edges; index 0 light, 1 view.
    Directions = 3,
    /// Cluster id of each texel.
    TexelClusters = 4,
    /// Number of lobes of each texel.
    TexelLobeCounts = 5,
    /// Dictionary of lobes of each cluster.
    Dictionary = 6,
    /// Lobe references with RGB weights, texel by texel.
    LobeRefs = 7,
    /// Factor matrices of the residual bases.
    Factors = 8,
    /// Cores of the bases that all clusters share.
    SharedBases = 9,
    /// One basis of every cluster as a mixture of the shared bases; index 0 the mean, j the j-th component.
    Basis = 10,
    /// Coefficients of the j-th component for all texels (index j from 1).
    Coefficients = 11,
    /// Height of each texel.
    Height = 12,
    /// Texels of a layer at a coarser level; index 1 half as wide and high, and so on.
    Level = 13,
    /// Edits of the whole asset, and the edit of each texel.
    Edits = 14,
    /// Words of the resident form, [`PIECE_BYTES`] a section.
    Words = 15,
    /// Lobe weights as functions of the coefficients.
    LobeWeights = 16,
    /// Corrections between the measured directions that the heights give.
    Relief = 17,
    /// Coefficients of a group of components, predicted from the neighbouring texels (index from 1).
    PredictedCoefficients = 18,
    /// A part of the cores of the bases that all clusters share (index from 0), where coefficients are predicted.
    SharedBasesPart = 19,
    /// Factor matrices as codes, where coefficients are predicted.
    FactorCodes = 20,
    /// Bands of the whole asset, and how they follow from the channels.
    Spectrum = 21,
}

impl SectionKind {
    /// Returns the kind with a number; `None` if this version does not know it.
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
            LobeWeights,
            Relief,
            PredictedCoefficients,
            SharedBasesPart,
            FactorCodes,
            Spectrum,
        ]
        .into_iter()
        .find(|known| *known as u32 == kind)
    }
}

impl SectionEntry {
    /// Returns the section's name for messages, such as `Basis 3 of layer 0`.
    pub fn name(&self) -> String {
        self.name_in::<Spmm>()
    }
}

/// Bit of the first of the two flags of [`Head::seamless`].
const SEAMLESS_BIT: u32 = 1;

/// Returns whether a physical size is within its range.
pub(crate) fn in_mm_range(size: [f32; 2]) -> bool {
    size.iter().all(|mm| *mm > 0.0 && *mm <= MAX_SIDE_MM)
}

/// Returns the oldest version that has what a file needs: the channels of a spectrum, or something else that version 1 does not
/// know.
pub(crate) fn version_of(is_spectral: bool, is_new: bool) -> u32 {
    match (is_spectral, is_new) {
        (true, _) => 3,
        (false, true) => 2,
        (false, false) => 1,
    }
}

/// The header of an asset: everything it says about the whole file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Head {
    /// Format version; a written file takes the oldest that has what it needs.
    pub version: u32,
    /// Form of the file.
    pub form: Form,
    /// Texels per row.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// Number of layers, 1 to 4.
    pub layers: u32,
    /// Physical width and height in millimetres, above 0 and at most [`MAX_SIDE_MM`]; `None` where they are not known.
    pub size_mm: Option<[f32; 2]>,
    /// Whether the left edge continues the right one, and the bottom edge the top one.
    pub seamless: [bool; 2],
    /// Whether the channels are those of a spectrum.
    pub spectral: bool,
}

/// The file format of assets, for [`FileFormat`].
pub(crate) enum Spmm {}

impl FileFormat for Spmm {
    type Head = Head;
    type Kind = SectionKind;
    const NAMES: Names = SPMM_NAMES;
    const VERSION: u32 = VERSION;

    fn version(head: &Head) -> u32 {
        head.version
    }

    fn read_head(header: &mut HeaderReader) -> Option<Head> {
        let layers = header.within("layer_count", header::LAYERS, [1, MAX_LAYERS as u32], "1 to 4");
        let width = header.within("width", header::WIDTH, [1, MAX_SIDE], "1 to 16384");
        let height = header.within("height", header::HEIGHT, [1, MAX_SIDE], "1 to 16384");
        header.within("channels", header::CHANNELS, [3, 3], "3");
        let newest = if header.word(header::VERSION) >= 3 { 1 } else { 0 };
        let bases = if newest == 1 { "0 (linear sRGB) or 1 (a spectrum)" } else { "0 (linear sRGB)" };
        let spectral = header.within("basis", header::BASIS, [0, newest], bases) == 1;
        let form = header.within("form", header::FORM, [0, 1], "0 or 1");
        for reserved in header::HEIGHT_MM + 1..HEADER_WORDS {
            header.within("reserved", reserved, [0, 0], "0");
        }
        let flags = header.word(header::FLAGS);
        if flags & !(3 << SEAMLESS_BIT) != 0 {
            header.refuse("flags", header::FLAGS, "0, 2, 4 or 6");
        }
        let seamless = [0, 1].map(|axis| flags >> (SEAMLESS_BIT + axis) & 1 == 1);
        let size_words = [header::WIDTH_MM, header::HEIGHT_MM].map(|field| header.word(field));
        let size_mm = (size_words != [0, 0]).then(|| size_words.map(f32::from_bits));
        if !size_mm.is_none_or(in_mm_range) {
            let allowed = "a size above 0 mm and at most 1000000 mm, or both 0";
            header.refuse("width_mm or height_mm", header::WIDTH_MM, allowed);
        }
        let form = if form == 0 { Form::File } else { Form::Resident };
        Some(Head { version: header.word(header::VERSION), form, width, height, layers, size_mm, seamless, spectral })
    }

    fn write_head(head: &Head, words: &mut [u32]) {
        words[header::LAYERS] = head.layers;
        words[header::WIDTH] = head.width;
        words[header::HEIGHT] = head.height;
        words[header::CHANNELS] = 3;
        words[header::BASIS] = u32::from(head.spectral);
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

/// Returns the format version that these bytes tell; `None` where they are too few.
pub fn read_version(bytes: &[u8]) -> Option<u32> {
    let word = bytes.get(4 * header::VERSION..4 * header::VERSION + 4)?;
    Some(u32::from_le_bytes([word[0], word[1], word[2], word[3]]))
}

/// Checks header, tables, section bounds, padding and the checksum of every section at hand.
///
/// Cost: one hash of the bytes. Allocation: bounded by the tables, which are bounded by `bytes`.
pub fn read_directory(bytes: &[u8]) -> Result<Directory<Head>, FormatError> {
    read_directory_of::<Spmm>(bytes, &serial)
}

/// Returns the lengths in bytes of all tiers, ascending, the whole file's last: each such beginning is an asset of less
/// detail. `beginning` holds at least header and tables, which the first 128 kB of a file do.
///
/// Errors: [`FormatError::TooShort`] telling the bytes that are needed; those of a header that is no asset's.
pub fn tier_lengths(beginning: &[u8]) -> Result<Vec<u32>, FormatError> {
    tier_lengths_of::<Spmm>(beginning)
}
