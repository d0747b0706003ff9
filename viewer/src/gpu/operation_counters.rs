//! The counters of a tracer that counts its operations ([`crate::operations`]), on the GPU.

use crate::error::ViewerError;
#[cfg(not(target_arch = "wasm32"))]
use crate::gpu::backend::GpuTracer;
use crate::gpu::device::Gpu;
use crate::gpu::layout::{WRITE, bind, buffer_entry};
use crate::gpu::modules::MODULE_PARTS;
#[cfg(not(target_arch = "wasm32"))]
use crate::gpu::modules::{ModuleLayout, part_of_functions, trace_module};
use crate::gpu::results::readback::read_buffer;
use crate::operations::counts::{COUNTERS, KINDS, OperationCounts};
#[cfg(not(target_arch = "wasm32"))]
use crate::operations::instrument::instrument;

/// Bind group 2 of a tracer that counts.
pub(crate) struct OperationCounters {
    buffer: wgpu::Buffer,
    pub layout: wgpu::BindGroupLayout,
    pub group: wgpu::BindGroup,
}

impl OperationCounters {
    /// Makes counters at 0.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] where the driver has no memory for them.
    pub(crate) fn new(gpu: &Gpu) -> Result<OperationCounters, ViewerError> {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let buffer = gpu.empty_buffer("counters of operations", (8 * COUNTERS) as u64, usage)?;
        let entries = [buffer_entry(0, WRITE)];
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("counters of operations"),
            entries: &entries,
        });
        let group = bind(gpu, &layout, &[(0, buffer.as_entire_binding())]);
        Ok(OperationCounters { buffer, layout, group })
    }

    /// Compiles the module of a tracer that counts.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] where the module cannot be rewritten.
    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) fn module(gpu: &Gpu, layout: ModuleLayout) -> Result<wgpu::ShaderModule, ViewerError> {
        let parts = part_of_functions();
        let part_of = |function: &str| parts.get(function).map_or(0, |part| *part as usize);
        let module = instrument(&trace_module(GpuTracer::Bvh, layout), &part_of).map_err(|why| gpu.error(why))?;
        Ok(gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("counting"),
            source: wgpu::ShaderSource::Naga(std::borrow::Cow::Owned(module)),
        }))
    }

    /// Sets the counters to 0.
    pub(crate) fn clear(&self, gpu: &Gpu) {
        gpu.queue.write_buffer(&self.buffer, 0, &[0; 8 * COUNTERS]);
    }

    /// Reads the operations of all passes since the counters were cleared, by part of the module.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] with what the driver reported.
    pub(crate) fn read(&self, gpu: &Gpu) -> Result<[OperationCounts; MODULE_PARTS], ViewerError> {
        let halves: Vec<[u32; 2]> = read_buffer(gpu, &self.buffer, COUNTERS)?;
        let number = |at: usize| u64::from(halves[at][0]) | u64::from(halves[at][1]) << 32;
        let of_part =
            |part: usize| OperationCounts::of_numbers(std::array::from_fn(|kind| number(KINDS * part + kind)));
        Ok(std::array::from_fn(of_part))
    }
}
