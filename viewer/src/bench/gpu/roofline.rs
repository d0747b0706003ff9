//! The roofline: gigabytes a second that the adapter copies from end to end, and multiply-adds a second in registers.

use crate::bench::gpu::params::GpuBenchParams;
use crate::bench::gpu::rows::{Rows, row_of};
use crate::bench::gpu::workload::Workload;
use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use crate::gpu::layout::bind;
use crate::gpu::modules::ROOFLINE;
use serde::Serialize;
use web_time::Instant;
use wgpu::BufferUsages;

/// Bytes that are copied: far more than caches hold. In quick runs fewer.
const COPY_BYTES: u64 = 512 << 20;
const QUICK_COPY_BYTES: u64 = 8 << 20;
/// Bytes of a vector of four, and vectors of an invocation. Twin: the locals of `multiply_add_main`.
const VECTOR_BYTES: u64 = 16;
const VECTORS: u64 = 4;
/// Multiply-adds of each vector; many, so that memory does not count. In quick runs fewer.
const ROUNDS: u64 = 1024;
const QUICK_ROUNDS: u64 = 64;
/// Invocations of a workgroup. Twin: `@workgroup_size` in `roofline.wgsl`.
const GROUP: u64 = 256;
/// Workgroups per row of a dispatch, below the least limit of 65535.
const ROW: u64 = 32768;
/// Seconds that dispatches which are submitted together take at least, so that submitting does not count.
const MIN_S: f64 = 0.05;

/// What the adapter can do at most.
#[derive(Serialize)]
struct RooflineRow {
    /// Bytes read and bytes written, together.
    copy_gigabytes_per_s: f64,
    tera_multiply_adds_per_s: f64,
    copied_bytes: u64,
}

/// Measures both.
///
/// # Errors
/// [`ViewerError::Gpu`] for what the driver reports.
pub(super) fn measure(params: &GpuBenchParams, rows: Rows) -> Result<(), ViewerError> {
    let workload = Workload::open(params)?;
    let gpu = &workload.gpu;
    let (most, rounds) = if params.quick { (QUICK_COPY_BYTES, QUICK_ROUNDS) } else { (COPY_BYTES, ROUNDS) };
    let bytes = most.min(gpu.max_binding_bytes()) / VECTOR_BYTES * VECTOR_BYTES;
    let copy_s = seconds_of(gpu, "copy_main", bytes, rounds)?;
    let compute_s = seconds_of(gpu, "multiply_add_main", bytes, rounds)?;
    // A vector has four numbers.
    let multiply_adds = bytes / VECTOR_BYTES * VECTORS * 4 * rounds;
    let row = RooflineRow {
        copy_gigabytes_per_s: 2.0 * bytes as f64 / copy_s * 1e-9,
        tera_multiply_adds_per_s: multiply_adds as f64 / compute_s * 1e-12,
        copied_bytes: bytes,
    };
    rows(row_of("roofline", &row));
    Ok(())
}

/// Returns the seconds of one dispatch of `entry` over buffers of so many bytes.
fn seconds_of(gpu: &Gpu, entry: &str, bytes: u64, rounds: u64) -> Result<f64, ViewerError> {
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("roofline"),
        source: wgpu::ShaderSource::Wgsl(ROOFLINE.into()),
    });
    let constants: &[(&str, f64)] = if entry == "copy_main" { &[] } else { &[("rounds", rounds as f64)] };
    let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(entry),
        layout: None,
        module: &module,
        entry_point: Some(entry),
        compilation_options: wgpu::PipelineCompilationOptions { constants, ..Default::default() },
        cache: None,
    });
    let from = gpu.empty_buffer("vectors to copy", bytes, BufferUsages::STORAGE)?;
    let to = gpu.empty_buffer("copied vectors", bytes, BufferUsages::STORAGE)?;
    let bound = [(0, from.as_entire_binding()), (1, to.as_entire_binding())];
    let group = bind(gpu, &pipeline.get_bind_group_layout(0), &bound);
    let groups = (bytes / VECTOR_BYTES).div_ceil(GROUP);
    let run = |dispatches: u64| -> Result<f64, ViewerError> {
        let start = Instant::now();
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        for _ in 0..dispatches {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(groups.min(ROW) as u32, groups.div_ceil(ROW) as u32, 1);
        }
        gpu.queue.submit([encoder.finish()]);
        gpu.wait()?;
        Ok(start.elapsed().as_secs_f64())
    };
    // The first dispatch compiles, and sets the buffers to zero.
    run(1)?;
    let mut dispatches = 1;
    loop {
        let seconds = run(dispatches)?;
        if seconds >= MIN_S {
            return Ok(seconds / dispatches as f64);
        }
        dispatches *= 2;
    }
}
