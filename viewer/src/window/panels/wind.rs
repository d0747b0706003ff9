//! The panel's part for a scene with a wind: how hard it blows, and whether time goes on. While it does, every frame is
//! of a moment of its own and has one sample.

use crate::scene::scene::Scene;
use crate::volume::skin::MAX_WIND_SPEED;
use web_time::Instant;

/// Longest time that passes from one frame to the next, seconds: after a pause gusts go on where they were.
const LONGEST_STEP_S: f64 = 0.25;

/// The clock of the wind.
#[derive(Debug, Default)]
pub(crate) struct WindPanel {
    /// Whether time goes on.
    pub plays: bool,
    /// When time last went on.
    last: Option<Instant>,
}

impl WindPanel {
    /// Makes the clock of a scene, whose wind blows from the beginning.
    pub(crate) fn new(scene: &Scene) -> WindPanel {
        WindPanel { plays: scene.wind.is_some(), last: None }
    }

    /// Draws the panel where there is a wind; returns `true` if the wind moved the scene's skins.
    pub(crate) fn show(&mut self, ui: &mut egui::Ui, scene: &mut Scene) -> bool {
        let Some(wind) = &mut scene.wind else { return false };
        ui.checkbox(&mut self.plays, format!("wind blows (B), {:.1} s", scene.time_s));
        let speed = egui::Slider::new(&mut wind.speed_m_per_s, 0.0..=MAX_WIND_SPEED).text("wind, m/s");
        let stronger = ui.add(speed).changed();
        let passed_s = self.step(Instant::now());
        if self.plays {
            ui.ctx().request_repaint();
        }
        // A wind that was checked, at a time that is a number.
        (stronger || passed_s > 0.0) && scene.blow(scene.time_s + passed_s).is_ok()
    }

    /// Returns the seconds of the wind since the last call.
    fn step(&mut self, now: Instant) -> f64 {
        let last = std::mem::replace(&mut self.last, self.plays.then_some(now));
        let passed = last.filter(|_| self.plays).map_or(0.0, |last| now.saturating_duration_since(last).as_secs_f64());
        passed.min(LONGEST_STEP_S)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn time_goes_on_while_it_plays_and_long_pauses_are_no_leaps() {
        let mut panel = WindPanel { plays: true, last: None };
        let start = Instant::now();
        let mut at = |ms: u64, plays: bool| {
            panel.plays = plays;
            panel.step(start + Duration::from_millis(ms))
        };
        assert_eq!(at(0, true), 0.0);
        assert!((at(40, true) - 0.04).abs() < 1e-9);
        assert_eq!(at(5_000, true), LONGEST_STEP_S);
        assert_eq!(at(5_100, false), 0.0);
        // What passed while it stood still is over.
        assert_eq!(at(9_000, true), 0.0);
        assert!((at(9_010, true) - 0.01).abs() < 1e-9);
    }
}
