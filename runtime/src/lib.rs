//! The packed BTF asset (`.spmm`) and its decoder, in Rust and WGSL.
//!
//! Bytes in, numbers out, and bytes out of the packer: no files, no threads, no GPU, no image codecs.
//! The byte layout is docs/FORMAT.md; the model is docs/MODEL.md.
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

mod algebra;
mod asset;
mod container;
mod decode;
mod edit;
mod entropy;
mod error;
mod evaluate;
mod expansion;
mod expansion_input;
mod fault;
mod finding;
mod format;
mod leaf;
mod leaf_body;
mod leaf_error;
mod leaf_figures;
mod leaf_gloss;
mod leaf_lobe;
mod leaf_optics;
mod leaf_state;
mod leaf_texture;
mod leaf_theta;
pub mod leaf_words;
mod lobe;
mod lobe_queue;
mod mip;
mod open;
mod pack;
mod parallax;
mod parse;
mod power;
mod quantize;
mod resident;
mod resident_check;
mod resident_file;
mod residual;
pub mod rule;
mod sample;
mod sections;
mod single;
mod sphere;
#[doc(hidden)]
pub mod testing;
mod texel;
mod texel_coding;
mod texel_residual;
mod threads;
mod validate;
mod viewed_leaf;
mod viewed_texel;
pub mod voltex;
mod wgsl;

pub use asset::{Asset, DictionaryLobe, Layer, Level, LevelTexels, LobeRef, LobeRole, SurfaceSide};
pub use container::{ALIGNMENT, Directory, SectionEntry};
pub use decode::{
    DecodeOptions, Interpolation, RATIO_EPSILON, RATIO_RANGE, decode, decode_from_file_form, decode_measured,
    decode_single, lobe_sum_at_pairs, lobe_tables,
};
pub use edit::{EDIT_WORDS, Edit, Edits, MOST_EDIT_WORDS, MOST_EDITS};
pub use entropy::plane_bytes;
pub use error::FormatError;
pub use evaluate::{Query, Sample, UNIT_RANGE, density, evaluate, evaluate_many, is_unit, sample};
pub use expansion_input::{
    EXPANSION_WGSL, EXPANSION_WORKGROUP, ExpansionChannel, ExpansionInput, ExpansionShape, ExpansionSlice,
};
pub use finding::Finding;
pub use format::{
    Form, Head, MAGIC, MAX_BASIS_STEP, MAX_CLUSTERS, MAX_COEFFICIENT_STEP, MAX_COMPONENTS, MAX_LAYERS, MAX_SHARED,
    MOST_LEVELS, MOST_SIDE_MM, PIECE_BYTES, RESIDENT_ALIGNMENT, SectionKind, VERSION, read_directory,
};
pub use leaf::Leaf;
pub use leaf_body::LeafBody;
pub use leaf_error::LeafError;
pub use leaf_figures::{BAND_SHARES, LEAF_ROWS, LeafRow, PRINTED_ROWS, THREE_ROWS};
pub use leaf_lobe::{LEAST_FACET, LEAST_HALF, MOST_EXPONENT};
pub use leaf_optics::{CONE_DEG, LeafSpectrumRow, leaf_body_spectrum, leaf_spectrum};
pub use leaf_state::{LEAF_QUANTITIES, LeafMode, LeafQuantity, LeafState};
pub use leaf_texture::{FACTOR_ONE, LeafTexel, LeafTexture, MOST_FACTOR, MOST_LEAF_SIDE};
pub use leaf_theta::{MOST_ABSORPTION, THETA_P, THETA_Q, rational_theta, three_piece_theta};
pub use lobe::{
    Lobe, LobeFamily, LobeSetup, MIN_COS_VIEW, MIN_HALF, RESIDENT_WORDS as LOBE_RESIDENT_WORDS, ResidentLobe,
};
pub use mip::with_levels;
pub use open::{Levels, open};
pub use pack::pack;
pub use parallax::{
    HIDDEN_SHARE, HeightField, Heights, LEAST_RAY_STEPS, MOST_HEIGHT_STEP, MOST_RAY_STEPS, MOST_SLOPE, OUTSIDE_SHARE,
    RAY_STEP, SHIFT_SLOPE, SeenBy,
};
pub use power::{POWER_RELATIVE_ERROR, exp, from_root, root};
pub use quantize::{byte_from_weight, coefficient_from_byte, weight_from_byte};
pub use resident::{ASSET_LAYERS, HORIZON_COS, Resident, ResidentBytes, block};
pub use resident_file::ResidentFile;
pub use residual::{
    Basis, COLOUR_FRAME, Coefficients, Factors, MAX_LOG, ROOT, Residual, ResidualKind, SharedBases, core_at_pair,
    expand_core,
};
pub use rule::{Rule, Severity};
pub use sample::{COSINE_SHARE, LEAST_ALPHA, LEAST_AXIS, sample_lobe_density, sample_lobe_direction};
pub use single::SingleBases;
pub use sphere::{
    DIRECTION_WORDS, EDGE_WORDS, INSIDE_TOLERANCE, ITEM_EDGE, Neighbours, SPHERE_HEADER_WORDS, Sphere, TRIANGLE_WORDS,
};
pub use threads::{Threads, serial};
pub use validate::{Report, validate};
pub use viewed_leaf::{LEAST_EYE, LEAST_SHARE, LEAST_UP, ViewedLeaf};
pub use viewed_texel::{LIGHT_ROWS, LightRows, ViewedTexel};
pub use wgsl::{LEAF_WGSL, VOLTEX_WGSL, WGSL, leaf_wgsl, voltex_wgsl, wgsl_library};

// Words are moved between bytes and `u32` as they lie in memory.
const _: () = assert!(cfg!(target_endian = "little"), "btf-runtime supports little-endian targets");
