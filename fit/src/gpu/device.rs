//! An open adapter, and how it is chosen.

use crate::error::FitError;
use std::sync::{Arc, Mutex};
use wgpu::BufferUsages;

/// Choice of an adapter.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum GpuChoice {
    /// The best adapter; none where none answers.
    #[default]
    Best,
    /// The first adapter whose name contains this text in any case; an error where there is none.
    Named(String),
    /// No adapter.
    Off,
}

impl GpuChoice {
    /// Reads `auto`, `off` or a part of an adapter's name.
    ///
    /// # Errors
    /// One clause for no words at all.
    pub fn from_words(text: &str) -> Result<GpuChoice, String> {
        Ok(match text {
            "auto" => GpuChoice::Best,
            "off" => GpuChoice::Off,
            "" => return Err("give auto, off or a part of an adapter's name".into()),
            name => GpuChoice::Named(name.into()),
        })
    }
}

/// Backends that the shaders are tested for.
const BACKENDS: wgpu::Backends = wgpu::Backends::VULKAN.union(wgpu::Backends::METAL).union(wgpu::Backends::DX12);

/// An open adapter.
pub(crate) struct GpuDevice {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    /// Name of the adapter.
    pub name: String,
    /// Whether it is a driver that computes on the CPU.
    pub software: bool,
    /// First error that the driver reported outside a call.
    fault: Arc<Mutex<Option<String>>>,
}

impl GpuDevice {
    /// Opens the adapter of `choice`; `Ok(Err(...))` says in words why there is none.
    ///
    /// # Errors
    /// A named adapter that does not exist, with the names of those that do.
    pub fn open(choice: &GpuChoice) -> Result<Result<GpuDevice, String>, FitError> {
        let name = match choice {
            GpuChoice::Off => return Ok(Err("none is asked for".into())),
            GpuChoice::Best => None,
            GpuChoice::Named(name) => Some(name.to_lowercase()),
        };
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = BACKENDS;
        let instance = wgpu::Instance::new(descriptor);
        let adapters = pollster::block_on(instance.enumerate_adapters(BACKENDS));
        let names: Vec<String> = adapters.iter().map(|adapter| adapter.get_info().name).collect();
        let rank = |adapter: &wgpu::Adapter| match adapter.get_info().device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu => 2,
            wgpu::DeviceType::Other => 3,
            wgpu::DeviceType::Cpu => 4,
        };
        let is_wanted = |adapter: &wgpu::Adapter| {
            name.as_ref().is_none_or(|name| adapter.get_info().name.to_lowercase().contains(name))
        };
        let Some(adapter) = adapters.into_iter().filter(is_wanted).min_by_key(rank) else {
            let Some(name) = name else {
                return Ok(Err("no Vulkan, Metal or DirectX 12 adapter answers here".into()));
            };
            let found = if names.is_empty() { "none".to_string() } else { names.join(", ") };
            return Err(FitError::Params(format!(
                "--gpu: no adapter is called `{name}` (there are: {found}); give a part of one of these names"
            )));
        };
        Ok(GpuDevice::from_adapter(&adapter))
    }

    fn from_adapter(adapter: &wgpu::Adapter) -> Result<GpuDevice, String> {
        let info = adapter.get_info();
        if !adapter.get_downlevel_capabilities().flags.contains(wgpu::DownlevelFlags::SHADER_F16_IN_F32) {
            return Err(format!("the adapter {} does not read half-precision numbers", info.name));
        }
        let has = adapter.limits();
        let required_limits = wgpu::Limits {
            max_storage_buffer_binding_size: has.max_storage_buffer_binding_size,
            max_buffer_size: has.max_buffer_size,
            ..wgpu::Limits::default()
        };
        let descriptor = wgpu::DeviceDescriptor { label: Some("btf-fit"), required_limits, ..Default::default() };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| format!("the adapter {} does not open ({})", info.name, one_line(&error)))?;
        let fault = Arc::new(Mutex::new(None));
        let noted = fault.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            if let Ok(mut fault) = noted.lock() {
                fault.get_or_insert_with(|| one_line(&error));
            }
        }));
        let software = info.device_type == wgpu::DeviceType::Cpu;
        Ok(GpuDevice { device, queue, name: info.name, software, fault })
    }

    /// Returns the driver's error since the last call, if any.
    pub fn fault(&self) -> Option<String> {
        self.fault.lock().ok().and_then(|mut fault| fault.take())
    }

    /// Makes a pipeline of the entry point `entry` with override `constants`.
    pub fn pipeline(&self, label: &str, wgsl: &str, entry: &str, constants: &[(&str, f64)]) -> wgpu::ComputePipeline {
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(label),
            source: wgpu::ShaderSource::Wgsl(wgsl.into()),
        });
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(label),
            layout: None,
            module: &module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions { constants, ..Default::default() },
            cache: None,
        })
    }

    /// Makes a buffer of at least `bytes` that can be written to.
    pub fn buffer(&self, bytes: u64, usage: BufferUsages) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: bytes.max(64).next_multiple_of(16),
            usage: usage | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// Makes a buffer of `bytes` that shaders read.
    pub fn stored(&self, bytes: &[u8]) -> wgpu::Buffer {
        let buffer = self.buffer(bytes.len() as u64, BufferUsages::STORAGE);
        self.queue.write_buffer(&buffer, 0, bytes);
        buffer
    }

    /// Binds whole `buffers` to the numbers from 0 on of `pipeline`'s group 0.
    pub fn bind(&self, pipeline: &wgpu::ComputePipeline, buffers: &[&wgpu::Buffer]) -> wgpu::BindGroup {
        let entries: Vec<wgpu::BindGroupEntry> = (0..)
            .zip(buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        })
    }

    /// Has `encoder` run `pipeline` with `group` as group 0 on so many workgroups in a row, and rows of them.
    pub fn dispatch(
        encoder: &mut wgpu::CommandEncoder,
        pipeline: &wgpu::ComputePipeline,
        group: &wgpu::BindGroup,
        [columns, rows]: [usize; 2],
    ) {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group, &[]);
        pass.dispatch_workgroups(columns as u32, rows as u32, 1);
    }

    /// Returns the bytes of the largest buffer that a shader reads.
    pub fn largest_buffer(&self) -> u64 {
        let limits = self.device.limits();
        limits.max_buffer_size.min(limits.max_storage_buffer_binding_size)
    }

    /// Waits for everything that was submitted; `false` after an error.
    pub fn wait(&self) -> bool {
        // A device that is lost makes wgpu panic.
        let wait = || self.device.poll(wgpu::PollType::wait_indefinitely()).is_ok();
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(wait)).unwrap_or(false)
    }

    /// Returns the numbers in the first `bytes` of a buffer; `None` after an error of the driver.
    pub fn read<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(
        &self,
        buffer: &wgpu::Buffer,
        bytes: u64,
    ) -> Option<Vec<T>> {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let readback = self.read_back(&mut encoder, buffer, bytes);
        self.queue.submit([encoder.finish()]);
        readback.numbers(self)
    }

    /// Has `encoder` copy the first `bytes` of a buffer, a multiple of 4, for [`Readback::numbers`] once it is submitted.
    pub fn read_back(&self, encoder: &mut wgpu::CommandEncoder, buffer: &wgpu::Buffer, bytes: u64) -> Readback {
        let staging = self.buffer(bytes, BufferUsages::MAP_READ);
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, bytes);
        Readback { staging, bytes }
    }
}

/// Bytes of a buffer on their way back.
pub(crate) struct Readback {
    staging: wgpu::Buffer,
    bytes: u64,
}

impl Readback {
    /// Waits for the bytes and returns them as numbers; `None` after an error of the driver.
    pub fn numbers<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(&self, gpu: &GpuDevice) -> Option<Vec<T>> {
        let mapped = Arc::new(Mutex::new(false));
        let told = mapped.clone();
        self.staging.map_async(wgpu::MapMode::Read, 0..self.bytes, move |result| {
            if let Ok(mut told) = told.lock() {
                *told = result.is_ok();
            }
        });
        let done = gpu.wait() && mapped.lock().is_ok_and(|mapped| *mapped);
        let range = done.then(|| self.staging.get_mapped_range(0..self.bytes).ok()).flatten();
        range.map(|range| bytemuck::pod_collect_to_vec(&range))
    }
}

/// Returns an error in one line: drivers explain errors over several lines.
fn one_line(error: &dyn std::error::Error) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Returns whether `BTF_SKIP_GPU=1` leaves `test` out, and has `cargo xtask test` count it as a skipped test.
#[cfg(test)]
pub(crate) fn gpu_is_left_out(test: &str) -> bool {
    use std::io::Write;
    let left_out = std::env::var_os("BTF_SKIP_GPU").is_some_and(|value| value == "1");
    if let (true, Some(log)) = (left_out, std::env::var_os("BTF_SKIP_LOG")) {
        let mut file = std::fs::OpenOptions::new().create(true).append(true).open(log).unwrap();
        writeln!(file, "{test} (BTF_SKIP_GPU=1)").unwrap();
    }
    left_out
}
