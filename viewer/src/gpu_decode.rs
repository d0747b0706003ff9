//! Decodes a list of samples on the GPU, with the same shader text that draws: for comparison with the CPU decoder.

use crate::arena::{Arena, ArenaAsset};
use crate::error::ViewerError;
use crate::gpu::Gpu;
use crate::pieces::ASSETS;
use crate::shaders::{GpuTracer, ModuleLayout, trace_module};
use crate::trace::bind;
use btf_runtime::{DecodeOptions, Resident};
use wgpu::BufferUsages;

/// Queries per workgroup. Twin: `@workgroup_size` of `decode_main`.
const GROUP: u32 = 64;
/// Workgroups per row of a dispatch, below the least limit of 65535.
const ROW: u32 = 32768;

/// One sample to decode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DecodeQuery {
    /// Layer number, below the asset's number of layers.
    pub layer: u32,
    /// Texel number, below the asset's number of texels.
    pub texel: u32,
    /// Unit direction to the light, texel frame.
    pub wi: [f32; 3],
    /// Unit direction to the eye, texel frame.
    pub wo: [f32; 3],
}

/// Twin: `Query` in `decode_queries.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuQuery {
    pub wi: [f32; 3],
    pub texel: u32,
    pub wo: [f32; 3],
    pub layer: u32,
}

/// Twin: `QueryParams` in `decode_queries.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuQueryParams {
    pub count: u32,
    pub components: u32,
    pub lobes: u32,
    pub interpolation: u32,
    pub parallax: u32,
}

/// Decodes `queries` inside the module of `tracer`; result as [`btf_runtime::decode`] has it, in the same order.
///
/// # Errors
/// [`ViewerError::NoAdapter`] without ray queries where they are asked for, [`ViewerError::Gpu`] otherwise.
pub fn gpu_decode(
    gpu: &Gpu,
    tracer: GpuTracer,
    resident: &Resident,
    options: &DecodeOptions,
    queries: &[DecodeQuery],
) -> Result<Vec<[f32; 3]>, ViewerError> {
    gpu.require(tracer)?;
    let arena = Arena::new(gpu, &[ArenaAsset::whole(resident.words())], |_| 0)?;
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("decode"),
        source: wgpu::ShaderSource::Wgsl(
            trace_module(tracer, ModuleLayout { assets: arena.pieces.layout, volumes: false, ..ModuleLayout::WHOLE })
                .into(),
        ),
    });
    let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("decode"),
        layout: None,
        module: &module,
        entry_point: Some("decode_main"),
        compilation_options: Default::default(),
        cache: None,
    });
    gpu.check()?;
    let listed: Vec<GpuQuery> = queries
        .iter()
        .map(|query| GpuQuery { wi: query.wi, texel: query.texel, wo: query.wo, layer: query.layer })
        .collect();
    let params = GpuQueryParams {
        count: queries.len() as u32,
        components: options.components,
        lobes: options.lobes,
        interpolation: options.interpolation as u32,
        parallax: options.parallax.into(),
    };
    let params = gpu.buffer("decode options", bytemuck::bytes_of(&params), BufferUsages::UNIFORM)?;
    let listed = gpu.buffer("samples", bytemuck::cast_slice(&listed), BufferUsages::STORAGE)?;
    let decoded =
        gpu.empty_buffer("decoded samples", 16 * queries.len() as u64, BufferUsages::STORAGE | BufferUsages::COPY_SRC)?;
    let mut resources =
        vec![(8, params.as_entire_binding()), (9, listed.as_entire_binding()), (10, decoded.as_entire_binding())];
    resources.extend(arena.pieces.entries(&ASSETS));
    let group = bind(gpu, &pipeline.get_bind_group_layout(0), &resources);
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        let groups = (queries.len() as u32).div_ceil(GROUP);
        pass.dispatch_workgroups(groups.min(ROW), groups.div_ceil(ROW), 1);
    }
    gpu.queue.submit([encoder.finish()]);
    let values: Vec<[f32; 4]> = gpu.read(&decoded, queries.len())?;
    Ok(values.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect())
}
