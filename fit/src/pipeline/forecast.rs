//! Forecast of the time that a fit still takes: the share of each stage in a fit is known roughly, and the time so far
//! tells how fast this machine and this capture are.

use crate::params::ValidFitParams;

/// A stage with its seconds in a fit of 256 x 256 texels of cloth, 81 x 81 directions, two cores: with `--bytes 2MB`,
/// where the residual holds the whole value, and without a goal, where every texel stores its lobes (those of a smaller
/// leaf). Only their ratios matter, and errors in those wear off as the fit goes on.
struct Known {
    name: &'static str,
    whole_s: f64,
    stored_s: f64,
}

const fn known(name: &'static str, whole_s: f64, stored_s: f64) -> Known {
    Known { name, whole_s, stored_s }
}

/// The stages of a layer, in order.
const LAYER_STAGES: [Known; 8] = [
    known("read", 2.6, 1.5),
    known("project", 7.5, 6.3),
    known("cluster", 0.7, 1.8),
    known("dictionary", 2.2, 43.2),
    known("weights", 0.4, 10.1),
    known("residual", 0.5, 36.1),
    known(PREDICT, 1.5, 0.0),
    known(HEIGHTS, 8.6, 8.6),
];
/// The stages that follow those of all layers.
const LAST_STAGES: [Known; 4] =
    [known(ENCODE, 2.5, 0.9), known(RELIEF, 3.0, 0.0), known("measure", 5.2, 22.2), known(REPORT, 4.3, 11.1)];
const ENCODE: &str = "encode";
const PREDICT: &str = "predict";
const HEIGHTS: &str = "heights";
const RELIEF: &str = "relief";
const REPORT: &str = "report";
/// Share of itself up to which a stage counts at most that does not tell how far it is.
const MAX_UNTOLD: f64 = 0.95;

/// Time that a fit still needs, in seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Left {
    /// Seconds of the current stage; `None` where it does not tell how far it is.
    pub stage_s: Option<f64>,
    /// Seconds of the whole fit; `None` at its very start.
    pub whole_s: Option<f64>,
}

/// Progress of a stage.
#[derive(Debug, Clone, Copy, PartialEq)]
enum State {
    Waiting,
    /// A stage that has begun, and perhaps ended; this share of it is done.
    Begun(f64),
    /// A stage whose result was kept from an earlier run.
    Passed,
}

#[derive(Debug, Clone)]
struct Planned {
    name: &'static str,
    /// Layer of the stage; one behind the last layer for the stages that follow.
    layer: usize,
    share: f64,
    state: State,
    /// Seconds spent in the stage so far.
    seconds: f64,
}

/// The stage that a fit ends with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LastStage {
    /// The measurement of the packed asset.
    Measure,
    /// The report's page, which follows the measurement.
    Report,
}

/// Follower of a fit's progress. Clocks are the caller's: seconds from any start on, never falling.
#[derive(Debug, Clone)]
pub struct Forecast {
    /// Stages in order.
    plan: Vec<Planned>,
    /// The stage at hand.
    at: usize,
    last_s: Option<f64>,
}

impl Forecast {
    /// Plans a fit of `layers` captures with `params` that ends with the stage `last`.
    pub fn new(layers: usize, params: &ValidFitParams, last: LastStage) -> Forecast {
        let report = last == LastStage::Report;
        let seconds = |known: &Known| if params.stores_lobes() { known.stored_s } else { known.whole_s };
        let planned = |known: &Known, layer: usize, times: usize| Planned {
            name: known.name,
            layer,
            share: seconds(known) * times as f64,
            state: State::Waiting,
            seconds: 0.0,
        };
        let is_run = |known: &&Known| match known.name {
            HEIGHTS => params.finds_heights(),
            PREDICT => params.predicts_lobes(),
            _ => true,
        };
        let of_layer = LAYER_STAGES.iter().filter(is_run);
        let of_layers = (0..layers).flat_map(|layer| of_layer.clone().map(move |known| (known, layer, 1)));
        let is_last = |known: &&Known| match known.name {
            REPORT => report,
            RELIEF => params.finds_heights() && params.predicts_lobes(),
            _ => true,
        };
        let last = LAST_STAGES.iter().filter(is_last);
        // Each of these takes its time for every layer.
        let last = last.map(|known| (known, layers, layers));
        let plan = of_layers.chain(last).map(|(known, layer, times)| planned(known, layer, times)).collect();
        Forecast { plan, at: 0, last_s: None }
    }

    /// Takes in that `stage` has done `done` of `total` parts (0 of 0: it does not tell) at `now_s`; returns the time
    /// left.
    ///
    /// Stages whose results were there already do not count: those that are passed over, and those whose first report
    /// is that they are done. A stage may run inside another, as images are read when they are asked for first.
    pub fn report(&mut self, stage: &str, done: usize, total: usize, now_s: f64) -> Left {
        let passed_s = now_s - self.last_s.replace(now_s).unwrap_or(now_s);
        let at_hand = &mut self.plan[self.at];
        if let State::Begun(_) = at_hand.state {
            at_hand.seconds += passed_s;
        }
        if at_hand.name != stage {
            self.turn_to(stage);
        }
        let told = (total > 0).then(|| (done as f64 / total as f64).clamp(0.0, 1.0));
        let (before_s, before) = self.spent(|number| number != self.at);
        let at_hand = &mut self.plan[self.at];
        // What is not in the plan says nothing about the stage at hand.
        let told = told.filter(|_| at_hand.name == stage);
        if at_hand.name == stage && at_hand.state == State::Waiting {
            at_hand.state = if told == Some(1.0) { State::Passed } else { State::Begun(0.0) };
        }
        if let State::Begun(begun) = &mut at_hand.state {
            // Without a word from it: as far as the speed so far makes it likely.
            let likely = at_hand.seconds * before / (before_s * at_hand.share).max(1e-9);
            *begun = told.unwrap_or(likely.min(MAX_UNTOLD)).max(*begun);
        }
        let stage_s = told.filter(|told| *told > 0.0).map(|told| at_hand.seconds * (1.0 / told - 1.0));
        let (elapsed_s, made) = self.spent(|_| true);
        let whole_s = (made > 0.0 && elapsed_s > 0.0).then(|| elapsed_s / made * self.to_come());
        Left { stage_s, whole_s }
    }

    /// Makes `stage` the current one, if it is in the plan.
    fn turn_to(&mut self, stage: &str) {
        let layer = self.plan[self.at].layer;
        // One that was to come earlier and runs only now, inside the one at hand.
        let inside = self.plan[..self.at]
            .iter()
            .position(|planned| planned.name == stage && planned.layer == layer && planned.state == State::Waiting);
        if let Some(inside) = inside {
            self.at = inside;
        } else if let Some(ahead) = self.plan[self.at..].iter().position(|planned| planned.name == stage) {
            for planned in &mut self.plan[self.at..self.at + ahead] {
                if let State::Begun(done) = &mut planned.state {
                    *done = 1.0;
                }
            }
            self.at += ahead;
        }
    }

    /// Returns the shares that are still to come. A stage that waits before the current one will hardly be needed.
    fn to_come(&self) -> f64 {
        let of = |(number, planned): (usize, &Planned)| match planned.state {
            State::Begun(done) => (1.0 - done) * planned.share,
            State::Waiting if number > self.at => planned.share,
            _ => 0.0,
        };
        self.plan.iter().enumerate().map(of).sum()
    }

    /// Returns the seconds and done shares of the chosen stages that have begun.
    fn spent(&self, which: impl Fn(usize) -> bool) -> (f64, f64) {
        let chosen = self.plan.iter().enumerate().filter(|(number, _)| which(*number));
        chosen.fold((0.0, 0.0), |(seconds, made), (_, planned)| match planned.state {
            State::Begun(done) => (seconds + planned.seconds, made + done * planned.share),
            _ => (seconds, made),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::FitParams;

    fn plain() -> ValidFitParams {
        FitParams { heights: true, ..FitParams::default() }.check().unwrap()
    }

    fn goal() -> ValidFitParams {
        FitParams { bytes: Some(500_000), ..plain().asked().clone() }.check().unwrap()
    }

    /// Plays a fit whose stages take `seconds(name)`, and gives the worst ratio of what was forecast to what was
    /// left, from `from` of the whole on. Each stage of `there` is reported as done at once.
    fn worst(params: &ValidFitParams, from: f64, there: &[&str], seconds: impl Fn(&str) -> f64) -> f64 {
        let mut forecast = Forecast::new(1, params, LastStage::Report);
        let plan: Vec<&str> = forecast.plan.iter().map(|planned| planned.name).collect();
        let takes = |name: &str| if there.contains(&name) { 0.0 } else { seconds(name) };
        let whole: f64 = plan.iter().map(|name| takes(name)).sum();
        let (mut now, mut worst) = (100.0, 1.0f64);
        for name in plan {
            if there.contains(&name) {
                forecast.report(name, 1, 1, now);
                continue;
            }
            forecast.report(name, 0, 0, now);
            for step in 1..=10 {
                now += seconds(name) / 10.0;
                let left = forecast.report(name, step, 10, now);
                let truth = whole - (now - 100.0);
                if step < 10 {
                    let stage = left.stage_s.unwrap();
                    assert!((stage - seconds(name) * (1.0 - step as f64 / 10.0)).abs() < 1e-6, "{name} {stage}");
                }
                if now - 100.0 > from * whole && truth > 0.05 * whole {
                    let ratio = left.whole_s.unwrap() / truth;
                    worst = worst.max(ratio).max(1.0 / ratio);
                }
            }
        }
        worst
    }

    fn share(name: &str) -> f64 {
        LAYER_STAGES.iter().chain(&LAST_STAGES).find(|known| known.name == name).map_or(0.0, |known| known.stored_s)
    }

    #[test]
    fn a_fit_whose_stages_have_the_known_shares_is_predicted_exactly_at_any_speed() {
        for speed in [0.01, 1.0, 300.0] {
            assert!(worst(&plain(), 0.0, &[], |name| speed * share(name)) < 1.0 + 1e-6);
        }
        // Planted difference: with a goal the shares are others.
        assert!(worst(&goal(), 0.0, &[], share) > 1.2);
    }

    #[test]
    fn stages_that_were_there_already_do_not_count() {
        assert!(worst(&plain(), 0.0, &["read", "project", "cluster"], share) < 1.0 + 1e-6);
        assert!(worst(&plain(), 0.0, &["weights"], |name| 7.0 * share(name)) < 1.4);
    }

    #[test]
    fn wrong_shares_wear_off_and_a_clock_that_stands_still_shows() {
        let odd = |name: &str| share(name) * if name == "residual" { 2.0 } else { 1.0 };
        let far = worst(&plain(), 0.6, &[], odd);
        assert!((1.01..1.6).contains(&far), "{far}");
        // Planted difference: a machine that is nine times slower in the end is not foreseen.
        let late = |name: &str| share(name) * if name == "measure" { 9.0 } else { 1.0 };
        assert!(worst(&plain(), 0.1, &[], late) > 2.0);
    }

    #[test]
    fn a_stage_that_does_not_tell_moves_on_by_the_clock() {
        let mut forecast = Forecast::new(1, &plain(), LastStage::Measure);
        assert_eq!(forecast.report("read", 0, 0, 0.0), Left { stage_s: None, whole_s: None });
        // As fast as the known shares.
        let read_s = share("read");
        forecast.report("read", 10, 10, read_s);
        let early = forecast.report("project", 0, 0, read_s).whole_s.unwrap();
        let later = forecast.report("project", 0, 0, read_s + 4.0).whole_s.unwrap();
        assert!((early - later - 4.0).abs() < 1e-6, "{early} {later}");
        // What is in no plan tells nothing, but its time counts.
        let after = forecast.report("elsewhere", 9, 10, read_s + 5.0);
        assert!(after.stage_s.is_none() && (later - after.whole_s.unwrap() - 1.0).abs() < 1e-6, "{after:?}");
    }

    #[test]
    fn images_that_are_read_inside_another_stage_count_as_reading() {
        // From the start, then after an earlier run that had found the directions already.
        for first in ["project", "dictionary"] {
            let mut forecast = Forecast::new(2, &plain(), LastStage::Measure);
            let there = LAYER_STAGES.iter().map(|known| known.name).skip(1).take_while(|name| *name != first);
            there.for_each(|name| {
                forecast.report(name, 1, 1, 0.0);
            });
            let after = LAYER_STAGES.iter().skip_while(|known| known.name != first).map(|known| known.stored_s);
            let second: f64 = LAYER_STAGES.iter().map(|known| known.stored_s).sum();
            let to_come = after.sum::<f64>() + second + 2.0 * (share("encode") + share("measure"));
            forecast.report(first, 0, 0, 0.0);
            forecast.report("read", 0, 0, 0.0);
            let left = forecast.report("read", 5, 10, 0.5 * share("read"));
            assert!((left.stage_s.unwrap() - 0.5 * share("read")).abs() < 1e-9, "{first} {left:?}");
            assert!((left.whole_s.unwrap() - to_come - 0.5 * share("read")).abs() < 1e-6, "{first} {left:?}");
            forecast.report("read", 10, 10, share("read"));
            // Back in the outer stage, whose silence is not taken for slow reading.
            forecast.report(first, 0, 0, share("read"));
            let left = forecast.report(first, 0, 0, share("read") + 0.2 * share(first));
            assert!((left.whole_s.unwrap() - to_come + 0.2 * share(first)).abs() < 1e-6, "{first} {left:?}");
            let left = forecast.report(first, 1, 4, share("read") + 0.25 * share(first));
            assert!((left.whole_s.unwrap() - to_come + 0.25 * share(first)).abs() < 1e-6, "{first} {left:?}");
        }
    }

    #[test]
    fn a_layer_that_was_there_already_is_not_taken_for_the_next() {
        let mut forecast = Forecast::new(2, &plain(), LastStage::Measure);
        LAYER_STAGES.iter().skip(1).for_each(|known| {
            forecast.report(known.name, 1, 1, 0.0);
        });
        forecast.report("project", 0, 0, 0.0);
        assert_eq!(forecast.plan[forecast.at].layer, 1);
        forecast.report("read", 1, 2, 1.0);
        assert_eq!((forecast.plan[forecast.at].layer, forecast.plan[forecast.at].name), (1, "read"));
    }
}
