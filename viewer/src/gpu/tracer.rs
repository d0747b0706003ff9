//! The GPU tracer: a scene's buffers, and the passes of a sample over the bands of a picture.

use crate::error::ViewerError;
use crate::geometry::bvh_node::BvhNode;
use crate::geometry::geometry::Geometry;
use crate::gpu::acceleration_structure::acceleration_structure;
use crate::gpu::arena::{Arena, ArenaAsset, room_for_edits};
use crate::gpu::backend::GpuTracer;
use crate::gpu::device::Gpu;
use crate::gpu::expand::LayerBases;
use crate::gpu::layout::{bind, scene_layout, structure_layout};
use crate::gpu::modules::{ModuleLayout, trace_module};
use crate::gpu::pieces::{ASSETS, NODES, PieceLayout, Pieces, TRIANGLES, VERTICES};
use crate::gpu::timer::{GpuTimer, Pass, PassTimes};
use crate::options::{DecoderForm, RenderMode, ShadeOptions};
use crate::picture::PixelHit;
use crate::scene::asset::SceneAsset;
use crate::scene::camera::jitter;
use crate::scene::material::{Body, Material};
use crate::scene::scene::Scene;
use std::time::Instant;
use wgpu::BufferUsages;

/// The asset offset of a plain material. Twin: `NO_ASSET` in `scene.wgsl`.
pub const NO_ASSET: u32 = u32::MAX;
/// Pixels per side of a workgroup. Twin: `@workgroup_size` in `passes.wgsl`.
const GROUP: u32 = 8;
/// Materials of a scene at most: as many as a uniform binding holds. Twin: `MAX_MATERIALS` in `scene.wgsl`.
pub(crate) const MAX_MATERIALS: usize = 1024;
/// Pixels of a band at most: its paths then take 270 MB.
const MAX_BAND_PIXELS: u64 = 1 << 22;

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
    pub ambient: [f32; 3],
    pub occlusion_distance: f32,
    pub jitter: [f32; 2],
    pub components: u32,
    pub lobes: u32,
    pub parallax: u32,
    pub first_row: u32,
    pub rows: u32,
    pub mode: u32,
    pub light_samples: u32,
    pub environment_at: u32,
    pub environment: [u32; 2],
    pub pixel_width: f32,
    pub levels: u32,
    pub root: u32,
    pub sky: u32,
    pub sun_direction: [f32; 3],
    pub sun_part: f32,
    pub sun_irradiance: [f32; 3],
    pub volume_root: u32,
    pub volumes_at: u32,
    pub proxies_at: u32,
    pub first_proxy: u32,
    pub volume_reach: f32,
    pub volume_slice: f32,
    pub widest_leaf: f32,
    pub pad0: u32,
    pub pad1: u32,
}

/// Twin: `Material` in `scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuMaterial {
    pub diffuse: [f32; 3],
    pub asset: u32,
    pub transmitted: [f32; 3],
    pub leaf: u32,
    pub mirror: [f32; 3],
    pub displacement: f32,
    pub uv_scale: [f32; 2],
    pub pad0: u32,
    pub pad1: u32,
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

/// Twin: `Path` in `scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuPath {
    pub origin: [f32; 3],
    pub primitive: u32,
    pub direction: [f32; 3],
    pub u: f32,
    pub throughput: [f32; 3],
    pub v: f32,
    pub instance: u32,
    pub density: f32,
    pub travelled: f32,
    pub sunk: f32,
}

/// Twin: `Pixel` in `scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuPixel {
    pub sum: [f32; 4],
    pub seen: u32,
    pub rays: u32,
    pub evaluations: u32,
    pub depth: u32,
}

impl GpuPixel {
    /// Returns a pixel that the CPU drew, from the sum of its samples.
    pub(crate) fn of_sum([r, g, b]: [f32; 3], samples: u32, hit: &PixelHit) -> GpuPixel {
        GpuPixel {
            sum: [r, g, b, samples as f32],
            seen: hit.primitive,
            rays: hit.rays,
            evaluations: hit.evaluations,
            depth: 0,
        }
    }
}

/// A scene on a GPU.
pub struct Tracer {
    tracer: GpuTracer,
    module: wgpu::ShaderModule,
    pipeline_layout: wgpu::PipelineLayout,
    decoder: DecoderForm,
    /// By number of the pass, made when first asked for: drivers take their time to compile.
    pipelines: [Option<wgpu::ComputePipeline>; 5],
    frame: wgpu::Buffer,
    materials: wgpu::Buffer,
    instances: wgpu::Buffer,
    arena: Arena,
    lights: wgpu::Buffer,
    light_capacity: usize,
    structure: Structure,
    /// Node where the hierarchy over the volumes' proxies begins.
    volume_root: u32,
    /// [`Geometry::widest_leaf`](crate::Geometry::widest_leaf).
    widest_leaf: f32,
    target: Option<Target>,
}

/// What rays are traced against.
struct Structure {
    vertices: Pieces,
    triangles: Pieces,
    /// Of [`GpuTracer::Bvh`].
    nodes: Option<Pieces>,
    layout: wgpu::BindGroupLayout,
    group: wgpu::BindGroup,
    // Kept alive for the bind group.
    _blas: Vec<wgpu::Blas>,
}

impl Structure {
    /// The bind group of the arrays, and with ray queries the acceleration structure over them. `geometry` has the volumes'
    /// proxies behind what the scene has.
    fn bind(
        gpu: &Gpu,
        scene: &Scene,
        geometry: &Geometry,
        instances: &wgpu::Buffer,
        [vertices, triangles]: [&Pieces; 2],
        nodes: Option<&Pieces>,
        layout: &wgpu::BindGroupLayout,
    ) -> Result<(wgpu::BindGroup, Vec<wgpu::Blas>), ViewerError> {
        let mut resources = vec![(1, instances.as_entire_binding())];
        resources.extend(vertices.entries(&VERTICES));
        resources.extend(triangles.entries(&TRIANGLES));
        if let Some(nodes) = nodes {
            resources.extend(nodes.entries(&NODES));
            return Ok((bind(gpu, layout, &resources), Vec::new()));
        }
        // The structure is built from one buffer; where the shaders' lie in pieces it gets its own.
        let own = match vertices.buffers.as_slice() {
            [_] => None,
            _ => Some(gpu.buffer("vertices", bytemuck::cast_slice(geometry.vertices()), BufferUsages::BLAS_INPUT)?),
        };
        let (tlas, blas) = acceleration_structure(gpu, geometry, scene, own.as_ref().unwrap_or(&vertices.buffers[0]))?;
        resources.push((0, tlas.as_binding()));
        Ok((bind(gpu, layout, &resources), blas))
    }
}

/// Buffers of one picture size.
struct Target {
    width: u32,
    height: u32,
    bands: Vec<Band>,
}

/// Rows of a picture that are drawn together: as many as one buffer binding holds.
pub(crate) struct Band {
    pub first_row: u32,
    pub rows: u32,
    /// [`GpuPixel`]s, row-major.
    pub pixels: wgpu::Buffer,
    group: wgpu::BindGroup,
}

/// The passes of a sample, in order.
fn passes_of(scene: &Scene, options: &ShadeOptions) -> Vec<Pass> {
    let mirrors = scene.materials.iter().any(|material| material.mirror.iter().any(|x| *x > 0.0));
    let next = match options.mode {
        RenderMode::Path => Some(Pass::Scatter),
        RenderMode::Direct => mirrors.then_some(Pass::Mirror),
    };
    let then: &[Pass] = if scene.volumes.is_some() { &[Pass::Volume, Pass::Light] } else { &[Pass::Light] };
    let mut passes = vec![Pass::Camera];
    passes.extend(then);
    if let Some(next) = next {
        for _ in 1..options.depth {
            passes.push(next);
            passes.extend(then);
        }
    }
    passes
}

impl Tracer {
    /// Uploads `scene`; geometry, volumes but for where their skins are, the number of materials and assets are then fixed, the materials themselves, lights,
    /// camera, ambient light and background are not.
    ///
    /// # Errors
    /// [`ViewerError::NoAdapter`] without ray queries where they are asked for, [`ViewerError::Gpu`] where the scene
    /// is larger than the adapter binds.
    pub fn new(gpu: &Gpu, scene: &Scene, tracer: GpuTracer) -> Result<Tracer, ViewerError> {
        Tracer::with_decoder(gpu, scene, tracer, DecoderForm::default())
    }

    /// The same with a chosen form of the decoder.
    ///
    /// # Errors
    /// As [`Tracer::new`].
    pub fn with_decoder(
        gpu: &Gpu,
        scene: &Scene,
        tracer: GpuTracer,
        decoder: DecoderForm,
    ) -> Result<Tracer, ViewerError> {
        gpu.require(tracer)?;
        let bases: Vec<Option<Vec<LayerBases>>> =
            scene.assets.iter().map(|asset| bases_to_expand(gpu, asset)).collect();
        let mut assets: Vec<ArenaAsset> = scene
            .assets
            .iter()
            .zip(&bases)
            .map(|(asset, bases)| match bases {
                Some(bases) => ArenaAsset { words: asset.head().words(), bases },
                None => ArenaAsset::whole(asset.resident().words()),
            })
            .collect();
        assets.extend(scene.leaves.iter().map(|leaf| ArenaAsset::whole(leaf.leaf.words())));
        let of_volumes = scene.volumes.as_ref().map(|volumes| volumes.arrays()).transpose();
        let of_volumes = of_volumes.map_err(|reason| gpu.error(reason))?;
        assets.extend(of_volumes.iter().flatten().map(|words| ArenaAsset::whole(words)));
        let environment = scene.environment.iter().map(|environment| bytemuck::cast_slice(environment.table()));
        assets.extend(environment.map(ArenaAsset::whole));
        let arena = Arena::new(gpu, &assets, room_for_edits)?;
        if let Some(volumes) = &scene.volumes {
            let table = volumes.table(&arena.bases[volume_place(scene)..]);
            arena.write(gpu, volume_table_place(scene), &table, 0..table.len());
        }
        let input = if tracer == GpuTracer::RayQuery { BufferUsages::BLAS_INPUT } else { BufferUsages::empty() };
        let with_proxies = scene.volumes.as_ref().map(|volumes| scene.geometry.followed_by(volumes.proxies()));
        let (geometry, volume_root) =
            with_proxies.as_ref().map_or((&*scene.geometry, 0), |(geometry, root)| (geometry, *root));
        let vertices = Pieces::new(gpu, "vertices", geometry.vertices(), input)?;
        let triangles = Pieces::new(gpu, "triangles", geometry.triangles(), BufferUsages::empty())?;
        let nodes = match tracer {
            GpuTracer::Bvh => Some(Pieces::new(gpu, "nodes", geometry.nodes(), BufferUsages::empty())?),
            GpuTracer::RayQuery => None,
        };
        let layout = ModuleLayout {
            assets: arena.pieces.layout,
            vertices: vertices.layout,
            triangles: triangles.layout,
            nodes: nodes.as_ref().map_or(PieceLayout::WHOLE, |nodes| nodes.layout),
            volumes: scene.volumes.is_some(),
        };
        let bound = [layout.assets, layout.vertices, layout.triangles, layout.nodes].map(|layout| layout.pieces);
        if bound.iter().sum::<u32>() > gpu.most_pieces() {
            return Err(gpu.error(format!(
                "assets and mesh take {} pieces of what this adapter binds at once, and it binds {}; simplify the mesh, or \
                 fit smaller assets (btf-fit fit --bytes)",
                bound.iter().sum::<u32>(),
                gpu.most_pieces()
            )));
        }
        if scene.materials.len() > MAX_MATERIALS {
            return Err(gpu.error(format!(
                "the scene has {} materials and a shader takes {MAX_MATERIALS}; render with --backend cpu, or join materials",
                scene.materials.len()
            )));
        }
        let bytes = (size_of::<GpuMaterial>() * MAX_MATERIALS) as u64;
        let materials = gpu.empty_buffer("materials", bytes, BufferUsages::UNIFORM)?;
        let instances = gpu.buffer("instances", bytemuck::cast_slice(geometry.instances()), BufferUsages::STORAGE)?;

        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(tracer.name()),
            source: wgpu::ShaderSource::Wgsl(trace_module(tracer, layout).into()),
        });
        let scene_layout = scene_layout(gpu, arena.pieces.layout);
        let structure_layout = structure_layout(gpu, tracer, layout);
        let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("trace"),
            bind_group_layouts: &[Some(&scene_layout), Some(&structure_layout)],
            ..Default::default()
        });
        let (group, _blas) = Structure::bind(
            gpu,
            scene,
            geometry,
            &instances,
            [&vertices, &triangles],
            nodes.as_ref(),
            &structure_layout,
        )?;
        let structure = Structure { vertices, triangles, nodes, layout: structure_layout, group, _blas };
        let frame = gpu.empty_buffer("frame", size_of::<Frame>() as u64, BufferUsages::UNIFORM)?;
        let light_capacity = scene.lights.len().max(1);
        let lights = light_buffer(gpu, light_capacity)?;
        gpu.check()?;
        Ok(Tracer {
            tracer,
            module,
            pipeline_layout,
            decoder,
            pipelines: [const { None }; 5],
            frame,
            materials,
            instances,
            arena,
            lights,
            light_capacity,
            structure,
            volume_root,
            widest_leaf: scene.geometry.widest_leaf(),
            target: None,
        })
    }

    /// Takes over the edits of an asset of the scene; `false` if they need more room than there is, and the scene must be
    /// uploaded anew.
    pub fn update_edits(&self, gpu: &Gpu, scene: &Scene, asset: usize) -> bool {
        let head = scene.assets[asset].head();
        head.edited_ranges().into_iter().all(|range| self.arena.write(gpu, asset, head.words(), range))
    }

    /// Takes over the words of a leaf that a change of its state touched.
    pub fn update_leaf(&self, gpu: &Gpu, scene: &Scene, leaf: usize, range: std::ops::Range<usize>) {
        self.arena.write(gpu, leaf_place(scene, leaf), scene.leaves[leaf].leaf.words(), range);
    }

    /// Takes over the light that surrounds the scene; `false` if it needs more room than there is, and the scene must be
    /// uploaded anew.
    pub fn update_environment(&self, gpu: &Gpu, scene: &Scene) -> bool {
        let at = environment_place(scene);
        let Some(environment) = &scene.environment else { return true };
        let words = bytemuck::cast_slice(environment.table());
        at < self.arena.bases.len() && self.arena.write(gpu, at, words, 0..words.len())
    }

    /// Takes over where the scene's skins have moved and what they stand in for, see [`Scene::blow`]. Cost: their words, proxies and
    /// the instances are uploaded again, and with ray queries the whole acceleration structure is built anew.
    ///
    /// # Errors
    /// As [`Tracer::new`].
    pub fn update_skins(&mut self, gpu: &Gpu, scene: &Scene) -> Result<(), ViewerError> {
        let Some(volumes) = &scene.volumes else { return Ok(()) };
        for (number, skin) in volumes.skins().iter().enumerate() {
            let moving = skin.shell.moving_words();
            let mut words = vec![0; moving.end];
            skin.shell.write_moving(&mut words);
            self.arena.write(gpu, volume_place(scene) + volumes.shell_array(number), &words, moving);
        }
        self.update_instances(gpu, scene);
        let structure = &mut self.structure;
        structure.vertices.write(gpu, scene.geometry.vertices().len(), volumes.proxies().vertices());
        if let Some(nodes) = &structure.nodes {
            let root = scene.geometry.root() as usize;
            let over_instances = scene.geometry.nodes()[root..].iter().copied();
            let moved: Vec<BvhNode> = over_instances.chain(scene.geometry.nodes_behind(volumes.proxies())).collect();
            nodes.write(gpu, root, &moved);
            return Ok(());
        }
        let (geometry, _) = scene.geometry.followed_by(volumes.proxies());
        let Structure { vertices, triangles, layout, .. } = &*structure;
        let (group, blas) =
            Structure::bind(gpu, scene, &geometry, &self.instances, [vertices, triangles], None, layout)?;
        (structure.group, structure._blas) = (group, blas);
        Ok(())
    }

    /// Takes over the factors of the scene's instances and where they stand.
    pub fn update_instances(&self, gpu: &Gpu, scene: &Scene) {
        gpu.queue.write_buffer(&self.instances, 0, bytemuck::cast_slice(scene.geometry.instances()));
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
    /// writes when each pass begins and ends.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] where the driver has no memory for a picture of this size.
    pub fn sample(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        size: [u32; 2],
        options: &ShadeOptions,
        sample: u32,
        mut timer: Option<&mut GpuTimer>,
    ) -> Result<(), ViewerError> {
        let passes = passes_of(scene, options);
        self.prepare(gpu, scene, size, &passes)?;
        let Some(target) = &self.target else { return Ok(()) };
        if let Some(timer) = &mut timer {
            timer.begin(gpu, target.bands.len() * passes.len())?;
        }
        self.write_lights(gpu, scene);
        self.write_materials(gpu, scene);
        for band in &target.bands {
            self.write_frame(gpu, scene, size, band, options, sample);
            let groups = [size[0].div_ceil(GROUP), band.rows.div_ceil(GROUP)];
            self.dispatch(gpu, band, &passes, groups, timer.as_deref_mut());
        }
        if let Some(timer) = timer {
            timer.resolve(gpu);
        }
        Ok(())
    }

    /// [`Tracer::sample`], waited for: how long it took, milliseconds, and by kind of pass. With a `timer` that is the GPU's
    /// time for the passes, else the time until they were finished.
    ///
    /// # Errors
    /// As [`Tracer::sample`], and what the driver reported.
    pub fn timed_sample(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        size: [u32; 2],
        options: &ShadeOptions,
        sample: u32,
        mut timer: Option<&mut GpuTimer>,
    ) -> Result<(f64, Option<PassTimes>), ViewerError> {
        let start = Instant::now();
        self.sample(gpu, scene, size, options, sample, timer.as_deref_mut())?;
        gpu.wait()?;
        let wall_ms = start.elapsed().as_secs_f64() * 1e3;
        let passes = timer.map(|timer| timer.read(gpu)).transpose()?;
        Ok((passes.map_or(wall_ms, |passes| passes.sum_ms()), passes))
    }

    /// Runs one workgroup of every pass and waits, so that drivers that compile at the first dispatch do so before
    /// anything is timed.
    ///
    /// # Errors
    /// As [`Tracer::sample`].
    pub fn warm_up(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        size: [u32; 2],
        options: &ShadeOptions,
    ) -> Result<(), ViewerError> {
        let passes = passes_of(scene, options);
        self.prepare(gpu, scene, size, &passes)?;
        self.write_lights(gpu, scene);
        self.write_materials(gpu, scene);
        if let Some(band) = self.target.as_ref().and_then(|target| target.bands.first()) {
            self.write_frame(gpu, scene, size, band, options, 0);
            self.dispatch(gpu, band, &passes, [1, 1], None);
        }
        gpu.wait()
    }

    fn prepare(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        [width, height]: [u32; 2],
        passes: &[Pass],
    ) -> Result<(), ViewerError> {
        for pass in passes {
            let made = &mut self.pipelines[*pass as usize];
            if made.is_none() {
                *made = Some(
                    gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                        label: Some(pass.entry_point()),
                        layout: Some(&self.pipeline_layout),
                        module: &self.module,
                        entry_point: Some(pass.entry_point()),
                        compilation_options: wgpu::PipelineCompilationOptions {
                            constants: &[
                                ("whole_decoder", self.decoder == DecoderForm::Whole),
                                ("with_assets", !scene.assets.is_empty()),
                                ("with_leaves", !scene.leaves.is_empty()),
                                ("with_lod_transition", scene.hands_over()),
                            ]
                            .map(|(name, is_so)| (name, f64::from(u8::from(is_so)))),
                            ..Default::default()
                        },
                        cache: None,
                    }),
                );
            }
        }
        let grown = scene.lights.len() > self.light_capacity;
        if grown {
            self.light_capacity = scene.lights.len().next_power_of_two();
            self.lights = light_buffer(gpu, self.light_capacity)?;
        }
        let known = self.target.as_ref().is_some_and(|target| [target.width, target.height] == [width, height]);
        if known && !grown {
            return Ok(());
        }
        // The old picture makes room before the new one asks for it.
        self.target = None;
        let most_pixels = (gpu.most_binding_bytes() / size_of::<GpuPath>() as u64).min(MAX_BAND_PIXELS);
        let band_rows = ((most_pixels / u64::from(width)) as u32).clamp(1, height);
        let band_pixels = u64::from(width) * u64::from(band_rows);
        let bytes = size_of::<GpuPath>() as u64 * band_pixels;
        let paths = gpu.empty_buffer("paths of this picture", bytes, BufferUsages::STORAGE)?;
        let layout = scene_layout(gpu, self.arena.pieces.layout);
        let mut bands = Vec::new();
        for first_row in (0..height).step_by(band_rows as usize) {
            let rows = band_rows.min(height - first_row);
            let bytes = size_of::<GpuPixel>() as u64 * u64::from(width) * u64::from(rows);
            let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
            let pixels = gpu.empty_buffer("pixels of this picture", bytes, usage)?;
            let mut resources = vec![
                (0, self.frame.as_entire_binding()),
                (3, self.materials.as_entire_binding()),
                (4, self.lights.as_entire_binding()),
                (6, pixels.as_entire_binding()),
                (7, paths.as_entire_binding()),
            ];
            resources.extend(self.arena.pieces.entries(&ASSETS));
            let group = bind(gpu, &layout, &resources);
            bands.push(Band { first_row, rows, pixels, group });
        }
        self.target = Some(Target { width, height, bands });
        gpu.check()
    }

    fn write_materials(&self, gpu: &Gpu, scene: &Scene) {
        let material = |material: &Material| GpuMaterial {
            diffuse: match material.body {
                Body::Plain(colour) => colour.reflectance,
                _ => material.tint,
            },
            asset: material.asset().map_or(NO_ASSET, |asset| self.arena.bases[asset]),
            transmitted: match material.body {
                Body::Plain(colour) => colour.transmittance,
                _ => [0.0; 3],
            },
            leaf: match material.body {
                Body::Leaf(leaf) => self.arena.bases[leaf_place(scene, leaf)],
                _ => NO_ASSET,
            },
            mirror: material.mirror,
            displacement: material.displacement,
            uv_scale: material.uv_scale,
            pad0: 0,
            pad1: 0,
        };
        let materials: Vec<GpuMaterial> = scene.materials.iter().map(material).collect();
        gpu.queue.write_buffer(&self.materials, 0, bytemuck::cast_slice(&materials));
    }

    fn write_lights(&self, gpu: &Gpu, scene: &Scene) {
        let lights: Vec<GpuLight> = scene
            .lights
            .iter()
            .map(|light| GpuLight { position: light.position.to_array(), pad0: 0, intensity: light.intensity, pad1: 0 })
            .collect();
        gpu.queue.write_buffer(&self.lights, 0, bytemuck::cast_slice(&lights));
    }

    fn write_frame(
        &self,
        gpu: &Gpu,
        scene: &Scene,
        [width, height]: [u32; 2],
        band: &Band,
        options: &ShadeOptions,
        sample: u32,
    ) {
        let camera = scene.camera.frame(width, height);
        let decode = &options.decode;
        let volumes = scene.volumes.as_ref();
        let volumes_at = volumes.map_or(0, |_| self.arena.bases[volume_table_place(scene)]);
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
            ambient: scene.ambient.radiance,
            occlusion_distance: scene.ambient.distance,
            jitter: jitter(sample),
            components: decode.components,
            lobes: decode.lobes,
            parallax: decode.parallax.into(),
            first_row: band.first_row,
            rows: band.rows,
            mode: options.mode as u32,
            light_samples: options.light_samples,
            environment_at: self.arena.bases.get(environment_place(scene)).copied().unwrap_or(0),
            environment: scene.environment.as_ref().map_or([0; 2], |environment| environment.size()),
            pixel_width: camera.pixel_width(),
            levels: options.uses_levels().into(),
            root: scene.geometry.root(),
            sky: options.sky as u32,
            sun_direction: scene.sun.map_or([0.0, 1.0, 0.0], |sun| sun.direction.to_array()),
            sun_part: scene.sun.map_or(0.0, |sun| sun.sun_part()),
            sun_irradiance: scene.sun.map_or([0.0; 3], |sun| sun.irradiance),
            volume_root: self.volume_root,
            volumes_at,
            proxies_at: volumes_at + volumes.map_or(0, |volumes| volumes.volume_count() as u32),
            first_proxy: scene.geometry.instances().len() as u32,
            volume_reach: volumes.map_or(0.0, |volumes| volumes.reach()),
            volume_slice: volumes.map_or(0.0, |volumes| volumes.slice()),
            widest_leaf: self.widest_leaf,
            pad0: 0,
            pad1: 0,
        };
        gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
    }

    fn dispatch(&self, gpu: &Gpu, band: &Band, passes: &[Pass], groups: [u32; 2], mut timer: Option<&mut GpuTimer>) {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        for pass in passes {
            let Some(pipeline) = &self.pipelines[*pass as usize] else { continue };
            let timestamp_writes = timer.as_mut().map(|timer| timer.writes(*pass));
            let mut compute = encoder
                .begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(pass.entry_point()), timestamp_writes });
            compute.set_pipeline(pipeline);
            compute.set_bind_group(0, &band.group, &[]);
            compute.set_bind_group(1, &self.structure.group, &[]);
            compute.dispatch_workgroups(groups[0], groups[1], 1);
        }
        gpu.queue.submit([encoder.finish()]);
    }

    /// The picture's bands, from the top; empty before the first sample.
    pub(crate) fn bands(&self) -> &[Band] {
        self.target.as_ref().map_or(&[], |target| &target.bands)
    }

    /// Mean linear radiance per pixel, row-major from the top left; empty before the first sample.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] with what the driver reported.
    pub fn read_radiance(&self, gpu: &Gpu) -> Result<Vec<[f32; 3]>, ViewerError> {
        let mean = |pixel: &GpuPixel| {
            let [r, g, b, count] = pixel.sum;
            [r / count, g / count, b / count]
        };
        Ok(self.read_pixels(gpu)?.iter().map(mean).collect())
    }

    /// What the last sample of every pixel did; empty before the first sample.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] with what the driver reported.
    pub fn read_hits(&self, gpu: &Gpu) -> Result<Vec<PixelHit>, ViewerError> {
        let hit =
            |pixel: &GpuPixel| PixelHit { primitive: pixel.seen, rays: pixel.rays, evaluations: pixel.evaluations };
        Ok(self.read_pixels(gpu)?.iter().map(hit).collect())
    }

    fn read_pixels(&self, gpu: &Gpu) -> Result<Vec<GpuPixel>, ViewerError> {
        let Some(target) = &self.target else { return Ok(Vec::new()) };
        let mut pixels = Vec::with_capacity(target.width as usize * target.height as usize);
        for band in &target.bands {
            pixels.extend(gpu.read::<GpuPixel>(&band.pixels, (target.width * band.rows) as usize)?);
        }
        Ok(pixels)
    }
}

/// Number of a leaf in the arena, which holds assets, then leaves, then what volumes need, then the environment.
fn leaf_place(scene: &Scene, leaf: usize) -> usize {
    scene.assets.len() + leaf
}

/// Number of the first array of the volumes.
fn volume_place(scene: &Scene) -> usize {
    leaf_place(scene, scene.leaves.len())
}

/// Number of the table of the volumes, where there are any.
fn volume_table_place(scene: &Scene) -> usize {
    environment_place(scene) - 1
}

/// Number of the environment.
fn environment_place(scene: &Scene) -> usize {
    volume_place(scene) + scene.volumes.as_ref().map_or(0, |volumes| volumes.array_count())
}

/// The bases that `gpu` is to expand itself; `None` where the CPU does, or has.
fn bases_to_expand(gpu: &Gpu, asset: &SceneAsset) -> Option<Vec<LayerBases>> {
    let file = asset.file.as_ref().filter(|_| gpu.expands_bases() && !asset.is_expanded())?;
    LayerBases::of_asset(gpu, asset.head(), &file.whole)
}

fn light_buffer(gpu: &Gpu, count: usize) -> Result<wgpu::Buffer, ViewerError> {
    gpu.empty_buffer("lights", (count * size_of::<GpuLight>()) as u64, BufferUsages::STORAGE)
}
