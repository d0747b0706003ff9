//! The pictures in the window: the scene's own, and the other one of a split view.

use super::blit::{Blit, GpuBlit};
use super::cpu_canvas::CpuCanvas;
use super::progress::Progress;
use super::renderer::Renderer;
use super::resting::Resting;
use super::side::{Devices, Rows, Side, Took};
use super::split::{Against, Split};
use super::stand_in::shrunk;
use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use crate::gpu::frame::FrameRequest;
use crate::gpu::limits::IN_BROWSER;
use crate::gpu::results::reading::Reading;
use crate::gpu::results::timer::GpuTimer;
use crate::gpu::scene_change::SceneChange;
use crate::options::{RenderMode, ShadeOptions};
use crate::render::governor::{Governor, Spending};
use crate::scene::scene::{Ambient, Scene};
use crate::window::editing::document::Document;
use crate::work::HAS_THREADS;

/// Samples per pixel after which a picture that nobody touches is left alone.
const MAX_SAMPLES: u32 = 64;
/// Samples per pixel after which a picture is left alone whose directions or lights are drawn at random.
const MAX_RANDOM_SAMPLES: u32 = 4096;
/// The CPU renders a picture of at most so many pixels and the window shows it enlarged, to stay usable.
const CPU_PIXELS: u32 = 200 * 200;

/// The pictures in the window.
pub(crate) struct Pictures {
    pub side: Side,
    pub split: Split,
    pub progress: Progress,
    pub resting: Resting,
    devices: Devices,
    timer: Option<GpuTimer>,
    /// The size of the pictures that are drawn, which may not be shown yet.
    drawn_size: Option<[u32; 2]>,
    /// The scene's own sample, where the other picture's is not drawn yet.
    own_took: Option<Took>,
}

impl Pictures {
    /// Makes pictures without samples for a window that `gpu` draws. `target_ms` is how many milliseconds a frame may
    /// take, if that is limited.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] where the driver opens no device for them.
    pub fn new(
        gpu: &Gpu,
        scene: &Scene,
        shade: ShadeOptions,
        target_ms: Option<f64>,
        split: Split,
    ) -> Result<Pictures, ViewerError> {
        let governor = target_ms.map(|target_ms| Governor::new(target_ms, Spending::all_of(scene)));
        let progress = Progress::new(shade, governor);
        let devices = Devices { window: gpu.clone(), tracing: gpu.for_tracing()? };
        let timer = GpuTimer::new(&devices.tracing);
        Ok(Pictures {
            side: Side::default(),
            split,
            progress,
            resting: Resting::default(),
            devices,
            timer,
            drawn_size: None,
            own_took: None,
        })
    }

    /// Returns the clock of the frame times of a renderer.
    pub fn timer_name(&self, renderer: Renderer) -> &'static str {
        match (renderer, &self.timer) {
            (Renderer::Gpu(_), Some(_)) => "GPU",
            _ => "wall clock",
        }
    }

    /// Begins anew with another renderer, which uploads the scene anew and compiles.
    pub fn switch_renderer(&mut self, document: &Document) {
        self.leave_busy_device();
        self.side = Side::default();
        self.drawn_size = None;
        self.progress.forget_renderer();
        self.split.reset(&document.scene, document.at_hand());
    }

    /// Begins anew with another scene.
    pub fn switch_scene(&mut self, document: &Document) {
        let was_busy = self.leave_busy_device();
        let scene = &document.scene;
        match was_busy {
            true => self.side = Side::default(),
            false => self.side.switch_scene(),
        }
        self.drawn_size = None;
        self.split.reset(scene, document.at_hand());
        let governor = &mut self.progress.governor;
        *governor = governor.as_ref().map(|it| Governor::new(it.budget_ms(), Spending::all_of(scene)));
        self.progress.problem = None;
    }

    /// Leaves the tracing device to a thread that still compiles on it, now for nobody: a software driver has everything
    /// else wait. For both pictures to begin anew. Returns whether there was such a thread.
    fn leave_busy_device(&mut self) -> bool {
        let is_busy = HAS_THREADS && self.preparation().is_some();
        if is_busy && let Ok(tracing) = self.devices.window.for_tracing() {
            self.timer = GpuTimer::new(&tracing);
            self.devices.tracing = tracing;
        }
        is_busy
    }

    /// Takes over a change of the scene.
    pub fn update(&mut self, scene: &Scene, change: &SceneChange) {
        self.side.update(scene, change);
        self.split.update(scene, change);
    }

    /// Begins anew, because the pictures are to show something else.
    pub fn restart(&mut self) {
        self.side.pace.restart();
        self.begin_anew();
    }

    /// Begins anew, perhaps finer than before.
    fn begin_anew(&mut self) {
        self.progress.samples = 0;
        self.own_took = None;
        self.resting.restart();
        self.side.restart();
        self.split.side.restart();
    }

    /// Adds a sample to pictures for an area of `view` pixels, unless they have all they need. While a renderer is made
    /// ready, another picture stands in.
    pub fn advance(&mut self, document: &Document, renderer: Renderer, shade: &ShadeOptions, view: [u32; 2]) {
        let advanced = self.take_ready(document).and_then(|()| {
            let size = self.picture_size(renderer, view);
            if self.progress.problem.is_none() && self.side.preparation().is_none() && self.drawn_size != Some(size) {
                self.drawn_size = Some(size);
                self.begin_anew();
            }
            // A whole sample of a coarse picture is followed by a finer picture.
            if IN_BROWSER && self.progress.samples > 0 && !self.are_at_work() && self.side.pace.refine(view) {
                return Ok(());
            }
            if !self.are_at_work() && self.progress.samples < self.most_samples(&document.scene) {
                self.add_sample(document, renderer, shade, size)?;
            }
            self.rest(&document.scene)?;
            self.side.stand_in(&self.devices.window, &document.scene, view)
        });
        if let Err(error) = advanced {
            // A renderer that fails leaves the window and its panel alive, with the others to switch to.
            self.progress.problem = Some(error.to_string());
            self.progress.samples = MAX_RANDOM_SAMPLES;
        }
    }

    /// Goes on filtering the scene's own picture, where that is all that is shown.
    fn rest(&mut self, scene: &Scene) -> Result<(), ViewerError> {
        if self.split.on || self.side.preparation().is_some() {
            self.resting.restart();
            return Ok(());
        }
        let Progress { samples, governed, .. } = &self.progress;
        self.resting.advance(&self.devices.window, &self.side, scene, governed, *samples)
    }

    /// Takes over renderers that have become ready, and begins anew with them.
    fn take_ready(&mut self, document: &Document) -> Result<(), ViewerError> {
        let mut is_new = self.side.take_ready(&document.scene)?;
        if self.split.on {
            let (side, scene) = self.split.scene(&document.scene, document.at_hand());
            is_new |= side.take_ready(scene)?;
        }
        if is_new {
            self.progress.problem = None;
            self.restart();
        }
        Ok(())
    }

    fn add_sample(
        &mut self,
        document: &Document,
        renderer: Renderer,
        shade: &ShadeOptions,
        size: [u32; 2],
    ) -> Result<(), ViewerError> {
        let scene = &document.scene;
        self.progress.settle(shade, scene.lights.len() as u32);
        let options = self.progress.governed;
        let request = FrameRequest { scene, size, options, sample: self.progress.samples };
        if self.own_took.is_none() {
            self.own_took = self.side.add_sample(&self.devices, renderer, &request, self.timer.as_mut())?;
        }
        if self.own_took.is_none() {
            return Ok(());
        }
        if self.split.on {
            let options = self.split.against.shade(&options);
            let pace = self.side.pace;
            let (side, scene) = self.split.scene(scene, document.at_hand());
            side.pace = pace;
            let request = FrameRequest { scene, options, ..request };
            let took = side.add_sample(&self.devices, renderer, &request, None)?;
            if took.is_none() && side.preparation().is_none() {
                // Bands are missing.
                return Ok(());
            }
        }
        if let Some(took) = self.own_took.take() {
            self.progress.count(took);
        }
        Ok(())
    }

    /// Returns the size of the picture that a renderer computes for an area of the window, pixels.
    fn picture_size(&mut self, renderer: Renderer, view: [u32; 2]) -> [u32; 2] {
        match renderer {
            Renderer::Cpu => shrunk(view, CPU_PIXELS),
            Renderer::Gpu(_) if IN_BROWSER => self.side.pace.size(view),
            Renderer::Gpu(_) => view,
        }
    }

    /// Returns what is being done to make renderers ready, for the user; `None` where they are.
    pub fn preparation(&self) -> Option<String> {
        let other = self.split.side.preparation().filter(|_| self.split.on);
        self.side.preparation().or(other.map(|line| format!("for the comparison: {line}")))
    }

    /// Tells whether the next frame is to have another sample at once.
    pub fn go_on(&self, scene: &Scene) -> bool {
        self.side.preparation().is_none() && !self.are_finished(scene)
    }

    /// Returns how many samples per pixel the pictures get.
    fn most_samples(&self, scene: &Scene) -> u32 {
        let shade = &self.progress.governed;
        let drawn = (shade.light_samples as usize) < scene.lights.len();
        let random = shade.mode == RenderMode::Path
            || (self.split.on && self.split.against == Against::Paths)
            || drawn
            || scene.ambient != Ambient::NONE
            || scene.environment.is_some();
        if random { MAX_RANDOM_SAMPLES } else { MAX_SAMPLES }
    }

    /// Tells whether the pictures have at least `enough` samples, or all that they get.
    pub fn have(&self, enough: u32, scene: &Scene) -> bool {
        self.progress.samples >= enough.min(self.most_samples(scene))
    }

    /// Tells whether more samples would not change the pictures.
    fn are_finished(&self, scene: &Scene) -> bool {
        self.have(u32::MAX, scene)
    }

    /// Begins to read the scene's own picture as it is.
    ///
    /// # Errors
    /// [`ViewerError::Usage`] where another one stands in for it; the errors of reading from the GPU.
    pub fn begin_read(&self) -> Result<Reading, ViewerError> {
        let unready = || ViewerError::Usage("the renderer is not ready: save the picture when it is there".into());
        self.side.begin_read()?.ok_or_else(unready)
    }

    /// Begins to read the picture that is shown: without its noise, where that is filtered out.
    ///
    /// # Errors
    /// As [`Pictures::begin_read`].
    pub fn begin_read_shown(&self) -> Result<Reading, ViewerError> {
        self.resting.reading().map_or_else(|| self.begin_read(), Ok)
    }

    /// Tells whether the GPU is at a sample, and a frame would show nothing new of it.
    pub fn are_at_work(&mut self) -> bool {
        let Pictures { side, split, devices, .. } = self;
        side.is_at_work(devices) | (split.on && split.side.is_at_work(devices))
    }

    /// Draws the pictures on an area of `view` pixels from the window's upper left corner.
    ///
    /// # Errors
    /// What the driver reported.
    pub fn draw(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::RenderPass,
        blit: &Blit,
        exposure_ev: f32,
        view: [u32; 2],
    ) -> Result<(), ViewerError> {
        let split = &self.split;
        let rested = self.resting.shown().map(|(_, canvas)| canvas);
        let Some(size) = rested.map(CpuCanvas::size).or(self.side.size()) else { return Ok(()) };
        let own = rested.map_or_else(|| self.side.rows(), |canvas| vec![Rows::of_canvas(canvas)]);
        let other = split.side.rows();
        // The other picture may still be of another size.
        let compared = split.on && split.side.size() == Some(size) && own.len() == other.len();
        pass.set_viewport(0.0, 0.0, view[0] as f32, view[1] as f32, 0.0, 1.0);
        let gain = exposure_ev.exp2();
        for (number, Rows { first, count, pixels }) in own.iter().enumerate() {
            let params = GpuBlit {
                picture: size,
                window: view,
                gain,
                first_row: *first,
                rows: *count,
                split: if compared { 1 + u32::from(split.difference) } else { 0 },
                other_from: (split.place * view[0] as f32) as u32,
                difference_gain: split.gain,
                pad0: [0; 2],
            };
            let other = if compared { other[number].pixels } else { pixels };
            blit.draw(gpu, pass, pixels, other, params)?;
        }
        Ok(())
    }
}
