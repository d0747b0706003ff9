//! The graphics processor as a calculator: adapters, matrix products, and what a fit computes on them.

pub(crate) mod device;
pub(crate) mod fit_gpu;
pub(crate) mod product;
pub(crate) mod row_stream;
pub(crate) mod speed;
