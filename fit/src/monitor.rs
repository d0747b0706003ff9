//! Progress and Ctrl-C, as the library sees them.

use crate::error::FitError;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// What a long computation reports to, and where it learns that it should stop.
#[derive(Default)]
pub struct Monitor {
    cancelled: AtomicBool,
    listener: Option<Box<Listener>>,
    stages: Mutex<Vec<Stage>>,
}

type Listener = dyn Fn(&str, usize, usize) + Send + Sync;

/// A finished stage.
#[derive(Debug, Clone, PartialEq)]
pub struct Stage {
    /// Its name, as in `stages` of `fit --json`.
    pub name: String,
    /// Wall-clock seconds.
    pub seconds: f64,
}

impl Monitor {
    /// A monitor that calls `listener(stage, done, total)` from any thread.
    pub fn with_listener(listener: impl Fn(&str, usize, usize) + Send + Sync + 'static) -> Monitor {
        Monitor { listener: Some(Box::new(listener)), ..Monitor::default() }
    }

    /// Asks the computation to stop at the next opportunity.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// `Err(Interrupted)` once [`Monitor::cancel`] was called.
    pub fn check(&self) -> Result<(), FitError> {
        if self.cancelled.load(Ordering::Relaxed) { Err(FitError::Interrupted) } else { Ok(()) }
    }

    /// Reports progress and checks for cancellation.
    pub fn report(&self, stage: &str, done: usize, total: usize) -> Result<(), FitError> {
        if let Some(listener) = &self.listener {
            listener(stage, done, total);
        }
        self.check()
    }

    /// Runs `work` as the stage `name` and keeps its time.
    pub fn stage<T>(&self, name: &str, work: impl FnOnce() -> Result<T, FitError>) -> Result<T, FitError> {
        self.report(name, 0, 0)?;
        let start = Instant::now();
        let result = work();
        let seconds = start.elapsed().as_secs_f64();
        if let Ok(mut stages) = self.stages.lock() {
            match stages.iter_mut().find(|stage| stage.name == name) {
                Some(stage) => stage.seconds += seconds,
                None => stages.push(Stage { name: name.to_string(), seconds }),
            }
        }
        result
    }

    /// The finished stages, in order.
    pub fn stages(&self) -> Vec<Stage> {
        self.stages.lock().map(|stages| stages.clone()).unwrap_or_default()
    }
}
