//! Holds a frame-time budget: what a frame costs is learned from frames, and components, then lights, are what it may spend.
//!
//! The time of a frame is taken as `fixed + per_component x components`, both learned with old frames forgotten; the share
//! of the lights' rays is in both. Components go first, because they cost least to the eye (docs/SCALABILITY.md); with none
//! left, fewer lights are drawn a frame.

use crate::options::ShadeOptions;

/// Share of what is known that a new frame replaces.
const LEARNING: f64 = 0.3;
/// Deviation from the budget that is left alone, so that settings do not flutter.
const DEAD_BAND: f64 = 0.05;
/// What is aimed at, as a share of the budget.
const AIM: f64 = 0.97;
/// Components by which a setting is changed to learn what they cost.
const PROBE: u32 = 4;

/// What frames may spend, and what they were seen to cost.
#[derive(Debug, Clone, PartialEq)]
pub struct Governor {
    budget_ms: f64,
    most_components: u32,
    most_lights: u32,
    components: u32,
    lights: u32,
    /// Learned: milliseconds a component.
    per_component_ms: f64,
    /// Last frame with another number of components, and its time.
    before: Option<(u32, f64)>,
    /// Smoothed time of frames with the settings at hand.
    now_ms: Option<f64>,
}

impl Governor {
    /// For frames of `budget_ms`, above 0, in a scene whose assets have up to `most_components` and which has `lights` point
    /// lights; begins with all of them.
    pub fn new(budget_ms: f64, most_components: u32, lights: u32) -> Governor {
        let lights = lights.max(1);
        Governor {
            budget_ms,
            most_components,
            most_lights: lights,
            components: most_components,
            lights,
            per_component_ms: 0.0,
            before: None,
            now_ms: None,
        }
    }

    /// Tells how many point lights there are now; with another number it begins with all of them again.
    pub fn set_lights(&mut self, lights: u32) {
        if lights.max(1) != self.most_lights {
            *self = Governor::new(self.budget_ms, self.most_components, lights);
        }
    }

    /// `asked` within what the budget allows.
    pub fn settings(&self, asked: &ShadeOptions) -> ShadeOptions {
        let mut shade = *asked;
        shade.decode.components = shade.decode.components.min(self.components);
        shade.light_samples = shade.light_samples.min(self.lights);
        shade
    }

    /// The budget, milliseconds.
    pub fn budget_ms(&self) -> f64 {
        self.budget_ms
    }

    /// Components and lights that a frame may ask for.
    pub fn spends(&self) -> (u32, u32) {
        (self.components, self.lights)
    }

    /// Tells the time of a frame with the present settings, and chooses the next ones.
    pub fn observe(&mut self, frame_ms: f64) {
        let now = self.now_ms.map_or(frame_ms, |old| old + LEARNING * (frame_ms - old));
        self.now_ms = Some(now);
        if let Some((components, ms)) = self.before
            && components != self.components
        {
            let slope = ((now - ms) / (f64::from(self.components) - f64::from(components))).max(0.0);
            self.per_component_ms +=
                if self.per_component_ms > 0.0 { LEARNING * (slope - self.per_component_ms) } else { slope };
        }
        if (now / self.budget_ms - AIM).abs() < DEAD_BAND {
            return;
        }
        let spare_ms = AIM * self.budget_ms - now;
        if self.lights < self.most_lights && spare_ms > 0.0 || self.components == 0 && spare_ms < 0.0 {
            // Rays to lights take all that components leave, in proportion.
            let share = (AIM * self.budget_ms / now).clamp(0.5, 2.0);
            let lights = (f64::from(self.lights) * share).round() as u32;
            let lights = lights.clamp(1, self.most_lights);
            if lights != self.lights {
                self.lights = lights;
                self.now_ms = None;
                self.before = None;
                return;
            }
        }
        let step = if self.per_component_ms > 0.0 {
            (spare_ms / self.per_component_ms).round() as i64
        } else {
            i64::from(PROBE) * spare_ms.signum() as i64
        };
        // Not farther at once than to a half or the double: what was learned elsewhere may not hold there.
        let most = i64::from((self.components / 2).max(PROBE));
        let components =
            (i64::from(self.components) + step.clamp(-most, most)).clamp(0, i64::from(self.most_components));
        if components != i64::from(self.components) {
            self.before = Some((self.components, now));
            self.components = components as u32;
            self.now_ms = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A clock that stands in for a GPU: what a frame with these settings takes, give or take a few percent.
    fn frame_ms(governor: &Governor, fixed: f64, per_component: f64, per_light: f64, frame: u32) -> f64 {
        let (components, lights) = governor.spends();
        let noise = 1.0 + 0.03 * (f64::from(frame) * 2.399).sin();
        noise * (fixed + f64::from(lights) * (per_light + per_component * f64::from(components)))
    }

    /// Mean time of frames 60 to 100, over the budget.
    fn settled(governor: &mut Governor, fixed: f64, per_component: f64, per_light: f64) -> f64 {
        let mut sum = 0.0;
        for frame in 0..100 {
            let ms = frame_ms(governor, fixed, per_component, per_light, frame);
            governor.observe(ms);
            sum += if frame >= 60 { ms / 40.0 } else { 0.0 };
        }
        sum / governor.budget_ms()
    }

    #[test]
    fn a_budget_is_held_within_a_tenth_on_scenes_of_any_cost() {
        for (fixed, per_component, per_light) in [(2.0, 0.2, 0.5), (8.0, 0.15, 1.0), (1.0, 0.5, 3.0)] {
            let mut governor = Governor::new(16.0, 100, 1);
            let share = settled(&mut governor, fixed, per_component, per_light);
            assert!((share - 1.0).abs() < 0.1, "{fixed} {per_component} {per_light}: {share}, {governor:?}");
            // The scene becomes dearer, then cheaper.
            for factor in [2.5, 0.7] {
                let share = settled(&mut governor, fixed, factor * per_component, per_light);
                let full = fixed + per_light + factor * per_component * 100.0;
                let expected = if full < 16.0 { full / 16.0 } else { 1.0 };
                assert!((share / expected - 1.0).abs() < 0.1, "x {factor}: {share} of {expected}, {governor:?}");
            }
        }
    }

    #[test]
    fn lights_are_drawn_fewer_once_no_component_is_left() {
        let mut governor = Governor::new(10.0, 30, 400);
        let share = settled(&mut governor, 1.0, 0.01, 0.1);
        assert!((share - 1.0).abs() < 0.1, "{share} {governor:?}");
        let (_, lights) = governor.spends();
        assert!(lights < 100, "{governor:?}");
    }

    #[test]
    fn what_is_within_the_budget_is_spent_whole_and_what_cannot_be_held_is_spent_least() {
        let mut rich = Governor::new(100.0, 50, 3);
        settled(&mut rich, 2.0, 0.1, 1.0);
        assert_eq!(rich.spends(), (50, 3));
        let mut poor = Governor::new(1.0, 50, 3);
        settled(&mut poor, 20.0, 0.1, 1.0);
        assert_eq!(poor.spends(), (0, 1));
        poor.set_lights(3);
        assert_eq!(poor.spends(), (0, 1), "nothing changed");
        let mut more = poor.clone();
        more.set_lights(5);
        assert_eq!(more.spends(), (50, 5));
        let asked = ShadeOptions::default();
        assert_eq!((poor.settings(&asked).decode.components, poor.settings(&asked).light_samples), (0, 1));
        let mut few = asked;
        few.decode.components = 7;
        assert_eq!(rich.settings(&few).decode.components, 7);
    }
}
