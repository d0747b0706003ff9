//! Buffers on their way back from a GPU. A browser does not let a program wait for them.

use crate::error::ViewerError;
use crate::gpu::device::{Gpu, one_line};
use std::marker::PhantomData;
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// A copy of a buffer that is being made.
pub(crate) struct Readback<T> {
    staging: wgpu::Buffer,
    bytes: u64,
    mapped: Receiver<Result<(), wgpu::BufferAsyncError>>,
    of: PhantomData<T>,
}

impl<T: bytemuck::Pod> Readback<T> {
    /// Begins to copy `count` values from the start of `buffer`, which has `COPY_SRC`.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] where the driver has no memory for the copy.
    pub(crate) fn begin(gpu: &Gpu, buffer: &wgpu::Buffer, count: usize) -> Result<Readback<T>, ViewerError> {
        let bytes = (count * size_of::<T>()) as u64;
        let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
        let staging = gpu.empty_buffer("results", bytes, usage)?;
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, bytes);
        gpu.queue.submit([encoder.finish()]);
        let (sender, mapped) = channel();
        staging.map_async(wgpu::MapMode::Read, 0..bytes, move |result| {
            // The receiver is gone only if nobody wants the copy.
            let _ = sender.send(result);
        });
        Ok(Readback { staging, bytes, mapped, of: PhantomData })
    }

    /// Returns the values once they are there.
    ///
    /// # Errors
    /// What the driver reported.
    pub(crate) fn take(&self, gpu: &Gpu) -> Option<Result<Vec<T>, ViewerError>> {
        let failed = || gpu.error("its results cannot be read back");
        match self.mapped.try_recv() {
            Ok(Ok(())) => Some(self.values(gpu)),
            Ok(Err(_)) | Err(TryRecvError::Disconnected) => Some(Err(failed())),
            Err(TryRecvError::Empty) => None,
        }
    }

    fn values(&self, gpu: &Gpu) -> Result<Vec<T>, ViewerError> {
        let view =
            self.staging.get_mapped_range(0..self.bytes).map_err(|error| gpu.error(one_line(&error.to_string())))?;
        Ok(bytemuck::pod_collect_to_vec(&view))
    }
}

/// Copies `count` values from the start of a buffer, which has `COPY_SRC`, and waits for them, which a browser does not allow.
///
/// # Errors
/// What the driver reported.
pub(crate) fn read_buffer<T: bytemuck::Pod>(
    gpu: &Gpu,
    buffer: &wgpu::Buffer,
    count: usize,
) -> Result<Vec<T>, ViewerError> {
    let readback = Readback::begin(gpu, buffer, count)?;
    gpu.wait()?;
    readback.take(gpu).unwrap_or_else(|| Err(gpu.error("its results cannot be waited for")))
}
