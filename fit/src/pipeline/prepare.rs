//! A fit up to the choice of its step: what `fit` searches in and `trade` sweeps over.

use crate::error::FitError;
use crate::gpu::fit_gpu::FitGpu;
use crate::input::tile_cache::{DecodedImages, TileCache};
use crate::monitor::Monitor;
use crate::params::ValidFitParams;
use crate::pipeline::adapter::FitAdapter;
use crate::pipeline::assemble::{assemble, greatest_coefficient};
use crate::pipeline::choose_error::with_chosen_error;
use crate::pipeline::memory_plan::{MemoryPlan, Surroundings, plan_memory};
use crate::pipeline::prepare_layer::{PreparedLayer, prepare_layer};
use crate::resume::checkpoint::Checkpoint;
use crate::stages::encode::Coding;
use crate::stages::rate_labels::{TexelGoal, step_for};
use btf_capture::Capture;
use btf_runtime::{Asset, MAX_LAYERS};

/// A fit up to the choice of its step.
pub struct PreparedFit {
    /// The layers without residual, with what their residuals are quantised from.
    pub layers: Vec<PreparedLayer>,
    /// Texels per row, rows.
    pub grid: [usize; 2],
    /// Decoded images of a single capture. With several captures each would take its room until all are fitted.
    pub images: Option<DecodedImages>,
}

/// Tells what a capture that is no full grid of measured directions lacks.
fn remark_on(capture: &Capture, monitor: &Monitor) {
    let info = capture.info();
    if let Some(snapped) = capture.snapped() {
        monitor.remark(&format!(
            "{}: directions count as those that capture.toml names, at most {:.1} degrees away; {} images were left out for nearer \
             ones",
            info.name, snapped.largest_deg, snapped.left_out
        ));
    }
    if !info.missing.is_empty() {
        let rounds = info.lights.rounds();
        let (missing, pairs) = (info.missing.len() / rounds, info.pair_count() / rounds);
        monitor.remark(&format!(
            "{}: {missing} of its {pairs} pairs have no image; they are predicted from the others",
            info.name
        ));
    }
}

impl PreparedFit {
    /// Runs every stage but the last. Memory: at most `params.memory_bytes()`; four bytes per texel and shared basis
    /// stay.
    ///
    /// # Errors
    /// As [`crate::fit()`], without those about a budget.
    pub fn prepare(captures: &[Capture], params: &ValidFitParams, monitor: &Monitor) -> Result<PreparedFit, FitError> {
        check_layers(captures)?;
        let params = &with_chosen_error(captures, params)?;
        let checkpoint = Checkpoint::open(captures, params, monitor)?;
        let adapter = FitAdapter::new(captures, params, monitor);
        let prepared = PreparedFit::prepare_from(captures, params, &checkpoint, adapter.gpu()?, monitor)?;
        adapter.tell();
        Ok(prepared)
    }

    /// Runs every stage but the last from the finished stages in `checkpoint`, on `gpu` where that is quicker. [`check_layers`] must
    /// have passed.
    pub fn prepare_from(
        captures: &[Capture],
        params: &ValidFitParams,
        checkpoint: &Checkpoint,
        gpu: Option<&FitGpu>,
        monitor: &Monitor,
    ) -> Result<PreparedFit, FitError> {
        let first = captures[0].info();
        let mut prepared = PreparedFit { layers: Vec::new(), grid: [first.width, first.height], images: None };
        for (number, capture) in captures.iter().enumerate() {
            remark_on(capture, monitor);
            let surroundings =
                Surroundings { waiting: captures.len() - 1, threads: rayon::current_num_threads(), gpu: gpu.is_some() };
            let MemoryPlan { sample, cache_bytes } = plan_memory(capture.info(), params, surroundings)?;
            let stages = checkpoint.layer(number, sample);
            // A cache is held in memory if it takes at most half of what it is told: tell it twice what is left.
            let (most, kept) = (params.error().most(), Some(&stages));
            let cache = TileCache::new(capture, 2 * cache_bytes, params.cache_directory(), most, kept, monitor)?;
            prepared.layers.push(prepare_layer(capture.info(), &cache, params, sample, gpu, &stages)?);
            if captures.len() == 1 {
                prepared.images = cache.into_images();
            }
        }
        Ok(prepared)
    }

    /// Returns the asset, without description, whose residuals are quantised with `step` and have at most `components`
    /// components.
    pub fn asset(&self, step: f64, components: usize) -> Asset {
        assemble(&self.layers, step, self.grid, components, Coding::Predicted).asset
    }

    /// Returns about the step of an asset of `bytes` bytes.
    pub fn step_within_bytes(&self, bytes: usize) -> f64 {
        let texels = self.layers.iter().map(|layer| layer.model.coordinates.scores.nrows()).sum::<usize>();
        let models = self.layers.iter().flat_map(|layer| &layer.model.clusters);
        step_for(models, TexelGoal::Bytes(bytes as f64 / texels.max(1) as f64))
    }

    /// Returns the size of the greatest coefficient: steps are told relative to it.
    pub fn greatest_coefficient(&self) -> f64 {
        greatest_coefficient(&self.layers)
    }
}

/// Checks that captures can become layers of one asset: at least one, all with one texel grid and each of another side.
pub fn check_layers(captures: &[Capture]) -> Result<(), FitError> {
    let Some(first) = captures.first() else {
        return Err(FitError::Params("give at least one capture".to_string()));
    };
    let (width, height) = (first.info().width, first.info().height);
    if captures.len() > MAX_LAYERS {
        let path = captures[MAX_LAYERS].path_of(0, 0).into();
        return Err(FitError::Layers { path, reason: format!("an asset has at most {MAX_LAYERS} layers") });
    }
    for (number, capture) in captures.iter().enumerate() {
        let info = capture.info();
        let reason = if (info.width, info.height) != (width, height) {
            format!("it is {} x {} texels, the first is {width} x {height}", info.width, info.height)
        } else if captures[..number].iter().any(|other| other.info().side == info.side) {
            format!("it shows the same side as another, `{}`", info.side)
        } else {
            continue;
        };
        return Err(FitError::Layers { path: capture.path_of(0, 0).into(), reason });
    }
    Ok(())
}
