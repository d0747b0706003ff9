//! Photographs a material into a capture folder.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use btf_capture::{CaptureInfo, CaptureWriter};
use rayon::prelude::*;

use crate::error::SynthError;
use crate::surface::rig::{Illumination, Material, ViewHits, render};

/// Bytes that the lights held at a time may take; more lights are processed in blocks, each of which marches the views
/// again.
const LIGHT_BYTES: usize = 256 << 20;

/// Name of the height map in a capture folder.
pub const HEIGHT_MAP_NAME: &str = "height.exr";

/// Callback that is called now and then with the number of images done and of all images; `Break` stops the work.
pub type Progress<'a> = &'a (dyn Fn(usize, usize) -> ControlFlow<()> + Sync);

/// Photographs the material that `make` returns under every pair of the views and lights of `info` into the folder
/// `dir`, and saves the heights of the visible face beside the images ([`HEIGHT_MAP_NAME`], millimetres). Runs in
/// parallel on the current thread pool; the number of threads never matters. `make` is called once the folder is known
/// to be free.
///
/// # Errors
/// The error of `make`; [`SynthError::Stopped`] if `progress` asks for it; [`SynthError::Capture`] if the folder is not
/// empty or cannot be written. In each case nothing is left behind.
pub fn write_capture<M: Material>(
    dir: impl AsRef<Path>,
    info: CaptureInfo,
    make: impl FnOnce() -> Result<M, SynthError>,
    progress: Progress,
) -> Result<(), SynthError> {
    let total = info.pair_count();
    let report = |done: usize| match progress(done, total) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(SynthError::Stopped),
    };
    let (views, lights) = (info.views.units(), info.lights.units());

    // The writer first: it refuses a folder that is not empty before any work.
    let writer = CaptureWriter::create(dir, info)?;
    report(0)?;
    let material = make()?;
    writer.write_map(HEIGHT_MAP_NAME, &material.face().height_map_mm(material.size()))?;
    let block = (LIGHT_BYTES / Illumination::bytes(&material)).clamp(1, lights.len());
    let done = AtomicUsize::new(0);
    for first in (0..lights.len()).step_by(block) {
        let illuminations: Vec<Illumination> = lights[first..(first + block).min(lights.len())]
            .par_iter()
            .map(|&wi| {
                report(done.load(Ordering::Relaxed))?;
                Ok(Illumination::new(&material, wi))
            })
            .collect::<Result<_, SynthError>>()?;
        for (view, &wo) in views.iter().enumerate() {
            let hits = ViewHits::new(&material, wo);
            illuminations.par_iter().enumerate().try_for_each(|(i, illumination)| {
                writer.write(view, first + i, &render(&material, &hits, illumination))?;
                report(done.fetch_add(1, Ordering::Relaxed) + 1)
            })?;
        }
    }
    writer.finish()?;
    Ok(())
}
