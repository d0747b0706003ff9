//! Decodes a list of samples on the GPU, with the same shader text that draws: for comparison with the CPU decoder.

use crate::error::ViewerError;
use crate::gpu::arena::{Arena, ArenaAsset};
use crate::gpu::backend::GpuTracer;
use crate::gpu::device::Gpu;
use crate::gpu::modules::{ModuleLayout, trace_module};
use crate::gpu::queries::shader_queries::gpu_queries;
use btf_runtime::{DecodeOptions, Resident};

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
    pub heights: u32,
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
    let listed: Vec<GpuQuery> = queries
        .iter()
        .map(|query| GpuQuery { wi: query.wi, texel: query.texel, wo: query.wo, layer: query.layer })
        .collect();
    let params = GpuQueryParams {
        count: queries.len() as u32,
        components: options.components,
        lobes: options.lobes,
        interpolation: options.interpolation as u32,
        heights: options.heights as u32,
    };
    let layout = ModuleLayout { assets: arena.pieces.layout, volumes: false, ..ModuleLayout::WHOLE };
    let values: Vec<[f32; 4]> = gpu_queries(gpu, "decode", trace_module(tracer, layout), &arena, &params, &listed)?;
    Ok(values.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect())
}
