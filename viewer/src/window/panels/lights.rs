//! The panel's part about point lights.

use crate::scene::scene::{PointLight, Scene, intensity_for};
use glam::Vec3;

/// Most lights that the panel offers.
pub(crate) const MAX_LIGHTS: usize = 256;

/// A point light by angles about the scene's centre, seen from its front (+z).
#[derive(Debug, Clone, Copy, PartialEq)]
struct PanelLight {
    azimuth_deg: f32,
    elevation_deg: f32,
    distance: f32,
    brightness: f32,
    colour: [f32; 3],
}

impl PanelLight {
    fn from_light(light: &PointLight, centre: Vec3) -> PanelLight {
        let offset = light.position - centre;
        let distance = offset.length().max(1e-6);
        let peak = light.intensity.iter().fold(0f32, |a, b| a.max(*b));
        PanelLight {
            azimuth_deg: offset.x.atan2(offset.z).to_degrees(),
            elevation_deg: (offset.y / distance).clamp(-1.0, 1.0).asin().to_degrees(),
            distance,
            brightness: peak / intensity_for(distance, 1.0),
            colour: if peak > 0.0 { light.intensity.map(|x| x / peak) } else { [1.0; 3] },
        }
    }

    fn light(&self, centre: Vec3) -> PointLight {
        let (sin_a, cos_a) = self.azimuth_deg.to_radians().sin_cos();
        let (sin_e, cos_e) = self.elevation_deg.to_radians().sin_cos();
        let intensity = intensity_for(self.distance, self.brightness);
        PointLight {
            position: centre + Vec3::new(sin_a * cos_e, sin_e, cos_a * cos_e) * self.distance,
            intensity: self.colour.map(|x| x * intensity),
        }
    }
}

/// The point lights of a scene as the panel turns them.
pub(crate) struct LightsPanel {
    lights: Vec<PanelLight>,
    /// Number of the light whose sliders are shown.
    selected: usize,
    /// Centre of the scene.
    centre: Vec3,
    /// Radius of the scene.
    radius: f32,
}

impl LightsPanel {
    /// Takes over the lights of a scene.
    pub(crate) fn new(scene: &Scene) -> LightsPanel {
        let (centre, radius) = scene.geometry.bounding_sphere();
        let lights = scene.lights.iter().map(|light| PanelLight::from_light(light, centre)).collect();
        LightsPanel { lights, selected: 0, centre, radius }
    }

    /// Returns the number of lights.
    pub(crate) fn count(&self) -> usize {
        self.lights.len()
    }

    /// Turns light `number` about the scene's centre by angles in degrees, and selects it.
    pub(crate) fn turn(&mut self, number: usize, azimuth_deg: f32, elevation_deg: f32, scene: &mut Scene) {
        let Some(light) = self.lights.get_mut(number) else { return };
        light.azimuth_deg = (light.azimuth_deg + azimuth_deg + 180.0).rem_euclid(360.0) - 180.0;
        light.elevation_deg = (light.elevation_deg + elevation_deg).clamp(-90.0, 90.0);
        self.selected = number;
        scene.lights[number] = light.light(self.centre);
    }

    /// Draws the list of lights and the sliders of the selected one; returns `true` and changes the scene if a light
    /// changed.
    pub(crate) fn show(&mut self, ui: &mut egui::Ui, scene: &mut Scene) -> bool {
        let before = self.lights.clone();
        self.show_list(ui);
        self.show_selected(ui);
        if before == self.lights {
            return false;
        }
        scene.lights = self.lights.iter().map(|light| light.light(self.centre)).collect();
        true
    }

    /// Draws how many lights there are, with buttons to add and to remove one, and which one is selected.
    fn show_list(&mut self, ui: &mut egui::Ui) {
        ui.horizontal(|ui| {
            ui.label(format!("lights: {}", self.lights.len()));
            if ui.add_enabled(self.lights.len() < MAX_LIGHTS, egui::Button::new("add")).clicked() {
                // Opposite to the last one, so that it shows.
                let last = self.lights.last().copied().unwrap_or(PanelLight {
                    azimuth_deg: 35.0,
                    elevation_deg: 40.0,
                    distance: 4.0 * self.radius,
                    brightness: 1.0,
                    colour: [1.0; 3],
                });
                let azimuth_deg = (last.azimuth_deg + 70.0 + 180.0).rem_euclid(360.0) - 180.0;
                self.lights.push(PanelLight { azimuth_deg, ..last });
                self.selected = self.lights.len() - 1;
            }
            if ui.add_enabled(!self.lights.is_empty(), egui::Button::new("remove")).clicked() {
                self.lights.remove(self.selected);
                self.selected = self.selected.min(self.lights.len().saturating_sub(1));
            }
        });
        if self.lights.len() > 1 {
            let last = self.lights.len() - 1;
            // Counted from 1, as the number of lights is.
            let mut number = self.selected + 1;
            ui.add(egui::Slider::new(&mut number, 1..=last + 1).text("light"));
            self.selected = number - 1;
        }
    }

    /// Draws the sliders of the selected light.
    fn show_selected(&mut self, ui: &mut egui::Ui) {
        let radius = self.radius;
        if let Some(light) = self.lights.get_mut(self.selected) {
            ui.add(egui::Slider::new(&mut light.azimuth_deg, -180.0..=180.0).text("azimuth"));
            ui.add(egui::Slider::new(&mut light.elevation_deg, -90.0..=90.0).text("elevation"));
            // A nearer or farther light keeps its brightness on the object.
            ui.add(
                egui::Slider::new(&mut light.distance, 0.2 * radius..=20.0 * radius).logarithmic(true).text("distance"),
            );
            ui.add(egui::Slider::new(&mut light.brightness, 0.0..=10.0).text("brightness"));
            ui.horizontal(|ui| {
                ui.color_edit_button_rgb(&mut light.colour);
                ui.label("colour");
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_light_survives_the_way_through_the_panel() {
        let centre = Vec3::new(1.0, 2.0, 3.0);
        let light = PointLight { position: Vec3::new(-3.0, 5.0, 9.0), intensity: [10.0, 20.0, 5.0] };
        let back = PanelLight::from_light(&light, centre).light(centre);
        assert!((back.position - light.position).length() < 1e-4);
        assert!(back.intensity.iter().zip(light.intensity).all(|(a, b)| (a - b).abs() < 1e-3));
        let dark = PointLight { intensity: [0.0; 3], ..light };
        assert_eq!(PanelLight::from_light(&dark, centre).light(centre).intensity, [0.0; 3]);
    }
}
