//! The pictures in the window: the scene's own, and the other one of a split view.

use super::blit::{Blit, GpuBlit};
use super::editing::document::Document;
use super::progress::Progress;
use super::renderer::Renderer;
use super::side::Side;
use super::split::{Against, Split};
use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use crate::gpu::frame::FrameRequest;
use crate::gpu::scene_change::SceneChange;
use crate::gpu::timer::GpuTimer;
use crate::options::{RenderMode, ShadeOptions};
use crate::picture::Picture;
use crate::render::governor::{Governor, Spending};
use crate::scene::scene::{Ambient, Scene};

/// Samples per pixel after which a picture that nobody touches is left alone.
const MAX_SAMPLES: u32 = 64;
/// Samples per pixel after which a picture is left alone whose directions or lights are drawn at random.
const MAX_RANDOM_SAMPLES: u32 = 4096;
/// The CPU renders a picture of at most so many pixels and the window shows it enlarged, to stay usable.
const CPU_PIXELS: u32 = 200 * 200;

/// The pictures in the window.
pub(super) struct Pictures {
    pub side: Side,
    pub split: Split,
    pub progress: Progress,
    timer: Option<GpuTimer>,
}

impl Pictures {
    /// Makes pictures without samples. `target_ms` is how many milliseconds a frame may take, if that is limited.
    pub fn new(gpu: &Gpu, scene: &Scene, shade: ShadeOptions, target_ms: Option<f64>, split: Split) -> Pictures {
        let governor = target_ms.map(|target_ms| Governor::new(target_ms, Spending::all_of(scene)));
        let progress = Progress::new(shade, governor);
        Pictures { side: Side::default(), split, progress, timer: GpuTimer::new(gpu) }
    }

    /// Returns the clock of the frame times of a renderer.
    pub fn timer_name(&self, renderer: Renderer) -> &'static str {
        match (renderer, &self.timer) {
            (Renderer::Gpu(_), Some(_)) => "GPU",
            _ => "wall clock",
        }
    }

    /// Begins anew with another renderer, which uploads the scene anew and whose first frames compile.
    pub fn switch_renderer(&mut self, document: &Document) {
        self.side = Side::default();
        self.progress.forget_renderer();
        self.split.reset(&document.scene, document.at_hand());
    }

    /// Begins anew with another scene.
    pub fn switch_scene(&mut self, document: &Document) {
        let scene = &document.scene;
        self.side = Side::default();
        self.split.reset(scene, document.at_hand());
        let governor = &mut self.progress.governor;
        *governor = governor.as_ref().map(|it| Governor::new(it.budget_ms(), Spending::all_of(scene)));
        self.progress.problem = None;
    }

    /// Takes over a change of the scene.
    pub fn update(&mut self, scene: &Scene, change: &SceneChange) {
        self.side.update(scene, change);
        self.split.update(scene, change);
    }

    /// Begins anew, because the pictures are to show something else.
    pub fn restart(&mut self) {
        self.progress.samples = 0;
    }

    /// Adds a sample to pictures for an area of `view` pixels, unless they have all they need.
    pub fn advance(
        &mut self,
        gpu: &Gpu,
        document: &Document,
        renderer: Renderer,
        shade: &ShadeOptions,
        view: [u32; 2],
    ) {
        let size = picture_size(renderer, view);
        if self.side.size() != Some(size) {
            self.restart();
        }
        if self.progress.samples < self.most_samples(&document.scene)
            && let Err(error) = self.add_sample(gpu, document, renderer, shade, size)
        {
            // A renderer that fails leaves the window and its panel alive, with the others to switch to.
            self.progress.problem = Some(error.to_string());
            self.progress.samples = MAX_RANDOM_SAMPLES;
        }
    }

    fn add_sample(
        &mut self,
        gpu: &Gpu,
        document: &Document,
        renderer: Renderer,
        shade: &ShadeOptions,
        size: [u32; 2],
    ) -> Result<(), ViewerError> {
        let scene = &document.scene;
        self.progress.settle(shade, scene.lights.len() as u32);
        let options = self.progress.governed;
        let request = FrameRequest { scene, size, options, sample: self.progress.samples };
        let took = self.side.add_sample(gpu, renderer, &request, self.timer.as_mut())?;
        if self.split.on {
            let options = self.split.against.shade(&options);
            let (side, scene) = self.split.scene(scene, document.at_hand());
            side.add_sample(gpu, renderer, &FrameRequest { scene, options, ..request }, None)?;
        }
        self.progress.count(took);
        Ok(())
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
    pub fn are_finished(&self, scene: &Scene) -> bool {
        self.have(u32::MAX, scene)
    }

    /// Reads the scene's own picture as it is.
    ///
    /// # Errors
    /// The errors of reading from the GPU.
    pub fn read(&self) -> Result<Picture, ViewerError> {
        let [width, height] = self.side.size().unwrap_or([0, 0]);
        Ok(Picture { width, height, radiance: self.side.radiance()? })
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
        let Some(size) = self.side.size() else { return Ok(()) };
        let (own, other) = (self.side.bands(), split.side.bands());
        // The other picture may still be of another size.
        let compared = split.on && split.side.size() == Some(size) && own.len() == other.len();
        pass.set_viewport(0.0, 0.0, view[0] as f32, view[1] as f32, 0.0, 1.0);
        let gain = exposure_ev.exp2();
        for (number, (first_row, rows, pixels)) in own.iter().enumerate() {
            let params = GpuBlit {
                picture: size,
                window: view,
                gain,
                first_row: *first_row,
                rows: *rows,
                split: if compared { 1 + u32::from(split.difference) } else { 0 },
                other_from: (split.place * view[0] as f32) as u32,
                difference_gain: split.gain,
                pad0: [0; 2],
            };
            let other = if compared { other[number].2 } else { pixels };
            blit.draw(gpu, pass, pixels, other, params)?;
        }
        Ok(())
    }
}

/// Returns the size of the picture that a renderer computes for an area of the window, pixels.
fn picture_size(renderer: Renderer, [width, height]: [u32; 2]) -> [u32; 2] {
    if renderer != Renderer::Cpu {
        return [width, height];
    }
    let shrink = (f64::from(CPU_PIXELS) / (f64::from(width) * f64::from(height))).sqrt().min(1.0);
    [width, height].map(|side| ((f64::from(side) * shrink) as u32).max(1))
}
