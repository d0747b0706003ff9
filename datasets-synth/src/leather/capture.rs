//! From a leather's parameters to a capture folder.

use std::path::Path;

use crate::error::SynthError;
use crate::leather::hide::Leather;
use crate::leather::params::LeatherParams;
use crate::surface::capture::{Progress, write_capture};

/// Makes the leather of `params` and writes its capture to the folder `dir`, with its height map; see
/// [`write_capture`]. The same parameters give the same files on any number of threads.
///
/// # Errors
/// [`SynthError::BadParameter`]; otherwise as [`write_capture`].
pub fn write_leather_capture(
    dir: impl AsRef<Path>,
    params: &LeatherParams,
    progress: Progress,
) -> Result<(), SynthError> {
    params.check()?;
    write_capture(dir, params.capture.info("leather", params.provenance()), || Leather::new(params), progress)
}
