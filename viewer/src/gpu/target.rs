//! The picture on a GPU, in bands of rows.

use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use crate::gpu::frame::{GpuPath, GpuPixel};
use crate::gpu::layout::bind;
use crate::gpu::results::readback::{Readback, read_buffer};
use wgpu::BufferUsages;

/// Pixels of a band at most: the paths of a band then take 270 MB.
pub(crate) const MAX_BAND_PIXELS: u64 = 1 << 22;

/// Buffers of one picture size.
pub(crate) struct Target {
    pub size: [u32; 2],
    pub bands: Vec<Band>,
}

/// Rows of a picture that are drawn together: as many as one buffer binding holds.
pub(crate) struct Band {
    pub first_row: u32,
    pub rows: u32,
    /// [`GpuPixel`]s, row-major.
    pub pixels: wgpu::Buffer,
    pub group: wgpu::BindGroup,
}

impl Target {
    /// Allocates the bands of a picture, of at most `max_band_pixels` each (or a row); `shared` are the resources of bind
    /// group 0 that all bands have in common.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] where the driver has no memory for them.
    pub(crate) fn new(
        gpu: &Gpu,
        size: [u32; 2],
        max_band_pixels: u64,
        layout: &wgpu::BindGroupLayout,
        shared: &[(u32, wgpu::BindingResource)],
    ) -> Result<Target, ViewerError> {
        let [width, height] = size;
        let max_pixels = (gpu.max_binding_bytes() / size_of::<GpuPath>() as u64).min(max_band_pixels);
        let band_rows = ((max_pixels / u64::from(width)) as u32).clamp(1, height);
        let band_pixels = u64::from(width) * u64::from(band_rows);
        let bytes = size_of::<GpuPath>() as u64 * band_pixels;
        let paths = gpu.empty_buffer("paths of this picture", bytes, BufferUsages::STORAGE)?;
        let mut bands = Vec::new();
        for first_row in (0..height).step_by(band_rows as usize) {
            let rows = band_rows.min(height - first_row);
            let bytes = size_of::<GpuPixel>() as u64 * u64::from(width) * u64::from(rows);
            let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
            let pixels = gpu.empty_buffer("pixels of this picture", bytes, usage)?;
            let own = [(6, pixels.as_entire_binding()), (7, paths.as_entire_binding())];
            let group = bind(gpu, layout, &[shared, &own].concat());
            bands.push(Band { first_row, rows, pixels, group });
        }
        Ok(Target { size, bands })
    }

    /// Begins to read the pixels back, band by band.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] where the driver has no memory for the copies.
    pub(crate) fn begin_read(&self, gpu: &Gpu) -> Result<Vec<Readback<GpuPixel>>, ViewerError> {
        let read = |band: &Band| Readback::begin(gpu, &band.pixels, (self.size[0] * band.rows) as usize);
        self.bands.iter().map(read).collect()
    }

    /// Reads the pixels back, row-major from the top left.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] with what the driver reported.
    pub(crate) fn read(&self, gpu: &Gpu) -> Result<Vec<GpuPixel>, ViewerError> {
        let [width, height] = self.size;
        let mut pixels = Vec::with_capacity(width as usize * height as usize);
        for band in &self.bands {
            pixels.extend(read_buffer::<GpuPixel>(gpu, &band.pixels, (width * band.rows) as usize)?);
        }
        Ok(pixels)
    }
}
