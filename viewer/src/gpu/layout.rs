//! The layouts of bind groups, and bind groups.

use crate::gpu::backend::GpuTracer;
use crate::gpu::device::Gpu;
use crate::gpu::modules::ModuleLayout;
use crate::gpu::pieces::{ASSETS, NODES, PieceLayout, TRIANGLES, VERTICES};

/// Returns the layout entry of a buffer for compute shaders.
pub(crate) fn buffer_entry(binding: u32, ty: wgpu::BufferBindingType) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    }
}

/// A storage buffer that shaders read.
pub(crate) const READ: wgpu::BufferBindingType = wgpu::BufferBindingType::Storage { read_only: true };
/// A storage buffer that shaders read and write.
pub(crate) const WRITE: wgpu::BufferBindingType = wgpu::BufferBindingType::Storage { read_only: false };

/// Returns the layout of bind group 0: frame, materials, lights, pixels, paths and the words of the assets.
pub(crate) fn scene_layout(gpu: &Gpu, assets: PieceLayout) -> wgpu::BindGroupLayout {
    let mut entries = [0, 3].map(|binding| buffer_entry(binding, wgpu::BufferBindingType::Uniform)).to_vec();
    entries.extend([(4, READ), (6, WRITE), (7, WRITE)].map(|(binding, ty)| buffer_entry(binding, ty)));
    entries.extend(assets.bindings(&ASSETS).map(|binding| buffer_entry(binding, READ)));
    gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("scene"), entries: &entries })
}

/// Returns the layout of bind group 1: what rays are traced against.
pub(crate) fn structure_layout(gpu: &Gpu, tracer: GpuTracer, layout: ModuleLayout) -> wgpu::BindGroupLayout {
    let mut entries = vec![buffer_entry(1, READ)];
    entries.extend(layout.vertices.bindings(&VERTICES).map(|binding| buffer_entry(binding, READ)));
    entries.extend(layout.triangles.bindings(&TRIANGLES).map(|binding| buffer_entry(binding, READ)));
    match tracer {
        GpuTracer::RayQuery => entries.push(wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::AccelerationStructure { vertex_return: false },
            count: None,
        }),
        GpuTracer::Bvh => entries.extend(layout.nodes.bindings(&NODES).map(|binding| buffer_entry(binding, READ))),
    }
    gpu.device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("structure"), entries: &entries })
}

/// Creates a bind group of `resources`, each with its binding.
pub(crate) fn bind(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    resources: &[(u32, wgpu::BindingResource)],
) -> wgpu::BindGroup {
    let entries: Vec<_> = resources
        .iter()
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding: *binding, resource: resource.clone() })
        .collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}
