//! The Rust twin of every constant of the library's WGSL, and the constants that WGSL has alone.

use btf_runtime::twin_constants::*;
use btf_runtime::{
    ASSET_LAYERS, COLOUR_FRAME, DIRECTION_WORDS, EDGE_WORDS, EDIT_WORDS, EXPANSION_WORKGROUP, HeightUse, Interpolation,
    LOBE_RESIDENT_WORDS, LeafMode, LobeRole, MAX_LOG, MIN_ALPHA, RATIO_EPSILON, RATIO_RANGE, ROOT, ResidualKind,
    SPHERE_HEADER_WORDS, TRIANGLE_WORDS, block, voltex,
};
use std::collections::BTreeMap;

/// Numbers of each constant by name: one for a scalar, one for each component of a vector. Every `u32`, `i32` and `f32`
/// is exactly a double.
pub type Constants = BTreeMap<String, Vec<f64>>;

/// A constant that WGSL has alone: name, value, and the reason why it has no twin.
type Alone = (&'static str, f64, &'static str);

fn of_words(table: &[(&str, usize)]) -> Constants {
    table.iter().map(|(name, value)| (name.to_string(), vec![*value as f64])).collect()
}

fn of_floats(table: &[(&str, f32)]) -> Constants {
    table.iter().map(|(name, value)| (name.to_string(), vec![f64::from(*value)])).collect()
}

fn of_alone(table: &[Alone]) -> Constants {
    table.iter().map(|(name, value, _)| (name.to_string(), vec![*value])).collect()
}

/// Returns the constants of the decoder's library.
fn decoder() -> [Constants; 3] {
    let words = of_words(&[
        ("SPHERE_HEADER_WORDS", SPHERE_HEADER_WORDS),
        ("DIRECTION_WORDS", DIRECTION_WORDS),
        ("TRIANGLE_WORDS", TRIANGLE_WORDS),
        ("EDGE_WORDS", EDGE_WORDS),
        ("ITEM_EDGE", ITEM_EDGE as usize),
        ("LOBE_RESIDENT_WORDS", LOBE_RESIDENT_WORDS),
        ("RESIDUAL_ADDITIVE", ResidualKind::Additive as usize),
        ("RESIDUAL_LOG", ResidualKind::Log as usize),
        ("RESIDUAL_ROOT", ResidualKind::Root as usize),
        ("LOBE_ROLE_OLD_BASE", LobeRole::OldBase as usize),
        ("LOBE_ROLE_GUIDE", LobeRole::Guide as usize),
        ("LOBE_ROLE_BASE", LobeRole::Base as usize),
        ("INTERPOLATION_FAST", Interpolation::Fast as usize),
        ("INTERPOLATION_EXACT", Interpolation::Exact as usize),
        ("ASSET_SPECTRUM", SPECTRUM),
        ("SPECTRUM_HEAD", SPECTRUM_HEAD),
        ("ASSET_LAYERS", ASSET_LAYERS),
        ("LIGHT_ROWS", LIGHT_ROWS),
        ("BLOCK_LIGHT_SIDE", block::LIGHT_SIDE),
        ("BLOCK_VIEW_SIDE", block::VIEW_SIDE),
        ("BLOCK_RESIDUAL_KIND", block::RESIDUAL_KIND),
        ("BLOCK_EPSILON", block::EPSILON),
        ("BLOCK_BASES", block::BASES),
        ("BLOCK_CHANNEL_WORDS", block::CHANNEL_WORDS),
        ("BLOCK_LIGHTS", block::LIGHTS),
        ("BLOCK_VIEWS", block::VIEWS),
        ("BLOCK_RECORDS", block::RECORDS),
        ("BLOCK_REFS", block::REFS),
        ("BLOCK_DICTIONARIES", block::DICTIONARIES),
        ("BLOCK_BASIS", block::BASIS),
        ("PACKED_PLACES", PACKED_PLACES),
        ("PLACE_WORDS", PLACE_WORDS),
        ("BLOCK_CODES", block::CODES),
        ("BLOCK_CODE_WORDS", block::CODE_WORDS),
        ("BLOCK_LIGHT_COUNT", block::LIGHT_COUNT),
        ("BLOCK_PAIRS", block::PAIRS),
        ("BLOCK_HORIZON", block::HORIZON),
        ("BLOCK_LOBE_ROLE", block::LOBE_ROLE),
        ("BLOCK_HEIGHTS", block::HEIGHTS),
        ("BLOCK_HEIGHT_STEP", block::HEIGHT_STEP),
        ("BLOCK_MIN_HEIGHT", block::MIN_HEIGHT),
        ("BLOCK_MAX_HEIGHT", block::MAX_HEIGHT),
        ("BLOCK_WIDTH", block::WIDTH),
        ("BLOCK_ROWS", block::ROWS),
        ("BLOCK_EDITS", block::EDITS),
        ("BLOCK_RELIEF", block::RELIEF),
        ("BLOCK_RELIEF_LIKENESS", block::RELIEF_LIKENESS),
        ("BLOCK_RELIEF_SHADING", block::RELIEF_SHADING),
        ("BLOCK_RELIEF_GLOSS", block::RELIEF_GLOSS),
        ("RELIEF_WORDS", RELIEF_WORDS),
        ("HEIGHTS_RELIEF", HeightUse::Relief as usize),
        ("EDIT_WORDS", EDIT_WORDS),
    ]);
    let floats = of_floats(&[
        ("INSIDE_TOLERANCE", INSIDE_TOLERANCE),
        ("MIN_COS_VIEW", MIN_COS_VIEW),
        ("MIN_HALF", MIN_HALF),
        ("ROOT", ROOT),
        ("MAX_CHANNEL", MAX_CHANNEL),
        ("MAX_LOG", MAX_LOG),
        ("RATIO_EPSILON", RATIO_EPSILON),
        ("RATIO_MIN", RATIO_RANGE[0]),
        ("RATIO_MAX", RATIO_RANGE[1]),
        ("MAX_SLOPE", MAX_SLOPE),
        ("RAY_STEP", RAY_STEP),
        ("MIN_RAY_STEPS", MIN_RAY_STEPS),
        ("MAX_RAY_STEPS", MAX_RAY_STEPS),
        ("HIDDEN_SHARE", HIDDEN_SHARE),
        ("OUTSIDE_SHARE", OUTSIDE_SHARE),
        ("SHIFT_SLOPE", SHIFT_SLOPE),
        ("SLOPE_STEP", SLOPE_STEP),
        ("HORIZON_STEP", HORIZON_STEP),
        ("MAX_ALBEDO", MAX_ALBEDO),
        ("EVEN_LIGHT", EVEN_LIGHT),
        ("SHADOW_EDGE", SHADOW_EDGE),
        ("GLOSS_ALPHA", GLOSS_ALPHA),
        ("GLOSS_NORMAL", GLOSS_NORMAL),
        ("MIN_COS_EYE", MIN_COS_EYE),
        ("MIN_BEYOND", MIN_BEYOND),
        ("NORMAL_SHARE", NORMAL_SHARE),
        ("COSINE_SHARE", COSINE_SHARE),
        ("MIN_ALPHA", MIN_ALPHA),
        ("MIN_AXIS", MIN_AXIS),
        ("MIN_FRESNEL", MIN_FRESNEL),
        ("MIN_FACET_COS", MIN_FACET_COS),
        ("UNIT_MIN", *UNIT_RANGE.start()),
        ("UNIT_MAX", *UNIT_RANGE.end()),
    ]);
    let frame = [("FRAME_GREY", 0), ("FRAME_RED_BLUE", 1), ("FRAME_GREEN_MAGENTA", 2)];
    let frame = frame.map(|(name, row)| (name.to_string(), COLOUR_FRAME[row].map(f64::from).to_vec()));
    [words, floats, Constants::from(frame)]
}

/// Returns the constants of leaves.
fn leaf() -> [Constants; 3] {
    let words = of_words(&[
        ("LEAF_HALVES_AT", leaf_words::HALVES_AT),
        ("LEAF_SCATTER_AT", leaf_words::SCATTER_AT),
        ("LEAF_CHANNELS_AT", leaf_words::CHANNELS_AT),
        ("LEAF_CLASSES", leaf_words::CLASSES),
        ("LEAF_INCIDENCES", leaf_words::INCIDENCES),
        ("LEAF_COSINES", leaf_words::COSINES),
        ("LEAF_AZIMUTHS", leaf_words::AZIMUTHS),
        ("LEAF_CELL_WORDS", leaf_words::CELL_WORDS),
        ("LEAF_TOTALS_AFTER", leaf_words::TOTALS_AFTER),
        ("LEAF_CELLS_AFTER", leaf_words::CELLS_AFTER),
        ("LEAF_TISSUE", LeafMode::Tissue as usize),
        ("LEAF_BANDS_AT", leaf_words::BANDS_AT),
        ("LEAF_BAND_WORDS", leaf_words::BAND_WORDS),
        ("LEAF_ALBEDO_AT", leaf_words::ALBEDO_AT),
        ("LEAF_ALBEDO_ROWS", leaf_words::ALBEDO_ROWS),
        ("LEAF_ALBEDO_COLUMNS", leaf_words::ALBEDO_COLUMNS),
        ("LEAF_TABLE_AT", leaf_words::TABLE_AT),
        ("LEAF_LOWER_TABLE_AT", leaf_words::LOWER_TABLE_AT),
        ("LEAF_TABLE_ENTRIES", leaf_words::TABLE_ENTRIES),
        ("LEAF_LEVELS_AT", leaf_words::LEVELS_AT),
        ("LEAF_TEXEL_WORDS", leaf_words::TEXEL_WORDS),
        ("LEAF_RATIONAL", LeafMode::Rational as usize),
        ("LEAF_N_LAYERS", LeafMode::NLayers as usize),
        ("LEAF_TWO_SIDED", LeafMode::TwoSided as usize),
    ]);
    let floats = of_floats(&[
        ("LEAF_TABLE_HALF", leaf_words::TABLE_HALF),
        ("LEAF_MAX_ABSORPTION", MAX_ABSORPTION),
        ("LEAF_THETA_P", THETA_P),
        ("LEAF_THETA_Q1", THETA_Q[0]),
        ("LEAF_THETA_Q2", THETA_Q[1]),
        ("LEAF_THETA_Q3", THETA_Q[2]),
        ("LEAF_FACTOR_ONE", FACTOR_ONE),
        ("LEAF_MIN_FACET", MIN_FACET),
        ("LEAF_MIN_HALF", LEAF_MIN_HALF),
        ("LEAF_MAX_EXPONENT", MAX_EXPONENT),
        ("LEAF_MIN_BETWEEN", MIN_BETWEEN),
        ("LEAF_MIN_EYE", MIN_EYE),
        ("LEAF_MIN_SINES", MIN_SINES),
        ("LEAF_MIN_UP", MIN_UP),
        ("LEAF_MIN_SHARE", MIN_SHARE),
    ]);
    [words, floats, Constants::from([("LEAF_LUMINANCE".into(), LUMINANCE.map(f64::from).to_vec())])]
}

/// Returns the constants of volumetric textures.
fn volumes() -> [Constants; 3] {
    let words = of_words(&[
        ("VOLTEX_LEVEL_COUNT_AT", voltex::words::LEVEL_COUNT_AT),
        ("VOLTEX_NODES_AT", voltex::words::NODES_AT),
        ("VOLTEX_VOXELS_AT", voltex::words::VOXELS_AT),
        ("VOLTEX_MATERIALS_AT", voltex::words::MATERIALS_AT),
        ("VOLTEX_LEVELS_AT", voltex::words::LEVELS_AT),
        ("VOLTEX_FLAGS_AT", voltex::words::FLAGS_AT),
        ("VOLTEX_EXTENT_AT", voltex::words::EXTENT_AT),
        ("VOLTEX_SIDE_AT", voltex::words::SIDE_AT),
        ("VOLTEX_MATERIAL_WORDS", voltex::words::MATERIAL_WORDS),
        ("VOLTEX_CLUMPING_AT", voltex::words::CLUMPING_AT),
        ("VOLTEX_FACETS_AT", voltex::words::FACETS_AT),
        ("VOLTEX_LIGHT_CORRECTION_AT", voltex::words::LIGHT_CORRECTION_AT),
        ("VOLTEX_LEVEL_WORDS", voltex::words::LEVEL_WORDS),
        ("VOLTEX_VOXEL_WORDS", VOXEL_WORDS),
        ("VOLTEX_OTHER_AT", OTHER_AT),
        ("VOLTEX_NODE_WORDS", NODE_WORDS),
        ("VOLTEX_NO_VOXEL", voltex::NO_VOXEL as usize),
    ]);
    let floats = of_floats(&[
        ("VOLTEX_MIN_DIRECTION", voltex::MIN_DIRECTION),
        ("VOLTEX_MIN_ROOT", MIN_ROOT),
        ("VOLTEX_SERIES_DEPTH", SERIES_DEPTH),
        ("VOLTEX_MIN_ROUGHNESS", MIN_ROUGHNESS),
        ("VOLTEX_MIN_HALF2", MIN_HALF2),
        ("VOLTEX_MIN_NORMAL2", MIN_NORMAL2),
        ("VOLTEX_MIDDLE_WEIGHT", MIDDLE_WEIGHT),
        ("VOLTEX_MAX_DENSER", MAX_DENSER),
        ("VOLTEX_MIN_REFRACTED", MIN_REFRACTED),
        ("VOLTEX_MIN_DIRECTION2", MIN_DIRECTION2),
        ("VOLTEX_MAX_BRIGHTER", MAX_BRIGHTER),
    ]);
    // The first and the last angle, 0 and 180, stand in the code.
    let [_, near @ .., _] = voltex::HOTSPOT_DEG.map(f64::from);
    let angles = [("VOLTEX_NEAR_DEG", &near[..4]), ("VOLTEX_WIDE_DEG", &near[4..])];
    [words, floats, angles.into_iter().map(|(name, numbers)| (name.to_string(), numbers.to_vec())).collect()]
}

/// Constants that the library has and Rust does not.
const ALONE: [Alone; 9] = [
    ("NO_LAYER", u32::MAX as f64, "Rust has `None`"),
    ("FAR", 1e30f32 as f64, "Rust has infinity, which a shader must not make"),
    ("VOLTEX_FAR", 3e38f32 as f64, "Rust has infinity, which a shader must not make"),
    ("VOLTEX_MAX_DEPTH", 80.0, "Rust's exponential may be infinite"),
    ("DRAW_MAX", (1.0 - f32::EPSILON) as f64, "the largest number below 1, which Rust writes where it clamps"),
    ("SAMPLE_PI", std::f32::consts::PI as f64, "Rust has it in its library"),
    ("SAMPLE_TAU", std::f32::consts::TAU as f64, "Rust has it in its library"),
    ("VOLTEX_HALF_PI", std::f32::consts::FRAC_PI_2 as f64, "Rust has it in its library"),
    ("VOLTEX_DEGREES", 57.295_78_f32 as f64, "Rust has `to_degrees`"),
];

/// Returns the constants of the library: decoder, leaves and volumetric textures.
pub fn library() -> Constants {
    let tables = decoder().into_iter().chain(leaf()).chain(volumes());
    let named: Vec<(String, Vec<f64>)> = tables.chain([of_alone(&ALONE)]).flatten().collect();
    let count = named.len();
    let all: Constants = named.into_iter().collect();
    assert_eq!(all.len(), count, "a constant has two entries");
    all
}

/// Returns the constants of the program that expands bases. Each row of the colour frame has one number there.
pub fn expansion() -> Constants {
    let mut all = of_words(&[
        ("WORKGROUP", EXPANSION_WORKGROUP as usize),
        ("RESIDUAL_ADDITIVE", ResidualKind::Additive as usize),
        ("RESIDUAL_LOG", ResidualKind::Log as usize),
        ("RESIDUAL_ROOT", ResidualKind::Root as usize),
    ]);
    let [grey, red_blue, green_magenta] = [COLOUR_FRAME[0][0], COLOUR_FRAME[1][0], COLOUR_FRAME[2][0]];
    all.extend(of_floats(&[
        ("GREY", grey),
        ("RED_BLUE", red_blue),
        ("GREEN_MAGENTA", green_magenta),
        ("MAX_HALF", half::f16::MAX.to_f32()),
        ("ROOT", ROOT),
        ("MAX_LOG", MAX_LOG),
    ]));
    all
}
