//! The renderers that the window can switch between.

use crate::gpu::backend::GpuTracer;

/// A renderer that the panel offers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Renderer {
    Gpu(GpuTracer),
    Cpu,
}

impl Renderer {
    /// Returns the name that the panel shows and that settings remember.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Renderer::Gpu(tracer) => tracer.name(),
            Renderer::Cpu => "cpu",
        }
    }
}
