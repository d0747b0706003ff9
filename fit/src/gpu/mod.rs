//! The graphics processor as a calculator: adapters and matrix products.

pub(crate) mod device;
pub(crate) mod product;
pub(crate) mod row_stream;
pub(crate) mod speed;
