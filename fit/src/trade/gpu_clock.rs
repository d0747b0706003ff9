//! Cost of one evaluation of the resident decoder on a GPU: the library's WGSL over a list of queries.

use crate::error::FitError;
use crate::trade::evaluation_time::Query;
use btf_runtime::{DecodeOptions, Resident, wgsl_library};
use std::sync::{Arc, Mutex};
use std::time::Instant;
use wgpu::BufferUsages;

/// Choice of the adapter that a trade is timed on.
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

/// Queries per workgroup. Twin: `@workgroup_size` of `time_main`.
const GROUP: usize = 64;
/// Evaluations per dispatch and dispatches per timed submission: enough to fill a GPU and to take far longer than the
/// submission itself (some 0.05 ms). A software driver runs on the CPU, where much less is enough.
const HARDWARE: [usize; 2] = [1 << 20, 8];
const SOFTWARE: [usize; 2] = [1 << 13, 1];
/// Backends that the decoder's shaders are tested for.
const BACKENDS: wgpu::Backends = wgpu::Backends::VULKAN.union(wgpu::Backends::METAL).union(wgpu::Backends::DX12);

/// A query as the shader reads it. Twin: `Query` in `time_queries.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct GpuQuery {
    wi: [f32; 3],
    texel: u32,
    wo: [f32; 3],
    pad: u32,
}

/// An open adapter that decoders are timed on.
pub(crate) struct GpuClock {
    device: wgpu::Device,
    queue: wgpu::Queue,
    pipeline: wgpu::ComputePipeline,
    name: String,
    software: bool,
    /// First error that the driver reported outside a call.
    fault: Arc<Mutex<Option<String>>>,
}

/// A resident asset and queries in the adapter's memory.
pub(crate) struct GpuAsset {
    words: wgpu::Buffer,
    queries: wgpu::Buffer,
    decoded: wgpu::Buffer,
    count: usize,
}

impl GpuClock {
    /// Opens the adapter of `choice`; `Ok(Err(...))` says in words why there is none.
    ///
    /// # Errors
    /// A named adapter that does not exist, with the names of those that do.
    pub(crate) fn open(choice: &GpuChoice) -> Result<Result<GpuClock, String>, FitError> {
        let name = match choice {
            GpuChoice::Off => return Ok(Err("not measured: --gpu none".into())),
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
                return Ok(Err("empty: no Vulkan, Metal or DirectX 12 adapter answers here".into()));
            };
            let found = if names.is_empty() { "none".to_string() } else { names.join(", ") };
            return Err(FitError::Params(format!(
                "--gpu: no adapter is called `{name}` (there are: {found}); give a part of one of these names, or none"
            )));
        };
        Ok(GpuClock::from_adapter(&adapter))
    }

    fn from_adapter(adapter: &wgpu::Adapter) -> Result<GpuClock, String> {
        let info = adapter.get_info();
        if !adapter.get_downlevel_capabilities().flags.contains(wgpu::DownlevelFlags::SHADER_F16_IN_F32) {
            return Err(format!("empty: the adapter {} does not read half-precision numbers", info.name));
        }
        let has = adapter.limits();
        let required_limits = wgpu::Limits {
            max_storage_buffer_binding_size: has.max_storage_buffer_binding_size,
            max_buffer_size: has.max_buffer_size,
            ..wgpu::Limits::default()
        };
        let descriptor = wgpu::DeviceDescriptor { label: Some("btf-fit"), required_limits, ..Default::default() };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| format!("empty: the adapter {} does not open ({})", info.name, one_line(&error)))?;
        let fault = Arc::new(Mutex::new(None));
        let noted = fault.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            if let Ok(mut fault) = noted.lock() {
                fault.get_or_insert_with(|| one_line(&error));
            }
        }));
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("trade"),
            source: wgpu::ShaderSource::Wgsl(module_text().into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("trade"),
            layout: None,
            module: &module,
            entry_point: Some("time_main"),
            compilation_options: Default::default(),
            cache: None,
        });
        let software = info.device_type == wgpu::DeviceType::Cpu;
        let clock = GpuClock { device, queue, pipeline, name: info.name, software, fault };
        match clock.fault() {
            Some(fault) => Err(format!("empty: the adapter {} refuses the decoder ({fault})", clock.name)),
            None => Ok(clock),
        }
    }

    /// Tells whether the adapter is a driver that computes on the CPU.
    pub(crate) fn is_software(&self) -> bool {
        self.software
    }

    /// Returns the name and kind of the adapter, in words.
    pub(crate) fn words(&self) -> String {
        let [count, dispatches] = self.amount();
        let kind = if self.software {
            "a software driver, which runs on the CPU's cores: no figure of a GPU, good for ratios at most"
        } else {
            "wall clock from submission to completion"
        };
        format!(
            "{} ({kind}); {dispatches} x {count} random evaluations a pass, half precision (the shader reads no other); empty where the resident form is larger than the adapter binds",
            self.name
        )
    }

    fn amount(&self) -> [usize; 2] {
        if self.software { SOFTWARE } else { HARDWARE }
    }

    /// Returns the driver's error since the last call, if any.
    fn fault(&self) -> Option<String> {
        self.fault.lock().ok().and_then(|mut fault| fault.take())
    }

    /// Returns the number of queries that [`GpuClock::upload`] expects.
    pub(crate) fn query_count(&self) -> usize {
        self.amount()[0]
    }

    /// Uploads an asset and queries to the adapter; `None` where they do not fit.
    pub(crate) fn upload(&self, resident: &Resident, queries: &[Query]) -> Option<GpuAsset> {
        let listed: Vec<GpuQuery> =
            queries.iter().map(|(texel, wi, wo)| GpuQuery { wi: *wi, texel: *texel, wo: *wo, pad: 0 }).collect();
        let limits = self.device.limits();
        let most = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
        let bytes = 4 * resident.words().len() as u64;
        if bytes > most || queries.is_empty() || 32 * queries.len() as u64 > most {
            return None;
        }
        let words = self.buffer(bytes, BufferUsages::STORAGE);
        self.queue.write_buffer(&words, 0, bytemuck::cast_slice(resident.words()));
        let listed_buffer = self.buffer(32 * queries.len() as u64, BufferUsages::STORAGE);
        self.queue.write_buffer(&listed_buffer, 0, bytemuck::cast_slice(&listed));
        let decoded = self.buffer(16 * queries.len() as u64, BufferUsages::STORAGE | BufferUsages::COPY_SRC);
        self.fault().is_none().then_some(GpuAsset { words, queries: listed_buffer, decoded, count: queries.len() })
    }

    fn buffer(&self, bytes: u64, usage: BufferUsages) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: bytes.max(64).next_multiple_of(16),
            usage: usage | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    fn bind(&self, asset: &GpuAsset, options: &DecodeOptions) -> wgpu::BindGroup {
        let options = [options.components, options.lobes, options.interpolation as u32, 0];
        let uniform = self.buffer(16, BufferUsages::UNIFORM);
        self.queue.write_buffer(&uniform, 0, bytemuck::cast_slice(&options));
        let buffers = [&asset.words, &uniform, &asset.queries, &asset.decoded];
        let entries: Vec<wgpu::BindGroupEntry> = buffers
            .iter()
            .enumerate()
            .map(|(number, buffer)| wgpu::BindGroupEntry {
                binding: number as u32,
                resource: match number {
                    // The list's own length, which the shader asks for.
                    2 => wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                        buffer,
                        offset: 0,
                        size: std::num::NonZeroU64::new(32 * asset.count as u64),
                    }),
                    _ => buffer.as_entire_binding(),
                },
            })
            .collect();
        let layout = self.pipeline.get_bind_group_layout(0);
        self.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout: &layout, entries: &entries })
    }

    /// Submits `dispatches` passes over all queries and waits for them; `false` after an error.
    fn run(&self, asset: &GpuAsset, group: &wgpu::BindGroup, dispatches: usize) -> bool {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        for _ in 0..dispatches {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(asset.count.div_ceil(GROUP) as u32, 1, 1);
        }
        self.queue.submit([encoder.finish()]);
        self.device.poll(wgpu::PollType::wait_indefinitely()).is_ok() && self.fault().is_none()
    }

    /// Returns the nanoseconds of an evaluation: the least of `repeats` passes after one that is not counted; `None`
    /// after an error of the driver.
    pub(crate) fn nanoseconds(&self, asset: &GpuAsset, options: &DecodeOptions, repeats: usize) -> Option<f64> {
        let group = self.bind(asset, options);
        let dispatches = self.amount()[1];
        let pass = || {
            let start = Instant::now();
            let done = self.run(asset, &group, dispatches);
            done.then(|| start.elapsed().as_secs_f64() * 1e9 / (dispatches * asset.count) as f64)
        };
        pass()?;
        let times: Vec<f64> = (0..repeats.max(1)).map(|_| pass()).collect::<Option<_>>()?;
        times.into_iter().reduce(f64::min)
    }
}

/// Returns the decoder's WGSL with the entry point that is timed.
fn module_text() -> String {
    format!("{}\n{}", wgsl_library(), include_str!("time_queries.wgsl"))
}

/// Returns an error in one line: drivers explain errors over several lines.
fn one_line(error: &dyn std::error::Error) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_asset::sample_asset;
    use crate::trade::evaluation_time::random_queries;
    use btf_runtime::{Interpolation, decode};
    use std::io::Write;

    /// Returns whether `BTF_SKIP_GPU=1` leaves `test` out, and has `cargo xtask test` count it as a skipped test.
    fn gpu_is_left_out(test: &str) -> bool {
        let left_out = std::env::var_os("BTF_SKIP_GPU").is_some_and(|value| value == "1");
        if let (true, Some(log)) = (left_out, std::env::var_os("BTF_SKIP_LOG")) {
            let mut file = std::fs::OpenOptions::new().create(true).append(true).open(log).unwrap();
            writeln!(file, "{test} (BTF_SKIP_GPU=1)").unwrap();
        }
        left_out
    }

    /// Returns what the last pass decoded.
    fn values(clock: &GpuClock, asset: &GpuAsset) -> Vec<[f32; 4]> {
        let bytes = 16 * asset.count as u64;
        let staging = clock.buffer(bytes, BufferUsages::MAP_READ);
        let mut encoder = clock.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(&asset.decoded, 0, &staging, 0, bytes);
        clock.queue.submit([encoder.finish()]);
        staging.map_async(wgpu::MapMode::Read, 0..bytes, |result| result.unwrap());
        clock.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
        bytemuck::pod_collect_to_vec(&staging.get_mapped_range(0..bytes).unwrap())
    }

    #[test]
    fn what_is_timed_decodes_as_the_cpu_does() {
        if gpu_is_left_out("what_is_timed_decodes_as_the_cpu_does") {
            return;
        }
        let clock = match GpuClock::open(&GpuChoice::Best).unwrap() {
            Ok(clock) => clock,
            Err(reason) => panic!("{reason}; BTF_SKIP_GPU=1 skips this test"),
        };
        let asset = sample_asset();
        let resident = Resident::from_asset(&asset);
        // A count that is no multiple of a workgroup.
        let queries = random_queries(301, asset.texel_count(), &asset.layers[0], 3);
        let on_gpu = clock.upload(&resident, &queries).unwrap();
        for (components, interpolation) in [(0, Interpolation::Fast), (u32::MAX, Interpolation::Exact)] {
            let options = DecodeOptions { components, interpolation, ..DecodeOptions::default() };
            assert!(clock.nanoseconds(&on_gpu, &options, 1).unwrap() > 0.0);
            for ((texel, wi, wo), found) in queries.iter().zip(values(&clock, &on_gpu)) {
                let expected = decode(&resident, 0, *texel, *wi, *wo, &options);
                let near = (0..3).all(|c| (found[c] - expected[c]).abs() <= 1e-3 + 1e-3 * expected[c].abs());
                assert!(near, "{expected:?} {found:?}");
            }
        }
        assert!(clock.words().contains(&clock.name) && clock.words().contains("software") == clock.is_software());
    }

    #[test]
    fn an_adapter_that_is_not_there_is_named_and_none_is_none() {
        let named = GpuClock::open(&GpuChoice::Named("no such adapter".into())).map(|_| ());
        let message = named.unwrap_err().to_string();
        assert!(message.contains("no such adapter") && !message.contains('\n'), "{message}");
        assert!(GpuClock::open(&GpuChoice::Off).unwrap().is_err());
    }
}
