//! How long a fit will still take: the share of each stage in a fit is known roughly, the time so far tells how fast
//! this machine and this capture are.

/// Seconds of a fit's stages, in order: 128 x 128 texels, 81 x 81 directions, `--bytes 500kB`, two cores. Only their
/// ratios matter, and errors in those wear off as the fit goes on.
const LAYER_STAGES: [(&str, f64); 6] =
    [("read", 10.0), ("project", 6.0), ("cluster", 1.0), ("dictionary", 14.0), ("weights", 5.0), ("residual", 20.0)];
/// The same of the stages that follow those of all layers.
const LAST_STAGES: [(&str, f64); 3] = [("encode", 12.0), ("measure", 12.0), ("report", 2.0)];
/// A stage that does not tell how far it is counts at most to this share of itself.
const MOST_UNTOLD: f64 = 0.95;

/// What a fit still needs, in seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Left {
    /// The stage at hand; `None` where it does not tell how far it is.
    pub stage_s: Option<f64>,
    /// The whole fit; `None` at its very start.
    pub whole_s: Option<f64>,
}

/// Follows a fit's progress. Clocks are the caller's: seconds from any start on, never falling.
#[derive(Debug, Clone)]
pub struct Forecast {
    /// Stages in order with their shares.
    plan: Vec<(&'static str, f64)>,
    /// The stage at hand.
    at: usize,
    started_s: Option<f64>,
    stage_started_s: f64,
    /// Shares of the stages that ran before the one at hand.
    done: f64,
}

impl Forecast {
    /// For a fit of `layers` captures; `report` tells whether a report follows.
    pub fn new(layers: usize, report: bool) -> Forecast {
        let last = LAST_STAGES.iter().filter(|(name, _)| report || *name != "report");
        // Measuring takes its time for every layer.
        let last = last.map(|(name, share)| (*name, share * layers as f64));
        let plan = (0..layers).flat_map(|_| LAYER_STAGES).chain(last).collect();
        Forecast { plan, at: 0, started_s: None, stage_started_s: 0.0, done: 0.0 }
    }

    /// Takes in that `stage` has done `done` of `total` parts (0 of 0: it does not tell) at `now_s`.
    ///
    /// Stages that are passed over, because their results were there already, do not count.
    pub fn report(&mut self, stage: &str, done: usize, total: usize, now_s: f64) -> Left {
        let started_s = *self.started_s.get_or_insert(now_s);
        if self.plan[self.at].0 != stage {
            if let Some(ahead) = self.plan[self.at..].iter().position(|(name, _)| *name == stage) {
                if now_s > started_s {
                    self.done += self.plan[self.at].1;
                }
                self.at += ahead;
                self.stage_started_s = now_s;
            }
        } else if self.done == 0.0 && done == 0 && total == 0 {
            self.stage_started_s = now_s;
        }
        let share = self.plan[self.at].1;
        let (elapsed_s, stage_elapsed_s) = (now_s - started_s, now_s - self.stage_started_s);
        let told = (total > 0).then(|| (done as f64 / total as f64).clamp(0.0, 1.0));
        let stage_s = told.filter(|told| *told > 0.0).map(|told| stage_elapsed_s * (1.0 / told - 1.0));
        let within = told.unwrap_or_else(|| {
            // As far as the speed so far makes it likely.
            let before_s = elapsed_s - stage_elapsed_s;
            let likely = if before_s > 0.0 { stage_elapsed_s / (before_s / self.done.max(1e-9) * share) } else { 0.0 };
            likely.min(MOST_UNTOLD)
        });
        let made = self.done + within * share;
        let rest: f64 = self.plan[self.at + 1..].iter().map(|(_, share)| share).sum();
        let left = rest + (1.0 - within) * share;
        let whole_s = (made > 0.0 && elapsed_s > 0.0).then(|| elapsed_s / made * left);
        Left { stage_s, whole_s }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Plays a fit whose stages take `seconds(name)`, and gives the worst ratio of what was forecast to what was
    /// left, from `from` of the whole on.
    fn worst(layers: usize, from: f64, skip: &[&str], seconds: impl Fn(&str) -> f64) -> f64 {
        let mut forecast = Forecast::new(layers, true);
        let plan: Vec<&str> = forecast.plan.iter().map(|(name, _)| *name).filter(|name| !skip.contains(name)).collect();
        let whole: f64 = plan.iter().map(|name| seconds(name)).sum();
        let (mut now, mut worst) = (100.0, 1.0f64);
        for name in plan {
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
        LAYER_STAGES.iter().chain(&LAST_STAGES).find(|(stage, _)| *stage == name).map_or(0.0, |(_, share)| *share)
    }

    #[test]
    fn a_fit_whose_stages_have_the_known_shares_is_foretold_exactly_at_any_speed() {
        for speed in [0.01, 1.0, 300.0] {
            assert!(worst(1, 0.0, &[], |name| speed * share(name)) < 1.0 + 1e-6);
        }
    }

    #[test]
    fn stages_that_were_there_already_do_not_count() {
        assert!(worst(1, 0.0, &["read", "project", "cluster"], share) < 1.0 + 1e-6);
        assert!(worst(1, 0.0, &["weights"], |name| 7.0 * share(name)) < 1.4);
    }

    #[test]
    fn wrong_shares_wear_off_and_a_clock_that_stands_still_shows() {
        let odd = |name: &str| share(name) * if name == "residual" { 2.0 } else { 1.0 };
        let far = worst(1, 0.6, &[], odd);
        assert!((1.01..1.6).contains(&far), "{far}");
        // Planted difference: a machine that is three times slower in the end is not foreseen.
        let late = |name: &str| share(name) * if name == "measure" { 9.0 } else { 1.0 };
        assert!(worst(1, 0.1, &[], late) > 2.0);
    }

    #[test]
    fn a_stage_that_does_not_tell_moves_on_by_the_clock() {
        let mut forecast = Forecast::new(1, false);
        assert_eq!(forecast.report("read", 0, 0, 0.0), Left { stage_s: None, whole_s: None });
        forecast.report("read", 10, 10, 10.0);
        let early = forecast.report("project", 0, 0, 10.0).whole_s.unwrap();
        let later = forecast.report("project", 0, 0, 14.0).whole_s.unwrap();
        assert!((early - later - 4.0).abs() < 1e-6, "{early} {later}");
        // A name that is in no plan changes nothing.
        assert!(forecast.report("elsewhere", 0, 0, 15.0).whole_s.unwrap() < later);
    }
}
