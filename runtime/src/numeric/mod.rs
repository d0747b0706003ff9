//! Numbers: small dense algebra, powers in vectors, encodings.

pub(crate) mod algebra;
pub(crate) mod power;
pub(crate) mod quantize;
pub(crate) mod vector;
