//! What the keys do.

use super::controls::Controls;
use super::editing::document::Document;
use super::editing::editor::Tool;
use super::panels::asked::{Asked, Export};
use super::pictures::split::Split;
use super::pressed::is_pressed;
use crate::work::HAS_THREADS;
use egui::{Key, Modifiers};

/// Radii of the scene that the eye flies in a second.
const RADII_PER_SECOND: f32 = 1.0;
/// Longest time that a key moves the eye in one frame, seconds: slow frames do not make it jump.
const LONGEST_FLIGHT_S: f32 = 0.1;
/// Keys that choose the tool of a mouse drag on the picture.
const TOOL_KEYS: [(Key, Tool); 4] =
    [(Key::Num1, Tool::Look), (Key::Num2, Tool::Brush), (Key::Num3, Tool::Cluster), (Key::Num4, Tool::Eraser)];
/// Keys of the window, for its help.
const KEYS: &str = "drag: turn; Shift or right drag: move\n\
    wheel: nearer to what is under the mouse, never through it\n\
    double click: drags turn about that point; beside everything: about the middle\n\
    W A S D, Q E: fly; F: drags look around instead of turning\n\
    L: lights' handles, which drags move\n\
    C: split view, whose line drags move; X: difference\n\
    P: picture as PNG; T: turntable\n\
    B: the wind blows or stands still\n\
    N: noise is filtered out while nothing moves\n\
    1 2 3 4: look, brush, cluster, eraser\n\
    Ctrl+Z, Ctrl+Shift+Z: edits back and forth\n\
    Ctrl+O: a file to open is chosen\n\
    Ctrl+S: all edits saved; Ctrl+Q: window closed\n\
    drop .spmm on what it is to cover, or to compare a leaf with; .obj .gltf .glb, .hdr .exr, .toml, .voltex anywhere\n\
    H or F1: this";

/// Takes steps of editing back, or does them again, where Ctrl+Z and Ctrl+Shift+Z ask for it; returns `true` if one of
/// them did.
pub(super) fn undo_and_redo(ui: &egui::Ui, document: &mut Document, asked: &mut Asked) -> bool {
    // The keys' own modifiers: when a frame is slow they are up again at its end.
    let typing = ui.ctx().egui_wants_keyboard_input();
    let [redo, undo] = ui.input_mut(|input| {
        if typing {
            return [false; 2];
        }
        let command = Modifiers::COMMAND;
        [command | Modifiers::SHIFT, command].map(|keys| input.consume_key(keys, Key::Z))
    });
    let Document { scene, editor, physiology, leaf_at_hand } = document;
    match (undo, redo, *leaf_at_hand) {
        (true, _, true) => asked.leaf = physiology.undo(scene).or(asked.leaf.take()),
        (true, _, false) => asked.edited = editor.undo(scene).or(asked.edited),
        (_, true, true) => asked.leaf = physiology.redo(scene).or(asked.leaf.take()),
        (_, true, false) => asked.edited = editor.redo(scene).or(asked.edited),
        _ => {}
    }
    undo || redo
}

/// Does what the other keys ask for: flies the camera, turns options of the window on and off, and notes the rest in
/// `asked`.
pub(super) fn follow_keys(
    ui: &egui::Ui,
    document: &mut Document,
    split: &mut Split,
    controls: &mut Controls,
    asked: &mut Asked,
) {
    let keys = [Key::O, Key::S, Key::Q];
    let [choose, save, close] = ui.input_mut(|input| keys.map(|key| input.consume_key(Modifiers::COMMAND, key)));
    asked.choose |= choose;
    asked.save |= save;
    asked.close |= close;
    if ui.ctx().egui_wants_keyboard_input() {
        return;
    }
    fly(ui, document);
    for (key, option) in [
        (Key::F, &mut controls.settings.fly),
        (Key::L, &mut controls.settings.light_handles),
        (Key::X, &mut split.difference),
    ] {
        *option ^= is_pressed(ui, key);
    }
    controls.help ^= is_pressed(ui, Key::H) || is_pressed(ui, Key::F1);
    for (key, export) in [(Key::P, Export::Picture), (Key::T, Export::Turntable)] {
        asked.exports.extend(is_pressed(ui, key).then_some(export));
    }
    for (key, tool) in TOOL_KEYS {
        if is_pressed(ui, key) {
            document.editor.tool = tool;
        }
    }
    if is_pressed(ui, Key::B) {
        controls.panel.wind.plays = !controls.panel.wind.plays;
        ui.ctx().request_repaint();
    }
    if HAS_THREADS && is_pressed(ui, Key::N) {
        controls.settings.denoise = !controls.settings.denoise;
        asked.changed = true;
    }
    if is_pressed(ui, Key::C) {
        split.on = !split.on;
        asked.changed = true;
    }
}

/// Moves the camera while W, A, S, D, Q or E is down.
fn fly(ui: &egui::Ui, document: &mut Document) {
    let down = |key| ui.input(|input| f32::from(u8::from(input.key_down(key) && !input.modifiers.command)));
    let way = [down(Key::D) - down(Key::A), down(Key::E) - down(Key::Q), down(Key::W) - down(Key::S)];
    if way != [0.0; 3] {
        let seconds = ui.input(|input| input.stable_dt).min(LONGEST_FLIGHT_S);
        let step = seconds * RADII_PER_SECOND * document.scene.geometry.bounding_sphere().1;
        document.scene.camera.fly(way.map(|x| x * step));
        ui.ctx().request_repaint();
    }
}

/// Draws what the keys do, in a window of its own over the picture in `area`.
pub(super) fn show_help(ui: &egui::Ui, area: egui::Rect) {
    let window = egui::Window::new("keys").collapsible(false).default_pos(area.min + egui::vec2(20.0, 20.0));
    window.show(ui.ctx(), |ui| ui.label(KEYS));
}
