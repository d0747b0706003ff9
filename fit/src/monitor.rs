//! Progress and cancellation (Ctrl-C) as the library sees them.

use crate::error::FitError;
use cpu_time::ProcessTime;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// Receiver of a computation's progress, through which the computation also learns that it should stop.
#[derive(Default)]
pub struct Monitor {
    cancelled: Arc<AtomicBool>,
    /// Flag of the monitor whose work this one is a part of.
    whole_cancelled: Option<Arc<AtomicBool>>,
    listener: Option<Box<Listener>>,
    hearer: Option<Box<Hearer>>,
    /// Stages that run now, outermost first, each with the time of the stages that ran inside it.
    running: Mutex<Vec<(String, Spent)>>,
    stages: Mutex<Vec<Stage>>,
    skipped: Mutex<Vec<String>>,
}

type Listener = dyn Fn(&str, usize, usize) + Send + Sync;
type Hearer = dyn Fn(&str) + Send + Sync;

/// A finished stage.
#[derive(Debug, Clone, PartialEq)]
pub struct Stage {
    /// Name of the stage, a key of `stages` in `fit --json`.
    pub name: String,
    /// Wall-clock seconds without stages that ran inside it.
    pub seconds: f64,
    /// Seconds of processor time of all threads of the program, without stages that ran inside it. Other work that
    /// runs at the same time in this program counts, too.
    pub processor_s: f64,
}

/// Time that a stage took, in seconds.
#[derive(Debug, Clone, Copy, Default)]
struct Spent {
    wall_s: f64,
    processor_s: f64,
}

impl Monitor {
    /// Returns a monitor that calls `listener(stage, done, total)` from any thread.
    pub fn with_listener(listener: impl Fn(&str, usize, usize) + Send + Sync + 'static) -> Monitor {
        Monitor { listener: Some(Box::new(listener)), ..Monitor::default() }
    }

    /// Returns this monitor with a `hearer(sentence)` that is called for remarks: what a user should know though it
    /// stops nothing.
    pub fn on_remark(self, hearer: impl Fn(&str) + Send + Sync + 'static) -> Monitor {
        Monitor { hearer: Some(Box::new(hearer)), ..self }
    }

    /// Returns a monitor for one of several pieces of work: it keeps its own stages, passes neither progress nor remarks on, and
    /// stops where `self` does or where it is cancelled itself.
    pub fn of_one(&self) -> Monitor {
        Monitor { whole_cancelled: Some(Arc::clone(&self.cancelled)), ..Monitor::default() }
    }

    /// Makes a remark, one sentence.
    pub fn remark(&self, sentence: &str) {
        if let Some(hearer) = &self.hearer {
            hearer(sentence);
        }
    }

    /// Notes that the result of a stage was kept from an earlier run, and reports the stage as done.
    pub fn skip(&self, stage: &str) {
        if let Some(listener) = &self.listener {
            listener(stage, 1, 1);
        }
        if let Ok(mut skipped) = self.skipped.lock() {
            skipped.push(stage.to_string());
        }
    }

    /// Returns the stages whose results were kept from an earlier run, in order.
    pub fn skipped(&self) -> Vec<String> {
        self.skipped.lock().map(|skipped| skipped.clone()).unwrap_or_default()
    }

    /// Asks the computation to stop at the next opportunity.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Returns `Err(Interrupted)` once [`Monitor::cancel`] was called.
    pub fn check(&self) -> Result<(), FitError> {
        let flags = [Some(&self.cancelled), self.whole_cancelled.as_ref()];
        let cancelled = flags.into_iter().flatten().any(|flag| flag.load(Ordering::Relaxed));
        if cancelled { Err(FitError::Interrupted) } else { Ok(()) }
    }

    /// Reports progress and checks for cancellation. Inside a stage only its own progress is passed on, not that of
    /// other work that it calls.
    pub fn report(&self, stage: &str, done: usize, total: usize) -> Result<(), FitError> {
        if let Some(listener) = &self.listener {
            let running = self.running.lock().map(|running| running.last().map(|(name, _)| name != stage));
            if !matches!(running, Ok(Some(true))) {
                listener(stage, done, total);
            }
        }
        self.check()
    }

    /// Runs `work` as the stage `name` and keeps its time, without the time of stages inside it. The begin of the
    /// stage, and the end of a stage inside it, are reported as 0 of 0.
    pub fn stage<T>(&self, name: &str, work: impl FnOnce() -> Result<T, FitError>) -> Result<T, FitError> {
        if let Ok(mut running) = self.running.lock() {
            running.push((name.to_string(), Spent::default()));
        }
        let (start, processor) = (Instant::now(), ProcessTime::now());
        let result = self.report(name, 0, 0).and_then(|()| work());
        let (wall_s, processor_s) = (start.elapsed().as_secs_f64(), processor.elapsed().as_secs_f64());
        let (mut inside, mut around) = (Spent::default(), None);
        if let Ok(mut running) = self.running.lock() {
            inside = running.pop().map_or(inside, |(_, inside)| inside);
            if let Some(outer) = running.last_mut() {
                outer.1.wall_s += wall_s;
                outer.1.processor_s += processor_s;
                around = Some(outer.0.clone());
            }
        }
        // It goes on, and it may be long before it says so itself.
        if let (Some(around), Some(listener)) = (around, &self.listener) {
            listener(&around, 0, 0);
        }
        if let Ok(mut stages) = self.stages.lock() {
            let (seconds, processor_s) = (wall_s - inside.wall_s, processor_s - inside.processor_s);
            match stages.iter_mut().find(|stage| stage.name == name) {
                Some(stage) => {
                    stage.seconds += seconds;
                    stage.processor_s += processor_s;
                }
                None => stages.push(Stage { name: name.to_string(), seconds, processor_s }),
            }
        }
        result
    }

    /// Returns the finished stages, in order.
    pub fn stages(&self) -> Vec<Stage> {
        self.stages.lock().map(|stages| stages.clone()).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread::sleep;
    use std::time::Duration;

    #[test]
    fn one_of_several_pieces_of_work_stops_with_the_whole_and_by_itself_alone() {
        let whole = Monitor::default();
        let [one, other] = [whole.of_one(), whole.of_one()];
        one.cancel();
        assert!(one.check().is_err() && other.check().is_ok() && whole.check().is_ok());
        whole.cancel();
        assert!(other.check().is_err());
    }

    #[test]
    fn a_stage_inside_another_counts_once_and_reports_only_its_own_progress() {
        let heard = Arc::new(Mutex::new(Vec::new()));
        let list = Arc::clone(&heard);
        let monitor = Monitor::with_listener(move |name, done, total| {
            list.lock().unwrap().push(format!("{name} {done}/{total}"));
        });
        monitor
            .stage("outer", || {
                sleep(Duration::from_millis(20));
                monitor.stage("inner", || {
                    sleep(Duration::from_millis(200));
                    monitor.report("inner", 1, 2)
                })?;
                monitor.report("other", 1, 2)?;
                monitor.report("outer", 3, 4)
            })
            .unwrap();
        monitor.report("other", 2, 2).unwrap();
        assert_eq!(
            *heard.lock().unwrap(),
            ["outer 0/0", "inner 0/0", "inner 1/2", "outer 0/0", "outer 3/4", "other 2/2"]
        );
        let stages = monitor.stages();
        assert_eq!(stages.iter().map(|stage| stage.name.as_str()).collect::<Vec<_>>(), ["inner", "outer"]);
        assert!(stages[0].seconds >= 0.2 && stages[1].seconds < 0.2, "{stages:?}");
    }
}
