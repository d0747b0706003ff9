//! Holds a frame-time budget: what a frame costs is learned from frames, and components, then lobes, then lights, are
//! what it may spend.
//!
//! Components and lobes together are the *detail* of decoding. The time of a frame is taken as
//! `fixed + per_detail x detail`, both learned with old frames forgotten; the share of the lights' rays is in both.
//! Components go first, because they cost least to the eye (docs/results/scalability.md), then lobes; with one lobe left, fewer
//! lights are drawn a frame.

use crate::options::ShadeOptions;
use crate::scene::scene::Scene;

/// Share of what is known that a new frame replaces.
const LEARNING: f64 = 0.3;
/// Deviation from the budget that is left alone, so that settings do not flutter.
const DEAD_BAND: f64 = 0.05;
/// The share of the budget that is aimed at.
const AIM: f64 = 0.97;
/// Detail by which a setting is changed to learn what it costs.
const PROBE: u32 = 4;

/// The limits of what a frame may ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Spending {
    /// Residual components.
    pub components: u32,
    /// Lobes of a texel.
    pub lobes: u32,
    /// Point lights.
    pub lights: u32,
}

impl Spending {
    /// Returns as much as there is to spend in a scene.
    pub fn all_of(scene: &Scene) -> Spending {
        Spending { components: scene.most_components(), lobes: scene.most_lobes(), lights: scene.lights.len() as u32 }
    }
}

/// The limits of what frames may spend, and the times that frames were seen to take.
#[derive(Debug, Clone, PartialEq)]
pub struct Governor {
    budget_ms: f64,
    most: Spending,
    detail: u32,
    lights: u32,
    /// Learned: milliseconds a component or lobe.
    per_detail_ms: f64,
    /// Last frame of another detail, and its time.
    before: Option<(u32, f64)>,
    /// Smoothed time of frames with the settings at hand.
    now_ms: Option<f64>,
}

impl Governor {
    /// Returns a governor for frames of `budget_ms`, above 0, in a scene that has `most` to spend; begins with all of
    /// it.
    pub fn new(budget_ms: f64, most: Spending) -> Governor {
        let most = Spending { components: most.components, lobes: most.lobes.max(1), lights: most.lights.max(1) };
        Governor {
            budget_ms,
            most,
            detail: most.components + most.lobes,
            lights: most.lights,
            per_detail_ms: 0.0,
            before: None,
            now_ms: None,
        }
    }

    /// Tells how many point lights there are now; with another number it begins with all of them again.
    pub fn set_lights(&mut self, lights: u32) {
        if lights.max(1) != self.most.lights {
            *self = Governor::new(self.budget_ms, Spending { lights, ..self.most });
        }
    }

    /// Limits `asked` to what the budget allows.
    pub fn settings(&self, asked: &ShadeOptions) -> ShadeOptions {
        let (mut shade, spends) = (*asked, self.spends());
        shade.decode.components = shade.decode.components.min(spends.components);
        shade.decode.lobes = shade.decode.lobes.min(spends.lobes);
        shade.light_samples = shade.light_samples.min(spends.lights);
        shade
    }

    /// Returns the budget, milliseconds.
    pub fn budget_ms(&self) -> f64 {
        self.budget_ms
    }

    /// Returns what a frame may ask for.
    pub fn spends(&self) -> Spending {
        let lobes = self.detail.min(self.most.lobes);
        Spending { components: self.detail - lobes, lobes, lights: self.lights }
    }

    /// Tells the time of a frame with the present settings, and chooses the next ones.
    pub fn observe(&mut self, frame_ms: f64) {
        let now = self.now_ms.map_or(frame_ms, |old| old + LEARNING * (frame_ms - old));
        self.now_ms = Some(now);
        if let Some((detail, ms)) = self.before
            && detail != self.detail
        {
            let slope = ((now - ms) / (f64::from(self.detail) - f64::from(detail))).max(0.0);
            self.per_detail_ms +=
                if self.per_detail_ms > 0.0 { LEARNING * (slope - self.per_detail_ms) } else { slope };
        }
        if (now / self.budget_ms - AIM).abs() < DEAD_BAND {
            return;
        }
        let spare_ms = AIM * self.budget_ms - now;
        if self.lights < self.most.lights && spare_ms > 0.0 || self.detail == 1 && spare_ms < 0.0 {
            // Rays to lights take all that decoding leaves, in proportion.
            let share = (AIM * self.budget_ms / now).clamp(0.5, 2.0);
            let lights = (f64::from(self.lights) * share).round() as u32;
            let lights = lights.clamp(1, self.most.lights);
            if lights != self.lights {
                self.lights = lights;
                self.now_ms = None;
                self.before = None;
                return;
            }
        }
        let step = if self.per_detail_ms > 0.0 {
            (spare_ms / self.per_detail_ms).round() as i64
        } else {
            i64::from(PROBE) * spare_ms.signum() as i64
        };
        // Not farther at once than to a half or the double: what was learned elsewhere may not hold there.
        let most = i64::from((self.detail / 2).max(PROBE));
        let all = i64::from(self.most.components + self.most.lobes);
        let detail = (i64::from(self.detail) + step.clamp(-most, most)).clamp(1, all);
        if detail != i64::from(self.detail) {
            self.before = Some((self.detail, now));
            self.detail = detail as u32;
            self.now_ms = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn most(components: u32, lights: u32) -> Spending {
        Spending { components, lobes: 4, lights }
    }

    /// A clock that stands in for a GPU: what a frame with these settings takes, give or take a few percent.
    fn frame_ms(governor: &Governor, fixed: f64, per_detail: f64, per_light: f64, frame: u32) -> f64 {
        let Spending { components, lobes, lights } = governor.spends();
        let noise = 1.0 + 0.03 * (f64::from(frame) * 2.399).sin();
        noise * (fixed + f64::from(lights) * (per_light + per_detail * f64::from(components + lobes - 1)))
    }

    /// Mean time of frames 60 to 100, over the budget.
    fn settled(governor: &mut Governor, fixed: f64, per_detail: f64, per_light: f64) -> f64 {
        let mut sum = 0.0;
        for frame in 0..100 {
            let ms = frame_ms(governor, fixed, per_detail, per_light, frame);
            governor.observe(ms);
            sum += if frame >= 60 { ms / 40.0 } else { 0.0 };
        }
        sum / governor.budget_ms()
    }

    #[test]
    fn a_budget_is_held_within_a_tenth_on_scenes_of_any_cost() {
        for (fixed, per_detail, per_light) in [(2.0, 0.2, 0.5), (8.0, 0.15, 1.0), (1.0, 0.5, 3.0)] {
            let mut governor = Governor::new(16.0, most(100, 1));
            let share = settled(&mut governor, fixed, per_detail, per_light);
            assert!((share - 1.0).abs() < 0.1, "{fixed} {per_detail} {per_light}: {share}, {governor:?}");
            // The scene becomes dearer, then cheaper.
            for factor in [2.5, 0.7] {
                let share = settled(&mut governor, fixed, factor * per_detail, per_light);
                let full = fixed + per_light + factor * per_detail * 103.0;
                let expected = if full < 16.0 { full / 16.0 } else { 1.0 };
                assert!((share / expected - 1.0).abs() < 0.1, "x {factor}: {share} of {expected}, {governor:?}");
            }
        }
    }

    #[test]
    fn lights_are_drawn_fewer_once_no_component_is_left() {
        let mut governor = Governor::new(10.0, most(30, 400));
        let share = settled(&mut governor, 1.0, 0.01, 0.1);
        assert!((share - 1.0).abs() < 0.1, "{share} {governor:?}");
        assert!(governor.spends().lights < 100, "{governor:?}");
    }

    #[test]
    fn what_is_within_the_budget_is_spent_whole_and_what_cannot_be_held_is_spent_least() {
        let mut rich = Governor::new(100.0, most(50, 3));
        settled(&mut rich, 2.0, 0.1, 1.0);
        assert_eq!(rich.spends(), most(50, 3));
        let mut poor = Governor::new(1.0, most(50, 3));
        settled(&mut poor, 20.0, 0.1, 1.0);
        let least = Spending { components: 0, lobes: 1, lights: 1 };
        assert_eq!(poor.spends(), least);
        poor.set_lights(3);
        assert_eq!(poor.spends(), least, "nothing changed");
        let mut more = poor.clone();
        more.set_lights(5);
        assert_eq!(more.spends(), most(50, 5));
        let asked = ShadeOptions::default();
        let held = poor.settings(&asked);
        assert_eq!((held.decode.components, held.decode.lobes, held.light_samples), (0, 1, 1));
        let mut few = asked;
        few.decode.components = 7;
        assert_eq!(rich.settings(&few).decode.components, 7);
    }
}
