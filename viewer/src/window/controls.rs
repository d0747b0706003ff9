//! What the user holds in hand beside the scene: the panel, what the window remembers, and what goes on.

use super::panels::open_dialog::{Choice, OpenDialog};
use super::panels::panel::Panel;
use super::panels::thumbnails::Thumbnails;
use super::panels::unsaved::UnsavedDialog;
use super::pictures::renderer::Renderer;
use super::settings::Settings;
use super::turntable::Turntable;
use crate::error::ViewerError;
use crate::gpu::backend::BackendChoice;
use crate::gpu::backend::GpuTracer;
use crate::gpu::device::Gpu;
use crate::scene::scene::Scene;
use glam::Vec3;
use std::path::PathBuf;

/// State of the window's controls beside the scene.
pub(super) struct Controls {
    pub panel: Panel,
    /// The renderers that the adapter has, the CPU's last.
    pub renderers: Vec<Renderer>,
    pub settings: Settings,
    pub thumbnails: Thumbnails,
    /// What drags turn the camera about, where a double click chose it; world.
    pub pivot: Option<Vec3>,
    /// The turntable that is being written.
    pub turntable: Option<Turntable>,
    /// The question what becomes of unsaved edits, while it is asked.
    pub dialog: Option<UnsavedDialog>,
    /// The choice of a file to open, while it is made.
    pub open_dialog: Option<OpenDialog>,
    /// The folder in which a file was chosen last.
    pub folder: Option<PathBuf>,
    /// Whether the keys are explained.
    pub help: bool,
    /// Whether the panel of a narrow window is open, and that of its leaves.
    pub narrow_panel_is_open: bool,
    pub narrow_leaf_is_open: bool,
    /// Whether the host has a choice of files of its own.
    pub host_chooses_files: bool,
    /// Whether the host is to show it.
    pub file_wanted: bool,
    /// Message of the latest saving or opening.
    pub message: Option<String>,
}

impl Controls {
    pub fn new(panel: Panel, renderers: Vec<Renderer>, settings: Settings) -> Controls {
        Controls {
            panel,
            renderers,
            settings,
            thumbnails: Thumbnails::default(),
            pivot: None,
            turntable: None,
            dialog: None,
            open_dialog: None,
            folder: None,
            help: false,
            narrow_panel_is_open: false,
            narrow_leaf_is_open: false,
            host_chooses_files: false,
            file_wanted: false,
            message: None,
        }
    }

    /// Follows another scene.
    pub fn switch_scene(&mut self, scene: &Scene) {
        self.panel = Panel::new(scene, self.panel.shade, self.panel.renderer);
        self.thumbnails = Thumbnails::default();
        self.pivot = None;
    }

    /// Tells whether a dialog takes the keys.
    pub fn asks(&self) -> bool {
        self.dialog.is_some() || self.open_dialog.is_some()
    }

    /// Begins the choice of a file to open, unless a dialog is there.
    pub fn choose_file(&mut self) {
        if self.host_chooses_files {
            self.file_wanted = true;
            return;
        }
        if !self.asks() {
            let here = || std::env::current_dir().unwrap_or_default();
            self.open_dialog = Some(OpenDialog::new(self.folder.clone().unwrap_or_else(here)));
        }
    }

    /// Draws the choice of a file while it is made; returns the file once it is chosen.
    pub fn show_open_dialog(&mut self, ui: &egui::Ui) -> Option<PathBuf> {
        let dialog = self.open_dialog.as_mut()?;
        let choice = dialog.show(ui)?;
        self.folder = Some(dialog.folder.clone());
        self.open_dialog = None;
        ui.ctx().request_repaint();
        match choice {
            Choice::Open(path) => Some(path),
            Choice::Cancel => None,
        }
    }

    /// Begins a turntable, unless one is being written.
    pub fn begin_turntable(&mut self) {
        if self.turntable.is_some() {
            return;
        }
        match Turntable::new() {
            Ok(turntable) => {
                // The pictures of a turntable are of one moment.
                self.panel.wind.plays = false;
                self.turntable = Some(turntable);
            }
            Err(error) => self.message = Some(error.to_string()),
        }
    }
}

/// Returns the renderers of an adapter, and the one to begin with: the one that is asked for, else the one that was
/// used last, else the adapter's best.
///
/// # Errors
/// [`ViewerError::NoAdapter`] where the adapter has not what is asked for.
pub(super) fn renderers_of(
    gpu: &Gpu,
    asked: BackendChoice,
    settings: &Settings,
) -> Result<(Vec<Renderer>, Renderer), ViewerError> {
    let mut renderers = vec![Renderer::Gpu(GpuTracer::Bvh), Renderer::Cpu];
    if gpu.has_ray_query() {
        renderers.insert(0, Renderer::Gpu(GpuTracer::RayQuery));
    }
    let renderer = match asked {
        BackendChoice::Auto => {
            let last = renderers.iter().find(|renderer| settings.renderer.as_deref() == Some(renderer.name()));
            last.copied().unwrap_or(Renderer::Gpu(gpu.best_tracer()))
        }
        BackendChoice::Cpu => Renderer::Cpu,
        BackendChoice::Gpu(tracer) => {
            gpu.require(tracer)?;
            Renderer::Gpu(tracer)
        }
    };
    Ok((renderers, renderer))
}
