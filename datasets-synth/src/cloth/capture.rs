//! From a cloth's parameters to a capture folder.

use std::path::Path;

use crate::cloth::fabric::Cloth;
use crate::cloth::params::ClothParams;
use crate::error::SynthError;
use crate::surface::capture::{Progress, write_capture};

/// Weaves the cloth of `params` and writes its capture to the folder `dir`, with its height map; see
/// [`write_capture`]. The same parameters give the same files on any number of threads.
///
/// # Errors
/// [`SynthError::BadParameter`]; otherwise as [`write_capture`].
pub fn write_cloth_capture(dir: impl AsRef<Path>, params: &ClothParams, progress: Progress) -> Result<(), SynthError> {
    params.check()?;
    write_capture(dir, params.capture.info("cloth", params.provenance()), || Cloth::new(params), progress)
}
