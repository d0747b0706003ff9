//! The dialog that chooses a file to open. It is drawn in the window itself, so that it is there on every system, without
//! a desktop's services too; folders are read on a thread of their own, since a remote one may take its time.

use crate::error::ViewerError;
use crate::window::folder::{Entry, list};
use crate::window::pictures::preparing::POLL;
use crate::window::pressed::is_pressed;
use crate::work::in_background;
use egui::Key;
use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;

/// Width of the dialog, points.
const WIDTH: f32 = 480.0;
/// Height of the list, points.
const LIST_HEIGHT: f32 = 300.0;

/// What a folder has, or why that is not known.
type Listing = Result<Vec<Entry>, ViewerError>;

/// What the user decided.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Choice {
    /// The file is to be opened.
    Open(PathBuf),
    /// No file is.
    Cancel,
}

/// The choice of a file.
pub(crate) struct OpenDialog {
    /// The folder that is listed.
    pub folder: PathBuf,
    /// Text of the field that names the folder or a file.
    path: String,
    reading: Receiver<Listing>,
    /// `None` while the folder is being read.
    listing: Option<Listing>,
    /// Number of the entry that is chosen.
    chosen: Option<usize>,
}

impl OpenDialog {
    /// Begins with a folder.
    pub(crate) fn new(folder: PathBuf) -> OpenDialog {
        let (path, reading) = (folder.display().to_string(), read(&folder));
        OpenDialog { folder, path, reading, listing: None, chosen: None }
    }

    /// Draws the dialog over everything else; returns what the user decided, once that is so. Arrows choose, Enter opens,
    /// Backspace goes to the folder above, Escape cancels.
    pub(crate) fn show(&mut self, ui: &egui::Ui) -> Option<Choice> {
        if self.listing.is_none() {
            self.listing = self.reading.try_recv().ok();
            ui.ctx().request_repaint_after(POLL);
        }
        let before = self.chosen;
        let typing = ui.ctx().egui_wants_keyboard_input();
        let mut taken = if typing { None } else { self.follow_keys(ui) };
        let mut cancelled = !typing && is_pressed(ui, Key::Escape);
        let moved = self.chosen != before;
        egui::Modal::new(egui::Id::unique("open a file")).show(ui.ctx(), |ui| {
            ui.set_width(WIDTH);
            ui.heading("Open a file");
            ui.horizontal(|ui| {
                if ui.button("up").on_hover_text("the folder above, Backspace").clicked() {
                    taken = self.folder.parent().map(Path::to_path_buf);
                }
                let field = ui.add(egui::TextEdit::singleline(&mut self.path).desired_width(f32::INFINITY));
                if field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter)) {
                    taken = Some(self.folder.join(self.path.trim()));
                }
            });
            taken = self.show_list(ui, moved).or(taken.take());
            ui.horizontal(|ui| {
                let open = ui.add_enabled(self.chosen.is_some(), egui::Button::new("Open"));
                if open.on_hover_text("Enter").clicked() {
                    taken = self.chosen_path();
                }
                cancelled |= ui.button("Cancel").on_hover_text("Escape").clicked();
                ui.small(".spmm .voltex .obj .gltf .glb .hdr .exr .toml");
            });
        });
        match taken {
            _ if cancelled => Some(Choice::Cancel),
            // A link to a folder is one, and what is neither is for the caller to refuse.
            Some(path) if path.is_dir() => {
                *self = OpenDialog::new(path);
                ui.ctx().request_repaint();
                None
            }
            taken => taken.map(Choice::Open),
        }
    }

    fn entries(&self) -> &[Entry] {
        self.listing.as_ref().and_then(|listing| listing.as_deref().ok()).unwrap_or_default()
    }

    fn chosen_path(&self) -> Option<PathBuf> {
        self.chosen.and_then(|number| self.entries().get(number)).map(|entry| entry.path.clone())
    }

    /// Draws the folder; returns what a double click opens. An entry to which keys have `moved` is scrolled to.
    fn show_list(&mut self, ui: &mut egui::Ui, moved: bool) -> Option<PathBuf> {
        let mut chosen = self.chosen;
        let mut opened = None;
        let area = egui::ScrollArea::vertical().max_height(LIST_HEIGHT).min_scrolled_height(LIST_HEIGHT);
        area.auto_shrink([false; 2]).show(ui, |ui| match &self.listing {
            None => drop(ui.label("reading the folder")),
            Some(Err(error)) => drop(ui.colored_label(egui::Color32::LIGHT_RED, error.to_string())),
            Some(Ok(entries)) if entries.is_empty() => drop(ui.label("nothing here that can be opened")),
            Some(Ok(entries)) => {
                for (number, entry) in entries.iter().enumerate() {
                    let name = format!("{}{}", entry.name, if entry.is_folder { "/" } else { "" });
                    let row = ui.selectable_label(chosen == Some(number), name);
                    if row.clicked() {
                        chosen = Some(number);
                    }
                    if row.double_clicked() {
                        opened = Some(entry.path.clone());
                    }
                    if moved && chosen == Some(number) {
                        row.scroll_to_me(None);
                    }
                }
            }
        });
        if chosen != self.chosen {
            self.chosen = chosen;
            ui.ctx().request_repaint();
        }
        opened
    }

    /// Does what the keys ask for; returns what they open.
    fn follow_keys(&mut self, ui: &egui::Ui) -> Option<PathBuf> {
        let last = self.entries().len().checked_sub(1);
        if is_pressed(ui, Key::ArrowDown) {
            self.chosen = last.map(|last| self.chosen.map_or(0, |number| (number + 1).min(last)));
        }
        if is_pressed(ui, Key::ArrowUp) {
            self.chosen = last.map(|last| self.chosen.map_or(last, |number| number.saturating_sub(1)));
        }
        if is_pressed(ui, Key::Backspace) {
            return self.folder.parent().map(Path::to_path_buf);
        }
        self.chosen_path().filter(|_| is_pressed(ui, Key::Enter))
    }
}

/// Reads a folder on another thread.
fn read(folder: &Path) -> Receiver<Listing> {
    let folder = folder.to_path_buf();
    in_background(move || list(&folder))
}
