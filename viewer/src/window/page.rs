//! The window on a page: it draws on a canvas that no document holds, in a worker, so that the page itself never waits.

use super::canvas::{Canvas, Host};
use super::link::LinkedView;
use super::settings::Settings;
use super::view::{Drawn, View};
use crate::error::ViewerError;
use crate::gpu::backend::{BackendChoice, GpuTracer};
use crate::gpu::device::{Gpu, instance};
use crate::options::ShadeOptions;
use crate::render::bricks::USUAL_VOLUME_BUDGET_MB;
use crate::scene::scene::Scene;
use crate::window_params::WindowParams;
use std::path::Path;
use web_sys::OffscreenCanvas;

/// Interval at which a GPU at work is asked whether it has finished, milliseconds.
const POLL_MS: f64 = 3.0;

/// A canvas of a page as the host of what is drawn on it.
struct PageHost(OffscreenCanvas);

impl Host for PageHost {
    fn make_surface(&self, instance: &wgpu::Instance) -> Result<wgpu::Surface<'static>, ViewerError> {
        let target = wgpu::SurfaceTarget::OffscreenCanvas(self.0.clone());
        instance.create_surface(target).map_err(|error| ViewerError::Window(error.to_string()))
    }
}

/// What a frame leaves to the page.
#[derive(Default)]
pub struct PageFrame {
    /// Whether the canvas has a new picture.
    pub is_drawn: bool,
    /// Milliseconds until the next frame, if nothing happens before; infinite for none.
    pub next_in_ms: f64,
    /// Name of the pointer's shape in CSS.
    pub cursor: &'static str,
    /// Text for the clipboard.
    pub copied: Option<String>,
    /// Whether the user wants to choose a file.
    pub choose_file: bool,
    /// Whether a text field has the focus.
    pub is_typing: bool,
    /// Whether edits are unsaved.
    pub has_unsaved: bool,
}

/// A window on a page.
pub struct Page {
    view: View,
    input: egui::RawInput,
    /// Size of the canvas in pixels, and how many of them a point has.
    size: [u32; 2],
    pixels_per_point: f32,
    /// Time at which controls must be drawn again, seconds.
    repaint_at_s: f64,
    /// Whether there is more to draw of the picture.
    goes_on: bool,
    /// The scene as it was opened, which links are told against, without what they do not tell.
    opened: Scene,
}

impl Page {
    /// Opens a window of `size` pixels on a canvas, with a scene.
    ///
    /// # Errors
    /// [`ViewerError::NoAdapter`], [`ViewerError::Window`], [`ViewerError::Gpu`].
    pub async fn open(
        canvas: OffscreenCanvas,
        size: [u32; 2],
        pixels_per_point: f32,
        scene: Scene,
    ) -> Result<Page, ViewerError> {
        let (instance, host) = (instance(None), PageHost(canvas));
        let surface = host.make_surface(&instance)?;
        let gpu = Gpu::of_browser(instance, Some(&surface)).await?;
        let canvas = Canvas::new(gpu, surface, size, Box::new(host))?;
        canvas.context.set_fonts(font());
        let params = WindowParams {
            size: Some(size),
            backend: BackendChoice::Gpu(GpuTracer::Bvh),
            adapter: None,
            shade: ShadeOptions::default(),
            target_ms: None,
            volume_budget_mb: USUAL_VOLUME_BUDGET_MB,
            compare: None,
        };
        let opened = without_content(&scene);
        let mut view = View::new(canvas, scene, &params, Settings::default())?;
        view.have_host_choose_files();
        let mut page = Page {
            view,
            input: egui::RawInput::default(),
            pixels_per_point,
            size,
            repaint_at_s: 0.0,
            goes_on: true,
            opened,
        };
        page.resize(size, pixels_per_point);
        Ok(page)
    }

    /// Follows the canvas to another size in pixels.
    pub fn resize(&mut self, size: [u32; 2], pixels_per_point: f32) {
        (self.size, self.pixels_per_point) = (size, pixels_per_point);
        self.view.canvas.resize(size);
        self.repaint_at_s = 0.0;
    }

    /// Takes an event of the user's.
    pub fn take(&mut self, event: egui::Event) {
        self.input.events.push(event);
    }

    /// Notes which keys are held down beside others.
    pub fn set_modifiers(&mut self, modifiers: egui::Modifiers) {
        self.input.events.push(egui::Event::ModifiersChanged(modifiers));
    }

    /// Shows another scene.
    pub fn show(&mut self, scene: Scene) {
        self.opened = without_content(&scene);
        self.view.show(scene);
        self.repaint_at_s = 0.0;
    }

    /// Opens a file that was handed over, as if it was dropped at a place of the window, in points.
    pub fn open_file(&mut self, path: &Path, at: Option<[f32; 2]>) {
        if let Some([x, y]) = at {
            self.input.events.push(egui::Event::PointerMoved(egui::pos2(x, y)));
        }
        self.view.drop_file(path.into());
        self.repaint_at_s = 0.0;
    }

    /// Returns how the scene is seen, as text for a link.
    pub fn link(&self) -> String {
        self.view.linked(&self.opened).text()
    }

    /// Has the scene seen as a link tells.
    pub fn follow(&mut self, link: &str) {
        self.view.follow(&LinkedView::read(link));
        self.repaint_at_s = 0.0;
    }

    /// Returns the samples per pixel that the picture has, once no renderer is being made ready.
    pub fn samples(&self) -> u32 {
        self.view.samples()
    }

    /// Returns the message of the latest opening or saving, or why the renderer stopped.
    pub fn message(&self) -> Option<String> {
        self.view.message()
    }

    /// Draws a frame at `now_s` seconds, unless nothing has happened and the GPU is still at the one before.
    ///
    /// # Errors
    /// What the browser reported.
    pub fn frame(&mut self, now_s: f64) -> Result<PageFrame, ViewerError> {
        if self.input.events.is_empty() && now_s < self.repaint_at_s {
            let nothing = |next_in_ms| PageFrame { next_in_ms, ..PageFrame::default() };
            if self.view.is_waiting() {
                return Ok(nothing(POLL_MS));
            }
            if self.goes_on && !self.view.advance() {
                return Ok(nothing(POLL_MS));
            }
        }
        let mut input = self.input.take();
        let [width, height] = self.size.map(|side| side as f32 / self.pixels_per_point);
        input.screen_rect = Some(egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(width, height)));
        input.time = Some(now_s);
        input.max_texture_side = Some(self.view.canvas.gpu.device.limits().max_texture_dimension_2d as usize);
        input.viewports.entry(input.viewport_id).or_default().native_pixels_per_point = Some(self.pixels_per_point);
        let Drawn { platform, repaint_in, goes_on, has_unsaved, .. } = self.view.redraw(input)?;
        self.goes_on = goes_on;
        self.repaint_at_s = now_s + repaint_in.as_secs_f64();
        let copied = platform.commands.into_iter().find_map(|command| match command {
            egui::OutputCommand::CopyText(text) => Some(text),
            _ => None,
        });
        Ok(PageFrame {
            is_drawn: true,
            next_in_ms: if goes_on { 0.0 } else { repaint_in.as_secs_f64() * 1e3 },
            cursor: css_cursor(platform.cursor_icon),
            copied,
            choose_file: self.view.takes_file_choice(),
            is_typing: self.view.canvas.context.egui_wants_keyboard_input(),
            has_unsaved,
        })
    }
}

/// Returns a scene without assets, leaves, volumes and surroundings, which would stay in memory after others have taken their
/// place.
fn without_content(scene: &Scene) -> Scene {
    Scene { assets: Vec::new(), leaves: Vec::new(), volumes: None, environment: None, ..scene.clone() }
}

/// Returns the font of all texts.
fn font() -> egui::FontDefinitions {
    let name = String::from("Ubuntu-Light");
    let mut fonts = egui::FontDefinitions::empty();
    let data = egui::FontData::from_static(epaint_default_fonts::UBUNTU_LIGHT);
    fonts.font_data.insert(name.clone(), data.into());
    for family in [egui::FontFamily::Proportional, egui::FontFamily::Monospace] {
        fonts.families.insert(family, vec![name.clone()]);
    }
    fonts
}

fn css_cursor(icon: egui::CursorIcon) -> &'static str {
    use egui::CursorIcon as Icon;
    match icon {
        Icon::PointingHand => "pointer",
        Icon::Text => "text",
        Icon::Grab => "grab",
        Icon::Grabbing => "grabbing",
        Icon::ResizeHorizontal | Icon::ResizeColumn => "ew-resize",
        Icon::ResizeVertical | Icon::ResizeRow => "ns-resize",
        Icon::NotAllowed => "not-allowed",
        Icon::Crosshair => "crosshair",
        _ => "default",
    }
}
