//! What the steps of a measurement share: the device, the assets in both resident forms, and sizes.

use crate::bench::gpu::params::GpuBenchParams;
use crate::bench::points::Point;
use crate::error::ViewerError;
use crate::gpu::backend::GpuTracer;
use crate::gpu::device::Gpu;
use crate::options::{DecoderForm, ShadeOptions};
use crate::render::engine::Engine;
use crate::scene::asset::SceneAsset;
use crate::scene::scene::{MeshChoice, Scene};
use btf_runtime::PackedGoal;
use std::sync::Arc;

/// The share of the expanded form's bytes that the packed form takes, of an asset of so many bytes or more.
const PACKED_SHARE: u64 = 8;
const LARGE_BYTES: u64 = 32_000_000;
/// PSNR to which the bases of smaller assets are packed, dB: most of their bytes are no bases, and an eighth would leave none.
const PACKED_PSNR_DB: f32 = 40.0;
/// The divisor of a picture's sides in a quick run.
const QUICK_SHRINK: u32 = 8;

/// A form of an asset in the memory of a renderer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum ResidentForm {
    /// All bases multiplied out.
    Expanded,
    /// Bases in few bits.
    Packed,
}

/// The device and what it is measured by.
pub(super) struct Workload<'a> {
    pub params: &'a GpuBenchParams,
    pub gpu: Gpu,
    pub tracer: GpuTracer,
}

impl<'a> Workload<'a> {
    /// Opens the device.
    ///
    /// # Errors
    /// [`ViewerError::NoAdapter`].
    pub(super) fn open(params: &'a GpuBenchParams) -> Result<Workload<'a>, ViewerError> {
        let gpu = Gpu::headless(params.adapter.as_deref())?;
        let tracer = params.tracer.unwrap_or(gpu.best_tracer());
        gpu.require(tracer)?;
        Ok(Workload { params, gpu, tracer })
    }

    /// Returns the renderer that is measured.
    pub(super) fn engine(&self) -> Engine {
        Engine::Gpu(Box::new(self.gpu.clone()), self.tracer)
    }

    /// Returns the assets in a form. Cost: where they are in file form, packing expands their bases twice.
    pub(super) fn assets(&self, form: ResidentForm) -> Vec<Arc<SceneAsset>> {
        let assets = &self.params.assets;
        if form == ResidentForm::Expanded {
            return assets.clone();
        }
        let goal = |asset: &SceneAsset| {
            let bytes = 4 * asset.head().words().len() as u64;
            match bytes < LARGE_BYTES {
                true => PackedGoal::of_psnr(PACKED_PSNR_DB),
                false => PackedGoal::Bytes(bytes / PACKED_SHARE),
            }
        };
        assets.iter().map(|asset| Arc::new(asset.packed(goal(asset)))).collect()
    }

    /// Ends a comparison with the CPU: `faults` are those of `what`.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] where there are any.
    pub(super) fn judge(&self, what: &str, faults: &[String]) -> Result<(), ViewerError> {
        match faults.is_empty() {
            true => Ok(()),
            false => Err(self.gpu.error(format!("{what} differ from the CPU's: {}", faults.join(", ")))),
        }
    }

    /// Returns a picture's size, smaller in a quick run.
    pub(super) fn size(&self, [width, height]: [u32; 2]) -> [u32; 2] {
        let shrink = if self.params.quick { QUICK_SHRINK } else { 1 };
        [width.div_ceil(shrink), height.div_ceil(shrink)]
    }

    /// Makes the point of a built-in scene with one light, all components and levels.
    ///
    /// # Errors
    /// The errors of [`Scene::built_in`].
    pub(super) fn built_in(
        &self,
        (name, mesh): (&'static str, MeshChoice),
        assets: &[Arc<SceneAsset>],
        size: [u32; 2],
    ) -> Result<Point, ViewerError> {
        Ok(self.point(name, Scene::built_in(&mesh, assets.to_vec(), [1.0; 2])?, size))
    }

    /// Makes a point of a scene that is drawn as the viewer draws if nothing else is asked for.
    pub(super) fn point(&self, name: &'static str, scene: Scene, size: [u32; 2]) -> Point {
        Point {
            mesh: name,
            variant: "",
            scene,
            size: self.size(size),
            shade: ShadeOptions::default(),
            decoder: DecoderForm::Halves,
            moves: false,
        }
    }
}
