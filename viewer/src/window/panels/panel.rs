//! The side panel: what the user can turn while looking.

use super::asked::{Asked, Export};
use super::comparison::show_comparison;
use super::editor::show_editor;
use super::lights::{LightsPanel, MAX_LIGHTS};
use super::outdoors::OutdoorsPanel;
use super::status::Status;
use super::thumbnails::Thumbnails;
use super::wind::WindPanel;
use crate::options::{MAX_DEPTH, RenderMode, ShadeOptions};
use crate::scene::illuminant::{ILLUMINANTS, has_bands, illuminant_of, show_under};
use crate::scene::scene::{Ambient, Scene};
use crate::window::editing::document::Document;
use crate::window::pictures::renderer::Renderer;
use crate::window::pictures::split::Split;
use crate::window::settings::Settings;
use crate::work::HAS_THREADS;
use btf_runtime::{HeightUse, Interpolation};
use std::path::PathBuf;

/// Slider position of the lobes above which all are used; fitted assets have fewer.
const LOBES_ALL: u32 = 17;

/// The panel's state.
pub(crate) struct Panel {
    /// Settings that trade time for accuracy.
    pub shade: ShadeOptions,
    /// The renderer that is chosen.
    pub renderer: Renderer,
    /// The point lights.
    pub lights: LightsPanel,
    /// Residual components of the asset that has most.
    pub max_components: u32,
    /// Whether an asset has heights.
    has_heights: bool,
    /// Text of the field that names a file to open.
    file: String,
    /// The ambient light that the check box turns on.
    ambient: Ambient,
    outdoors: Option<OutdoorsPanel>,
    /// The clock of the wind.
    pub wind: WindPanel,
    /// Radius of the scene.
    radius: f32,
}

impl Panel {
    /// Makes the panel of a scene.
    pub(crate) fn new(scene: &Scene, shade: ShadeOptions, renderer: Renderer) -> Panel {
        Panel {
            shade,
            renderer,
            lights: LightsPanel::new(scene),
            max_components: scene.most_components(),
            has_heights: scene.assets.iter().any(|asset| asset.has_heights()),
            file: String::new(),
            ambient: if scene.ambient == Ambient::NONE { scene.usual_ambient() } else { scene.ambient },
            outdoors: OutdoorsPanel::new(scene),
            wind: WindPanel::new(scene),
            radius: scene.geometry.bounding_sphere().1,
        }
    }

    /// Draws the panel and changes the scene as the user asks.
    pub(crate) fn show(
        &mut self,
        ui: &mut egui::Ui,
        document: &mut Document,
        split: &mut Split,
        settings: &mut Settings,
        thumbnails: &Thumbnails,
        status: &Status,
    ) -> Asked {
        let mut asked = Asked::default();
        let before = (self.shade, self.renderer);
        let Document { scene, editor, .. } = document;
        ui.heading("BTF viewer");
        status.show(ui, &mut self.renderer);
        ui.separator();
        asked.changed |= self.show_decoding(ui, scene);
        asked.illuminant = show_illuminants(ui, scene);
        ui.separator();
        self.show_surroundings(ui, scene, &mut asked);
        ui.separator();
        asked.changed |= self.lights.show(ui, scene);
        ui.separator();
        if let Some(asset) = thumbnails.show(ui, editor.asset) {
            editor.close(scene);
            editor.show(scene, asset);
        }
        let edited = egui::CollapsingHeader::new("edit the material").show(ui, |ui| {
            if let Some(original) = scene.assets.get(editor.asset).and_then(|asset| asset.original()) {
                let button = ui.button("read it for editing").on_hover_text("takes some seconds");
                asked.open = button.clicked().then_some(original);
                return None;
            }
            show_editor(ui, editor, scene)
        });
        asked.edited = edited.body_returned.flatten();
        show_comparison(ui, split, status.at_hand, scene, &mut asked);
        ui.checkbox(&mut settings.light_handles, "handles of the lights");
        ui.checkbox(&mut settings.fly, "drags look around (F)");
        if HAS_THREADS {
            let filter = ui.checkbox(&mut settings.denoise, "filter noise while nothing moves (N)");
            asked.changed |= filter.on_hover_text("not in split views").changed();
        }
        ui.separator();
        self.show_files(ui, &mut asked);
        if let Some(message) = status.message {
            ui.small(message);
        }
        ui.small("H: keys");
        asked.changed |= asked.edited.is_some() || asked.illuminant || before != (self.shade, self.renderer);
        asked
    }

    /// Draws what writes pictures and opens files.
    fn show_files(&mut self, ui: &mut egui::Ui, asked: &mut Asked) {
        ui.horizontal(|ui| {
            asked.choose |= ui.button("open...").on_hover_text("choose a file, Ctrl+O").clicked();
            if ui.button("picture").on_hover_text("as PNG, P").clicked() {
                asked.exports.push(Export::Picture);
            }
            if ui.button("turntable").on_hover_text("36 pictures, T").clicked() {
                asked.exports.push(Export::Turntable);
            }
        });
        ui.horizontal(|ui| {
            ui.add(egui::TextEdit::singleline(&mut self.file).desired_width(190.0).hint_text("file, or drop one"));
            if ui.button("open").clicked() && !self.file.is_empty() {
                asked.open = Some(PathBuf::from(&self.file));
            }
        });
    }

    /// Draws the light of the day, ambient light, mirrors and the wind.
    fn show_surroundings(&mut self, ui: &mut egui::Ui, scene: &mut Scene, asked: &mut Asked) {
        let before = scene.ambient;
        if let Some(outdoors) = &mut self.outdoors {
            asked.surroundings = outdoors.show(ui, scene, &mut self.shade.sky);
        } else if scene.environment.is_some() {
            ui.label("surrounded by a picture of light");
        }
        self.show_ambient(ui, scene);
        if self.lights.count() > 1 {
            let most = MAX_LIGHTS as u32;
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

    /// Draws the ambient light of a scene that no picture of light surrounds.
    fn show_ambient(&mut self, ui: &mut egui::Ui, scene: &mut Scene) {
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
    }

    /// Draws how assets are decoded and how bright the picture is; returns `true` if surfaces are displaced otherwise
    /// than before.
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
        });
        ui.horizontal(|ui| {
            for heights in HeightUse::ALL {
                ui.radio_value(&mut self.shade.decode.heights, heights, heights.name());
            }
            ui.label("heights").on_hover_text("what the decoder makes of an asset's heights");
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
}

/// Draws the illuminants of a scene with assets in bands; returns `true` if another one was chosen.
fn show_illuminants(ui: &mut egui::Ui, scene: &mut Scene) -> bool {
    if !has_bands(scene) {
        return false;
    }
    let shown = illuminant_of(scene);
    let mut chosen = None;
    ui.horizontal(|ui| {
        for (name, meaning) in ILLUMINANTS {
            if ui.radio(shown == Some(name), name).on_hover_text(meaning).clicked() {
                chosen = Some(name);
            }
        }
        ui.label("illuminant").on_hover_text("the light under which materials in spectral bands are seen");
    });
    let Some(name) = chosen.filter(|name| shown != Some(*name)) else { return false };
    show_under(scene, name);
    true
}
