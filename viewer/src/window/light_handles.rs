//! Handles of the lights: circles around the scene, in the lights' directions, that the mouse drags.

use super::panels::lights::LightsPanel;
use crate::scene::scene::Scene;

/// Distance of the handles from the scene's centre, in its radii.
const HANDLE_RADII: f32 = 1.15;
/// Points across a handle.
const HANDLE_POINTS: f32 = 14.0;
/// Degrees that a drag of a point turns a light.
const DEGREES_A_POINT: f32 = 0.5;
/// Most lights that have handles.
const MAX_HANDLES: usize = 16;

/// Draws the handles over the picture in `area`; returns `true` if the user moved a light.
pub(crate) fn show_light_handles(
    ui: &mut egui::Ui,
    area: egui::Rect,
    lights: &mut LightsPanel,
    scene: &mut Scene,
) -> bool {
    let (centre, radius) = scene.geometry.bounding_sphere();
    let frame = scene.camera.frame(area.width().max(1.0) as u32, area.height().max(1.0) as u32);
    let mut moved = false;
    for number in 0..scene.lights.len().min(MAX_HANDLES) {
        let light = scene.lights[number];
        let towards = (light.position - centre).normalize_or_zero() * (HANDLE_RADII * radius);
        let Some([x, y]) = frame.pixel_of(centre + towards) else { continue };
        let at = area.min + egui::vec2(x, y);
        if !area.contains(at) {
            continue;
        }
        let rect = egui::Rect::from_center_size(at, egui::Vec2::splat(HANDLE_POINTS));
        let response = ui.interact(rect, ui.scope_id().with(("light", number)), egui::Sense::drag());
        if response.dragged() {
            let drag = response.drag_delta();
            lights.turn(number, drag.x * DEGREES_A_POINT, -drag.y * DEGREES_A_POINT, scene);
            moved = true;
        }
        let peak = light.intensity.iter().fold(1e-6f32, |a, b| a.max(*b));
        let [r, g, b] = light.intensity.map(|x| (255.0 * (x / peak).powf(1.0 / 2.2)) as u8);
        let colour = egui::Color32::from_rgb(r, g, b);
        let behind = towards.dot(scene.camera.eye - centre) < 0.0;
        let size = HANDLE_POINTS * if response.hovered() { 0.45 } else { 0.35 };
        let painter = ui.painter_at(area);
        painter.circle_stroke(at, size + 1.0, egui::Stroke::new(1.0, egui::Color32::BLACK));
        if behind {
            painter.circle_stroke(at, size, egui::Stroke::new(1.5, colour));
        } else {
            painter.circle_filled(at, size, colour);
        }
    }
    moved
}
