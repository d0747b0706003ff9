//! The panel's part about the split view.

use super::asked::Asked;
use crate::scene::material::Body;
use crate::scene::scene::Scene;
use crate::window::pictures::split::Split;
use std::path::PathBuf;

/// Draws what the picture is compared with. `at_hand` is the body that split views show something else in place of.
pub(crate) fn show_comparison(ui: &mut egui::Ui, split: &mut Split, at_hand: Body, scene: &Scene, asked: &mut Asked) {
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
        asked.changed = true;
    }
}
