//! The GPU tracer: a scene's buffers, a pipeline, one dispatch per sample.

use crate::camera::jitter;
use crate::error::ViewerError;
use crate::gpu::Gpu;
use crate::scene::Scene;
use crate::shaders::{GpuTracer, trace_module};
use btf_runtime::DecodeOptions;
use wgpu::BufferUsages;

/// The asset offset of a plain material. Twin: `NO_ASSET` in `scene.wgsl`.
pub const NO_ASSET: u32 = u32::MAX;
/// Assets begin at multiples of this many words in the arena, so that their sections stay aligned to 256 bytes.
const ARENA_ALIGNMENT_WORDS: usize = 64;
/// Pixels per side of a workgroup. Twin: `@workgroup_size` of `trace_main`.
const GROUP: u32 = 8;

/// Twin: `Frame` in `scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Frame {
    pub eye: [f32; 3],
    pub width: u32,
    pub forward: [f32; 3],
    pub height: u32,
    pub right: [f32; 3],
    pub light_count: u32,
    pub up: [f32; 3],
    pub sample: u32,
    pub background: [f32; 3],
    pub interpolation: u32,
    pub jitter: [f32; 2],
    pub components: u32,
    pub lobes: u32,
    pub parallax: u32,
    pub pad0: u32,
    pub pad1: u32,
    pub pad2: u32,
}

/// Twin: `Material` in `scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuMaterial {
    pub diffuse: [f32; 3],
    pub asset: u32,
    pub uv_scale: [f32; 2],
    pub pad: [u32; 2],
}

/// Twin: `Light` in `scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuLight {
    pub position: [f32; 3],
    pub pad0: u32,
    pub intensity: [f32; 3],
    pub pad1: u32,
}

/// What the last sample of a pixel did. Twin: `PixelHit` in `scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct PixelHit {
    /// Triangle that the primary ray hit, or [`crate::NO_HIT`].
    pub primitive: u32,
    /// Rays traced, shadow rays included.
    pub rays: u32,
    /// Asset decodes.
    pub evaluations: u32,
    /// Zero.
    pub pad: u32,
}

/// A scene on a GPU.
pub struct Tracer {
    tracer: GpuTracer,
    pipeline: wgpu::ComputePipeline,
    frame: wgpu::Buffer,
    fixed: [wgpu::Buffer; 4],
    lights: wgpu::Buffer,
    light_capacity: usize,
    structure: wgpu::BindGroup,
    target: Option<Target>,
    // Kept alive for the bind group.
    _blas: Option<wgpu::Blas>,
}

/// Buffers of one picture size.
struct Target {
    width: u32,
    height: u32,
    accumulation: wgpu::Buffer,
    hits: wgpu::Buffer,
    group: wgpu::BindGroup,
}

impl Tracer {
    /// Uploads `scene`; geometry, materials and assets are then fixed, lights, camera and background are not.
    ///
    /// # Errors
    /// [`ViewerError::NoAdapter`] without ray queries where they are asked for, [`ViewerError::Gpu`] where the scene
    /// is larger than the adapter binds.
    pub fn new(gpu: &Gpu, scene: &Scene, tracer: GpuTracer) -> Result<Tracer, ViewerError> {
        gpu.require(tracer)?;
        let (arena, bases) = arena_of(scene);
        let materials: Vec<GpuMaterial> = scene
            .materials
            .iter()
            .map(|material| GpuMaterial {
                diffuse: material.diffuse,
                asset: material.asset.map_or(NO_ASSET, |asset| bases[asset]),
                uv_scale: material.uv_scale,
                pad: [0; 2],
            })
            .collect();
        let input = if tracer == GpuTracer::RayQuery { BufferUsages::BLAS_INPUT } else { BufferUsages::empty() };
        let geometry = &scene.geometry;
        let fixed = [
            gpu.buffer("vertices", bytemuck::cast_slice(geometry.vertices()), BufferUsages::STORAGE | input)?,
            gpu.buffer("triangles", bytemuck::cast_slice(geometry.triangles()), BufferUsages::STORAGE)?,
            gpu.buffer("materials", bytemuck::cast_slice(&materials), BufferUsages::STORAGE)?,
            gpu.buffer("assets", bytemuck::cast_slice(&arena), BufferUsages::STORAGE)?,
        ];

        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(tracer.name()),
            source: wgpu::ShaderSource::Wgsl(trace_module(tracer).into()),
        });
        let scene_layout = scene_layout(gpu);
        let structure_layout = structure_layout(gpu, tracer);
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("trace"),
            bind_group_layouts: &[Some(&scene_layout), Some(&structure_layout)],
            ..Default::default()
        });
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("trace"),
            layout: Some(&layout),
            module: &module,
            entry_point: Some("trace_main"),
            compilation_options: Default::default(),
            cache: None,
        });

        let (structure, blas) = match tracer {
            GpuTracer::RayQuery => {
                let (tlas, blas) = acceleration_structure(gpu, scene, &fixed[0])?;
                (bind(gpu, &structure_layout, &[(0, tlas.as_binding())]), Some(blas))
            }
            GpuTracer::Bvh => {
                let nodes = bytemuck::cast_slice(geometry.bvh().nodes());
                let nodes = gpu.buffer("nodes", nodes, BufferUsages::STORAGE)?;
                (bind(gpu, &structure_layout, &[(0, nodes.as_entire_binding())]), None)
            }
        };
        let frame = gpu.empty_buffer("frame", size_of::<Frame>() as u64, BufferUsages::UNIFORM)?;
        let light_capacity = scene.lights.len().max(1);
        let lights = light_buffer(gpu, light_capacity)?;
        gpu.check()?;
        Ok(Tracer { tracer, pipeline, frame, fixed, lights, light_capacity, structure, target: None, _blas: blas })
    }

    /// Which tracer this is.
    pub fn tracer(&self) -> GpuTracer {
        self.tracer
    }

    /// Width and height of the picture, `None` before the first sample.
    pub fn size(&self) -> Option<[u32; 2]> {
        self.target.as_ref().map(|target| [target.width, target.height])
    }

    /// Adds sample number `sample` to every pixel (0 starts anew) and submits the work. `timer` is where the GPU
    /// writes when it begins and ends.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] for pictures larger than the adapter binds.
    pub fn sample(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        size: [u32; 2],
        decode: &DecodeOptions,
        sample: u32,
        timer: Option<&GpuTimer>,
    ) -> Result<(), ViewerError> {
        self.prepare(gpu, scene, size)?;
        self.write_frame(gpu, scene, size, decode, sample);
        let groups = size.map(|side| side.div_ceil(GROUP));
        self.dispatch(gpu, groups, timer);
        Ok(())
    }

    /// Runs one workgroup and waits, so that drivers that compile at the first dispatch do so before anything is timed.
    ///
    /// # Errors
    /// As [`Tracer::sample`].
    pub fn warm_up(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        size: [u32; 2],
        decode: &DecodeOptions,
    ) -> Result<(), ViewerError> {
        self.prepare(gpu, scene, size)?;
        self.write_frame(gpu, scene, size, decode, 0);
        self.dispatch(gpu, [1, 1], None);
        gpu.wait()
    }

    fn prepare(&mut self, gpu: &Gpu, scene: &Scene, [width, height]: [u32; 2]) -> Result<(), ViewerError> {
        let grown = scene.lights.len() > self.light_capacity;
        if grown {
            self.light_capacity = scene.lights.len().next_power_of_two();
            self.lights = light_buffer(gpu, self.light_capacity)?;
        }
        let known = self.target.as_ref().is_some_and(|target| [target.width, target.height] == [width, height]);
        if known && !grown {
            return Ok(());
        }
        let pixels = u64::from(width) * u64::from(height);
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let accumulation = gpu.empty_buffer("pixels of this picture", 16 * pixels, usage)?;
        let hits = gpu.empty_buffer("pixels of this picture", size_of::<PixelHit>() as u64 * pixels, usage)?;
        let group = bind(
            gpu,
            &scene_layout(gpu),
            &[
                (0, self.frame.as_entire_binding()),
                (1, self.fixed[0].as_entire_binding()),
                (2, self.fixed[1].as_entire_binding()),
                (3, self.fixed[2].as_entire_binding()),
                (4, self.lights.as_entire_binding()),
                (5, self.fixed[3].as_entire_binding()),
                (6, accumulation.as_entire_binding()),
                (7, hits.as_entire_binding()),
            ],
        );
        self.target = Some(Target { width, height, accumulation, hits, group });
        Ok(())
    }

    fn write_frame(&self, gpu: &Gpu, scene: &Scene, [width, height]: [u32; 2], decode: &DecodeOptions, sample: u32) {
        let camera = scene.camera.frame(width, height);
        let frame = Frame {
            eye: camera.eye.to_array(),
            width,
            forward: camera.forward.to_array(),
            height,
            right: camera.right.to_array(),
            light_count: scene.lights.len() as u32,
            up: camera.up.to_array(),
            sample,
            background: scene.background,
            interpolation: decode.interpolation as u32,
            jitter: jitter(sample),
            components: decode.components,
            lobes: decode.lobes,
            parallax: decode.parallax.into(),
            pad0: 0,
            pad1: 0,
            pad2: 0,
        };
        gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
        let lights: Vec<GpuLight> = scene
            .lights
            .iter()
            .map(|light| GpuLight { position: light.position.to_array(), pad0: 0, intensity: light.intensity, pad1: 0 })
            .collect();
        gpu.queue.write_buffer(&self.lights, 0, bytemuck::cast_slice(&lights));
    }

    fn dispatch(&self, gpu: &Gpu, groups: [u32; 2], timer: Option<&GpuTimer>) {
        let Some(target) = &self.target else { return };
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("trace"),
                timestamp_writes: timer.map(GpuTimer::writes),
            });
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &target.group, &[]);
            pass.set_bind_group(1, &self.structure, &[]);
            pass.dispatch_workgroups(groups[0], groups[1], 1);
        }
        if let Some(timer) = timer {
            timer.resolve(&mut encoder);
        }
        gpu.queue.submit([encoder.finish()]);
    }

    /// The buffer with the sum of all samples, RGB and their count, row-major; `None` before the first sample.
    pub(crate) fn accumulation(&self) -> Option<&wgpu::Buffer> {
        self.target.as_ref().map(|target| &target.accumulation)
    }

    /// Mean linear radiance per pixel, row-major from the top left; empty before the first sample.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] with what the driver reported.
    pub fn read_radiance(&self, gpu: &Gpu) -> Result<Vec<[f32; 3]>, ViewerError> {
        let Some(target) = &self.target else { return Ok(Vec::new()) };
        let sums: Vec<[f32; 4]> = gpu.read(&target.accumulation, (target.width * target.height) as usize)?;
        Ok(sums.iter().map(|[r, g, b, count]| [r / count, g / count, b / count]).collect())
    }

    /// What the last sample of every pixel did; empty before the first sample.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] with what the driver reported.
    pub fn read_hits(&self, gpu: &Gpu) -> Result<Vec<PixelHit>, ViewerError> {
        let Some(target) = &self.target else { return Ok(Vec::new()) };
        gpu.read(&target.hits, (target.width * target.height) as usize)
    }
}

/// All assets of a scene one after the other, and the first word of each.
fn arena_of(scene: &Scene) -> (Vec<u32>, Vec<u32>) {
    let mut words = Vec::new();
    let mut bases = Vec::new();
    for asset in &scene.assets {
        words.resize(words.len().next_multiple_of(ARENA_ALIGNMENT_WORDS), 0);
        bases.push(words.len() as u32);
        words.extend_from_slice(asset.resident.words());
    }
    (words, bases)
}

fn light_buffer(gpu: &Gpu, count: usize) -> Result<wgpu::Buffer, ViewerError> {
    gpu.empty_buffer("lights", (count * size_of::<GpuLight>()) as u64, BufferUsages::STORAGE)
}

fn acceleration_structure(
    gpu: &Gpu,
    scene: &Scene,
    vertices: &wgpu::Buffer,
) -> Result<(wgpu::Tlas, wgpu::Blas), ViewerError> {
    let geometry = &scene.geometry;
    let most = gpu.device.limits().max_blas_primitive_count as usize;
    if geometry.triangles().len() > most {
        return Err(gpu.error(format!(
            "the scene has {} triangles and this adapter's ray query takes at most {most}, use --backend bvh",
            geometry.triangles().len()
        )));
    }
    let indices: Vec<u32> = geometry.triangles().iter().flat_map(|triangle| triangle.vertices).collect();
    let index_buffer = gpu.buffer("indices", bytemuck::cast_slice(&indices), BufferUsages::BLAS_INPUT)?;
    let size = wgpu::BlasTriangleGeometrySizeDescriptor {
        vertex_format: wgpu::VertexFormat::Float32x3,
        vertex_count: geometry.vertices().len() as u32,
        index_format: Some(wgpu::IndexFormat::Uint32),
        index_count: Some(indices.len() as u32),
        flags: wgpu::AccelerationStructureGeometryFlags::OPAQUE,
    };
    let flags = wgpu::AccelerationStructureFlags::PREFER_FAST_TRACE;
    let update_mode = wgpu::AccelerationStructureUpdateMode::Build;
    let blas = gpu.device.create_blas(
        &wgpu::CreateBlasDescriptor { label: Some("scene"), flags, update_mode },
        wgpu::BlasGeometrySizeDescriptors::Triangles { descriptors: vec![size.clone()] },
    );
    let mut tlas = gpu.device.create_tlas(&wgpu::CreateTlasDescriptor {
        label: Some("scene"),
        max_instances: 1,
        flags,
        update_mode,
    });
    const IDENTITY: [f32; 12] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    tlas[0] = Some(wgpu::TlasInstance::new(&blas, IDENTITY, 0, 0xff));
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    encoder.build_acceleration_structures(
        [&wgpu::BlasBuildEntry {
            blas: &blas,
            geometry: wgpu::BlasGeometries::TriangleGeometries(vec![wgpu::BlasTriangleGeometry {
                size: &size,
                vertex_buffer: vertices,
                first_vertex: 0,
                vertex_stride: size_of::<crate::geometry::Vertex>() as u64,
                index_buffer: Some(&index_buffer),
                first_index: Some(0),
                transform_buffer: None,
                transform_buffer_offset: None,
            }]),
        }],
        [&tlas],
    );
    gpu.queue.submit([encoder.finish()]);
    Ok((tlas, blas))
}

fn scene_layout(gpu: &Gpu) -> wgpu::BindGroupLayout {
    let entries: Vec<_> = (0..8)
        .map(|binding| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: match binding {
                    0 => wgpu::BufferBindingType::Uniform,
                    6 | 7 => wgpu::BufferBindingType::Storage { read_only: false },
                    _ => wgpu::BufferBindingType::Storage { read_only: true },
                },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        })
        .collect();
    gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("scene"), entries: &entries })
}

fn structure_layout(gpu: &Gpu, tracer: GpuTracer) -> wgpu::BindGroupLayout {
    let ty = match tracer {
        GpuTracer::RayQuery => wgpu::BindingType::AccelerationStructure { vertex_return: false },
        GpuTracer::Bvh => wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only: true },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
    };
    let entry = wgpu::BindGroupLayoutEntry { binding: 0, visibility: wgpu::ShaderStages::COMPUTE, ty, count: None };
    gpu.device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("structure"), entries: &[entry] })
}

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

/// Measures a compute pass by GPU timestamps.
pub struct GpuTimer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    period_ns: f32,
}

impl GpuTimer {
    /// `None` where the device has no timestamps.
    pub fn new(gpu: &Gpu) -> Option<GpuTimer> {
        if !gpu.has_timestamps() {
            return None;
        }
        let queries = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("timer"),
            ty: wgpu::QueryType::Timestamp,
            count: 2,
        });
        let usage = BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC;
        let resolved = gpu.empty_buffer("timestamps", 16, usage).ok()?;
        Some(GpuTimer { queries, resolved, period_ns: gpu.queue.get_timestamp_period() })
    }

    fn writes(&self) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        }
    }

    fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.resolve_query_set(&self.queries, 0..2, &self.resolved, 0);
    }

    /// Waits for the last pass and returns how long it took.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] with what the driver reported.
    pub fn read_ms(&self, gpu: &Gpu) -> Result<f64, ViewerError> {
        let ticks: Vec<u64> = gpu.read(&self.resolved, 2)?;
        Ok(ticks[1].saturating_sub(ticks[0]) as f64 * f64::from(self.period_ns) * 1e-6)
    }
}
