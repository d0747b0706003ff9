//! Expands single assets on a GPU: for comparison with the CPU, and to time it.

use crate::error::ViewerError;
use crate::gpu::arena::{Arena, ArenaAsset};
use crate::gpu::device::Gpu;
use crate::gpu::expand::LayerBases;
use crate::gpu::results::readback::read_buffer;
use btf_runtime::{Asset, Resident};

/// Expands `asset` on `gpu` and reads its words back: for comparison with [`Resident::from_asset`].
///
/// # Errors
/// [`ViewerError::Gpu`], also where the adapter binds less than a cluster takes.
pub fn gpu_expand(gpu: &Gpu, asset: &Asset) -> Result<Vec<u32>, ViewerError> {
    let arena = expanded_arena(gpu, asset)?;
    let mut words = Vec::new();
    for (buffer, place) in arena.pieces.buffers.iter().zip(arena.pieces.places()) {
        words.extend(read_buffer::<u32>(gpu, buffer, place.len())?);
    }
    // Word 3 is the number of them; the buffers have whole quads.
    words.truncate(words[3] as usize);
    Ok(words)
}

/// Measures the milliseconds from `asset` in memory to the expanded words in the adapter's memory, compiling included.
///
/// # Errors
/// As [`gpu_expand`].
pub fn time_gpu_expand(gpu: &Gpu, asset: &Asset) -> Result<f64, ViewerError> {
    let start = web_time::Instant::now();
    expanded_arena(gpu, asset)?;
    gpu.wait()?;
    Ok(1e3 * start.elapsed().as_secs_f64())
}

/// Measures the milliseconds that the upload of `resident` takes, bases included.
///
/// # Errors
/// [`ViewerError::Gpu`] where the adapter has no room for it.
pub fn time_upload(gpu: &Gpu, resident: &Resident) -> Result<f64, ViewerError> {
    let start = web_time::Instant::now();
    Arena::new(gpu, &[ArenaAsset::whole(resident.words())], |_| 0)?;
    gpu.queue.submit([]);
    gpu.wait()?;
    Ok(1e3 * start.elapsed().as_secs_f64())
}

fn expanded_arena(gpu: &Gpu, asset: &Asset) -> Result<Arena, ViewerError> {
    let head = Resident::without_bases(asset);
    let bases = LayerBases::of_asset(gpu, &head, asset)
        .ok_or_else(|| gpu.error("it binds less than a cluster of this asset takes while it is expanded"))?;
    Arena::new(gpu, &[ArenaAsset { words: head.words(), bases: &bases }], |_| 0)
}
