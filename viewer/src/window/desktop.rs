//! The window of a desktop.

use super::canvas::{Canvas, Host};
use super::pictures::preparing;
use super::settings::Settings;
use super::view::{Drawn, View};
use crate::error::ViewerError;
use crate::gpu::device::{Gpu, instance, one_line};
use crate::scene::scene::Scene;
use crate::window_params::WindowParams;
use std::sync::Arc;
use web_time::Instant;
use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::window::{Window, WindowId};

/// Title of a window whose edits are saved.
const TITLE: &str = "BTF viewer";
/// Title of a window with unsaved edits.
const UNSAVED_TITLE: &str = "* BTF viewer";

/// Opens a window and returns when the user closes it, which asks where edits are unsaved. Needs an adapter even for
/// the CPU renderer, to show its picture.
///
/// # Errors
/// [`ViewerError::Window`] where there is no display, [`ViewerError::NoAdapter`], [`ViewerError::Gpu`].
pub fn run_window(scene: Scene, params: WindowParams) -> Result<(), ViewerError> {
    let event_loop = EventLoop::new().map_err(|error| no_window(&error))?;
    event_loop.set_control_flow(ControlFlow::Wait);
    let mut app = App { scene: Some(scene), params, shown: None, error: None };
    event_loop.run_app(&mut app).map_err(|error| no_window(&error))?;
    if app.error.is_none() {
        preparing::end_if_at_work();
    }
    app.error.map_or(Ok(()), Err)
}

struct App {
    // Taken by the view once the window is there.
    scene: Option<Scene>,
    params: WindowParams,
    shown: Option<Shown>,
    error: Option<ViewerError>,
}

/// The window, what reads the user's input of it, and what it shows.
struct Shown {
    window: Arc<Window>,
    input: egui_winit::State,
    view: View,
    /// Whether other windows cover this one.
    is_occluded: bool,
    title: &'static str,
}

/// A window of the system as the host of a canvas.
struct DesktopHost(Arc<Window>);

impl Host for DesktopHost {
    fn make_surface(&self, instance: &wgpu::Instance) -> Result<wgpu::Surface<'static>, ViewerError> {
        instance.create_surface(self.0.clone()).map_err(|error| no_window(&error))
    }

    fn before_presenting(&self) {
        self.0.pre_present_notify();
    }
}

impl Shown {
    /// Opens the window on a scene.
    fn open(event_loop: &ActiveEventLoop, scene: Scene, params: &WindowParams) -> Result<Shown, ViewerError> {
        let settings = Settings::load();
        let [width, height] = params.size.unwrap_or(settings.size);
        let size = winit::dpi::PhysicalSize::new(width, height);
        let attributes = Window::default_attributes().with_title(TITLE).with_inner_size(size);
        let window = Arc::new(event_loop.create_window(attributes).map_err(|error| no_window(&error))?);
        let instance = instance(Some(Box::new(event_loop.owned_display_handle())));
        let host = DesktopHost(window.clone());
        let surface = host.make_surface(&instance)?;
        let gpu = Gpu::open(instance, Some(&surface), params.adapter.as_deref())?;
        let canvas =
            Canvas::new(gpu, surface, [window.inner_size().width, window.inner_size().height], Box::new(host))?;
        let input = egui_winit::State::new(
            canvas.context.clone(),
            egui::ViewportId::ROOT,
            &window,
            Some(window.scale_factor() as f32),
            None,
            Some(canvas.gpu.device.limits().max_texture_dimension_2d as usize),
        );
        let view = View::new(canvas, scene, params, settings)?;
        Ok(Shown { window, input, view, is_occluded: false, title: TITLE })
    }

    fn is_hidden(&self) -> bool {
        let size = self.window.inner_size();
        self.is_occluded || size.width == 0 || size.height == 0
    }

    /// Draws a frame, and asks for the next one where there is more to draw.
    fn redraw(&mut self, event_loop: &ActiveEventLoop) -> Result<(), ViewerError> {
        if self.is_hidden() {
            return Ok(());
        }
        let input = self.input.take_egui_input(&self.window);
        let Drawn { platform, has_unsaved, repaint_in, goes_on } = self.view.redraw(input)?;
        self.input.handle_platform_output(&self.window, platform);
        let title = if has_unsaved { UNSAVED_TITLE } else { TITLE };
        if title != self.title {
            self.title = title;
            self.window.set_title(title);
        }
        if goes_on || repaint_in.is_zero() {
            self.window.request_redraw();
        }
        // A far deadline overflows; then nothing but an event wakes us.
        event_loop
            .set_control_flow(Instant::now().checked_add(repaint_in).map_or(ControlFlow::Wait, ControlFlow::WaitUntil));
        Ok(())
    }
}

impl ApplicationHandler for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        let Some(scene) = self.scene.take() else { return };
        match Shown::open(event_loop, scene, &self.params) {
            Ok(shown) => {
                shown.window.request_redraw();
                self.shown = Some(shown);
            }
            Err(error) => self.fail(event_loop, error),
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(shown) = &mut self.shown else { return };
        let response = shown.input.on_window_event(&shown.window, &event);
        match event {
            WindowEvent::CloseRequested => {
                shown.view.close();
                shown.window.request_redraw();
            }
            // A minimised window has size 0, which a surface does not take.
            WindowEvent::Resized(size) if size.width > 0 && size.height > 0 => {
                shown.view.canvas.resize([size.width, size.height]);
                shown.window.request_redraw();
            }
            WindowEvent::Occluded(is_occluded) => {
                shown.is_occluded = is_occluded;
                shown.window.request_redraw();
            }
            WindowEvent::RedrawRequested => {
                if let Err(error) = shown.redraw(event_loop) {
                    self.fail(event_loop, error);
                }
            }
            // A redraw counts as a reason to repaint too; asking for one then would never end.
            _ if response.repaint => shown.window.request_redraw(),
            _ => {}
        }
        if let Some(shown) = self.shown.as_mut().filter(|shown| shown.view.closing) {
            let size = shown.window.inner_size();
            shown.view.remember([size.width, size.height]);
            event_loop.exit();
        }
    }

    fn new_events(&mut self, _: &ActiveEventLoop, cause: winit::event::StartCause) {
        if let (winit::event::StartCause::ResumeTimeReached { .. }, Some(shown)) = (cause, &self.shown) {
            shown.window.request_redraw();
        }
    }
}

impl App {
    fn fail(&mut self, event_loop: &ActiveEventLoop, error: ViewerError) {
        self.error = Some(error);
        event_loop.exit();
    }
}

/// Makes the error of a window that cannot be opened. winit puts the place in its own source before what happened; a
/// user needs only the latter.
fn no_window(error: &dyn std::fmt::Display) -> ViewerError {
    let message = one_line(&error.to_string());
    let what = match message.split_once(".rs:") {
        Some((_, rest)) => rest.split_once(": ").map_or(rest, |(_, what)| what),
        None => &message,
    };
    ViewerError::Window(what.trim_end_matches('.').into())
}
