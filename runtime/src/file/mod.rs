//! The bytes of an asset file (docs/reference/format.md): packing, parsing, validation.

pub(crate) mod coefficient_coding;
pub(crate) mod format;
pub(crate) mod pack;
pub(crate) mod parse;
pub(crate) mod resident_file;
pub(crate) mod residual_coding;
pub(crate) mod texel_coding;
pub(crate) mod validate;
