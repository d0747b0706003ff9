//! What the mouse and fingers do on the picture: they turn and move the camera, set what that turns about, or paint.

use super::editing::document::Document;
use super::editing::editor::Tool;
use super::settings::Settings;
use super::zoom::zoom;
use crate::cpu::pick::{Picked, pick, pick_surface};
use crate::scene::scene::Scene;
use glam::Vec3;

/// Radians that a drag across the window's shorter side turns.
const TURN_PER_SIDE: f32 = 4.0;
/// How much nearer the wheel brings the eye: the exponent for a point of scrolling. A click of a wheel has 40 to 50.
const ZOOM_PER_POINT: f32 = 0.003;

/// Radius of the ring that marks what drags turn about, points.
const PIVOT_RADIUS: f32 = 5.0;

/// The area of the window that shows the picture.
pub(super) struct PictureArea {
    /// The area in points.
    pub rect: egui::Rect,
    /// Width and height, pixels.
    pub size: [u32; 2],
    response: egui::Response,
    pixels_per_point: f32,
}

impl PictureArea {
    /// Takes what the panels leave of a window of `window` pixels.
    pub fn of(ui: &mut egui::Ui, window: [u32; 2]) -> PictureArea {
        let rect = ui.available_rect_before_wrap();
        let response = ui.allocate_rect(rect, egui::Sense::click_and_drag());
        let pixels_per_point = ui.pixels_per_point();
        let pixels = |points: f32| ((points * pixels_per_point).round() as u32).max(1);
        let size = [pixels(rect.width()).min(window[0]), pixels(rect.height()).min(window[1])];
        PictureArea { rect, size, response, pixels_per_point }
    }

    /// Returns what is seen at a place of the window in points; `None` where that is no asset.
    pub fn pick(&self, scene: &Scene, at: egui::Pos2) -> Option<Picked> {
        pick(scene, self.size, self.pixel_at(at))
    }

    /// Returns where a place of the window in points is in the picture, pixels.
    fn pixel_at(&self, at: egui::Pos2) -> [f32; 2] {
        [at.x - self.rect.min.x, at.y - self.rect.min.y].map(|points| points * self.pixels_per_point)
    }

    /// Uses the tool at hand where the mouse is pressed on an asset; returns the asset that changed.
    pub fn paint(&self, ui: &egui::Ui, document: &mut Document) -> Option<usize> {
        let pressed = self.response.is_pointer_button_down_on() && ui.input(|input| input.pointer.primary_down());
        let at = self.response.interact_pointer_pos().filter(|_| pressed && is_painting(ui, document))?;
        let Picked { asset, texel, .. } = self.pick(&document.scene, at)?;
        document.editor.touch(&mut document.scene, asset, texel).then_some(asset)
    }

    /// Turns, moves and zooms the camera as drags and the wheel ask for. Drags turn it about `pivot`, which a double
    /// click sets, or about its target.
    pub fn move_camera(&self, ui: &egui::Ui, document: &mut Document, settings: &Settings, pivot: &mut Option<Vec3>) {
        let painting = is_painting(ui, document);
        let scene = &mut document.scene;
        let response = &self.response;
        if let Some(at) = response.interact_pointer_pos().filter(|_| response.double_clicked() && !painting) {
            *pivot = pick_surface(scene, self.size, self.pixel_at(at)).map(|seen| seen.position);
        }
        if let Some(touch) = ui.input(|input| input.multi_touch()) {
            // Two fingers come nearer and move.
            let moved = touch.translation_delta / self.rect.width().min(self.rect.height()).max(1.0);
            scene.camera.pan(moved.x, -moved.y);
            zoom(scene, self.size, self.pixel_at(touch.center_pos), 1.0 / touch.zoom_delta);
            return;
        }
        let drag = response.drag_delta() / self.rect.width().min(self.rect.height()).max(1.0);
        let moving = response.dragged_by(egui::PointerButton::Secondary)
            || response.dragged_by(egui::PointerButton::Middle)
            || ui.input(|input| input.modifiers.shift);
        let camera = &mut scene.camera;
        if moving {
            camera.pan(drag.x, -drag.y);
        } else if response.dragged() && !painting {
            let [x, y] = [drag.x, drag.y].map(|x| x * TURN_PER_SIDE);
            match settings.fly {
                true => camera.look(x * 0.5, -y * 0.5),
                false => {
                    camera.orbit_about(pivot.unwrap_or(camera.target), -x, y);
                    self.mark(ui, scene, *pivot);
                }
            }
        }
        let scroll = ui.input(|input| input.smooth_scroll_delta().y);
        if let Some(at) = response.hover_pos().filter(|_| scroll != 0.0) {
            zoom(scene, self.size, self.pixel_at(at), (-scroll * ZOOM_PER_POINT).exp());
        }
    }

    /// Draws a ring where the camera turns about a point that was chosen.
    fn mark(&self, ui: &egui::Ui, scene: &Scene, pivot: Option<Vec3>) {
        let frame = scene.camera.frame(self.size[0], self.size[1]);
        if let Some([x, y]) = pivot.and_then(|pivot| frame.pixel_of(pivot)) {
            let at = self.rect.min + egui::vec2(x, y) / self.pixels_per_point;
            let stroke = egui::Stroke::new(1.5, egui::Color32::WHITE);
            ui.painter_at(self.rect).circle_stroke(at, PIVOT_RADIUS, stroke);
        }
    }
}

/// Tells whether drags on the picture paint, as they do with a tool unless Shift moves the camera.
pub(super) fn is_painting(ui: &egui::Ui, document: &Document) -> bool {
    document.editor.tool != Tool::Look && !ui.input(|input| input.modifiers.shift)
}
