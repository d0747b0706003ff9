//! Tells when a GPU has finished work, without waiting for it.

use crate::gpu::device::Gpu;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The end of what was submitted before.
pub(crate) struct Fence(Arc<AtomicBool>);

impl Fence {
    /// Stands behind all that is submitted so far.
    pub(crate) fn behind_all(gpu: &Gpu) -> Fence {
        let passed = Arc::new(AtomicBool::new(false));
        let noted = passed.clone();
        gpu.queue.on_submitted_work_done(move || noted.store(true, Ordering::Relaxed));
        Fence(passed)
    }

    /// Tells whether the work is finished.
    pub(crate) fn has_passed(&self, gpu: &Gpu) -> bool {
        if !self.0.load(Ordering::Relaxed) {
            // Callbacks are run here, but for browsers, which run them between two tasks.
            let _ = gpu.device.poll(wgpu::PollType::Poll);
        }
        self.0.load(Ordering::Relaxed)
    }
}
