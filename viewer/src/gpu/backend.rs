//! The renderers that can be asked for.

/// A way in which a GPU finds what a ray hits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum GpuTracer {
    /// Acceleration structures and ray queries; needs an adapter that has them.
    RayQuery,
    /// A bounding volume hierarchy in storage buffers; runs everywhere.
    Bvh,
}

impl GpuTracer {
    /// Returns the backend's name on the command line and in JSON.
    pub fn name(self) -> &'static str {
        match self {
            GpuTracer::RayQuery => "ray-query",
            GpuTracer::Bvh => "bvh",
        }
    }
}

/// Which renderer was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BackendChoice {
    /// Ray query where the adapter has it, else the BVH; the CPU where there is no adapter.
    Auto,
    /// The tracer on a GPU, or an error.
    Gpu(GpuTracer),
    /// The CPU decoder and BVH.
    Cpu,
}

/// The processor that expands the bases of assets in file form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Expansion {
    /// The GPU, which is sent what the bases are made from.
    OnGpu,
    /// The CPU, which uploads the expanded bases.
    OnCpu,
}
