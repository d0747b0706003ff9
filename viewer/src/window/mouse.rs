//! What the mouse does on the picture: it turns the camera, or paints.

use super::editing::document::Document;
use super::editing::editor::Tool;
use super::settings::Settings;
use crate::cpu::pick::{Picked, pick};
use crate::scene::scene::Scene;

/// Radians that a drag across the window's shorter side turns.
const TURN_PER_SIDE: f32 = 4.0;
/// How much nearer the wheel brings the eye: the exponent for a point of scrolling.
const ZOOM_PER_POINT: f32 = 0.003;

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
        let [x, y] = [at.x - self.rect.min.x, at.y - self.rect.min.y].map(|points| points * self.pixels_per_point);
        pick(scene, self.size, [x, y])
    }

    /// Uses the tool at hand where the mouse is pressed on an asset; returns the asset that changed.
    pub fn paint(&self, ui: &egui::Ui, document: &mut Document) -> Option<usize> {
        let pressed = self.response.is_pointer_button_down_on() && ui.input(|input| input.pointer.primary_down());
        let at = self.response.interact_pointer_pos().filter(|_| pressed && is_painting(ui, document))?;
        let Picked { asset, texel, .. } = self.pick(&document.scene, at)?;
        document.editor.touch(&mut document.scene, asset, texel).then_some(asset)
    }

    /// Turns, moves and zooms the camera as drags and the wheel ask for.
    pub fn move_camera(&self, ui: &egui::Ui, document: &mut Document, settings: &Settings) {
        let painting = is_painting(ui, document);
        let camera = &mut document.scene.camera;
        let response = &self.response;
        let drag = response.drag_delta() / self.rect.width().min(self.rect.height()).max(1.0);
        let moving = response.dragged_by(egui::PointerButton::Secondary)
            || response.dragged_by(egui::PointerButton::Middle)
            || ui.input(|input| input.modifiers.shift);
        if moving {
            camera.pan(drag.x, -drag.y);
        } else if response.dragged() && !painting {
            let [x, y] = [drag.x, drag.y].map(|x| x * TURN_PER_SIDE);
            match settings.fly {
                true => camera.look(x * 0.5, -y * 0.5),
                false => camera.orbit(-x, y),
            }
        }
        if response.hovered() {
            let scroll = ui.input(|input| input.smooth_scroll_delta().y);
            if scroll != 0.0 {
                camera.zoom((-scroll * ZOOM_PER_POINT).exp());
            }
        }
    }
}

/// Tells whether drags on the picture paint, as they do with a tool unless Shift moves the camera.
pub(super) fn is_painting(ui: &egui::Ui, document: &Document) -> bool {
    document.editor.tool != Tool::Look && !ui.input(|input| input.modifiers.shift)
}
