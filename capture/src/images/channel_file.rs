//! Writes a picture of named quantities as a file of its own.

use std::path::Path;

use crate::atomic::write_file_atomically;
use crate::error::CaptureError;
use crate::images::exr;

/// Writes `values`, `[pixel, channel]`, of a picture of `[width, height]` pixels as an EXR file in single precision with ZIP
/// compression, one channel for each of `names`; never half a file.
///
/// # Errors
/// [`CaptureError::BadOutput`] where the values do not fit; [`CaptureError::Write`].
pub fn write_channels_exr(
    path: &Path,
    values: &[f32],
    names: &[&str],
    [width, height]: [usize; 2],
) -> Result<(), CaptureError> {
    let refused = |reason: String| CaptureError::BadOutput { path: path.into(), reason };
    if values.len() != width * height * names.len() || values.is_empty() {
        let channels = names.len();
        return Err(refused(format!(
            "it got {} values for {width} x {height} pixels of {channels} channels",
            values.len()
        )));
    }
    let bytes = exr::encode_channels(values, names, width, height).map_err(refused)?;
    write_file_atomically(path, &bytes)
}
