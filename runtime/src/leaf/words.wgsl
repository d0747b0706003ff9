// The layout of a leaf's words, counted from its first. Twin: leaf/words.rs, which has the contents.

const LEAF_HALVES_AT: u32 = 10u;
const LEAF_SCATTER_AT: u32 = 14u;
const LEAF_CHANNELS_AT: u32 = 15u;
const LEAF_CLASSES: u32 = 4u;
const LEAF_INCIDENCES: u32 = 20u;
const LEAF_COSINES: u32 = 16u;
const LEAF_AZIMUTHS: u32 = 12u;
const LEAF_CELL_WORDS: u32 = 2u;
const LEAF_TOTALS_AFTER: u32 = 16u;
const LEAF_CELLS_AFTER: u32 = 32u;
const LEAF_BANDS_AT: u32 = 16u;
const LEAF_BAND_WORDS: u32 = 8u;
const LEAF_ALBEDO_AT: u32 = 112u;
const LEAF_ALBEDO_ROWS: u32 = 65u;
const LEAF_ALBEDO_COLUMNS: u32 = 9u;
const LEAF_TABLE_AT: u32 = 697u;
const LEAF_TABLE_ENTRIES: u32 = 65u;
const LEAF_TABLE_HALF: f32 = 0.5;
const LEAF_LOWER_TABLE_AT: u32 = 1477u;
const LEAF_LEVELS_AT: u32 = 2257u;
const LEAF_TEXEL_WORDS: u32 = 4u;

// Returns the number of texels in a row of the finest level, and of its rows.
fn leaf_size(base: u32) -> vec2<u32> {
    return vec2<u32>(asset_word(base + 2u), asset_word(base + 3u));
}

// Returns the number of levels of the textures.
fn leaf_levels(base: u32) -> u32 {
    return asset_word(base + 1u);
}
