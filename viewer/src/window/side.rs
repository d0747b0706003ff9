//! A picture in the making in the window: on the GPU by a tracer, or on the CPU. A split view has two.

use super::renderer::Renderer;
use crate::cpu::picture::CpuPicture;
use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use crate::gpu::frame::{FrameRequest, GpuPixel};
use crate::gpu::scene_change::{SceneChange, Updated};
use crate::gpu::timer::{GpuTimer, PassTimes};
use crate::gpu::tracer::Tracer;
use crate::scene::scene::Scene;
use std::time::Instant;

/// The picture of one renderer.
#[derive(Default)]
pub(crate) struct Side {
    tracer: Option<Tracer>,
    cpu: Option<(CpuPicture, wgpu::Buffer)>,
}

/// Time of a sample.
pub(crate) struct Took {
    /// Milliseconds.
    pub ms: f64,
    /// The sample by kind of pass, where the GPU has timestamps.
    pub passes: Option<PassTimes>,
    /// Whether it was the first sample of a renderer, which holds its compilation on some drivers.
    pub first: bool,
}

impl Side {
    /// Returns width and height of the picture, pixels.
    pub(crate) fn size(&self) -> Option<[u32; 2]> {
        let cpu = self.cpu.as_ref().map(|(picture, _)| [picture.width, picture.height]);
        self.tracer.as_ref().and_then(Tracer::size).or(cpu)
    }

    /// Returns the rows of the picture in buffers: the first row, how many, and the buffer.
    pub(crate) fn bands(&self) -> Vec<(u32, u32, &wgpu::Buffer)> {
        match (&self.tracer, &self.cpu) {
            (Some(tracer), _) => tracer.bands().iter().map(|band| (band.first_row, band.rows, &band.pixels)).collect(),
            (None, Some((picture, buffer))) => vec![(0, picture.height, buffer)],
            (None, None) => Vec::new(),
        }
    }

    /// Takes over a change of the scene.
    pub(crate) fn update(&mut self, scene: &Scene, change: &SceneChange) {
        let Some(tracer) = &mut self.tracer else { return };
        // What cannot be taken over is uploaded anew, which tells why.
        if !matches!(tracer.update(scene, change), Ok(Updated::InPlace)) {
            self.tracer = None;
        }
    }

    /// Adds a sample to the picture; number 0 starts anew.
    ///
    /// # Errors
    /// What the driver reported; those of uploading the scene.
    pub(crate) fn add_sample(
        &mut self,
        gpu: &Gpu,
        renderer: Renderer,
        request: &FrameRequest,
        timer: Option<&mut GpuTimer>,
    ) -> Result<Took, ViewerError> {
        let FrameRequest { scene, size, options, sample } = *request;
        match renderer {
            Renderer::Gpu(kind) => {
                self.cpu = None;
                let first = self.tracer.is_none();
                let tracer = match &mut self.tracer {
                    Some(tracer) => tracer,
                    none => none.insert(Tracer::new(gpu, scene, kind)?),
                };
                let (ms, passes) = tracer.timed_sample(request, timer)?;
                Ok(Took { ms, passes, first })
            }
            Renderer::Cpu => {
                self.tracer = None;
                let start = Instant::now();
                if sample == 0 || self.cpu.is_none() {
                    let bytes = size_of::<GpuPixel>() as u64 * u64::from(size[0]) * u64::from(size[1]);
                    let buffer = gpu.empty_buffer("pixels of this picture", bytes, wgpu::BufferUsages::STORAGE)?;
                    self.cpu = Some((CpuPicture::new(size), buffer));
                }
                if let Some((picture, buffer)) = &mut self.cpu {
                    picture.add_sample(scene, &options, &|| true);
                    let drawn = picture.sums.iter().zip(&picture.hits);
                    let pixels: Vec<GpuPixel> =
                        drawn.map(|(sum, hit)| GpuPixel::of_sum(*sum, picture.samples, hit)).collect();
                    gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(&pixels));
                }
                Ok(Took { ms: start.elapsed().as_secs_f64() * 1e3, passes: None, first: false })
            }
        }
    }

    /// Reads the mean linear radiance of the picture at hand.
    pub(crate) fn radiance(&self) -> Result<Vec<[f32; 3]>, ViewerError> {
        match (&self.tracer, &self.cpu) {
            (Some(tracer), _) => tracer.read_radiance(),
            (None, Some((picture, _))) => Ok(picture.radiance()),
            (None, None) => Ok(Vec::new()),
        }
    }
}
