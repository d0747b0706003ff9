//! Where a leaf's words lie: one array that a renderer holds beside assets. Twin: `shaders/leaf_words.wgsl`.
//!
//! | words | hold |
//! |---|---|
//! | 0 | [`LEAF_MAGIC`] |
//! | 1, 2, 3 | levels, texels in a row of level 0, its rows |
//! | 4, 5 | mode, bands in use |
//! | 6 to 9 | of the gloss: index, roughness along and across the veins, mean directional albedo |
//! | [`BANDS_AT`] | the bands of `BAND_SHARES`, [`BAND_WORDS`]: absorption per layer by chlorophyll, by carotenoids, by brown pigment and anthocyanins, by all else; shares of red, green and blue; transmittance of the interface from inside |
//! | [`ALBEDO_AT`] | directional albedo of the gloss, [`ALBEDO_ROWS`] x [`ALBEDO_COLUMNS`] |
//! | [`TABLE_AT`] | a table each of [`TABLE_ENTRIES`]: reflectance (low half) and transmittance (high half) in 1/65535 |
//! | [`LEVELS_AT`] | first word of each level |
//! | [`TEXELS_AT`] | texels, four words each, level after level, the top row first |
//!
//! Numbers are u32 or f32 as bits; offsets count from the magic. Words 4 to [`LEVELS_AT`] are the state's, of one length
//! whatever the state; the others are the textures'.

use crate::leaf::figures::LEAF_BANDS;

/// First word: `LEAF` as bytes, so that nobody takes a leaf for an asset.
pub const LEAF_MAGIC: u32 = u32::from_le_bytes(*b"LEAF");
/// First word of the state.
pub const STATE_AT: usize = 4;
/// First word of the bands.
pub const BANDS_AT: usize = 16;
/// Words of a band.
pub const BAND_WORDS: usize = 8;
/// First word of the table of directional albedo.
pub const ALBEDO_AT: usize = BANDS_AT + LEAF_BANDS * BAND_WORDS;
/// Its rows, even in the root of the cosine.
pub const ALBEDO_ROWS: usize = 65;
/// Its columns, even in the roughness that the plane of incidence cuts, from the smaller to the larger.
pub const ALBEDO_COLUMNS: usize = 9;
/// First word of the bands' tables.
pub const TABLE_AT: usize = ALBEDO_AT + ALBEDO_ROWS * ALBEDO_COLUMNS;
/// Entries of a band's table, even in k / (k + [`TABLE_HALF`]); at the last, k is infinite.
pub const TABLE_ENTRIES: usize = 65;
/// Absorption at the middle of a table.
pub const TABLE_HALF: f32 = 0.5;
/// First word of the levels' offsets.
pub const LEVELS_AT: usize = TABLE_AT + LEAF_BANDS * TABLE_ENTRIES;
/// Most levels.
pub const MAX_LEAF_LEVELS: usize = 16;
/// First word of the texels.
pub const TEXELS_AT: usize = LEVELS_AT + MAX_LEAF_LEVELS;
/// Words of a texel.
pub const TEXEL_WORDS: usize = 4;
