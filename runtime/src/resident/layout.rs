//! The layout of a resident asset's words. Offsets are in words, relative to the asset's first word, so that several
//! assets share one buffer. Twin: `resident/layout.wgsl`.

use crate::asset::limits::{MAX_LAYERS, MAX_LEVELS};

/// Number of words before the offsets of the layers' blocks: width, height, layers, total words, levels, words without
/// the edits (0 if none were ever made), the offset of the spectrum (0 for colours), a zero. The offsets follow level by level.
pub const ASSET_LAYERS: usize = 8;
/// Word that holds the offset of the spectrum.
pub const SPECTRUM: usize = 6;
/// Number of words before the first layer block.
pub const ASSET_WORDS: usize = (ASSET_LAYERS + MAX_LAYERS * MAX_LEVELS).next_multiple_of(PART_WORDS);
/// Number of words of a layer block.
pub const LAYER_BLOCK_WORDS: usize = 32;
/// Unit of the places of blocks and parts in words: 256 bytes, where a GPU lets a binding begin.
pub const PART_WORDS: usize = 64;

/// Positions of the words of a layer block.
pub mod block {
    /// Side of the light.
    pub const LIGHT_SIDE: usize = 0;
    /// Side of the eye.
    pub const VIEW_SIDE: usize = 1;
    /// Kind of the residual's curve, see [`crate::ResidualKind`].
    pub const RESIDUAL_KIND: usize = 2;
    /// Epsilon of the residual's curve (f32).
    pub const EPSILON: usize = 3;
    /// Number of bases: 0 without residual, else 1 + components.
    pub const BASES: usize = 4;
    /// Number of words of a pair and channel: at least `ceil(bases / 2)`; a multiple of 4 where rows are read four words at a
    /// time.
    pub const CHANNEL_WORDS: usize = 5;
    /// Offset of the set of light directions.
    pub const LIGHTS: usize = 6;
    /// Offset of the set of view directions.
    pub const VIEWS: usize = 7;
    /// Offset of the texel records.
    pub const RECORDS: usize = 8;
    /// Offset of the lobe references.
    pub const REFS: usize = 9;
    /// Offset of the table of dictionary offsets, one per cluster.
    pub const DICTIONARIES: usize = 10;
    /// Offset of the expanded bases.
    pub const BASIS: usize = 11;
    /// Offset of the coefficient codes.
    pub const CODES: usize = 12;
    /// Number of words of a texel's codes.
    pub const CODE_WORDS: usize = 13;
    /// Number of lights.
    pub const LIGHT_COUNT: usize = 14;
    /// Number of pairs: views times lights.
    pub const PAIRS: usize = 15;
    /// Cosine below which the light fades to the horizon (f32).
    pub const HORIZON: usize = 16;
    /// Role of the lobes besides the residual, see [`crate::LobeRole`].
    pub const LOBE_ROLE: usize = 17;
    /// Offset of the height codes, 0 without heights.
    pub const HEIGHTS: usize = 18;
    /// Texel widths per height code (f32).
    pub const HEIGHT_STEP: usize = 19;
    /// Least height, texel widths (f32).
    pub const MIN_HEIGHT: usize = 20;
    /// Greatest height, texel widths (f32).
    pub const MAX_HEIGHT: usize = 21;
    /// Texels per row of the level.
    pub const WIDTH: usize = 22;
    /// Number of rows of the level.
    pub const ROWS: usize = 23;
    /// Offset of the list of edits, 0 without edits.
    pub const EDITS: usize = 24;
    /// Number of clusters.
    pub const CLUSTERS: usize = 25;
    /// Number of lobe references.
    pub const REF_COUNT: usize = 26;
    /// Number of edits.
    pub const EDIT_COUNT: usize = 27;
    /// Offset of the records of relief, 0 without relief.
    pub const RELIEF: usize = 28;
    /// Rate at which unlike neighbours lose weight, see [`crate::Relief`] (f32).
    pub const RELIEF_LIKENESS: usize = 29;
    /// Share of the relief's shading (f32).
    pub const RELIEF_SHADING: usize = 30;
    /// Share of the relief's gloss (f32).
    pub const RELIEF_GLOSS: usize = 31;
    /// The fields of [`crate::Relief::numbers`].
    pub(crate) const RELIEF_NUMBERS: [usize; 3] = [RELIEF_LIKENESS, RELIEF_SHADING, RELIEF_GLOSS];
}

/// Cosine below which the light fades to 0 at the horizon (84 degrees), or the least cosine of the set's directions if
/// that is lower.
pub const HORIZON_COS: f32 = 0.1;
/// Least cosine at which the fade starts, so that no decoder divides by a denormal.
pub(crate) const MIN_HORIZON_COS: f32 = 1e-6;
/// Returns columns and rows of the level whose layer's block begins at word `layer`.
pub(crate) fn level_size(words: &[u32], layer: usize) -> [usize; 2] {
    [block::WIDTH, block::ROWS].map(|field| words[layer + field] as usize)
}
