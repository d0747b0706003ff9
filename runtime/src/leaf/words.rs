//! The layout of a leaf's words: one array that a renderer holds beside assets. Twin: `leaf/words.wgsl`.
//!
//! | words | contents |
//! |---|---|
//! | 0 | [`LEAF_MAGIC`] |
//! | 1, 2, 3 | levels, texels in a row of level 0, its rows |
//! | 4, 5 | mode, bands in use |
//! | 6 to 9 | gloss: index, roughness along and across the veins, mean directional albedo |
//! | [`HALVES_AT`] | how much more of the pigments a layer of the upper half holds than one of the whole leaf, of water and dry matter; the same of the lower half |
//! | [`SCATTER_AT`], [`CHANNELS_AT`] | first word of the table of an algorithmic model, 0 without one; its channels |
//! | [`BANDS_AT`] | the bands of `BAND_SHARES`, [`BAND_WORDS`] each: absorption per layer by chlorophyll, by carotenoids, by brown pigment and anthocyanins, by all else; shares of red, green and blue; transmittance of the interface from inside, for two halves from outside |
//! | [`ALBEDO_AT`] | directional albedo of the gloss, [`ALBEDO_ROWS`] x [`ALBEDO_COLUMNS`] |
//! | [`TABLE_AT`] | a table for each band, [`TABLE_ENTRIES`] entries: reflectance (low half) and transmittance (high half) in 1/65535, of the light that entered; for two halves of the upper half's pile in the air |
//! | [`LOWER_TABLE_AT`] | the same of the lower half's pile; 0 in other modes |
//! | [`LEVELS_AT`] | first word of each level |
//! | [`TEXELS_AT`] | texels, four words each, level after level, the top row first |
//! | after the texels | of an algorithmic model: lengths of ways, [`CLASSES`] for each face and side; from [`TOTALS_AFTER`] on the shares of light from all around, [`CLASSES`] for each face and side; from [`CELLS_AFTER`] on the cells, [`CELL_WORDS`] each, by face, side, channel, incidence, cosine and azimuth: `pi f` of each class as half floats |
//!
//! Numbers are u32 or f32 as bits; offsets count from the magic word. Words 4 to [`LEVELS_AT`] depend on the state and
//! have the same length for every state; the others are those of the textures.

use crate::leaf::figures::LEAF_BANDS;

/// First word of a leaf: `LEAF` as bytes, so that a leaf is not taken for an asset.
pub const LEAF_MAGIC: u32 = u32::from_le_bytes(*b"LEAF");
/// First word of the state.
pub const STATE_AT: usize = 4;
/// First word of what the layers of two halves hold.
pub const HALVES_AT: usize = 10;
/// Number of the word that holds the first word of the table of an algorithmic model.
pub const SCATTER_AT: usize = 14;
/// Number of the word that holds the number of channels of that table: 1 or 3.
pub const CHANNELS_AT: usize = 15;
/// Number of classes of ways through the tissue.
pub const CLASSES: usize = 4;
/// Number of incidences, evenly spaced in the root of the cosine.
pub const INCIDENCES: usize = 20;
/// Number of classes of the cosine of the eye.
pub const COSINES: usize = 16;
/// Number of classes of the cosine of half the azimuth between light and eye.
pub const AZIMUTHS: usize = 12;
/// Words of a cell.
pub const CELL_WORDS: usize = CLASSES / 2;
/// Words of the table before the shares of light from all around.
pub const TOTALS_AFTER: usize = 4 * CLASSES;
/// Words of the table before its cells.
pub const CELLS_AFTER: usize = TOTALS_AFTER + 4 * CLASSES;
/// First word of the bands.
pub const BANDS_AT: usize = 16;
/// Number of words of a band.
pub const BAND_WORDS: usize = 8;
/// First word of the table of directional albedo.
pub const ALBEDO_AT: usize = BANDS_AT + LEAF_BANDS * BAND_WORDS;
/// Number of rows of the albedo table, evenly spaced in the root of the cosine.
pub const ALBEDO_ROWS: usize = 65;
/// Number of columns of the albedo table, evenly spaced in the roughness that the plane of incidence cuts, from the
/// smaller to the larger.
pub const ALBEDO_COLUMNS: usize = 9;
/// First word of the bands' tables.
pub const TABLE_AT: usize = ALBEDO_AT + ALBEDO_ROWS * ALBEDO_COLUMNS;
/// Number of entries of a band's table, evenly spaced in k / (k + [`TABLE_HALF`]); at the last, k is infinite.
pub const TABLE_ENTRIES: usize = 65;
/// Absorption at the middle of a table.
pub const TABLE_HALF: f32 = 0.5;
/// First word of the tables of the lower half.
pub const LOWER_TABLE_AT: usize = TABLE_AT + LEAF_BANDS * TABLE_ENTRIES;
/// First word of the levels' offsets.
pub const LEVELS_AT: usize = LOWER_TABLE_AT + LEAF_BANDS * TABLE_ENTRIES;
/// Largest number of levels.
pub const MAX_LEAF_LEVELS: usize = 16;
/// First word of the texels.
pub const TEXELS_AT: usize = LEVELS_AT + MAX_LEAF_LEVELS;
/// Number of words of a texel.
pub const TEXEL_WORDS: usize = 4;
