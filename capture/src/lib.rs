//! Direction sets, transfer curves, and capture folders: reads and writes samples of a bidirectional texture function
//! (BTF).
//!
//! A capture is a set of photographs of one flat material: one image for every pair of a view and a light. On disk it
//! has Bonn's layout (UBO2003), as a folder or as a zip of one that is read in place:
//! `tvTTT_pvPPP/NNNNN tlTTT plPPP tvTTT pvPPP.EXT` with the angles in degrees. An optional `capture.toml` beside the
//! images holds what the names cannot say. This package also reads, but does not write, images of any names with a list
//! of their directions, Radiance images, spectral EXR, TIFF and ENVI images, and UBO2014 files; docs/guide/captures.md
//! says for each what is taken from where.
//!
//! The quantity everywhere is reflectance x cosine, `pi * BRDF * |n.wi|`, linear, with sRGB
//! primaries: 1.0 is a white Lambertian surface lit at normal incidence. Texels are row-major from
//! the top left, the channel comes last, and pair index = `view * lights + light`.
//!
//! ```
//! use btf_capture::{Capture, CaptureInfo, CaptureWriter, DirectionSet, ImageFormat, Pixels};
//!
//! let parent = tempfile::tempdir()?;
//! let dir = parent.path().join("grey");
//! let set = DirectionSet::random(3, 1)?;
//! let info = CaptureInfo::new("grey", 4, 4, set.clone(), set, ImageFormat::Png);
//! let writer = CaptureWriter::create(&dir, info)?;
//! for view in 0..3 {
//!     for light in 0..3 {
//!         writer.write(view, light, &[0.25; 4 * 4 * 3])?;
//!     }
//! }
//! writer.finish()?;
//!
//! let capture = Capture::open(&dir)?;
//! let table = capture.info().linear_from_encoded8(2);
//! let Pixels::Encoded8(values) = capture.read(0, 2)? else { unreachable!("png has 8 bits") };
//! assert!((table[values[0] as usize] - 0.25).abs() < 0.002);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Read in this order: [`Direction`] and [`DirectionSet`]; [`CaptureInfo`] with [`Transfer`], [`Cosine`] and [`Side`],
//! which hold the radiometry; [`Capture`] and [`CaptureWriter`]; [`CaptureError`]. [`mod@atomic`] and [`files`] serve every
//! program that writes and reads files, [`toml_text`] those that read TOML, [`delimited`] those that read tables, [`cie`] those that compute with spectra.
//!
//! Error metrics belong to the fitter. Views and lights form a grid, of which pairs may have no image.

pub mod atomic;
#[cfg(test)]
mod bad_input;
mod capture;
mod colour;
pub mod delimited;
mod direction;
mod error;
pub mod files;
mod image_file;
mod images;
mod info;
mod layout;
mod shared_bytes;
mod stamp;
pub mod toml_text;
mod ubo2014;
mod units;
mod writer;

pub use atomic::{AtomicFile, write_file_atomically};
pub use capture::{Capture, Pixels, Snapped};
pub use colour::cie;
pub use colour::ciede::{Lab, LabConverter, delta_e00, lab_from_linear};
pub use colour::illuminant::{Illuminant, Observer, shown_weights};
pub use colour::spectrum::{rgb_of, rgb_weights};
pub use colour::transfer::Transfer;
pub use direction::{Direction, DirectionSet, MAX_DIRECTIONS};
pub use error::CaptureError;
pub use images::band_file::write_bands_exr;
pub use images::bands::MAX_BANDS;
pub use images::channel_file::write_channels_exr;
pub use images::decoded::MIN_LINEAR;
pub use images::encode8::Encoder8;
pub use images::radiance_map::RadianceMap;
pub use info::{CaptureInfo, Cosine, ImageFormat, Side};
pub use shared_bytes::SharedBytes;
pub use stamp::FileStamp;
pub use ubo2014::{ContainerInfo, ContainerKind, HeightMap};
pub use units::{bytes_from_text, text_from_bytes};
pub use writer::CaptureWriter;
