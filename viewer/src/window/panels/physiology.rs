//! The panel of a scene with leaves: contents, structure, gloss and variation under sliders, states by name, the
//! spectrum.

use super::spectrum::show_spectrum;
use crate::scene::scene::Scene;
use crate::window::editing::physiology::{LeafChange, LeafSettings, Physiology};
use btf_models::{LEAF_QUANTITIES, LeafPreset, LeafQuantity};
use btf_runtime::LeafMode;

/// Length of a slider, points: the number and its unit stand beside it.
const SLIDER_WIDTH: f32 = 88.0;

/// A group of sliders: its name, whether it is open at first, and what belongs to it.
type Group = (&'static str, bool, fn(&LeafQuantity) -> bool);

const GROUPS: [Group; 5] = [
    ("contents", true, |quantity| quantity.section == "contents" && quantity.key != "structure"),
    ("structure", true, |quantity| quantity.key == "structure"),
    ("gloss", true, |quantity| quantity.section == "gloss"),
    ("variation from plant to plant", false, |quantity| quantity.section == "variation"),
    ("patch, for captures of this leaf", false, |quantity| quantity.section == "look"),
];

/// Draws the panel; returns what changed, if anything did. `None` in a scene without leaves, where nothing is drawn.
pub(crate) fn show_physiology(ui: &mut egui::Ui, physiology: &mut Physiology, scene: &mut Scene) -> Option<LeafChange> {
    choose_leaf(ui, physiology, scene);
    let mut settings = physiology.settings(scene)?;
    show_spectrum(ui, scene.leaves[physiology.leaf].leaf.state());
    let has_table = scene.leaves[physiology.leaf].leaf.has_scattering();
    ui.horizontal_wrapped(|ui| {
        for preset in LeafPreset::ALL {
            let is_so = settings.description.contents == preset.contents();
            let button = ui.add(egui::Button::new(preset.name()).selected(is_so));
            if button.on_hover_text("what a whole blade of this state holds").clicked() {
                settings.take(preset);
            }
        }
    });
    ui.horizontal(|ui| {
        let tissue = has_table.then_some(LeafMode::Tissue);
        for mode in tissue.into_iter().chain(LeafMode::ALL.into_iter().rev()) {
            ui.radio_value(&mut settings.mode, mode, mode.name()).on_hover_text(mode_meaning(mode));
        }
    });
    for (name, is_open, belongs) in GROUPS {
        let header = egui::CollapsingHeader::new(name).default_open(is_open);
        header.show(ui, |ui| {
            for quantity in LEAF_QUANTITIES.iter().filter(|quantity| belongs(quantity)) {
                show_quantity(ui, quantity, &mut settings);
            }
            if name.starts_with("variation") {
                show_seed(ui, &mut settings, scene);
            }
        });
    }
    let mut changed = physiology.set(scene, settings);
    ui.horizontal(|ui| {
        if ui.add_enabled(physiology.can_undo(), egui::Button::new("undo")).on_hover_text("Ctrl+Z").clicked() {
            changed = physiology.undo(scene).or(changed.take());
        }
        if ui.add_enabled(physiology.can_redo(), egui::Button::new("redo")).on_hover_text("Ctrl+Shift+Z").clicked() {
            changed = physiology.redo(scene).or(changed.take());
        }
        let reset = egui::Button::new("as opened");
        if ui.add_enabled(!physiology.is_as_opened(scene), reset).on_hover_text("back to the file").clicked() {
            changed = physiology.reset(scene).or(changed.take());
        }
        if let Some(ms) = physiology.step_ms {
            ui.small(format!("{ms:.2} ms")).on_hover_text("what the last change took on the CPU");
        }
    });
    ui.horizontal(|ui| {
        ui.add(egui::TextEdit::singleline(&mut physiology.file).desired_width(200.0));
        if ui
            .button("save leaf")
            .on_hover_text("as TOML, for btf-synth leaf --leaf FILE and btf-view --leaf FILE")
            .clicked()
        {
            physiology.save(scene);
        }
    });
    if let Some(message) = &physiology.message {
        ui.small(message);
    }
    changed
}

fn choose_leaf(ui: &mut egui::Ui, physiology: &mut Physiology, scene: &Scene) {
    let Some(shown) = scene.leaves.get(physiology.leaf) else { return };
    if scene.leaves.len() == 1 {
        ui.heading(format!("leaf: {}", shown.name));
        return;
    }
    let mut leaf = physiology.leaf;
    egui::ComboBox::from_label("leaf").selected_text(&shown.name).show_ui(ui, |ui| {
        for (number, known) in scene.leaves.iter().enumerate() {
            ui.selectable_value(&mut leaf, number, &known.name);
        }
    });
    if leaf != physiology.leaf {
        physiology.close(scene);
        physiology.show(scene, leaf);
    }
}

fn show_quantity(ui: &mut egui::Ui, quantity: &LeafQuantity, settings: &mut LeafSettings) {
    ui.spacing_mut().slider_width = SLIDER_WIDTH;
    let [least, most] = quantity.range;
    let mut value = quantity.of(&settings.description);
    let unit = if quantity.unit.is_empty() { String::new() } else { format!(" {}", quantity.unit) };
    let name = quantity.name.strip_prefix("variation of ").unwrap_or(quantity.name);
    // A typed number is one step, when it is whole.
    let slider = egui::Slider::new(&mut value, least..=most).suffix(&unit).text(name).update_while_editing(false);
    let hover = format!("{}; {least} to {most}{unit}", quantity.meaning);
    if ui.add(slider).on_hover_text(hover).changed() {
        settings.put(quantity, value);
    }
}

fn show_seed(ui: &mut egui::Ui, settings: &mut LeafSettings, scene: &Scene) {
    ui.horizontal(|ui| {
        // As many as TOML's integers hold.
        let seeds = 0..=i64::MAX as u64;
        ui.add(egui::DragValue::new(&mut settings.description.variation.seed).range(seeds));
        ui.label("seed").on_hover_text("other numbers draw other plants");
    });
    if scene.geometry.instances().len() < 2 {
        ui.small("one plant alone is as the leaf is described");
    }
}

fn mode_meaning(mode: LeafMode) -> &'static str {
    match mode {
        LeafMode::Tissue => "a table of an algorithmic model, with its own surface",
        LeafMode::TwoSided => "two unequal piles of plates over the spectrum: a paler back",
        LeafMode::NLayers => "N plates over the spectrum, PROSPECT-D",
        LeafMode::Rational => "one exact plate at 675, 546 and 435 nm",
        LeafMode::ThreePiece => "one plate as Miao et al. print it, misprints and all",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_quantity_is_in_one_group_and_explained() {
        for quantity in &LEAF_QUANTITIES {
            let groups = GROUPS.iter().filter(|(.., belongs)| belongs(quantity)).count();
            assert_eq!(groups, 1, "{}", quantity.key);
            assert_ne!(quantity.meaning, quantity.name);
        }
    }
}
