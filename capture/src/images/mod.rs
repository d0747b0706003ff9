//! Image files: png, jpg, exr, hdr, tif, ENVI.

pub(crate) mod band_file;
pub(crate) mod bands;
pub(crate) mod channel_file;
pub(crate) mod corrections;
pub(crate) mod decoded;
pub(crate) mod encode8;
pub(crate) mod envi;
pub(crate) mod exr;
pub(crate) mod file_format;
pub(crate) mod gdal_metadata;
pub(crate) mod homography;
pub(crate) mod jpg;
pub(crate) mod png;
pub(crate) mod radiance;
pub(crate) mod radiance_map;
pub(crate) mod tiff;
pub(crate) mod tiff_chunk;
pub(crate) mod tiff_directory;
pub(crate) mod wavelengths;
