//! Image files: png, jpg, exr, hdr.

pub(crate) mod encode8;
pub(crate) mod exr;
pub(crate) mod images;
pub(crate) mod radiance;
pub(crate) mod radiance_map;
