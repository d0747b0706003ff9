//! The window as what is drawn on: its surface, the GPU behind it, and the user interface's painter.

use crate::error::ViewerError;
use crate::gpu::device::Gpu;

/// What shows a canvas.
pub(super) trait Host {
    /// Makes the surface to draw on.
    ///
    /// # Errors
    /// [`ViewerError::Window`].
    fn make_surface(&self, instance: &wgpu::Instance) -> Result<wgpu::Surface<'static>, ViewerError>;

    /// Tells that a frame is about to be shown.
    fn before_presenting(&self) {}
}

/// A surface and what draws on it.
pub(super) struct Canvas {
    pub gpu: Gpu,
    pub context: egui::Context,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    painter: egui_wgpu::Renderer,
    host: Box<dyn Host>,
}

impl Canvas {
    /// Prepares to draw on a surface of `size` pixels that `host` has made.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] where the adapter cannot.
    pub fn new(
        gpu: Gpu,
        surface: wgpu::Surface<'static>,
        size: [u32; 2],
        host: Box<dyn Host>,
    ) -> Result<Canvas, ViewerError> {
        let capabilities = surface.get_capabilities(&gpu.adapter);
        // egui blends in gamma space and the blit applies the sRGB curve itself.
        let format = capabilities
            .formats
            .iter()
            .copied()
            .find(|format| matches!(format, wgpu::TextureFormat::Bgra8Unorm | wgpu::TextureFormat::Rgba8Unorm));
        let format = format.ok_or_else(|| gpu.error("its surface offers no 8-bit format without an sRGB curve"))?;
        let [width, height] = size.map(|side| side.max(1));
        let mut config = surface
            .get_default_config(&gpu.adapter, width, height)
            .ok_or_else(|| gpu.error("it cannot show this window"))?;
        config.format = format;
        config.view_formats.clear();
        config.present_mode = wgpu::PresentMode::AutoVsync;
        surface.configure(&gpu.device, &config);
        let painter = egui_wgpu::Renderer::new(&gpu.device, format, Default::default());
        let context = egui::Context::default();
        // A click is told by its way alone: where frames are slow, its two ends come long after each other.
        context.options_mut(|options| options.input_options.max_click_duration = f64::INFINITY);
        Ok(Canvas { gpu, context, surface, config, painter, host })
    }

    /// Returns the format of the pixels.
    pub fn format(&self) -> wgpu::TextureFormat {
        self.config.format
    }

    /// Returns width and height of what is drawn on, pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.config.width, self.config.height]
    }

    /// Follows the window to another size in pixels, above 0.
    pub fn resize(&mut self, size: [u32; 2]) {
        let most = self.gpu.device.limits().max_texture_dimension_2d;
        [self.config.width, self.config.height] = size.map(|side| side.clamp(1, most));
        self.surface.configure(&self.gpu.device, &self.config);
    }

    /// Shows what `draw` draws, and the user interface on top; `true` if it must be drawn again to be seen.
    ///
    /// # Errors
    /// The errors of `draw`, and what the driver reported.
    pub fn present(
        &mut self,
        mut output: egui::FullOutput,
        draw: impl FnOnce(&Gpu, &mut wgpu::RenderPass<'static>) -> Result<(), ViewerError>,
    ) -> Result<bool, ViewerError> {
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
                self.surface = self.host.make_surface(&self.gpu.instance)?;
                (None, true)
            }
            Current::Validation => {
                self.gpu.check()?;
                (None, true)
            }
        };
        if let Some(frame) = frame {
            self.paint(&frame.texture, &jobs, &screen, draw)?;
            self.host.before_presenting();
            self.gpu.queue.present(frame);
        }
        for id in freed {
            self.painter.free_texture(&id);
        }
        if stale {
            self.surface.configure(&self.gpu.device, &self.config);
        }
        self.gpu.check().map(|()| stale)
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
