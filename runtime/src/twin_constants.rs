//! Constants that shaders repeat, for the tests that compare the two. Not part of the promised interface.

pub use crate::asset::disk::ITEM_EDGE;
pub use crate::asset::lobe::{MIN_COS_VIEW, MIN_HALF};
pub use crate::asset::relief::{EVEN_LIGHT, HORIZON_STEP, MAX_ALBEDO, RELIEF_WORDS, SLOPE_STEP};
pub use crate::asset::spectrum::{MAX_CHANNEL, SPECTRUM_HEAD};
pub use crate::asset::sphere::INSIDE_TOLERANCE;
pub use crate::decode::evaluate::UNIT_RANGE;
pub use crate::decode::parallax::{
    HIDDEN_SHARE, MAX_RAY_STEPS, MAX_SLOPE, MIN_RAY_STEPS, OUTSIDE_SHARE, RAY_STEP, SHIFT_SLOPE,
};
pub use crate::decode::relief::{GLOSS_ALPHA, GLOSS_NORMAL, MIN_BEYOND, MIN_COS_EYE, NORMAL_SHARE, SHADOW_EDGE};
pub use crate::decode::sample::{COSINE_SHARE, MIN_AXIS, MIN_FACET_COS, MIN_FRESNEL};
pub use crate::decode::viewed_texel::LIGHT_ROWS;
pub use crate::leaf::body::MIN_BETWEEN;
pub use crate::leaf::lobe::{LEAF_MIN_HALF, MAX_EXPONENT, MIN_FACET};
pub use crate::leaf::texture::FACTOR_ONE;
pub use crate::leaf::theta::{MAX_ABSORPTION, THETA_P, THETA_Q};
pub use crate::leaf::viewed::{LUMINANCE, MIN_EYE, MIN_SHARE, MIN_SINES, MIN_UP};
pub use crate::leaf::words as leaf_words;
pub use crate::resident::layout::SPECTRUM;
pub use crate::resident::packed_part::{PACKED_PLACES, PLACE_WORDS};
pub use crate::voltex::corrections::facets::{MAX_DENSER, MIN_HALF2};
pub use crate::voltex::corrections::light_correction::{MAX_BRIGHTER, MIN_DIRECTION2};
pub use crate::voltex::gloss::{MIDDLE_WEIGHT, MIN_NORMAL2, MIN_REFRACTED, MIN_ROUGHNESS};
pub use crate::voltex::node::NODE_WORDS;
pub use crate::voltex::shade::{MIN_ROOT, SERIES_DEPTH};
pub use crate::voltex::voxel::{OTHER_AT, VOXEL_WORDS};
