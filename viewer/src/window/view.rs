//! What exists once the window does, drawn frame by frame: what the user works on, its pictures, and the controls.

use super::bricks::Bricks;
use super::canvas::Canvas;
use super::controls::{Controls, renderers_of};
use super::editing::document::{Document, Unsaved};
use super::files::free_name;
use super::keys::{follow_keys, show_help, undo_and_redo};
use super::light_handles::show_light_handles;
use super::mouse::{PictureArea, is_painting};
use super::panels::asked::{Asked, Export};
use super::panels::panel::Panel;
use super::panels::physiology::show_physiology;
use super::panels::status::Status;
use super::panels::unsaved::{Answer, Loss, UnsavedDialog};
use super::pictures::blit::Blit;
use super::pictures::pictures::Pictures;
use super::pictures::preparing::POLL;
use super::pictures::split::Split;
use super::settings::Settings;
use super::turntable::Turntable;
use crate::error::ViewerError;
use crate::gpu::results::reading::Reading;
use crate::gpu::scene_change::SceneChange;
use crate::scene::asset::SceneAsset;
use crate::scene::material::Body;
use crate::scene::scene::Scene;
use crate::window_params::WindowParams;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// Width of the panel in points.
const PANEL_WIDTH: f32 = 290.0;
/// Width of the panel of leaves.
const PHYSIOLOGY_WIDTH: f32 = 340.0;
/// Width below which a window has its panels under the picture, one at a time, points.
const NARROW: f32 = 640.0;
/// Share of a narrow window's height that a panel takes.
const NARROW_SHARE: f32 = 0.5;

/// Everything that exists once the window does.
pub(super) struct View {
    pub canvas: Canvas,
    /// Whether the window is to be closed after this frame.
    pub closing: bool,
    blit: Blit,
    document: Document,
    pictures: Pictures,
    controls: Controls,
    /// Width and height of the area that shows the picture, pixels.
    area: [u32; 2],
    /// Bricks of the scene's volumes.
    bricks: Bricks,
    /// The picture that is being saved.
    saving: Option<Reading>,
    /// Files that the host wants opened.
    handed_over: Vec<PathBuf>,
}

/// What a frame leaves to the window's host.
pub(super) struct Drawn {
    /// The pointer's shape, copied text and the like.
    pub platform: egui::PlatformOutput,
    /// Whether edits are unsaved.
    pub has_unsaved: bool,
    /// Time to the next frame, if nothing happens before; 0 for at once.
    pub repaint_in: Duration,
    /// Whether the pictures go on, which the next frame shows.
    pub goes_on: bool,
}

/// Result of a frame.
struct Frame {
    /// Width and height of the area beside the panels, pixels.
    size: [u32; 2],
    /// Whether the picture must begin anew.
    changed: bool,
}

impl View {
    /// Shows a scene on a canvas.
    ///
    /// # Errors
    /// [`ViewerError::NoAdapter`] and [`ViewerError::Gpu`].
    pub fn new(canvas: Canvas, scene: Scene, params: &WindowParams, settings: Settings) -> Result<View, ViewerError> {
        let gpu = &canvas.gpu;
        let blit = Blit::new(gpu, canvas.format())?;
        let (renderers, renderer) = renderers_of(gpu, params.backend, &settings)?;
        let panel = Panel::new(&scene, params.shade, renderer);
        let mut split = Split::new(settings.difference_gain);
        let document = Document::new(scene, settings.brush_radius);
        if let Some(asset) = &params.compare {
            split.compare_with(asset.clone(), &document.scene, document.at_hand());
        }
        Ok(View {
            pictures: Pictures::new(gpu, &document.scene, params.shade, params.target_ms, split)?,
            controls: Controls::new(panel, renderers, settings),
            closing: false,
            area: [1; 2],
            bricks: Bricks::new(params.volume_budget_mb),
            saving: None,
            handed_over: Vec::new(),
            canvas,
            blit,
            document,
        })
    }

    /// Closes the window after this frame, or asks first where edits are unsaved.
    pub fn close(&mut self) {
        self.lose(Loss::Close, self.document.unsaved());
    }

    /// Writes what the next run begins with, in a window of `size` pixels.
    pub fn remember(&mut self, size: [u32; 2]) {
        let settings = &mut self.controls.settings;
        settings.size = size;
        settings.renderer = Some(self.controls.panel.renderer.name().into());
        settings.brush_radius = self.document.editor.radius;
        settings.difference_gain = self.pictures.split.gain;
        settings.save();
    }

    /// Takes what the user did and draws a frame.
    ///
    /// # Errors
    /// What the driver reported.
    pub fn redraw(&mut self, input: egui::RawInput) -> Result<Drawn, ViewerError> {
        let renderer_before = self.controls.panel.renderer;
        let context = self.canvas.context.clone();
        let mut frame = Frame { size: [1, 1], changed: false };
        let mut output = context.run_ui(input, |ui| {
            let Frame { size, changed } = self.ui(ui);
            frame = Frame { size, changed: changed || frame.changed };
        });
        // Advance the pictures.
        let panel = &self.controls.panel;
        if panel.renderer != renderer_before {
            self.pictures.switch_renderer(&self.document);
        }
        let Frame { size, mut changed } = frame;
        changed |= self.follow_bricks(size);
        let panel = &self.controls.panel;
        self.pictures.resting.on = self.controls.settings.denoise;
        if changed {
            self.pictures.restart();
        }
        self.pictures.advance(&self.document, panel.renderer, &panel.shade, size);
        changed |= self.go_round();
        self.go_on_saving();
        // Show them.
        let platform = std::mem::take(&mut output.platform_output);
        let root = output.viewport_output.get(&egui::ViewportId::ROOT);
        let mut delay = root.map_or(Duration::MAX, |viewport| viewport.repaint_delay);
        let works = self.pictures.preparation().is_some() || self.pictures.resting.is_at_work();
        if works || self.bricks.waits(&self.document.scene) {
            delay = delay.min(POLL);
        }
        let View { canvas, blit, pictures, document, .. } = self;
        let stale =
            canvas.present(output, |gpu, pass| pictures.draw(gpu, pass, blit, document.scene.exposure_ev, size))?;
        let reads = self.saving.is_some() || self.controls.turntable.as_ref().is_some_and(|it| it.reading.is_some());
        let repaint_in = if stale || changed || reads { Duration::ZERO } else { delay };
        let goes_on = self.pictures.go_on(&self.document.scene);
        self.area = size;
        let has_unsaved = self.document.has_unsaved();
        Ok(Drawn { platform, has_unsaved, repaint_in, goes_on })
    }

    /// Takes bricks over that have been loaded for the camera. Returns whether the picture must begin anew.
    fn follow_bricks(&mut self, size: [u32; 2]) -> bool {
        let View { bricks, document, pictures, controls, .. } = self;
        match bricks.follow(&mut document.scene, size) {
            Ok(true) => pictures.update(&document.scene, &SceneChange::Bricks),
            Ok(false) => return false,
            Err(error) => {
                controls.message = Some(error.to_string());
                return false;
            }
        }
        true
    }

    /// Draws the panels and does what the user asks for.
    fn ui(&mut self, ui: &mut egui::Ui) -> Frame {
        let (at_hand, camera) = (self.document.at_hand(), self.document.scene.camera);
        let mut asked = self.show_panels(ui);
        let area = PictureArea::of(ui, self.canvas.size());
        self.edit(ui, &area, &mut asked);
        self.take_over(&mut asked, at_hand);
        let View { document, pictures, controls, .. } = self;
        area.move_camera(ui, document, &controls.settings, &mut controls.pivot);
        if !controls.asks() {
            follow_keys(ui, document, &mut pictures.split, controls, &mut asked);
        }
        if controls.settings.light_handles && !is_painting(ui, document) {
            asked.changed |= show_light_handles(ui, area.rect, &mut controls.panel.lights, &mut document.scene);
        }
        pictures.split.show_line(ui, area.rect, &document.scene);
        if controls.help {
            show_help(ui, area.rect);
        }
        if asked.choose {
            self.controls.choose_file();
        }
        asked.open = self.controls.show_open_dialog(ui).or(asked.open.take());
        self.take_files(ui, &area, &mut asked);
        self.do_the_rest(&mut asked);
        self.ask_about_unsaved(ui, &mut asked);
        Frame { size: area.size, changed: asked.changed || self.document.scene.camera != camera }
    }

    /// Draws the panels, from the window's right edge on.
    fn show_panels(&mut self, ui: &mut egui::Ui) -> Asked {
        let View { canvas, document, pictures, controls, bricks, .. } = self;
        let volumes = bricks.told();
        let panel = &mut controls.panel;
        controls.thumbnails.update(&canvas.context, &document.scene);
        let timer = pictures.timer_name(panel.renderer);
        let preparation = pictures.preparation();
        let Pictures { side, split, progress, resting, .. } = pictures;
        let status = Status {
            adapter: canvas.gpu.adapter_name(),
            renderers: &controls.renderers,
            progress,
            preparation: preparation.as_deref(),
            timer,
            picture: side.size().unwrap_or([0, 0]),
            filtered_samples: resting.shown().map(|(samples, _)| samples),
            max_components: panel.max_components,
            message: controls.message.as_deref(),
            volumes: volumes.as_deref(),
            at_hand: document.at_hand(),
        };
        let (settings, thumbnails) = (&mut controls.settings, &controls.thumbnails);
        let mut show = |ui: &mut egui::Ui| {
            let area = egui::ScrollArea::vertical();
            area.show(ui, |ui| panel.show(ui, document, split, settings, thumbnails, &status)).inner
        };
        if ui.available_width() < NARROW {
            let is_open = &mut controls.narrow_panel_is_open;
            let mut asked = show_below(ui, is_open, "controls", &mut show);
            let Document { scene, physiology, .. } = document;
            if !scene.leaves.is_empty() {
                let is_open = &mut controls.narrow_leaf_is_open;
                asked.leaf = show_below(ui, is_open, "leaf", |ui| {
                    egui::ScrollArea::vertical().show(ui, |ui| show_physiology(ui, physiology, scene)).inner
                });
            }
            return asked;
        }
        let side_panel = egui::Panel::right("panel").exact_size(PANEL_WIDTH).resizable(false);
        let mut asked = side_panel.show(ui, show).inner;
        let Document { scene, physiology, .. } = document;
        if !scene.leaves.is_empty() {
            let side_panel = egui::Panel::right("physiology").exact_size(PHYSIOLOGY_WIDTH).resizable(false);
            let shown = side_panel.show(ui, |ui| {
                egui::ScrollArea::vertical().show(ui, |ui| show_physiology(ui, physiology, scene)).inner
            });
            asked.leaf = shown.inner;
        }
        asked
    }

    /// Paints, takes steps back and does them again; ends the step that goes on when the mouse is up.
    fn edit(&mut self, ui: &egui::Ui, area: &PictureArea, asked: &mut Asked) {
        let document = &mut self.document;
        if let Some(asset) = area.paint(ui, document) {
            asked.edited = Some(asset);
        }
        let moved = !self.controls.asks() && undo_and_redo(ui, document, asked);
        if !moved && !ui.input(|input| input.pointer.any_down()) {
            document.editor.close(&document.scene);
            document.physiology.close(&document.scene);
        }
        document.leaf_at_hand = asked.leaf.is_some() || document.leaf_at_hand && asked.edited.is_none();
    }

    /// Shows what changed of assets, leaves, surroundings and skins; `at_hand` is what was at hand before.
    fn take_over(&mut self, asked: &mut Asked, at_hand: Body) {
        let View { document, pictures, .. } = self;
        let scene = &document.scene;
        if document.at_hand() != at_hand {
            // What another asset is compared with is what is at hand.
            pictures.split.reset(scene, document.at_hand());
            asked.changed |= pictures.split.on;
        }
        if let Some(asset) = asked.edited {
            pictures.update(scene, &SceneChange::Edits(asset));
        }
        if asked.illuminant {
            (0..scene.assets.len()).for_each(|asset| pictures.update(scene, &SceneChange::Shown(asset)));
        }
        if let Some(change) = &asked.leaf {
            pictures.update(scene, &SceneChange::Leaf { leaf: change.leaf, words: change.words.clone() });
            if change.plants {
                pictures.update(scene, &SceneChange::Instances);
            }
        }
        if asked.surroundings {
            pictures.update(scene, &SceneChange::Environment);
        }
        if asked.skins {
            pictures.update(scene, &SceneChange::Skins);
        }
        asked.changed |= asked.edited.is_some() || asked.leaf.is_some();
    }

    /// Opens files that are dropped or named in the panel; an asset covers what it is dropped on.
    fn take_files(&mut self, ui: &egui::Ui, area: &PictureArea, asked: &mut Asked) {
        let dropped: Vec<PathBuf> =
            ui.input(|input| input.raw.dropped_files.iter().map(|file| file.path().to_path_buf()).collect());
        let dropped = std::mem::take(&mut self.handed_over).into_iter().chain(dropped);
        let pointer = ui.input(|input| input.pointer.latest_pos()).filter(|_| asked.open.is_none());
        for path in dropped.chain(asked.open.take()) {
            let under = pointer.and_then(|at| area.pick(&self.document.scene, at)).map(|picked| picked.asset);
            let lost = self.document.lost_by_opening(&path, under.unwrap_or(self.document.editor.asset));
            self.lose(Loss::Open(path, under), lost);
            asked.changed = true;
        }
        if let Some(path) = asked.compare_with.take() {
            self.compare_with(&path);
            asked.changed = true;
        }
    }

    /// Writes pictures, saves edits and closes the window, where the user asks for it.
    fn do_the_rest(&mut self, asked: &mut Asked) {
        for export in asked.exports.drain(..) {
            match export {
                Export::Picture => self.save_picture(),
                Export::Turntable => self.controls.begin_turntable(),
            }
        }
        if asked.save {
            self.save_edits();
        }
        if asked.close {
            self.close();
        }
    }

    /// Goes on with what loses edits, or asks first where any are `unsaved`. A question that is being asked stays.
    fn lose(&mut self, loss: Loss, unsaved: Vec<Unsaved>) {
        if self.controls.dialog.is_some() {
            return;
        }
        if unsaved.is_empty() {
            self.go_on(loss);
        } else {
            self.controls.dialog = Some(UnsavedDialog::new(loss, unsaved));
        }
    }

    /// Asks what becomes of unsaved edits while that is a question, and follows the answer.
    fn ask_about_unsaved(&mut self, ui: &egui::Ui, asked: &mut Asked) {
        let Some(mut dialog) = self.controls.dialog.take() else { return };
        let answer = dialog.show(ui);
        match answer {
            None => self.controls.dialog = Some(dialog),
            Some(Answer::Cancel) => {}
            Some(Answer::Discard) => self.go_on(dialog.loss),
            Some(Answer::Save) => match self.document.save(&dialog.unsaved) {
                Ok(files) => {
                    self.controls.message = Some(format!("saved {files}"));
                    self.go_on(dialog.loss);
                }
                Err(error) => {
                    dialog.problem = Some(error.to_string());
                    self.controls.dialog = Some(dialog);
                }
            },
        }
        if answer.is_some() {
            asked.changed = true;
            ui.ctx().request_repaint();
        }
    }

    /// Does what loses edits.
    fn go_on(&mut self, loss: Loss) {
        match loss {
            Loss::Close => self.closing = true,
            Loss::Open(path, asset) => self.open(&path, asset),
        }
    }

    /// Saves all unsaved edits.
    fn save_edits(&mut self) {
        let unsaved = self.document.unsaved();
        self.controls.message = Some(match self.document.save(&unsaved) {
            Ok(_) if unsaved.is_empty() => "no edits to save".into(),
            Ok(files) => format!("saved {files}"),
            Err(error) => error.to_string(),
        });
    }

    /// Shows an asset in place of what is at hand in the split view.
    fn compare_with(&mut self, path: &Path) {
        let document = &self.document;
        self.controls.message = Some(match SceneAsset::load(path) {
            Ok(asset) => {
                self.pictures.split.compare_with(Arc::new(asset), &document.scene, document.at_hand());
                format!("comparing with {}", path.display())
            }
            Err(error) => error.to_string(),
        });
    }

    /// Takes in a file; `asset` is that which another one replaces.
    fn open(&mut self, path: &Path, asset: Option<usize>) {
        let is_asset = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("spmm"));
        if is_asset && self.document.scene.assets.is_empty() {
            // Nothing here could carry it.
            self.compare_with(path);
            return;
        }
        let asset = asset.unwrap_or(self.document.editor.asset);
        self.bricks.restart();
        self.controls.message = Some(match self.document.open(path, asset) {
            Ok(()) => {
                self.controls.switch_scene(&self.document.scene);
                self.pictures.switch_scene(&self.document);
                format!("opened {}", path.display())
            }
            Err(error) => error.to_string(),
        });
    }

    /// Begins to save the picture, unless one is being saved.
    fn save_picture(&mut self) {
        if self.saving.is_some() {
            return;
        }
        match self.pictures.begin_read_shown() {
            Ok(reading) => self.saving = Some(reading),
            Err(error) => self.controls.message = Some(error.to_string()),
        }
    }

    /// Writes the picture that is being saved, once it is there.
    fn go_on_saving(&mut self) {
        let Some(read) = self.saving.as_mut().and_then(Reading::take) else { return };
        self.saving = None;
        let path = free_name("btf-view", ".png");
        let exposure_ev = self.document.scene.exposure_ev;
        let written = read.and_then(|picture| picture.write_png(&path, exposure_ev));
        self.controls.message = Some(match written {
            Ok(()) => format!("saved {}", path.display()),
            Err(error) => error.to_string(),
        });
    }

    /// Writes a turntable's picture where one is finished, and turns the camera on; returns `true` if it did.
    fn go_round(&mut self) -> bool {
        let View { document, pictures, controls, .. } = self;
        let Some(turntable) = &mut controls.turntable else { return false };
        if turntable.reading.is_none() && pictures.have(Turntable::SAMPLES, &document.scene) {
            match pictures.begin_read() {
                Ok(reading) => turntable.reading = Some(reading),
                Err(error) => {
                    controls.message = Some(error.to_string());
                    controls.turntable = None;
                    return false;
                }
            }
        }
        let Some(read) = turntable.reading.as_mut().and_then(Reading::take) else { return false };
        let Some(mut turntable) = controls.turntable.take() else { return false };
        turntable.reading = None;
        let exposure_ev = document.scene.exposure_ev;
        let written = read.and_then(|picture| turntable.write(&picture, exposure_ev));
        controls.message = Some(match written {
            Ok(last) => {
                document.scene.camera.orbit(std::f32::consts::TAU / Turntable::PICTURES as f32, 0.0);
                pictures.restart();
                let told = format!(
                    "turntable: {} of {} in {}",
                    turntable.done,
                    Turntable::PICTURES,
                    turntable.place.display()
                );
                controls.turntable = (!last).then_some(turntable);
                told
            }
            Err(error) => error.to_string(),
        });
        true
    }
}

/// Draws a panel under the picture while it is open, with a button for that. What the panel keeps going, as the wind, goes on
/// while it is closed.
fn show_below<T>(
    ui: &mut egui::Ui,
    is_open: &mut bool,
    name: &'static str,
    show: impl FnOnce(&mut egui::Ui) -> T,
) -> T {
    egui::Panel::bottom(egui::Id::unique((name, "button"))).show(ui, |ui| {
        *is_open ^= ui.selectable_label(*is_open, name).clicked();
    });
    if *is_open {
        let height = NARROW_SHARE * ui.available_height();
        return egui::Panel::bottom(name).exact_size(height).resizable(false).show(ui, show).inner;
    }
    let beside = egui::Rect::from_min_size(egui::pos2(0.0, -1e4), egui::vec2(PANEL_WIDTH, 1e3));
    show(&mut ui.new_child(egui::UiBuilder::new().max_rect(beside).invisible()))
}

/// What the host of a page needs.
#[cfg(target_arch = "wasm32")]
impl View {
    /// Shows another scene; unsaved edits are lost.
    pub fn show(&mut self, scene: Scene) {
        self.document = Document::new(scene, self.document.editor.radius);
        self.bricks.restart();
        self.controls.switch_scene(&self.document.scene);
        self.pictures.switch_scene(&self.document);
        self.pictures.restart();
        self.controls.message = None;
    }

    /// Has a file opened in the next frame, as if it was dropped.
    pub fn drop_file(&mut self, path: PathBuf) {
        self.handed_over.push(path);
    }

    /// Has the host show its own choice of files.
    pub fn have_host_choose_files(&mut self) {
        self.controls.host_chooses_files = true;
    }

    /// Tells, once, whether the user wants to choose a file.
    pub fn takes_file_choice(&mut self) -> bool {
        std::mem::take(&mut self.controls.file_wanted)
    }

    /// Goes on with the picture; returns `true` if a frame would show something new.
    pub fn advance(&mut self) -> bool {
        let View { document, controls, pictures, area, .. } = self;
        let (before, prepared) = (pictures.progress.samples, pictures.preparation().is_some());
        pictures.advance(document, controls.panel.renderer, &controls.panel.shade, *area);
        pictures.progress.samples != before || prepared != pictures.preparation().is_some()
    }

    /// Tells whether a frame would show nothing new, because the GPU is at work.
    pub fn is_waiting(&mut self) -> bool {
        self.pictures.are_at_work()
    }

    /// Returns how the scene is seen, against how it was `opened`.
    pub fn linked(&self, opened: &Scene) -> super::link::LinkedView {
        let (scene, shade) = (&self.document.scene, &self.controls.panel.shade);
        super::link::LinkedView::of(scene, opened, shade, &self.pictures.split)
    }

    /// Has the scene seen as a link tells.
    pub fn follow(&mut self, link: &super::link::LinkedView) {
        let View { document, controls, pictures, .. } = self;
        link.apply(&mut document.scene, &mut controls.panel, &mut pictures.split);
        pictures.split.reset(&document.scene, document.at_hand());
        let scene = &document.scene;
        (0..scene.assets.len()).for_each(|asset| pictures.update(scene, &SceneChange::Shown(asset)));
        pictures.restart();
    }

    /// Returns the samples per pixel that the picture has.
    pub fn samples(&self) -> u32 {
        if self.pictures.preparation().is_some() { 0 } else { self.pictures.progress.samples }
    }

    /// Returns why the renderer stopped, or the message of the latest opening or saving.
    pub fn message(&self) -> Option<String> {
        self.pictures.progress.problem.clone().or_else(|| self.controls.message.clone())
    }
}
