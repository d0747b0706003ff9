//! The packed BTF asset (`.spmm`) and its decoder, in Rust and WGSL.
//!
//! The package turns bytes into numbers, and an asset into bytes. It uses no files, no threads of its own, no GPU and
//! no image codecs. The byte layout is docs/reference/format.md; the model is docs/reference/model.md.
//!
//! ```text
//! bytes --Asset::parse--> Asset (file form) --Resident::from_asset--> Resident --decode--> RGB
//!       <----- pack -----                                             words for the GPU, WGSL beside
//! ```
//!
//! Values are `pi * BRDF * |n.wi|`: 1 is a white Lambertian surface lit at normal incidence. The cosine is part of the
//! value; a renderer must not multiply by it again.
//!
//! Limits: an asset has three channels, which are colours or give the bands of a [`Spectrum`], and each layer is measured at all pairs of one set of light and one set
//! of view directions. Weights of lobes are not negative. A texture coordinate selects the nearest texel of a level;
//! texels are not filtered within a level.

#![forbid(unsafe_code)]

mod asset;
mod container;
mod decode;
mod error;
mod file;
mod leaf;
mod levels;
mod numeric;
mod open;
mod resident;
pub mod rule;
#[doc(hidden)]
pub mod testing;
mod threads;
#[doc(hidden)]
pub mod twin_constants;
pub mod voltex;
mod wgsl;

pub use asset::asset::{Asset, Layer, Level, LevelTexels, LobeRole, SurfaceSide};
pub use asset::dictionary::{DictionaryLobe, LobeRef, mark_used_lobes};
pub use asset::edit::{EDIT_WORDS, Edit, Edits, MAX_EDIT_WORDS, MAX_EDITS};
pub use asset::height_field::HeightField;
pub use asset::heights::Heights;
pub use asset::limits::{
    MAX_BASIS_STEP, MAX_CLUSTERS, MAX_COEFFICIENT_STEP, MAX_COMPONENTS, MAX_HEIGHT_STEP, MAX_LAYERS, MAX_LEVELS,
    MAX_SHARED, MAX_SIDE_MM,
};
pub use asset::lobe::{Lobe, LobeFamily, LobeSetup, RESIDENT_WORDS as LOBE_RESIDENT_WORDS, ResidentLobe};
pub use asset::lobe_tables::{lobe_sum_at_pairs, lobe_tables};
pub use asset::lobe_weights::LobeWeights;
pub use asset::predicted_lobes::first_lobes;
pub use asset::relief::{MAX_LIKENESS, Relief};
pub use asset::residual::{
    Basis, COLOUR_FRAME, Coefficients, Factors, MAX_LOG, PredictedGroup, ROOT, Residual, ResidualKind, SharedBases,
};
pub use asset::spectrum::{
    BAND_RANGE_NM, Channels, MAX_BAND_WEIGHT, MAX_BANDS, MAX_GROUPS, Spectrum, weighted_channels,
};
pub use asset::sphere::{DIRECTION_WORDS, EDGE_WORDS, Neighbours, SPHERE_HEADER_WORDS, Sphere, TRIANGLE_WORDS};
pub use btf_leaf_quantities::Part as LeafPart;
pub use container::directory::{Directory, SectionEntry};
pub use container::entropy::plane_bytes;
pub use container::file_format::ALIGNMENT;
pub use container::finding::Finding;
pub use decode::decode::{decode, decode_single};
pub use decode::evaluate::{Query, Sample, density, evaluate, evaluate_bands, evaluate_many, sample};
pub use decode::measured::{TexelPlace, decode_from_file_form, decode_measured};
pub use decode::options::{DecodeOptions, HeightUse, Interpolation, RATIO_EPSILON, RATIO_RANGE};
pub use decode::parallax::SeenBy;
pub use decode::relief::lit_share;
pub use decode::sample::MIN_ALPHA;
pub use decode::viewed_texel::{LightRows, ViewedTexel};
pub use error::FormatError;
pub use file::coefficient_coding::choose_coefficients;
pub use file::format::{
    Form, Head, MAGIC, PIECE_BYTES, RESIDENT_ALIGNMENT, SectionKind, VERSION, read_directory, read_version,
    tier_lengths,
};
pub use file::pack::{pack, packed_len};
pub use file::resident_file::ResidentFile;
pub use file::validate::{Report, validate};
pub use leaf::body::LeafBody;
pub use leaf::error::LeafError;
pub use leaf::face_gloss::FaceGloss;
pub use leaf::figures::{LEAF_BAND_NM, LEAF_ROWS, LeafRow};
pub use leaf::leaf::Leaf;
pub use leaf::optics::{LeafSpectrumRow, leaf_body_spectrum, leaf_spectrum};
pub use leaf::scatter::LeafScattering;
pub use leaf::state::{LEAF_QUANTITIES, LeafMode, LeafQuantity, LeafState, TwoHalves};
pub use leaf::texture::{LeafTexel, LeafTexture, MAX_FACTOR, MAX_LEAF_SIDE};
pub use leaf::viewed::ViewedLeaf;
pub use levels::levels::with_levels;
pub use numeric::power::{POWER_RELATIVE_ERROR, exp, root};
pub use numeric::quantize::{byte_from_weight, weight_from_byte};
pub use open::{Levels, open};
pub use resident::expansion_input::{
    EXPANSION_WGSL, EXPANSION_WORKGROUP, ExpansionChannel, ExpansionInput, ExpansionShape, ExpansionSlice,
};
pub use resident::layout::{ASSET_LAYERS, HORIZON_COS, block};
pub use resident::packed_widths::PackedGoal;
pub use resident::resident::{Resident, ResidentBytes};
pub use resident::single::SingleBases;
pub use rule::{Rule, Severity};
pub use threads::{Threads, serial};
pub use wgsl::{LEAF_WGSL, VOLTEX_WGSL, WGSL, leaf_wgsl, voltex_wgsl, wgsl_library, wgsl_library_of_quads};

// Words are moved between bytes and `u32` as they lie in memory.
const _: () = assert!(cfg!(target_endian = "little"), "btf-runtime supports little-endian targets");
