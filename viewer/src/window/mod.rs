//! The window: the camera under the mouse, a panel, progressive rendering.

mod blit;
mod canvas;
mod editor;
mod editor_panel;
mod files;
mod history;
mod light_handles;
mod outdoors;
mod panel;
mod physiology;
mod physiology_panel;
mod settings;
mod side;
mod spectrum_plot;
mod split;
mod thumbnails;
mod wind_panel;

use crate::cpu::pick::{Picked, pick};
use crate::error::ViewerError;
use crate::gpu::backend::BackendChoice;
use crate::gpu::backend::GpuTracer;
use crate::gpu::frame::FrameRequest;
use crate::gpu::scene_change::SceneChange;
use crate::gpu::timer::{GpuTimer, PassTimes};
use crate::options::{RenderMode, ShadeOptions};
use crate::picture::Picture;
use crate::render::governor::{Governor, Spending};
use crate::scene::asset::SceneAsset;
use crate::scene::material::Body;
use crate::scene::scene::{Ambient, Scene};
use blit::Blit;
pub(crate) use blit::GpuBlit;
use canvas::Canvas;
use editor::{Editor, Tool};
use files::{Turntable, free_name, open_file};
use light_handles::show_light_handles;
use panel::{Asked, Panel, Renderer, Status};
use physiology::{LeafChange, Physiology};
use physiology_panel::show_physiology;
use settings::Settings;
use side::Side;
use split::{Against, Split};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;
use thumbnails::Thumbnails;
use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::window::WindowId;

/// Samples per pixel after which a picture that nobody touches is left alone.
const MAX_SAMPLES: u32 = 64;
/// The same where directions or lights are drawn at random.
const MAX_RANDOM_SAMPLES: u32 = 4096;
/// The CPU renders a picture of at most so many pixels and the window shows it enlarged, to stay usable.
const CPU_PIXELS: u32 = 200 * 200;
/// Width of the panel in points.
const PANEL_WIDTH: f32 = 290.0;
/// Width of the panel of leaves.
const PHYSIOLOGY_WIDTH: f32 = 340.0;
/// Radians that a drag across the window's shorter side turns.
const TURN_PER_SIDE: f32 = 4.0;
/// Weight of the newest frame in the shown frame time.
const FRAME_TIME_WEIGHT: f64 = 0.2;

/// Radii of the scene that the eye flies in a second.
const RADII_PER_SECOND: f32 = 1.0;
/// Longest time that a key moves the eye in one frame, seconds: slow frames do not make it jump.
const LONGEST_FLIGHT_S: f32 = 0.1;
/// Keys of the window, for its help.
const KEYS: &str = "drag: turn; Shift or right drag: move; wheel: nearer\n\
    W A S D, Q E: fly; F: drags look around instead of turning\n\
    L: lights' handles, which drags move\n\
    C: split view, whose line drags move; X: difference\n\
    P: picture as PNG; T: turntable\n\
    B: the wind blows or stands still\n\
    Ctrl+Z, Ctrl+Shift+Z: edits back and forth\n\
    drop .spmm on what it is to cover, or to compare a leaf with; .obj .gltf .glb, .hdr .exr, .toml anywhere\n\
    H or F1: this";

/// What the window starts with.
#[derive(Debug, Clone)]
pub struct WindowParams {
    /// Width and height, pixels; the last run's where there is none.
    pub size: Option<[u32; 2]>,
    /// Which renderer; the panel switches it.
    pub backend: BackendChoice,
    /// Part of the adapter's name, where there are several.
    pub adapter: Option<String>,
    /// What costs time and changes accuracy; the panel changes it.
    pub shade: ShadeOptions,
    /// Milliseconds that a frame may take; components, lobes and lights are what is saved.
    pub target_ms: Option<f64>,
    /// What the split view shows in place of the scene's first leaf, or first asset.
    pub compare: Option<Arc<SceneAsset>>,
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
    let message = crate::gpu::device::one_line(&error.to_string());
    let what = match message.split_once(".rs:") {
        Some((_, rest)) => rest.split_once(": ").map_or(rest, |(_, what)| what),
        None => &message,
    };
    ViewerError::Window(what.trim_end_matches('.').into())
}

/// A leaf or an asset.
fn at_hand(is_leaf: bool, leaf: usize, asset: usize) -> Body {
    if is_leaf { Body::Leaf(leaf) } else { Body::Asset(asset) }
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
    canvas: Canvas,
    blit: Blit,
    timer: Option<GpuTimer>,
    renderers: Vec<Renderer>,
    panel: Panel,
    editor: Editor,
    physiology: Physiology,
    /// Whether the leaf was changed later than assets were.
    leaf_at_hand: bool,
    /// The panel's settings within the budget, of the picture at hand.
    governed: ShadeOptions,
    scene: Scene,
    side: Side,
    split: Split,
    thumbnails: Thumbnails,
    turntable: Option<Turntable>,
    settings: Settings,
    help: bool,
    /// What saving or opening said.
    message: Option<String>,
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
            WindowEvent::CloseRequested => {
                view.remember();
                event_loop.exit();
            }
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

impl View {
    fn new(event_loop: &ActiveEventLoop, scene: Scene, params: &WindowParams) -> Result<View, ViewerError> {
        let settings = Settings::load();
        let size = params.size.unwrap_or(settings.size);
        let canvas = Canvas::open(event_loop, size, params.adapter.as_deref())?;
        let gpu = &canvas.gpu;
        let blit = Blit::new(gpu, canvas.format())?;
        let mut renderers = vec![Renderer::Gpu(GpuTracer::Bvh), Renderer::Cpu];
        if gpu.has_ray_query() {
            renderers.insert(0, Renderer::Gpu(GpuTracer::RayQuery));
        }
        let renderer = match params.backend {
            BackendChoice::Auto => {
                let last = renderers.iter().find(|renderer| settings.renderer.as_deref() == Some(renderer.name()));
                last.copied().unwrap_or(Renderer::Gpu(gpu.best_tracer()))
            }
            BackendChoice::Cpu => Renderer::Cpu,
            BackendChoice::Gpu(tracer) => {
                gpu.require(tracer)?;
                Renderer::Gpu(tracer)
            }
        };
        let governor = params.target_ms.map(|target_ms| Governor::new(target_ms, Spending::all_of(&scene)));
        let panel = Panel::new(&scene, params.shade, renderer);
        let timer = GpuTimer::new(gpu);
        let mut split = Split::new(settings.difference_gain);
        let leaf_at_hand = !scene.leaves.is_empty();
        if let Some(asset) = &params.compare {
            split.compare_with(asset.clone(), &scene, at_hand(leaf_at_hand, 0, 0));
        }
        Ok(View {
            canvas,
            blit,
            timer,
            renderers,
            governed: params.shade,
            editor: Editor::new(&scene, settings.brush_radius),
            panel,
            physiology: Physiology::new(&scene),
            leaf_at_hand,
            thumbnails: Thumbnails::default(),
            split,
            settings,
            help: false,
            message: None,
            turntable: None,
            scene,
            side: Side::default(),
            samples: 0,
            frame_ms: None,
            passes: None,
            governor,
            problem: None,
            occluded: false,
        })
    }

    /// Writes what the next run begins with.
    fn remember(&mut self) {
        let size = self.canvas.window.inner_size();
        self.settings.size = [size.width, size.height];
        self.settings.renderer = Some(self.panel.renderer.name().into());
        self.settings.brush_radius = self.editor.radius;
        self.settings.difference_gain = self.split.gain;
        self.settings.save();
    }

    fn hidden(&self) -> bool {
        let size = self.canvas.window.inner_size();
        self.occluded || size.width == 0 || size.height == 0
    }

    fn redraw(&mut self, event_loop: &ActiveEventLoop) -> Result<(), ViewerError> {
        if self.hidden() {
            return Ok(());
        }
        let input = self.canvas.input.take_egui_input(&self.canvas.window);
        let renderer_before = self.panel.renderer;
        let context = self.canvas.context.clone();
        let (mut changed, mut view_size) = (false, [1, 1]);
        let mut output = context.run_ui(input, |ui| {
            let (touched, size) = self.ui(ui);
            changed |= touched;
            view_size = size;
        });
        if self.panel.renderer != renderer_before {
            // The other renderer uploads the scene anew; its first frames compile.
            (self.side, self.frame_ms, self.passes, self.problem) = (Side::default(), None, None, None);
            self.split.reset(&self.scene, self.at_hand());
        }
        let picture_size = self.picture_size(view_size);
        if changed || self.side.size() != Some(picture_size) {
            self.samples = 0;
        }
        if self.samples < self.most_samples()
            && let Err(error) = self.add_sample(picture_size)
        {
            // A renderer that fails leaves the window and its panel alive, with the others to switch to.
            self.problem = Some(error.to_string());
            self.samples = MAX_RANDOM_SAMPLES;
        }
        changed |= self.go_round();
        self.canvas.input.handle_platform_output(&self.canvas.window, std::mem::take(&mut output.platform_output));
        let root = output.viewport_output.get(&egui::ViewportId::ROOT);
        let delay = root.map_or(std::time::Duration::MAX, |viewport| viewport.repaint_delay);
        self.present(output, view_size)?;

        if self.samples < self.most_samples() || changed || delay.is_zero() {
            self.canvas.window.request_redraw();
        }
        // A far deadline overflows; then nothing but an event wakes us.
        event_loop
            .set_control_flow(Instant::now().checked_add(delay).map_or(ControlFlow::Wait, ControlFlow::WaitUntil));
        Ok(())
    }

    /// Panel and camera; whether the picture must begin anew, and the size of the area beside the panel in pixels.
    fn ui(&mut self, ui: &mut egui::Ui) -> (bool, [u32; 2]) {
        let status = Status {
            adapter: self.canvas.gpu.adapter_name(),
            renderers: &self.renderers,
            frame_ms: self.frame_ms,
            passes: self.passes,
            timer: self.timer_name(),
            samples: self.samples,
            picture: self.side.size().unwrap_or([0, 0]),
            problem: self.problem.as_deref(),
            governor: self.governor.as_ref(),
            message: self.message.as_deref(),
            at_hand: self.at_hand(),
        };
        self.thumbnails.update(&self.canvas.context, &self.scene);
        let at_hand_before = self.at_hand();
        let (panel, scene, editor) = (&mut self.panel, &mut self.scene, &mut self.editor);
        let (split, settings, thumbnails) = (&mut self.split, &mut self.settings, &self.thumbnails);
        let Asked { mut changed, mut edited, surroundings, skins, compare, compare_with, export, open } =
            egui::Panel::right("panel")
                .exact_size(PANEL_WIDTH)
                .resizable(false)
                .show(ui, |ui| {
                    egui::ScrollArea::vertical()
                        .show(ui, |ui| panel.show(ui, scene, editor, split, settings, thumbnails, &status))
                        .inner
                })
                .inner;
        let physiology = &mut self.physiology;
        let mut leaf_change = None;
        if !scene.leaves.is_empty() {
            let side_panel = egui::Panel::right("physiology").exact_size(PHYSIOLOGY_WIDTH).resizable(false);
            let shown = side_panel.show(ui, |ui| {
                egui::ScrollArea::vertical().show(ui, |ui| show_physiology(ui, physiology, scene)).inner
            });
            leaf_change = shown.inner;
        }
        let camera_before = scene.camera;
        let area = ui.available_rect_before_wrap();
        let response = ui.allocate_rect(area, egui::Sense::click_and_drag());
        let side = area.width().min(area.height()).max(1.0);
        let drag = response.drag_delta() / side;
        let pixels = |points: f32| ((points * ui.pixels_per_point()).round() as u32).max(1);
        let [width, height] = self.canvas.size();
        let size = [pixels(area.width()).min(width), pixels(area.height()).min(height)];
        let painting = editor.tool != Tool::Look && !ui.input(|input| input.modifiers.shift);
        let pressed = response.is_pointer_button_down_on() && ui.input(|input| input.pointer.primary_down());
        let scale = ui.pixels_per_point();
        let pick_at = |scene: &Scene, at: egui::Pos2| {
            pick(scene, size, [(at.x - area.min.x) * scale, (at.y - area.min.y) * scale])
        };
        let touched = response.interact_pointer_pos().filter(|_| painting && pressed).and_then(|at| pick_at(scene, at));
        if let Some(Picked { asset, texel, .. }) = touched
            && editor.touch(scene, asset, texel)
        {
            edited = Some(asset);
        }
        // The keys' own modifiers: when a frame is slow they are up again at its end.
        let typing = self.canvas.context.egui_wants_keyboard_input();
        let [redo, undo] = ui.input_mut(|input| {
            if typing {
                return [false; 2];
            }
            let command = egui::Modifiers::COMMAND;
            [command | egui::Modifiers::SHIFT, command].map(|keys| input.consume_key(keys, egui::Key::Z))
        });
        match (undo, redo, self.leaf_at_hand) {
            (true, _, true) => leaf_change = physiology.undo(scene).or(leaf_change),
            (true, _, false) => edited = editor.undo(scene).or(edited),
            (_, true, true) => leaf_change = physiology.redo(scene).or(leaf_change),
            (_, true, false) => edited = editor.redo(scene).or(edited),
            _ if ui.input(|input| input.pointer.any_down()) => {}
            _ => {
                editor.close(scene);
                physiology.close(scene);
            }
        }
        self.leaf_at_hand = leaf_change.is_some() || self.leaf_at_hand && edited.is_none();
        if self.at_hand() != at_hand_before {
            // What another asset is compared with is what is at hand.
            self.split.reset(&self.scene, self.at_hand());
            changed |= self.split.on;
        }
        if let Some(asset) = edited {
            changed = true;
            self.side.update(&self.scene, &SceneChange::Edits(asset));
            self.split.update(&self.scene, &SceneChange::Edits(asset));
        }
        if let Some(change) = leaf_change {
            changed = true;
            self.take_over(&change);
        }
        if surroundings {
            self.side.update(&self.scene, &SceneChange::Environment);
            self.split.update(&self.scene, &SceneChange::Environment);
        }
        if skins {
            self.side.update(&self.scene, &SceneChange::Skins);
            self.split.update(&self.scene, &SceneChange::Skins);
        }
        let moving = response.dragged_by(egui::PointerButton::Secondary)
            || response.dragged_by(egui::PointerButton::Middle)
            || ui.input(|input| input.modifiers.shift);
        if moving {
            self.scene.camera.pan(drag.x, -drag.y);
        } else if response.dragged() && !painting {
            let [x, y] = [drag.x, drag.y].map(|x| x * TURN_PER_SIDE);
            match self.settings.fly {
                true => self.scene.camera.look(x * 0.5, -y * 0.5),
                false => self.scene.camera.orbit(-x, y),
            }
        }
        if response.hovered() {
            let scroll = ui.input(|input| input.smooth_scroll_delta().y);
            if scroll != 0.0 {
                self.scene.camera.zoom((-scroll * 0.003).exp());
            }
        }
        if !typing {
            changed |= self.keys(ui);
        }
        if self.settings.light_handles && !painting {
            changed |= show_light_handles(ui, area, &mut self.panel, &mut self.scene);
        }
        changed |= compare;
        self.split.show_line(ui, area, &self.scene);
        if self.help {
            egui::Window::new("keys").collapsible(false).default_pos(area.min + egui::vec2(20.0, 20.0)).show(
                ui.ctx(),
                |ui| {
                    ui.label(KEYS);
                },
            );
        }
        let dropped: Vec<_> =
            ui.input(|input| input.raw.dropped_files.iter().map(|file| file.path().to_path_buf()).collect());
        let pointer = ui.input(|input| input.pointer.latest_pos());
        for path in dropped.iter().chain(&open) {
            // An asset covers what it is dropped on.
            let under = pointer.filter(|_| open.is_none()).and_then(|at| pick_at(&self.scene, at));
            self.open(path, under.map(|picked| picked.asset));
            changed = true;
        }
        if let Some(path) = compare_with {
            self.compare_with(&path);
            changed = true;
        }
        match export {
            Some(panel::Export::Picture) => self.save_picture(),
            Some(panel::Export::Turntable) => self.begin_turntable(),
            None => {}
        }
        changed |= self.scene.camera != camera_before;
        (changed, size)
    }

    /// What split views show something else in place of.
    fn at_hand(&self) -> Body {
        at_hand(self.leaf_at_hand, self.physiology.leaf, self.editor.asset)
    }

    /// Shows a leaf as it is after a change.
    fn take_over(&mut self, change: &LeafChange) {
        let leaf = SceneChange::Leaf { leaf: change.leaf, words: change.words.clone() };
        for change in [Some(leaf), change.plants.then_some(SceneChange::Instances)].into_iter().flatten() {
            self.side.update(&self.scene, &change);
            self.split.update(&self.scene, &change);
        }
    }

    /// Shows an asset in place of what is at hand in the split view.
    fn compare_with(&mut self, path: &Path) {
        self.message = Some(match SceneAsset::load(path) {
            Ok(asset) => {
                self.split.compare_with(Arc::new(asset), &self.scene, self.at_hand());
                format!("comparing with {}", path.display())
            }
            Err(error) => error.to_string(),
        });
    }

    /// What keys ask for; `true` if the picture must begin anew.
    fn keys(&mut self, ui: &egui::Ui) -> bool {
        use egui::Key;
        let pressed = |wanted: Key| {
            let is = |event: &egui::Event| {
                matches!(event, egui::Event::Key { key, pressed: true, repeat: false, modifiers, .. }
                    if *key == wanted && !modifiers.command)
            };
            ui.input(|input| input.events.iter().any(is))
        };
        let down = |key| ui.input(|input| f32::from(u8::from(input.key_down(key) && !input.modifiers.command)));
        let way = [down(Key::D) - down(Key::A), down(Key::E) - down(Key::Q), down(Key::W) - down(Key::S)];
        if way != [0.0; 3] {
            let seconds = ui.input(|input| input.stable_dt).min(LONGEST_FLIGHT_S);
            let step = seconds * RADII_PER_SECOND * self.scene.geometry.bounding_sphere().1;
            self.scene.camera.fly(way.map(|x| x * step));
            ui.ctx().request_repaint();
        }
        if pressed(Key::F) {
            self.settings.fly = !self.settings.fly;
        }
        if pressed(Key::L) {
            self.settings.light_handles = !self.settings.light_handles;
        }
        if pressed(Key::H) || pressed(Key::F1) {
            self.help = !self.help;
        }
        if pressed(Key::P) {
            self.save_picture();
        }
        if pressed(Key::T) {
            self.begin_turntable();
        }
        if pressed(Key::B) {
            self.panel.wind.plays = !self.panel.wind.plays;
            ui.ctx().request_repaint();
        }
        if pressed(Key::X) {
            self.split.difference = !self.split.difference;
        }
        let split = pressed(Key::C);
        self.split.on ^= split;
        split
    }

    /// Takes in a file; `asset` is that which another one replaces.
    fn open(&mut self, path: &Path, asset: Option<usize>) {
        let is_asset = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("spmm"));
        if is_asset && self.scene.assets.is_empty() {
            // Nothing here could carry it.
            self.compare_with(path);
            return;
        }
        let asset = asset.unwrap_or(self.editor.asset);
        self.message = Some(match open_file(&mut self.scene, asset, path) {
            Ok(()) => {
                self.side = Side::default();
                self.panel = Panel::new(&self.scene, self.panel.shade, self.panel.renderer);
                self.editor = Editor::new(&self.scene, self.editor.radius);
                self.physiology = Physiology::new(&self.scene);
                self.leaf_at_hand = !self.scene.leaves.is_empty();
                self.split.reset(&self.scene, self.at_hand());
                self.governor =
                    self.governor.as_ref().map(|it| Governor::new(it.budget_ms(), Spending::all_of(&self.scene)));
                (self.problem, self.thumbnails) = (None, Thumbnails::default());
                format!("opened {}", path.display())
            }
            Err(error) => error.to_string(),
        });
    }

    /// The picture as it is.
    fn picture(&self) -> Result<Picture, ViewerError> {
        let [width, height] = self.side.size().unwrap_or([0, 0]);
        Ok(Picture { width, height, radiance: self.side.radiance()? })
    }

    fn save_picture(&mut self) {
        let path = free_name("btf-view", ".png");
        let written = self.picture().and_then(|picture| picture.write_png(&path, self.scene.exposure_ev));
        self.message = Some(match written {
            Ok(()) => format!("saved {}", path.display()),
            Err(error) => error.to_string(),
        });
    }

    fn begin_turntable(&mut self) {
        if self.turntable.is_some() {
            return;
        }
        match Turntable::new() {
            Ok(turntable) => {
                // Its pictures are of one moment.
                self.panel.wind.plays = false;
                self.turntable = Some(turntable);
            }
            Err(error) => self.message = Some(error.to_string()),
        }
    }

    /// Writes a turntable's picture where one is finished, and turns the camera on.
    fn go_round(&mut self) -> bool {
        let ready = self.samples >= Turntable::SAMPLES.min(self.most_samples());
        let Some(mut turntable) = self.turntable.take_if(|_| ready) else { return false };
        let written = self.picture().and_then(|picture| turntable.write(&picture, self.scene.exposure_ev));
        self.message = Some(match written {
            Ok(last) => {
                self.scene.camera.orbit(std::f32::consts::TAU / Turntable::PICTURES as f32, 0.0);
                self.samples = 0;
                let told = format!(
                    "turntable: {} of {} in {}",
                    turntable.done,
                    Turntable::PICTURES,
                    turntable.folder.display()
                );
                self.turntable = (!last).then_some(turntable);
                told
            }
            Err(error) => error.to_string(),
        });
        true
    }

    fn most_samples(&self) -> u32 {
        let shade = &self.governed;
        let drawn = (shade.light_samples as usize) < self.scene.lights.len();
        let random = shade.mode == RenderMode::Path
            || (self.split.on && self.split.against == Against::Paths)
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

    fn add_sample(&mut self, size: [u32; 2]) -> Result<(), ViewerError> {
        // Settings change with the picture only, so that its samples are alike.
        if self.samples == 0 {
            let lights = self.scene.lights.len() as u32;
            self.governor.iter_mut().for_each(|governor| governor.set_lights(lights));
            self.governed = self.governor.as_ref().map_or(self.panel.shade, |it| it.settings(&self.panel.shade));
        }
        let (shade, renderer) = (self.governed, self.panel.renderer);
        let request = FrameRequest { scene: &self.scene, size, options: shade, sample: self.samples };
        let side::Took { ms, passes, first } =
            self.side.add_sample(&self.canvas.gpu, renderer, &request, self.timer.as_mut())?;
        self.passes = passes;
        if self.split.on {
            let options = self.split.against.shade(&shade);
            let at_hand = self.at_hand();
            let (side, scene) = self.split.scene(&self.scene, at_hand);
            let request = FrameRequest { scene, size, options, sample: self.samples };
            side.add_sample(&self.canvas.gpu, renderer, &request, None)?;
        }
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

    /// Shows picture and panel.
    fn present(&mut self, output: egui::FullOutput, view: [u32; 2]) -> Result<(), ViewerError> {
        let View { canvas, blit, side, split, scene, .. } = self;
        canvas.present(output, |gpu, pass| {
            let Some(size) = side.size() else { return Ok(()) };
            let (own, other) = (side.bands(), split.side.bands());
            // The other picture may still be of another size.
            let compared = split.on && split.side.size() == Some(size) && own.len() == other.len();
            pass.set_viewport(0.0, 0.0, view[0] as f32, view[1] as f32, 0.0, 1.0);
            let gain = scene.exposure_ev.exp2();
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
        })
    }
}
