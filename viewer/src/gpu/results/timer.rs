//! The passes of a sample, and how long the GPU takes for each.

use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use crate::gpu::results::readback::read_buffer;
use wgpu::BufferUsages;

/// A pass over the pixels of a band.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pass {
    /// The ray from the eye.
    Camera,
    /// Light at what the latest ray hit.
    Light,
    /// The next ray, from a mirror.
    Mirror,
    /// The next ray of a traced path.
    Scatter,
    /// Volumes before what the latest ray hit.
    Volume,
}

/// Number of [`Pass`]es.
pub(crate) const PASSES: usize = 5;

impl Pass {
    pub(crate) fn entry_point(self) -> &'static str {
        match self {
            Pass::Camera => "camera_main",
            Pass::Light => "light_main",
            Pass::Mirror => "mirror_main",
            Pass::Scatter => "scatter_main",
            Pass::Volume => "volume_main",
        }
    }
}

/// Measures a sample's passes by GPU timestamps.
pub struct GpuTimer {
    gpu: Gpu,
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    capacity: usize,
    period_ns: f32,
    /// The passes that were timed since `begin`.
    timed: Vec<Pass>,
}

/// GPU time of a sample by kind of pass, milliseconds.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct PassTimes {
    /// Rays from the eye.
    pub camera_ms: f64,
    /// Volumes that the rays meet, with their light; 0 where there are none.
    pub volume_ms: f64,
    /// Light: decoding and shadow rays, ambient occlusion in them.
    pub light_ms: f64,
    /// Rays from mirrors, or the next ones of traced paths.
    pub bounce_ms: f64,
}

impl PassTimes {
    /// Adds `share` times another's.
    pub(crate) fn add(&mut self, other: &PassTimes, share: f64) {
        self.camera_ms += share * other.camera_ms;
        self.volume_ms += share * other.volume_ms;
        self.light_ms += share * other.light_ms;
        self.bounce_ms += share * other.bounce_ms;
    }

    /// Returns the sum of all passes, milliseconds.
    pub fn sum_ms(&self) -> f64 {
        self.camera_ms + self.volume_ms + self.light_ms + self.bounce_ms
    }
}

impl GpuTimer {
    /// Returns a timer; `None` where the device has no timestamps.
    pub fn new(gpu: &Gpu) -> Option<GpuTimer> {
        const USUAL_PASSES: usize = 8;
        if !gpu.has_timestamps() {
            return None;
        }
        let (queries, resolved) = timer_buffers(gpu, USUAL_PASSES).ok()?;
        let period_ns = gpu.queue.get_timestamp_period();
        Some(GpuTimer { gpu: gpu.clone(), queries, resolved, capacity: USUAL_PASSES, period_ns, timed: Vec::new() })
    }

    pub(crate) fn begin(&mut self, passes: usize) -> Result<(), ViewerError> {
        self.timed.clear();
        if passes > self.capacity {
            self.capacity = passes.next_power_of_two();
            (self.queries, self.resolved) = timer_buffers(&self.gpu, self.capacity)?;
        }
        Ok(())
    }

    pub(crate) fn writes(&mut self, pass: Pass) -> wgpu::ComputePassTimestampWrites<'_> {
        let first = 2 * self.timed.len() as u32;
        self.timed.push(pass);
        wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        }
    }

    pub(crate) fn resolve(&self) {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        encoder.resolve_query_set(&self.queries, 0..2 * self.timed.len() as u32, &self.resolved, 0);
        self.gpu.queue.submit([encoder.finish()]);
    }

    /// Waits for the last sample and returns how long its passes took.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] with what the driver reported.
    pub fn read(&self) -> Result<PassTimes, ViewerError> {
        let ticks: Vec<u64> = read_buffer(&self.gpu, &self.resolved, 2 * self.timed.len())?;
        let mut times = PassTimes::default();
        for (pass, ticks) in self.timed.iter().zip(ticks.chunks_exact(2)) {
            let time = match pass {
                Pass::Camera => &mut times.camera_ms,
                Pass::Volume => &mut times.volume_ms,
                Pass::Light => &mut times.light_ms,
                Pass::Mirror | Pass::Scatter => &mut times.bounce_ms,
            };
            *time += ticks[1].saturating_sub(ticks[0]) as f64 * f64::from(self.period_ns) * 1e-6;
        }
        Ok(times)
    }
}

fn timer_buffers(gpu: &Gpu, passes: usize) -> Result<(wgpu::QuerySet, wgpu::Buffer), ViewerError> {
    let queries = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
        label: Some("timer"),
        ty: wgpu::QueryType::Timestamp,
        count: 2 * passes as u32,
    });
    let usage = BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC;
    Ok((queries, gpu.empty_buffer("timestamps", 16 * passes as u64, usage)?))
}
