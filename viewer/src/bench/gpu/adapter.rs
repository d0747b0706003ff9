//! What the adapter and its driver say of themselves.

use crate::bench::gpu::params::GpuBenchParams;
use crate::bench::gpu::rows::{Rows, row_of};
use crate::bench::gpu::workload::Workload;
use crate::error::ViewerError;
use serde::Serialize;

/// An adapter.
#[derive(Serialize)]
struct AdapterRow {
    name: String,
    /// Graphics interface and kind of adapter, as in `vulkan DiscreteGpu`.
    interface: String,
    driver: String,
    driver_info: String,
    /// How rays are traced here.
    tracer: &'static str,
    ray_query: bool,
    timestamps: bool,
    max_binding_bytes: u64,
    max_buffer_bytes: u64,
    max_storage_buffers: u32,
}

/// Tells name, driver and limits.
///
/// # Errors
/// [`ViewerError::NoAdapter`].
pub(super) fn tell(params: &GpuBenchParams, rows: Rows) -> Result<(), ViewerError> {
    let workload = Workload::open(params)?;
    let (gpu, info) = (&workload.gpu, workload.gpu.adapter.get_info());
    let limits = gpu.device.limits();
    let row = AdapterRow {
        name: info.name,
        interface: gpu.interface(),
        driver: info.driver,
        driver_info: info.driver_info,
        tracer: workload.tracer.name(),
        ray_query: gpu.has_ray_query(),
        timestamps: gpu.has_timestamps(),
        max_binding_bytes: gpu.max_binding_bytes(),
        max_buffer_bytes: limits.max_buffer_size,
        max_storage_buffers: limits.max_storage_buffers_per_shader_stage,
    };
    rows(row_of("adapter", &row));
    Ok(())
}
