//! Puts the accumulated picture on a window's surface. Twin of the structs: `shaders/blit.wgsl`.

use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use crate::gpu::layout::bind;
use crate::gpu::modules::BLIT;

/// Twin: `Blit` in `blit.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuBlit {
    pub picture: [u32; 2],
    pub window: [u32; 2],
    pub gain: f32,
    pub first_row: u32,
    pub rows: u32,
    pub split: u32,
    pub other_from: u32,
    pub difference_gain: f32,
    pub pad0: [u32; 2],
}

/// The pipeline.
pub(crate) struct Blit {
    pipeline: wgpu::RenderPipeline,
}

impl Blit {
    pub(crate) fn new(gpu: &Gpu, format: wgpu::TextureFormat) -> Result<Blit, ViewerError> {
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("blit"),
            source: wgpu::ShaderSource::Wgsl(BLIT.into()),
        });
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("blit"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("blit_vertex"),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: Default::default(),
            depth_stencil: None,
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("blit_fragment"),
                compilation_options: Default::default(),
                targets: &[Some(format.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        gpu.check()?;
        Ok(Blit { pipeline })
    }

    /// Draws a band of a picture, whose place in it `params` tells, and of the `other` one of a split view over the
    /// pass' viewport.
    pub(crate) fn draw(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::RenderPass,
        pixels: &wgpu::Buffer,
        other: &wgpu::Buffer,
        params: GpuBlit,
    ) -> Result<(), ViewerError> {
        let params = gpu.buffer("blit", bytemuck::bytes_of(&params), wgpu::BufferUsages::UNIFORM)?;
        let layout = self.pipeline.get_bind_group_layout(0);
        let resources =
            [(0, params.as_entire_binding()), (1, pixels.as_entire_binding()), (2, other.as_entire_binding())];
        let group = bind(gpu, &layout, &resources);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.draw(0..3, 0..1);
        Ok(())
    }
}
