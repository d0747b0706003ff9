//! The adapter and the device.

use crate::error::ViewerError;
use crate::gpu::backend::{Expansion, GpuTracer};
use crate::gpu::limits::{IN_BROWSER, asked_limits, missing_limit};
use std::sync::{Arc, Mutex};
use std::thread::ThreadId;

/// An open device. A clone stands for the same device.
#[derive(Clone)]
pub struct Gpu {
    /// The device.
    pub device: wgpu::Device,
    /// The queue of the device.
    pub queue: wgpu::Queue,
    pub(crate) instance: wgpu::Instance,
    pub(crate) adapter: wgpu::Adapter,
    info: wgpu::AdapterInfo,
    /// Bytes of one binding at most.
    max_binding_bytes: u64,
    /// Whether the device expands assets' bases, and not the CPU.
    expands_bases: bool,
    /// Errors that the driver reported outside a call, the first of each thread.
    faults: Arc<Mutex<Vec<Fault>>>,
}

/// An error that the driver reported.
struct Fault {
    /// The thread whose call it was; `None` for the loss of the device.
    thread: Option<ThreadId>,
    reason: String,
}

/// The remedy where no adapter answers.
const NO_ADAPTER_REMEDY: &str = "to have one, install the graphics driver's Vulkan part (on Debian and Ubuntu the \
                                 package mesa-vulkan-drivers, which also has a software driver); --headless with \
                                 --backend cpu renders without";

/// Storage buffers of a stage that hold neither assets nor geometry.
const OTHER_STORAGE_BUFFERS: u32 = 4;

/// Which backends are looked at: those that the shaders are tested for.
#[cfg(not(target_arch = "wasm32"))]
const BACKENDS: wgpu::Backends = wgpu::Backends::VULKAN.union(wgpu::Backends::METAL).union(wgpu::Backends::DX12);
#[cfg(target_arch = "wasm32")]
const BACKENDS: wgpu::Backends = wgpu::Backends::BROWSER_WEBGPU;

pub(crate) fn instance(display: Option<Box<dyn wgpu::wgt::WgpuHasDisplayHandle>>) -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = BACKENDS;
    descriptor.display = display;
    wgpu::Instance::new(descriptor)
}

impl Gpu {
    /// Opens the best adapter for work without a window, or the first whose name contains `adapter_name` (in any case).
    ///
    /// # Errors
    /// [`ViewerError::NoAdapter`] naming what to install, or which adapters there are.
    pub fn headless(adapter_name: Option<&str>) -> Result<Gpu, ViewerError> {
        Gpu::open(instance(None), None, adapter_name)
    }

    /// Opens the best adapter that can present to `surface`, or the first whose name contains `adapter_name`.
    pub(crate) fn open(
        instance: wgpu::Instance,
        surface: Option<&wgpu::Surface>,
        adapter_name: Option<&str>,
    ) -> Result<Gpu, ViewerError> {
        let mut adapters = pollster::block_on(instance.enumerate_adapters(BACKENDS));
        adapters.retain(|adapter| surface.is_none_or(|surface| adapter.is_surface_supported(surface)));
        if adapters.is_empty() {
            let purpose = if surface.is_some() { " that can show a window" } else { "" };
            return Err(ViewerError::NoAdapter(format!(
                "no Vulkan, Metal or DirectX 12 adapter{purpose} answers; {NO_ADAPTER_REMEDY}"
            )));
        }
        let names: Vec<String> = adapters.iter().map(|adapter| adapter.get_info().name).collect();
        // A GPU before a software driver; among equals the one that the system lists first.
        let rank = |adapter: &wgpu::Adapter| match adapter.get_info().device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu => 2,
            wgpu::DeviceType::Other => 3,
            wgpu::DeviceType::Cpu => 4,
        };
        let wanted = adapter_name.map(str::to_lowercase);
        let adapter = adapters
            .into_iter()
            .filter(|adapter| {
                wanted.as_ref().is_none_or(|wanted| adapter.get_info().name.to_lowercase().contains(wanted))
            })
            .min_by_key(rank)
            .ok_or_else(|| {
                ViewerError::NoAdapter(format!(
                    "no adapter is called '{}', there are: {}",
                    adapter_name.unwrap_or_default(),
                    names.join(", ")
                ))
            })?;
        pollster::block_on(Gpu::from_adapter(instance, adapter))
    }

    /// Opens the adapter that a browser gives, within the limits that every one has, for pictures on `surface`.
    ///
    /// # Errors
    /// [`ViewerError::NoAdapter`], [`ViewerError::Gpu`].
    #[cfg(target_arch = "wasm32")]
    pub async fn of_browser(instance: wgpu::Instance, surface: Option<&wgpu::Surface<'_>>) -> Result<Gpu, ViewerError> {
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            compatible_surface: surface,
            ..Default::default()
        };
        let adapter = instance.request_adapter(&options).await.map_err(|_| {
            ViewerError::NoAdapter("this browser has WebGPU, but no graphics adapter for it answers".into())
        })?;
        Gpu::from_adapter(instance, adapter).await
    }

    async fn from_adapter(instance: wgpu::Instance, adapter: wgpu::Adapter) -> Result<Gpu, ViewerError> {
        let info = adapter.get_info();
        // Assets hold half-precision numbers; every adapter that could run WebGPU reads them.
        if !adapter.get_downlevel_capabilities().flags.contains(wgpu::DownlevelFlags::SHADER_F16_IN_F32) {
            return Err(ViewerError::NoAdapter(format!(
                "the adapter {} does not read half-precision numbers, use --backend cpu",
                info.name
            )));
        }
        let wanted = match IN_BROWSER {
            true => wgpu::Features::empty(),
            false => wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::EXPERIMENTAL_RAY_QUERY,
        };
        let features = adapter.features() & wanted;
        let ray_query = features.contains(wgpu::Features::EXPERIMENTAL_RAY_QUERY);
        let has = adapter.limits();
        let mut limits = asked_limits(&has);
        if ray_query {
            limits = limits.using_acceleration_structure_values(has.clone());
        }
        if let Some(missing) = missing_limit(&limits, &has) {
            return Err(ViewerError::Gpu { adapter: info.name.clone(), reason: missing });
        }
        #[allow(unsafe_code, reason = "wgpu marks ray queries as experimental; asking for them takes this call")]
        let experimental_features = if ray_query {
            unsafe { wgpu::ExperimentalFeatures::enabled() }
        } else {
            wgpu::ExperimentalFeatures::disabled()
        };
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("btf-viewer"),
            required_features: features,
            required_limits: limits,
            experimental_features,
            ..Default::default()
        };
        let opened = adapter.request_device(&descriptor).await;
        let (device, queue) = opened
            .map_err(|error| ViewerError::Gpu { adapter: info.name.clone(), reason: one_line(&error.to_string()) })?;
        let faults = Arc::new(Mutex::new(Vec::new()));
        let (on_error, on_loss) = (faults.clone(), faults.clone());
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            note(&on_error, Some(std::thread::current().id()), &error.to_string());
        }));
        device.set_device_lost_callback(move |reason, message| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                note(&on_loss, None, &format!("the device was lost: {message}"));
            }
        });
        let limits = device.limits();
        let max_binding_bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        // Software drivers compute on the CPU, which is faster at it with its own vectors.
        let expands_bases = info.device_type != wgpu::DeviceType::Cpu;
        Ok(Gpu { device, queue, instance, adapter, info, max_binding_bytes, expands_bases, faults })
    }

    /// Opens the device that traces beside a window: this one, but on a software driver another one of the same adapter.
    /// Such a driver compiles at a shader's first dispatch, and everything that is submitted to the device later, the
    /// window's frames among it, waits for that.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`].
    pub(crate) fn for_tracing(&self) -> Result<Gpu, ViewerError> {
        match self.info.device_type {
            // Browsers compile beside the window's work.
            wgpu::DeviceType::Cpu if !IN_BROWSER => {
                pollster::block_on(Gpu::from_adapter(self.instance.clone(), self.adapter.clone()))
            }
            _ => Ok(self.clone()),
        }
    }

    /// Returns the adapter name as the driver gives it.
    pub fn adapter_name(&self) -> &str {
        &self.info.name
    }

    /// Graphics interface, e.g. "vulkan", and kind of adapter, e.g. "Cpu" for a software driver.
    pub fn interface(&self) -> String {
        format!("{} {:?}", self.info.backend.to_str(), self.info.device_type)
    }

    /// Returns whether the device has ray queries.
    pub fn has_ray_query(&self) -> bool {
        self.device.features().contains(wgpu::Features::EXPERIMENTAL_RAY_QUERY)
    }

    /// Returns whether the device has timestamps.
    pub fn has_timestamps(&self) -> bool {
        self.device.features().contains(wgpu::Features::TIMESTAMP_QUERY)
    }

    /// Has assets cut into pieces of at most `bytes` and pictures into bands, as on an adapter that binds no more at
    /// once.
    pub fn limit_bindings(&mut self, bytes: u64) {
        self.max_binding_bytes = self.max_binding_bytes.min(bytes);
    }

    /// Chooses where the bases of assets in file form are expanded. At first GPUs expand them, and the CPU does for software
    /// drivers.
    pub fn expand_bases(&mut self, expansion: Expansion) {
        self.expands_bases = expansion == Expansion::OnGpu;
    }

    pub(crate) fn expands_bases(&self) -> bool {
        self.expands_bases
    }

    pub(crate) fn max_binding_bytes(&self) -> u64 {
        self.max_binding_bytes
    }

    /// Returns how many pieces of assets, vertices, triangles and nodes can be bound together, beside the other buffers
    /// of a stage.
    pub(crate) fn max_pieces(&self) -> u32 {
        self.device.limits().max_storage_buffers_per_shader_stage - OTHER_STORAGE_BUFFERS
    }

    /// Returns the tracer that `auto` means here.
    pub fn best_tracer(&self) -> GpuTracer {
        if self.has_ray_query() { GpuTracer::RayQuery } else { GpuTracer::Bvh }
    }

    /// Checks that the device can run `tracer`.
    ///
    /// # Errors
    /// [`ViewerError::NoAdapter`] if this device cannot run `tracer`.
    pub fn require(&self, tracer: GpuTracer) -> Result<(), ViewerError> {
        if tracer == GpuTracer::RayQuery && !self.has_ray_query() {
            return Err(ViewerError::NoAdapter(format!(
                "the adapter {} has no ray query (software drivers have it from Mesa 24.1 on: on Debian 12 take \
                 mesa-vulkan-drivers from bookworm-backports), use --backend bvh",
                self.info.name
            )));
        }
        Ok(())
    }

    /// Checks that the driver reported no error since the last call, of this thread's work.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`].
    pub fn check(&self) -> Result<(), ViewerError> {
        let Ok(mut faults) = self.faults.lock() else { return Ok(()) };
        let own = Some(std::thread::current().id());
        let found = faults.iter().position(|fault| fault.thread.is_none() || fault.thread == own);
        found.map_or(Ok(()), |number| Err(self.error(faults.remove(number).reason)))
    }

    pub(crate) fn error(&self, reason: impl Into<String>) -> ViewerError {
        ViewerError::Gpu { adapter: self.info.name.clone(), reason: reason.into() }
    }

    /// Waits for all submitted work; not in a browser, where [`Fence`](crate::gpu::results::fence::Fence) tells.
    pub(crate) fn wait(&self) -> Result<(), ViewerError> {
        self.device
            .poll(wgpu::PollType::wait_indefinitely())
            .map_err(|error| self.error(one_line(&error.to_string())))?;
        self.check()
    }

    /// Creates a storage or other buffer that holds `bytes`; at least 64 bytes long, because empty bindings are not
    /// allowed.
    pub(crate) fn buffer(
        &self,
        label: &str,
        bytes: &[u8],
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer, ViewerError> {
        let buffer = self.empty_buffer(label, bytes.len() as u64, usage)?;
        self.queue.write_buffer(&buffer, 0, bytes);
        Ok(buffer)
    }

    /// Makes the module of a shader of ours, whose loops all end: without the counters by which wgpu ends them.
    pub(crate) fn shader_module(&self, label: &str, wgsl: String) -> wgpu::ShaderModule {
        let descriptor =
            wgpu::ShaderModuleDescriptor { label: Some(label), source: wgpu::ShaderSource::Wgsl(wgsl.into()) };
        let checks = wgpu::ShaderRuntimeChecks { force_loop_bounding: false, ..wgpu::ShaderRuntimeChecks::checked() };
        #[allow(unsafe_code, reason = "wgpu takes our word for it that loops end; every other check is left on")]
        unsafe {
            self.device.create_shader_module_trusted(descriptor, checks)
        }
    }

    pub(crate) fn empty_buffer(
        &self,
        label: &str,
        bytes: u64,
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer, ViewerError> {
        const MIN_BYTES: u64 = 64;
        let size = bytes.max(MIN_BYTES).next_multiple_of(4);
        let limits = self.device.limits();
        let most = if usage.contains(wgpu::BufferUsages::STORAGE) {
            limits.max_buffer_size.min(limits.max_storage_buffer_binding_size)
        } else {
            limits.max_buffer_size
        };
        if size > most {
            return Err(self.error(format!(
                "the {label} take {:.1} MiB and this adapter binds at most {:.1} MiB at once",
                size as f64 / (1 << 20) as f64,
                most as f64 / (1 << 20) as f64
            )));
        }
        let usage = usage | wgpu::BufferUsages::COPY_DST;
        Ok(self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage,
            mapped_at_creation: false,
        }))
    }
}

fn note(faults: &Mutex<Vec<Fault>>, thread: Option<ThreadId>, message: &str) {
    if let Ok(mut faults) = faults.lock()
        && faults.iter().all(|fault| fault.thread != thread)
    {
        faults.push(Fault { thread, reason: one_line(message) });
    }
}

/// Joins the lines of a message: wgpu explains errors over several.
pub(crate) fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}
