//! Runs a list of queries through a shader's text on a GPU, for comparison with the CPU.

use crate::error::ViewerError;
use crate::gpu::arena::Arena;
use crate::gpu::device::Gpu;
use crate::gpu::layout::bind;
use crate::gpu::pieces::ASSETS;
use crate::gpu::results::readback::read_buffer;
use wgpu::BufferUsages;

/// Queries per workgroup. Twin: `@workgroup_size` of the entry points.
const GROUP: u32 = 64;
/// Workgroups per row of a dispatch, below the least limit of 65535.
const ROW: u32 = 32768;

/// Runs entry point `name`_main of `source` over `queries` and returns the answers in their order. The module has
/// `params` at binding 8, the queries at 9, the answers at 10 and the words of the arena.
///
/// # Errors
/// [`ViewerError::Gpu`] for what the driver reports.
pub(crate) fn gpu_queries<Params: bytemuck::Pod, Query: bytemuck::Pod, Answer: bytemuck::Pod>(
    gpu: &Gpu,
    name: &str,
    source: String,
    arena: &Arena,
    params: &Params,
    queries: &[Query],
) -> Result<Vec<Answer>, ViewerError> {
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(name),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(name),
        layout: None,
        module: &module,
        entry_point: Some(&format!("{name}_main")),
        compilation_options: Default::default(),
        cache: None,
    });
    gpu.check()?;
    let params = gpu.buffer("what queries share", bytemuck::bytes_of(params), BufferUsages::UNIFORM)?;
    let listed = gpu.buffer("queries", bytemuck::cast_slice(queries), BufferUsages::STORAGE)?;
    let bytes = (size_of::<Answer>() * queries.len()) as u64;
    let answers = gpu.empty_buffer("answers", bytes, BufferUsages::STORAGE | BufferUsages::COPY_SRC)?;
    let mut resources =
        vec![(8, params.as_entire_binding()), (9, listed.as_entire_binding()), (10, answers.as_entire_binding())];
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
    read_buffer(gpu, &answers, queries.len())
}
