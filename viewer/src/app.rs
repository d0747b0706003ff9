//! The window: orbit camera, side panel, progressive rendering.

use crate::blit::{Blit, GpuBlit};
use crate::cpu::CpuPicture;
use crate::error::ViewerError;
use crate::governor::{Governor, Spending};
use crate::gpu::{BackendChoice, Gpu, instance};
use crate::gpu_timer::{GpuTimer, PassTimes};
use crate::options::{RenderMode, ShadeOptions};
use crate::panel::{Panel, Renderer, Status};
use crate::scene::{Ambient, Scene};
use crate::shaders::GpuTracer;
use crate::trace::{GpuPixel, Tracer};
use std::sync::Arc;
use std::time::Instant;
use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::window::{Window, WindowId};

/// Samples per pixel after which a picture that nobody touches is left alone.
const MAX_SAMPLES: u32 = 64;
/// The same where directions or lights are drawn at random.
const MAX_RANDOM_SAMPLES: u32 = 4096;
/// The CPU renders a picture of at most so many pixels and the window shows it enlarged, to stay usable.
const CPU_PIXELS: u32 = 200 * 200;
/// Width of the panel in points.
const PANEL_WIDTH: f32 = 290.0;
/// Radians that a drag across the window's shorter side turns.
const TURN_PER_SIDE: f32 = 4.0;
/// Weight of the newest frame in the shown frame time.
const FRAME_TIME_WEIGHT: f64 = 0.2;

/// What the window starts with.
#[derive(Debug, Clone)]
pub struct WindowParams {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Which renderer; the panel switches it.
    pub backend: BackendChoice,
    /// Part of the adapter's name, where there are several.
    pub adapter: Option<String>,
    /// What costs time and changes accuracy; the panel changes it.
    pub shade: ShadeOptions,
    /// Milliseconds that a frame may take; components and lights are what is saved.
    pub target_ms: Option<f64>,
}

/// Opens a window and returns when the user closes it. Needs an adapter even for the CPU renderer, to show its picture.
///
/// # Errors
/// [`ViewerError::Window`] where there is no display, [`ViewerError::NoAdapter`], [`ViewerError::Gpu`].
pub fn run_window(scene: Scene, params: WindowParams) -> Result<(), ViewerError> {
    let event_loop = EventLoop::new().map_err(|error| no_window(&error))?;
    event_loop.set_control_flow(ControlFlow::Wait);
    let mut app = App { scene: Some(scene), params, view: None, error: None };
    event_loop.run_app(&mut app).map_err(|error| no_window(&error))?;
    app.error.map_or(Ok(()), Err)
}

/// winit puts the place in its own source before what happened; a user needs only the latter.
fn no_window(error: &dyn std::fmt::Display) -> ViewerError {
    let message = crate::gpu::one_line(&error.to_string());
    let what = match message.split_once(".rs:") {
        Some((_, rest)) => rest.split_once(": ").map_or(rest, |(_, what)| what),
        None => &message,
    };
    ViewerError::Window(what.trim_end_matches('.').into())
}

struct App {
    // Taken by the view once the window is there.
    scene: Option<Scene>,
    params: WindowParams,
    view: Option<View>,
    error: Option<ViewerError>,
}

/// Everything that exists once the window does.
struct View {
    window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    gpu: Gpu,
    context: egui::Context,
    input: egui_winit::State,
    painter: egui_wgpu::Renderer,
    blit: Blit,
    timer: Option<GpuTimer>,
    renderers: Vec<Renderer>,
    panel: Panel,
    /// The panel's settings within the budget, of the picture at hand.
    governed: ShadeOptions,
    scene: Scene,
    tracer: Option<Tracer>,
    cpu: Option<(CpuPicture, wgpu::Buffer)>,
    samples: u32,
    frame_ms: Option<f64>,
    passes: Option<PassTimes>,
    governor: Option<Governor>,
    problem: Option<String>,
    occluded: bool,
}

impl ApplicationHandler for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        let Some(scene) = self.scene.take() else { return };
        match View::new(event_loop, scene, &self.params) {
            Ok(view) => {
                view.window.request_redraw();
                self.view = Some(view);
            }
            Err(error) => self.fail(event_loop, error),
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(view) = &mut self.view else { return };
        let response = view.input.on_window_event(&view.window, &event);
        match event {
            WindowEvent::CloseRequested => event_loop.exit(),
            WindowEvent::Resized(size) => view.resize(size.width, size.height),
            WindowEvent::Occluded(occluded) => {
                view.occluded = occluded;
                view.window.request_redraw();
            }
            WindowEvent::RedrawRequested => {
                if let Err(error) = view.redraw(event_loop) {
                    self.fail(event_loop, error);
                }
            }
            // A redraw counts as a reason to repaint too; asking for one then would never end.
            _ if response.repaint => view.window.request_redraw(),
            _ => {}
        }
    }

    fn new_events(&mut self, _: &ActiveEventLoop, cause: winit::event::StartCause) {
        if let (winit::event::StartCause::ResumeTimeReached { .. }, Some(view)) = (cause, &self.view) {
            view.window.request_redraw();
        }
    }
}

impl App {
    fn fail(&mut self, event_loop: &ActiveEventLoop, error: ViewerError) {
        self.error = Some(error);
        event_loop.exit();
    }
}

impl View {
    fn new(event_loop: &ActiveEventLoop, scene: Scene, params: &WindowParams) -> Result<View, ViewerError> {
        let size = winit::dpi::PhysicalSize::new(params.size[0], params.size[1]);
        let attributes = Window::default_attributes().with_title("BTF viewer").with_inner_size(size);
        let window = Arc::new(event_loop.create_window(attributes).map_err(|error| no_window(&error))?);
        let instance = instance(Some(Box::new(event_loop.owned_display_handle())));
        let surface = instance.create_surface(window.clone()).map_err(|error| no_window(&error))?;
        let gpu = Gpu::open(instance, Some(&surface), params.adapter.as_deref())?;

        let capabilities = surface.get_capabilities(&gpu.adapter);
        // egui blends in gamma space and the blit applies the sRGB curve itself.
        let format = capabilities
            .formats
            .iter()
            .copied()
            .find(|format| matches!(format, wgpu::TextureFormat::Bgra8Unorm | wgpu::TextureFormat::Rgba8Unorm));
        let format = format.ok_or_else(|| gpu.error("its surface offers no 8-bit format without an sRGB curve"))?;
        let size = window.inner_size();
        let mut config = surface
            .get_default_config(&gpu.adapter, size.width.max(1), size.height.max(1))
            .ok_or_else(|| gpu.error("it cannot show this window"))?;
        config.format = format;
        config.view_formats.clear();
        config.present_mode = wgpu::PresentMode::AutoVsync;
        surface.configure(&gpu.device, &config);

        let context = egui::Context::default();
        let input = egui_winit::State::new(
            context.clone(),
            egui::ViewportId::ROOT,
            &window,
            Some(window.scale_factor() as f32),
            None,
            Some(gpu.device.limits().max_texture_dimension_2d as usize),
        );
        let painter = egui_wgpu::Renderer::new(&gpu.device, format, Default::default());
        let blit = Blit::new(&gpu, format)?;
        let mut renderers = vec![Renderer::Gpu(GpuTracer::Bvh), Renderer::Cpu];
        if gpu.has_ray_query() {
            renderers.insert(0, Renderer::Gpu(GpuTracer::RayQuery));
        }
        let renderer = match params.backend {
            BackendChoice::Auto => Renderer::Gpu(gpu.best_tracer()),
            BackendChoice::Cpu => Renderer::Cpu,
            BackendChoice::Gpu(tracer) => {
                gpu.require(tracer)?;
                Renderer::Gpu(tracer)
            }
        };
        let governor = params.target_ms.map(|target_ms| Governor::new(target_ms, Spending::all_of(&scene)));
        let panel = Panel::new(&scene, params.shade, renderer);
        let timer = GpuTimer::new(&gpu);
        Ok(View {
            window,
            surface,
            config,
            gpu,
            context,
            input,
            painter,
            blit,
            timer,
            renderers,
            governed: params.shade,
            panel,
            scene,
            tracer: None,
            cpu: None,
            samples: 0,
            frame_ms: None,
            passes: None,
            governor,
            problem: None,
            occluded: false,
        })
    }

    /// A minimised window has size 0, which a surface does not take.
    fn resize(&mut self, width: u32, height: u32) {
        if width == 0 || height == 0 {
            return;
        }
        let most = self.gpu.device.limits().max_texture_dimension_2d;
        (self.config.width, self.config.height) = (width.min(most), height.min(most));
        self.surface.configure(&self.gpu.device, &self.config);
        self.window.request_redraw();
    }

    fn hidden(&self) -> bool {
        let size = self.window.inner_size();
        self.occluded || size.width == 0 || size.height == 0
    }

    fn redraw(&mut self, event_loop: &ActiveEventLoop) -> Result<(), ViewerError> {
        if self.hidden() {
            return Ok(());
        }
        let input = self.input.take_egui_input(&self.window);
        let renderer_before = self.panel.renderer;
        let context = self.context.clone();
        let (mut changed, mut view_size) = (false, [1, 1]);
        let mut output = context.run_ui(input, |ui| {
            let (touched, size) = self.ui(ui);
            changed |= touched;
            view_size = size;
        });
        if self.panel.renderer != renderer_before {
            // The other renderer uploads the scene anew; its first frames compile.
            (self.tracer, self.cpu, self.frame_ms, self.passes, self.problem) = (None, None, None, None, None);
        }
        let picture_size = self.picture_size(view_size);
        if changed || self.current_size() != Some(picture_size) {
            self.samples = 0;
        }
        if self.samples < self.most_samples()
            && let Err(error) = self.add_sample(picture_size)
        {
            // A renderer that fails leaves the window and its panel alive, with the others to switch to.
            self.problem = Some(error.to_string());
            self.samples = MAX_RANDOM_SAMPLES;
        }
        self.input.handle_platform_output(&self.window, std::mem::take(&mut output.platform_output));
        let root = output.viewport_output.get(&egui::ViewportId::ROOT);
        let delay = root.map_or(std::time::Duration::MAX, |viewport| viewport.repaint_delay);
        self.present(output, view_size)?;

        if self.samples < self.most_samples() || changed || delay.is_zero() {
            self.window.request_redraw();
        }
        // A far deadline overflows; then nothing but an event wakes us.
        event_loop
            .set_control_flow(Instant::now().checked_add(delay).map_or(ControlFlow::Wait, ControlFlow::WaitUntil));
        Ok(())
    }

    /// Panel and camera; whether the picture must begin anew, and the size of the area beside the panel in pixels.
    fn ui(&mut self, ui: &mut egui::Ui) -> (bool, [u32; 2]) {
        let status = Status {
            adapter: self.gpu.adapter_name(),
            renderers: &self.renderers,
            frame_ms: self.frame_ms,
            passes: self.passes,
            timer: self.timer_name(),
            samples: self.samples,
            picture: self.current_size().unwrap_or([0, 0]),
            problem: self.problem.as_deref(),
            governor: self.governor.as_ref(),
        };
        let (panel, scene) = (&mut self.panel, &mut self.scene);
        let mut changed = egui::Panel::right("panel")
            .exact_size(PANEL_WIDTH)
            .resizable(false)
            .show(ui, |ui| egui::ScrollArea::vertical().show(ui, |ui| panel.show(ui, scene, &status)).inner)
            .inner;
        let camera_before = self.scene.camera;
        let area = ui.available_rect_before_wrap();
        let response = ui.allocate_rect(area, egui::Sense::click_and_drag());
        let side = area.width().min(area.height()).max(1.0);
        let drag = response.drag_delta() / side;
        let moving = response.dragged_by(egui::PointerButton::Secondary)
            || response.dragged_by(egui::PointerButton::Middle)
            || ui.input(|input| input.modifiers.shift);
        if moving {
            self.scene.camera.pan(drag.x, -drag.y);
        } else if response.dragged() {
            self.scene.camera.orbit(-drag.x * TURN_PER_SIDE, drag.y * TURN_PER_SIDE);
        }
        if response.hovered() {
            let scroll = ui.input(|input| input.smooth_scroll_delta().y);
            if scroll != 0.0 {
                self.scene.camera.zoom((-scroll * 0.003).exp());
            }
        }
        changed |= self.scene.camera != camera_before;
        let pixels = |points: f32| ((points * ui.pixels_per_point()).round() as u32).max(1);
        (changed, [pixels(area.width()).min(self.config.width), pixels(area.height()).min(self.config.height)])
    }

    fn most_samples(&self) -> u32 {
        let shade = &self.panel.shade;
        let drawn = (shade.light_samples as usize) < self.scene.lights.len();
        let random = shade.mode == RenderMode::Path
            || drawn
            || self.scene.ambient != Ambient::NONE
            || self.scene.environment.is_some();
        if random { MAX_RANDOM_SAMPLES } else { MAX_SAMPLES }
    }

    fn timer_name(&self) -> &'static str {
        match (self.panel.renderer, &self.timer) {
            (Renderer::Gpu(_), Some(_)) => "GPU",
            _ => "wall clock",
        }
    }

    fn picture_size(&self, [width, height]: [u32; 2]) -> [u32; 2] {
        if self.panel.renderer != Renderer::Cpu {
            return [width, height];
        }
        let shrink = (f64::from(CPU_PIXELS) / (f64::from(width) * f64::from(height))).sqrt().min(1.0);
        [width, height].map(|side| ((f64::from(side) * shrink) as u32).max(1))
    }

    fn current_size(&self) -> Option<[u32; 2]> {
        match self.panel.renderer {
            Renderer::Gpu(_) => self.tracer.as_ref().and_then(Tracer::size),
            Renderer::Cpu => self.cpu.as_ref().map(|(picture, _)| [picture.width, picture.height]),
        }
    }

    fn add_sample(&mut self, size: [u32; 2]) -> Result<(), ViewerError> {
        // Settings change with the picture only, so that its samples are alike.
        if self.samples == 0 {
            let lights = self.scene.lights.len() as u32;
            self.governor.iter_mut().for_each(|governor| governor.set_lights(lights));
            self.governed = self.governor.as_ref().map_or(self.panel.shade, |it| it.settings(&self.panel.shade));
        }
        let shade = self.governed;
        let mut first = false;
        let ms = match self.panel.renderer {
            Renderer::Gpu(kind) => {
                let tracer = match &mut self.tracer {
                    Some(tracer) => tracer,
                    none => {
                        first = true;
                        none.insert(Tracer::new(&self.gpu, &self.scene, kind)?)
                    }
                };
                let (ms, passes) =
                    tracer.timed_sample(&self.gpu, &self.scene, size, &shade, self.samples, self.timer.as_mut())?;
                self.passes = passes;
                ms
            }
            Renderer::Cpu => {
                let start = Instant::now();
                let anew = self.samples == 0;
                if anew {
                    let bytes = size_of::<GpuPixel>() as u64 * u64::from(size[0]) * u64::from(size[1]);
                    let buffer = self.gpu.empty_buffer("pixels of this picture", bytes, wgpu::BufferUsages::STORAGE)?;
                    self.cpu = Some((CpuPicture::new(size), buffer));
                }
                if let Some((picture, buffer)) = &mut self.cpu {
                    picture.add_sample(&self.scene, &shade, &|| true);
                    self.gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(&picture.gpu_pixels()));
                }
                self.passes = None;
                start.elapsed().as_secs_f64() * 1e3
            }
        };
        if let (Some(governor), false) = (&mut self.governor, first) {
            governor.observe(ms);
        }
        // The first frame of a renderer holds its compilation on some drivers.
        if !first {
            let old = self.frame_ms.unwrap_or(ms);
            self.frame_ms = Some(old + FRAME_TIME_WEIGHT * (ms - old));
        }
        self.samples += 1;
        Ok(())
    }

    fn present(&mut self, mut output: egui::FullOutput, view: [u32; 2]) -> Result<(), ViewerError> {
        let screen = egui_wgpu::ScreenDescriptor {
            size_in_pixels: [self.config.width, self.config.height],
            pixels_per_point: output.pixels_per_point,
        };
        let jobs = self.context.tessellate(std::mem::take(&mut output.shapes), output.pixels_per_point);
        for (id, deltas) in &output.textures_delta.set {
            for delta in deltas {
                self.painter.update_texture(&self.gpu.device, &self.gpu.queue, *id, delta);
            }
        }
        // Textures are freed after painting; the delta itself must be empty when it is dropped.
        let freed = std::mem::take(&mut output.textures_delta.free);
        output.textures_delta.clear();

        use wgpu::CurrentSurfaceTexture as Current;
        let (frame, stale) = match self.surface.get_current_texture() {
            Current::Success(frame) => (Some(frame), false),
            Current::Suboptimal(frame) => (Some(frame), true),
            Current::Timeout | Current::Occluded => (None, false),
            Current::Outdated => (None, true),
            Current::Lost => {
                self.surface =
                    self.gpu.instance.create_surface(self.window.clone()).map_err(|error| no_window(&error))?;
                (None, true)
            }
            Current::Validation => {
                self.gpu.check()?;
                (None, true)
            }
        };
        if let Some(frame) = frame {
            self.paint(&frame.texture, &jobs, &screen, view)?;
            self.window.pre_present_notify();
            self.gpu.queue.present(frame);
        }
        for id in freed {
            self.painter.free_texture(&id);
        }
        if stale {
            self.surface.configure(&self.gpu.device, &self.config);
            self.window.request_redraw();
        }
        self.gpu.check()
    }

    fn paint(
        &mut self,
        texture: &wgpu::Texture,
        jobs: &[egui::ClippedPrimitive],
        screen: &egui_wgpu::ScreenDescriptor,
        view: [u32; 2],
    ) -> Result<(), ViewerError> {
        let target = texture.create_view(&Default::default());
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let callbacks = self.painter.update_buffers(&self.gpu.device, &self.gpu.queue, &mut encoder, jobs, screen);
        {
            let mut pass = encoder
                .begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some("window"),
                    color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                        view: &target,
                        depth_slice: None,
                        resolve_target: None,
                        ops: wgpu::Operations {
                            load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                            store: wgpu::StoreOp::Store,
                        },
                    })],
                    ..Default::default()
                })
                .forget_lifetime();
            if let Some(size) = self.current_size() {
                let bands: Vec<(u32, u32, &wgpu::Buffer)> = match (self.panel.renderer, &self.tracer, &self.cpu) {
                    (Renderer::Gpu(_), Some(tracer), _) => {
                        tracer.bands().iter().map(|band| (band.first_row, band.rows, &band.pixels)).collect()
                    }
                    (Renderer::Cpu, _, Some((picture, buffer))) => vec![(0, picture.height, buffer)],
                    _ => Vec::new(),
                };
                pass.set_viewport(0.0, 0.0, view[0] as f32, view[1] as f32, 0.0, 1.0);
                let gain = self.scene.exposure_ev.exp2();
                for (first_row, rows, pixels) in bands {
                    let params = GpuBlit { picture: size, window: view, gain, first_row, rows, pad0: 0 };
                    self.blit.draw(&self.gpu, &mut pass, pixels, params)?;
                }
                pass.set_viewport(0.0, 0.0, self.config.width as f32, self.config.height as f32, 0.0, 1.0);
            }
            self.painter.render(&mut pass, jobs, screen);
        }
        self.gpu.queue.submit(callbacks.into_iter().chain([encoder.finish()]));
        Ok(())
    }
}
