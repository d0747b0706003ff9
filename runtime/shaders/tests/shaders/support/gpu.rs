//! Runs entry points on the software driver through wgpu, as WGSL or as unchecked SPIR-V. A missing driver is a
//! failure, unless `BTF_SKIP_GPU=1` leaves these tests out, visibly.

use btf_shaders::{Range, WORKGROUP};
use bytemuck::Pod;
use std::sync::Once;
use wgpu::{BindingType, BufferBindingType, BufferUsages};

/// A shader that can run.
pub enum Program<'a> {
    /// A WGSL module.
    Wgsl(&'a str),
    /// SPIR-V, which goes to the driver as it is.
    SpirV(&'a [u32]),
}

/// Environment variables with which Mesa's software driver compiles a new module in about a third of the time: four
/// lanes and no optimiser. Running takes longer, which does not matter for a thousand queries.
pub const QUICK_COMPILER: [(&str, &str); 2] = [("LP_NATIVE_VECTOR_WIDTH", "128"), ("GALLIVM_PERF", "nopt")];

/// Sets [`QUICK_COMPILER`] for this process, before the first driver is loaded.
fn quicken_compiler() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        for (name, value) in QUICK_COMPILER {
            // SAFETY: nothing but std, which locks the environment, and the driver, which is loaded after this, reads
            // it in the processes of these tests.
            #[allow(unsafe_code, reason = "the driver is told by its environment only")]
            unsafe {
                std::env::set_var(name, value);
            }
        }
    });
}

/// An open device.
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
}

/// Opens the device for `test`; `None` if GPU tests are left out on purpose.
///
/// # Panics
/// If there is no device; the message says how to get one.
pub fn open(test: &str) -> Option<Gpu> {
    if super::is_set("BTF_SKIP_GPU") {
        super::skip(&format!("{test} (BTF_SKIP_GPU=1)"));
        return None;
    }
    quicken_compiler();
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN;
    let instance = wgpu::Instance::new(descriptor);
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    // The software driver where there is one: the same on every machine.
    let adapter = adapters
        .into_iter()
        .min_by_key(|adapter| adapter.get_info().device_type != wgpu::DeviceType::Cpu)
        .expect("no Vulkan driver answers: `cargo xtask setup` installs one, BTF_SKIP_GPU=1 leaves GPU tests out");
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
        required_features: wgpu::Features::PASSTHROUGH_SHADERS,
        ..Default::default()
    }))
    .expect("the driver runs SPIR-V as it is");
    Some(Gpu { device, queue })
}

impl Gpu {
    /// Returns the answers of `entry` to all `queries` over asset words; queries and answers have the layout of the
    /// program.
    ///
    /// # Panics
    /// If the driver refuses.
    pub fn answers<Q: Pod, A: Pod>(&self, program: &Program, entry: &str, words: &[u32], queries: &[Q]) -> Vec<A> {
        let device = &self.device;
        let module = match program {
            Program::Wgsl(text) => device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(entry),
                source: wgpu::ShaderSource::Wgsl((*text).into()),
            }),
            Program::SpirV(words) => {
                let descriptor = wgpu::ShaderModuleDescriptorPassthrough {
                    label: Some(entry),
                    entry_points: vec![wgpu::PassthroughShaderEntryPoint {
                        name: entry.into(),
                        workgroup_size: (WORKGROUP, 1, 1),
                    }]
                    .into(),
                    spirv: Some((*words).into()),
                    ..Default::default()
                };
                // SAFETY: the callers' SPIR-V comes from naga or glslang, binds what the layout below has, and reads
                // within the words of assets that btf-runtime has laid out.
                #[allow(unsafe_code, reason = "SPIR-V that wgpu does not read takes this call")]
                unsafe {
                    device.create_shader_module_passthrough(descriptor)
                }
            }
        };
        let storage = |read_only| BindingType::Buffer {
            ty: BufferBindingType::Storage { read_only },
            has_dynamic_offset: false,
            min_binding_size: None,
        };
        let uniform =
            BindingType::Buffer { ty: BufferBindingType::Uniform, has_dynamic_offset: false, min_binding_size: None };
        let kinds = [storage(true), storage(true), uniform, storage(false)];
        let entries: Vec<_> = kinds
            .into_iter()
            .zip(0..)
            .map(|(ty, binding)| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty,
                count: None,
            })
            .collect();
        let layout =
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&layout)],
            ..Default::default()
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry),
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some(entry),
            compilation_options: Default::default(),
            cache: None,
        });
        let range = Range { first: 0, count: queries.len() as u32, pad: [0; 2] };
        let length = (size_of::<A>() * queries.len()) as u64;
        let buffers = [
            self.buffer(bytemuck::cast_slice(words), BufferUsages::STORAGE),
            self.buffer(bytemuck::cast_slice(queries), BufferUsages::STORAGE),
            self.buffer(bytemuck::bytes_of(&range), BufferUsages::UNIFORM),
            self.empty(length, BufferUsages::STORAGE | BufferUsages::COPY_SRC),
        ];
        let resources: Vec<_> = buffers
            .iter()
            .zip(0..)
            .map(|(buffer, binding)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let group =
            device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout: &layout, entries: &resources });
        let copy = self.empty(length, BufferUsages::MAP_READ | BufferUsages::COPY_DST);
        let mut encoder = device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups((queries.len() as u32).div_ceil(WORKGROUP), 1, 1);
        }
        encoder.copy_buffer_to_buffer(&buffers[3], 0, &copy, 0, length);
        self.queue.submit([encoder.finish()]);
        copy.slice(..).map_async(wgpu::MapMode::Read, |result| result.expect("the answers are mapped"));
        device.poll(wgpu::PollType::wait_indefinitely()).expect("the driver finishes");
        let mapped = copy.slice(..).get_mapped_range().expect("the answers are mapped");
        bytemuck::pod_collect_to_vec(&mapped)
    }

    fn empty(&self, size: u64, usage: BufferUsages) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size,
            usage: usage | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    fn buffer(&self, bytes: &[u8], usage: BufferUsages) -> wgpu::Buffer {
        let buffer = self.empty(bytes.len() as u64, usage);
        self.queue.write_buffer(&buffer, 0, bytes);
        buffer
    }
}
