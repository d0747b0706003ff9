//! The dialog that asks what becomes of unsaved edits before they are lost.

use crate::window::editing::document::Unsaved;
use crate::window::pressed::is_pressed;
use std::path::{Path, PathBuf};

/// Width of the dialog, points.
const WIDTH: f32 = 480.0;
/// Width of the fields with the files' names, points.
const FILE_WIDTH: f32 = 320.0;

/// Action that would lose unsaved edits and waits for the answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Loss {
    /// The window closes.
    Close,
    /// The file is opened, in place of the asset of a number where it is one.
    Open(PathBuf, Option<usize>),
}

/// Answer of the user.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Answer {
    /// Save the edits, then go on.
    Save,
    /// Go on without the edits.
    Discard,
    /// Do not go on.
    Cancel,
}

/// The question what becomes of unsaved edits.
pub(crate) struct UnsavedDialog {
    /// Action that waits for the answer.
    pub loss: Loss,
    /// Unsaved documents with their files, which the user may rename.
    pub unsaved: Vec<Unsaved>,
    /// Why saving failed, if it did.
    pub problem: Option<String>,
}

impl UnsavedDialog {
    /// Makes the question.
    pub(crate) fn new(loss: Loss, unsaved: Vec<Unsaved>) -> UnsavedDialog {
        UnsavedDialog { loss, unsaved, problem: None }
    }

    /// Draws the question over everything else; returns the answer when there is one. Enter saves, D discards, Escape
    /// cancels.
    pub(crate) fn show(&mut self, ui: &egui::Ui) -> Option<Answer> {
        let typing = ui.ctx().egui_wants_keyboard_input();
        let mut answer = None;
        egui::Modal::new(egui::Id::unique("unsaved edits")).show(ui.ctx(), |ui| {
            ui.set_width(WIDTH);
            ui.heading(match self.loss {
                Loss::Close => "Save the edits before the window closes?",
                Loss::Open(..) => "Save the edits before the file takes their place?",
            });
            for Unsaved { name, file, .. } in &mut self.unsaved {
                ui.horizontal(|ui| {
                    ui.add(egui::TextEdit::singleline(file).desired_width(FILE_WIDTH));
                    ui.label(name.as_str());
                });
                if Path::new(file.as_str()).exists() {
                    ui.small("this file is there and will be replaced");
                }
            }
            if let Some(problem) = &self.problem {
                ui.colored_label(egui::Color32::LIGHT_RED, problem);
            }
            ui.horizontal(|ui| {
                let choices = [
                    ("Save", "Enter", egui::Key::Enter, Answer::Save),
                    ("Discard", "D", egui::Key::D, Answer::Discard),
                    ("Cancel", "Escape", egui::Key::Escape, Answer::Cancel),
                ];
                for (name, hint, key, choice) in choices {
                    if ui.button(name).on_hover_text(hint).clicked() || (!typing && is_pressed(ui, key)) {
                        answer = Some(choice);
                    }
                }
            });
        });
        answer
    }
}
