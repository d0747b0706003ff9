//! The panel's part that edits assets.

use crate::scene::scene::Scene;
use crate::window::editing::editor::{Editor, Extent, Tool};
use btf_runtime::Edit;

/// Draws the edits of an asset; returns the asset that changed, if one did.
pub(crate) fn show_editor(ui: &mut egui::Ui, editor: &mut Editor, scene: &mut Scene) -> Option<usize> {
    if scene.assets.is_empty() {
        ui.small("nothing here carries an asset");
        return None;
    }
    let mut changed = None;
    choose_asset(ui, editor, scene);
    show_steps(ui, editor, scene, &mut changed);
    let Some(before) = editor.edit(scene) else {
        ui.small("no edits: add one, or choose the brush and paint");
        show_tools(ui, editor);
        return changed;
    };
    let count = editor.count(scene);
    if count > 1 {
        // Counted from 1, as edits are.
        let mut number = editor.selected + 1;
        ui.add(egui::Slider::new(&mut number, 1..=count).text("edit"));
        editor.selected = number - 1;
    }
    show_edit(ui, editor, scene, before, &mut changed);
    show_tools(ui, editor);
    ui.horizontal(|ui| {
        ui.add(egui::TextEdit::singleline(&mut editor.file).desired_width(190.0));
        if ui.button("save").clicked() {
            editor.save(scene);
        }
    });
    if let Some(message) = &editor.message {
        ui.small(message);
    }
    changed
}

/// Draws which asset is edited, where there are several.
fn choose_asset(ui: &mut egui::Ui, editor: &mut Editor, scene: &Scene) {
    if scene.assets.len() > 1 {
        let mut asset = editor.asset;
        egui::ComboBox::from_label("asset").selected_text(&scene.assets[asset].name).show_ui(ui, |ui| {
            for (number, known) in scene.assets.iter().enumerate() {
                ui.selectable_value(&mut asset, number, &known.name);
            }
        });
        if asset != editor.asset {
            editor.close(scene);
            editor.show(scene, asset);
        }
    }
}

/// Draws the buttons that take steps back, do them again, add an edit and remove one.
fn show_steps(ui: &mut egui::Ui, editor: &mut Editor, scene: &mut Scene, changed: &mut Option<usize>) {
    ui.horizontal(|ui| {
        if ui.add_enabled(editor.can_undo(), egui::Button::new("undo")).on_hover_text("Ctrl+Z").clicked() {
            *changed = editor.undo(scene);
        }
        if ui.add_enabled(editor.can_redo(), egui::Button::new("redo")).on_hover_text("Ctrl+Shift+Z").clicked() {
            *changed = editor.redo(scene);
        }
        if ui.button("add edit").clicked() {
            editor.add(scene);
            *changed = Some(editor.asset);
        }
        if ui.add_enabled(editor.count(scene) > 0, egui::Button::new("remove")).clicked() {
            editor.remove(scene);
            *changed = Some(editor.asset);
        }
    });
}

/// Draws the sliders of the edit at hand, which was `before` when the frame began.
fn show_edit(ui: &mut egui::Ui, editor: &mut Editor, scene: &mut Scene, before: Edit, changed: &mut Option<usize>) {
    let Some(mut edit) = editor.edit(scene) else { return };
    let shown = edit;
    ui.horizontal(|ui| {
        ui.color_edit_button_rgb(&mut edit.tint);
        ui.label("tint");
    });
    let factor = |ui: &mut egui::Ui, x: &mut f32, range: std::ops::RangeInclusive<f32>, text: &str| {
        ui.add(egui::Slider::new(x, range).logarithmic(true).smallest_positive(0.01).text(text));
    };
    factor(ui, &mut edit.diffuse, 0.0..=16.0, "diffuse lobes");
    factor(ui, &mut edit.specular, 0.0..=16.0, "glossy lobes");
    factor(ui, &mut edit.roughness, 0.1..=10.0, "roughness");
    ui.add(egui::Slider::new(&mut edit.tilt[0], -0.9..=0.9).text("normal, right"));
    ui.add(egui::Slider::new(&mut edit.tilt[1], -0.9..=0.9).text("normal, up"));
    ui.add(egui::Slider::new(&mut edit.fade, 0.0..=16.0).text("residual fades"));
    ui.horizontal(|ui| {
        ui.small(format!("{:.0} % of the residual stays", 100.0 * edit.keep()));
        if ui.small_button("as measured").clicked() {
            edit = Edit::default();
        }
    });
    if edit != shown && before == shown {
        editor.set(scene, edit);
        *changed = Some(editor.asset);
    }
    ui.horizontal(|ui| {
        if ui.button("everywhere").clicked() {
            editor.fill(scene, Extent::Everywhere);
            *changed = Some(editor.asset);
        }
        if ui.button("nowhere").clicked() {
            editor.fill(scene, Extent::Nowhere);
            *changed = Some(editor.asset);
        }
    });
}

/// Draws the choice of a tool, and the radius of the brush.
fn show_tools(ui: &mut egui::Ui, editor: &mut Editor) {
    ui.horizontal(|ui| {
        ui.radio_value(&mut editor.tool, Tool::Look, "look");
        ui.radio_value(&mut editor.tool, Tool::Brush, "brush");
        ui.radio_value(&mut editor.tool, Tool::Cluster, "cluster");
        ui.radio_value(&mut editor.tool, Tool::Eraser, "eraser");
    });
    if matches!(editor.tool, Tool::Brush | Tool::Eraser) {
        ui.add(egui::Slider::new(&mut editor.radius, 0.5..=64.0).logarithmic(true).text("radius, texels"));
    }
}
