//! The window: the camera under the mouse, panels, progressive rendering, and edits that are saved before they are
//! lost.

mod blit;
mod canvas;
mod controls;
mod cpu_canvas;
mod editing;
mod files;
mod folder;
mod keys;
mod light_handles;
mod mouse;
mod panels;
mod pictures;
mod preparing;
mod pressed;
mod progress;
mod renderer;
mod settings;
mod side;
mod split;
mod stand_in;
mod view;
mod zoom;

use crate::error::ViewerError;
use crate::scene::scene::Scene;
use crate::window_params::WindowParams;
#[cfg(test)]
pub(crate) use blit::GpuBlit;
use canvas::no_window;
use view::View;
use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::window::WindowId;

/// Opens a window and returns when the user closes it, which asks where edits are unsaved. Needs an adapter even for
/// the CPU renderer, to show its picture.
///
/// # Errors
/// [`ViewerError::Window`] where there is no display, [`ViewerError::NoAdapter`], [`ViewerError::Gpu`].
pub fn run_window(scene: Scene, params: WindowParams) -> Result<(), ViewerError> {
    let event_loop = EventLoop::new().map_err(|error| no_window(&error))?;
    event_loop.set_control_flow(ControlFlow::Wait);
    let mut app = App { scene: Some(scene), params, view: None, error: None };
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
    view: Option<View>,
    error: Option<ViewerError>,
}

impl ApplicationHandler for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        let Some(scene) = self.scene.take() else { return };
        match View::new(event_loop, scene, &self.params) {
            Ok(view) => {
                view.canvas.window.request_redraw();
                self.view = Some(view);
            }
            Err(error) => self.fail(event_loop, error),
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(view) = &mut self.view else { return };
        let response = view.canvas.input.on_window_event(&view.canvas.window, &event);
        match event {
            WindowEvent::CloseRequested => view.close(),
            WindowEvent::Resized(size) => view.canvas.resize(size.width, size.height),
            WindowEvent::Occluded(occluded) => {
                view.occluded = occluded;
                view.canvas.window.request_redraw();
            }
            WindowEvent::RedrawRequested => {
                if let Err(error) = view.redraw(event_loop) {
                    self.fail(event_loop, error);
                }
            }
            // A redraw counts as a reason to repaint too; asking for one then would never end.
            _ if response.repaint => view.canvas.window.request_redraw(),
            _ => {}
        }
        if let Some(view) = self.view.as_mut().filter(|view| view.closing) {
            view.remember();
            event_loop.exit();
        }
    }

    fn new_events(&mut self, _: &ActiveEventLoop, cause: winit::event::StartCause) {
        if let (winit::event::StartCause::ResumeTimeReached { .. }, Some(view)) = (cause, &self.view) {
            view.canvas.window.request_redraw();
        }
    }
}

impl App {
    fn fail(&mut self, event_loop: &ActiveEventLoop, error: ViewerError) {
        self.error = Some(error);
        event_loop.exit();
    }
}
