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
/// to be free, and returns one material for colours, or one for each three bands of `info`, with these for its channels.
///
/// # Errors
/// The error of `make`; [`SynthError::Stopped`] if `progress` asks for it; [`SynthError::Capture`] if the folder is not
/// empty or cannot be written. In each case nothing is left behind.
pub fn write_capture<M: Material>(
    dir: impl AsRef<Path>,
    info: CaptureInfo,
    make: impl FnOnce() -> Result<Vec<M>, SynthError>,
    progress: Progress,
) -> Result<(), SynthError> {
    let total = info.pair_count();
    let report = |done: usize| match progress(done, total) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(SynthError::Stopped),
    };
    let (views, lights, bands) = (info.views.units(), info.lights.units(), info.channels());

    // The writer first: it refuses a folder that is not empty before any work.
    let writer = CaptureWriter::create(dir, info)?;
    report(0)?;
    let materials = make()?;
    let Some(first_material) = materials.first() else { return Ok(()) };
    writer.write_map(HEIGHT_MAP_NAME, &first_material.face().height_map_mm(first_material.size()))?;
    let bytes: usize = materials.iter().map(Illumination::bytes).sum();
    let block = (LIGHT_BYTES / bytes).clamp(1, lights.len());
    let done = AtomicUsize::new(0);
    for first in (0..lights.len()).step_by(block) {
        let illuminations: Vec<Vec<Illumination>> = lights[first..(first + block).min(lights.len())]
            .par_iter()
            .map(|&wi| {
                report(done.load(Ordering::Relaxed))?;
                Ok(materials.iter().map(|material| Illumination::new(material, wi)).collect())
            })
            .collect::<Result<_, SynthError>>()?;
        for (view, &wo) in views.iter().enumerate() {
            let hits: Vec<_> = materials.iter().map(|material| ViewHits::new(material, wo)).collect();
            illuminations.par_iter().enumerate().try_for_each(|(i, illuminations)| {
                let threes = materials.iter().zip(&hits).zip(illuminations);
                let threes = threes.map(|((material, hits), illumination)| render(material, hits, illumination));
                writer.write(view, first + i, &bands_of_threes(threes.collect(), bands))?;
                report(done.fetch_add(1, Ordering::Relaxed) + 1)
            })?;
        }
    }
    writer.finish()?;
    Ok(())
}

/// Returns one image `[texel, band]` of images of three bands each; of the last one as many count as there are bands.
fn bands_of_threes(mut threes: Vec<Vec<f32>>, bands: usize) -> Vec<f32> {
    if threes.len() == 1 && bands == 3 {
        return threes.swap_remove(0);
    }
    let texels = threes.first().map_or(0, |three| three.len() / 3);
    let value = |i: usize| threes[i % bands / 3][i / bands * 3 + i % bands % 3];
    (0..texels * bands).map(value).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_of_a_texel_lie_together_and_what_fills_the_last_three_is_left_out() {
        let threes = vec![vec![1.0, 2.0, 3.0, 11.0, 12.0, 13.0], vec![4.0, 5.0, 0.0, 14.0, 15.0, 0.0]];
        assert_eq!(bands_of_threes(threes, 5), [1.0, 2.0, 3.0, 4.0, 5.0, 11.0, 12.0, 13.0, 14.0, 15.0]);
        assert_eq!(bands_of_threes(vec![vec![1.0, 2.0, 3.0]], 3), [1.0, 2.0, 3.0]);
        assert_eq!(bands_of_threes(vec![vec![1.0, 2.0, 3.0]], 1), [1.0]);
    }
}
