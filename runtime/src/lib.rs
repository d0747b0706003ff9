//! The packed BTF asset (`.spmm`) and its decoder, in Rust and WGSL.
//!
//! Bytes in, numbers out, and bytes out of the packer: no files, no threads, no GPU, no image codecs.
//! The byte layout is docs/reference/format.md; the model is docs/reference/model.md.
//!
//! ```text
//! bytes --Asset::parse--> Asset (file form) --Resident::from_asset--> Resident --decode--> RGB
//!       <----- pack -----                                             words for the GPU, WGSL beside
//! ```
//!
//! Values are `pi * BRDF * |n.wi|`: 1 is a white Lambertian lit at normal incidence. The cosine
//! is inside; a renderer never multiplies another one.
//!
//! Limits of version 0: three channels, product grids of directions, non-negative lobe weights,
//! nearest texel.

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
pub mod voltex;
mod wgsl;

pub use asset::asset::{Asset, DictionaryLobe, Layer, Level, LevelTexels, LobeRef, LobeRole, SurfaceSide};
pub use asset::edit::{EDIT_WORDS, Edit, Edits, MAX_EDIT_WORDS, MAX_EDITS};
pub use asset::lobe::{
    Lobe, LobeFamily, LobeSetup, MIN_COS_VIEW, MIN_HALF, RESIDENT_WORDS as LOBE_RESIDENT_WORDS, ResidentLobe,
};
pub use asset::residual::{
    Basis, COLOUR_FRAME, Coefficients, Factors, MAX_LOG, ROOT, Residual, ResidualKind, SharedBases, core_at_pair,
    expand_core,
};
pub use asset::sphere::{
    DIRECTION_WORDS, EDGE_WORDS, INSIDE_TOLERANCE, ITEM_EDGE, Neighbours, SPHERE_HEADER_WORDS, Sphere, TRIANGLE_WORDS,
};
pub use container::container::{ALIGNMENT, Directory, SectionEntry};
pub use container::entropy::plane_bytes;
pub use container::finding::Finding;
pub use decode::decode::{
    DecodeOptions, Interpolation, RATIO_EPSILON, RATIO_RANGE, decode, decode_from_file_form, decode_measured,
    decode_single, lobe_sum_at_pairs, lobe_tables,
};
pub use decode::evaluate::{Query, Sample, UNIT_RANGE, density, evaluate, evaluate_many, is_unit, sample};
pub use decode::parallax::{
    HIDDEN_SHARE, HeightField, Heights, MAX_HEIGHT_STEP, MAX_RAY_STEPS, MAX_SLOPE, MIN_RAY_STEPS, OUTSIDE_SHARE,
    RAY_STEP, SHIFT_SLOPE, SeenBy,
};
pub use decode::sample::{COSINE_SHARE, MIN_ALPHA, MIN_AXIS, sample_lobe_density, sample_lobe_direction};
pub use decode::viewed_texel::{LIGHT_ROWS, LightRows, ViewedTexel};
pub use error::FormatError;
pub use file::format::{
    Form, Head, MAGIC, MAX_BASIS_STEP, MAX_CLUSTERS, MAX_COEFFICIENT_STEP, MAX_COMPONENTS, MAX_LAYERS, MAX_LEVELS,
    MAX_SHARED, MAX_SIDE_MM, PIECE_BYTES, RESIDENT_ALIGNMENT, SectionKind, VERSION, read_directory,
};
pub use file::pack::pack;
pub use file::resident_file::ResidentFile;
pub use file::validate::{Report, validate};
pub use leaf::body::LeafBody;
pub use leaf::error::LeafError;
pub use leaf::figures::{BAND_SHARES, LEAF_ROWS, LeafRow, PRINTED_ROWS, THREE_ROWS};
pub use leaf::leaf::Leaf;
pub use leaf::lobe::{LEAF_MIN_HALF, MAX_EXPONENT, MIN_FACET};
pub use leaf::optics::{CONE_DEG, LeafSpectrumRow, leaf_body_spectrum, leaf_spectrum};
pub use leaf::state::{LEAF_QUANTITIES, LeafMode, LeafQuantity, LeafState};
pub use leaf::texture::{FACTOR_ONE, LeafTexel, LeafTexture, MAX_FACTOR, MAX_LEAF_SIDE};
pub use leaf::theta::{MAX_ABSORPTION, THETA_P, THETA_Q, rational_theta, three_piece_theta};
pub use leaf::viewed::{MIN_EYE, MIN_SHARE, MIN_UP, ViewedLeaf};
pub use leaf::words as leaf_words;
pub use levels::mip::with_levels;
pub use numeric::power::{POWER_RELATIVE_ERROR, exp, from_root, root};
pub use numeric::quantize::{byte_from_weight, coefficient_from_byte, weight_from_byte};
pub use open::{Levels, open};
pub use resident::expansion_input::{
    EXPANSION_WGSL, EXPANSION_WORKGROUP, ExpansionChannel, ExpansionInput, ExpansionShape, ExpansionSlice,
};
pub use resident::resident::{ASSET_LAYERS, HORIZON_COS, Resident, ResidentBytes, block};
pub use resident::single::SingleBases;
pub use rule::{Rule, Severity};
pub use threads::{Threads, serial};
pub use wgsl::{LEAF_WGSL, VOLTEX_WGSL, WGSL, leaf_wgsl, voltex_wgsl, wgsl_library};

// Words are moved between bytes and `u32` as they lie in memory.
const _: () = assert!(cfg!(target_endian = "little"), "btf-runtime supports little-endian targets");
