//! Writes a picture in bands as a file of its own.

use std::path::Path;

use crate::atomic::write_file_atomically;
use crate::error::CaptureError;
use crate::images::exr;

/// Writes linear `values`, `[pixel, band]`, of a picture of `[width, height]` pixels as an EXR file in half precision, one
/// channel for each of `wavelengths_nm`, named by it.
///
/// # Errors
/// [`CaptureError::BadOutput`] where the values do not fit; [`CaptureError::Write`].
pub fn write_bands_exr(
    path: &Path,
    values: &[f32],
    wavelengths_nm: &[f64],
    [width, height]: [usize; 2],
) -> Result<(), CaptureError> {
    let refused = |reason: String| CaptureError::BadOutput { path: path.into(), reason };
    if values.len() != width * height * wavelengths_nm.len() || values.is_empty() {
        let bands = wavelengths_nm.len();
        return Err(refused(format!("it got {} values for {width} x {height} pixels of {bands} bands", values.len())));
    }
    let bytes = exr::encode_bands(values, wavelengths_nm, width, height).map_err(refused)?;
    write_file_atomically(path, &bytes)
}
