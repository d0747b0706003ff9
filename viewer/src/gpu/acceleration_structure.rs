//! What adapters with ray queries find hits in: the driver's own hierarchies over a scene's meshes and instances.

use crate::error::ViewerError;
use crate::geometry::geometry::{Geometry, Vertex};
use crate::gpu::device::Gpu;
use crate::scene::scene::Scene;
use crate::volume::volumes::Volumes;
use wgpu::BufferUsages;

/// Mask of instances that are surfaces. Twin: `RAY_MESHES` in `trace_ray_query.wgsl`.
pub(crate) const MESHES: u8 = 1;
/// Mask of instances that are proxies of volumes. Twin: `RAY_PROXIES`.
pub(crate) const PROXIES: u8 = 2;
/// Mask of instances that are surfaces which volumes stand in for. Twin: `RAY_WITH_VOLUMES`.
pub(crate) const WITH_VOLUMES: u8 = 4;

/// Builds a structure for each mesh and one over the instances, which are numbered as `geometry` has them. Instances
/// that `scene` does not have itself are proxies.
///
/// # Errors
/// [`ViewerError::Gpu`] where the adapter takes fewer triangles or instances.
pub(crate) fn acceleration_structure(
    gpu: &Gpu,
    geometry: &Geometry,
    scene: &Scene,
    vertices: &wgpu::Buffer,
) -> Result<(wgpu::Tlas, Vec<wgpu::Blas>), ViewerError> {
    check_limits(gpu, geometry)?;
    let instances = geometry.instances();
    let indices: Vec<u32> = geometry.triangles().iter().flat_map(|triangle| triangle.vertices).collect();
    let index_buffer = gpu.buffer("indices", bytemuck::cast_slice(&indices), BufferUsages::BLAS_INPUT)?;
    let flags = wgpu::AccelerationStructureFlags::PREFER_FAST_TRACE;
    let update_mode = wgpu::AccelerationStructureUpdateMode::Build;
    let sizes = mesh_sizes(geometry, scene);
    let blas: Vec<wgpu::Blas> = sizes
        .iter()
        .map(|size| {
            gpu.device.create_blas(
                &wgpu::CreateBlasDescriptor { label: Some("mesh"), flags, update_mode },
                wgpu::BlasGeometrySizeDescriptors::Triangles { descriptors: vec![size.clone()] },
            )
        })
        .collect();
    let mut tlas = gpu.device.create_tlas(&wgpu::CreateTlasDescriptor {
        label: Some("scene"),
        max_instances: instances.len() as u32,
        flags,
        update_mode,
    });
    for (number, instance) in instances.iter().enumerate() {
        let rows = instance.world_from_object.concat();
        let mut map = [0.0; 12];
        map.copy_from_slice(&rows);
        let mask = match (number < scene.geometry.instances().len(), instance.leaf_width > 0.0) {
            (true, false) => MESHES,
            (true, true) => WITH_VOLUMES,
            (false, _) => PROXIES,
        };
        tlas[number] = Some(wgpu::TlasInstance::new(&blas[geometry.mesh_of(number)], map, number as u32, mask));
    }
    // Meshes without a triangle are placed nowhere.
    let built: Vec<_> = blas
        .iter()
        .zip(&sizes)
        .zip(geometry.meshes())
        .filter(|(_, mesh)| mesh.triangles > 0)
        .map(|((blas, size), mesh)| wgpu::BlasBuildEntry {
            blas,
            geometry: wgpu::BlasGeometries::TriangleGeometries(vec![wgpu::BlasTriangleGeometry {
                size,
                vertex_buffer: vertices,
                first_vertex: 0,
                vertex_stride: size_of::<Vertex>() as u64,
                index_buffer: Some(&index_buffer),
                first_index: Some(3 * mesh.first_triangle),
                transform_buffer: None,
                transform_buffer_offset: None,
            }]),
        })
        .collect();
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    encoder.build_acceleration_structures(&built, [&tlas]);
    gpu.queue.submit([encoder.finish()]);
    Ok((tlas, blas))
}

/// Checks that the adapter takes as many triangles and instances.
fn check_limits(gpu: &Gpu, geometry: &Geometry) -> Result<(), ViewerError> {
    let limits = gpu.device.limits();
    let (most, largest) = (limits.max_blas_primitive_count, geometry.meshes().iter().map(|mesh| mesh.triangles).max());
    if largest.is_some_and(|triangles| triangles > most) {
        return Err(gpu.error(format!(
            "a mesh has {} triangles and this adapter's ray query takes at most {most}, use --backend bvh",
            largest.unwrap_or(0)
        )));
    }
    let (most, instances) = (limits.max_tlas_instance_count, geometry.instances());
    if instances.len() > most as usize {
        return Err(gpu.error(format!(
            "the scene has {} instances and this adapter's ray query takes at most {most}, use --backend bvh",
            instances.len()
        )));
    }
    Ok(())
}

/// Returns the size of each mesh, and whether the shader decides on the hits of it.
fn mesh_sizes(geometry: &Geometry, scene: &Scene) -> Vec<wgpu::BlasTriangleGeometrySizeDescriptor> {
    // What volumes stand in for is there within a sphere only, and shells between two: the shader decides on each of their hits.
    let mut is_asked = vec![false; geometry.meshes().len()];
    for (number, instance) in scene.geometry.instances().iter().enumerate() {
        is_asked[geometry.mesh_of(number)] |= instance.leaf_width > 0.0;
    }
    let first_proxy = scene.geometry.instances().len();
    for number in first_proxy..geometry.instances().len() {
        let has_levels = |volumes: &Volumes| volumes.is_one_of_several(number - first_proxy);
        is_asked[geometry.mesh_of(number)] = scene.volumes.as_deref().is_some_and(has_levels);
    }
    let opaque = wgpu::AccelerationStructureGeometryFlags::OPAQUE;
    geometry
        .meshes()
        .iter()
        .zip(is_asked)
        .map(|(mesh, is_asked)| wgpu::BlasTriangleGeometrySizeDescriptor {
            vertex_format: wgpu::VertexFormat::Float32x3,
            vertex_count: geometry.vertices().len() as u32,
            index_format: Some(wgpu::IndexFormat::Uint32),
            index_count: Some(3 * mesh.triangles),
            flags: if is_asked { wgpu::AccelerationStructureGeometryFlags::empty() } else { opaque },
        })
        .collect()
}
