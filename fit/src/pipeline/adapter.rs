//! The adapter of a fit, opened when something is first computed.

use crate::error::FitError;
use crate::gpu::device::GpuChoice;
use crate::gpu::fit_gpu::FitGpu;
use crate::monitor::Monitor;
use crate::params::ValidFitParams;
use crate::pipeline::memory_plan::shared_bases;
use btf_capture::Capture;
use std::cell::OnceCell;

/// Operations of a fit's products from which on an adapter is opened: below, opening it takes longer than they do.
const MIN_OPERATIONS: f64 = 2e11;

/// The adapter that the parameters of a fit ask for.
pub(crate) struct FitAdapter<'a> {
    captures: &'a [Capture],
    params: &'a ValidFitParams,
    monitor: &'a Monitor,
    opened: OnceCell<Option<FitGpu>>,
}

impl<'a> FitAdapter<'a> {
    /// Returns the adapter of a fit of `captures`, not opened yet.
    pub fn new(captures: &'a [Capture], params: &'a ValidFitParams, monitor: &'a Monitor) -> FitAdapter<'a> {
        FitAdapter { captures, params, monitor, opened: OnceCell::new() }
    }

    /// Returns the adapter, opened; `None` where the CPU computes, with a remark unless it was asked to.
    ///
    /// # Errors
    /// A named adapter that does not exist.
    pub fn gpu(&self) -> Result<Option<&FitGpu>, FitError> {
        if self.opened.get().is_none() {
            let _ = self.opened.set(self.open()?);
        }
        Ok(self.opened.get().and_then(Option::as_ref))
    }

    /// Tells what the adapter did, if it was asked for anything.
    pub fn tell(&self) {
        if let Some(sentence) = self.opened.get().and_then(Option::as_ref).and_then(FitGpu::in_words) {
            self.monitor.remark(&sentence);
        }
    }

    fn open(&self) -> Result<Option<FitGpu>, FitError> {
        let operations = |capture: &Capture| {
            let info = capture.info();
            let samples = 3 * info.pair_count();
            2.0 * info.texel_count() as f64 * (samples * shared_bases(self.params, info.texel_count())) as f64
        };
        match self.params.gpu() {
            GpuChoice::Off => return Ok(None),
            GpuChoice::Best if self.captures.iter().map(operations).sum::<f64>() < MIN_OPERATIONS => return Ok(None),
            _ => {}
        }
        Ok(match FitGpu::open(self.params.gpu())? {
            Ok(gpu) => Some(gpu),
            Err(reason) => {
                self.monitor.remark(&format!("the fit is computed on the CPU: {reason}"));
                None
            }
        })
    }
}
