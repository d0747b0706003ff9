//! Keys that went down in a frame.

/// Tells whether a key went down in this frame, without Ctrl.
pub(crate) fn is_pressed(ui: &egui::Ui, wanted: egui::Key) -> bool {
    let is = |event: &egui::Event| {
        matches!(event, egui::Event::Key { key, pressed: true, repeat: false, modifiers, .. }
            if *key == wanted && !modifiers.command)
    };
    ui.input(|input| input.events.iter().any(is))
}
