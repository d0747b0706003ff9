//! Numbers: small dense algebra, loops in vectors, powers with SIMD, encodings, vectors.

pub(crate) mod algebra;
pub(crate) mod in_vectors;
pub(crate) mod padded_rows;
pub(crate) mod power;
pub(crate) mod quantize;
pub(crate) mod vector;
