//! Long work on threads of its own, while Python's thread passes progress on and hears Control-C.

use crate::faults::fit_error;
use btf_fit::{FitError, Monitor};
use pyo3::exceptions::{PyRuntimeError, PyUserWarning};
use pyo3::prelude::*;
use std::ffi::CString;
use std::sync::Mutex;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// Time between two looks for Control-C.
const PATIENCE: Duration = Duration::from_millis(50);

/// What the work tells.
enum Told {
    /// Name of the stage, steps that are done, and all steps: 0 of 0 at its begin.
    Progress(String, usize, usize),
    /// A sentence that a user should know.
    Remark(String),
}

/// Runs `work` on `threads` threads, 0 for as many as there are processors. `progress` is called as `(stage, done, total)` by
/// the calling thread; remarks become warnings.
///
/// # Errors
/// Those of the work; what `progress` raises and KeyboardInterrupt, either of which ends the work.
pub fn run<T: Send>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    threads: usize,
    work: impl FnOnce(&Monitor) -> Result<T, FitError> + Send,
) -> PyResult<T> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| PyRuntimeError::new_err(format!("no threads to work on: {error}")))?;
    let (tell, told) = channel();
    let remark = tell.clone();
    // Nobody listens any more once the work is cancelled.
    let monitor = Monitor::with_listener(move |stage, done, total| {
        let _ = tell.send(Told::Progress(stage.to_string(), done, total));
    })
    .on_remark(move |sentence| {
        let _ = remark.send(Told::Remark(sentence.to_string()));
    });
    let told = Mutex::new(told);
    let mut failure = None;
    let result = std::thread::scope(|scope| {
        let worker = scope.spawn(|| pool.install(|| work(&monitor)));
        loop {
            let next = py.detach(|| told.lock().ok().map(|told| told.recv_timeout(PATIENCE)));
            let heard = match next {
                // What has ended the work is not asked again.
                Some(Ok(_)) if failure.is_some() => Ok(()),
                Some(Ok(told)) => pass_on(py, progress, told),
                Some(Err(RecvTimeoutError::Timeout)) if !worker.is_finished() => Ok(()),
                _ => break,
            };
            if let Err(error) = heard.and_then(|()| py.check_signals())
                && failure.is_none()
            {
                monitor.cancel();
                failure = Some(error);
            }
        }
        py.detach(|| worker.join())
    });
    match (failure, result) {
        (Some(error), _) => Err(error),
        (None, Ok(result)) => result.map_err(|error| fit_error(&error)),
        (None, Err(_)) => Err(PyRuntimeError::new_err("the work panicked, which is an error of this module")),
    }
}

/// Calls Python with what was told.
fn pass_on(py: Python<'_>, progress: Option<&Bound<'_, PyAny>>, told: Told) -> PyResult<()> {
    match (told, progress) {
        (Told::Progress(stage, done, total), Some(progress)) => progress.call1((stage, done, total)).map(|_| ()),
        (Told::Progress(..), None) => Ok(()),
        (Told::Remark(sentence), _) => {
            let sentence = CString::new(sentence.replace('\0', " "))?;
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &sentence, 1)
        }
    }
}
