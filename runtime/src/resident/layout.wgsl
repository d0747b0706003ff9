// The layout of a resident asset's words, relative to the asset's first. Twin: resident/layout.rs, which has the contents.

const ASSET_SPECTRUM: u32 = 6u;
const ASSET_LAYERS: u32 = 8u;
const BLOCK_LIGHT_SIDE: u32 = 0u;
const BLOCK_VIEW_SIDE: u32 = 1u;
const BLOCK_RESIDUAL_KIND: u32 = 2u;
const BLOCK_EPSILON: u32 = 3u;
const BLOCK_BASES: u32 = 4u;
const BLOCK_CHANNEL_WORDS: u32 = 5u;
const BLOCK_LIGHTS: u32 = 6u;
const BLOCK_VIEWS: u32 = 7u;
const BLOCK_RECORDS: u32 = 8u;
const BLOCK_REFS: u32 = 9u;
const BLOCK_DICTIONARIES: u32 = 10u;
const BLOCK_BASIS: u32 = 11u;
const BLOCK_CODES: u32 = 12u;
const BLOCK_CODE_WORDS: u32 = 13u;
const BLOCK_LIGHT_COUNT: u32 = 14u;
const BLOCK_PAIRS: u32 = 15u;
const BLOCK_HORIZON: u32 = 16u;
const BLOCK_LOBE_ROLE: u32 = 17u;
const BLOCK_HEIGHTS: u32 = 18u;
const BLOCK_HEIGHT_STEP: u32 = 19u;
const BLOCK_MIN_HEIGHT: u32 = 20u;
const BLOCK_MAX_HEIGHT: u32 = 21u;
const BLOCK_WIDTH: u32 = 22u;
const BLOCK_ROWS: u32 = 23u;
const BLOCK_EDITS: u32 = 24u;
const BLOCK_RELIEF: u32 = 28u;
const BLOCK_RELIEF_LIKENESS: u32 = 29u;
const BLOCK_RELIEF_SHADING: u32 = 30u;
const BLOCK_RELIEF_GLOSS: u32 = 31u;
const EDIT_WORDS: u32 = 8u;

// Returns columns and rows of the level whose layer's block begins at word `layer`.
fn level_size(layer: u32) -> vec2<u32> {
    return vec2<u32>(asset_word(layer + BLOCK_WIDTH), asset_word(layer + BLOCK_ROWS));
}
