//! The side panel: what the user can turn while looking.

use super::editor::Editor;
use super::editor_panel::show_editor;
use super::outdoors::OutdoorsPanel;
use super::settings::Settings;
use super::split::Split;
use super::thumbnails::Thumbnails;
use super::wind_panel::WindPanel;
use crate::gpu::backend::GpuTracer;
use crate::gpu::timer::PassTimes;
use crate::options::{MAX_DEPTH, RenderMode, ShadeOptions};
use crate::render::governor::{Governor, Spending};
use crate::scene::material::Body;
use crate::scene::scene::{Ambient, PointLight, Scene, intensity_for};
use btf_runtime::Interpolation;
use glam::Vec3;
use std::path::PathBuf;

/// Slider position of the lobes above which all are used; fitted assets have fewer.
const LOBES_ALL: u32 = 17;
/// Most lights that the panel offers.
const MAX_PANEL_LIGHTS: usize = 256;

/// A renderer that the panel can switch to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Renderer {
    Gpu(GpuTracer),
    Cpu,
}

impl Renderer {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Renderer::Gpu(tracer) => tracer.name(),
            Renderer::Cpu => "cpu",
        }
    }
}

/// A light as the panel shows it: by angles about the scene's centre, seen from its front (+z).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PanelLight {
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

/// What the panel shows but does not change.
pub(crate) struct Status<'a> {
    pub adapter: &'a str,
    pub renderers: &'a [Renderer],
    pub frame_ms: Option<f64>,
    pub passes: Option<PassTimes>,
    pub timer: &'static str,
    pub samples: u32,
    pub picture: [u32; 2],
    pub problem: Option<&'a str>,
    pub governor: Option<&'a Governor>,
    pub message: Option<&'a str>,
    /// What split views show something else in place of.
    pub at_hand: Body,
}

/// A file that the panel asks to be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Export {
    Picture,
    Turntable,
}

/// What the user did in the panel.
#[derive(Debug, Default)]
pub(crate) struct Asked {
    /// The picture must begin anew (exposure does not need that).
    pub changed: bool,
    /// The asset whose edits changed.
    pub edited: Option<usize>,
    /// The light that surrounds the scene changed.
    pub surroundings: bool,
    /// The wind moved the scene's skins.
    pub skins: bool,
    /// The split view must begin anew.
    pub compare: bool,
    /// An asset to compare with.
    pub compare_with: Option<PathBuf>,
    pub export: Option<Export>,
    /// A file to take in.
    pub open: Option<PathBuf>,
}

/// The panel's state.
pub(crate) struct Panel {
    pub shade: ShadeOptions,
    pub renderer: Renderer,
    lights: Vec<PanelLight>,
    selected: usize,
    max_components: u32,
    has_heights: bool,
    /// Of the text field.
    file: String,
    /// What the check box turns on.
    ambient: Ambient,
    outdoors: Option<OutdoorsPanel>,
    pub wind: WindPanel,
    centre: Vec3,
    radius: f32,
}

impl Panel {
    pub(crate) fn new(scene: &Scene, shade: ShadeOptions, renderer: Renderer) -> Panel {
        let (centre, radius) = scene.geometry.bounding_sphere();
        Panel {
            shade,
            renderer,
            lights: scene.lights.iter().map(|light| PanelLight::from_light(light, centre)).collect(),
            selected: 0,
            max_components: scene.most_components(),
            has_heights: scene.assets.iter().any(|asset| asset.has_heights()),
            file: String::new(),
            ambient: if scene.ambient == Ambient::NONE { scene.usual_ambient() } else { scene.ambient },
            outdoors: OutdoorsPanel::new(scene),
            wind: WindPanel::new(scene),
            centre,
            radius,
        }
    }

    /// Draws the panel.
    pub(crate) fn show(
        &mut self,
        ui: &mut egui::Ui,
        scene: &mut Scene,
        editor: &mut Editor,
        split: &mut Split,
        settings: &mut Settings,
        thumbnails: &Thumbnails,
        status: &Status,
    ) -> Asked {
        let mut asked = Asked::default();
        let before = (self.shade, self.renderer, self.lights.clone());
        ui.heading("BTF viewer");
        self.show_status(ui, status);
        ui.separator();
        asked.changed |= self.show_decoding(ui, scene);
        ui.separator();
        self.show_surroundings(ui, scene, &mut asked);
        ui.separator();
        self.show_lights(ui);
        ui.separator();
        if let Some(asset) = thumbnails.show(ui, editor.asset) {
            editor.close(scene);
            editor.show(scene, asset);
        }
        let edited = egui::CollapsingHeader::new("edit the material").show(ui, |ui| show_editor(ui, editor, scene));
        asked.edited = edited.body_returned.flatten();
        show_split(ui, split, status.at_hand, scene, &mut asked);
        ui.checkbox(&mut settings.light_handles, "handles of the lights");
        ui.checkbox(&mut settings.fly, "drags look around (F)");
        ui.separator();
        self.show_files(ui, &mut asked);
        if let Some(message) = status.message {
            ui.small(message);
        }
        ui.small("H: keys");
        if before.2 != self.lights {
            scene.lights = self.lights.iter().map(|light| light.light(self.centre)).collect();
        }
        asked.changed |= asked.edited.is_some();
        asked.changed |= before != (self.shade, self.renderer, self.lights.clone());
        asked
    }

    fn show_files(&mut self, ui: &mut egui::Ui, asked: &mut Asked) {
        ui.horizontal(|ui| {
            if ui.button("picture").on_hover_text("as PNG, P").clicked() {
                asked.export = Some(Export::Picture);
            }
            if ui.button("turntable").on_hover_text("36 pictures, T").clicked() {
                asked.export = Some(Export::Turntable);
            }
        });
        ui.horizontal(|ui| {
            ui.add(egui::TextEdit::singleline(&mut self.file).desired_width(190.0).hint_text("file, or drop one"));
            if ui.button("open").clicked() && !self.file.is_empty() {
                asked.open = Some(PathBuf::from(&self.file));
            }
        });
    }

    /// Turns a light about the scene's centre, degrees.
    pub(crate) fn turn_light(&mut self, number: usize, azimuth_deg: f32, elevation_deg: f32, scene: &mut Scene) {
        let Some(light) = self.lights.get_mut(number) else { return };
        light.azimuth_deg = (light.azimuth_deg + azimuth_deg + 180.0).rem_euclid(360.0) - 180.0;
        light.elevation_deg = (light.elevation_deg + elevation_deg).clamp(-90.0, 90.0);
        self.selected = number;
        scene.lights[number] = light.light(self.centre);
    }

    /// Light of the day, ambient light and mirrors.
    fn show_surroundings(&mut self, ui: &mut egui::Ui, scene: &mut Scene, asked: &mut Asked) {
        let before = scene.ambient;
        if let Some(outdoors) = &mut self.outdoors {
            asked.surroundings = outdoors.show(ui, scene, &mut self.shade.sky);
        } else if scene.environment.is_some() {
            ui.label("surrounded by a picture of light");
        }
        let mut occlusion = scene.ambient != Ambient::NONE;
        let choose = scene.environment.is_none();
        if choose && ui.checkbox(&mut occlusion, "ambient occlusion").changed() {
            scene.ambient = if occlusion { self.ambient } else { Ambient::NONE };
        }
        if occlusion && choose {
            let mut radiance = scene.ambient.radiance[1];
            if ui.add(egui::Slider::new(&mut radiance, 0.01..=2.0).logarithmic(true).text("ambient light")).changed() {
                scene.ambient.radiance = [radiance; 3];
            }
            let distances = 0.01 * self.radius..=4.0 * self.radius;
            let slider = egui::Slider::new(&mut scene.ambient.distance, distances).logarithmic(true);
            ui.add(slider.text("within"));
            self.ambient = scene.ambient;
        }
        if self.lights.len() > 1 {
            let most = MAX_PANEL_LIGHTS as u32;
            ui.add(egui::Slider::new(&mut self.shade.light_samples, 1..=most).text("lights a frame"));
        }
        ui.horizontal(|ui| {
            ui.radio_value(&mut self.shade.mode, RenderMode::Direct, "direct light");
            ui.radio_value(&mut self.shade.mode, RenderMode::Path, "path tracing");
        });
        if self.shade.mode == RenderMode::Path
            || scene.materials.iter().any(|material| material.mirror.iter().any(|x| *x > 0.0))
        {
            ui.add(egui::Slider::new(&mut self.shade.depth, 1..=MAX_DEPTH).text("path depth"));
        }
        asked.skins = self.wind.show(ui, scene);
        asked.changed |= asked.surroundings || asked.skins || scene.ambient != before;
    }

    fn show_status(&mut self, ui: &mut egui::Ui, status: &Status) {
        ui.label(status.adapter);
        egui::ComboBox::from_label("backend").selected_text(self.renderer.name()).show_ui(ui, |ui| {
            for renderer in status.renderers {
                ui.selectable_value(&mut self.renderer, *renderer, renderer.name());
            }
        });
        match status.frame_ms {
            Some(ms) => ui.label(format!("{ms:.2} ms per frame ({})", status.timer)),
            None => ui.label("measuring"),
        };
        if let Some(PassTimes { camera_ms, volume_ms, light_ms, bounce_ms }) = status.passes {
            let volumes = if volume_ms > 0.0 { format!("volumes {volume_ms:.2}, ") } else { String::new() };
            ui.small(format!("camera {camera_ms:.2}, {volumes}light {light_ms:.2}, further rays {bounce_ms:.2} ms"));
        }
        ui.label(format!("{} x {}, {} samples", status.picture[0], status.picture[1], status.samples));
        if let Some(governor) = status.governor {
            let Spending { components, lobes, lights } = governor.spends();
            let of = self.max_components;
            ui.small(format!(
                "budget {:.1} ms: {components} of {of} components, {lobes} lobes, {lights} lights at most",
                governor.budget_ms()
            ));
        }
        if let Some(problem) = status.problem {
            ui.colored_label(egui::Color32::LIGHT_RED, problem);
        }
    }

    /// True if surfaces are displaced otherwise than before.
    fn show_decoding(&mut self, ui: &mut egui::Ui, scene: &mut Scene) -> bool {
        let mut displaced = false;
        let mut components = self.shade.decode.components.min(self.max_components);
        ui.add_enabled_ui(self.max_components > 0, |ui| {
            let slider = egui::Slider::new(&mut components, 0..=self.max_components);
            if ui.add(slider.text("components")).changed() {
                self.shade.decode.components = if components == self.max_components { u32::MAX } else { components };
            }
        });
        let mut lobes = self.shade.decode.lobes.min(LOBES_ALL);
        let slider = egui::Slider::new(&mut lobes, 0..=LOBES_ALL)
            .custom_formatter(|x, _| if x >= f64::from(LOBES_ALL) { "all".into() } else { format!("{x:.0}") });
        if ui.add(slider.text("lobes")).changed() {
            self.shade.decode.lobes = if lobes == LOBES_ALL { u32::MAX } else { lobes };
        }
        ui.horizontal(|ui| {
            ui.radio_value(&mut self.shade.decode.interpolation, Interpolation::Fast, "fast");
            ui.radio_value(&mut self.shade.decode.interpolation, Interpolation::Exact, "exact");
            ui.label("interpolation");
            ui.checkbox(&mut self.shade.decode.parallax, "parallax");
        });
        if self.has_heights {
            let mut scale = scene.materials.iter().map(|material| material.displacement).fold(0.0, f32::max);
            let slider = egui::Slider::new(&mut scale, 0.0..=8.0);
            if ui.add(slider.text("displacement")).on_hover_text("heights times this; 0 for none").changed() {
                scene.displace(scale);
                displaced = true;
            }
        }
        ui.checkbox(&mut self.shade.levels, "coarser texels where the picture is small");
        ui.add(egui::Slider::new(&mut scene.exposure_ev, -6.0..=6.0).text("exposure, EV"));
        displaced
    }

    fn show_lights(&mut self, ui: &mut egui::Ui) {
        ui.horizontal(|ui| {
            ui.label(format!("lights: {}", self.lights.len()));
            if ui.add_enabled(self.lights.len() < MAX_PANEL_LIGHTS, egui::Button::new("add")).clicked() {
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

/// What the picture is compared with.
fn show_split(ui: &mut egui::Ui, split: &mut Split, at_hand: Body, scene: &Scene, asked: &mut Asked) {
    let before = (split.on, split.against);
    ui.checkbox(&mut split.on, "compare (C)");
    if split.on {
        egui::ComboBox::from_label("with").selected_text(split.name(split.against, scene)).show_ui(ui, |ui| {
            for choice in split.choices(scene, at_hand) {
                let name = split.name(choice, scene);
                ui.selectable_value(&mut split.against, choice, name);
            }
        });
        ui.checkbox(&mut split.difference, "difference (X)");
        if split.difference {
            ui.add(egui::Slider::new(&mut split.gain, 1.0..=64.0).logarithmic(true).text("times"));
        }
        ui.horizontal(|ui| {
            ui.add(egui::TextEdit::singleline(&mut split.file).desired_width(190.0).hint_text("asset (.spmm)"));
            let button = ui.button("compare").on_hover_text("with this asset in place of the leaf or asset at hand");
            if button.clicked() && !split.file.is_empty() {
                asked.compare_with = Some(PathBuf::from(&split.file));
            }
        });
    }
    if before != (split.on, split.against) {
        split.reset(scene, at_hand);
        asked.compare = true;
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
