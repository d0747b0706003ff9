//! The renderer that was asked for, opened.

use crate::error::ViewerError;
use crate::gpu::backend::BackendChoice;
use crate::gpu::backend::GpuTracer;
use crate::gpu::device::Gpu;
use crate::render::control::Control;

/// A device and how it traces, or the CPU.
pub(crate) enum Engine {
    Gpu(Box<Gpu>, GpuTracer),
    Cpu,
}

impl Engine {
    /// Opens `backend`; where [`BackendChoice::Auto`] finds no adapter it says so and is the CPU.
    ///
    /// # Errors
    /// [`ViewerError::NoAdapter`] where a GPU is asked for, by kind or by name, and there is none.
    pub(crate) fn open(
        backend: BackendChoice,
        adapter: Option<&str>,
        control: &Control,
    ) -> Result<Engine, ViewerError> {
        let open = || Gpu::headless(adapter).map(Box::new);
        match backend {
            BackendChoice::Cpu => Ok(Engine::Cpu),
            BackendChoice::Gpu(tracer) => Ok(Engine::Gpu(open()?, tracer)),
            BackendChoice::Auto => match open() {
                Ok(gpu) => {
                    let tracer = gpu.best_tracer();
                    Ok(Engine::Gpu(gpu, tracer))
                }
                // A name that fits no adapter is a mistake, not a machine without one.
                Err(error) if adapter.is_some() => Err(error),
                Err(error) => {
                    (control.notice)(&format!("rendering with the CPU decoder: {error}"));
                    Ok(Engine::Cpu)
                }
            },
        }
    }

    /// Returns the adapter name, or the number of threads.
    pub(crate) fn adapter(&self) -> String {
        match self {
            Engine::Gpu(gpu, _) => gpu.adapter_name().to_string(),
            Engine::Cpu => format!("CPU, {} threads", rayon::current_num_threads()),
        }
    }

    /// Graphics interface and kind of adapter.
    pub(crate) fn interface(&self) -> String {
        match self {
            Engine::Gpu(gpu, _) => gpu.interface(),
            Engine::Cpu => "cpu".into(),
        }
    }

    /// Returns the backend's name on the command line.
    pub(crate) fn backend(&self) -> &'static str {
        match self {
            Engine::Gpu(_, tracer) => tracer.name(),
            Engine::Cpu => "cpu",
        }
    }

    /// Returns what times a frame: begin and end of its passes on a GPU that tells them, or submission until it is
    /// finished.
    pub(crate) fn timer(&self) -> &'static str {
        match self {
            Engine::Gpu(gpu, _) if gpu.has_timestamps() => "gpu-timestamps",
            _ => "wall-clock",
        }
    }
}
