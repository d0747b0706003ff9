//! The shaders of a picture as text, for tools that compile them without a GPU.

use crate::gpu::backend::GpuTracer;
use crate::gpu::modules::{ModuleLayout, trace_module};
use crate::gpu::pipeline_constants::PipelineConstants;
use crate::gpu::structure::with_proxies;
use crate::gpu::tracer::passes_of;
use crate::options::{DecoderForm, ShadeOptions};
use crate::scene::scene::Scene;

/// The shader of a pass over the pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct PassShader {
    /// Name of the entry point in the module.
    pub entry_point: &'static str,
    /// The pipeline-overridable constants that the viewer compiles it with.
    pub constants: Vec<(&'static str, f64)>,
}

/// Returns the WGSL module that draws `scene` where no array is cut, and its passes, each once. With
/// [`GpuTracer::RayQuery`] the text is of wgpu's dialect.
pub fn pass_shaders(scene: &Scene, options: &ShadeOptions, tracer: GpuTracer) -> (String, Vec<PassShader>) {
    let (geometry, volume_root) = with_proxies(scene);
    let layout = ModuleLayout::of_scene(scene, tracer, &geometry, &[geometry.root(), volume_root]);
    let constants = PipelineConstants::of(scene, options, DecoderForm::default());
    let mut passes: Vec<PassShader> = Vec::new();
    for pass in passes_of(scene, options) {
        if passes.iter().all(|other| other.entry_point != pass.entry_point()) {
            let constants = constants.values(pass).to_vec();
            passes.push(PassShader { entry_point: pass.entry_point(), constants });
        }
    }
    (trace_module(tracer, layout), passes)
}
