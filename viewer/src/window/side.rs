//! A picture in the making in the window: on the GPU by a tracer, or on the CPU. A split view has two.

use super::editing::physiology::LeafChange;
use super::renderer::Renderer;
use crate::cpu::cpu::CpuPicture;
use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use crate::gpu::timer::{GpuTimer, PassTimes};
use crate::gpu::tracer::{GpuPixel, Tracer};
use crate::options::ShadeOptions;
use crate::scene::scene::Scene;
use std::time::Instant;

/// The picture of one renderer.
#[derive(Default)]
pub(crate) struct Side {
    tracer: Option<Tracer>,
    cpu: Option<(CpuPicture, wgpu::Buffer)>,
}

/// A sample that a picture is asked for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    pub renderer: Renderer,
    /// Width and height of the picture, pixels.
    pub size: [u32; 2],
    pub shade: ShadeOptions,
    /// Number of the sample, from 0.
    pub number: u32,
}

/// What a sample took.
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

    /// Takes over an asset's edits.
    pub(crate) fn update_edits(&mut self, gpu: &Gpu, scene: &Scene, asset: usize) {
        // Where the edits have outgrown their place the scene is uploaded anew.
        if self.tracer.as_ref().is_some_and(|tracer| !tracer.update_edits(gpu, scene, asset)) {
            self.tracer = None;
        }
    }

    /// Takes over a leaf that changed.
    pub(crate) fn update_leaf(&self, gpu: &Gpu, scene: &Scene, change: &LeafChange) {
        let Some(tracer) = &self.tracer else { return };
        tracer.update_leaf(gpu, scene, change.leaf, change.words.clone());
        if change.plants {
            tracer.update_instances(gpu, scene);
        }
    }

    /// Takes over the light that surrounds the scene.
    pub(crate) fn update_environment(&mut self, gpu: &Gpu, scene: &Scene) {
        if self.tracer.as_ref().is_some_and(|tracer| !tracer.update_environment(gpu, scene)) {
            self.tracer = None;
        }
    }

    /// Takes over where the wind has moved skins.
    pub(crate) fn update_skins(&mut self, gpu: &Gpu, scene: &Scene) {
        // What cannot be taken over is uploaded anew, which tells why.
        if self.tracer.as_mut().is_some_and(|tracer| tracer.update_skins(gpu, scene).is_err()) {
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
        scene: &Scene,
        sample: &Sample,
        timer: Option<&mut GpuTimer>,
    ) -> Result<Took, ViewerError> {
        let Sample { renderer, size, shade, number: sample } = *sample;
        match renderer {
            Renderer::Gpu(kind) => {
                self.cpu = None;
                let first = self.tracer.is_none();
                let tracer = match &mut self.tracer {
                    Some(tracer) => tracer,
                    none => none.insert(Tracer::new(gpu, scene, kind)?),
                };
                let (ms, passes) = tracer.timed_sample(gpu, scene, size, &shade, sample, timer)?;
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
                    picture.add_sample(scene, &shade, &|| true);
                    gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(&picture.gpu_pixels()));
                }
                Ok(Took { ms: start.elapsed().as_secs_f64() * 1e3, passes: None, first: false })
            }
        }
    }

    /// Reads the mean linear radiance of the picture at hand.
    pub(crate) fn radiance(&self, gpu: &Gpu) -> Result<Vec<[f32; 3]>, ViewerError> {
        match (&self.tracer, &self.cpu) {
            (Some(tracer), _) => tracer.read_radiance(gpu),
            (None, Some((picture, _))) => Ok(picture.radiance()),
            (None, None) => Ok(Vec::new()),
        }
    }
}
