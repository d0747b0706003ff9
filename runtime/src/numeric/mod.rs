//! Numbers: small dense algebra, powers with SIMD, encodings, vectors.

pub(crate) mod algebra;
pub(crate) mod padded_rows;
pub(crate) mod power;
pub(crate) mod quantize;
pub(crate) mod vector;
