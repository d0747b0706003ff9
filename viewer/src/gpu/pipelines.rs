//! The pipelines of a tracer: one for each pass, compiled when a picture first needs it, for what pictures need.

use crate::gpu::backend::GpuTracer;
use crate::gpu::device::Gpu;
use crate::gpu::modules::ModuleLayout;
use crate::gpu::pipeline_constants::PipelineConstants;
use crate::gpu::results::timer::{PASSES, Pass};

/// Columns and rows of pixels of a workgroup, where nothing else is asked for.
const GROUP: [u32; 2] = [8, 8];

/// Label of the pipelines' layout. A page compiles those of this layout without keeping others waiting.
const LAYOUT_LABEL: &str = "trace";

/// Tells whether pipelines that were made are still being compiled, as in a browser they are for a while. They must not be
/// used before.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn are_compiling() -> bool {
    false
}

/// Tells whether pipelines that were made are still being compiled. They must not be used before.
#[cfg(target_arch = "wasm32")]
pub(crate) fn are_compiling() -> bool {
    #[wasm_bindgen::prelude::wasm_bindgen]
    extern "C" {
        /// Number of pipelines in the making; `deferred_pipelines.js` defines it.
        #[wasm_bindgen(js_name = btfPipelinesInTheMaking)]
        fn pipelines_in_the_making() -> u32;
    }
    pipelines_in_the_making() > 0
}

/// Pipelines by pass. Drivers take their time to compile: seconds on GPUs, tens of seconds on the processor.
pub(crate) struct Pipelines {
    /// What the module is joined for, where pipelines may serve other scenes, too.
    of: Option<(GpuTracer, ModuleLayout)>,
    device: wgpu::Device,
    module: wgpu::ShaderModule,
    layout: wgpu::PipelineLayout,
    /// What they are compiled for.
    constants: PipelineConstants,
    /// Columns and rows of pixels of a workgroup.
    group: [u32; 2],
    by_pass: [Option<wgpu::ComputePipeline>; PASSES],
}

impl Pipelines {
    /// Makes pipelines of the entry points of `module`, none of which is compiled yet.
    pub(crate) fn new(
        gpu: &Gpu,
        of: Option<(GpuTracer, ModuleLayout)>,
        module: wgpu::ShaderModule,
        bind_groups: &[&wgpu::BindGroupLayout],
    ) -> Pipelines {
        let groups: Vec<_> = bind_groups.iter().map(|group| Some(*group)).collect();
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(LAYOUT_LABEL),
            bind_group_layouts: &groups,
            ..Default::default()
        });
        let constants = PipelineConstants::default();
        let by_pass = [const { None }; PASSES];
        Pipelines { of, device: gpu.device.clone(), module, layout, constants, group: GROUP, by_pass }
    }

    /// Tells whether these pipelines serve for such a module on a device: layouts that were made alike are alike.
    pub(crate) fn are_of(&self, gpu: &Gpu, of: (GpuTracer, ModuleLayout)) -> bool {
        let serves = |(tracer, layout): (GpuTracer, ModuleLayout)| tracer == of.0 && layout.serves(of.1);
        self.of.is_some_and(serves) && self.device == gpu.device
    }

    /// Sets the columns and rows of pixels of a workgroup, at most 256 together.
    pub(crate) fn set_group(&mut self, group: [u32; 2]) {
        self.group = group;
        self.by_pass = [const { None }; PASSES];
    }

    /// Returns the columns and rows of pixels of a workgroup.
    pub(crate) fn group(&self) -> [u32; 2] {
        self.group
    }

    /// Has all pipelines also serve what `needed` asks for: those that do not are dropped.
    pub(crate) fn expect(&mut self, needed: PipelineConstants) {
        if !self.constants.serve(needed) {
            self.constants = self.constants.and(needed);
            self.by_pass = [const { None }; PASSES];
        }
    }

    /// Compiles those of `passes` that are not yet, for what `needed` asks for.
    pub(crate) fn prepare(&mut self, passes: &[Pass], needed: PipelineConstants) {
        self.expect(needed);
        for pass in passes {
            if self.by_pass[*pass as usize].is_none() {
                self.by_pass[*pass as usize] = Some(self.compile(*pass));
            }
        }
    }

    /// Tells whether those of `passes` are compiled and serve what `needed` asks for.
    pub(crate) fn are_ready(&self, passes: &[Pass], needed: PipelineConstants) -> bool {
        self.constants.serve(needed) && passes.iter().all(|pass| self.get(*pass).is_some())
    }

    /// Returns the pipeline of a pass, if it is compiled.
    pub(crate) fn get(&self, pass: Pass) -> Option<&wgpu::ComputePipeline> {
        self.by_pass[pass as usize].as_ref()
    }

    fn compile(&self, pass: Pass) -> wgpu::ComputePipeline {
        let group = [("group_width", self.group[0].into()), ("group_height", self.group[1].into())];
        let constants: Vec<_> = self.constants.values(pass).into_iter().chain(group).collect();
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(pass.entry_point()),
            layout: Some(&self.layout),
            module: &self.module,
            entry_point: Some(pass.entry_point()),
            compilation_options: wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() },
            cache: None,
        })
    }
}
