//! The GPU tracer: a scene's buffers, and the passes of a sample over the bands of a picture.

use crate::cpu::bounced_light::BouncedLight;
use crate::error::ViewerError;
use crate::gpu::backend::GpuTracer;
use crate::gpu::device::Gpu;
use crate::gpu::frame::{FrameRequest, GpuFrame, GpuLight, GpuMaterial, MAX_MATERIALS, ScenePlaces, gpu_lights};
use crate::gpu::layout::scene_layout;
use crate::gpu::limits::IN_BROWSER;
use crate::gpu::modules::{MODULE_PARTS, ModuleLayout, trace_module};
use crate::gpu::operation_counters::OperationCounters;
use crate::gpu::pieces::ASSETS;
use crate::gpu::pipeline_constants::PipelineConstants;
use crate::gpu::pipelines::Pipelines;
use crate::gpu::preparation::Preparation;
use crate::gpu::results::reading::Reading;
use crate::gpu::results::timer::{GpuTimer, PASSES, Pass, PassTimes};
use crate::gpu::scene_change::{SceneChange, Updated};
use crate::gpu::scene_words::SceneWords;
use crate::gpu::structure::Structure;
use crate::gpu::target::{Band, MAX_BAND_PIXELS, Target};
use crate::light::irradiance_volume::IrradianceVolume;
use crate::light::light_grid::LightGrid;
use crate::operations::counts::OperationCounts;
use crate::options::{DecoderForm, RenderMode, ShadeOptions};
use crate::picture::PixelHit;
use crate::scene::scene::Scene;
use glam::Vec4;
use std::sync::Arc;
use web_time::Instant;
use wgpu::BufferUsages;

/// The factor by which the sides of the picture shrink that [`Tracer::limit_bands`] judges by.
const PROBE_SHRINK: u32 = 8;
/// Bands of a picture that [`Tracer::limit_bands`] makes at most: as many as a set of timestamps has room for.
const MAX_BANDS: u64 = 64;

/// Makes the module of a tracer that counts, see [`OperationCounters::module`].
type MakeModule = fn(&Gpu, ModuleLayout) -> Result<wgpu::ShaderModule, ViewerError>;

/// A scene on a GPU.
pub struct Tracer {
    gpu: Gpu,
    tracer: GpuTracer,
    /// The layout of bind group 0.
    scene_layout: wgpu::BindGroupLayout,
    decoder: DecoderForm,
    pipelines: Pipelines,
    /// Where operations are counted.
    counters: Option<OperationCounters>,
    frame: wgpu::Buffer,
    materials: wgpu::Buffer,
    lights: wgpu::Buffer,
    /// What draws the lights, where there are more than a sample has candidates for; they are in its order, and it stands
    /// behind them in their buffer.
    light_grid: Option<Arc<LightGrid>>,
    /// The grid of the latest lights that needed one.
    kept_grid: Option<Arc<LightGrid>>,
    /// The light after one bounce, where the latest options asked for it.
    bounced_light: Option<BouncedLight>,
    /// What of that is in the lights' buffer, and the quad where it begins.
    irradiance_volume: Option<(Arc<IrradianceVolume>, u32)>,
    words: SceneWords,
    structure: Structure,
    /// [`Geometry::widest_leaf`](crate::Geometry::widest_leaf).
    widest_leaf: f32,
    target: Option<Target>,
    /// Pixels of a band at most.
    max_band_pixels: u64,
    /// The band that comes next where they are drawn one by one.
    next_band: usize,
    /// The picture before, which is shown until all bands of the new one are drawn.
    before: Option<Target>,
}

/// Returns the passes of a sample, in order.
pub(crate) fn passes_of(scene: &Scene, options: &ShadeOptions) -> Vec<Pass> {
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
    /// Uploads `scene`. Geometry, volumes but for where their skins are, the number of materials and assets are then
    /// fixed; materials, lights, camera, ambient light and background are not. [`Tracer::update`] takes over further
    /// changes.
    ///
    /// # Errors
    /// [`ViewerError::NoAdapter`] without ray queries where they are asked for, [`ViewerError::Gpu`] where the scene
    /// is larger than the adapter binds.
    pub fn new(gpu: &Gpu, scene: &Scene, tracer: GpuTracer) -> Result<Tracer, ViewerError> {
        Tracer::with_decoder(gpu, scene, tracer, DecoderForm::default())
    }

    /// Uploads `scene` for a chosen form of the decoder, see [`Tracer::new`].
    ///
    /// # Errors
    /// As [`Tracer::new`].
    pub fn with_decoder(
        gpu: &Gpu,
        scene: &Scene,
        tracer: GpuTracer,
        decoder: DecoderForm,
    ) -> Result<Tracer, ViewerError> {
        Tracer::with_counters(gpu, scene, tracer, decoder, None, None)
    }

    /// Uploads `scene` like [`Tracer::new`], with the pipelines of another scene's tracer where they fit: nothing is compiled
    /// then.
    ///
    /// # Errors
    /// As [`Tracer::new`].
    pub(crate) fn with_pipelines(
        gpu: &Gpu,
        scene: &Scene,
        tracer: GpuTracer,
        pipelines: Option<Pipelines>,
    ) -> Result<Tracer, ViewerError> {
        Tracer::with_counters(gpu, scene, tracer, DecoderForm::default(), None, pipelines)
    }

    /// Returns what another scene's tracer can use, and the picture that is shown until that has one.
    pub(crate) fn into_rest(self) -> (Pipelines, Option<Target>) {
        (self.pipelines, self.before.or(self.target))
    }

    /// Uploads `scene` for a tracer that counts its operations, with the hierarchy in storage buffers. It is slower.
    ///
    /// # Errors
    /// As [`Tracer::new`].
    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) fn counting(gpu: &Gpu, scene: &Scene) -> Result<Tracer, ViewerError> {
        let counters = (OperationCounters::new(gpu)?, OperationCounters::module as MakeModule);
        Tracer::with_counters(gpu, scene, GpuTracer::Bvh, DecoderForm::default(), Some(counters), None)
    }

    fn with_counters(
        gpu: &Gpu,
        scene: &Scene,
        tracer: GpuTracer,
        decoder: DecoderForm,
        counting: Option<(OperationCounters, MakeModule)>,
        pipelines: Option<Pipelines>,
    ) -> Result<Tracer, ViewerError> {
        gpu.require(tracer)?;
        let words = SceneWords::new(gpu, scene)?;
        let structure = Structure::new(gpu, scene, tracer, words.pieces().layout)?;
        if scene.materials.len() > MAX_MATERIALS {
            return Err(gpu.error(format!(
                "the scene has {} materials and a shader takes {MAX_MATERIALS}; render with --backend cpu, or join materials",
                scene.materials.len()
            )));
        }
        let bytes = (size_of::<GpuMaterial>() * MAX_MATERIALS) as u64;
        let materials = gpu.empty_buffer("materials", bytes, BufferUsages::UNIFORM)?;
        let scene_layout = scene_layout(gpu, words.pieces().layout);
        let of = (tracer, structure.cut);
        let pipelines = match pipelines.filter(|pipelines| counting.is_none() && pipelines.are_of(gpu, of)) {
            Some(pipelines) => pipelines,
            None => {
                let module = match &counting {
                    Some((_, make)) => make(gpu, structure.cut)?,
                    None => gpu.shader_module(tracer.name(), trace_module(tracer, structure.cut)),
                };
                let counters_layout = counting.as_ref().map(|(counters, _)| &counters.layout);
                let layouts: Vec<_> = [&scene_layout, &structure.layout].into_iter().chain(counters_layout).collect();
                Pipelines::new(gpu, counting.is_none().then_some(of), module, &layouts)
            }
        };
        let frame = gpu.empty_buffer("frame", size_of::<GpuFrame>() as u64, BufferUsages::UNIFORM)?;
        let lights = light_buffer(gpu, lights_bytes(scene))?;
        gpu.check()?;
        Ok(Tracer {
            gpu: gpu.clone(),
            tracer,
            scene_layout,
            decoder,
            pipelines,
            counters: counting.map(|(counters, _)| counters),
            frame,
            materials,
            lights,
            light_grid: None,
            kept_grid: None,
            bounced_light: None,
            irradiance_volume: None,
            words,
            structure,
            widest_leaf: scene.geometry.widest_leaf(),
            target: None,
            max_band_pixels: MAX_BAND_PIXELS,
            next_band: 0,
            before: None,
        })
    }

    /// Takes over a change of the scene.
    ///
    /// # Errors
    /// As [`Tracer::new`], for [`SceneChange::Skins`].
    pub fn update(&mut self, scene: &Scene, change: &SceneChange) -> Result<Updated, ViewerError> {
        let fits = match change {
            SceneChange::Edits(asset) => self.words.write_edits(scene, *asset),
            SceneChange::Shown(asset) => self.words.write_shown(scene, *asset),
            SceneChange::Leaf { leaf, words } => self.words.write_leaf(scene, *leaf, words.clone()),
            SceneChange::Environment => self.words.write_environment(scene),
            SceneChange::Instances => {
                self.structure.write_instances(scene);
                true
            }
            SceneChange::Bricks => false,
            SceneChange::Skins => {
                self.words.write_skins(scene);
                self.structure.move_proxies(scene)?;
                true
            }
        };
        Ok(if fits { Updated::InPlace } else { Updated::NeedsUpload })
    }

    /// Returns how rays are traced.
    pub fn tracer(&self) -> GpuTracer {
        self.tracer
    }

    /// Returns width and height of the picture, `None` before the first sample.
    pub fn size(&self) -> Option<[u32; 2]> {
        self.target.as_ref().map(|target| target.size)
    }

    /// Adds a sample to every pixel and submits the work. `timer` is where the GPU writes when each pass begins and
    /// ends.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] where the driver has no memory for a picture of this size.
    pub fn sample(&mut self, request: &FrameRequest, mut timer: Option<&mut GpuTimer>) -> Result<(), ViewerError> {
        let passes = passes_of(request.scene, &request.options);
        self.prepare(request, &passes)?;
        let Some(target) = &self.target else { return Ok(()) };
        if let Some(timer) = &mut timer {
            timer.begin(target.bands.len() * passes.len())?;
        }
        self.write_scene(request.scene);
        for band in &target.bands {
            self.write_frame(request, band);
            let [width, height] = self.pipelines.group();
            let groups = [request.size[0].div_ceil(width), band.rows.div_ceil(height)];
            self.dispatch(band, &passes, groups, timer.as_deref_mut());
        }
        if let Some(timer) = timer {
            timer.resolve();
        }
        Ok(())
    }

    /// Draws the next band of a sample, of `band_pixels` at most (which the first sample settles), and submits the work.
    /// Returns the pixels that it has, and whether it is the last one.
    ///
    /// # Errors
    /// As [`Tracer::sample`].
    pub(crate) fn sample_band(&mut self, request: &FrameRequest, band_pixels: u64) -> Result<(u64, bool), ViewerError> {
        let passes = passes_of(request.scene, &request.options);
        if self.next_band == 0 {
            let has = (self.size(), self.max_band_pixels);
            if request.sample == 0 && has != (Some(request.size), band_pixels) {
                self.max_band_pixels = band_pixels;
                // A picture that is not whole is not worth showing.
                let whole = self.target.take();
                self.before = self.before.take().or(whole);
            }
            self.prepare(request, &passes)?;
            self.write_scene(request.scene);
        }
        let Some(band) = self.bands().get(self.next_band) else { return Ok((0, true)) };
        self.write_frame(request, band);
        let [width, height] = self.pipelines.group();
        let groups = [request.size[0].div_ceil(width), band.rows.div_ceil(height)];
        self.dispatch(band, &passes, groups, None);
        let pixels = u64::from(request.size[0]) * u64::from(band.rows);
        let is_last = self.next_band + 1 == self.bands().len();
        self.next_band = if is_last { 0 } else { self.next_band + 1 };
        if is_last {
            self.before = None;
        }
        Ok((pixels, is_last))
    }

    /// Has the next band be the first one of another sample.
    pub(crate) fn restart_bands(&mut self) {
        self.next_band = 0;
    }

    /// Returns the size of the picture that is shown, and its bands from the top: the one before, while the new one has no whole
    /// sample.
    pub(crate) fn shown(&self) -> Option<([u32; 2], &[Band])> {
        let target = self.before.as_ref().or(self.target.as_ref())?;
        Some((target.size, &target.bands))
    }

    /// Runs [`Tracer::sample`] and waits: returns how long it took, milliseconds, and by kind of pass. With a `timer`
    /// that is the GPU's time for the passes, else the time until they were finished.
    ///
    /// # Errors
    /// As [`Tracer::sample`], and what the driver reported.
    pub fn timed_sample(
        &mut self,
        request: &FrameRequest,
        mut timer: Option<&mut GpuTimer>,
    ) -> Result<(f64, Option<PassTimes>), ViewerError> {
        let start = Instant::now();
        self.sample(request, timer.as_deref_mut())?;
        self.gpu.wait()?;
        let wall_ms = start.elapsed().as_secs_f64() * 1e3;
        let passes = timer.map(|timer| timer.read()).transpose()?;
        Ok((passes.map_or(wall_ms, |passes| passes.sum_ms()), passes))
    }

    /// Compiles every pass of a sample and runs one workgroup of each, so that drivers that compile at the first dispatch
    /// do so before anything is timed.
    ///
    /// # Errors
    /// As [`Tracer::sample`].
    pub fn warm_up(&mut self, request: &FrameRequest) -> Result<(), ViewerError> {
        self.make_ready(request, &Preparation::default())
    }

    /// Runs [`Tracer::warm_up`] and tells another thread how far it is.
    ///
    /// # Errors
    /// As [`Tracer::sample`]; [`ViewerError::Interrupted`] where the other thread does not wait any more.
    pub(crate) fn make_ready(&mut self, request: &FrameRequest, preparation: &Preparation) -> Result<(), ViewerError> {
        let first = FrameRequest { sample: 0, ..*request };
        let mut passes = passes_of(first.scene, &first.options);
        let mut met = [false; PASSES];
        passes.retain(|pass| !std::mem::replace(&mut met[*pass as usize], true));
        preparation.begin(passes.len());
        if IN_BROWSER {
            // Pipelines are compiled beside each other, and nobody can wait for them here.
            return self.prepare(&first, &passes);
        }
        for pass in passes {
            if preparation.is_abandoned() {
                return Err(ViewerError::Interrupted);
            }
            self.prepare(&first, &[pass])?;
            self.write_scene(first.scene);
            if let Some(band) = self.bands().first() {
                self.write_frame(&first, band);
                self.dispatch(band, &[pass], [1, 1], None);
            }
            self.gpu.wait()?;
            preparation.count();
        }
        Ok(())
    }

    /// Sets the columns and rows of pixels of a workgroup, at most 256 together.
    pub(crate) fn set_group(&mut self, group: [u32; 2]) {
        self.pipelines.set_group(group);
    }

    /// Has pipelines also serve what users of a window change from one moment to the next: edits, and numbers of lights.
    pub(crate) fn expect_changes(&mut self) {
        let changes = PipelineConstants { edits: true, kept_rows: true, drawn_lights: true, ..Default::default() };
        self.pipelines.expect(changes);
    }

    /// Tells whether all passes of a sample are compiled.
    pub(crate) fn is_ready_for(&self, request: &FrameRequest) -> bool {
        let passes = passes_of(request.scene, &request.options);
        self.pipelines.are_ready(&passes, self.needed(request))
    }

    fn needed(&self, request: &FrameRequest) -> PipelineConstants {
        PipelineConstants::of(request.scene, &request.options, self.decoder)
    }

    /// Cuts pictures like the requested one into bands whose passes take about `band_ms` at most together, as far as a
    /// small picture of the same tells, so that no system takes the device for hung. Returns the pixels that a band then has at
    /// most. Cost: two small pictures.
    ///
    /// # Errors
    /// As [`Tracer::sample`].
    pub fn limit_bands(&mut self, request: &FrameRequest, band_ms: f64) -> Result<u64, ViewerError> {
        let size = request.size.map(|side| side.div_ceil(PROBE_SHRINK));
        let small = FrameRequest { size, sample: 0, ..*request };
        let mut seconds = 0.0;
        // The first is for buffers and caches.
        for _ in 0..2 {
            let start = Instant::now();
            self.sample(&small, None)?;
            self.gpu.wait()?;
            seconds = start.elapsed().as_secs_f64();
        }
        let pixels = |[width, height]: [u32; 2]| u64::from(width) * u64::from(height);
        let most = (band_ms * 1e-3 / seconds.max(1e-9) * pixels(size) as f64) as u64;
        self.max_band_pixels = most.max(pixels(request.size).div_ceil(MAX_BANDS)).min(MAX_BAND_PIXELS);
        self.target = None;
        Ok(self.max_band_pixels)
    }

    /// Makes what is missing: pipelines, room for lights, the buffers of the picture.
    fn prepare(&mut self, request: &FrameRequest, passes: &[Pass]) -> Result<(), ViewerError> {
        self.pipelines.prepare(passes, self.needed(request));
        let grown = self.prepare_lights(request)?;
        if self.size() == Some(request.size) && !grown {
            return Ok(());
        }
        // The old picture makes room before the new one asks for it.
        self.target = None;
        let mut shared = vec![
            (0, self.frame.as_entire_binding()),
            (3, self.materials.as_entire_binding()),
            (4, self.lights.as_entire_binding()),
        ];
        shared.extend(self.words.pieces().entries(&ASSETS));
        self.target = Some(Target::new(&self.gpu, request.size, self.max_band_pixels, &self.scene_layout, &shared)?);
        self.gpu.check()
    }

    /// Makes room for the lights, for what draws them and for what they have lit, and writes that where it is new. Returns
    /// whether they have another buffer.
    fn prepare_lights(&mut self, request: &FrameRequest) -> Result<bool, ViewerError> {
        let FrameRequest { scene, options, sample, .. } = request;
        let written = self.light_grid.take();
        self.light_grid = scene.light_grid(options.light_samples, &mut self.kept_grid);
        let bounced = BouncedLight::of_sample(&mut self.bounced_light, scene, options, *sample);
        // Whether lights are drawn by the grid may change within a picture, which another buffer would end.
        let lights = lights_bytes(scene).max(size_of::<GpuLight>() as u64);
        let volume_at = (lights + LightGrid::max_bytes(scene.lights.len())).next_multiple_of(size_of::<Vec4>() as u64);
        let bytes = volume_at + bounced.as_ref().map_or(0, |volume| size_of_val(volume.quads()) as u64);
        let grown = bytes > self.lights.size();
        if grown {
            self.lights = light_buffer(&self.gpu, bytes.next_power_of_two())?;
        }
        if let Some(grid) = &self.light_grid
            && (grown || !written.is_some_and(|written| Arc::ptr_eq(&written, grid)))
        {
            self.gpu.queue.write_buffer(&self.lights, lights_bytes(scene), bytemuck::cast_slice(grid.pairs()));
        }
        let before = self.irradiance_volume.take().filter(|_| !grown);
        self.irradiance_volume = bounced.map(|volume| (volume, (volume_at / size_of::<Vec4>() as u64) as u32));
        if let Some((volume, at)) = &self.irradiance_volume
            && !before.is_some_and(|(written, written_at)| Arc::ptr_eq(&written, volume) && written_at == *at)
        {
            self.gpu.queue.write_buffer(&self.lights, volume_at, bytemuck::cast_slice(volume.quads()));
        }
        Ok(grown)
    }

    /// Writes lights and materials.
    fn write_scene(&self, scene: &Scene) {
        self.gpu.queue.write_buffer(
            &self.lights,
            0,
            bytemuck::cast_slice(&gpu_lights(scene, self.light_grid.as_deref())),
        );
        let (asset_at, leaf_at) = (|asset| self.words.asset_at(asset), |leaf| self.words.leaf_at(leaf));
        let materials: Vec<GpuMaterial> =
            scene.materials.iter().map(|material| GpuMaterial::new(material, asset_at, leaf_at)).collect();
        self.gpu.queue.write_buffer(&self.materials, 0, bytemuck::cast_slice(&materials));
    }

    fn write_frame(&self, request: &FrameRequest, band: &Band) {
        let places = ScenePlaces {
            environment_at: self.words.environment_at(),
            volumes_at: self.words.volumes_at(),
            volume_root: self.structure.volume_root,
            widest_leaf: self.widest_leaf,
            irradiance_at: self.irradiance_volume.as_ref().map_or(0, |(_, at)| *at),
        };
        let frame = GpuFrame::new(request, [band.first_row, band.rows], &places);
        self.gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
    }

    fn dispatch(&self, band: &Band, passes: &[Pass], groups: [u32; 2], mut timer: Option<&mut GpuTimer>) {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        for pass in passes {
            let Some(pipeline) = self.pipelines.get(*pass) else { continue };
            let timestamp_writes = timer.as_mut().map(|timer| timer.writes(*pass));
            let mut compute = encoder
                .begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(pass.entry_point()), timestamp_writes });
            compute.set_pipeline(pipeline);
            compute.set_bind_group(0, &band.group, &[]);
            compute.set_bind_group(1, &self.structure.group, &[]);
            if let Some(counters) = &self.counters {
                compute.set_bind_group(2, &counters.group, &[]);
            }
            compute.dispatch_workgroups(groups[0], groups[1], 1);
        }
        self.gpu.queue.submit([encoder.finish()]);
    }

    /// Returns the picture's bands, from the top; empty before the first sample.
    pub(crate) fn bands(&self) -> &[Band] {
        self.target.as_ref().map_or(&[], |target| &target.bands)
    }

    /// Draws a sample and returns the operations that it took, by part of the module; none of a tracer that does not count.
    ///
    /// # Errors
    /// As [`Tracer::sample`], and what the driver reported.
    pub(crate) fn count_sample(
        &mut self,
        request: &FrameRequest,
    ) -> Result<[OperationCounts; MODULE_PARTS], ViewerError> {
        self.make_ready(request, &Preparation::default())?;
        self.counters.iter().for_each(|counters| counters.clear(&self.gpu));
        self.sample(request, None)?;
        self.counters.as_ref().map_or(Ok(Default::default()), |counters| counters.read(&self.gpu))
    }

    /// Reads the mean linear radiance per pixel, row-major from the top left; empty before the first sample.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] with what the driver reported.
    pub fn read_radiance(&self) -> Result<Vec<[f32; 3]>, ViewerError> {
        let pixels = self.target.as_ref().map(|target| target.read(&self.gpu)).transpose()?;
        Ok(pixels.iter().flatten().map(|pixel| pixel.radiance()).collect())
    }

    /// Begins to read the mean linear radiance; `None` before the first sample.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] where the driver has no memory for the copies.
    pub(crate) fn begin_read(&self) -> Result<Option<Reading>, ViewerError> {
        let Some(target) = self.before.as_ref().or(self.target.as_ref()) else { return Ok(None) };
        let (gpu, bands) = (Box::new(self.gpu.clone()), target.begin_read(&self.gpu)?);
        Ok(Some(Reading::Bands { gpu, size: target.size, bands, pixels: Vec::new() }))
    }

    /// Reads what the last sample of every pixel did; empty before the first sample.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] with what the driver reported.
    pub fn read_hits(&self) -> Result<Vec<PixelHit>, ViewerError> {
        let pixels = self.target.as_ref().map(|target| target.read(&self.gpu)).transpose()?;
        Ok(pixels.iter().flatten().map(|pixel| pixel.hit()).collect())
    }
}

/// Returns the bytes of the lights alone, where the grid that draws them begins.
fn lights_bytes(scene: &Scene) -> u64 {
    (scene.lights.len() * size_of::<GpuLight>()) as u64
}

fn light_buffer(gpu: &Gpu, bytes: u64) -> Result<wgpu::Buffer, ViewerError> {
    gpu.empty_buffer("lights", bytes.max(size_of::<GpuLight>() as u64), BufferUsages::STORAGE)
}
