//! A picture that the CPU draws for the window.

use crate::cpu::picture::CpuPicture;
use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use crate::gpu::frame::GpuPixel;
use crate::options::ShadeOptions;
use crate::scene::scene::Scene;

/// A picture and the buffer in which the window shows it.
pub(crate) struct CpuCanvas {
    pub picture: CpuPicture,
    pub buffer: wgpu::Buffer,
}

impl CpuCanvas {
    /// Makes a picture without samples.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] where the driver has no memory for it.
    pub fn new(gpu: &Gpu, size: [u32; 2]) -> Result<CpuCanvas, ViewerError> {
        let bytes = size_of::<GpuPixel>() as u64 * u64::from(size[0]) * u64::from(size[1]);
        let buffer = gpu.empty_buffer("pixels of this picture", bytes, wgpu::BufferUsages::STORAGE)?;
        Ok(CpuCanvas { picture: CpuPicture::new(size), buffer })
    }

    /// Returns width and height, pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.picture.width, self.picture.height]
    }

    /// Adds a sample to every pixel.
    pub fn add_sample(&mut self, gpu: &Gpu, scene: &Scene, options: &ShadeOptions) {
        self.picture.add_sample(scene, options, &|| true);
        self.upload(gpu);
    }

    /// Brings the picture into its buffer.
    pub fn upload(&self, gpu: &Gpu) {
        let picture = &self.picture;
        let drawn = picture.sums.iter().zip(&picture.hits);
        let pixels: Vec<GpuPixel> = drawn.map(|(sum, hit)| GpuPixel::of_sum(*sum, picture.samples, hit)).collect();
        gpu.queue.write_buffer(&self.buffer, 0, bytemuck::cast_slice(&pixels));
    }
}
