// Has the pipelines that draw pictures compiled beside everything else. A browser compiles what createComputePipeline makes
// at once and keeps every page waiting for it; createComputePipelineAsync does not, but gives the pipeline later, and the
// viewer's library has no call for that. So the viewer gets a stand-in, which setPipeline replaces by the pipeline. It does
// not use pipelines before btfPipelinesInTheMaking() is 0.

// The label of the layout whose pipelines are deferred: LAYOUT_LABEL in viewer/src/gpu/pipelines.rs.
const LAYOUT = 'trace';

const compiled = new WeakMap();
let inTheMaking = 0;

globalThis.btfPipelinesInTheMaking = () => inTheMaking;

export function deferPipelines(onFailure) {
  if (!globalThis.GPUDevice) {
    return;
  }
  const create = GPUDevice.prototype.createComputePipeline;
  GPUDevice.prototype.createComputePipeline = function (descriptor) {
    if (descriptor.layout?.label !== LAYOUT) {
      return create.call(this, descriptor);
    }
    const standIn = {};
    inTheMaking += 1;
    this.createComputePipelineAsync(descriptor)
      .then((pipeline) => compiled.set(standIn, pipeline), (error) => onFailure(error.message))
      .finally(() => { inTheMaking -= 1; });
    return standIn;
  };
  const set = GPUComputePassEncoder.prototype.setPipeline;
  GPUComputePassEncoder.prototype.setPipeline = function (pipeline) {
    set.call(this, pipeline instanceof GPUComputePipeline ? pipeline : compiled.get(pipeline));
  };
}
