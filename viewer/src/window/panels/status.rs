//! The panel's part that tells what is drawn by what, and how fast.

use crate::gpu::results::timer::PassTimes;
use crate::render::governor::Spending;
use crate::scene::material::Body;
use crate::window::pictures::progress::Progress;
use crate::window::pictures::renderer::Renderer;

/// Values that the panel shows but does not change.
pub(crate) struct Status<'a> {
    /// Name of the GPU.
    pub adapter: &'a str,
    /// The renderers to choose from.
    pub renderers: &'a [Renderer],
    /// Progress of the picture.
    pub progress: &'a Progress,
    /// What is being done to make the renderer ready.
    pub preparation: Option<&'a str>,
    /// Clock of the frame times.
    pub timer: &'static str,
    /// Width and height of the picture, pixels.
    pub picture: [u32; 2],
    /// Samples of the picture that is shown, where its noise is filtered out.
    pub filtered_samples: Option<u32>,
    /// Residual components of the asset that has most.
    pub max_components: u32,
    /// What is loaded of volumes that are stored by brick.
    pub volumes: Option<&'a str>,
    /// Message of the latest saving or opening.
    pub message: Option<&'a str>,
    /// What split views show something else in place of.
    pub at_hand: Body,
}

impl Status<'_> {
    /// Draws the status; the user may choose another `renderer`.
    pub(crate) fn show(&self, ui: &mut egui::Ui, renderer: &mut Renderer) {
        let progress = self.progress;
        ui.label(self.adapter);
        egui::ComboBox::from_label("backend").selected_text(renderer.name()).show_ui(ui, |ui| {
            for choice in self.renderers {
                ui.selectable_value(renderer, *choice, choice.name());
            }
        });
        match (self.preparation, progress.frame_ms) {
            (Some(preparation), _) => ui.label(preparation),
            (None, Some(ms)) => ui.label(format!("{ms:.2} ms per frame ({})", self.timer)),
            (None, None) => ui.label("measuring"),
        };
        if let (None, Some(PassTimes { camera_ms, volume_ms, light_ms, bounce_ms })) =
            (self.preparation, progress.passes)
        {
            let volumes = if volume_ms > 0.0 { format!("volumes {volume_ms:.2}, ") } else { String::new() };
            ui.small(format!("camera {camera_ms:.2}, {volumes}light {light_ms:.2}, further rays {bounce_ms:.2} ms"));
        }
        ui.label(format!("{} x {}, {} samples", self.picture[0], self.picture[1], progress.samples));
        if let Some(samples) = self.filtered_samples {
            ui.small(format!("shown: noise of {samples} samples filtered out"));
        }
        if let Some(governor) = &progress.governor {
            let Spending { components, lobes, lights } = governor.spends();
            let of = self.max_components;
            ui.small(format!(
                "budget {:.1} ms: {components} of {of} components, {lobes} lobes, {lights} lights at most",
                governor.budget_ms()
            ));
        }
        if let Some(volumes) = self.volumes {
            ui.small(volumes);
        }
        if let Some(problem) = &progress.problem {
            ui.colored_label(egui::Color32::LIGHT_RED, problem);
        }
    }
}
