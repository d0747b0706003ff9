//! The window as what is drawn on: its surface, the GPU behind it, and the user interface's painter.

use crate::error::ViewerError;
use crate::gpu::device::{Gpu, instance, one_line};
use std::sync::Arc;
use winit::event_loop::ActiveEventLoop;
use winit::window::Window;

/// Makes the error of a window that cannot be opened. winit puts the place in its own source before what happened; a
/// user needs only the latter.
pub(super) fn no_window(error: &dyn std::fmt::Display) -> ViewerError {
    let message = one_line(&error.to_string());
    let what = match message.split_once(".rs:") {
        Some((_, rest)) => rest.split_once(": ").map_or(rest, |(_, what)| what),
        None => &message,
    };
    ViewerError::Window(what.trim_end_matches('.').into())
}

/// A window and what draws in it.
pub(super) struct Canvas {
    pub window: Arc<Window>,
    pub gpu: Gpu,
    pub context: egui::Context,
    pub input: egui_winit::State,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    painter: egui_wgpu::Renderer,
}

impl Canvas {
    /// Opens a window of a title and a size in pixels on an adapter that can show it.
    ///
    /// # Errors
    /// [`ViewerError::Window`], [`ViewerError::NoAdapter`] and [`ViewerError::Gpu`].
    pub fn open(
        event_loop: &ActiveEventLoop,
        title: &str,
        [width, height]: [u32; 2],
        adapter: Option<&str>,
    ) -> Result<Canvas, ViewerError> {
        let size = winit::dpi::PhysicalSize::new(width, height);
        let attributes = Window::default_attributes().with_title(title).with_inner_size(size);
        let window = Arc::new(event_loop.create_window(attributes).map_err(|error| no_window(&error))?);
        let instance = instance(Some(Box::new(event_loop.owned_display_handle())));
        let surface = instance.create_surface(window.clone()).map_err(|error| no_window(&error))?;
        let gpu = Gpu::open(instance, Some(&surface), adapter)?;

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
        Ok(Canvas { window, gpu, context, input, surface, config, painter })
    }

    /// Returns the format of the pixels.
    pub fn format(&self) -> wgpu::TextureFormat {
        self.config.format
    }

    /// Returns width and height of what is drawn on, pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.config.width, self.config.height]
    }

    /// Follows the window to another size in pixels. A minimised window has size 0, which a surface does not take.
    pub fn resize(&mut self, width: u32, height: u32) {
        if width == 0 || height == 0 {
            return;
        }
        let most = self.gpu.device.limits().max_texture_dimension_2d;
        (self.config.width, self.config.height) = (width.min(most), height.min(most));
        self.surface.configure(&self.gpu.device, &self.config);
        self.window.request_redraw();
    }

    /// Shows what `draw` draws, and the user interface on top.
    ///
    /// # Errors
    /// The errors of `draw`, and what the driver reported.
    pub fn present(
        &mut self,
        mut output: egui::FullOutput,
        draw: impl FnOnce(&Gpu, &mut wgpu::RenderPass<'static>) -> Result<(), ViewerError>,
    ) -> Result<(), ViewerError> {
        let screen =
            egui_wgpu::ScreenDescriptor { size_in_pixels: self.size(), pixels_per_point: output.pixels_per_point };
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
            self.paint(&frame.texture, &jobs, &screen, draw)?;
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
        draw: impl FnOnce(&Gpu, &mut wgpu::RenderPass<'static>) -> Result<(), ViewerError>,
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
            draw(&self.gpu, &mut pass)?;
            pass.set_viewport(0.0, 0.0, self.config.width as f32, self.config.height as f32, 0.0, 1.0);
            self.painter.render(&mut pass, jobs, screen);
        }
        self.gpu.queue.submit(callbacks.into_iter().chain([encoder.finish()]));
        Ok(())
    }
}
